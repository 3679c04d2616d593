"""A new folder that appears when it is complete."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from ...core.files.locations import file_names, is_remote
from ...core.files.whole_file import TEMPORARY_PREFIX, sync_folder
from ...errors import RecordError
from ...record.claims import StoreClaim
from ..manifest.names import LOCK


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A temporary folder that is renamed to `out` on success and removed on an error.

    Raises:
        RecordError: `out` exists and is not an empty folder, or it cannot be written.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RecordError(f"{out} already exists and is not empty; choose another name")
    if is_remote(out):  # objects cannot be renamed together: the manifest, which is written last, makes the data set
        claim = StoreClaim(out / LOCK)
        claim.take()
        try:
            yield out
            claim.require()
        except BaseException:
            with suppress(OSError, RecordError):
                claim.require()
                for name in file_names(out):
                    (out / name).unlink(missing_ok=True)
            raise
        finally:
            claim.release()
        return
    work = out.parent / f"{TEMPORARY_PREFIX}{uuid4().hex}"
    try:
        work.mkdir(parents=True)
        yield work
        if out.exists():
            out.rmdir()
        os.replace(work, out)
        sync_folder(out.parent)  # a power cut does not take the name back
    except OSError as error:
        raise RecordError(f"{out} cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(work, ignore_errors=True)
