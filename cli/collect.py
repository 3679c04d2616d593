"""`sonata2d collect`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .output import json_option, show_json

if TYPE_CHECKING:
    from sonata2d.scenegen.scenario.config import ScenarioConfig
    from sonata2d.window.rate_screen import RateScreen
    from sonata2d.window.stage import Screen

SCENARIO = "sonata-2020"


@click.command(
    epilog="Examples:  sonata2d collect runs --contributor zoe --scenario office.yaml --runs 20   ·   "
    "sonata2d collect --rate runs --contributor rater-1 --scenario survey.yaml"
)
@click.argument("out", type=click.Path(path_type=Path), required=False)
@click.option("--contributor", metavar="ID", help="Who drives, or rates; asked for in the window unless given.")
@click.option("--scenario", default=SCENARIO, show_default=True, metavar="NAME|FILE", help="Scenes, and what is asked.")
@click.option("--runs", type=click.IntRange(1), help="How many are asked for; without it, as many as one likes.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the scenes, or of the order.")
@click.option("--view", type=click.Choice(["follow", "top"]), default="follow", show_default=True, help="Camera.")
@click.option(
    "--compress", type=click.Choice(["none", "gz", "zst"]), default="none", show_default=True, help="How to pack files."
)
@click.option("--rate", type=click.Path(path_type=Path), metavar="DIR|FILE", help="Rate recorded runs instead.")
@click.option("--repeats", type=click.FloatRange(0, 1), default=0.1, show_default=True, help="Share rated twice.")
@click.option("--size", type=(click.IntRange(640), click.IntRange(480)), default=(1280, 800), help="Of the window.")
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
    size: tuple[int, int],
    as_json: bool,
) -> None:
    """Open a window in which a person drives the robot, run after run, into the folder OUT.

    The world waits for the first move. An ended run is kept or discarded; whatever was driven when the program ends,
    however it ends, is there again the next time. With --rate, recorded runs are shown and judged instead.
    """
    if (out is None) == (rate is None):
        both = "both were given; " if out is not None else ""
        raise click.UsageError(f"{both}give a folder OUT for runs to be driven, or --rate and one of recorded runs")
    from sonata2d.scenegen.scenario.load import load_scenario
    from sonata2d.window.profiles import remember, remembered
    from sonata2d.window.stage import Stage

    config = load_scenario(scenario)
    screens: list[RateScreen] = []

    def follow(name: str) -> Screen:
        screen: Screen
        if rate is not None:
            screen = _rating(rate, name, config, seed, repeats, view)
            screens.append(screen)
        else:
            assert out is not None
            screen = _driving(out, name, config, seed, runs, view, "" if compress == "none" else f".{compress}")
        remember(None, **{"contributor" if rate is None else "rater": name.strip()})
        return screen

    from sonata2d.window.name_screen import NameScreen

    stage = Stage("sonata2d: collect", size=size)
    asked = {} if rate is None else {"title": "Who rates?", "line": "A pseudonym is best; it is kept with each rating."}
    key = "contributor" if rate is None else "rater"
    last = str(remembered().get(key) or "")
    first = follow(contributor) if contributor is not None else NameScreen(follow, last, **asked)
    stage.run(first)
    if out is not None:
        _tell(out, as_json)
    elif as_json or screens:
        _tell_rated(screens, as_json)


def _driving(
    out: Path, name: str, config: ScenarioConfig, seed: int, runs: int | None, view: str, packing: str
) -> Screen:
    from sonata2d.collect.session import Session
    from sonata2d.window.collect_screen import CollectScreen
    from sonata2d.window.hands import Hands

    hands = Hands()
    session = Session(out, name, config, seed=seed, hands=hands.hands, suffix=f".json{packing}")
    return CollectScreen(session, hands, runs=runs, view="top" if view == "top" else "follow")


def _rating(folder: Path, name: str, config: ScenarioConfig, seed: int, repeats: float, view: str) -> RateScreen:
    from sonata2d.collect.rating import RatingSession
    from sonata2d.window.rate_screen import RateScreen

    session = RatingSession(folder, name, config.label.spec(), seed=seed, repeats=repeats)
    return RateScreen(session, view="top" if view == "top" else "follow", context=config.context)


def _tell(out: Path, as_json: bool) -> None:
    """What the folder holds now, and what to do with it."""
    from sonata2d.datasets.manifest import MANIFEST, read_manifest

    manifest = read_manifest(out) if (out / MANIFEST).exists() else None
    if as_json:
        show_json(manifest)
    if as_json or manifest is None:
        return
    people = ", ".join(f"{count} by {name}" for name, count in manifest["counts"]["contributor"].items())
    count = len(manifest["files"])
    click.echo(f"{out}: {count} {'run' if count == 1 else 'runs'}{f' ({people})' if people else ''}")
    if any((out / "journal").glob("*.jsonl")):
        click.echo("a run is left open; the same command goes on with it")
    if count:
        click.echo(f"next:  sonata2d view {out}   ·   sonata2d check {out} --replay")


def _tell_rated(screens: list[RateScreen], as_json: bool) -> None:
    """How far the rating has come, and where the answers are."""
    if as_json:
        sessions = [screen.session for screen in screens]
        show_json([{"rated": session.done, "of": session.total, "file": str(session.path)} for session in sessions])
        return
    session = screens[-1].session
    click.echo(f"{session.path}: {session.done} of {session.total} rated")
    click.echo(f"next:  sonata2d describe {session.folder}")
