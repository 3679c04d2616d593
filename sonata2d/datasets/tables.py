"""Tables of the episodes and frames of a data set, in Parquet files that Hugging Face `datasets` and others read.

| table | one row per | columns |
| --- | --- | --- |
| `episodes` | episode | family, seed, outcome, … and `header`, the other keys of the episode file as JSON |
| `frames` | frame, and the final state | time, robot, goal, command, …; lists: humans, interactions; JSON: label, … |

pyarrow is imported only when it is needed.
"""

from __future__ import annotations

import hashlib
import logging
import re
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ..core.files.locations import delete, file_names, is_remote, location, make_folder
from ..core.files.optional import optional
from ..core.files.whole_file import sync_folder, whole_file
from ..core.notebook import Advance
from ..errors import RecordError
from ..record.files import episode_key
from ..record.layout import COMMAND_NAMES, HUMAN_NAMES, ROBOT_NAMES, JsonDict
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from ..record.tables import CONTACT_COLUMNS, JSON_KEYS, tables_of
from ..workers.executors import Workers, parallel_map, shared_workers
from ..workers.tasks import stop_if_over, stop_if_unwanted
from .manifest.rows import paths_in, read_manifest

logger = logging.getLogger(__name__)

TABLES = ("episodes", "frames")
_LAYOUT = 2  # of the columns; tables of another layout are written again
_PART = 1000  # episodes in a file of a data set
_ROW_GROUP, _GROUP_BYTES = 100_000, 1 << 24  # rows and bytes of a row group
_JOINED = 64  # tables of episodes that are joined at a time
_MARK = b"sonata2d"  # key of the metadata of a file: layout and hash of its episodes
_NAME = re.compile(rf"(?:{'|'.join(TABLES)})-(?:\w+-)?[0-9]{{5,}}\.parquet")


@dataclass(frozen=True, slots=True)
class PackedEpisode:
    """The rows of an episode, as workers send them.

    Attributes:
        path: of its file, for messages.
        key: which joins its rows.
        tables: of Arrow, by name.
    """

    path: Path
    key: str
    tables: dict[str, Any]


def has_pyarrow() -> bool:
    """Whether pyarrow is installed, which writes the tables."""
    return find_spec("pyarrow") is not None


def pyarrow() -> tuple[Any, Any]:
    """pyarrow and its parquet module.

    Raises:
        RecordError: pyarrow is not installed; names the package to install.
    """
    return optional("pyarrow", RecordError), optional("pyarrow.parquet", RecordError)


def pack(record: EpisodeRecord, key: str) -> PackedEpisode:
    """The rows of an episode.

    Args:
        record: the episode.
        key: value of `episode_id`.

    Raises:
        RecordError: pyarrow is not installed.
    """
    pa, _ = pyarrow()
    schema, columns, packed = schemas(pa), tables_of(record, key), {}
    frames, columns["agents"]["id"] = columns["frames"], columns["agents"]["human_id"]
    for name, table in (("humans", "agents"), ("interactions", "interactions")):
        frames[name] = _nested(pa, columns[table], frames["tick"], schema["frames"].field(name).type)
    for name in TABLES:
        packed[name] = pa.table(columns[name], schema=schema[name])
    return PackedEpisode(record.path, key, packed)


def _nested(pa: Any, rows: dict[str, Any], ticks: Any, type: Any) -> Any:
    """Rows that are ordered by tick, as a list of structs for each frame."""
    fields = [pa.array(rows[field.name], field.type) for field in type.value_type]
    offsets = np.searchsorted(np.asarray(rows["tick"], dtype=np.int64), [*ticks, ticks[-1] + 1]).astype(np.int32)
    return pa.ListArray.from_arrays(offsets, pa.StructArray.from_arrays(fields, fields=list(type.value_type)))


