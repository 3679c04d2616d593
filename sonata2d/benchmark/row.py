"""Rows: folders with the scores of a controller, the hashes and commands of all its episodes, and its files.

A row holds `row.json` (scores; the same bytes on every machine), `episodes.json` (values and hashes of all scenes),
`commands.npz` (from which the episodes are replayed), `controller/` (its files), `run.json` (what is true of this run
only, such as its duration) and `README.md` (the card, which its authors complete).
"""

from __future__ import annotations

import io
import re
import shutil
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import orjson

from ..agents.controllers.base import Controller
from ..agents.controllers.loading import ControllerSource, split_pair
from ..core.arguments import whole_number
from ..core.files.archives import read_npz
from ..core.files.limits import MAX_WEIGHTS_BYTES
from ..core.files.reading import read_at_most
from ..core.notebook import ProgressBar, bar_of
from ..core.wording import counted, shown
from ..errors import BenchmarkError, ConfigError, ControllerError
from ..record.files import sha256_of, write_atomically
from ..record.layout import software_versions
from ..registry import CONTROLLERS
from ..workers.executors import Workers, parallel_map, shared_workers
from ..workers.processes import end_if_unguarded
from .isolated import Isolated, files_of
from .run import RECORDED_PERSON, Past, Run, Runner, Task, tasks_of
from .scorers import MODELS, checked_scorers
from .scoring import FRONT, SCORES, summary, third_of
from .suite import Suite, Track, commitment, joint_sha256, load_suite, quarters_of, require_track

ROW, EPISODES, COMMANDS, RUN, CARD = "row.json", "episodes.json", "commands.npz", "run.json", "README.md"
FILES, _PARTS, _PLAN = "controller", ".parts", "plan.json"
_FORMAT, _VERSION = "sonata2d-benchmark-row", 1
_MOST_JSON = 1 << 28  # bytes
_ENOUGH = 3  # entries in which a controller fails, after which a run stops: its robot may be unfit for one

Badge = Literal["replayed", "re-run", "hidden"]


@dataclass(frozen=True, slots=True)
class Plan:
    """Everything that determines a row.

    Attributes:
        suite: its name.
        suite_sha256: hash of its file.
        track: what the controller observes.
        seeds: name of the seeds.
        seed: of the scenes; None in the row of hidden seeds.
        commitment: of hidden seeds; None of others.
        controller: its name.
        files: hashes of its files by name.
        parts: names of parts or entries; empty: the whole suite.
        scenes: largest number of scenes of each entry; None: all.
        scorers: names of learned scores, and of the files of models.
        models: hashes of these files by name.
    """

    suite: str
    suite_sha256: str
    track: Track
    seeds: str
    seed: int | None
    commitment: str | None
    controller: str
    files: dict[str, str]
    parts: tuple[str, ...]
    scenes: int | None
    scorers: tuple[str, ...]
    models: dict[str, str]

    @property
    def is_complete(self) -> bool:
        """Whether the row has all scenes of the suite."""
        return not self.parts and self.scenes is None

    def to_json(self) -> dict[str, Any]:
        """As rows hold it."""
        return {key: getattr(self, key) for key in self.__dataclass_fields__}

    @classmethod
    def from_json(cls, values: Any) -> Plan:
        """The plan of a row.

        Raises:
            BenchmarkError: it is no plan.
        """
        try:
            given = {key: values[key] for key in cls.__dataclass_fields__}
            for key, kinds in _KINDS.items():
                if not isinstance(given[key], kinds):
                    raise TypeError(f"{key} is {shown(given[key])}")
            given |= {key: tuple(map(_text, given[key])) for key in ("parts", "scorers")}
            for key in ("files", "models"):
                given[key] = {_file_name(name): _text(value) for name, value in given[key].items()}
            plan = cls(**given)
        except (KeyError, TypeError, ValueError) as error:
            raise BenchmarkError(f"the row does not say how it was made: {error!r:.200}") from None
        require_track(plan.track)
        if loose := [name for name in plan.scorers if name.endswith(MODELS) and name not in plan.models]:
            raise BenchmarkError(f"the row does not hold the model {loose[0]}")
        return plan


