"""The compiled tick: the interpreter gives the same bits, worlds run in threads, and a client can push commands."""

from __future__ import annotations

import gc
import multiprocessing
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.controllers.base import External
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.agents.pedestrians.models.sonata2026 import Sonata2026Model
from sonata2d.core.compiled.kernel import IS_COMPILED
from sonata2d.core.devices import DeviceEvent
from sonata2d.core.geometry import Twist
from sonata2d.core.snapshot import Snapshot
from sonata2d.errors import ControllerError
from sonata2d.sim.world import World

from ..conftest import room, walker
from .episodes import digests, recorded


def test_the_interpreter_gives_the_same_bits_as_compiled_code() -> None:
    """Every pedestrian model and stock controller, and rooms with walls, groups, reactions and social behaviour."""
    if not IS_COMPILED:
        pytest.skip("numba is missing or disabled: there is no compiled code to compare with")
    command = [sys.executable, "-W", "error", "-m", "tests.sim.episodes"]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    found = subprocess.run(
        command, env=environment, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=True
    )
    assert found.stdout.split() == digests()


def test_worlds_in_threads_give_the_same_bytes_as_one_after_the_other() -> None:
    """Kernels release the interpreter's lock, so that the ticks of several worlds overlap."""
    seeds = range(4)
    one_by_one = [recorded("sonata-2020-crowded", seed, s2.SocialPlanner(), 6.0) for seed in seeds]
    with ThreadPoolExecutor(4) as pool:
        runs = [pool.submit(recorded, "sonata-2020-crowded", seed, s2.SocialPlanner(), 6.0) for seed in seeds]
    assert [run.result() for run in runs] == one_by_one


def make_and_drop_worlds() -> None:
    """In three threads, with a collector of garbage that runs often."""
    gc.set_threshold(100, 2, 2)
    scenes = [s2.generate("lively", seed) for seed in range(3)]

    def work(first: int) -> None:
        for n in range(300):
            World(scenes[(first + n) % 3])

    with ThreadPoolExecutor(3) as pool:
        list(pool.map(work, range(3)))


def test_worlds_can_be_dropped_in_threads() -> None:
    """The engine's bodies may be freed in another thread than their space; in a process, which could crash."""
    process = multiprocessing.get_context("spawn").Process(target=make_and_drop_worlds)
    process.start()
    process.join(100)
    assert process.exitcode == 0


class Half(s2.Controller):
    """Drives ahead and labels each frame with its tick."""

    def act(self, snapshot: Snapshot) -> Twist:
        return Twist(0.5, 0.0, 0.1)

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        return {"tick": snapshot.tick}


def test_pushed_commands_give_the_same_episode_as_a_controller() -> None:
    scene = room([walker(1, 0.0, 1.0), walker(2, 1.0, -1.0)])
    driven, pushed = s2.Episode(scene, Half()), s2.Episode(scene)
    driven.run()
    while not pushed.is_over:
        snapshot = pushed.observe()
        pushed.apply(Twist(0.5, 0.0, 0.1), {"tick": snapshot.tick})
    assert pushed.past == driven.past
    assert pushed.outcome == driven.outcome
    assert pushed.snapshot().state.row.tobytes() == driven.snapshot().state.row.tobytes()


def test_observing_again_gives_the_same_snapshot_and_adds_events() -> None:
    episode = s2.Episode(room())
    first, second = (DeviceEvent("keyboard", key, 1.0) for key in ("w", "a"))
    assert episode.observe() is episode.observe()
    assert episode.observe([first]).events == (first,)
    frame = episode.apply(Twist(), events=[second])
    assert frame is not None
    assert frame.snapshot.events == episode.past[0].events == (first, second)
    assert episode.observe().events == ()


def test_after_the_end_nothing_is_applied_and_the_last_snapshot_can_be_observed() -> None:
    episode = s2.Episode(room(goal=(-3.0, 0.0)))  # the robot starts at its goal
    assert episode.apply(Twist(vx=1.0)) is None
    assert episode.outcome is not None
    assert episode.outcome.status == "goal"
    assert episode.observe().tick == 0
    assert episode.past == []


