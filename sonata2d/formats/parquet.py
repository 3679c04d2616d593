"""`parquet`: all episodes in four tables that join on `episode_id` and `tick`; nothing is lost.

| table | one row per | columns |
| --- | --- | --- |
| `episodes` | episode | family, seed, outcome, … and `header`, the other keys of the episode file as JSON |
| `frames` | frame, and the final state | time, robot, …; as JSON: contacts, doors, robots, events, label, sensors |
| `agents` | pedestrian present in a frame | pose, velocity, head, activity, radius, breadth |
| `interactions` | interaction in a frame | src, relation, dst |

A README.md with a `configs` header is written beside the tables: `datasets.load_dataset(folder, "agents")` uses it to
find a table. It does not name tables without rows, which `datasets` cannot load. With a size of shards each table is in
several files, `agents-00000.parquet` and so on, each with the rows of that many episodes. pyarrow is imported only when
it is needed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from ..core.files.locations import delete, file_names, make_folder
from ..core.files.optional import optional
from ..core.files.reading import require_readable
from ..core.files.whole_file import whole_file
from ..core.wording import one_line
from ..errors import RecordError
from ..record.files import write_atomically
from ..record.layout import ABSENT, COMMAND_NAMES, HUMAN_NAMES, ROBOT_NAMES, JsonDict
from ..record.record import EpisodeRecord
from ..record.tables import JSON_KEYS, TABLES, tables_of
from .format import Format, Options, Tables
from .importing import document_of, parsing

NAME = "parquet"
_ROW_GROUP, _GROUP_BYTES = 100_000, 1 << 24  # rows and bytes of a row group
_NEWER_KEYS = ("doors", "robots", "sensors")  # columns of `frames` that older tables do not have
_JOINED = 64  # tables of episodes that are joined at a time


@dataclass(frozen=True, slots=True)
class _PackedEpisode:
    """The rows of an episode, as workers send them.

    Attributes:
        path: of its file, for messages.
        key: which joins its rows.
        tables: by name, as Arrow writes them.
    """

    path: Path
    key: str
    tables: dict[str, bytes]


def pack(record: EpisodeRecord, key: str) -> _PackedEpisode:
    """The rows of an episode.

    Args:
        record: the episode.
        key: value of `episode_id`.

    Raises:
        RecordError: pyarrow is not installed.
    """
    pa, _ = _pyarrow()
    schemas, tables = _schemas(pa), {}
    for name, columns in tables_of(record, key).items():
        sink = pa.BufferOutputStream()
        with pa.ipc.new_stream(sink, schemas[name]) as writer:
            writer.write_table(pa.table(columns, schema=schemas[name]))
        tables[name] = sink.getvalue().to_pybytes()
    return _PackedEpisode(record.path, key, tables)


def write(episodes: Iterator[_PackedEpisode], out: Path, number: int | None) -> list[Path]:
    """Write the tables of episodes into a folder, all of them or none; only a few episodes are held in memory.

    Args:
        episodes: see `pack`.
        out: the folder; created if needed.
        number: of the part, whose tables have names such as `agents-00007.parquet`; None: `agents.parquet`.

    Returns:
        The tables.

    Raises:
        RecordError: pyarrow is not installed, two episodes have the same file name, or a file cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise RecordError(f"{out} is a file; the tables need a folder, choose another name")
    ending = ".parquet" if number is None else f"-{number:05d}.parquet"
    files = {name: out / f"{name}{ending}" for name in TABLES}
    pa, pq = _pyarrow()
    schemas = _schemas(pa)
    options = {"write_page_checksum": True, "compression": "zstd"}
    try:
        make_folder(out)
        with ExitStack() as whole:  # only complete tables get their final names
            places = {name: whole.enter_context(whole_file(files[name])) for name in TABLES}
            with ExitStack() as stack:
                writers = {
                    name: stack.enter_context(_closing(pq.ParquetWriter(places[name], schemas[name], **options)))
                    for name in TABLES
                }
                _write_all(pa, episodes, writers)
    except OSError as error:
        raise RecordError(f"{out} cannot be written: {error.strerror or error}") from error
    return [*files.values()]


def finish(out: Path, parts: int) -> list[Path]:
    """Write the README.md of a folder, and remove the tables of a former export.

    Args:
        out: the folder.
        parts: number of parts; 0: the tables are not divided.

    Returns:
        The file.

    Raises:
        RecordError: it cannot be written.
    """
    for file in file_names(out):
        name, _, number = file.removesuffix(".parquet").rpartition("-")
        if name in TABLES and number.isdecimal() and int(number) >= parts:
            delete(out / file)
    for name in TABLES if parts else ():
        delete(out / f"{name}.parquet")
    ending = "-*.parquet" if parts else ".parquet"
    _, pq = _pyarrow()
    files = [file for file in sorted(file_names(out)) if file.endswith(".parquet")]
    # `datasets` loads no table without rows
    named = [name for name in TABLES if any(_has_rows(pq, out / file) for file in files if file.startswith(name))]
    configs = "".join(f'- config_name: {name}\n  data_files: "{name}{ending}"\n' for name in named)
    # the description of the tables is the table of this module's docstring
    description = [line for line in (__doc__ or "").splitlines() if line.startswith("|")]
    lines = [f"---\nconfigs:\n{configs}---", "# Episodes of sonata2d as tables", "", *description, ""]
    write_atomically(out / "README.md", "\n".join(lines).encode())
    return [out / "README.md"]