_KINDS: dict[str, Any] = {
    "suite": str, "suite_sha256": str, "track": str, "seeds": str, "seed": int | None, "commitment": str | None,
    "controller": str, "files": dict, "parts": list, "scenes": int | None, "scorers": list, "models": dict,
}  # fmt: skip


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{shown(value)} is no text")
    return value


def _file_name(name: str) -> str:
    """A name of a file without a folder, so that a row names files of its own only."""
    if name != Path(name).name or "\\" in name or name in ("", ".", ".."):
        raise ValueError(f"{name!r} is no name of a file")
    return name


@dataclass(frozen=True, slots=True)
class Verification:
    """Result of the verification of a row.

    Attributes:
        badges: that the row has earned.
        problems: descriptions; empty: none.
        scenes: number of scenes that were checked.
    """

    badges: tuple[Badge, ...]
    problems: tuple[str, ...]
    scenes: int


def run_benchmark(
    controller: str | Controller | type[Controller],
    out: str | Path,
    *,
    suite: str = "s2b-1",
    track: Track = "state",
    seeds: str = "test",
    seed: int = 1,
    secret: bytes | None = None,
    parts: Sequence[str] = (),
    scenes: int | None = None,
    scorers: Sequence[str] = (),
    recordings: str | Path | None = None,
    workers: int | Executor | Workers = 1,
    progress: bool | ProgressBar | None = None,
) -> Path:
    """Run a controller in all scenes of a suite, in a process of its own, and write a row.

    The same call continues a row that was interrupted.

    Args:
        controller: a name as on the command line, a class, or an object.
        out: folder of the row.
        suite: name of the suite.
        track: `state`, `sees` or `lidar`.
        seeds: `dev`, `test`, `hidden`, or a quarter that was revealed.
        seed: of `dev`.
        secret: of `hidden`.
        parts: names of parts or entries, for trials; empty: all.
        scenes: largest number of scenes of each entry, for trials; None: all.
        scorers: names of learned scores, or paths of models; the Pareto front ignores their columns.
        recordings: folder with the recordings of a suite that needs some.
        workers: number of processes; or an executor, or workers that several calls share, see `sonata2d.Workers`.
        progress: as of `sonata2d.evaluate`.

    Returns:
        The path of `row.json`.

    Raises:
        BenchmarkError: the suite, track, seeds or a part are unknown, the folder holds another row, or the controller
            breaks a rule.
        ControllerError: the controller cannot be loaded, or fails in all of the first scenes.
        ConfigError: there is no such learned score.
        WorkerError: a worker crashed or was killed.
    """
    end_if_unguarded()
    place_of = None if recordings is None else str(Path(recordings).absolute())
    chosen, source = load_suite(suite, place_of), ControllerSource(controller)
    chosen.require_versions()
    require_track(track)
    models = checked_scorers(scorers)
    if scenes is not None:
        scenes = whole_number("scenes", scenes, 1)
    drawn = chosen.seed_of(seeds, secret, seed)
    files = files_of(source.name) if isinstance(controller, str) else []
    if shared := models.keys() & {path.name for path in files}:
        raise ConfigError(
            f"a file of the controller and one of a learned score are both named {min(shared)}; rename one"
        )
    plan = Plan(
        suite=suite,
        suite_sha256=chosen.sha256,
        track=track,
        seeds=seeds,
        seed=None if seeds == "hidden" else drawn,
        commitment=commitment(secret) if seeds == "hidden" and secret is not None else None,
        controller=public_name(source.name),
        files={path.name: sha256_of(path) for path in files},
        parts=tuple(parts),
        scenes=scenes,
        scorers=tuple(Path(name).name if name.endswith(MODELS) else name for name in scorers),
        models=models,
    )
    chosen = chosen.chosen(plan.parts, plan.scenes)
    folder = Path(out)
    place = _begun(folder, plan)
    for path in (*files, *(Path(name) for name in scorers if name.endswith(MODELS))):
        (folder / FILES).mkdir(exist_ok=True)
        shutil.copyfile(path, folder / FILES / path.name)
    own_scorers = _scorers_in(folder, plan)
    runner = Runner(suite, drawn, plan.controller, track, source, own_scorers, place_of)
    start = time.time()
    runs = _runs(runner, tasks_of(chosen.entries), workers, bar_of(progress), place)
    _check_scenes(chosen, load_suite(suite, place_of), runs, plan)
    row = row_of(chosen, plan, runs)
    _write(folder, row, runs, {"seconds": round(time.time() - start, 1), "software": software_versions()})
    shutil.rmtree(place)
    return folder / ROW


