"""Episodes of sonata2d 0.1.0, of physics version 2, are read, checked and measured; running them again is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonata2d.datasets import verify
from sonata2d.metrics.measurement import measure
from sonata2d.record.reader import read_episode

GOLDEN = Path(__file__).parents[2] / "shared" / "golden"
FOLDERS = sorted(GOLDEN.iterdir()) if GOLDEN.is_dir() else []


@pytest.mark.skipif(not FOLDERS, reason="the episodes of 0.1.0 are expected in ../shared/golden, which is absent")
@pytest.mark.parametrize("folder", FOLDERS or [None], ids=lambda folder: folder.name if folder else "absent")
def test_episodes_of_physics_version_2_are_read_and_measured_but_not_run(folder: Path) -> None:
    assert verify(folder) == []
    files = sorted(folder.glob("[0-9]*.json*"))
    assert files
    for path in files:
        assert measure(read_episode(path))["path_length"] is not None
    problems = verify(folder, replay=True, rerun=True)
    assert {problem.place for problem in problems} == {"physics"}
    assert all("sonata2d 0.2.0 is the last release that can" in problem.message for problem in problems)
