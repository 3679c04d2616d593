"""Every test of the window has its own settings folder, and closes the window."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pygame
import pytest


@pytest.fixture(autouse=True)
def _window(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SONATA2D_CONFIG", str(tmp_path / "config"))
    yield
    pygame.quit()
