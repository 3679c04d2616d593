"""A data set is the same bytes whoever makes which part of it, and however often it is interrupted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import sonata2d as s2
from sonata2d.datasets.generate import generate_dataset
from sonata2d.datasets.verification import verify
from sonata2d.errors import ControllerError, RecordError
from sonata2d.testing.controllers import check_controller

QUICK = s2.ScenarioConfig(name="quick", standing=2, wandering=3, tables=1, rules={"time_limit": 3.0})


def content(folder: Path) -> dict[str, bytes]:
    """All but the log of the runs."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.name != "run.jsonl"}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sets") / "made"
    generate_dataset(out, QUICK, "straight-to-goal", episodes=10, seed=5)
    return out


def test_workers_change_no_byte(made: Path, tmp_path: Path) -> None:
    generate_dataset(tmp_path / "two", QUICK, "straight-to-goal", episodes=10, seed=5, workers=2)
    assert content(tmp_path / "two") == content(made)


@pytest.mark.parametrize("hash_seed", ["0", "1"])
def test_the_hash_seed_changes_no_byte(made: Path, tmp_path: Path, hash_seed: str) -> None:
    code = (
        "import sonata2d as s2; from sonata2d.datasets.generate import generate_dataset as g\n"
        "q = s2.ScenarioConfig(name='quick', standing=2, wandering=3, tables=1, rules={'time_limit': 3.0})\n"
        f"g({str(tmp_path / 'out')!r}, q, 'straight-to-goal', episodes=10, seed=5)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, "PYTHONHASHSEED": hash_seed})
    assert content(tmp_path / "out") == content(made)


def test_an_episode_does_not_depend_on_how_many_there_are(made: Path, tmp_path: Path) -> None:
    generate_dataset(tmp_path / "few", QUICK, "straight-to-goal", episodes=3, seed=5)
    for name, data in content(tmp_path / "few").items():
        assert name in ("manifest.json", "README.md") or data == content(made)[name]


@pytest.mark.skipif(os.name != "posix", reason="kill -9 is Unix's")
def test_killed_in_mid_run_and_resumed_gives_the_same_bytes(tmp_path: Path) -> None:
    scenario = s2.ScenarioConfig(name="quick", standing=2, wandering=3, rules={"time_limit": 6.0, "ends_on": ["time"]})
    code = (
        "import sonata2d as s2; from sonata2d.datasets.generate import generate_dataset as g\n"
        "if __name__ == '__main__':\n"
        "    rules = {'time_limit': 6.0, 'ends_on': ['time']}\n"
        "    q = s2.ScenarioConfig(name='quick', standing=2, wandering=3, rules=rules)\n"
        f"    g({str(tmp_path / 'out')!r}, q, episodes=30, seed=1, workers=2)"
    )
    (tmp_path / "make.py").write_text(code)
    process = subprocess.Popen([sys.executable, str(tmp_path / "make.py")], stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while len(list((tmp_path / "out").glob("0*.json"))) < 5 and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = len(list((tmp_path / "out").glob("0*.json")))
    assert 5 <= before < 30
    generate_dataset(tmp_path / "out", scenario, episodes=30, seed=1, resume=True)
    generate_dataset(tmp_path / "whole", scenario, episodes=30, seed=1, workers=2)
    assert content(tmp_path / "out") == content(tmp_path / "whole")


def test_a_file_cut_short_is_made_again_on_resume(made: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=10, seed=5)
    path = tmp_path / "out/000004.json"
    path.write_bytes(path.read_bytes()[:1000])
    generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=10, seed=5, resume=True)
    assert content(tmp_path / "out") == content(made)
    assert "000004.json" in caplog.text


def test_a_file_of_a_newer_version_and_another_packing_are_left_alone(made: Path, tmp_path: Path) -> None:
    generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=3, seed=5)
    with pytest.raises(RecordError, match="same --compress"):
        generate_dataset(
            tmp_path / "out", QUICK, "straight-to-goal", episodes=3, seed=5, suffix=".json.gz", resume=True
        )
    path = tmp_path / "out/000001.json"
    path.write_text(path.read_text().replace('"version":1', '"version":2', 1))
    with pytest.raises(RecordError, match="upgrade"):
        generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=3, seed=5, resume=True)
    assert '"version":2' in path.read_text()


def test_a_file_that_was_changed_is_made_again_on_resume(made: Path, tmp_path: Path) -> None:
    generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=10, seed=5)
    path = tmp_path / "out/000004.json"
    path.write_text(path.read_text().replace('"tick":3,"time":0.3', '"tick":3,"time":0.31'))
    generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=10, seed=5, resume=True)
    assert content(tmp_path / "out") == content(made)


def test_a_fast_robot_among_fast_people_passes_the_check(tmp_path: Path) -> None:
    limits = {"ahead": 3.5, "back": 3.5, "sideways": 3.5, "acceleration": 100.0, "turn_acceleration": 100.0}
    speed = {"mean": 2.0, "max": 2.5}
    rules = {"time_limit": 10.0, "ends_on": ["time"]}
    scenario = s2.ScenarioConfig(
        wandering=12, standing=0, relations=0, robot={"limits": limits}, person={"desired_speed": speed}, rules=rules
    )
    generate_dataset(tmp_path / "out", scenario, f"{__name__}:Racer", episodes=4)
    assert verify(tmp_path / "out", replay=True) == []


class Racer(s2.Controller):
    """As fast as it can, another way every second."""

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist(vx=3.5, omega=1.5 if snapshot.tick // 10 % 2 else -1.0)


def test_everything_made_can_be_proven(made: Path) -> None:
    assert verify(made, replay=True, rerun=True) == []


def test_progress_is_told_to_the_last_episode(tmp_path: Path) -> None:
    steps: list[int] = []
    generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=3, seed=5, advance=steps.append)
    assert sum(steps) == 3


def test_another_data_set_is_not_resumed(made: Path) -> None:
    with pytest.raises(RecordError, match="another data set"):
        generate_dataset(made, QUICK, "straight-to-goal", episodes=10, seed=6, resume=True)


class Forgetful(s2.Controller):
    """Keeps a count from one episode to the next, which it should not."""

    def __init__(self) -> None:
        self._count = 0

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        self._count += 1
        return s2.Twist(vx=0.0001 * self._count)


class Odd(s2.Controller):
    """Labels with something no file can hold."""

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist()

    def label(self, snapshot: s2.Snapshot, twist: s2.Twist) -> object:
        return {"why": object()}


def test_check_controller_accepts_the_stock_ones() -> None:
    assert len(check_controller(s2.StraightToGoal(), time_limit=3.0)) == 3


def test_check_controller_finds_what_is_kept_from_run_to_run() -> None:
    with pytest.raises(AssertionError, match="differently the second time"):
        check_controller(Forgetful(), time_limit=1.0)


def test_check_controller_finds_labels_that_no_file_can_hold() -> None:
    with pytest.raises(RecordError, match="label"):
        check_controller(Odd(), time_limit=1.0)


def test_a_controller_that_fails_ends_the_batch_with_its_episode(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="episode 0"):
        generate_dataset(tmp_path / "out", QUICK, f"{__name__}:Odd", episodes=2)
    with pytest.raises(ControllerError, match="no controller is named"):
        generate_dataset(tmp_path / "other", QUICK, "straight", episodes=2)
