"""`parquet`: all episodes in four tables that join on `episode_id` and `tick`; nothing is lost.

| table | a row | columns |
| --- | --- | --- |
| `episodes` | an episode | family, seed, outcome, … and `header`, the text of its file's other keys |
| `frames` | a look, the final one too | time, robot, command, executed, guarded; contacts, events, label as JSON |
| `agents` | a person who is present at a look | pose, velocity, head, activity, radius |
| `interactions` | a tie at a look | src, relation, dst |

Beside them lies a README.md with a `configs` head, by which `datasets.load_dataset(folder, "agents")` finds a table.
pyarrow is asked for when it is needed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.humans import ACTIVITIES
from ..errors import RecordError
from ..record.files import TEMPORARY, stem_of, write_atomically
from ..record.layout import COMMAND_NAMES, HUMAN_NAMES, ROBOT_NAMES, Tree
from ..record.record import EpisodeRecord
from .base import Format, Options, parsing

NAME = "parquet"
TABLES = ("episodes", "frames", "agents", "interactions")
_GROUP = 100_000  # rows of a row group
_TEXTS = ("contacts", "events", "label")  # of frames, as JSON


def gather(records: Iterator[EpisodeRecord], out: Path) -> list[Path]:
    """Write the tables of all episodes into a folder, a few episodes at a time.

    Raises:
        RecordError: pyarrow is not installed, two episodes have the same file name, or nothing can be written.
    """
    pa, pq = _arrow()
    schemas, files = _schemas(pa), {name: out / f"{name}.parquet" for name in TABLES}
    parts = {name: out / f"{TEMPORARY}{name}.tmp" for name in TABLES}
    options = {"write_page_checksum": True, "compression": "zstd"}
    try:
        out.mkdir(parents=True, exist_ok=True)
        writers = {name: pq.ParquetWriter(parts[name], schemas[name], **options) for name in TABLES}
        try:
            _write_all(pa, records, writers, schemas)
        finally:
            for writer in writers.values():
                writer.close()
        for name in TABLES:
            os.replace(parts[name], files[name])
    except OSError as error:
        raise RecordError(f"{out} cannot be written: {error.strerror or error}") from error
    finally:
        for part in parts.values():
            part.unlink(missing_ok=True)
    write_atomically(out / "README.md", _card().encode())
    return [*files.values(), out / "README.md"]


def _write_all(pa: Any, records: Iterator[EpisodeRecord], writers: dict[str, Any], schemas: dict[str, Any]) -> None:
    """Write the rows of each episode, in groups of some hundred thousand."""
    waiting: dict[str, list[Any]] = {name: [] for name in TABLES}
    names: set[str] = set()
    for record in records:
        if (name := stem_of(record.path)) in names:
            raise RecordError(f"{record.path}: another episode is named {name} too; rename one, names join the tables")
        names.add(name)
        for table, columns in _rows(record, name).items():
            waiting[table].append(pa.table(columns, schema=schemas[table]))
            if sum(len(part) for part in waiting[table]) > _GROUP:
                writers[table].write_table(pa.concat_tables(waiting[table]))
                waiting[table] = []
    for table, rest in waiting.items():
        if rest:
            writers[table].write_table(pa.concat_tables(rest))


def _arrow() -> tuple[Any, Any]:
    """pyarrow and its parquet module.

    Raises:
        RecordError: they are not installed; says what is to be installed.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise RecordError(f"{NAME} needs pyarrow: pip install 'sonata2d[parquet]'") from error
    return pa, pq


