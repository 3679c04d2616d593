"""Tell in tables what the other stages found: OUT/report.md, and film strips of the learned robot.

python examples/use_case/report.py -o runs
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
from data import run_cleanly
from evaluate import LEARNED, MEAN, OTHERS, SCENES, SHIPPED
from train import RECIPES

from sonata2d.metrics.measurement import Measured
from sonata2d.metrics.page import best_of, why_best, why_worst, worst_of
from sonata2d.metrics.summary import bootstrap_interval, wilson_interval
from sonata2d.record.files import safe_text, safe_texts
from sonata2d.record.reader import read_episode
from sonata2d.view.files import render

PAPER = {"train": 0.0230, "dev": 0.0328, "test": 0.0331}  # Baghel et al. 2020
PAPER_REACHED = (46, 60)
PICTURES = ("bias.png", "best.png", "worst.png")
BEST = SHIPPED  # whose film strips are shown
SHARES: dict[str, Callable[[dict[str, Any]], bool]] = {
    "goal": lambda run: run["success"] == 1.0,
    "touches a person by its fault": lambda run: run["robot_on_person"] > 0,
    "touches anything": lambda run: run["collisions"] > 0,
}
MEANS = {
    "personal-space compliance (0.45 m)": "personal_space_compliance_0.45",
    "interaction intrusion": "interaction_intrusion",
    "time to goal, s": "time_to_goal",
    "SPL": "spl",
    "jerk, m/s³": "jerk_mean",
}


def errors(out: Path) -> str:
    """Mean squared errors beside the paper's; what is shipped learned from other data."""
    rows = [["SONATA paper", *(f"{PAPER[part]:.4f}" for part in PAPER), "", "", "", ""]]
    for name in (name for name in LEARNED if name != SHIPPED):
        told = json.loads((out / name / "training.json").read_text())
        if not name.endswith("aggregated"):
            mean = [f"{told['error of the mean'][part]:.4f}" for part in PAPER]
            rows.append([f"the mean, always ({name})", *mean, "", "", "", ""])
        numbers = [f"{told['error'][part]:.4f}" for part in PAPER]
        took = [told["graphs"]["train"], told["parameters"], told["epochs"], f"{told['seconds']['cpu'] / 60:.1f} min"]
        rows.append([name, *numbers, *map(str, took)])
    return table(["network", "train", "dev", "test", "graphs", "parameters", "epochs", "CPU"], rows)


def evaluation(out: Path, scenes: str) -> str:
    """Shares with Wilson's interval, means with the bootstrap's, of each controller."""
    found = {
        name_of(one["label"]): [run["values"] for run in one["episodes"]]
        for one in json.loads((out / f"evaluation-{scenes}" / "evaluation.json").read_text())["evaluations"]
    }
    names = [name for name in (*LEARNED, *OTHERS, MEAN) if name in found]
    rows = [[what, *(share([of(run) for run in found[name]]) for name in names)] for what, of in SHARES.items()]
    rows += [[what, *(mean([run[metric] for run in found[name]]) for name in names)] for what, metric in MEANS.items()]
    return table([f"{SCENES[scenes][0]} scenes", *names], rows)


def everywhere(out: Path) -> str:
    """Goal shares and touches of people in each scenario."""
    found = json.loads((out / "evaluation-everywhere" / "evaluation.json").read_text())["evaluations"]
    rows = []
    for scenario in sorted({run["name"] for run in found[0]["episodes"]}):
        row = [scenario]
        for one in found:
            runs = [run["values"] for run in one["episodes"] if run["name"] == scenario]
            reached, touched = (sum(map(of, runs)) for of in list(SHARES.values())[:2])
            row.append(f"{reached} / {touched} of {len(runs)}")
        rows.append(row)
    return table(["reached the goal / touched a person by its fault", *(name_of(one["label"]) for one in found)], rows)


def name_of(label: str) -> str:
    """A learned controller is named by its folder."""
    return Path(label).parent.name if label.endswith(".npz") else label


def share(hits: Sequence[bool]) -> str:
    """Per cent, with the interval."""
    low, high = wilson_interval(sum(hits), len(hits))
    return f"{100 * sum(hits) / len(hits):.1f} % [{100 * low:.1f}, {100 * high:.1f}]"


