"""The results of a study as tables: participants, runs, answers, scores of questionnaires, and ratings."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..collect.rating import ratings_of
from ..core.devices import NETWORK_DEVICE
from ..core.vectors import lengths
from ..core.wording import counted
from ..datasets.manifest import LOG, MANIFEST, read_manifest
from ..errors import RecordError
from ..record.files import read_bytes, safe_stem, write_atomically
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from ..scenegen.scenario.parse import parse_settings
from .answers import read_answers, state_of
from .folder import ANSWERS, PERSONAL, RATED, STUDY, read_state, require_outside
from .plan import PRACTICE_CHECK, condition_of
from .questions import Likert, question_kind
from .scales import Item, scale_named

Row = dict[str, Any]
_PAGES = ("done", "consented", "answers")  # events that end a page
_FAST, _STILL, _FEWEST_RATINGS = 1.0, 0.5, 5  # s on a page; m in a run; ratings that may be compared
TABLES = parse_settings(Path(__file__).with_name("tables.yaml"))  # meaning of each column, by table


def save_results(out: str | Path, folder: str | Path, *, personal: bool = False) -> dict[Path, int]:
    """Write the results of a study as CSV tables, one row for each participant, run, answer, score and rating.

    A score is the mean of the items of a table with `score: true`, or of one part of a published questionnaire;
    opposite items are reversed.

    Args:
        out: folder of the study.
        folder: for the tables; created if it does not exist.
        personal: whether personal answers are included.

    Returns:
        Number of rows by path of the table.

    Raises:
        ConfigError: the tables would be in the folder of the study.
        RecordError: the folder is not the folder of a study, a file is damaged, or a table cannot be written.
    """
    counts, tables = {}, results_of(out, personal=personal)
    require_outside(out, folder)
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordError(f"{folder} cannot be written: {error.strerror or error}") from error
    for name, rows in tables.items():
        path = Path(folder) / f"{name}.csv"
        write_atomically(path, table_of(TABLES[name], rows))
        counts[path] = len(rows)
    return counts


def results_of(out: str | Path, *, personal: bool = False) -> dict[str, list[Row]]:
    """The rows of all tables, by name of the table; see `save_results`."""
    out = Path(out)
    state = read_state(out)
    participants = [id for id in state["participants"] if id not in state["withdrawn"]]
    events = {id: read_answers(out / STUDY / ANSWERS / f"{safe_stem(id)}.jsonl") for id in participants}
    secret = {
        id: read_answers(out / STUDY / PERSONAL / f"{safe_stem(id)}.jsonl") if personal else [] for id in participants
    }
    language = state["structure"]["config"]["languages"][0]
    runs = _run_rows(out, events)
    kept = {row["file"] for row in runs}
    rated = _rating_rows(out)
    ratings = [row for id in participants for row in rated.get(id, [])]
    answers = [row for id in participants for row in _answer_rows(id, [*events[id], *secret[id]], kept)]
    return {
        "participants": [
            _participant_row(id, language, events[id], runs, ratings) | _condition(state, id) for id in participants
        ],
        "runs": runs,
        "pages": [row for id in participants for row in _page_rows(id, events[id])],
        "answers": answers,
        "scores": _score_rows(answers, state["structure"]["config"]),
        "ratings": ratings,
    }


def table_of(columns: Collection[str], rows: Iterable[Row]) -> bytes:
    """A table as CSV in UTF-8.

    A text that a spreadsheet would take for a formula, or that begins with an apostrophe, is preceded by an apostrophe.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow([_cell(row.get(column)) for column in columns])
    return text.getvalue().encode()


def _cell(value: Any) -> Any:
    if isinstance(value, bool):
        return int(value)
    if isinstance(value, str):
        value = value.replace("\r\n", "\n").replace("\r", "\n")  # would begin a row
        return f"'{value}" if value[:1] in ("=", "+", "-", "@", "\t", "\n", "'") else value
    return "" if value is None else value