def _schemas(pa: Any) -> dict[str, Any]:
    real, whole, text = pa.float64(), pa.int64(), pa.string()
    key = {"episode_id": text}
    moment = key | {"tick": whole}
    body = {f"robot_{name}": real for name in ROBOT_NAMES}
    acts = {f"{kind}_{name}": real for kind in ("command", "executed") for name in COMMAND_NAMES}
    tables = {
        "episodes": key
        | dict.fromkeys(("name", "family", "contributor", "context", "outcome", "outcome_reason"), text)
        | dict.fromkeys(("seed", "episode", "physics", "frames"), whole)
        | dict.fromkeys(("dt", "goal_x", "goal_y", "goal_distance", "robot_radius"), real)
        | {"label": text, "header": text},
        "frames": moment | {"time": real} | body | acts | {"guarded": pa.bool_()} | dict.fromkeys(_TEXTS, text),
        "agents": moment | {"human_id": whole} | dict.fromkeys(HUMAN_NAMES, real) | {"activity": text, "radius": real},
        "interactions": moment | {"src": whole, "relation": text, "dst": whole},
    }
    return {name: pa.schema(list(columns.items())) for name, columns in tables.items()}


def _rows(record: EpisodeRecord, name: str) -> dict[str, dict[str, Any]]:
    """Columns of each table for one episode."""
    looks = [*record.document["frames"], record.document["final"]]
    ties = [(look["tick"], *tie) for look in looks for tie in look["interactions"]]
    tick, src, relation, dst = (list(column) for column in zip(*ties, strict=True)) if ties else ([], [], [], [])
    return {
        "episodes": _episode(record, name),
        "frames": _frames(record, name, looks),
        "agents": _agents(record, name),
        "interactions": {
            "episode_id": [name] * len(ties), "tick": tick, "src": src, "relation": relation, "dst": dst
        },
    }  # fmt: skip


def _episode(record: EpisodeRecord, name: str) -> dict[str, Any]:
    document, scene = record.document, record.scene()
    header = {key: value for key, value in document.items() if key not in ("frames", "final")}
    row = {key: document[key] for key in ("name", "family", "contributor", "context", "seed", "episode", "physics")}
    row |= {
        "episode_id": name,
        "outcome": record.outcome.status,
        "outcome_reason": record.outcome.reason,
        "frames": len(record),
        "dt": scene.rules.dt,
        "goal_x": scene.goal.x,
        "goal_y": scene.goal.y,
        "goal_distance": scene.goal.distance,
        "robot_radius": scene.robot.radius,
        "label": _text(document, "label"),
        "header": orjson.dumps(header).decode(),
    }
    return {key: [value] for key, value in row.items()}


def _text(tree: Tree, key: str) -> str | None:
    return orjson.dumps(tree[key]).decode() if key in tree else None


def _frames(record: EpisodeRecord, name: str, looks: list[Tree]) -> dict[str, Any]:
    robot = {f"robot_{key}": record.looks.robot[:, k] for k, key in enumerate(ROBOT_NAMES)}
    acts = {
        f"{kind}_{key}": [look[kind][k] if kind in look else None for look in looks]
        for kind in ("command", "executed")
        for k, key in enumerate(COMMAND_NAMES)
    }
    return {
        "episode_id": [name] * len(looks),
        "tick": record.looks.tick,
        "time": record.looks.time,
        **robot,
        **acts,
        "guarded": [look.get("guarded") for look in looks],
        **{key: [_text(look, key) for look in looks] for key in _TEXTS},
    }


def _agents(record: EpisodeRecord, name: str) -> dict[str, Any]:
    """Whoever is present, look by look."""
    looks, people = record.looks, record.scene().humans
    t, k = np.nonzero(looks.present)
    names = np.array(record.document["activities"], dtype=object)
    rows = looks.humans[t, k]
    return {
        "episode_id": [name] * len(t),
        "tick": looks.tick[t],
        "human_id": np.array([human.id for human in people], dtype=np.int64)[k],
        **{key: rows[:, column] for column, key in enumerate(HUMAN_NAMES)},
        "activity": names[looks.activity[t, k]].tolist(),
        "radius": np.array([human.radius for human in people], dtype=float)[k],
    }


