"""The folder of a study: the collected runs, and in `study/` the study file, the participants and their answers.

The runs are a data set. `study/answers/` has one file for each participant; `study/personal/` has the personal answers,
so that they can be moved or deleted separately.
"""

from __future__ import annotations

import shutil
import threading
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import orjson

from ..collect.collection import checked_name, require_collection_folder
from ..collect.rating import Rating, checked_rater
from ..core.files.locking import acquired_lock
from ..core.labels import LabelSpec
from ..core.wording import counted, shown
from ..errors import ConfigError, RecordError
from ..record.files import read_bytes, safe_stem, sha256_of, write_atomically
from .answers import AnswerLog, event_time, read_answers, state_of, time_of
from .load import Study
from .plan import rows_of
from .texts import with_texts

STUDY, ANSWERS, PERSONAL, RATED, PICTURES = "study", "answers", "personal", "rated", "pictures"
LOCK = "study.lock"
RECRUITMENT = "recruitment"  # step of the ids of a panel among the personal answers
_STATE = "study.json"
_ABSENT = {
    "must_reach_goal": False, "minimum_distance": 0.0, "check": [], "right": None, "screen_out": False,
    "until_right": False, "score": False,
}  # fmt: skip


class StudyFolder:
    """The files of a study.

    Args:
        out: folder of the runs; created if it does not exist.
        study: the study.

    Attributes:
        out: folder of the runs.
        participants: ids of the participants, in the order of their arrival.
        withdrawn: ids of the participants who have withdrawn, and whose data are deleted.
        rows: of the Latin square, by participant; of those without one, the row follows from the order of arrival.

    Raises:
        ConfigError: the folder belongs to a study with other steps, scenes or questions.
        RecordError: the folder holds something else, or cannot be read or written.
    """

    def __init__(self, out: str | Path, study: Study) -> None:
        self.out, self.study = Path(out), study
        self.participants: list[str] = []
        self.withdrawn: list[str] = []
        self.rows: dict[str, int] = {}
        self._versions: list[str] = []
        state = self.out / STUDY / _STATE
        structure = _structure_of(study)
        _make_folders(self.out)
        stored = _read_state(state) if state.exists() else None
        if stored is not None and _compared(stored["structure"]) != _compared(structure):
            if stored["participants"]:
                former, present = _compared(stored["structure"]), _compared(structure)
                people, change = len(stored["participants"]), _difference(former, present)
                raise ConfigError(
                    f"{self.out} belongs to another study, or to an earlier version of it"
                    f" ({counted(people, 'participant')}): {change};"
                    " texts of the study file may change, but no steps, scenes or questions: choose another folder"
                )
            self._remove_rated()  # without participants, the folder can take another study
            stored = None
        if stored is not None:
            self.participants, self._versions = stored["participants"], stored["versions"]
            self.withdrawn, self.rows = stored["withdrawn"], stored["rows"]
        self._structure, self._adding = structure, threading.RLock()
        self._by_external: dict[str, str] = {}  # participant by the first id of a panel
        for id in self.present if study.config.recruitment is not None else ():
            if key := next(iter(external_ids(read_answers(self.personal_of(id))).values()), ""):
                self._by_external[key] = id
        self._copy_rated()
        for picture in study.pictures.values():
            if not (copy := self.picture(picture.name)).exists():
                write_atomically(copy, read_bytes(picture.path))
        if study.sha256 not in self._versions:
            self._versions.append(study.sha256)
            copy = self.out / STUDY / f"study-{study.sha256[:8]}{study.path.suffix}"
            write_atomically(copy, read_bytes(study.path))
            self._write_state()

    @property
    def present(self) -> list[str]:
        """Ids of the participants who have not withdrawn."""
        return [id for id in self.participants if id not in self.withdrawn]

    def add(self, participant: str) -> int:
        """Add a participant, unless the id is known.

        Returns:
            The index of the participant, from 0, by which orders are balanced.

        Raises:
            ConfigError: the id is not usable.
            RecordError: the folder cannot be written.
        """
        participant = checked_name(participant)
        if participant in self.withdrawn:
            raise ConfigError(f"{participant} has withdrawn from the study; choose another id")
        if self.study.config.ratings:
            checked_rater(participant)
        with self._adding:  # the threads of a server take turns
            if participant not in self.participants:
                if rows_of(self.study.config) > 1:
                    places = self._places()
                    self.rows[participant] = self._least_used(places, places)
                self.participants.append(participant)
                try:
                    self._write_state()
                except RecordError:
                    self.participants.remove(participant)
                    self.rows.pop(participant, None)
                    raise
            return self.participants.index(participant)

    def add_next(self, taken: Container[str] = (), limit: int | None = None) -> str | None:
        """Add a participant with the next free id, such as `p001`.

        Args:
            taken: ids that are not free.
            limit: largest number of participants.

        Returns:
            The id; None if there are as many participants as the limit allows.

        Raises:
            RecordError: the folder cannot be written.
        """
        with self._adding:
            if limit is not None and len(self._places()) >= limit:
                return None
            number = len(self.participants) + 1
            while (id := f"p{number:03d}") in self.participants or id in taken:
                number += 1
            self.add(id)
            return id

    def recruit(self, ids: Mapping[str, str], taken: Container[str] = (), limit: int | None = None) -> str | None:
        """Add a participant of a panel, unless the person is known by the first id.

        Args:
            ids: that the panel gave, by name; they are stored among the personal answers.
            taken, limit: as of `add_next`.

        Returns:
            The participant; None if there is no place.

        Raises:
            RecordError: the folder cannot be written.
        """
        with self._adding:
            key = next(iter(ids.values()), "")
            if key and (known := self._by_external.get(key)) in self.present:
                return known
            id = self.add_next(taken, limit)
            if id is not None and any(ids.values()):
                facts: dict[str, Any] = {"event": "answers", "step": RECRUITMENT, "values": dict(ids)}
                AnswerLog(self.personal_of(id)).append(time=event_time(datetime.now(UTC)), **facts)
                self._by_external[key] = id
            return id

    @contextmanager
    def admission(self, participant: str, answer: Any) -> Iterator[bool]:
        """Whether a participant gets one of the places of the quota, with the least used row among the same answers.

        The answer has to be stored within the context: until then, others who give it wait.

        Args:
            participant: who has not driven yet.
            answer: to the question of the quota, as it is stored.

        Raises:
            RecordError: the folder cannot be written.
        """
        quota = self.study.config.quota
        assert quota is not None
        with self._adding:
            places = {id: k for id, k in self._places().items() if id != participant}
            others = {id: k for id, k in places.items() if self._answer_of(id, quota.question) == answer}
            if len(others) >= quota.places[int(answer) if isinstance(answer, bool) else answer - 1]:
                yield False
                return
            if rows_of(self.study.config) > 1:
                former, self.rows[participant] = self.rows.get(participant), self._least_used(others, places)
                try:
                    self._write_state()
                except RecordError:
                    self.rows |= {} if former is None else {participant: former}
                    raise
            yield True

    def quota(self) -> list[tuple[str, int, int]]:
        """Each answer of the quota: its name, the number of places that are taken, and of all places."""
        if (quota := self.study.config.quota) is None:
            return []
        with self._adding:
            taken = Counter(self._answer_of(id, quota.question) for id in self._places())
        words = self.study.tables[self.study.config.languages[0]]
        return [
            (words[f"question.{name}"] if isinstance(answer, bool) else name, taken[answer], places)
            for answer, name, places in self.study.config.quota_answers()
        ]

    def _answer_of(self, participant: str, question: str) -> Any:
        """The last answer of a participant to a demographic question; None without one.

        It is read where it is stored, which is among the personal answers by default, and kept nowhere else.
        """
        lines = [*read_answers(self.answers_of(participant)), *read_answers(self.personal_of(participant))]
        answers = [line["values"] for line in lines if line.get("step") == "demographics" and "values" in line]
        return next((values[question] for values in reversed(answers) if question in values), None)

    def _least_used(self, participants: Mapping[str, int], everybody: Mapping[str, int]) -> int:
        """The row that the fewest of some participants have; among equal ones, the fewest of all; by their numbers."""
        count = rows_of(self.study.config)
        used, in_all = (
            Counter(self.rows.get(id, k) % count for id, k in people.items()) for people in (participants, everybody)
        )
        return min(range(count), key=lambda row: (used[row], in_all[row], row))

    def _places(self) -> dict[str, int]:
        """Participants who hold a place, with their numbers: not those who declined, were screened out or are away."""
        recruitment, places = self.study.config.recruitment, dict[str, int]()
        minutes = recruitment.minutes if recruitment is not None else None
        for k, id in enumerate(self.participants):
            if id in self.withdrawn:
                continue
            events = read_answers(self.answers_of(id)) if self.answers_of(id).exists() else []
            state = state_of(events)
            is_away = False
            if state == "begun" and minutes is not None:
                is_away = datetime.now(UTC) - time_of(events[-1]) > timedelta(minutes=minutes)
            if state not in ("declined", "screened out", "full") and not is_away:
                places[id] = k
        return places

    def answers_of(self, participant: str) -> Path:
        """The file with the events and answers of a participant."""
        return self.out / STUDY / ANSWERS / f"{safe_stem(participant)}.jsonl"

    def personal_of(self, participant: str) -> Path:
        """The file with the personal answers of a participant."""
        return self.out / STUDY / PERSONAL / f"{safe_stem(participant)}.jsonl"

    def picture(self, name: str) -> Path:
        """The copy of a picture of the texts."""
        return self.out / STUDY / PICTURES / name

    def rated(self, block: int) -> Path:
        """The folder with copies of the runs that a block of ratings is about, and with the ratings."""
        return self.out / RATED / self.study.config.ratings[block].name

    def rating_spec(self, block: int, ratings: Iterable[Rating]) -> LabelSpec:
        """The question of a block of ratings in the first language, as files hold it.

        The wording of the first rating counts: if the study corrects it later, the ratings still belong together.

        Args:
            block: number of the block.
            ratings: the ratings of the block, of all participants.
        """
        spec = self.study.config.ratings[block].question.label()
        for rating in ratings:
            other = rating.spec
            if (other.name, other.kind, len(other.classes)) == (spec.name, spec.kind, len(spec.classes)):
                return other
        return spec

    def _copy_rated(self) -> None:
        """Copy the recorded runs to be rated into the folder."""
        for k, files in enumerate(self.study.rated):
            folder = self.rated(k)
            try:
                folder.mkdir(parents=True, exist_ok=True)
                for path in files:
                    copy = folder / path.name
                    if not copy.exists():
                        write_atomically(copy, read_bytes(path))
                    elif sha256_of(copy) != sha256_of(path):
                        raise ConfigError(f"{path} is not the run that {folder} has ratings of; choose another folder")
            except OSError as error:
                raise RecordError(f"{folder} cannot be written: {error.strerror or error}") from error

    def _remove_rated(self) -> None:
        """Delete the copies of the runs to be rated."""
        try:
            shutil.rmtree(self.out / RATED)
        except FileNotFoundError:
            pass
        except OSError as error:
            raise RecordError(f"{self.out / RATED} cannot be deleted: {error.strerror or error}") from error

    def _write_state(self) -> None:
        lists = {
            "versions": self._versions,
            "participants": self.participants,
            "withdrawn": self.withdrawn,
            "rows": self.rows,
        }
        write_state(self.out, {"structure": self._structure} | lists)