def verify_row(
    folder: str | Path,
    *,
    rerun: bool = False,
    secret: bytes | None = None,
    recordings: str | Path | None = None,
    workers: int | Executor | Workers = 1,
    progress: bool | ProgressBar | None = None,
) -> Verification:
    """Verify a row: replay the commands of all its episodes, and run its controller again.

    Args:
        folder: of the row.
        rerun: whether to run the controller, whose code is in the row; only for rows that you trust that far.
        secret: of hidden seeds.
        recordings, workers, progress: as of `run_benchmark`.

    Raises:
        BenchmarkError: the folder holds no row, or a row of another suite, physics or version.
    """
    end_if_unguarded()
    place = Path(folder)
    row, stored, pasts = _read(place)
    plan = Plan.from_json(row.get("plan"))
    place_of = None if recordings is None else str(Path(recordings).absolute())
    whole = load_suite(plan.suite, place_of)
    whole.require_versions()
    if plan.suite_sha256 != whole.sha256:
        raise BenchmarkError(f"the row is of another version of {plan.suite} than this package")
    seed = _seed_of(plan, whole, secret)
    chosen = whole.chosen(plan.parts, plan.scenes)
    name = _name_in(place, plan) if rerun else ""  # before a replay that takes minutes
    if len(pasts) != chosen.count:
        raise BenchmarkError(f"the row has {counted(len(pasts), 'episode')}, and its suite {chosen.count}")
    problems = _file_problems(place, plan)
    if problems:
        return Verification((), tuple(problems), 0)
    own_scorers = _scorers_in(place, plan)
    bar = bar_of(progress)
    replayer = Runner(plan.suite, seed, plan.controller, plan.track, None, own_scorers, place_of)
    with shared_workers(workers) as pool:
        runs = _runs(replayer, tasks_of(chosen.entries, pasts), pool, bar, None)
        # whether an answer was late cannot be replayed; only a new run shows it
        late = [each["late"] for each in stored]
        runs = [run._replace(late=tuple(ticks)) for run, ticks in zip(runs, late, strict=True)]
        problems += _differences(stored, runs)
        if not problems and orjson.dumps(row_of(chosen, plan, runs)) != orjson.dumps(row):
            problems.append(f"{ROW} does not hold the scores of its episodes")
        badges: list[Badge] = [] if problems else ["replayed"]
        if badges and rerun:
            source = ControllerSource(name)
            again = Runner(plan.suite, seed, plan.controller, plan.track, source, own_scorers, place_of)
            reruns = _runs(again, tasks_of(chosen.entries), pool, bar, None)
            problems += _rerun_problems(chosen, plan, runs, reruns, is_exact=_is_deterministic(source, plan))
            if not problems:
                badges += ["re-run", "hidden"] if _is_announced(plan) else ["re-run"]
    return Verification(tuple(badges), tuple(problems), len(runs))


def row_of(suite: Suite, plan: Plan, runs: Sequence[Run]) -> dict[str, Any]:
    """The content of `row.json`: what is the same on every machine."""
    part_of = {entry.name: entry.part for entry in suite.entries}
    thirds = [third_of(run.difficulty, suite.thirds[part_of[run.entry]]) for run in runs]

    def scores(*parts: str) -> dict[str, Any]:
        own = [k for k, run in enumerate(runs) if part_of[run.entry] in parts]
        return summary([runs[k].values for k in own], [thirds[k] for k in own])

    parts = list(dict.fromkeys(part_of.values()))
    return {
        "format": _FORMAT,
        "version": _VERSION,
        "plan": plan.to_json(),
        "complete": plan.is_complete,
        "late": sum(len(run.late) for run in runs),
        "failed": sum(run.has_failed for run in runs),
        "all": scores(*parts),
        "parts": {part: scores(part) for part in parts},
        "episodes_sha256": joint_sha256([run.sha256 for run in runs]),
    }


def public_name(name: str) -> str:
    """The name of a controller without the folders of its files."""
    parts = (part for part in split_pair(name) if part)
    return "+".join(re.split(r"[/\\]", part)[-1] for part in parts)


