"""Every test of the window has its own settings folder, and closes the window."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pygame
import pytest

from sonata2d.view import canvas
from sonata2d.view.fonts import rendered
from sonata2d.window import widgets

from .driver import Driver


class Line(NamedTuple):
    """A line of text that was drawn, other than those of buttons and text fields."""

    words: str
    size: int  # px


@pytest.fixture(autouse=True)
def _window(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SONATA2D_CONFIG", str(tmp_path / "config"))
    yield
    pygame.quit()


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Line]:
    """The lines that are drawn from now on."""
    lines: list[Line] = []

    def noted(text: str, size: int, colour: tuple[int, int, int]) -> pygame.Surface:
        lines.append(Line(text, size))
        return rendered(text, size, colour)

    for module in (widgets, canvas):
        monkeypatch.setattr(module, "rendered", noted)
    return lines


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[Callable[..., Driver]]:
    """Makes drivers in one folder of runs."""
    opened: list[Driver] = []

    def make(**options: Any) -> Driver:
        opened.append(Driver(tmp_path / "runs", **options))
        return opened[-1]

    yield make
    for each in opened:
        each.session._journal.shut()
        each.session._collection._lock.release()
