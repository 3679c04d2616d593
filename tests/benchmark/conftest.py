"""Small rows that several tests read."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonata2d.benchmark import run_benchmark

PARTS = ("frontal-approach", "home")


@pytest.fixture(scope="session")
def row(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A row of the expert in four scenes."""
    folder = tmp_path_factory.mktemp("rows") / "planner"
    run_benchmark("social-planner", folder, parts=PARTS, scenes=2)
    return folder
