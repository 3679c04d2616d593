"""A few of the calls that `python -m tests.faults calls` disturbs."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sonata2d.core.files.whole_file import sync_folder

from .calls import TRIALS, Trial, create_sets, trials
from .disk import Disk, PowerCut

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="each run is a forked process")


@pytest.fixture(scope="module")
def sets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return create_sets(tmp_path_factory.mktemp("faults") / "sets")


@pytest.mark.parametrize("trial", TRIALS, ids=lambda trial: trial.name)
def test_a_failed_call_or_a_power_cut_loses_nothing(trial: Trial, sets: Path) -> None:
    for row in trials(sets, [trial], lambda count: [*range(count, 0, -max(count // 4, 1))]):
        assert row.faults == []
        assert sum(row.outcomes.values()) >= 4


def test_a_power_cut_leaves_what_was_synced(tmp_path: Path) -> None:
    """Of three files, one is synced with its name, one without, and one not at all."""
    for keeps_names, expected in ((False, {"synced": b"1"}), (True, {"synced": b"1", "nameless": b"2", "lost": b""})):
        folder = tmp_path / str(keeps_names)
        folder.mkdir()
        with Disk(folder, fails_at=9, is_cut=True) as disk, pytest.raises(PowerCut):
            _write_three(folder)
        disk.lose(keeps_names=keeps_names)
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == expected


def _write_three(folder: Path) -> None:
    for name, content in (("synced", b"1"), ("nameless", b"2"), ("lost", b"3")):
        with (folder / name).open("wb", buffering=0) as file:
            file.write(content)
            if name != "lost":
                os.fsync(file.fileno())
        if name == "synced":
            sync_folder(folder)


def test_the_chosen_call_fails(tmp_path: Path) -> None:
    with Disk(tmp_path, fails_at=2) as disk, pytest.raises(OSError, match="No space left"):
        (tmp_path / "a").write_bytes(b"1")
    assert disk.calls == ["create a", "write a"]
    (tmp_path / "b").write_bytes(b"2")  # the real functions are back
