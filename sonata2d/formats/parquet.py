"""`parquet`: all episodes in four tables that join on `episode_id` and `tick`; nothing is lost.

| table | one row per | columns |
| --- | --- | --- |
| `episodes` | episode | family, seed, outcome, … and `header`, the other keys of the episode file as JSON |
| `frames` | frame, and the final state | time, robot, command, executed, guarded; contacts, events, label as JSON |
| `agents` | pedestrian present in a frame | pose, velocity, head, activity, radius, breadth |
| `interactions` | interaction in a frame | src, relation, dst |

A README.md with a `configs` header is written beside the tables: `datasets.load_dataset(folder, "agents")` uses it to
find a table. pyarrow is imported only when it is needed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import orjson

from ..core.humans import ACTIVITIES
from ..core.whole_file import TEMPORARY_PREFIX
from ..core.wording import one_line
from ..errors import RecordError
from ..record.files import file_stem, write_atomically
from ..record.layout import ABSENT, COMMAND_NAMES, HUMAN_NAMES, ROBOT_NAMES, JsonDict
from ..record.record import EpisodeRecord
from ..record.tables import JSON_KEYS, TABLES, tables_of
from .base import Format, Options
from .parse import parsing

NAME = "parquet"
_ROW_GROUP = 100_000  # rows


def export_all(records: Iterator[EpisodeRecord], out: Path) -> list[Path]:
    """Write the tables of all episodes into a folder; only a few episodes are held in memory.

    Args:
        records: the episodes.
        out: the folder; created if needed.

    Returns:
        The tables and their README.md.

    Raises:
        RecordError: pyarrow is not installed, two episodes have the same file name, or a file cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise RecordError(f"{out} is a file; the tables need a folder, choose another name")
    pa, pq = _pyarrow()
    schemas, files = _schemas(pa), {name: out / f"{name}.parquet" for name in TABLES}
    parts = {name: out / f"{TEMPORARY_PREFIX}{name}.tmp" for name in TABLES}
    options = {"write_page_checksum": True, "compression": "zstd"}
    try:
        out.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            writers = {
                name: stack.enter_context(_closing(pq.ParquetWriter(parts[name], schemas[name], **options)))
                for name in TABLES
            }
            _write_all(pa, records, writers, schemas)
        for name in TABLES:  # only complete tables get their final names
            os.replace(parts[name], files[name])
    except OSError as error:
        raise RecordError(f"{out} cannot be written: {error.strerror or error}") from error
    finally:
        for part in parts.values():
            part.unlink(missing_ok=True)
    write_atomically(out / "README.md", _readme().encode())
    return [*files.values(), out / "README.md"]


@contextmanager
def _closing(writer: Any) -> Iterator[Any]:
    """Close a ParquetWriter at the end of the block; after an error it must not write again when it is collected."""
    try:
        yield writer
        writer.close()
    finally:
        writer.is_open = False


def _write_all(pa: Any, records: Iterator[EpisodeRecord], writers: dict[str, Any], schemas: dict[str, Any]) -> None:
    """Write the rows of each episode, in row groups of about 100 000 rows."""
    waiting: dict[str, list[Any]] = {name: [] for name in TABLES}
    names: set[str] = set()
    for record in records:
        if (name := file_stem(record.path)) in names:
            raise RecordError(
                f"{record.path}: another episode is also named {name}, but names join the tables; rename one file"
            )
        names.add(name)
        for table, columns in tables_of(record, name).items():
            waiting[table].append(pa.table(columns, schema=schemas[table]))
            if sum(len(part) for part in waiting[table]) > _ROW_GROUP:
                writers[table].write_table(pa.concat_tables(waiting[table]))
                waiting[table] = []
    for table, rest in waiting.items():
        if rest:
            writers[table].write_table(pa.concat_tables(rest))


