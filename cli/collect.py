"""The command `sonata2d collect`."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .command import Command
from .common import (
    PATH,
    compress_option,
    episode_suffix,
    examples,
    json_option,
    language_option,
    note,
    show_json,
    size_option,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from sonata2d.scenegen.scenario.config import ScenarioConfig
    from sonata2d.window.rate_screen import RateScreen
    from sonata2d.window.stage import Screen


@click.command(
    cls=Command,
    epilog=examples(
        "collect runs --contributor zoe --scenario sonata-2020-crowded --runs 20",
        "collect runs --study study.yaml --contributor p01",
        "collect --rate runs --contributor rater-1 --scenario survey.yaml",
    ),
)
@click.argument("out", type=PATH, required=False)
@click.option("--contributor", metavar="ID", help="Pseudonym of the driver or rater.  [default: the window asks]")
@click.option(
    "--scenario",
    default="sonata-2020",
    metavar="NAME|FILE",
    help="Scenario: the rooms, and the question asked about each run.",
)
@click.option("--runs", type=click.IntRange(1), help="Number of runs.  [default: unlimited]")
@click.option("--seed", type=click.IntRange(0), default=0, help="Seed of the rooms, or of the rating order.")
@click.option("--view", type=click.Choice(["follow", "top"]), default="follow", help="Camera.")
@compress_option
@click.option("--rate", type=PATH, metavar="DIR|FILE", help="Rate these recorded runs instead of driving.")
@click.option("--repeats", type=click.FloatRange(0, 1), default=0.1, help="Fraction of the runs rated twice.")
@click.option("--study", type=PATH, metavar="FILE", help="Study file: pages, questions, practice, runs and ratings.")
@click.option("--allow-scene-changes", is_flag=True, help="Let drivers change the numbers of people and objects (G).")
@language_option
@size_option
@json_option
def command(
    out: Path | None,
    contributor: str | None,
    scenario: str,
    runs: int | None,
    seed: int,
    view: str,
    compress: str,
    rate: Path | None,
    repeats: float,
    study: Path | None,
    allow_scene_changes: bool,
    language: str,
    size: tuple[int, int] | None,
    as_json: bool,
) -> None:
    """Open a window in which a person drives the robot, and store each run in the folder OUT.

    Time starts with the first movement. After each run the person keeps or discards it. If the program ends during a
    run, the same command continues that run. With --rate, the window shows recorded runs and asks for ratings. With
    --study, it goes through a study, whose file has all other settings.
    """
    if (out is None) == (rate is None):
        problem = "both were given; " if out is not None else ""
        raise click.UsageError(f"{problem}give either a folder OUT to drive, or --rate DIR|FILE to rate recorded runs")
    from sonata2d.collect.session import warm_up
    from sonata2d.collect.texts import choose_language
    from sonata2d.errors import SceneError
    from sonata2d.scenegen.generator import generate
    from sonata2d.scenegen.scenario.load import load_scenario
    from sonata2d.window.name_screen import NameScreen
    from sonata2d.window.stage import Stage

    choose_language(language)
    if study is not None:
        _take_part(study, out, contributor, episode_suffix(compress), size, as_json)
        return
    config = load_scenario(scenario)
    if rate is None:
        with suppress(SceneError):  # the session tries further scenes
            warm_up(generate(config, seed))
    rating: list[RateScreen] = []

    def first_screen(name: str) -> Screen:
        screen: Screen
        if rate is not None:
            screen = _rate_screen(rate, name, config, seed, repeats, view)
            rating.append(screen)
        else:
            assert out is not None
            # A person who was named on the command line is the only one of this session.
            another = ask_name if contributor is None else None
            screen = _drive_screen(
                out, name, config, seed, runs, view, episode_suffix(compress), allow_scene_changes, another
            )
        return screen

    def ask_name() -> Screen:
        return NameScreen(first_screen, role="driver" if rate is None else "rater")

    stage = Stage("sonata2d: collect", size=size)
    stage.run(ask_name() if contributor is None else first_screen(contributor))
    if out is not None:
        _show_runs(out, as_json)
    elif as_json or rating:
        _show_ratings(rating, as_json)


_WITH_STUDY = ("out", "contributor", "study", "compress", "language", "size", "as_json")


def _take_part(
    file: Path, out: Path | None, contributor: str | None, suffix: str, size: tuple[int, int] | None, as_json: bool
) -> None:
    """Go through a study in the window."""
    context = click.get_current_context()
    for name in context.params:
        is_default = context.get_parameter_source(name) is click.core.ParameterSource.DEFAULT
        if name not in _WITH_STUDY and not is_default:
            raise click.UsageError(f"--{name.replace('_', '-')} is set by the study file; leave it out with --study")
    assert out is not None
    from sonata2d.collect.texts import use_table
    from sonata2d.study.folder import opened_folder
    from sonata2d.study.load import load_study
    from sonata2d.study.participant import Participant
    from sonata2d.window.input import InputDevices
    from sonata2d.window.name_screen import NameScreen
    from sonata2d.window.stage import Stage
    from sonata2d.window.study_flow import StudyFlow

    study = load_study(file)
    participants: list[Participant] = []

    with opened_folder(out, study) as folder:
        study.warm_up()

        def first_screen(name: str) -> Screen:
            devices = InputDevices()
            participants.append(Participant(folder, name, mappings=devices.mappings, suffix=suffix))
            return StudyFlow(participants[-1], devices).screen()

        use_table(study.tables[study.config.languages[0]])
        stage = Stage("sonata2d", size=size)
        stage.run(NameScreen(first_screen) if contributor is None else first_screen(contributor))
    rows = [{"participant": one.id, "step": one.step.id, "done": one.progress} for one in participants]
    if as_json:
        show_json(rows)
    for row in () if as_json else rows:
        note(f"{row['participant']}: step {row['done'][0]} of {row['done'][1]}")
        note(f"next:  sonata2d study results {out} tables")


def _drive_screen(
    out: Path,
    name: str,
    config: ScenarioConfig,
    seed: int,
    runs: int | None,
    view: str,
    suffix: str,
    scene_changes: bool,
    new_person: Callable[[], Screen] | None,
) -> Screen:
    from sonata2d.collect.session import Session
    from sonata2d.window.collect_screen import CollectScreen
    from sonata2d.window.input import InputDevices

    devices = InputDevices()
    session = Session(out, name, config, seed=seed, mappings=devices.mappings, suffix=suffix)
    return CollectScreen(
        session,
        devices,
        runs=runs,
        view="top" if view == "top" else "follow",
        scene_changes=scene_changes,
        new_person=new_person,
    )


def _rate_screen(folder: Path, name: str, config: ScenarioConfig, seed: int, repeats: float, view: str) -> RateScreen:
    from sonata2d.collect.rating import RatingSession
    from sonata2d.window.rate_screen import RateScreen

    session = RatingSession(folder, name, config.label, seed=seed, repeats=repeats)
    return RateScreen(session, view="top" if view == "top" else "follow", context=config.context)


def _show_runs(out: Path, as_json: bool) -> None:
    """Print the contents of the folder, and commands to run next."""
    from sonata2d.datasets.manifest import MANIFEST, read_manifest

    manifest = read_manifest(out) if (out / MANIFEST).exists() else None
    if as_json:
        show_json(manifest)
    if as_json or manifest is None:
        return
    contributors = ", ".join(f"{count} by {name}" for name, count in manifest["counts"]["contributor"].items())
    count = len(manifest["files"])
    note(f"{out}: {count} {'run' if count == 1 else 'runs'}{f' ({contributors})' if contributors else ''}")
    if any((out / "journal").glob("*.jsonl")):
        note("one run is unfinished; the same command continues it")
    if count:
        note(f"next:  sonata2d view {out}\n       sonata2d check {out} --replay")


def _show_ratings(screens: list[RateScreen], as_json: bool) -> None:
    """Print how many runs are rated, and where the ratings are stored."""
    sessions = [screen.session for screen in screens]
    if as_json:
        show_json([{"rated": session.done, "of": session.total, "file": str(session.path)} for session in sessions])
        return
    session = sessions[-1]
    note(f"{session.path}: {session.done} of {session.total} rated")
    note(f"next:  sonata2d describe {session.folder}")