def _name_in(folder: Path, plan: Plan) -> str:
    """The name of the controller of a row, with its files in the row.

    Raises:
        BenchmarkError: the row has neither its files nor the name of a stock controller.
    """
    parts = []
    for part in split_pair(plan.controller):
        if not part:
            continue
        file = part if part in plan.files else part.rpartition(":")[0]
        if file in plan.files:
            parts.append(str(folder / FILES / part))
        elif part in CONTROLLERS or part == RECORDED_PERSON or part.startswith("sonata2d."):
            parts.append(part)
        else:
            raise BenchmarkError(f"the row does not contain the controller {part!r}; it can be replayed, not run")
    return "+".join(parts)


def _scorers_in(folder: Path, plan: Plan) -> tuple[str, ...]:
    """The learned scores of a row, with the files of models in the row."""
    place = (folder / FILES).absolute()
    return tuple(str(place / name) if name in plan.models else name for name in plan.scorers)


def _begun(folder: Path, plan: Plan) -> Path:
    """The folder of a row that is begun or continued; returns the place of its finished tasks.

    Raises:
        BenchmarkError: it holds a row, or the beginning of another one.
    """
    place = folder / _PARTS
    if (folder / ROW).exists():
        raise BenchmarkError(f"{folder} holds a row already; choose another folder, or delete it")
    content = orjson.dumps(plan.to_json(), option=orjson.OPT_INDENT_2)
    file = place / _PLAN
    if file.exists() and file.read_bytes() != content and not any(place.glob("[0-9]*.json")):
        shutil.rmtree(place)  # nothing was run: an earlier start failed
        shutil.rmtree(folder / FILES, ignore_errors=True)
    if file.exists() and file.read_bytes() != content:
        raise BenchmarkError(f"{folder} holds the beginning of another row; choose another folder, or delete it")
    if folder.exists() and not folder.is_dir():
        raise BenchmarkError(f"{folder} is a file; choose another folder")
    if not file.exists() and folder.exists() and any(folder.iterdir()):
        raise BenchmarkError(f"{folder} is not empty; choose another folder")
    place.mkdir(parents=True, exist_ok=True)
    write_atomically(file, content)
    return place


def _runs(
    runner: Runner, tasks: Sequence[Task], workers: int | Executor | Workers, bar: ProgressBar, place: Path | None
) -> list[Run]:
    """The runs of all tasks; of a row that is continued, some from files."""
    found = {} if place is None else _kept_runs(place, len(tasks))
    missing = [k for k in range(len(tasks)) if k not in found]
    total = sum(task.scenes for task in tasks)
    with bar(total, "scenes") as advance, closing(runner):
        advance(sum(tasks[k].scenes for k in found))
        results = parallel_map(runner, [tasks[k] for k in missing], workers=workers)
        for k, runs in zip(missing, results, strict=True):
            found[k] = runs
            _stop_if_useless(runner.name, found)
            if place is not None:
                _keep(place, k, runs)
            advance(len(runs))
    return [run for k in range(len(tasks)) for run in found[k]]


def _stop_if_useless(name: str, found: dict[int, list[Run]]) -> None:
    """Stop if the controller has failed in all scenes of several entries: it does not work at all.

    Raises:
        ControllerError: it has.
    """
    runs = [run for each in found.values() for run in each]
    if all(run.has_failed for run in runs) and len({run.entry for run in runs}) >= _ENOUGH:
        raise ControllerError(f"{name} failed in all of the first {len(runs)} scenes: {runs[0].reason}")


def _keep(place: Path, k: int, runs: Sequence[Run]) -> None:
    rows = [run._asdict() | {"commands": run.commands.hex()} for run in runs]
    write_atomically(place / f"{k:04d}.json", orjson.dumps(rows))


def _kept_runs(place: Path, count: int) -> dict[int, list[Run]]:
    """The runs of finished tasks by the number of the task, of which there are `count`."""
    return {k: runs for k in range(count) if (runs := _kept(place, k)) is not None}


def _kept(place: Path, k: int) -> list[Run] | None:
    try:
        rows = orjson.loads((place / f"{k:04d}.json").read_bytes())
    except (OSError, orjson.JSONDecodeError):
        return None
    made = (row | {"commands": bytes.fromhex(row["commands"]), "late": tuple(row["late"])} for row in rows)
    return [Run(**row) for row in made]


