"""The command `sonata2d collect`."""

from __future__ import annotations

import threading
import webbrowser
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sonata2d.core.wording import counted

from .command import Command
from .options import PATH, compress_option, examples, json_option, language_option, size_option
from .output import echo, show_json, show_links, wants_json
from .serve import serve_study

if TYPE_CHECKING:
    from sonata2d.collect.rating import RatingSession
    from sonata2d.core.devices import View
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
@click.option(
    "--contributor",
    metavar="ID",
    help="Pseudonym of the driver or rater.  [default: the window asks; a study numbers its participants]",
)
@click.option(
    "--scenario", default="sonata-2020", metavar="NAME|FILE", help="The rooms, and the question about each run."
)
@click.option("--runs", type=click.IntRange(1), help="Number of runs.  [default: unlimited]")
@click.option("--seed", type=click.IntRange(0), default=0, help="Seed of the rooms, or of the rating order.")
@click.option("--view", type=click.Choice(["follow", "top"]), default="follow", help="Camera.")
@compress_option
@click.option("--rate", type=PATH, metavar="DIR|FILE", help="Rate these recorded runs instead of driving.")
@click.option("--repeats", type=click.FloatRange(0, 1), default=0.1, help="Fraction of the runs rated twice.")
@click.option("--study", type=PATH, metavar="FILE", help="Study file: pages, questions, practice, runs and ratings.")
@click.option("--allow-scene-changes", is_flag=True, help="Let drivers change the numbers of people and objects (G).")
@click.option("--write-controls", is_flag=True, help="Only write the default controls to a file, to change them there.")
@language_option
@size_option
@json_option
def command(
    out: Path | None,
    contributor: str | None,
    scenario: str,
    runs: int | None,
    seed: int,
    view: View,
    suffix: str,
    rate: Path | None,
    repeats: float,
    study: Path | None,
    allow_scene_changes: bool,
    write_controls: bool,
    language: str,
    size: tuple[int, int] | None,
) -> None:
    """Open a window in which a person drives the robot, and store each run in the folder OUT.

    Time starts with the first movement. After each run the person keeps or discards it. If the program ends during a
    run, the same command continues that run. With --rate, the window shows recorded runs and asks for ratings. With
    --study, a browser opens in place of the window, and the study is served to it until Ctrl+C.
    """
    if write_controls:
        from sonata2d.window.profiles import write_default_controls

        click.echo(write_default_controls())
        return
    if (out is None) == (rate is None):
        problem = "both were given; " if out is not None else ""
        raise click.UsageError(f"{problem}give either a folder OUT to drive, or --rate DIR|FILE to rate recorded runs")
    if study is not None:
        _open_study(study, out, contributor, suffix)
        return
    from sonata2d.collect.rating import RatingSession
    from sonata2d.collect.session import Session, warm_up
    from sonata2d.collect.texts import choose_language
    from sonata2d.errors import SceneError
    from sonata2d.scenegen.generator import generate
    from sonata2d.scenegen.scenario.load import load_scenario
    from sonata2d.window.collect_screen import CollectScreen
    from sonata2d.window.input import InputDevices
    from sonata2d.window.name_screen import NameScreen
    from sonata2d.window.profiles import read_profiles
    from sonata2d.window.rate_screen import RateScreen
    from sonata2d.window.stage import Stage

    choose_language(language)
    config = load_scenario(scenario)
    profiles = read_profiles() if rate is None else {}
    if rate is None:
        with suppress(SceneError):  # the session tries further scenes
            warm_up(generate(config, seed))
    ratings: list[RatingSession] = []

    def first_screen(name: str) -> Screen:
        if rate is not None:
            ratings.append(RatingSession(rate, name, config.label, seed=seed, repeats=repeats))
            return RateScreen(ratings[-1], view=view, context=config.context)
        assert out is not None
        devices = InputDevices(profiles)
        session = Session(out, name, config, seed=seed, mappings=devices.mappings, suffix=suffix)
        # with --contributor, the whole session belongs to one person
        another = ask_name if contributor is None else None
        return CollectScreen(
            session, devices, runs=runs, view=view, scene_changes=allow_scene_changes, new_person=another
        )

    def ask_name() -> Screen:
        return NameScreen(first_screen, role="driver" if rate is None else "rater")

    stage = Stage("sonata2d: collect", size=size)
    stage.run(ask_name() if contributor is None else first_screen(contributor))
    if out is not None:
        _show_runs(out)
    else:
        _show_ratings(ratings)


_FOR_STUDIES = ("out", "contributor", "study", "suffix")
_OF_WINDOW = ("language", "size")


def _open_study(file: Path, out: Path | None, contributor: str | None, suffix: str) -> None:
    """Serve a study on this machine, and open its page in the default browser."""
    context = click.get_current_context()
    for name in context.params:
        if name in _FOR_STUDIES or context.get_parameter_source(name) is click.core.ParameterSource.DEFAULT:
            continue
        reason = (
            "is for the window, and a browser shows the study" if name in _OF_WINDOW else "is set by the study file"
        )
        raise click.UsageError(f"--{name.replace('_', '-')} {reason}; leave it out with --study")
    assert out is not None

    def announce(links: dict[str, str]) -> None:
        show_links(links)
        # Some browsers return when they are closed, and the server must answer before that.
        threading.Thread(target=_open_page, args=(links[contributor or "open link"],), daemon=True).start()

    ids = () if contributor is None else (contributor,)
    serve_study(file, out, announce, port=0, ids=ids, suffix=suffix)
    echo(f"next:  sonata2d study results {out} tables")


def _open_page(link: str) -> None:
    """Open a link in the default browser, or explain how to open it."""
    if not webbrowser.open(link):
        remedy = "for a browser of another machine, use `sonata2d serve`"
        click.echo(f"no browser can be started here: open {link} in a browser of this machine; {remedy}", err=True)


def _show_runs(out: Path) -> None:
    """Print the contents of the folder, and commands to run next."""
    from sonata2d.datasets.manifest import MANIFEST, read_manifest

    manifest = read_manifest(out) if (out / MANIFEST).exists() else None
    if wants_json():
        show_json(manifest)
    if wants_json() or manifest is None:
        return
    contributors = ", ".join(f"{count} by {name}" for name, count in manifest["counts"]["contributor"].items())
    count = len(manifest["files"])
    echo(f"{out}: {counted(count, 'run')}{f' ({contributors})' if contributors else ''}")
    if any((out / "journal").glob("*.jsonl")):
        echo("one run is unfinished; the same command continues it")
    if count:
        echo(f"next:  sonata2d view {out}\n       sonata2d check {out} --replay")


def _show_ratings(sessions: list[RatingSession]) -> None:
    """Print how many runs are rated, and where the ratings are stored; nobody may have begun."""
    if wants_json():
        show_json([{"rated": session.done, "of": session.total, "file": str(session.path)} for session in sessions])
        return
    for session in sessions[-1:]:
        echo(f"{session.path}: {session.done} of {session.total} rated")
        echo(f"next:  sonata2d describe {session.folder}")
