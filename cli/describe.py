"""`sonata2d describe`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .output import json_option, show_json, show_table

if TYPE_CHECKING:
    from sonata2d.collect.agreement import Agreement, Steadiness

Rows = list[tuple[str, object]]

_MOST_DISPUTED = 5  # runs told of a question; in JSON, all


@click.command(epilog="Examples:  sonata2d describe demo   ·   sonata2d describe demo/000000.json --json")
@click.argument("path", type=click.Path(path_type=Path), metavar="DIR|FILE")
@json_option
def command(path: Path, as_json: bool) -> None:
    """Say what an episode file or a data set holds: who, where, how it ended, and what its columns mean."""
    judged = _agreements(path) if path.is_dir() else []
    rows = _folder(path, rated=bool(judged)) if path.is_dir() else _episode(path)
    if as_json:
        told = {name.replace(" ", "_"): value for name, value in rows}
        show_json(told | {"ratings": [_agreement_tree(one) for one in judged]} if judged else told)
    else:
        rated = [row for one in judged for row in _agreement_rows(one)]
        show_table((name, _shown(value)) for name, value in [*rows, *rated])


def _folder(folder: Path, *, rated: bool) -> Rows:
    """What the manifest tells; rated runs may lie in a folder that has none."""
    from sonata2d.datasets.manifest import MANIFEST

    return [("folder", str(folder))] if rated and not (folder / MANIFEST).exists() else _dataset(folder)


def _dataset(folder: Path) -> Rows:
    """What the manifest tells."""
    from sonata2d.datasets.manifest import read_manifest

    manifest = read_manifest(folder)
    files, counts = manifest["files"], manifest["counts"]
    origin: Rows = [
        ("scenario", manifest["name"]),
        ("controller", manifest["controller"] and manifest["controller"]["path"]),
        ("seed", manifest["seed"]),
        ("contributors", counts.get("contributor")),
    ]
    rows: Rows = [
        ("data set", str(folder)),
        *((name, value) for name, value in origin if value is not None),
        ("episodes", f"{len(files)} of {manifest['episodes']}{'' if manifest['complete'] else ', interrupted'}"),
        ("frames", sum(file["ticks"] for file in files)),
        ("bytes", sum(file["bytes"] for file in files)),
        ("outcomes", counts["outcome"]),
        ("families", counts["family"]),
        ("physics version", manifest["physics"]),
        ("sonata2d", manifest["software"]["sonata2d"]),
    ]
    if manifest.get("keep"):
        rows += [("kept are", ", ".join(manifest["keep"])), ("left out", manifest["left_out"] or "none")]
    if manifest.get("mirrored"):
        rows.append(("mirrored", "each episode is the mirror image of one that settings and seed give"))
    rows += [("merged from", [_source(source) for source in manifest["sources"]])] if manifest.get("sources") else []
    if manifest["split"]:
        rows.append(("split", {part: len(names) for part, names in manifest["split"].items()}))

    return rows + (_answers(folder, files) if manifest["collected"] else [])


def _answers(folder: Path, files: list[dict[str, Any]]) -> Rows:
    """What was answered of whole runs, by question."""
    from sonata2d.core.labels import LabelSpec
    from sonata2d.record.canonical import head_of
    from sonata2d.record.files import read_bytes

    told: dict[str, Counter[str]] = {}
    for file in files:
        head = head_of(read_bytes(folder / file["name"]))
        if "label" in head:
            spec = LabelSpec.restored(head["label_spec"])
            told.setdefault(spec.question or spec.name, Counter())[spec.in_words(head["label"])] += 1
    return [(f"answers to {question!r}", dict(sorted(counts.items()))) for question, counts in told.items()]


def _episode(path: Path) -> Rows:
    """What the file tells."""
    from sonata2d.record.reader import read_episode

    record = read_episode(path)
    scene, document = record.scene(), record.document
    walking = sum(human.behaviour != "standing" for human in scene.humans)
    recorded = sum(human.behaviour == "recorded" for human in scene.humans)
    passing = int((~record.looks.present).any(axis=0).sum())
    return [
        ("episode", record.id),
        ("scenario", scene.family),
        ("seed, episode", [record.seed, record.episode]),
        ("controller", record.author.path),
        ("contributor", record.contributor),
        ("context", record.context),
        ("people", f"{len(scene.humans)}, {walking} of them walking"),
        *([("recorded people", recorded)] if recorded else []),
        *([("people who come or go", passing)] if passing else []),
        ("ignore the robot", sum(human.reacts_to_robot == 0.0 for human in scene.humans)),
        ("towards the robot", dict(sorted(Counter(human.reaction for human in scene.humans).items()))),
        ("objects", [thing.type for thing in scene.furniture]),
        ("interactions", [[tie.src, tie.relation, tie.dst] for tie in scene.interactions]),
        ("robot", f"{scene.robot.kinematics}, radius {scene.robot.radius} m"),
        ("goal", f"({scene.goal.x}, {scene.goal.y}), reached within {scene.goal.distance} m"),
        ("frames", f"{len(record)}, one each {scene.rules.dt} s"),
        ("outcome", f"{record.outcome.status}: {record.outcome.reason}"),
        ("labels", document["labels"] or "the command itself"),
        ("not placed", list(scene.dropped)),
        *_origin(document),
        *_columns(document["columns"]),
    ]


def _source(source: dict[str, Any]) -> str:
    """One of the data sets that were merged."""
    scenario = source["scenario"] or "driven by people"
    seed = "" if source["seed"] is None else f", seed {source['seed']}"
    return (
        f"{source['name']}: {len(source['files'])} of {scenario}{seed}{', mirrored' if source.get('mirrored') else ''}"
    )


def _origin(document: dict[str, Any]) -> Iterator[tuple[str, object]]:
    """Where an episode is from, if it was not simply run."""
    if branched := document["branched_from"]:
        yield "branched from", f"{branched['id']} at tick {branched['tick']}"
    if mirrored := document.get("mirrored_from"):
        yield "mirror image of", mirrored["id"]
    if imported := document.get("imported"):
        yield "imported from", f"{imported['file']} ({imported['format']})"
        yield "not in the source", imported["lacks"]


def _columns(columns: dict[str, list[dict[str, str]]]) -> Iterator[tuple[str, object]]:
    """What the numbers in a row mean."""
    for block, told in columns.items():
        yield f"{block} columns", [f"{c['name']} [{c['unit']}, {c['frame']}]" for c in told]


def _agreements(folder: Path) -> list[Agreement]:
    """How well the ratings beside the episodes agree, question by question."""
    from sonata2d.collect.agreement import agreements
    from sonata2d.collect.rating import ratings_of

    return agreements(ratings_of(folder))


def _agreement_tree(told: Agreement) -> dict[str, Any]:
    """All of it, for programs."""
    between = {"measure": told.measure, "value": told.alpha} if told.measure else None
    return {
        "question": told.spec.question,
        "kind": told.spec.kind,
        "raters": told.raters,
        "ratings": told.ratings,
        "runs": told.runs,
        "runs_rated_by_two_or_more": told.shared,
        "between_raters": between,
        "within_raters": [asdict(one) for one in told.within],
        "disputed": [asdict(one) for one in told.disputed],
    }


def _agreement_rows(told: Agreement) -> Rows:
    """What people want to know first."""
    question = f"{told.spec.question or told.spec.name} ({told.spec.kind})"
    rows: Rows = [
        ("asked", question),
        ("raters", list(told.raters)),
        ("ratings", f"{told.ratings}, of {told.runs} runs; {told.shared} of them rated by two or more"),
    ]
    if told.measure:
        rows.append(("between raters", f"{told.measure}: {_number(told.alpha)}"))
    rows += [(f"within {one.rater}", _steadiness(one)) for one in told.within]
    disputed = [
        f"{run.file} ({', '.join(f'{rater}: {label}' for rater, label in run.labels.items())})"
        for run in told.disputed[:_MOST_DISPUTED]
    ]
    return [*rows, ("most disputed", disputed)] if disputed else rows


def _steadiness(one: Steadiness) -> str:
    """How well a person agrees with their own answers."""
    if one.same is None:
        return "nothing rated twice"
    alike = f"{one.repeats} rated twice, {one.same:.0%} alike, mean difference {one.difference:.2f}"
    return f"{alike}, {one.measure}: {_number(one.value)}"


def _number(value: float | None) -> str:
    return "not defined (too few ratings, or all alike)" if value is None else f"{value:.3f}"


def _shown(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, dict):
        return ", ".join(
            f"{count} {name}" if type(count) is int else f"{name}: {_shown(count)}" for name, count in value.items()
        )
    if isinstance(value, list):
        return ", ".join(" ".join(map(str, v)) if isinstance(v, list) else str(v) for v in value) or "none"
    return "none" if value is None else str(value)
