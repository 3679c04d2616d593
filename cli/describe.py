"""The command `sonata2d describe`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .command import Command
from .options import PATH, examples, json_option
from .output import show_json, show_table, wants_json

if TYPE_CHECKING:
    from sonata2d.collect.agreement import Agreement, RaterConsistency
    from sonata2d.core.attributes import Attributes
    from sonata2d.core.geometry import Shape
    from sonata2d.core.scene import Scene, Unmeasured

Rows = list[tuple[str, object]]

_COUNTED_IN_FILES = "scenario", "controller", "seed", "outcomes", "families", "physics version", "sonata2d"
_MAX_DISPUTED = 5  # disputed runs printed without --json


@click.command(cls=Command, epilog=examples("describe demo", "describe demo/000000.json", "describe demo --json"))
@click.argument("path", type=PATH, metavar="DIR|FILE")
@json_option
def command(path: Path) -> None:
    """Summarise a data set or an episode file.

    Shows the scenario, controller, people, outcome and columns; for rated data sets also how well the raters agree.
    """
    from sonata2d.record.shard_file import is_shard

    ratings: list[Agreement] = []
    if path.is_dir() or is_shard(path):
        from sonata2d.collect.agreement import agreements
        from sonata2d.collect.rating import ratings_of
        from sonata2d.datasets.manifest.read import has_manifest

        ratings = agreements(ratings_of(path))
        rows = _dataset_rows(path) if has_manifest(path) else _rows_of_files(path, is_rated=bool(ratings))
    else:
        rows = _episode_rows(path)
    if wants_json():
        values = {name.replace(" ", "_"): value for name, value in rows}
        show_json(values | {"ratings": ratings} if ratings else values)
    else:
        rows += [row for agreement in ratings for row in _agreement_rows(agreement)]
        show_table(line for name, value in rows for line in _lines(name, value))


def _rows_of_files(path: Path, *, is_rated: bool) -> Rows:
    """Contents of the episodes of a folder or shard without a manifest."""
    from sonata2d.datasets.dataset import Dataset
    from sonata2d.datasets.summaries import totals_of
    from sonata2d.errors import RecordError

    try:
        dataset = Dataset(path)
    except RecordError:
        if is_rated:  # the rated files may lie elsewhere
            return [("folder", str(path))]
        raise
    values: dict[str, Counter[Any]] = {name: Counter() for name in _COUNTED_IN_FILES}
    files: list[dict[str, Any]] = []
    for record in dataset:
        files.append({"ticks": len(record), **record.counts()})
        document = record.document
        facts = record.scene().name, record.controller_info.path, record.seed, record.outcome.status, record.family
        for counter, value in zip(
            values.values(), (*facts, document["physics"], document["software"]["sonata2d"]), strict=True
        ):
            counter[value] += 1
    totals = totals_of(files)
    counts = {name: dict(sorted(counter.items())) for name, counter in values.items()}
    return [
        ("files", str(path)),
        *((name, _only(counts.pop(name))) for name in ("scenario", "controller", "seed")),
        ("episodes", len(files)),
        ("frames", totals.frames),
        ("outcomes", counts.pop("outcomes")),
        ("contacts", totals.contacts),
        *([("commands beyond limits", totals.excess)] if totals.excess else []),
        ("families", counts.pop("families")),
        *((name, _only(versions)) for name, versions in counts.items()),
    ]


def _only(values: Iterable[object]) -> object:
    """The only value, or all of them as a list."""
    found = list(values)
    return found[0] if len(found) == 1 else found


def _dataset_rows(folder: Path) -> Rows:
    """Contents of the manifest of a data set."""
    from sonata2d.datasets.manifest import read_manifest, unlisted_episodes
    from sonata2d.datasets.summaries import totals_of

    manifest = read_manifest(folder)
    files, counts = manifest["files"], manifest["counts"]
    totals = totals_of(files)
    origin: Rows = [
        ("scenario", manifest["name"]),
        ("controller", manifest["controller"] and manifest["controller"]["path"]),
        ("seed", manifest["seed"]),
        ("contributors", counts.get("contributor")),
    ]
    unlisted = unlisted_episodes(folder, manifest)
    rows: Rows = [
        ("data set", str(folder)),
        *((name, value) for name, value in origin if value is not None),
        ("episodes", f"{len(files)} of {manifest['episodes']}{'' if manifest['complete'] else ', interrupted'}"),
        *([("interrupted", unlisted)] if unlisted else []),
        *([("shards", f"{len(manifest['shards'])} of {manifest['shard_size']} each")] if "shards" in manifest else []),
        ("frames", totals.frames),
        ("bytes", totals.bytes),
        ("outcomes", counts["outcome"]),
        ("contacts", totals.contacts),
        *([("commands beyond limits", totals.excess)] if totals.excess else []),
        ("families", counts["family"]),
        ("physics version", manifest["physics"]),
        ("sonata2d", manifest["software"]["sonata2d"]),
    ]
    if manifest.get("keep"):
        rows += [("kept are", ", ".join(manifest["keep"])), ("left out", manifest["left_out"] or "none")]
    if manifest.get("mirrored"):
        rows.append(("mirrored", "each episode is the mirror image of the one generated from settings and seed"))
    if manifest.get("sources"):
        rows.append(("merged from", [_source_text(source) for source in manifest["sources"]]))
    if manifest["split"]:
        rows.append(("split", {part: len(names) for part, names in manifest["split"].items()}))
    return rows + (_answer_rows(folder, files) + _delay_rows(folder, files) if manifest["collected"] else [])


def _source_text(source: dict[str, Any]) -> str:
    """One source of a merged data set."""
    scenario = source["scenario"] or "driven by people"
    seed = "" if source["seed"] is None else f", seed {source['seed']}"
    mirrored = ", mirrored" if source.get("mirrored") else ""
    return f"{source['name']}: {len(source['files'])} of {scenario}{seed}{mirrored}"


def _answer_rows(folder: Path, files: list[dict[str, Any]]) -> Rows:
    """Counts of the labels of whole runs, by question."""
    from sonata2d.core.labels import LabelSpec
    from sonata2d.record.canonical import parse_header
    from sonata2d.record.files import read_bytes

    answers: dict[str, Counter[str]] = {}
    for file in files:
        header = parse_header(read_bytes(folder / file["name"]))
        if "label" in header:
            spec = LabelSpec.from_settings(header["label_spec"])
            answers.setdefault(spec.question or spec.name, Counter())[spec.in_words(header["label"])] += 1
    return [(f"answers to {question!r}", dict(sorted(counts.items()))) for question, counts in answers.items()]


def _delay_rows(folder: Path, files: list[dict[str, Any]]) -> Rows:
    """Delay with which drivers saw the world, if they drove in a browser."""
    import numpy as np

    from sonata2d.record.reader import read_episode

    trips = {}
    for file in files:
        summary = read_episode(folder / file["name"]).round_trip_summary()
        if summary is not None:
            trips[file["name"]] = summary
    if not trips:
        return []
    medians, percentiles = np.array(list(trips.values())).T
    slowest = max(trips, key=lambda name: trips[name])
    words = f"median {np.median(medians):.3f} s, 95th percentile {np.median(percentiles):.3f} s"
    return [("round trip", f"{words} (medians of {len(trips)} runs); slowest run {trips[slowest][0]:.3f} s, {slowest}")]


def _outline_text(shape: Shape) -> str:
    """The outline of a robot in words."""
    from sonata2d.core.geometry import Disc, Rectangle

    length, width = shape.sides
    if isinstance(shape, Disc):
        return f"radius {shape.radius:g} m"
    kind = "rectangle" if isinstance(shape, Rectangle) else f"polygon of {len(shape.core)} corners"
    return f"{kind}, {length:g} m long, {width:g} m wide"


def _attributes(scene: Scene) -> dict[str, Any]:
    """The attributes of people, objects, areas and the episode: names and values, with how many have each."""
    holders: dict[str, list[Attributes | None]] = {
        "people": [human.attributes for human in scene.humans],
        "objects": [piece.attributes for piece in scene.furniture],
        "areas": [area.attributes for area in scene.areas],
        "the episode": [scene.attributes_of()],
    }
    found: dict[str, Any] = {}
    for of, all_values in holders.items():
        pairs = [(name, value) for values in all_values for name, value in (values or {}).items()]
        counts = Counter(name if isinstance(value, float) else f"{name}={value}" for name, value in pairs)
        if counts:
            found[of] = sorted(counts) if of == "the episode" else dict(sorted(counts.items()))
    return found


def _measured(scene: Scene, name: Unmeasured, text: str) -> str:
    """The text, unless the source of an imported episode lacks the value."""
    return "not in the source" if name in scene.unmeasured else text


def _episode_rows(path: Path) -> Rows:
    """Contents of an episode file."""
    from sonata2d.core.entities import DEFAULT_KIND
    from sonata2d.datasets.summaries import totals_of
    from sonata2d.record.reader import read_episode

    record = read_episode(path)
    scene, document = record.scene(), record.document
    totals = totals_of([{"ticks": len(record), **record.counts()}])
    walking = sum(human.walks_at_start and human.enters == 0 for human in scene.humans)
    recorded = sum(human.behaviour == "recorded" for human in scene.humans)
    sometimes_absent = int((~record.states.present).any(axis=0).sum())
    missing = record.never_entered
    other_paths = [info.path for info in record.controller_info.others]
    landmarks = {
        "doors": scene.doors,
        "interior doors": scene.interior_doors,
        "queues": scene.queues,
        "places of interest": scene.places,
    }
    goal = f"({scene.goal.x:.6g}, {scene.goal.y:.6g}), reached within {scene.goal.distance:g} m"
    if scene.goal.then:
        goal += ", then " + ", ".join(f"({x:.6g}, {y:.6g})" for x, y in scene.goal.then)
    if scene.goal.person is not None:
        goal = f"{scene.goal.task} person {scene.goal.person}, near within {scene.goal.near:g} m" + (
            "" if scene.goal.moves else f", at {goal}"
        )
    kinds = Counter(human.kind for human in scene.humans)
    rows: Rows = [
        ("episode", record.id),
        ("scenario", scene.family),
        ("seed, episode", [record.seed, record.episode]),
        ("controller", record.controller_info.path),
        *([("other robots", dict(Counter(other_paths)))] if other_paths else []),
        ("contributor", record.contributor),
        ("context", record.context),
        ("people", f"{len(scene.humans)}, {walking} of them walking at the start"),
        *([("kinds of people", dict(sorted(kinds.items())))] if [*kinds] not in ([], [DEFAULT_KIND]) else []),
        *([("areas", [area.name for area in scene.areas])] if scene.areas else []),
        *((f"attributes of {of}", value) for of, value in _attributes(scene).items()),
        *([("recorded people", recorded)] if recorded else []),
        *([("people who come or go", sometimes_absent)] if sometimes_absent else []),
        *([("never entered", f"{_text(missing)}; the place where they enter was occupied")] if missing else []),
        ("ignore the robot", sum(human.reacts_to_robot == 0.0 for human in scene.humans)),
        ("towards the robot", dict(sorted(Counter(human.reaction for human in scene.humans).items()))),
        ("objects", [thing.type for thing in scene.furniture]),
        *((kind, len(marks)) for kind, marks in landmarks.items() if marks),
        ("interactions", [[i.src, i.relation, i.dst] for i in scene.interactions]),
        ("robot", _measured(scene, "robot", f"{scene.robot.kinematics}, {_outline_text(scene.robot.outline)}")),
        ("goal", _measured(scene, "goal", goal)),
        ("frames", f"{len(record)}, one each {scene.rules.dt} s"),
        ("outcome", f"{record.outcome.status}: {record.outcome.reason}"),
        ("contacts", totals.contacts),
        *([("commands beyond limits", totals.excess)] if totals.excess else []),
        ("labels", document["labels"] or "the command itself"),
        ("not placed", list(scene.dropped)),
    ]
    if branched := document["branched_from"]:
        rows.append(("branched from", f"{branched['id']} at tick {branched['tick']}"))
    if mirrored := document.get("mirrored_from"):
        rows.append(("mirror image of", mirrored["id"]))
    if imported := document.get("imported"):
        rows.append(("imported from", f"{imported['file']} ({imported['format']})"))
        remarks = imported.get("tracks") or {}
        rows += [("about the tracks", remark) for remark in (*remarks.get("notes", ()), *remarks.get("doubts", ()))]
        rows.append(("not in the source", imported["lacks"]))
    for block in ("robot", "humans", "command"):  # other keys may hold anything
        columns = document["columns"][block]
        rows.append((f"{block} columns", [f"{c['name']} [{c['unit']}, {c['frame']}]" for c in columns]))
    return rows


def _agreement_rows(agreement: Agreement) -> Rows:
    """Agreement of the ratings of one question, in short."""
    ratings = f"{agreement.ratings}, of {agreement.runs} runs; {agreement.shared} of them rated by two or more"
    rows: Rows = [
        ("asked", f"{agreement.spec.question or agreement.spec.name} ({agreement.spec.kind})"),
        ("raters", list(agreement.raters)),
        ("ratings", ratings),
    ]
    if agreement.measure:
        rows.append(("between raters", f"{agreement.measure}: {_coefficient(agreement.alpha)}"))
    rows += [(f"within {within.rater}", _consistency_text(within)) for within in agreement.within]
    disputed = [
        f"{run.file} ({', '.join(f'{rater}: {label}' for rater, label in run.labels.items())})"
        for run in agreement.disputed[:_MAX_DISPUTED]
    ]
    return [*rows, ("most disputed", disputed)] if disputed else rows


def _consistency_text(within: RaterConsistency) -> str:
    """Agreement of a rater's first and repeated ratings."""
    if within.same is None:
        return "no run rated twice"
    return (
        f"{within.repeats} rated twice, {within.same:.0%} equal, mean difference {within.difference:.2f},"
        f" {within.measure}: {_coefficient(within.value)}"
    )


def _coefficient(value: float | None) -> str:
    return "not defined (too few ratings, or all equal)" if value is None else f"{value:.3f}"


def _lines(name: str, value: Any) -> list[tuple[str, str]]:
    """A row as it is printed: contacts take one line for each kind."""
    from sonata2d.datasets.summaries import ContactSummary

    return value.rows() if isinstance(value, ContactSummary) else [(name, _text(value))]


def _text(value: Any) -> str:
    """Format a value in one line."""
    if isinstance(value, dict):
        return ", ".join(
            f"{count} {name}" if type(count) is int else f"{name}: {_text(count)}" for name, count in value.items()
        )
    if isinstance(value, list):
        return ", ".join(" ".join(map(str, v)) if isinstance(v, list) else str(v) for v in value) or "none"
    return "none" if value is None else str(value)