def _has_rows(pq: Any, path: Path) -> bool:
    """Whether a file of a table has rows."""
    with path.open("rb") as file:
        return bool(pq.read_metadata(file).num_rows)


@contextmanager
def _closing(writer: Any) -> Iterator[Any]:
    """Close a ParquetWriter at the end of the block; after an error it must not write again when it is collected."""
    try:
        yield writer
        writer.close()
    finally:
        writer.is_open = False


def _write_all(pa: Any, episodes: Iterator[_PackedEpisode], writers: dict[str, Any]) -> None:
    """Write the rows of each episode, in row groups of about 100 000 rows or 16 MB."""
    waiting: dict[str, list[Any]] = {name: [] for name in TABLES}
    names: set[bytes] = set()  # 8 bytes of each, as there may be millions
    for episode in episodes:
        digest = hashlib.blake2b(episode.key.encode(), digest_size=8).digest()
        if digest in names:
            raise RecordError(
                f"{episode.path}: another episode is also named {episode.key}, which joins the tables; rename one file"
            )
        names.add(digest)
        for table, data in episode.tables.items():
            parts = waiting[table]
            parts.append(pa.ipc.open_stream(data).read_all())
            if len(parts) >= _JOINED:  # many small tables take far more memory than a large one
                whole = pa.concat_tables(parts).combine_chunks()
                parts[:] = [whole]
                if len(whole) > _ROW_GROUP or whole.nbytes > _GROUP_BYTES:
                    writers[table].write_table(whole)
                    parts.clear()
    for table, rest in waiting.items():
        if any(map(len, rest)):  # readers refuse a row group without rows
            writers[table].write_table(pa.concat_tables(rest).combine_chunks())


def _pyarrow() -> tuple[Any, Any]:
    """pyarrow and its parquet module.

    Raises:
        RecordError: pyarrow is not installed; names the package to install.
    """
    return optional("pyarrow", RecordError), optional("pyarrow.parquet", RecordError)


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
            for part in _parts(path):
                tables = {name: _sorted_table(pa, pq, file, name) for name, file in part.items()}
                for episode in tables["episodes"].to_pylist():
                    yield _document(episode, *(_rows_of(tables[name], episode["episode_id"]) for name in TABLES[1:]))
    except (OSError, pa.ArrowException) as error:
        raise RecordError(f"{path} does not hold complete tables: {one_line(error, 200)}") from error


def _parts(folder: Path) -> Iterator[dict[str, Path]]:
    """The files of each part of the tables by name; of tables that are not divided, one part."""
    names = file_names(folder)
    endings = sorted(
        name.removeprefix("episodes") for name in names if name.startswith("episodes-") and name.endswith(".parquet")
    )
    for ending in endings or [".parquet"]:
        yield {name: folder / f"{name}{ending}" for name in TABLES}


def _sorted_table(pa: Any, pq: Any, path: Path, name: str) -> Any:
    """A table, sorted by episode and tick.

    Raises:
        KeyError: a column is missing.
        pyarrow.ArrowException: a column has another type, or the file is damaged.
        OSError: it is no file.
    """
    require_readable(path)
    with path.open("rb") as file:
        table, schema = pq.read_table(file, page_checksum_verification=True), _schemas(pa)[name]
    for column in schema:
        if column.name not in table.column_names:
            if column.name not in _NEWER_KEYS:
                raise KeyError(f"column {column.name} of {path.name}")
            table = table.append_column(column, pa.nulls(len(table), column.type))
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
    column = {human["id"]: k for k, human in enumerate(header["humans"])}
    humans: dict[int, list[Any]] = {row["tick"]: [None] * len(column) for row in frames}
    activity = {row["tick"]: [ABSENT] * len(column) for row in frames}
    edges: dict[int, list[Any]] = {row["tick"]: [] for row in frames}
    for row in agents:
        humans[row["tick"]][column[row["human_id"]]] = [row[key] for key in HUMAN_NAMES]
        activity[row["tick"]][column[row["human_id"]]] = header["activities"].index(row["activity"])
    for row in interactions:
        edges[row["tick"]].append([row["src"], row["relation"], row["dst"]])
    states = [_frame(row, humans[row["tick"]], activity[row["tick"]], edges[row["tick"]]) for row in frames]
    return document_of(header, states)


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
    "four tables that join: episodes, frames, agents, interactions",
    ".parquet",
    import_,
    tables=Tables(pack, write, finish),
    holds_robots=True,
)