def _check_scenes(suite: Suite, whole: Suite, runs: Sequence[Run], plan: Plan) -> None:
    """Require the scenes of the suite; those of the test seed are known.

    Raises:
        BenchmarkError: this installation generates others.
    """
    if plan.seeds != "test":
        return
    for entry in suite.entries:
        hashes = [run.scene for run in runs if run.entry == entry.name]
        is_whole = len(hashes) == whole.entry(entry.name).scenes
        if is_whole and joint_sha256(hashes) != suite.scenes_sha256[entry.name]:
            raise BenchmarkError(
                f"this installation generates other scenes of {entry.name} than {suite.name} has; "
                "run `sonata2d doctor`, and report it"
            )


def _write(folder: Path, row: dict[str, Any], runs: Sequence[Run], about: dict[str, Any]) -> None:
    episodes = [run.to_json() for run in runs]
    write_atomically(folder / EPISODES, b"[\n" + b",\n".join(map(orjson.dumps, episodes)) + b"\n]\n")
    packed = io.BytesIO()
    commands = np.frombuffer(b"".join(run.commands for run in runs), dtype="<i4").reshape(-1, 3)
    np.savez_compressed(packed, commands=commands, ticks=np.array([run.ticks for run in runs], dtype="<i4"))
    write_atomically(folder / COMMANDS, packed.getvalue())
    write_atomically(folder / RUN, orjson.dumps(about, option=orjson.OPT_INDENT_2) + b"\n")
    if not (folder / CARD).exists():
        write_atomically(folder / CARD, _card(row).encode())
    write_atomically(folder / ROW, orjson.dumps(row, option=orjson.OPT_INDENT_2) + b"\n")


def _card(row: dict[str, Any]) -> str:
    plan, strict = row["plan"], row["all"]["strict"]["value"]
    return (
        f"# {plan['controller']} in {plan['suite']}\n\n"
        f"Track {plan['track']}, seeds {plan['seeds']}: {strict:.1%} of {row['all']['scenes']} scenes strict.\n\n"
        "- Authors:\n- Paper or page:\n- Training data and seeds:\n- Compute of the training:\n- Licence:\n"
    )


def read_row(folder: str | Path) -> dict[str, Any]:
    """The content of `row.json` in a folder.

    Raises:
        BenchmarkError: there is none, or it cannot be read.
    """
    row = _json(Path(folder), ROW)
    if not isinstance(row, dict) or row.get("format") != _FORMAT:
        raise BenchmarkError(f"{Path(folder) / ROW} is no row of a benchmark")
    if row.get("version") != _VERSION:
        raise BenchmarkError(f"{Path(folder) / ROW} is a row of version {row.get('version')!r}, not of {_VERSION}")
    Plan.from_json(row.get("plan"))
    if not isinstance(row.get("parts"), dict) or not isinstance(row.get("all"), dict):
        raise BenchmarkError(f"{Path(folder) / ROW} has no scores")
    return row


def _read(folder: Path) -> tuple[dict[str, Any], list[dict[str, Any]], list[Past]]:
    """Row, episodes and commands.

    Raises:
        BenchmarkError: a file is missing or invalid.
    """
    row, episodes = read_row(folder), _json(folder, EPISODES)
    try:
        content = read_at_most(folder / COMMANDS, MAX_WEIGHTS_BYTES)
        arrays = read_npz(content, MAX_WEIGHTS_BYTES, ["commands", "ticks"])
        commands, ticks = arrays["commands"].astype("<i4"), arrays["ticks"].astype(int)
        ends = np.cumsum(ticks)
        if commands.ndim != 2 or commands.shape[1] != 3 or (ticks < 0).any() or ends[-1:].sum() != len(commands):
            raise ValueError("the numbers of ticks do not belong to the commands")
        pasts = [
            Past(commands[end - count : end].tobytes(), str(each["status"]), str(each["reason"]))
            for end, count, each in zip(ends, ticks, episodes, strict=True)
        ]
        for each in episodes:
            if {"entry", "episode", "sha256", "late"} - set(each) or not isinstance(each["late"], list):
                raise ValueError("an episode is not complete")
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise BenchmarkError(f"{folder} is no complete row: {error}") from None
    return row, episodes, pasts


