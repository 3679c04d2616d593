"""The states of an object that are drawn, by the object's class; imports no pygame, so that any package can add one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

from ..core.scene import Scene
from ..core.snapshot import Snapshot, snapshot_of


@dataclass(frozen=True)
class Drawing:
    """The content of a picture, film or page.

    Attributes:
        snapshots: in the order of time; the last one is drawn as a picture, with the paths that lead to it.
        outcome: how the episode ended.
        commands: (T, 3), m/s, m/s, rad/s, body frame, of a page.
        labels: (T,), of a page.
    """

    snapshots: Sequence[Snapshot]
    outcome: str | None = None
    commands: Any = None
    labels: Sequence[Any] | None = None


@singledispatch
def drawing_of(subject: object) -> Drawing:
    """The content of the pictures of an object; a package registers a function for each of its classes.

    Raises:
        TypeError: no function is registered for the class.
    """
    raise TypeError(f"{type(subject).__name__} cannot be drawn; register it with sonata2d.view.drawing.drawing_of")


@drawing_of.register
def _(scene: Scene) -> Drawing:
    return Drawing([snapshot_of(scene)])


@drawing_of.register
def _(snapshot: Snapshot) -> Drawing:
    return Drawing([snapshot])
