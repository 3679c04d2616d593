"""Episodes of sonata2d 0.1.0 replay and rerun to the bit while the physics version is 2."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonata2d.datasets.verification import verify
from sonata2d.version import PHYSICS_VERSION

GOLDEN = Path(__file__).parents[2] / "shared" / "golden"
FOLDERS = sorted(GOLDEN.iterdir()) if GOLDEN.is_dir() else []


@pytest.mark.skipif(not FOLDERS, reason="the episodes of 0.1.0 are expected in ../shared/golden, which is absent")
@pytest.mark.skipif(PHYSICS_VERSION != 2, reason="the episodes of 0.1.0 are of physics version 2")
@pytest.mark.parametrize("folder", FOLDERS or [None], ids=lambda folder: folder.name if folder else "absent")
def test_episodes_of_version_0_1_0_replay_and_rerun_to_the_bit(folder: Path) -> None:
    assert verify(folder, replay=True, rerun=True) == []