def _participant_row(id: str, first_language: str, events: list[Row], runs: list[Row], ratings: list[Row]) -> Row:
    last = {event["event"]: event["time"] for event in events}  # time of the last event of each kind
    state = state_of(events)
    languages = [event["language"] for event in events if "language" in event]
    own = [row for row in ratings if row["participant"] == id]
    return {
        "participant": id,
        "language": languages[-1] if languages else first_language if events else None,
        "state": state,
        "last_step": next((event["step"] for event in reversed(events) if "step" in event), None),
        "begun": events[0]["time"] if events else None,
        "consented": last.get("consented"),
        "finished": last["finished"] if state == "finished" else None,
        "last_event": events[-1]["time"] if events else None,
        "runs": sum(row["participant"] == id for row in runs),
        "ratings": len(own),
        **next((event["device"] for event in reversed(events) if event["event"] == "device"), {}),
        "flags": "; ".join(_flags(events, [row for row in runs if row["participant"] == id], own)) or None,
    }


def _condition(state: Mapping[str, Any], id: str) -> Row:
    """The row of the Latin square of a participant, and its meaning."""
    config, row = state["structure"]["config"], state["rows"].get(id)
    scenarios = [block["scenario"] for block in config["runs"]]
    number = state["participants"].index(id) if row is None else row
    return {"row": row, "condition": condition_of(config["order"], scenarios, number) or None}


def _flags(events: list[Row], runs: list[Row], ratings: list[Row]) -> Iterator[str]:
    """Reasons to doubt the data of a participant, for the researcher to look at."""
    if fast := sum(event.get("seconds", _FAST) < _FAST for event in events if event["event"] in _PAGES):
        yield f"{counted(fast, 'page')} under {_FAST:g} s"
    if still := sum(row["path_length"] < _STILL for row in runs):
        yield f"{counted(still, 'run')} without driving"
    if wrong := Counter(name for event in events for name in event.get("wrong", ())):
        parts = ", ".join(f"{name} {count}" for name, count in wrong.items())
        yield f"{counted(wrong.total(), 'wrong check')} ({parts})"
    if failed := sum(event.get("failed", False) for event in events):
        yield f"{counted(failed, 'practice run')} without reaching the goal"
    if len(ratings) >= _FEWEST_RATINGS and len({row["label"] for row in ratings}) == 1:
        yield "all ratings are equal"


def _page_rows(id: str, events: list[Row]) -> list[Row]:
    """The time of each page, consent and page of questions."""
    return [
        {"participant": id} | {key: event.get(key) for key in ("step", "seconds", "time")}
        for event in events if event["event"] in _PAGES and "seconds" in event
    ]  # fmt: skip


def _run_rows(out: Path, events: dict[str, list[Row]]) -> list[Row]:
    """The kept runs, in the order in which each participant drove them."""
    if not (out / MANIFEST).exists():
        return []
    listed = {row["name"]: row for row in read_manifest(out)["files"]}
    dropped = _dropped_ticks(out)
    rows = []
    for id, lines in events.items():
        kept = {event["file"]: event for event in lines if event["event"] == "kept"}
        repeated = Counter(event["step"] for event in lines if event["event"] in ("replaced", "redone"))
        files = [name for name, row in listed.items() if row["contributor"] == id]
        for order, name in enumerate(sorted(files), start=1):  # names of one participant begin with the time
            record = read_episode(out / name)
            step = kept.get(name, {}).get("step")
            median, percentile = record.round_trip_summary() or (None, None)
            row = {
                "participant": id,
                "order": order,
                "step": step,
                "scenario": record.scene().name,
                "scene": record.episode,
                "file": name,
                "outcome": record.outcome.status,
                "seconds": round(float(record.states.time[-1]), 4),
                "path_length": round(float(lengths(np.diff(record.states.robot[:, :2], axis=0)).sum()), 3),
                "device": _devices(record),
                "attempts": 1 + repeated[step],
                "dropped_ticks": dropped.get(name),
                "round_trip_median": None if median is None else round(median, 4),
                "round_trip_95": None if percentile is None else round(percentile, 4),
                "predicted": round(float(np.mean(record.predicted)), 3),
                "label": record.label if isinstance(record.label, str | int | float | None) else str(record.label),
            }
            rows.append(row)
    return rows


