# ruff: noqa: E501 (lists of words)
"""The readers and commands that cases call, by kind of input."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from click.testing import CliRunner

from ..formats.layouts import LAYOUTS

Use = Callable[[Path], None]  # gives a damaged file to a reader; raises as the reader does


class Refusal(Exception):
    """A command ended with an error message."""


@dataclass(frozen=True)
class Kind:
    """A kind of input.

    Attributes:
        damaged: patterns of the files in the sample folder, one of which is damaged.
        uses: readers and commands, one of which is called with the damaged file, or with the data set it lies in.
        folder: name of the sample folder, if it is not that of the kind.
    """

    damaged: tuple[str, ...]
    uses: tuple[Use, ...]
    folder: str = ""


def run(words: str, path: Path) -> None:
    """Run a command line, in which F is the damaged file, D its folder, S its scenario and O another data set.

    Raises:
        Refusal: the command ended with a message.
        Exception: it ended with another exception, which is a failure.
    """
    from cli.interrupts import EXIT_BUG
    from cli.main import main

    places = {
        "F": str(path),
        "D": str(path.parent),
        "O": str(path.parent.parent / "other"),
        "S": str(path.parent / "scenario.json"),
    }
    line = [places.get(word, word) for word in shlex.split(words)]
    result = CliRunner().invoke(main, line, prog_name="sonata2d")
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    if result.exit_code == EXIT_BUG or "Traceback" in result.output:
        raise AssertionError(result.output[-500:])
    if result.exit_code:
        raise Refusal(result.output)


def commands(*lines: str) -> tuple[Use, ...]:
    return tuple(partial(run, line) for line in lines)


def read_everything(path: Path) -> None:
    """Restore all that a record holds, and what the window shows of it."""
    from sonata2d.record.motion import motion_of
    from sonata2d.record.reader import read_episode
    from sonata2d.window.playback import Player
    from sonata2d.window.run_texts import frame_label, frame_summary, run_summary

    record = read_episode(path)
    for index, _ in enumerate(record.frames()):
        frame_summary(record, record.snapshot(index), index)
        frame_label(record, index)
    record.labels, record.label_spec, record.controller_info, run_summary(record), repr(record)
    motion_of(record)
    player = Player(record)
    player.contacts()
    player.advance(0.5)
    player.moment  # noqa: B018


def few_ticks(path: Path) -> None:
    """Generate the scene of a scenario, and run a few ticks; a whole episode may be as long as the scenario says."""
    import sonata2d as s2
    from sonata2d.scenegen.scenario.load import load_scenario

    scene = s2.generate(load_scenario(str(path)), seed=1)
    recorder = s2.EpisodeRecorder(id="fuzz")
    episode = s2.Episode(scene, s2.SocialForce(), observers=[recorder])
    for _ in range(5):
        if episode.outcome is None:
            episode.step()
    if episode.outcome is None:
        episode.end("stopped", "enough")
    recorder.document()


def weights(path: Path) -> None:
    import sonata2d as s2
    from sonata2d.agents.controllers.loading import load_controller

    controller = load_controller(str(path))
    scene = s2.generate(s2.ScenarioConfig(standing=1, wandering=1), seed=1)
    episode = s2.Episode(scene, controller)
    episode.step()
    episode.step()


def collected(path: Path) -> None:
    from sonata2d.collect.journal import read_journal
    from sonata2d.window.profiles import read_profiles

    if path.suffix == ".toml":
        read_profiles(path)
    else:
        read_journal(path)


def study(path: Path) -> None:
    """Read a study file, and list the steps of its first participants."""
    from sonata2d.study.load import load_study
    from sonata2d.study.plan import steps_of

    read = load_study(path)
    for participant in range(2):
        steps_of(read.config, participant)
    read.config.untranslated()


def message(path: Path) -> None:
    """Read a message of a participant's page, and of the researcher's page."""
    from sonata2d.web.messages import parse_message

    if not path.is_file():
        raise Refusal("the path was damaged, and messages have none")
    refused = 0
    for of_researcher in (False, True):
        try:
            parse_message(path.read_bytes(), of_researcher=of_researcher)
        except ValueError as error:
            if "\n" in str(error):
                raise AssertionError("the refusal has several lines") from error
            refused += 1
    if refused == 2:
        raise Refusal("neither page sends it")


def imported(name: str, path: Path) -> None:
    """Import a file; what is made of it must be a valid episode."""
    from sonata2d.datasets import verify
    from sonata2d.formats.api import import_from
    from sonata2d.formats.format import Options
    from sonata2d.record.reader import read_episode

    source = path.parent if name == "parquet" else path.parent / "000000.csv" if name == "csv" else path
    options: dict[str, Any] = {"frame_time": 0.1} if name in ("csv", "trajnet") else {}
    if name == "tracks":
        options = next((layout.options for layout in LAYOUTS if layout.name == path.name), {})
    result = import_from(source, name, path.parent / "made", Options(**options))
    for file in result.files:
        read_episode(file)
        verify(file)
    if result.refused:
        raise Refusal(str(result.refused[0]))


def imports(name: str, *lines: str) -> tuple[Use, ...]:
    return (*[partial(imported, name)] * 3, *commands(f"import F --from {name} -o made", *lines))


DATASET = commands(
    "check D", "describe D", "split D", "merge D O -o merged", "mirror D -o mirrored", "card D",
    "export D --to csv -o out", "evaluate D --no-rerun --workers 1 --resamples 100", "check D --replay --workers 1",
    "generate D --resume --scenario S --episodes 3 --seed 3 --workers 1 --no-picture", "describe D --json",
)  # fmt: skip

KINDS: dict[str, Kind] = {
    "episode": Kind(
        ("*",),
        (
            *[read_everything] * 4,
            *commands(
                "describe F", "describe F --json", "check F", "check F --replay --workers 1", "check F --rerun --workers 1",
                "render F -o x.svg --ids --zones", "render F -o x.png --strip 2", "render F -o x.html",
                "render F -o x.png --graph", "mirror F -o m.json", "mirror F -o m.json --labels twist",
                "evaluate F --workers 1 --resamples 100", "evaluate F --workers 1 --resamples 100 --metric all --no-rerun",
                "export F --to csv -o out", "export F --to npz -o out", "export F --to socnav3 -o out",
                "export F --to sonata -o out", "export F --to sonata --quirks original -o out",
                "export F --to parquet -o out",
            ),
        ),
    ),
    "dataset": Kind(("set/manifest.json", "set/manifest.json", "set/scenario.json", "set/00*.json"), DATASET),
    "beside": Kind(
        ("set/croissant.json", "set/metrics.json", "set/run.jsonl", "set/README.md", "set/ratings/*"),
        DATASET, "dataset",
    ),
    "shard": Kind(
        ("set/shard-*.tar", "set/shard-*.manifest.json"),
        commands(
            "check D --workers 1", "check F --workers 1", "describe D", "evaluate D --no-rerun --workers 1 --resamples 100",
            "export D --to csv -o out", "split D", "mirror D -o mirrored --workers 1",
            "generate D --resume --scenario S --episodes 3 --seed 4 --shard-size 2 --workers 1 --no-picture "
            "--controller straight-to-goal",
        ),
    ),
    "tar": Kind(
        ("*",),
        commands(
            "check F --workers 1", "evaluate F --no-rerun --workers 1 --resamples 100", "export F --to csv -o out",
        ),
    ),
    "scenario": Kind(
        ("*",), (*[few_ticks] * 3, *commands("scenarios show F", "scenarios draw F --scenes 1 -o x.png"))
    ),
    "map": Kind(("*",), commands("scenarios from-map F --unit 0.05 -o x.yaml")),
    "csv": Kind(("*",), imports("csv", "scenarios from-tracks F -o s.yaml --frame-time 0.1")),
    "trajnet": Kind(("*",), imports("trajnet", "scenarios from-tracks F -o s.yaml")),
    "tracks": Kind(
        ("*",),
        (*imports("tracks")[:3], *commands("import F --from tracks --frame-rate 25 --unit 0.05 -o made")),
    ),
    "npz": Kind(("*",), imports("npz")),
    "parquet": Kind(("*.parquet",), imports("parquet")[:3]),
    "socnav3": Kind(("*.json",), imports("socnav3")),
    "sonata": Kind(("*.json",), imports("sonata")),
    "weights": Kind(("*",), (weights,)),
    "collected": Kind(("*",), (collected,)),
    "study": Kind(("*",), (study,)),
    "message": Kind(("*",), (message,)),
}  # fmt: skip

# Command lines are damaged word by word. Counts stay small, as a command rightly runs for as long as it was asked to.
WORDS = (
    "generate", "new", "set", "set/manifest.json", "set/000000.json", "describe", "check", "render", "export", "import",
    "mirror", "split", "merge", "card", "scenarios", "show", "draw", "list", "from-tracks", "controllers", "evaluate",
    "--json", "-o", "--output", "--to", "--from", "csv", "sonata", "parquet", "npz", "--replay", "--rerun", "--controller",
    "--scenario", "--episodes", "1", "--seed", "--parts", "train=.5,test=.5", "train=nan", "train=-1", "--labels", "twist",
    "--strip", "--fps", "--speed", "--zones", "--graph", "--licence", "--metric", "all", "--resamples", "--picture", "--page",
    "--workers", "social-planner", "sonata-2020", "x.png", "x.svg", "x.html", "x.yaml", "0", "-1", "nan", "inf", "1e400", "é",
    "99999999999999999999999", "", "\0", "a\0b", "\udcff", "😀", "x" * 300, "x" * 5000, "/dev/null", "/dev/zero", "/", ".",
    "..", "~", "new/new/new", "set/000000.json/x", "--", "-", "a:b", ":", "./x.py:", "json:dumps", "../../x", "a+b", "a+b+c",
    "{}", "[", "*", "--frame-time", "0.1", "--quirks", "original", "--whole-families", "--resume", "--keep", "goal", "--help",
)  # fmt: skip
LINES = (
    "describe set", "check set --workers 1", "render set/000000.json -o x.svg", "export set --to csv -o new",
    "import set/000000.json --from sonata -o new", "mirror set -o new", "split set --parts train=.5,test=.5 --seed 1",
    "merge set other -o new", "card set --licence mit", "scenarios show sonata-2020",
    "scenarios draw sonata-2020 --scenes 1 -o x.png", "controllers", "evaluate set --workers 1 --no-rerun --resamples 100",
    "evaluate set --metric all --no-rerun --workers 1 --resamples 100", "generate set --resume --episodes 1 --workers 1",
    "check set/000000.json --rerun --controller social-planner --workers 1", "scenarios from-tracks set/000000.json -o x.yaml",
)  # fmt: skip
LONG = {"generate", "evaluate"}  # with other arguments they run for as long as they are asked to


def arguments(rng: Random) -> list[str]:
    """A command line with up to three other words."""
    words = rng.choice(LINES).split()
    for _ in range(rng.randint(1, 3)):
        k = rng.randint(1, len(words))
        words[k : k + rng.choice((0, 1, 1))] = [rng.choice(WORDS)] * rng.choice((0, 1, 1, 1))
    if "generate" in words[1:] or (words[0] in LONG and not {"set"} & set(words)):
        return ["describe", *words[1:]]
    return words


def use_arguments(words: list[str]) -> None:
    run(" ".join(shlex.quote(word) for word in words), Path("F"))
