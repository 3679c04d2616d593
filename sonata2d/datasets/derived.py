"""Data sets made of data sets: whole or not there, and only from files that are what their manifest says."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import orjson

from ..errors import RecordError
from ..record.files import TEMPORARY, read_bytes, write_atomically
from ..record.layout import Tree
from .card import card
from .manifest import CARD, MANIFEST, read_manifest, write_tree

Advance = Callable[[int], None]


def manifest_as_it_stands(folder: Path) -> Tree:
    """The manifest with no key added, so that what is written again differs only where it was changed.

    Raises:
        RecordError: there is none, or it is damaged.
    """
    read_manifest(folder)
    manifest: Tree = orjson.loads(read_bytes(folder / MANIFEST))
    return manifest


def listed_bytes(folder: Path, row: Tree) -> bytes:
    """A file of a data set as it lies on the disk.

    Raises:
        RecordError: it is not there, or not what the manifest says.
    """
    path = folder / row["name"]
    if path.name != row["name"]:
        raise RecordError(f"{folder / MANIFEST} lists {row['name']!r}, which is no file of this folder")
    try:
        data: bytes = path.read_bytes()
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror or error}") from error
    if hashlib.sha256(data).hexdigest() != row["sha256"]:
        raise RecordError(f"{path} is not what the manifest says, it was changed since; `sonata2d check` tells more")
    return data


def write_manifest(folder: Path, manifest: Tree) -> None:
    """Write the data card, then the manifest."""
    write_atomically(folder / CARD, card(manifest).encode())
    write_tree(folder / MANIFEST, manifest)


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A folder to fill, which takes its name when all is well and vanishes otherwise.

    Raises:
        RecordError: there is something of that name already, or it cannot be written.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RecordError(f"{out} is there already and not empty; choose another name")
    work = out.parent / f"{TEMPORARY}{uuid4().hex}"
    try:
        work.mkdir(parents=True)
        yield work
        if out.exists():
            out.rmdir()
        os.replace(work, out)
    except OSError as error:
        raise RecordError(f"{out} cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(work, ignore_errors=True)
