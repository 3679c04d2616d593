"""The commands `sonata2d study check|preview|results|export|remove`."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from .command import Group
from .options import PATH, examples, json_option
from .output import echo, progress, show_json, show_links, show_result, show_table, wants_json

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
    """Check the file of a study, and write its results as tables.

    A study file (.yaml, .json or .toml) describes what participants read, drive, answer and rate.
    """


@command.command("check", epilog=examples("study check study.yaml", "study check study.yaml --participant 2"))
@click.argument("file", type=PATH)
@click.option("--participant", type=click.IntRange(1), default=1, help="Whose steps to show, in order of arrival.")
@json_option
def check(file: Path, participant: int) -> None:
    """Check a study file, and show the steps of a participant.

    Errors name line, key and value. Scenarios, recorded runs and translations are checked as well, and each scene that
    participants drive in is generated once.
    """
    from sonata2d.study.load import load_study
    from sonata2d.study.plan import steps_of

    study = load_study(file)
    steps = steps_of(study.config, participant - 1)
    with progress(study.number_of_scenes, "scene") as advance:
        study.check_scenes(advance)
    warnings, quota = study.config.untranslated(), study.config.quota_answers()
    if wants_json():
        rows = [{"answer": name, "places": places} for _, name, places in quota]
        show_json({"steps": [_step_row(study, step) for step in steps], "quota": rows, "warnings": warnings})
        return
    for warning in warnings:
        echo(f"warning: {warning}", err=True)
    show_table((row["step"], row["text"]) for row in (_step_row(study, step) for step in steps))
    if study.config.quota is not None:
        echo(f"places by {study.config.quota.question}: {', '.join(f'{name} {places}' for _, name, places in quota)}")


def _step_row(study: Study, step: Step) -> dict[str, Any]:
    """One step of a participant as text."""
    from sonata2d.collect.rating import plan_showings
    from sonata2d.core.wording import counted
    from sonata2d.study.texts import in_language

    # A step is known by its questions, its scene or its runs; pages have titles.
    if step.kind == "questions":
        details = ", ".join(entry.name for entry in step.entries)
    elif step.kind in ("run", "practice"):
        details = f"{study.config_of(step.block).name}, scene {study.scene_number(step.block, step.scene)}"
    elif step.kind == "ratings":
        files, block = study.rated[step.block], study.config.ratings[step.block]
        repeats = len(plan_showings(files, block.repeats)) - len(files)
        details = f"{counted(len(files), 'run')} of {block.folder}, {repeats or 'none'} of them twice"
    else:
        details = in_language(step.title, study.config.languages[0])
    return {"step": step.id, "text": f"{_KINDS[step.kind]}{': ' if details else ''}{details}"}


@command.command("preview", epilog=examples("study preview study.yaml"))
@click.argument("file", type=PATH)
@click.option("--host", default="127.0.0.1", help="Address to listen at.")
@click.option("--port", type=click.IntRange(0, 65535), default=8765, help="0: a free one.")
@click.option("--page", type=PATH, help="Folder of `sonata2d page`, as of `sonata2d serve`.")
@json_option
def preview(file: Path, host: str, port: int, page: Path | None) -> None:
    """Try a study in a browser as a participant; every step can be skipped.

    Prints a link, and runs until Ctrl+C. What is collected is deleted then.
    """
    from sonata2d.study.folder import StudyFolder
    from sonata2d.study.load import load_study
    from sonata2d.web.serve import serve
    from sonata2d.web.settings import ServerSettings

    study = load_study(file)
    with TemporaryDirectory(prefix="sonata2d-preview-") as folder:
        settings = ServerSettings(host=host, port=port, participants=1, is_preview=True, page=page)
        serve(StudyFolder(folder, study), settings, show_links)
    echo("stopped; the collected files are deleted", err=True)


@command.command("results", epilog=examples("study results OUT tables", "study results OUT tables --personal"))
@click.argument("out", type=PATH)
@click.argument("folder", type=PATH)
@click.option("--personal", is_flag=True, help="Include the personal answers.")
@json_option
def results(out: Path, folder: Path, personal: bool) -> None:
    """Write the results of a study as tables.

    FOLDER gets participants.csv, runs.csv, pages.csv, answers.csv, scores.csv (means of the parts of published
    questionnaires, and of tables of statements with `score: true`) and ratings.csv.
    Answers about runs that were driven again are left out.
    """
    from sonata2d.core.wording import counted
    from sonata2d.study.report import save_results

    counts = save_results(out, folder, personal=personal)
    if wants_json():
        show_json([str(path) for path in counts])
    else:
        show_table((path.name, counted(rows, "row")) for path, rows in counts.items())


@command.command("remove", epilog=examples("study remove OUT p007"))
@click.argument("out", type=PATH)
@click.argument("participant")
@click.option("--yes", is_flag=True, help="Do not ask.")
@json_option
def remove(out: Path, participant: str, yes: bool) -> None:
    """Delete a participant's runs, ratings and answers, because they withdraw from the study.

    The link leads nowhere afterwards. The server has to be stopped; archives that were exported before are not changed.
    """
    from sonata2d.study.folder import read_state
    from sonata2d.study.removal import remove_participant

    read_state(out)
    if not yes:
        click.confirm(f"Delete all files of {participant} in {out}?", abort=True, err=True)
    paths = remove_participant(out, participant)
    show_result([str(path) for path in paths], f"{len(paths)} files deleted")


@command.command("export", epilog=examples("study export OUT study.zip", "study export OUT study.zip --personal"))
@click.argument("out", type=PATH)
@click.argument("file", type=PATH)
@click.option("--personal", is_flag=True, help="Include the personal answers.")
@json_option
def export(out: Path, file: Path, personal: bool) -> None:
    """Write all that a study has collected to a ZIP file: runs, ratings, answers and tables.

    Links are left out.
    """
    from sonata2d.study.export import export_study

    path = export_study(out, file, personal=personal)
    show_result(str(path), f"{path}: {path.stat().st_size / 1e6:.1f} MB")
