"""What a format is: how an episode is put into it, and how one is had from it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ..errors import RecordError
from ..record.layout import Tree
from ..record.record import EpisodeRecord


@dataclass(frozen=True, slots=True)
class Options:
    """What may be asked of an export or an import.

    Attributes:
        original: keep the quirks of the program that a format comes from, where it has any (`sonata`).
        frame_time: s that a frame number stands for, in files that do not say it (`csv`).
    """

    original: bool = False
    frame_time: float | None = None


Export = Callable[[EpisodeRecord, Options], bytes]
Import = Callable[[Path, Options], Iterator[Tree]]  # documents of episodes, as `record.read_episode` reads them
Gather = Callable[[Iterator[EpisodeRecord], Path], list[Path]]


@dataclass(frozen=True, slots=True)
class Format:
    """A format that other programs read.

    Attributes:
        about: one line.
        suffix: of its files; of a format of tables, that of each table.
        import_: reads a file (of tables: a folder).
        export: the bytes of one file an episode; None where episodes share their files.
        gather: writes all episodes into shared files in a folder, instead of `export`.
    """

    about: str
    suffix: str
    import_: Import
    export: Export | None = None
    gather: Gather | None = None


@contextmanager
def parsing(path: Path, format: str) -> Iterator[None]:
    """Whatever a damaged or foreign file makes go wrong is one RecordError that names file and format."""
    try:
        yield
    except RecordError:
        raise
    except KeyError as error:
        raise RecordError(f"{path} is no whole {format} file: {error} is missing") from error
    except RecursionError as error:
        raise RecordError(f"{path} is no {format} file: it is nested too deep") from error
    except MemoryError as error:
        raise RecordError(f"{path} is no {format} file: it claims more than memory holds") from error
    except (TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        told = " ".join(str(error).split())
        raise RecordError(f"{path} is no whole {format} file: {told:.200}") from error
