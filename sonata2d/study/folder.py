"""The folder of a study: the collected runs, and in `study/` the study file, the participants and their answers.

The runs are a data set like any other. `study/answers/` has one file for each participant; `study/personal/` has the
personal answers, so that they can be kept elsewhere, or deleted, without touching anything else.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import orjson

from ..collect.collection import checked_name
from ..core.wording import counted
from ..errors import ConfigError, RecordError
from ..record.files import read_bytes, safe_stem, sha256_of, write_atomically
from .config import texts_in
from .load import Study

STUDY, ANSWERS, PERSONAL, RATED = "study", "answers", "personal", "rated"
_STATE = "study.json"


class StudyFolder:
    """The files of a study.

    Args:
        out: folder of the runs; created if it does not exist.
        study: the study.

    Attributes:
        out: folder of the runs.
        participants: ids of the participants, in the order of their arrival.

    Raises:
        ConfigError: the folder belongs to a study with other steps, scenes or questions.
        RecordError: the folder cannot be read or written.
    """

    def __init__(self, out: str | Path, study: Study) -> None:
        self.out, self.study = Path(out), study
        self.participants: list[str] = []
        self._versions: list[str] = []
        state = self.out / STUDY / _STATE
        structure = structure_of(study)
        try:
            self.out.mkdir(parents=True, exist_ok=True)
            (self.out / STUDY).mkdir(mode=0o700, exist_ok=True)  # answers and links are for its owner only
        except OSError as error:
            raise RecordError(f"{self.out} cannot be written: {error.strerror or error}") from error
        if state.exists():
            stored = _read_state(state)
            if stored["structure"] != structure:
                raise ConfigError(
                    f"{self.out} belongs to another study, or to an earlier version of it with other steps, scenes or"
                    f" questions ({counted(len(stored['participants']), 'participant')}); texts may change, the rest"
                    " may not: choose another folder"
                )
            self.participants, self._versions = stored["participants"], stored["versions"]
        self._structure = structure
        self._copy_rated()
        if study.sha256 not in self._versions:
            self._versions.append(study.sha256)
            copy = self.out / STUDY / f"study-{study.sha256[:8]}{study.path.suffix}"
            write_atomically(copy, read_bytes(study.path))
        self._write_state()

    def add(self, participant: str) -> int:
        """Add a participant, unless the id is known.

        Returns:
            The index of the participant, from 0, by which orders are balanced.

        Raises:
            ConfigError: the id is not usable.
            RecordError: the folder cannot be written.
        """
        participant = checked_name(participant)
        if participant not in self.participants:
            self.participants.append(participant)
            try:
                self._write_state()
            except RecordError:
                self.participants.remove(participant)
                raise
        return self.participants.index(participant)

    def answers_of(self, participant: str) -> Path:
        """The file with what a participant has done and answered."""
        return self.out / STUDY / ANSWERS / f"{safe_stem(participant)}.jsonl"

    def personal_of(self, participant: str) -> Path:
        """The file with the personal answers of a participant."""
        return self.out / STUDY / PERSONAL / f"{safe_stem(participant)}.jsonl"

    def rated(self, block: int) -> Path:
        """The folder with copies of the runs that a block of ratings is about, and with the ratings."""
        return self.out / RATED / self.study.config.ratings[block].name

    def _copy_rated(self) -> None:
        """Copy the recorded runs to be rated, so that the folder has all that the ratings are about."""
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

    def _write_state(self) -> None:
        state = {"version": 1, "structure": self._structure, "versions": self._versions}
        write_atomically(
            self.out / STUDY / _STATE,
            orjson.dumps(state | {"participants": self.participants}, option=orjson.OPT_INDENT_2),
        )


def structure_of(study: Study) -> dict[str, Any]:
    """What must not change while participants take part: the settings without their texts, and the scenarios."""
    config = study.config.model_dump(mode="json")
    for path, _ in texts_in(study.config):
        *parents, last = path
        place: Any = config
        for key in parents:
            place = place[key]
        place[last] = ""
    for key in ("texts", "participants"):
        del config[key]
    for block in config["runs"]:
        del block["label"]
    for section in ("demographics", "after_run", "end"):
        for entry in config[section]:
            entry.pop("texts", None)
    scenarios = [scenario.settings() for scenario in (*study.scenarios, *([study.practice] if study.practice else []))]
    structure: dict[str, Any] = orjson.loads(orjson.dumps({"config": config, "scenarios": scenarios}))
    return structure


def read_state(out: str | Path) -> dict[str, Any]:
    """The participants of a study, and the hashes of the versions of its file.

    Raises:
        RecordError: the folder is not that of a study.
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
        if not all(isinstance(state[key], list) for key in ("participants", "versions")):
            raise TypeError("participants and versions are lists")
        return {key: state[key] for key in ("structure", "versions", "participants")}
    except (KeyError, TypeError, ValueError) as error:
        raise RecordError(f"{path} is damaged: {error}") from error