def test_events_observed_before_the_end_are_in_the_final_state_and_later_ones_are_not() -> None:
    first, second, third = (DeviceEvent("keyboard", key, 1.0) for key in ("w", "a", "q"))
    recorder = s2.EpisodeRecorder()
    episode = s2.Episode(room(), observers=[recorder])
    episode.observe([first])
    episode.end("stopped", "by the driver", [second])
    document = recorder.document()
    assert episode.observe([third]).events == (first, second)
    assert b'"w"' in document
    assert b'"a"' in document


@pytest.mark.parametrize("events", [["w"], "w", [None]])
def test_events_of_another_kind_are_refused(events: Any) -> None:
    episode = s2.Episode(room())
    with pytest.raises(TypeError, match="must be a sequence of DeviceEvent"):
        episode.observe(events)
    assert episode.observe().events == ()


def test_a_controller_hears_of_commands_that_are_applied_instead_of_its_own() -> None:
    class Listener(Half):
        def command_overridden(self, twist: Twist) -> None:
            heard.append(twist)

    heard: list[Twist] = []
    episode = s2.Episode(room(), Listener())
    episode.step()
    episode.apply(Twist(vx=0.2))
    assert heard == [Twist(vx=0.2)]


@pytest.mark.parametrize("name", ["lively", "waiting-room", "intersection", "crossing-flows"])
@pytest.mark.parametrize("model", ["sonata2026", "farina2017"])
def test_a_tick_in_one_call_equals_its_parts_called_one_after_the_other(name: str, model: str) -> None:
    """One after the other as for a model in ordinary Python."""
    scene = s2.generate(name, 3)
    scene = replace(scene, humans=tuple(replace(human, model=model) for human in scene.humans))
    whole, parts = s2.Episode(scene), World(scene)
    crowd = Crowd(scene)
    assert whole._crowd.is_compiled
    for tick in range(80):
        command = Twist(0.6, 0.0, 0.4 if tick % 40 < 20 else -0.4)
        snapshot = parts.snapshot()
        parts.step(command, crowd.act(snapshot), is_limited=True)
        whole.apply(command)
        state, other = whole._world.snapshot().state, parts.snapshot().state
        assert state.row.tobytes() == other.row.tobytes()
        assert state.activity.tobytes() == other.activity.tobytes()
        assert whole._world.snapshot().interactions == parts.snapshot().interactions


def test_an_error_of_a_pedestrian_model_ends_the_episode_before_the_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = [np.zeros((1, 2)), None]
    monkeypatch.setattr(Sonata2026Model, "acceleration", lambda self, walkers: answers.pop(0))
    recorder = s2.EpisodeRecorder()
    episode = s2.Episode(room([walker(1, 0.0, 0.0)]), Half(), observers=[recorder])
    episode.step()
    with pytest.raises(ValueError, match="must return an array") as caught:
        episode.step()
    assert caught.value.__notes__ == ["at tick 1 of episode 0, seed 0"]
    assert episode.outcome is not None
    assert (episode.outcome.status, episode.outcome.tick) == ("error", 1)
    assert len(episode.past) == 1
    assert recorder.document().count(b'\n{"tick":') == 1
    assert episode.step() is None


@pytest.mark.parametrize("command", [Twist(vx=float("nan")), 0.5, Twist(vx=1e300)])
def test_a_command_that_no_file_can_hold_is_refused_and_moves_nothing(command: Any) -> None:
    episode = s2.Episode(room())
    with pytest.raises(ControllerError, match="the command"):
        episode.apply(command)
    assert episode.outcome is None
    assert episode.apply(Twist()) is not None


def test_an_episode_without_a_controller_says_where_its_commands_come_from() -> None:
    with pytest.raises(ControllerError, match=r"Episode\.apply"):
        s2.Episode(room()).run()
    assert not External.deterministic


def test_what_a_controller_does_not_read_is_not_built() -> None:
    class OnlyTheRobot(s2.Controller):
        def act(self, snapshot: Snapshot) -> Twist:
            assert snapshot.robot.radius > 0.0
            snapshots.append(snapshot)
            return Twist()

    snapshots: list[Snapshot] = []
    episode = s2.Episode(room([walker(1, 0.0, 0.0)]), OnlyTheRobot())
    for _ in range(3):
        episode.step()
    for snapshot in snapshots:
        assert "robot" in vars(snapshot)
        assert "humans" not in vars(snapshot)
    assert len(snapshots[0].humans) == 1  # built when it is read
    assert len(vars(snapshots[0])["humans"]) == 1
