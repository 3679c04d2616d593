"""Export of a study as one archive."""

from __future__ import annotations

import secrets
import zipfile
from collections.abc import Iterator
from pathlib import Path

from ..collect.collection import DISCARDED
from ..core.files.reading import require_readable
from ..core.files.whole_file import TEMPORARY_PREFIX, whole_file
from ..datasets.manifest import CARD, CROISSANT, LOG, MANIFEST, SCENARIO, read_manifest
from ..errors import RecordError
from .folder import ANSWERS, LOCK, PERSONAL, PICTURES, RATED, STUDY, read_state, require_outside
from .report import TABLES, results_of, table_of


def export_study(out: str | Path, file: str | Path, *, personal: bool = False) -> Path:
    """Write runs, ratings, answers, study file and tables of results to a ZIP file.

    Links are left out, so that nobody can use the archive to take part as somebody else.

    Args:
        out: folder of the study; it may be served meanwhile.
        file: the archive; replaced if it exists. Its folder is created.
        personal: whether personal answers are included.

    Returns:
        The path of the archive.

    Raises:
        ConfigError: the archive would be in the folder of the study.
        RecordError: the folder is not the folder of a study, a file is damaged, or the archive cannot be written.
    """
    out, file = Path(out), Path(file)
    read_state(out)
    require_outside(out, file)
    return write_archive(out, file, personal=personal)


def write_archive(out: Path, file: Path, *, personal: bool) -> Path:
    """Write the archive of `export_study` to any path; the server writes temporary ones to the folder of the study."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(file) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
            for path in _files(out, personal):
                require_readable(path)
                archive.write(path, path.relative_to(out))
            for name, rows in results_of(out, personal=personal).items():
                archive.writestr(f"tables/{name}.csv", table_of(TABLES[name], rows))
    except FileNotFoundError as error:
        raise RecordError(f"{error.filename} was taken back during the export; export again") from error
    except OSError as error:
        raise RecordError(f"{file} cannot be written: {error.strerror or error}") from error
    return file


def temporary_export(out: Path) -> Path:
    """A name for an archive in the private part of a study's folder."""
    return out / STUDY / f"export-{secrets.token_hex(4)}.zip"


def unfinished_exports(out: Path) -> list[Path]:
    """Archives that remain after a program was killed during an export; they may hold personal answers."""
    return [*(out / STUDY).glob("export-*.zip"), *(out / STUDY).glob(f"{TEMPORARY_PREFIX}*.zip")]


def _files(out: Path, personal: bool) -> Iterator[Path]:
    """The files of a study, except links, locks, and runs that are being driven."""
    if (out / MANIFEST).exists():
        yield out / MANIFEST
        yield from (out / row["name"] for row in read_manifest(out)["files"])
    yield from (path for name in (SCENARIO, LOG, CARD, CROISSANT) if (path := out / name).exists())
    folders = [out / DISCARDED, out / RATED, out / STUDY / ANSWERS, out / STUDY / PICTURES]
    folders += [out / STUDY / PERSONAL] if personal else []
    for folder in folders:
        yield from (path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith("."))
    yield from sorted(path for path in (out / STUDY).glob("study*") if path.name != LOCK and path.is_file())