def _json(folder: Path, name: str) -> Any:
    try:
        return orjson.loads(read_at_most(folder / name, _MOST_JSON))
    except OSError:
        raise BenchmarkError(f"{folder} has no {name}; it is no row, or one that is not finished") from None
    except ValueError as error:
        raise BenchmarkError(f"{folder / name} is no JSON file: {error}") from None


def _seed_of(plan: Plan, suite: Suite, secret: bytes | None) -> int:
    """The seed of a row.

    Raises:
        BenchmarkError: the secret is missing or another one, or the row names another seed than its seeds have.
    """
    if plan.seeds == "hidden":
        if secret is None:
            raise BenchmarkError("the row has hidden seeds, and is verified with the secret of their quarter")
        if commitment(secret) != plan.commitment:
            raise BenchmarkError("the row was made with another secret")
        return suite.hidden_seed(secret)
    if not isinstance(plan.seed, int):
        raise BenchmarkError(f"the row has no seed, got {shown(plan.seed)}")
    seed = suite.seed_of(plan.seeds, seed=plan.seed)
    if seed != plan.seed:
        raise BenchmarkError(f"the seeds {plan.seeds} have the seed {seed}, and the row {plan.seed}")
    return seed


def _file_problems(folder: Path, plan: Plan) -> list[str]:
    known = plan.files | plan.models
    present = [path.name for path in (folder / FILES).iterdir()] if (folder / FILES).is_dir() else []
    problems = [f"{FILES}/{name} was not part of the run" for name in sorted(present) if name not in known]
    for name, sha256 in known.items():
        path = folder / FILES / Path(name).name
        if not path.is_file():
            problems.append(f"{FILES}/{name} is missing")
        elif sha256_of(path) != sha256:
            problems.append(f"{FILES}/{name} is another file than the one that was run")
    return problems


def _differences(stored: Sequence[dict[str, Any]], runs: Sequence[Run]) -> list[str]:
    """The scenes whose replay differs from the row, at most five."""
    problems = []
    for each, run in zip(stored, runs, strict=True):
        if (each["entry"], each["episode"]) != (run.entry, run.episode):
            return [f"episode {run.episode} of {run.entry} is not where it belongs"]
        present = orjson.loads(orjson.dumps(run.to_json()))
        wrong = [key for key, value in present.items() if each.get(key) != value]
        if wrong:
            problems.append(f"episode {run.episode} of {run.entry}: a replay gives another {', '.join(wrong)}")
    return [*problems[:5], *([f"and {len(problems) - 5} more"] if len(problems) > 5 else [])]


def _rerun_problems(
    suite: Suite, plan: Plan, runs: Sequence[Run], again: Sequence[Run], *, is_exact: bool
) -> list[str]:
    """Problems of a second run: other commands; of a controller that draws at random, scores beyond the intervals.

    Scenes with late answers are left out of the comparison of commands: which ones are late depends on the machine.
    """
    pairs = [(first, second) for first, second in zip(runs, again, strict=True) if not first.late and not second.late]
    others = sum(first.commands != second.commands for first, second in pairs)
    if others and is_exact:
        return [f"the controller gives other commands in {counted(others, 'scene')} of a second run"]
    if not others:
        return []
    first, second = row_of(suite, plan, runs)["all"], row_of(suite, plan, again)["all"]
    for name in FRONT:
        group = SCORES[name].group
        found, value = first[group][name], second[group][name]["value"]
        if found["low"] is not None and not found["low"] <= value <= found["high"]:
            return [
                f"a second run has {name} {value:.3f}, outside of the interval of the row, {found['low']:.3f} to "
                f"{found['high']:.3f}"
            ]
    return []


def _is_deterministic(source: ControllerSource, plan: Plan) -> bool:
    """Whether a controller says that equal snapshots give equal commands."""
    if plan.controller == RECORDED_PERSON:
        return True
    driver = Isolated(source, plan.track)
    try:
        return driver.is_deterministic
    finally:
        driver.close()


def _is_announced(plan: Plan) -> bool:
    """Whether a row has hidden seeds whose commitment the package announces."""
    known = {quarter["commitment"] for quarter in quarters_of(plan.suite).values()}
    return plan.seeds == "hidden" and plan.commitment in known