@contextmanager
def opened_folder(out: str | Path, study: Study) -> Iterator[StudyFolder]:
    """The folder of a study, locked for other programs.

    Raises:
        RecordError: another program uses it.
        ConfigError, RecordError: as of `StudyFolder`.
    """
    with locked(out):
        yield StudyFolder(out, study)


@contextmanager
def locked(out: str | Path) -> Iterator[None]:
    """The lock of a study's folder, as a context manager.

    Raises:
        RecordError: another program holds the lock, or the folder holds something else or cannot be written.
    """
    _make_folders(Path(out))
    lock = acquired_lock(Path(out) / STUDY / LOCK, f"another program uses {out}; stop it first")
    try:
        yield
    finally:
        lock.release()


def external_ids(lines: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """The ids of a panel among the personal answers of a participant."""
    return next((dict(line["values"]) for line in lines if line.get("step") == RECRUITMENT), {})


def _make_folders(out: Path) -> None:
    """Create the folder of a study, with its private part.

    Raises:
        RecordError: the folder holds something else or cannot be written.
    """
    require_collection_folder(out)
    try:
        (out / STUDY).mkdir(mode=0o700, parents=True, exist_ok=True)  # links and answers are for its owner only
    except OSError as error:
        raise RecordError(f"{out} cannot be written: {error.strerror or error}") from error


def require_outside(out: str | Path, path: str | Path) -> None:
    """Require a path outside the folder of a study, where the removal of a participant would leave data.

    Raises:
        ConfigError: the path is in the folder.
    """
    if Path(path).resolve().is_relative_to(Path(out).resolve()):
        raise ConfigError(
            f"{path} is in the folder of the study, which holds its data only; choose a path outside of it"
        )


def _difference(a: Any, b: Any, keys: tuple[str, ...] = ()) -> str:
    """The first key at which two structures differ, and the values there."""
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        a, b = dict(enumerate(a)), dict(enumerate(b))
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys((*a, *b)):
            if a.get(key) != b.get(key):
                return _difference(a.get(key), b.get(key), (*keys, str(key)))
    place = ".".join(key for key in keys if key != "config")
    return f"{place} was {shown(a)} and is {shown(b)}"


def _structure_of(study: Study) -> dict[str, Any]:
    """The part of a study that must not change once there are participants: settings without texts, and scenarios."""
    config = with_texts(study.config, lambda text: "")
    for key in ("texts", "participants", "quota", "recruitment", "requires"):
        del config[key]
    for block in config["runs"]:
        del block["label"]
    for entry in _entries(config):
        entry.pop("texts", None)
    scenarios = [scenario.settings() for scenario in (*study.scenarios, *([study.practice] if study.practice else []))]
    structure: dict[str, Any] = orjson.loads(orjson.dumps({"config": config, "scenarios": scenarios}))
    return _without_absent(structure)


def _compared(structure: dict[str, Any]) -> dict[str, Any]:
    """The part of a structure that must not change: without scores, which are computed anew from the answers."""
    structure = _without_absent(structure)
    for entry in _entries(structure["config"]):
        entry.pop("score", None)
    return structure


def _without_absent(structure: dict[str, Any]) -> dict[str, Any]:
    """A structure without settings that do nothing, which studies from before these settings lack."""
    structure = deepcopy(structure)
    config = structure["config"]
    practice = config["practice"] or {}
    for settings in (config, practice, *_entries(config), *(block["question"] for block in config["ratings"])):
        for key, absent in _ABSENT.items():
            if key in settings and settings[key] == absent:
                del settings[key]
    if "must_reach_goal" not in practice:
        practice.pop("attempts", None)
    return structure


def _entries(config: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The settings of all questions that participants answer."""
    check = (config["practice"] or {}).get("check", ())
    return [*config["demographics"], *check, *config["after_run"], *config["end"]]


def write_state(out: str | Path, state: dict[str, Any]) -> None:
    """Store what `read_state` returns.

    Raises:
        RecordError: the folder cannot be written.
    """
    write_atomically(Path(out) / STUDY / _STATE, orjson.dumps({"version": 1} | state, option=orjson.OPT_INDENT_2))


def read_state(out: str | Path) -> dict[str, Any]:
    """The structure and the participants of a study, and the hashes of the versions of its file.

    Raises:
        RecordError: the folder is not the folder of a study.
    """
    state = Path(out) / STUDY / _STATE
    if not state.exists():
        raise RecordError(f"{out} is not the folder of a study: it has no {STUDY}/{_STATE}")
    return _read_state(state)


def _read_state(path: Path) -> dict[str, Any]:
    try:
        state = orjson.loads(read_bytes(path))
        if state["version"] != 1:
            raise ValueError(f"version {state['version']} is unknown; upgrade sonata2d")
        if not all(isinstance(state[key], list) for key in ("participants", "versions", "withdrawn")):
            raise TypeError("participants, versions and withdrawn are lists")
        stored = {key: state[key] for key in ("structure", "versions", "participants", "withdrawn")}
        return stored | {"rows": dict(state.get("rows", {}))}
    except (KeyError, TypeError, ValueError) as error:
        raise RecordError(f"{path} is damaged: {error}") from error
