"""Folders and files that no other user of the machine can have written."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

_WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_MAX_LINKS = 40  # on one path, as in Linux


def foreign_access(folder: Path) -> str | None:
    """Reason why another user could put files into a folder, and the remedy; None if nobody could.

    The rule is the one of ssh for `~/.ssh`: the folder and its parents belong to the user or to root, and neither their
    group nor others may write to them. A parent with the sticky bit, such as `/tmp`, may be writable: nobody can rename
    another user's entries there. The same holds for the target of each symbolic link, and a link belongs to the user or
    to root. Folders that do not exist are passed over.

    Windows has no such modes; there, the folders of a user's profile are private, and nothing is checked.
    """
    if os.name != "posix":
        return None
    folder = folder.absolute()
    try:
        places = _places(folder)
    except OSError as error:
        return f"{folder} cannot be followed: {error.strerror}; use a folder of your own"
    for place in dict.fromkeys(places):
        try:
            found = place.lstat()
        except OSError:  # it does not exist, or cannot be reached, so that nothing is read from it
            continue
        if found.st_uid not in (0, os.geteuid()):
            return f"{place} belongs to another user ({found.st_uid}); use a folder of your own"
        # The mode of a link means nothing; it can be replaced only where the folder that holds it can be written.
        is_last = place == places[-1]
        is_exempt = stat.S_ISLNK(found.st_mode) or (not is_last and found.st_mode & stat.S_ISVTX)
        if found.st_mode & _WRITABLE_BY_OTHERS and not is_exempt:
            remedy = "empty it and run" if is_last else "use a folder of your own, or run"
            return f"other users can write to {place}; {remedy} chmod go-w {place}"
    return None


def _places(folder: Path) -> list[Path]:
    """The folders and symbolic links on the way to a folder, with those on the way of each link; the folder is last.

    Raises:
        OSError: a link cannot be read, or there are too many.
    """
    place = Path(folder.anchor)
    places, rest, links = [place], list(folder.parts[1:]), 0
    while rest:
        part = rest.pop(0)
        entry = place.parent if part == os.pardir else place / part
        places.append(entry)
        if not entry.is_symlink():
            place = entry
            continue
        links += 1
        if links > _MAX_LINKS:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP))
        target = Path(os.readlink(entry))
        rest = [*(target.parts[1:] if target.is_absolute() else target.parts), *rest]
        place = Path(target.anchor) if target.is_absolute() else place
    return [*places, place]


def is_own_file(path: Path) -> bool:
    """Whether a path is a regular file, no symbolic link, that only the user or root could have written.

    The folder must be safe in the sense of `foreign_access`: then nobody can replace the file before it is read.
    """
    try:
        found = path.lstat()
    except OSError:
        return False
    is_own = os.name != "posix" or (found.st_uid in (0, os.geteuid()) and not found.st_mode & _WRITABLE_BY_OTHERS)
    return stat.S_ISREG(found.st_mode) and is_own


def make_private(folder: Path) -> None:
    """Make a folder and its missing parents, with access for the user only.

    Raises:
        OSError: it cannot be made.
    """
    for place in (*reversed(folder.parents), folder):
        if not place.is_dir():
            place.mkdir(mode=0o700, exist_ok=True)