def write(episodes: Iterator[PackedEpisode], out: Path, ending: str = "", mark: str = "") -> list[Path]:
    """Write the tables of episodes into a folder, all of them or none; only a few episodes are held in memory.

    Args:
        episodes: see `pack`.
        out: the folder; created if needed.
        ending: of the names of the files, before the suffix.
        mark: kept in the metadata of the files.

    Returns:
        The tables.

    Raises:
        RecordError: pyarrow is not installed, two episodes have the same file name, or a file cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise RecordError(f"{out} is a file; the tables need a folder, choose another name")
    files = {name: out / f"{name}{ending}.parquet" for name in TABLES}
    pa, pq = pyarrow()
    schema = {name: each.with_metadata({_MARK: mark.encode()}) for name, each in schemas(pa).items()}
    # dictionaries of numbers would take two thirds of the time, and save a tenth of the size
    texts = {name: [field.name for field in each if field.type == pa.string()] for name, each in schema.items()}
    texts["frames"] += ["humans.list.element.activity", "interactions.list.element.relation"]
    options = {"write_page_checksum": True, "compression": "zstd"}
    try:
        make_folder(out)
        with ExitStack() as whole:  # only complete tables get their final names
            places = {name: whole.enter_context(whole_file(files[name])) for name in TABLES}
            with ExitStack() as stack:
                writers = {
                    name: stack.enter_context(
                        _closing(pq.ParquetWriter(places[name], schema[name], use_dictionary=texts[name], **options))
                    )
                    for name in TABLES
                }
                _write_all(pa, episodes, writers)
    except OSError as error:
        raise RecordError(f"{out} cannot be written: {error.strerror or error}") from error
    return [*files.values()]


@contextmanager
def _closing(writer: Any) -> Iterator[Any]:
    """Close a ParquetWriter at the end of the block; after an error it must not write again when it is collected."""
    try:
        yield writer
        writer.close()
    finally:
        writer.is_open = False


def _write_all(pa: Any, episodes: Iterator[PackedEpisode], writers: dict[str, Any]) -> None:
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
        for table, rows in episode.tables.items():
            parts = waiting[table]
            parts.append(rows)
            if len(parts) >= _JOINED:  # many small tables take far more memory than a large one
                whole = pa.concat_tables(parts).combine_chunks()
                parts[:] = [whole]
                if len(whole) > _ROW_GROUP or whole.nbytes > _GROUP_BYTES:
                    writers[table].write_table(whole)
                    parts.clear()
    for table, rest in waiting.items():
        if any(map(len, rest)):  # readers refuse a row group without rows
            writers[table].write_table(pa.concat_tables(rest).combine_chunks())


def schemas(pa: Any) -> dict[str, Any]:
    """The Arrow schema of each table."""
    number, integer, text = pa.float64(), pa.int64(), pa.string()
    human = [("id", integer), *((name, number) for name in HUMAN_NAMES), ("activity", text)]
    human += [("radius", number), ("breadth", number)]
    interaction = [("src", integer), ("relation", text), ("dst", integer)]
    twists = [f"{kind}_{name}" for kind in ("command", "executed") for name in COMMAND_NAMES]
    numbers = [f"robot_{name}" for name in ROBOT_NAMES] + [f"goal_{name}" for name in ("x", "y", "theta")] + twists
    tables = {
        "episodes": {"episode_id": text}
        | dict.fromkeys(("name", "family", "contributor", "context", "outcome", "outcome_reason"), text)
        | dict.fromkeys(("seed", "episode", "physics", "frames"), integer)
        | dict.fromkeys((f"{kind}_contacts" for kind in CONTACT_COLUMNS), integer)
        | dict.fromkeys(("dt", "goal_x", "goal_y", "goal_distance", "robot_radius"), number)
        | {"label": text, "header": text},
        "frames": {"episode_id": text, "tick": integer, "time": number}
        | dict.fromkeys(numbers, number)
        | {"guarded": pa.bool_()}
        | {"humans": pa.list_(pa.struct(human)), "interactions": pa.list_(pa.struct(interaction))}
        | dict.fromkeys(JSON_KEYS, text),
    }  # fmt: skip
    return {name: pa.schema(list(columns.items())) for name, columns in tables.items()}


@dataclass(frozen=True, slots=True)
class _Part:
    """Some episodes of a data set, whose rows have files of their own.

    Attributes:
        ending: of the names of the files.
        files: of the episodes.
        mark: layout and hash of the episodes.
    """

    ending: str
    files: list[Path]
    mark: str


def write_tables(
    folder: str | Path, *, workers: int | Executor | Workers = 1, advance: Advance = lambda step: None
) -> list[Path]:
    """Write the tables of a data set beside its episodes, where `datasets.load_dataset(folder)` finds them.

    A file has the rows of 1000 episodes; of a data set that is split, of one part. Files whose episodes have not
    changed stay. The same episodes and the same version of pyarrow give the same bytes.

    Args:
        folder: of the data set.
        workers: number of processes; or an executor, or workers that several calls share, see `sonata2d.Workers`.
        advance: called with the number of finished episodes.

    Returns:
        The files.

    Raises:
        RecordError: pyarrow is not installed, the folder is no data set, an episode cannot be read, or a file cannot be
            written.
    """
    pyarrow()
    folder = location(folder)
    manifest = read_manifest(folder)
    count, endings = len(manifest["files"]), list[str]()
    with shared_workers(workers) as pool:
        key, place = episode_key(paths_in(folder, manifest["files"])), pool.place(folder)

        def placed() -> Iterator[_Part]:
            for part in _parts(folder, manifest):
                endings.append(part.ending)
                yield _Part(part.ending, [pool.place(file) for file in part.files], part.mark)

        done = parallel_map(
            partial(_write_part, place, key), placed(), total=-(-count // _PART), workers=pool,
            reads=pool.place(folder), writes=place,
        )  # fmt: skip
        for number in done:
            advance(number)
    wanted = {f"{name}{ending}.parquet" for name in TABLES for ending in endings}
    _remove(folder, table_names(folder) - wanted)
    return [folder / name for name in sorted(wanted)]


def tables_are_stale(folder: Path, manifest: JsonDict) -> bool:
    """Whether a data set has tables that do not hold its episodes; False if its manifest is damaged.

    Args:
        folder: of the data set.
        manifest: of the data set.

    Raises:
        RecordError: pyarrow is not installed.
    """
    present = table_names(folder)
    try:
        parts = list(_parts(folder, manifest)) if present else []
    except RecordError:
        return False
    names = {f"{name}{part.ending}.parquet": part.mark for part in parts for name in TABLES}
    surplus = [name for name in present - set(names) if _mark_of(folder / name)]
    are_current = all(_mark_of(folder / name) == mark and is_whole(folder / name) for name, mark in names.items())
    return bool(present) and (bool(surplus) or not are_current)


def is_whole(path: Path) -> bool:
    """Whether the checksums of all pages of a table are right."""
    pa, pq = pyarrow()
    try:
        with path.open("rb") as file, pq.ParquetFile(file, page_checksum_verification=True) as table:
            for _ in table.iter_batches(10_000):
                pass
    except (OSError, ValueError, pa.ArrowException):
        return False
    return True


def remove_tables(folder: Path) -> None:
    """Remove the tables of a data set."""
    _remove(folder, table_names(folder))


def _remove(folder: Path, names: set[str]) -> None:
    """Delete tables of a folder, so that a power cut does not bring them back; files of others stay."""
    names = {name for name in names if not has_pyarrow() or _mark_of(folder / name) != ""}
    for name in names:
        delete(folder / name)
    if names and not is_remote(folder):
        sync_folder(folder)


def table_names(folder: Path) -> set[str]:
    """The names of the tables in a folder; other files may have such names as well."""
    return {name for name in file_names(folder) if _NAME.fullmatch(name)}


def table_name(part: str) -> str:
    """The name of a part of a data set in the names of its tables, where Hugging Face allows words only."""
    return re.sub(r"\W", "_", part)


def _parts(folder: Path, manifest: JsonDict) -> Iterator[_Part]:
    """The parts of a data set, in the order in which they are complete."""
    split = manifest["split"]
    names = {part: iter(listed) for part, listed in (split or {}).items()}
    following = {part: next(listed, None) for part, listed in names.items()}
    waiting: dict[str, list[tuple[Path, str]]] = {part: [] for part in split or ("",)}
    numbers = dict.fromkeys(waiting, 0)
    rows = manifest["files"]
    for row, path in zip(rows, paths_in(folder, rows), strict=True):
        part = "" if split is None else next((part for part, name in following.items() if name == row["name"]), None)
        if part is None:
            raise RecordError(f"{folder}: no part of its split has {row['name']}; split it again")
        if part:
            following[part] = next(names[part], None)
        waiting[part].append((path, row["sha256"]))
        if len(waiting[part]) == _PART:
            yield _part_of(part, numbers[part], waiting[part])
            waiting[part] = []
            numbers[part] += 1
    for part, rest in waiting.items():
        if rest:
            yield _part_of(part, numbers[part], rest)


def _part_of(part: str, number: int, episodes: list[tuple[Path, str]]) -> _Part:
    digest = hashlib.sha256("".join(sha256 for _, sha256 in episodes).encode()).hexdigest()
    ending = f"-{table_name(part)}-{number:05d}" if part else f"-{number:05d}"
    return _Part(ending, [path for path, _ in episodes], f"{_LAYOUT} {digest}")


def _write_part(out: Path, key: Any, part: _Part) -> int:
    """Write the tables of a part, unless they are there; returns the number of its episodes."""
    if not all(_mark_of(out / f"{name}{part.ending}.parquet") == part.mark for name in TABLES):

        def packed() -> Iterator[PackedEpisode]:
            for file in part.files:
                stop_if_over()
                yield pack(read_episode(file), key(file))
            stop_if_unwanted()

        write(packed(), out, part.ending, part.mark)
    return len(part.files)


def _mark_of(path: Path) -> str | None:
    """The mark of a file, empty in a file of another program; None if there is no file, or it is damaged."""
    pa, pq = pyarrow()
    try:
        with path.open("rb") as file:
            mark: bytes = (pq.read_schema(file).metadata or {}).get(_MARK, b"")
            return mark.decode()
    except (OSError, ValueError, pa.ArrowException):
        return None