def _devices(record: EpisodeRecord) -> str | None:
    """The devices that were used in a run, such as `keyboard, mouse`."""
    used = {event["device"] for frame in record.document["frames"] for event in frame["events"]}
    return ", ".join(sorted(used - {NETWORK_DEVICE, "label"})) or None


def _dropped_ticks(out: Path) -> dict[str, int]:
    """Ticks of real time that were not simulated, by file, from the log of the runs."""
    dropped = {}
    path = out / LOG
    for line in read_bytes(path).splitlines() if path.exists() else ():
        try:
            event = orjson.loads(line)
        except ValueError:
            continue  # a line that a crash cut off
        if event.get("event") == "kept":
            dropped[event["file"]] = event["dropped_ticks"]
    return dropped


def _answer_rows(id: str, events: list[Row], kept: set[str]) -> list[Row]:
    """The latest answers to each question; those about runs that were driven again are left out."""
    latest: dict[tuple[str, str], Row] = {}
    for event in events:
        if event["event"] == "answers" and (event.get("file") is None or event["file"] in kept):
            for question, value in event["values"].items():
                latest[event["step"], question] = event | {"question": question, "value": value}
    rows = []
    for event in latest.values():
        values = event["value"] if isinstance(event["value"], dict) else {"": event["value"]}
        base = {"participant": id, **{key: event.get(key) for key in ("step", "file", "question", "time")}}
        rows += [base | {"item": item, "value": value} for item, value in values.items()]
    return rows


def _score_rows(answers: Iterable[Row], config: Mapping[str, Any]) -> list[Row]:
    """The mean of each part of each table that has scores and was answered."""
    check = (config.get("practice") or {}).get("check", ())
    sections = {PRACTICE_CHECK: check} | {section: config[section] for section in ("demographics", "after_run", "end")}
    tables = {(section, entry["name"]): entry for section, entries in sections.items() for entry in entries}
    points_of: dict[tuple[Any, ...], dict[str, int]] = {}  # by row of the table, for each answered table
    for row in answers:
        if row["item"]:
            key = tuple(row[column] for column in ("participant", "step", "file", "question"))
            points_of.setdefault(key, {})[row["item"]] = row["value"]
    rows = []
    for (participant, step, file, question), values in points_of.items():
        section = "after_run" if step.startswith("after-run-") else step
        points, items = _items_of(tables[section, question])
        for part in dict.fromkeys(item.subscale for item in items):
            answered = [item for item in items if item.subscale == part and item.name in values]
            scores = [points + 1 - values[item.name] if item.reversed else values[item.name] for item in answered]
            if scores:
                row = {"participant": participant, "step": step, "file": file, "table": question, "part": part}
                rows.append(row | {"score": round(sum(scores) / len(scores), 4), "items": len(scores)})
    return rows


def _items_of(entry: Mapping[str, Any]) -> tuple[int, Sequence[Item]]:
    """Number of points, and items, of a table; no items for questions without scores."""
    if "scale" in entry:
        scale = scale_named(entry["scale"]).part(entry["subscales"])
        return scale.points, scale.items
    if issubclass(question_kind(entry["kind"]), Likert) and entry.get("score"):
        return entry["points"], [Item.model_construct(**item) for item in entry["items"]]  # the structure has no texts
    return 0, ()


def _rating_rows(out: Path) -> dict[str, list[Row]]:
    """The ratings of each participant."""
    folder = out / RATED
    rows: dict[str, list[Row]] = {}
    for block in sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []:
        for rating in ratings_of(block):
            facts = {key: getattr(rating, key) for key in ("file", "showing", "label", "seconds", "whole", "time")}
            rows.setdefault(rating.rater, []).append({"participant": rating.rater, "block": block.name} | facts)
    return rows
