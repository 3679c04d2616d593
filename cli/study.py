"""The commands `sonata2d study check|results`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .command import Group
from .common import PATH, examples, json_option, note, progress, show_json, show_table

if TYPE_CHECKING:
    from sonata2d.study.load import Study
    from sonata2d.study.plan import Step

_KINDS = {
    "page": "reads",
    "consent": "consents",
    "questions": "answers",
    "practice": "practises",
    "run": "drives",
    "ratings": "rates",
    "thanks": "has finished",
}


@click.group(cls=Group, epilog=examples("study check study.yaml", "study results OUT tables"))
def command() -> None:
    """Check the file of a study, and turn what participants did into tables.

    A study file (.yaml, .json or .toml) describes what participants read, drive, answer and rate.
    """


@command.command("check", epilog=examples("study check study.yaml", "study check study.yaml --participant 2"))
@click.argument("file", type=PATH)
@click.option("--participant", type=click.IntRange(1), default=1, help="Whose steps to show, in order of arrival.")
@json_option
def check(file: Path, participant: int, as_json: bool) -> None:
    """Check a study file, and show the steps of a participant.

    Errors name line, key and value. Scenarios, recorded runs and translations are checked as well, and each scene that
    participants drive in is generated once.
    """
    from sonata2d.study.load import load_study
    from sonata2d.study.plan import steps_of

    study = load_study(file)
    steps = steps_of(study.config, participant - 1)
    scenes = [step for step in steps if step.kind in ("run", "practice")]
    with progress(len(scenes), "scene") as advance:
        for step in scenes:
            study.scene_number(step.block, step.scene)
            advance(1)
    warnings = study.config.untranslated()
    if as_json:
        show_json({"steps": [_step_row(study, step) for step in steps], "warnings": warnings})
        return
    for warning in warnings:
        note(f"warning: {warning}", err=True)
    show_table((row["step"], row["text"]) for row in (_step_row(study, step) for step in steps))


def _step_row(study: Study, step: Step) -> dict[str, Any]:
    """One step of a participant as text."""
    from sonata2d.study.config import in_language, name_of_entry

    what = ""
    if step.kind == "questions":
        what = ", ".join(name_of_entry(entry) for entry in step.entries)
    elif step.kind in ("run", "practice"):
        what = f"{study.config_of(step.block).name}, scene {study.scene_number(step.block, step.scene)}"
    elif step.kind == "ratings":
        what = f"{len(study.rated[step.block])} runs of {study.config.ratings[step.block].folder}"
    else:
        what = in_language(step.title, study.config.languages[0])
    return {"step": step.id, "text": f"{_KINDS[step.kind]}{': ' if what else ''}{what}"}


@command.command("results", epilog=examples("study results OUT tables", "study results OUT tables --personal"))
@click.argument("out", type=PATH)
@click.argument("folder", type=PATH)
@click.option("--personal", is_flag=True, help="Include the personal answers.")
@json_option
def results(out: Path, folder: Path, personal: bool, as_json: bool) -> None:
    """Write the results of a study as tables.

    FOLDER gets participants.csv, runs.csv, answers.csv and ratings.csv. Answers about runs that were driven again are
    left out.
    """
    from sonata2d.study.report import save_results

    paths = save_results(out, folder, personal=personal)
    if as_json:
        show_json([str(path) for path in paths])
    else:
        show_table((path.name, f"{len(path.read_bytes().splitlines()) - 1} rows") for path in paths)
