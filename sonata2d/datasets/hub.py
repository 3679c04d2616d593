"""Data sets on the Hugging Face Hub: upload of a folder, and download with verification.

The package huggingface_hub is imported only when it is needed.
"""

from __future__ import annotations

import glob
import os
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..core.arguments import whole_number
from ..core.files.locations import is_remote, location
from ..core.files.optional import optional
from ..core.wording import one_line
from ..errors import DatasetWarning, RecordError
from ..record.files import sha256_of
from ..record.layout import JsonDict
from ..record.shard_file import SHARD_SUFFIX, shard_manifest_path
from ..version import PHYSICS_VERSION
from .card.write import card_differences, has_edited_card, write_card
from .check.manifests import check_shard, listed_shards
from .check.verification import verify
from .dataset import Dataset
from .manifest.names import CARD, CROISSANT, MANIFEST, PREVIEW, SCENARIO, shard_card_path
from .manifest.read import has_manifest
from .manifest.rows import listing, read_manifest
from .tables import is_whole, write_tables

_NAME = re.compile(r"[\w-][\w.-]*/[\w-][\w.-]*")
_MAX_FILES = 10_000  # of a folder on the Hub


def push_dataset(
    folder: str | Path,
    name: str,
    *,
    private: bool = False,
    revision: str | None = None,
    message: str | None = None,
    personal: bool = False,
) -> str:
    """Upload a data set to the Hugging Face Hub, as a data set repository.

    Before, the files are compared with their hashes, and card and tables are written again; a card that was edited
    stays. Uploaded are the episodes or shards, manifest, card, metadata, settings, picture and tables, and nothing
    else: no log, failed episodes, ratings or answers. Other files of the repository are deleted.

    Args:
        folder: of a complete data set on this machine.
        name: of the repository, `OWNER/NAME`; it is created if needed.
        private: whether only its owner can see it.
        revision: branch that receives the files, created if needed; None: `main`.
        message: of the commit.
        personal: whether names of drivers, and the path of a controller on this machine, may be uploaded.

    Returns:
        The address of the page.

    Raises:
        RecordError: the data set is incomplete, damaged, in a store or driven by people, names a path of this machine,
            has too many files, or has an edited card with other counts or tables; a package is not installed; the Hub
            cannot be reached, or refuses.
    """
    hub = optional("huggingface_hub", RecordError, extra="hub")
    optional("pyarrow", RecordError, extra="hub")
    folder = location(folder)
    if not _NAME.fullmatch(name):
        raise RecordError(f"{name!r} is no name on the Hugging Face Hub; give OWNER/NAME")
    if is_remote(folder):
        raise RecordError(f"{folder} is in a store; copy the data set to this machine and push the copy")
    if not folder.exists():
        raise RecordError(f"{folder} does not exist")
    names = _prepared(folder, personal)
    with _clear_errors(name):
        api = hub.HfApi()
        page = api.create_repo(name, repo_type="dataset", private=private or None, exist_ok=True)
        if private and not api.dataset_info(page.repo_id).private:
            raise RecordError(f"{name} exists and is public; make it private in its settings on the Hub first")
        if revision is not None:
            api.create_branch(page.repo_id, branch=revision, repo_type="dataset", exist_ok=True)
        # `upload_folder` sends large folders in several commits and continues after an interruption, like
        # `upload_large_folder`, which takes no message and deletes nothing
        api.upload_folder(
            repo_id=page.repo_id,
            repo_type="dataset",
            folder_path=folder,
            revision=revision,
            commit_message=message or f"Upload {folder.resolve().name} with sonata2d",
            allow_patterns=[glob.escape(name) for name in sorted(names)],
            delete_patterns="*",
        )
    return str(page)


def load(name: str | Path, *, revision: str | None = None, replay: int = 1) -> Dataset:
    """Load a data set of this machine, of a store, or of the Hugging Face Hub.

    One of the Hub is downloaded into the Hub's cache. Its files are compared with the hashes in its manifest, and some
    episodes are run again and compared byte by byte. A data set of this machine or of a store is not verified, as by
    `Dataset`.

    Args:
        name: a path, the URL of a store, or the name of a data set on the Hub, `OWNER/NAME`.
        revision: branch, tag or commit on the Hub; None: `main`.
        replay: number of episodes to run again, spread over the data set.

    Raises:
        RecordError: there is no such data set, a file differs from the manifest, an episode cannot be reproduced, a
            package is not installed, or the Hub cannot be reached.
        ValueError: a revision of a path is asked for, or the number is below 0.

    Warns:
        DatasetWarning: the data set is of another version of the physics, so that no episode can be run again.
    """
    whole_number("replay", replay, 0)
    text = os.fspath(name)
    if not _NAME.fullmatch(text) or Path(text).exists():
        if revision is not None:
            raise ValueError(f"{text} has no revisions, as OWNER/NAME on the Hugging Face Hub has, got {revision!r}")
        return Dataset(name)
    hub = optional("huggingface_hub", RecordError, extra="hub")
    with _clear_errors(f"{text} is not a folder here, and"):
        folder = Path(hub.snapshot_download(text, repo_type="dataset", revision=revision))
    if not has_manifest(folder):
        raise RecordError(f"{text} on the Hugging Face Hub is no data set of sonata2d: it has no {MANIFEST}")
    manifest = read_manifest(folder)
    cache = folder.parent.parent  # also of the contents, to which the files of a revision are links
    remedy = f"it was changed after its upload, or the download is damaged: remove {cache} to load it again"
    _require_unchanged(folder, manifest, remedy)
    dataset = Dataset(folder)
    _replay(dataset, manifest, replay)
    return dataset


