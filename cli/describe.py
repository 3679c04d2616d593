"""`sonata2d describe`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from .output import json_option, show_json, show_table

Rows = list[tuple[str, object]]


@click.command(epilog="Examples:  sonata2d describe demo   ·   sonata2d describe demo/000000.json --json")
@click.argument("path", type=click.Path(path_type=Path), metavar="DIR|FILE")
@json_option
def command(path: Path, as_json: bool) -> None:
    """Say what an episode file or a data set holds: who, where, how it ended, and what its columns mean."""
    rows = _dataset(path) if path.is_dir() else _episode(path)
    if as_json:
        show_json({name.replace(" ", "_"): value for name, value in rows})
    else:
        show_table((name, _shown(value)) for name, value in rows)


def _dataset(folder: Path) -> Rows:
    """What the manifest tells."""
    from sonata2d.record import read_manifest

    manifest = read_manifest(folder)
    files, counts = manifest["files"], manifest["counts"]
    return [
        ("data set", str(folder)),
        ("scenario", manifest["name"]),
        ("controller", manifest["controller"]["path"]),
        ("seed", manifest["seed"]),
        ("episodes", f"{len(files)} of {manifest['episodes']}{'' if manifest['complete'] else ', interrupted'}"),
        ("frames", sum(file["ticks"] for file in files)),
        ("bytes", sum(file["bytes"] for file in files)),
        ("outcomes", counts["outcome"]),
        ("families", counts["family"]),
        ("physics version", manifest["physics"]),
        ("sonata2d", manifest["software"]["sonata2d"]),
    ]


def _episode(path: Path) -> Rows:
    """What the file tells."""
    from sonata2d.record import read_episode

    record = read_episode(path)
    scene, document = record.scene(), record.document
    wandering = sum(human.behaviour == "wandering" for human in scene.humans)
    return [
        ("episode", record.id),
        ("scenario", scene.family),
        ("seed, episode", [record.seed, record.episode]),
        ("controller", record.author.path),
        ("contributor", record.contributor),
        ("context", record.context),
        ("people", f"{len(scene.humans)}, {wandering} of them walking"),
        ("ignore the robot", sum(human.reacts_to_robot == 0.0 for human in scene.humans)),
        ("objects", [thing.type for thing in scene.furniture]),
        ("interactions", [[tie.src, tie.relation, tie.dst] for tie in scene.interactions]),
        ("robot", f"{scene.robot.kinematics}, radius {scene.robot.radius} m"),
        ("goal", f"({scene.goal.x}, {scene.goal.y}), reached within {scene.goal.distance} m"),
        ("frames", f"{len(record)}, one each {scene.rules.dt} s"),
        ("outcome", f"{record.outcome.status}: {record.outcome.reason}"),
        ("labels", document["labels"] or "the command itself"),
        ("not placed", list(scene.dropped)),
        *_columns(document["columns"]),
    ]


def _columns(columns: dict[str, list[dict[str, str]]]) -> Iterator[tuple[str, object]]:
    """What the numbers in a row mean."""
    for block, told in columns.items():
        yield f"{block} columns", [f"{c['name']} [{c['unit']}, {c['frame']}]" for c in told]


def _shown(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, dict):
        return ", ".join(
            f"{count} {name}" if isinstance(count, int) else f"{name}: {count}" for name, count in value.items()
        )
    if isinstance(value, list):
        return ", ".join(" ".join(map(str, v)) if isinstance(v, list) else str(v) for v in value) or "none"
    return "none" if value is None else str(value)
