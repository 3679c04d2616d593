"""Controllers in a process of their own: honest ones drive as in this process, and cheats are refused or useless."""

from __future__ import annotations

import gc
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import sonata2d as s2
from sonata2d.agents.controllers.loading import ControllerSource
from sonata2d.agents.sensors.lidar import Lidar
from sonata2d.benchmark import load_suite
from sonata2d.benchmark.isolated import Isolated
from sonata2d.benchmark.suite import TRACKS, Track
from sonata2d.core.compiled.cache import cache_folder
from sonata2d.core.devices import ImageRequest
from sonata2d.errors import BenchmarkError, ControllerError

from . import cheats

REFUSED = {
    "ReadsSuite": "read .*s2b-1.json",
    "Generates": "run the simulator .sonata2d.generate",
    "Simulates": "run the simulator .sonata2d.simulate",
    "StartsProgram": "start or stop processes",
    "Connects": "use the network",
    "WritesNotes": "write .*notes.txt",
    "HidesRefusal": "run the simulator",
    "ReadsFolder": "read .*README.md",
    "MovesKernel": "change files .os.rename",
    "UsesDatabase": "change files .sqlite3.connect",
}
if sys.platform != "win32":
    REFUSED["Forks"] = "start or stop processes"
if sys.platform == "linux":
    REFUSED["ReadsParent"] = "read /proc"


@contextmanager
def isolated(controller: object, track: Track = "state") -> Iterator[Isolated]:
    """A controller in a process of its own, which ends with the block."""
    driver = Isolated(ControllerSource(controller), track)  # type: ignore[arg-type]
    try:
        yield driver
    finally:
        driver.close()


def _scene(name: str = "sonata-2020", episode: int = 0) -> s2.Scene:
    return load_suite().entry(name).scene(1, episode)


def _commands(episode: s2.Episode, ticks: int = 40) -> list[s2.Twist]:
    while not episode.is_over and len(episode.past) < ticks:
        episode.step()
    return [tick.command for tick in episode.past]


@pytest.mark.parametrize("name", ["social-planner", "orca", "graph-policy"])
def test_a_stock_controller_drives_as_in_this_process(name: str) -> None:
    scene = _scene("lively", 2)
    with isolated(name) as driver:
        alone = _commands(s2.Episode(scene, driver))
    here = _commands(s2.Episode(scene, s2.load_controller(name)))
    same = sum(a == b for a, b in zip(alone, here, strict=True))
    assert same == len(here)
    assert not driver.late


def test_sensors_measure_outside_of_the_process() -> None:
    scene = _scene("home", 1)
    with isolated("dwa", "lidar") as driver:
        alone = _commands(s2.Episode(scene, driver), 25)
    here = _commands(s2.Episode(scene, s2.load_controller("dwa")), 25)
    assert alone == here


@pytest.mark.parametrize("name", REFUSED)
def test_a_cheat_is_refused(name: str) -> None:
    with isolated(cheats.Honest) as driver:  # the same file without the cheat is accepted
        assert _commands(s2.Episode(_scene(), driver), 2)[0] == cheats.AHEAD
    with pytest.raises(
        BenchmarkError, match=f"breaks the rules of the benchmark: the controller tried to {REFUSED[name]}"
    ):
        Isolated(ControllerSource(getattr(cheats, name)))


def test_there_is_nothing_to_find_in_the_process() -> None:
    with isolated(cheats.Snoops) as driver:
        assert set(_commands(s2.Episode(_scene("waiting-room"), driver), 3)) == {s2.Twist()}


def test_kernels_of_the_process_are_not_loaded_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, shared = tmp_path / "sonata2d", cache_folder()
    assert shared is not None
    shutil.copytree(shared, folder, ignore=shutil.ignore_patterns("*.tmp", "*.lock"))  # other tests write to that one
    folder.chmod(0o700)
    monkeypatch.setattr("sonata2d.core.compiled.cache._location", lambda: folder)
    before = sorted(folder.iterdir())
    with isolated("social-planner") as driver:
        assert driver._cache is not None
        copy = Path(driver._cache)
        assert (copy / "sonata2d").is_dir()
        assert copy / "sonata2d" != folder
    assert not copy.exists()
    assert before == sorted(folder.iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="/proc is a folder of Linux")
def test_what_does_no_harm_is_allowed() -> None:
    with isolated(cheats.SetsEnvironment) as driver:
        assert _commands(s2.Episode(_scene(), driver), 2)[0] == cheats.AHEAD


def test_the_process_ends_with_its_driver() -> None:
    process = Isolated(ControllerSource(cheats.Honest))._process
    gc.collect()
    assert process is not None
    assert process.wait(timeout=5.0) is not None


def test_answers_are_three_numbers_and_no_objects() -> None:
    with isolated(cheats.SendsObject) as driver:
        outcome = s2.Episode(_scene(), driver).run()
    assert outcome.status == "stopped"
    assert outcome.reason.startswith("the controller failed: act must return a Twist, got b'")


def test_answers_out_of_turn_are_noticed() -> None:
    with pytest.raises(BenchmarkError, match="answered out of turn"):
        Isolated(ControllerSource(cheats.AnswersTwice))


def test_late_answers_hold_the_last_command() -> None:
    with isolated(cheats.ThinksLong) as driver:
        driver._second = 2e-3  # of a call of the fixed work, whatever else this machine does
        commands = _commands(s2.Episode(_scene(), driver), 10)
    assert driver.late == [4, 9]
    assert commands == [cheats.AHEAD] * 10


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("NotFinite", "the controller failed: the command is not finite"),
        ("Raises", "the controller failed: RuntimeError: no plan"),
        ("Exits", "the controller failed: its process ended"),
        ("ExitsAtOnce", "the controller failed: its process ended"),
    ],
)
def test_a_controller_that_fails_ends_its_scene_only(name: str, reason: str) -> None:
    with isolated(getattr(cheats, name)) as driver:
        for _ in range(2):
            outcome = s2.Episode(_scene(), driver).run()
            assert outcome.status == "stopped"
            assert outcome.reason.startswith(reason)


def test_sensors_of_a_track_are_fixed() -> None:
    for track in TRACKS:
        with pytest.raises(BenchmarkError, match="the sensors of the benchmark are Lidar"):
            Isolated(ControllerSource(_Fine), track)
    with pytest.raises(BenchmarkError, match="the track lidar is for controllers with partial = True"):
        Isolated(ControllerSource("orca"), "lidar")
    with pytest.raises(BenchmarkError, match="requests camera images"):
        Isolated(ControllerSource(_Looks))
    with pytest.raises(ControllerError, match="cannot be loaded in a process of its own"):
        Isolated(ControllerSource("no-such-controller"))


class _Fine(cheats.Honest):
    partial = True
    sensors = (Lidar(rays=4000, distance=100.0),)


class _Looks(cheats.Honest):
    image = ImageRequest(64, 64)