def _card() -> str:
    configs = "".join(f"- config_name: {name}\n  data_files: {name}.parquet\n" for name in TABLES)
    about = [line for line in (__doc__ or "").splitlines() if line.startswith("|")]
    return "\n".join([f"---\nconfigs:\n{configs}---", "# Episodes of sonata2d as tables", "", *about, ""])


def import_(path: Path, options: Options) -> Iterator[Tree]:
    """The episodes that were exported.

    Raises:
        RecordError: pyarrow is not installed, or a table is missing or damaged.
    """
    pa, pq = _arrow()
    if not path.is_dir():
        raise RecordError(f"{path} is no folder; {NAME} is a folder with {', '.join(TABLES)}")
    try:
        with parsing(path, NAME):
            tables = {name: _sorted(pa, pq, path / f"{name}.parquet", name) for name in TABLES}
            for episode in tables["episodes"].to_pylist():
                yield _document(episode, *(_part(tables[name], episode["episode_id"]) for name in TABLES[1:]))
    except (OSError, pa.ArrowException) as error:
        told = " ".join(str(error).split())
        raise RecordError(f"{path} holds no whole tables: {told:.200}") from error


def _sorted(pa: Any, pq: Any, path: Path, name: str) -> Any:
    """A table by episode and tick.

    Raises:
        ValueError: its columns are others, or of other types.
    """
    table, schema = pq.read_table(path, page_checksum_verification=True, partitioning=None), _schemas(pa)[name]
    for column in schema:
        if column.name not in table.column_names:
            raise KeyError(f"column {column.name} of {path.name}")
    keys = [("episode_id", "ascending")] + ([] if name == "episodes" else [("tick", "ascending")])
    return table.select(schema.names).cast(schema).sort_by(keys)


def _part(table: Any, episode: str) -> list[Tree]:
    """The rows of an episode in a sorted table."""
    import pyarrow.compute as pc

    rows: list[Tree] = table.filter(pc.equal(table["episode_id"], episode)).to_pylist()
    return rows


def _document(episode: Tree, frames: list[Tree], agents: list[Tree], ties: list[Tree]) -> Tree:
    """The document, keys in the order of the recorder."""
    header = orjson.loads(episode["header"])
    software, activities = header.pop("software"), header.get("activities", list(ACTIVITIES))
    column = {human["id"]: k for k, human in enumerate(header["humans"])}
    people: dict[int, list[Any]] = {row["tick"]: [None] * len(column) for row in frames}
    doing = {row["tick"]: [-1] * len(column) for row in frames}
    held: dict[int, list[Any]] = {row["tick"]: [] for row in frames}
    for row in agents:
        people[row["tick"]][column[row["human_id"]]] = [row[key] for key in HUMAN_NAMES]
        doing[row["tick"]][column[row["human_id"]]] = activities.index(row["activity"])
    for row in ties:
        held[row["tick"]].append([row["src"], row["relation"], row["dst"]])
    looks = [_look(row, people[row["tick"]], doing[row["tick"]], held[row["tick"]]) for row in frames]
    return {**header, "frames": looks[:-1], "final": looks[-1], "software": software}


def _look(row: Tree, people: list[Any], doing: list[int], ties: list[Any]) -> Tree:
    acts = {
        kind: [row[f"{kind}_{key}"] for key in COMMAND_NAMES]
        for kind in ("command", "executed")
        if row[f"{kind}_vx"] is not None
    }
    return {
        "tick": row["tick"],
        "time": row["time"],
        "robot": [row[f"robot_{key}"] for key in ROBOT_NAMES],
        **acts,
        **({"guarded": row["guarded"]} if row["guarded"] is not None else {}),
        "humans": people,
        "activity": doing,
        "interactions": ties,
        **{key: orjson.loads(row[key]) for key in _TEXTS if row[key] is not None},
    }


FORMAT = Format("four tables that join: episodes, frames, agents, interactions", ".parquet", import_, gather=gather)
