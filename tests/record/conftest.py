"""Fixtures of the tests of `record`."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonata2d.record.recorder import JsonRecorder

from .samples import run


@pytest.fixture
def episode(tmp_path: Path) -> Path:
    """A complete episode file."""
    path = tmp_path / "by-hand.json"
    with JsonRecorder(path) as recorder:
        run(recorder)
    return path