def _pyarrow() -> tuple[Any, Any]:
    """pyarrow and its parquet module.

    Raises:
        RecordError: pyarrow is not installed; names the package to install.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise RecordError(f"{NAME} needs pyarrow: pip install 'sonata2d[parquet]'") from error
    return pa, pq


def _schemas(pa: Any) -> dict[str, Any]:
    number, integer, text = pa.float64(), pa.int64(), pa.string()
    episode_key = {"episode_id": text}
    frame_key = episode_key | {"tick": integer}
    robot = {f"robot_{name}": number for name in ROBOT_NAMES}
    twists = {f"{kind}_{name}": number for kind in ("command", "executed") for name in COMMAND_NAMES}
    human = dict.fromkeys(HUMAN_NAMES, number)
    tables = {
        "episodes": episode_key
        | dict.fromkeys(("name", "family", "contributor", "context", "outcome", "outcome_reason"), text)
        | dict.fromkeys(("seed", "episode", "physics", "frames"), integer)
        | dict.fromkeys(("dt", "goal_x", "goal_y", "goal_distance", "robot_radius"), number)
        | {"label": text, "header": text},
        "frames": frame_key
        | {"time": number}
        | robot
        | twists
        | {"guarded": pa.bool_()}
        | dict.fromkeys(JSON_KEYS, text),
        "agents": frame_key | {"human_id": integer} | human | {"activity": text, "radius": number, "breadth": number},
        "interactions": frame_key | {"src": integer, "relation": text, "dst": integer},
    }
    return {name: pa.schema(list(columns.items())) for name, columns in tables.items()}


def _readme() -> str:
    """README.md of the folder; the description of the tables is that of this module."""
    configs = "".join(f"- config_name: {name}\n  data_files: {name}.parquet\n" for name in TABLES)
    description = [line for line in (__doc__ or "").splitlines() if line.startswith("|")]
    return "\n".join([f"---\nconfigs:\n{configs}---", "# Episodes of sonata2d as tables", "", *description, ""])


def import_(path: Path, options: Options) -> Iterator[JsonDict]:
    """Yield the episodes that were exported.

    Args:
        path: the folder of the tables.
        options: not used.

    Raises:
        RecordError: pyarrow is not installed, or a table is missing or damaged.
    """
    pa, pq = _pyarrow()
    if not path.is_dir():
        raise RecordError(f"{path} is not a folder; {NAME} data are a folder with the tables {', '.join(TABLES)}")
    try:
        with parsing(path, NAME):
            tables = {name: _sorted_table(pa, pq, path / f"{name}.parquet", name) for name in TABLES}
            for episode in tables["episodes"].to_pylist():
                yield _document(episode, *(_rows_of(tables[name], episode["episode_id"]) for name in TABLES[1:]))
    except (OSError, pa.ArrowException) as error:
        raise RecordError(f"{path} does not hold complete tables: {one_line(error, 200)}") from error


def _sorted_table(pa: Any, pq: Any, path: Path, name: str) -> Any:
    """A table, sorted by episode and tick.

    Raises:
        KeyError: a column is missing.
        pyarrow.ArrowException: a column has another type, or the file is damaged.
    """
    table, schema = pq.read_table(path, page_checksum_verification=True, partitioning=None), _schemas(pa)[name]
    for column in schema:
        if column.name not in table.column_names:
            raise KeyError(f"column {column.name} of {path.name}")
    keys = [("episode_id", "ascending")] + ([] if name == "episodes" else [("tick", "ascending")])
    return table.select(schema.names).cast(schema).sort_by(keys)


def _rows_of(table: Any, episode: str) -> list[JsonDict]:
    """The rows of one episode."""
    import pyarrow.compute as pc

    rows: list[JsonDict] = table.filter(pc.equal(table["episode_id"], episode)).to_pylist()
    return rows


def _document(
    episode: JsonDict, frames: list[JsonDict], agents: list[JsonDict], interactions: list[JsonDict]
) -> JsonDict:
    """The document, with keys in the order of the recorder."""
    header = orjson.loads(episode["header"])
    software, activities = header.pop("software"), header.get("activities", list(ACTIVITIES))
    column = {human["id"]: k for k, human in enumerate(header["humans"])}
    humans: dict[int, list[Any]] = {row["tick"]: [None] * len(column) for row in frames}
    activity = {row["tick"]: [ABSENT] * len(column) for row in frames}
    edges: dict[int, list[Any]] = {row["tick"]: [] for row in frames}
    for row in agents:
        humans[row["tick"]][column[row["human_id"]]] = [row[key] for key in HUMAN_NAMES]
        activity[row["tick"]][column[row["human_id"]]] = activities.index(row["activity"])
    for row in interactions:
        edges[row["tick"]].append([row["src"], row["relation"], row["dst"]])
    states = [_frame(row, humans[row["tick"]], activity[row["tick"]], edges[row["tick"]]) for row in frames]
    return {**header, "frames": states[:-1], "final": states[-1], "software": software}


def _frame(row: JsonDict, humans: list[Any], activity: list[int], interactions: list[Any]) -> JsonDict:
    """A frame, or the final state, which has no executed twist and often no command."""
    twists = {
        kind: [row[f"{kind}_{key}"] for key in COMMAND_NAMES]
        for kind in ("command", "executed")
        if row[f"{kind}_vx"] is not None
    }
    return {
        "tick": row["tick"],
        "time": row["time"],
        "robot": [row[f"robot_{key}"] for key in ROBOT_NAMES],
        **twists,
        **({"guarded": row["guarded"]} if row["guarded"] is not None else {}),
        "humans": humans,
        "activity": activity,
        "interactions": interactions,
        **{key: orjson.loads(row[key]) for key in JSON_KEYS if row[key] is not None},
    }


FORMAT = Format(
    "four tables that join: episodes, frames, agents, interactions", ".parquet", import_, export_all=export_all
)
