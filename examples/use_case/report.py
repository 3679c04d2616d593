"""Writes the results of the other stages as tables, OUT/report.md, with film strips of the shipped policy.

python examples/use_case/report.py -o runs
"""

from __future__ import annotations

import json
import shutil
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any

import click
import numpy as np
from data import run_command
from evaluate import LEARNED, MEAN, REFERENCES, SHIPPED
from settings import OURS, SETTINGS, title_of

from sonata2d import read_episode
from sonata2d.metrics import Measured, bootstrap_interval, wilson_interval
from sonata2d.metrics.exemplars import best_of, why_best, why_worst, worst_of
from sonata2d.record.files import safe_text, safe_texts
from sonata2d.view import render

Run = dict[str, Any]  # values of the metrics of one run

PAPER_ERRORS = {"train": 0.0230, "dev": 0.0328, "test": 0.0331}  # Baghel et al. 2020
PAPER_GOALS, PAPER_RUNS = 46, 60
PICTURES = ("bias.png", "best.png", "worst.png")
DRIVERS = {"expert": "expert", "before": "learner", "after": "learner, aggregated"}  # keys of bias.json


def reached_goal(run: Run) -> bool:
    """Whether the robot reached the goal."""
    return bool(run["success"] == 1.0)


def caused_contact(run: Run) -> bool:
    """Whether the robot's own velocity caused a contact with a person."""
    return bool(run["robot_on_person"] > 0)


def had_contact(run: Run) -> bool:
    """Whether the robot had any contact with a person, furniture or a wall."""
    return bool(run["collisions"] > 0)


FRACTIONS: dict[str, Callable[[Run], bool]] = {
    "goal": reached_goal,
    "contact with a person by its fault": caused_contact,
    "any contact": had_contact,
}
MEANS = {
    "personal-space compliance (0.45 m)": "personal_space_compliance_0.45",
    "interaction intrusion": "interaction_intrusion",
    "time to goal, s": "time_to_goal",
    "SPL": "spl",
    "jerk, m/s³": "jerk_mean",
}


def error_table(out: Path) -> str:
    """Mean squared errors of the paper, of predicting the mean, and of the networks.

    The shipped policy is left out: it was trained on other data, so its errors are not comparable.
    """
    rows = [["published: R-GCN, people's runs", *(f"{error:.4f}" for error in PAPER_ERRORS.values()), "", "", "", ""]]
    for name in (name for name in LEARNED if name != SHIPPED):
        training = json.loads((out / name / "training.json").read_text())
        if not name.endswith("aggregated"):
            mean = [f"{training['error of the mean'][part]:.4f}" for part in PAPER_ERRORS]
            rows.append([f"the mean command ({title_of(name)})", *mean, "", "", "", ""])
        errors = [f"{training['error'][part]:.4f}" for part in PAPER_ERRORS]
        sizes = [str(number) for number in (training["graphs"]["train"], training["parameters"], training["epochs"])]
        rows.append([title_of(name), *errors, *sizes, f"{training['seconds']['cpu'] / 60:.1f} min"])
    return markdown_table(["network", "train", "dev", "test", "graphs", "parameters", "epochs", "CPU"], rows)


def evaluation_table(out: Path, scenes: str) -> str:
    """Fractions with Wilson's interval, and means with the bootstrap interval, of each controller.

    Args:
        out: output folder of the use case.
        scenes: `few` or `many`.
    """
    results = {
        controller_name(evaluation["label"]): [run["values"] for run in evaluation["episodes"]]
        for evaluation in read_evaluations(out, scenes)
    }
    names = [name for name in (*LEARNED, *REFERENCES, MEAN) if name in results]
    rows = [
        [title, *(fraction_with_interval([is_counted(run) for run in results[name]]) for name in names)]
        for title, is_counted in FRACTIONS.items()
    ]
    rows += [
        [title, *(mean_with_interval([run[metric] for run in results[name]]) for name in names)]
        for title, metric in MEANS.items()
    ]
    return markdown_table([f"{SETTINGS.scenes[scenes]} scenes", *map(title_of, names)], rows)


def scenario_table(out: Path) -> str:
    """Goals and contacts of each scenario."""
    evaluations = read_evaluations(out, "everywhere")
    rows = []
    for scenario in sorted({run["name"] for run in evaluations[0]["episodes"]}):
        row = [scenario]
        for evaluation in evaluations:
            runs = [run["values"] for run in evaluation["episodes"] if run["name"] == scenario]
            row.append(f"{sum(map(reached_goal, runs))} / {sum(map(caused_contact, runs))} of {len(runs)}")
        rows.append(row)
    names = [controller_name(evaluation["label"]) for evaluation in evaluations]
    return markdown_table(["goal / contact with a person by its fault", *names], rows)


def read_evaluations(out: Path, scenes: str) -> list[dict[str, Any]]:
    """Read what `evaluate.py` wrote: label and episodes of each controller."""
    evaluations: list[dict[str, Any]]
    evaluations = json.loads((out / f"evaluation-{scenes}" / "evaluation.json").read_text())["evaluations"]
    return evaluations


def controller_name(label: str) -> str:
    """Return the name of a controller in the tables: of weights, the name of their folder."""
    return Path(label).parent.name if label.endswith(".npz") else label


def fraction_with_interval(hits: Sequence[bool]) -> str:
    """Format a fraction in per cent, with its interval."""
    low, high = wilson_interval(sum(hits), len(hits))
    return f"{100 * sum(hits) / len(hits):.1f} % [{100 * low:.1f}, {100 * high:.1f}]"


