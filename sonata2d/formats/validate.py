"""What an import makes has to be an episode, to the letter of the schema."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..core.geometry import LARGEST
from ..errors import RecordError
from ..record.canonical import written
from ..record.layout import ABSENT, Tree

_PLACED = ("rules", "room", "walls", "objects", "humans", "robot", "goal", "frames", "final")


def proven(document: Tree, path: Path) -> bytes:
    """The file's bytes, if the document is what the schema of episodes says.

    Raises:
        RecordError: it is not; the source says something that cannot be.
    """
    from ..record.models import Episode

    data = written(document)
    try:
        Episode.model_validate_json(data)
        _refuse_ragged(document)
        _refuse_large(document)
    except ValueError as error:
        raise RecordError(f"{path} tells of what no episode can be: {_told(error):.200}") from None
    return data


def _told(error: ValueError) -> str:
    """One line: of the schema's findings, which are many, the first."""
    findings = getattr(error, "errors", None)
    if findings is None:
        return str(error)
    first = findings(include_url=False, include_context=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"


def _refuse_ragged(document: Tree) -> None:
    """A schema cannot say that each look has a row for each person, and none for whoever is not present."""
    people, names = len(document["humans"]), len(document["activities"])
    for look in (*document["frames"], document["final"]):
        rows, activity = look["humans"], look["activity"]
        if len(rows) != people or len(activity) != people:
            raise ValueError(f"{len(rows)} rows and {len(activity)} activities of {people} people at {look['tick']}")
        if any((row is None) != (doing == ABSENT) or doing >= names for row, doing in zip(rows, activity, strict=True)):
            raise ValueError(f"activities at tick {look['tick']} do not say who is present")


def _refuse_large(document: Tree) -> None:
    """A number of a size that whoever squares it later cannot hold."""
    for key in _PLACED:
        if (largest := _largest(document[key])) > LARGEST:
            raise ValueError(f"{key} holds {largest:g}, beyond what a file holds, {LARGEST:g}")


def _largest(value: Any) -> float:
    """The size of the largest number in a tree, labels aside."""
    if isinstance(value, int | float):
        return abs(value)
    if isinstance(value, list | tuple):
        return max(map(_largest, value), default=0.0)
    if isinstance(value, dict):
        return max((_largest(part) for key, part in value.items() if key != "label"), default=0.0)
    return 0.0