def _prepared(folder: Path, personal: bool) -> set[str]:
    """Check a data set, bring its card and tables up to date, and return the names of the files to upload.

    Raises:
        RecordError: as of `push_dataset`.
    """
    manifest = read_manifest(folder)
    if not manifest["complete"]:
        count = f"{len(manifest['files'])} of {manifest['episodes']} episodes"
        raise RecordError(f"{folder} is interrupted: it has {count}; complete it with generate --resume")
    sources = manifest.get("sources") or ()
    is_driven = manifest["collected"] or any(source["scenario"] is None for source in sources)
    if (is_driven or manifest["counts"].get("contributor")) and not personal:
        raise RecordError(
            f"{folder} has runs that people drove, and the files hold the drivers' names; if all of them agree to the "
            "publication, give --personal (personal=True)"
        )
    paths = [(source["controller"] or {}).get("path", "") for source in sources or (manifest,)]
    if (absolute := [path for path in paths if path.startswith(("/", "~")) or path[1:3] == ":\\"]) and not personal:
        raise RecordError(
            f"{folder} names its controller by a path of this machine, {absolute[0]}; generate it again with a "
            "relative path such as ./mine.py:Mine, or give --personal (personal=True) to publish the path"
        )
    names = {row["name"] for row in listing(manifest)}
    for shard in [folder / name for name in names if name.endswith(SHARD_SUFFIX)]:
        names |= {shard_manifest_path(shard).name, shard_card_path(shard).name}
    _require_unchanged(folder, manifest, "restore it, or generate the data set again")
    if not has_edited_card(folder):
        write_card(folder)
    elif differences := card_differences(folder, manifest):
        raise RecordError(f"{folder / CARD} {differences[0][1]}; edit it, or write a new one with `sonata2d card`")
    for damaged in [path for path in write_tables(folder) if not is_whole(path)]:
        damaged.unlink()
    names |= {path.name for path in write_tables(folder)}
    names |= {MANIFEST, CARD, CROISSANT, SCENARIO, PREVIEW}
    if len(names) > _MAX_FILES:
        raise RecordError(f"{folder} has {len(names)} files, the Hub takes {_MAX_FILES}; generate it with --shard-size")
    return names


def _require_unchanged(folder: Path, manifest: JsonDict, remedy: str) -> None:
    """Require that the files of a data set have the hashes in its manifest.

    Raises:
        RecordError: one is missing or differs.
    """
    for shard in listed_shards(folder, manifest):
        if problem := next((each for each in check_shard(shard) if not each.is_warning), None):
            raise RecordError(f"{folder}/{problem}; {remedy}")
    for row in () if "shards" in manifest else listing(manifest):
        if (found := sha256_of(folder / row["name"])) != row["sha256"]:
            raise RecordError(f"{folder / row['name']} has the SHA-256 {found}, not that of the manifest; {remedy}")


def _replay(dataset: Dataset, manifest: JsonDict, count: int) -> None:
    """Run some episodes of a downloaded data set again.

    Raises:
        RecordError: one is not as its commands make it.
    """
    if count and manifest["physics"] != PHYSICS_VERSION:
        message = (
            f"{dataset.path} is of physics version {manifest['physics']}, which this sonata2d (physics version "
            f"{PHYSICS_VERSION}) cannot run: only its hashes were compared"
        )
        warnings.warn(message, DatasetWarning, stacklevel=3)
        return
    count = min(count, len(dataset))
    for k in range(count):
        file = dataset.files[(2 * k + 1) * len(dataset) // (2 * count)]
        problems = [problem for problem in verify(file, replay=True) if not problem.is_warning]
        if problems:
            raise RecordError(f"{file} is not as its commands make it: {problems[0]}")


@contextmanager
def _clear_errors(name: str) -> Iterator[None]:
    """Turn errors of the Hub, of its package and of the network into a RecordError with the remedy."""
    try:
        yield
    except RecordError:
        raise
    except Exception as error:  # the network client has classes of its own
        response: Any = getattr(error, "response", None)
        code = getattr(response, "status_code", None)
        if isinstance(error, ValueError) and code is None:
            remedy = "give a name such as OWNER/NAME"
        elif code == 403:
            remedy = "check the owner's name, and that your token may write there"
        elif code in (401, 404):
            remedy = "check the name, and log in with `hf auth login`, or set HF_TOKEN"
        else:
            remedy = "check the network, HF_ENDPOINT and HF_HUB_OFFLINE, and try again"
        if code is None:
            place = f"{name} cannot be reached on the Hugging Face Hub ({type(error).__name__}: {one_line(error, 200)})"
        else:
            verb = "is refused by" if code in (401, 403) else "cannot be reached on"
            place = f"{name} {verb} the Hugging Face Hub ({type(error).__name__}, {code})"
        raise RecordError(f"{place}; {remedy}") from error