def mean_with_interval(values: Sequence[float | None]) -> str:
    """Format the mean of the defined values, with its interval, and with their number if some are not defined."""
    defined = np.array([value for value in values if value is not None])
    if not len(defined):
        return "not defined"
    interval = bootstrap_interval(defined)
    text = f"{defined.mean():.3f}" + (f" [{interval[0]:.3f}, {interval[1]:.3f}]" if interval else "")
    return text if len(defined) == len(values) else f"{text} (n={len(defined)})"


def time_table(out: Path) -> str:
    """Run times of the stages, in the order in which they finished."""
    files = sorted((out / "stages").glob("*.json"), key=lambda path: path.stat().st_mtime)
    stages = [json.loads(path.read_text()) for path in files if path.stem != "report"]
    rows = [
        [stage["stage"], *("" if stage[kind] is None else f"{stage[kind] / 60:.1f} min" for kind in ("wall", "cpu"))]
        for stage in stages
    ]
    return markdown_table(["stage", "wall", "CPU"], rows)


def bias_table(out: Path) -> str:
    """How often each driver is near anything, and how much the commands of learner and expert differ."""
    results = json.loads((out / "bias.json").read_text())
    rows = []
    for network in (key for key in results if key != "edges"):
        for driver, numbers in results[network].items():
            near = "{:.1f} % [{:.1f}, {:.1f}]".format(*(100 * value for value in numbers["near"]))
            difference = "{:.3f} [{:.3f}, {:.3f}]".format(*numbers["difference"])
            rows.append([title_of(network), DRIVERS[driver], near, difference])
    return markdown_table(["network", "driver", "frames within 0.1 m of anything", "mean squared difference"], rows)


def settings_table() -> str:
    """The settings of the trainings."""
    head = ["network", "learning rate", "weight decay", "cosine decay", "batch", "epochs", "dev interval", "patience"]
    rows = []
    for name, recipe in SETTINGS.recipes.items():
        rate, decay, fading, *counts = astuple(recipe)
        rows.append([title_of(name), str(rate), str(decay), "yes" if fading else "no", *map(str, counts)])
    return markdown_table(head, rows)


def film_strips(out: Path) -> str:
    """Draw the best and the worst of the many runs of the shipped policy, chosen by the rule of `sonata2d evaluate`."""
    evaluations = read_evaluations(out, "many")
    folders = safe_texts([evaluation["label"] for evaluation in evaluations])
    evaluation, folder = next(
        pair for pair in zip(evaluations, folders, strict=True) if controller_name(pair[0]["label"]) == SHIPPED
    )
    runs = [Measured(**row) for row in evaluation["episodes"]]
    best, worst = best_of(runs), worst_of(runs)
    parts = []
    for rank, run, reason in (("best", best, why_best(best)), ("worst", worst, why_worst(worst))):
        record = read_episode(out / "evaluation-many" / folder / safe_text(run.name) / run.file)
        render([*record.snapshots()], out / f"{rank}.png", strip=6)
        parts.append(paragraph(f"The {rank} run of {SHIPPED} is episode {run.episode}: {reason}."))
        parts.append(f"![The {rank} run]({rank}.png)")
    return "\n\n".join(parts)


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Format a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def paragraph(text: str) -> str:
    """Wrap text at 120 characters."""
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False)


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--docs", type=click.Path(path_type=Path, exists=True), help="Also copy it to this documentation folder.")
def main(out: Path, docs: Path | None) -> None:
    """Write OUT/report.md and its pictures."""
    parts = [
        "# Figures of the use case",
        paragraph("Written by `python examples/use_case/run.py`; [The use case](use-case.md) explains them."),
        "## Mean squared errors",
        error_table(out),
        paragraph(
            "The dev and test parts are runs of the expert, the same for all networks. The train part is the data that"
            " a network was trained on, which after aggregation includes runs of the learner; so only dev and test"
            " errors compare before and after aggregation. The tables below show how the networks drive."
        ),
        paragraph(
            f"{OURS} is the network of the publication (B. Baghel et al., 2020), trained here on runs of the expert."
            f" The published one, trained on runs of people, reached the goal in {PAPER_GOALS} of {PAPER_RUNS} runs"
            f" ({100 * PAPER_GOALS / PAPER_RUNS:.1f} %) in scenes of its own; no table below contains it."
        ),
        *(
            f"## {SETTINGS.scenes[scenes]} unseen scenes\n\n{evaluation_table(out, scenes)}"
            for scenes in ("few", "many")
        ),
        paragraph("The page `evaluation-many.html` in the output folder shows all metrics of these runs."),
        "## Every scenario",
        scenario_table(out),
        "## Where learner and expert part",
        bias_table(out),
        "![Clearance, and difference of learner and expert](bias.png)",
        "## The best and the worst run",
        film_strips(out),
        "## Run times",
        paragraph(
            "For a stage that was interrupted, only the time after the last start counts. The two networks were trained"
            " at the same time, and so were they aggregated."
        ),
        time_table(out),
        "## Training settings",
        settings_table(),
        paragraph(
            "The dev error is computed once per dev interval, in epochs. Training ends early after as many dev errors"
            " without improvement as the patience."
        ),
    ]
    text = "\n\n".join(parts) + "\n"
    (out / "report.md").write_text(text, encoding="utf-8")
    if docs is not None:
        for picture in PICTURES:
            shutil.copy(out / picture, docs / "images" / f"use-case-{picture}")
            text = text.replace(f"({picture})", f"(images/use-case-{picture})")
        (docs / "use-case-figures.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    run_command(main)