def mean(values: Sequence[float | None]) -> str:
    """Of those defined, with the interval, and of how many if not of all."""
    there = np.array([value for value in values if value is not None])
    if not len(there):
        return "not defined"
    interval = bootstrap_interval(there)
    told = f"{there.mean():.3f}" + (f" [{interval[0]:.3f}, {interval[1]:.3f}]" if interval else "")
    return told if len(there) == len(values) else f"{told} (n={len(there)})"


def times(out: Path) -> str:
    """What each stage took; of one that was interrupted, since it was gone on with."""
    files = sorted((out / "stages").glob("*.json"), key=lambda path: path.stat().st_mtime)
    stages = [json.loads(path.read_text()) for path in files if path.stem != "report"]
    minutes = [["" if one[kind] is None else f"{one[kind] / 60:.1f} min" for kind in ("wall", "cpu")] for one in stages]
    return table(["stage", "wall", "CPU"], [[one["stage"], *took] for one, took in zip(stages, minutes, strict=True)])


def bias(out: Path) -> str:
    """Where learner and expert part."""
    found = json.loads((out / "bias.json").read_text())
    rows = []
    for network, sets in found.items():
        for who, told in sets.items() if network != "edges" else ():
            near = "{:.1f} % [{:.1f}, {:.1f}]".format(*(100 * value for value in told["near"]))
            rows.append([network, who, near, "{:.3f} [{:.3f}, {:.3f}]".format(*told["difference"])])
    return table(["network", "who drives", "frames nearer than 0.1 m to anything", "mean squared difference"], rows)


def strips(out: Path) -> str:
    """Film strips of the best and the worst run of the 1000, chosen by the rule of `sonata2d evaluate`."""
    place = out / "evaluation-many"
    every = json.loads((place / "evaluation.json").read_text())["evaluations"]
    folders = safe_texts([one["label"] for one in every])
    one, folder = next(pair for pair in zip(every, folders, strict=True) if name_of(pair[0]["label"]) == BEST)
    runs = [Measured(**row) for row in one["episodes"]]
    lines = []
    best, worst = best_of(runs), worst_of(runs)
    for what, run, why in (("best", best, why_best(best)), ("worst", worst, why_worst(worst))):
        record = read_episode(place / folder / safe_text(run.name) / run.file)
        render([*record.snapshots()], out / f"{what}.png", strip=6)
        lines.append(f"The {what} run of {BEST}, episode {run.episode}: {why}.\n\n![{what}]({what}.png)")
    return "\n\n".join(lines)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path, exists=True), default=Path("runs"), show_default=True)
@click.option("--docs", type=click.Path(path_type=Path, exists=True), help="A folder of documentation to copy it to.")
def main(out: Path, docs: Path | None) -> None:
    """Write OUT/report.md and its pictures."""
    reached, of = PAPER_REACHED
    parts = [
        "# The use case, in figures",
        "Made by `python examples/use_case/run.py`; what it means is told in [The use case](use-case.md).",
        "## Mean squared errors",
        errors(out),
        "Dev and test are the expert's runs, for all. Train is what a network learned from: where it was aggregated,"
        " what learners met as well. So only dev and test compare before and after; how it drives is told below.",
        f"The paper's network reached the goal in {reached} of {of} runs ({100 * reached / of:.1f} %).",
        *(f"## {SCENES[scenes][0]} unseen scenes\n\n{evaluation(out, scenes)}" for scenes in ("few", "many")),
        "Every metric of them is on the page `evaluation-many.html`, in the folder of the runs.",
        "## In every scenario",
        everywhere(out),
        "## Where learner and expert part",
        bias(out),
        "![bias](bias.png)",
        "## At its best and at its worst",
        strips(out),
        "## What it took",
        "Of a stage that was interrupted, only what came after. Stages of networks ran two at a time.",
        times(out),
        *(f"- `{name}`: {recipe}" for name, recipe in RECIPES.items()),
    ]
    text = "\n\n".join(parts) + "\n"
    (out / "report.md").write_text(text, encoding="utf-8")
    if docs is not None:
        for picture in PICTURES:
            shutil.copy(out / picture, docs / "images" / f"use-case-{picture}")
            text = text.replace(f"({picture})", f"(images/use-case-{picture})")
        (docs / "use-case-figures.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    run_cleanly(main)
