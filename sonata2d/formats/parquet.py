"""`parquet`: all episodes in two tables, `episodes` and `frames`; nothing is lost.

A README.md with a `configs` header is written beside the tables: `datasets.load_dataset(folder)` uses it to find the
frames, and `datasets.load_dataset(folder, "episodes")` the episodes. With a size of shards each table is in several
files, `frames-00000.parquet` and so on, each with the rows of that many episodes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson

from ..core.files.locations import delete, file_names
from ..core.files.reading import require_readable
from ..core.wording import one_line
from ..datasets import tables
from ..datasets.card.text import version_of
from ..datasets.tables import TABLES, PackedEpisode, pyarrow, schemas
from ..errors import RecordError
from ..record.files import sha256_of, write_atomically
from ..record.layout import ABSENT, COMMAND_NAMES, HUMAN_NAMES, ROBOT_NAMES, JsonDict
from ..record.record import EpisodeRecord
from ..record.tables import JSON_KEYS
from .format import Format, Options, Tables
from .importing import document_of, parsing

NAME = "parquet"
_OLDER = ("agents", "interactions")  # tables of sonata2d 0.3 and older
_NEWER_COLUMNS = (
    "human_contacts",
    "object_contacts",
    "wall_contacts",
    "doors",
    "robots",
    "sensors",
    "goal_x",
    "goal_y",
    "goal_theta",
    "humans",
    "interactions",
)


def pack(record: EpisodeRecord, key: str, options: Options) -> PackedEpisode:
    """The rows of an episode; see `tables.pack`."""
    return tables.pack(record, key)


def write(episodes: Iterator[PackedEpisode], out: Path, number: int | None) -> list[Path]:
    """Write the tables of episodes into a folder, all of them or none.

    Args:
        episodes: see `tables.pack`.
        out: the folder; created if needed.
        number: of the part, whose tables have names such as `frames-00007.parquet`; None: `frames.parquet`.

    Returns:
        The tables.

    Raises:
        RecordError: as of `tables.write`.
    """
    return tables.write(episodes, out, "" if number is None else f"-{number:05d}")


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
        is_older = file in {f"{older}.parquet" for older in _OLDER} or (name in _OLDER and number.isdecimal())
        if is_older or (name in TABLES and number.isdecimal() and int(number) >= parts):
            delete(out / file)
    for name in TABLES if parts else ():
        delete(out / f"{name}.parquet")
    ending = "-*.parquet" if parts else ".parquet"
    # the cache of `datasets` tells exports of one name apart by it
    tables_here = [file for file in sorted(file_names(out)) if file.endswith(".parquet")]
    version = version_of(hashlib.sha256("".join(sha256_of(out / file) for file in tables_here).encode()).digest())
    configs = "".join(
        f'- config_name: {name}\n  version: {version}\n  data_files: "{name}{ending}"\n'
        + "  default: true\n" * (name == "frames")
        for name in reversed(TABLES)
    )
    # the description of the tables is the table of the docstring of their module
    description = [line for line in (tables.__doc__ or "").splitlines() if line.startswith("|")]
    lines = [f"---\nconfigs:\n{configs}---", "# Episodes of sonata2d as tables", "", *description, ""]
    write_atomically(out / "README.md", "\n".join(lines).encode())
    return [out / "README.md"]


def import_(path: Path, options: Options) -> Iterator[JsonDict]:
    """Yield the episodes that were exported.

    Args:
        path: the folder of the tables.
        options: not used.

    Raises:
        RecordError: pyarrow is not installed, or a table is missing or damaged.
    """
    pa, pq = pyarrow()
    if not path.is_dir():
        raise RecordError(f"{path} is not a folder; {NAME} data are a folder with the tables {', '.join(TABLES)}")
    try:
        with parsing(path, NAME):
            for part in _parts(path):
                names = (*TABLES, *_OLDER) if part[_OLDER[0]].exists() else TABLES
                episodes, *others = (_sorted_table(pa, pq, part[name], name) for name in names)
                for episode in episodes.to_pylist():
                    yield _document(episode, *(_rows_of(table, episode["episode_id"]) for table in others))
    except (OSError, pa.ArrowException) as error:
        raise RecordError(f"{path} does not hold complete tables: {one_line(error, 200)}") from error


def _parts(folder: Path) -> Iterator[dict[str, Path]]:
    """The files of each part of the tables by name; of tables that are not divided, one part."""
    names = file_names(folder)
    endings = sorted(
        name.removeprefix("episodes") for name in names if name.startswith("episodes-") and name.endswith(".parquet")
    )
    for ending in endings or [".parquet"]:
        yield {name: folder / f"{name}{ending}" for name in (*TABLES, *_OLDER)}


def _sorted_table(pa: Any, pq: Any, path: Path, name: str) -> Any:
    """A table, sorted by episode and tick.

    Raises:
        KeyError: a column is missing.
        pyarrow.ArrowException: a column has another type, or the file is damaged.
        OSError: it is no file.
    """
    require_readable(path)
    with path.open("rb") as file:
        table, schema = pq.read_table(file, page_checksum_verification=True), schemas(pa).get(name)
    if schema is not None:
        for column in schema:
            if column.name not in table.column_names:
                if column.name not in _NEWER_COLUMNS:
                    raise KeyError(f"column {column.name} of {path.name}")
                table = table.append_column(column, pa.nulls(len(table), column.type))
        table = table.select(schema.names).cast(schema)
    return table.sort_by([("episode_id", "ascending")] + ([] if name == "episodes" else [("tick", "ascending")]))


def _rows_of(table: Any, episode: str) -> list[JsonDict]:
    """The rows of one episode."""
    import pyarrow.compute as pc

    rows: list[JsonDict] = table.filter(pc.equal(table["episode_id"], episode)).to_pylist()
    return rows


def _document(episode: JsonDict, frames: list[JsonDict], *older: list[JsonDict]) -> JsonDict:
    """The document, with keys in the order of the recorder."""
    header = orjson.loads(episode["header"])
    column = {human["id"]: k for k, human in enumerate(header["humans"])}
    rows = {frame["tick"]: frame for frame in frames}
    if older:  # people and interactions of all frames were tables of their own
        for frame in frames:
            frame |= {"humans": [], "interactions": []}
        for name, table in zip(("humans", "interactions"), older, strict=True):
            for row in table:
                rows[row["tick"]][name].append(row | {"id": row.get("human_id")})
    return document_of(header, [_frame(row, column, header["activities"]) for row in frames])


def _frame(row: JsonDict, column: dict[int, int], activities: list[str]) -> JsonDict:
    """A frame, or the final state, which has no executed twist and often no command.

    Args:
        row: of the table.
        column: index of each pedestrian in the lists of a frame, by id.
        activities: names of the activities.
    """
    humans: list[list[float] | None] = [None] * len(column)
    activity = [ABSENT] * len(column)
    for human in row["humans"]:
        humans[column[human["id"]]] = [human[key] for key in HUMAN_NAMES]
        activity[column[human["id"]]] = activities.index(human["activity"])
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
        "interactions": [[each["src"], each["relation"], each["dst"]] for each in row["interactions"]],
        **{key: orjson.loads(row[key]) for key in JSON_KEYS if row[key] is not None},
    }


FORMAT = Format(
    "two tables that join: episodes, and frames with the people in them",
    ".parquet",
    import_,
    tables=Tables(pack, write, finish),
    holds_robots=True,
)
