"""Controllers of the benchmark get what a robot can see, and no more."""

from __future__ import annotations

import math

import numpy as np

from sonata2d.benchmark import Sensing, load_suite
from sonata2d.benchmark.shown import Perception
from sonata2d.core.entities import Human
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Snapshot, snapshot_of


def _scene(name: str = "lively", episode: int = 0) -> Scene:
    return load_suite().entry(name).scene(11, episode)


def test_the_scene_has_no_seed_settings_or_intentions() -> None:
    for name in ("crossing-a-group", "waiting-room", "intersection"):
        scene = _scene(name)
        shown = Perception(scene).scene
        assert (shown.seed, shown.episode, shown.settings, shown.name) == (0, 0, None, "benchmark")
        assert not shown.doors
        assert not shown.queues
        assert not shown.places
        for human in shown.humans:
            assert not human.goals
            assert human.desired_speed == Human(1, human.pose).desired_speed
            assert (human.reaction, human.enters, human.leaves, human.group) == ("avoids", 0, None, None)


def test_people_who_enter_later_are_nowhere_in_the_room() -> None:
    scene = _scene("waiting-room", 3)
    later = [human.id for human in scene.humans if human.enters > 0]
    assert later
    shown = Perception(scene).scene
    x, y = scene.outline.max(axis=0)
    for human in shown.humans:
        if human.id in later:
            assert human.pose.x > x
            assert human.pose.y > y
    assert shown.furniture == scene.furniture
    assert shown.walls == scene.walls


def test_everything_present_is_exact_without_sensing() -> None:
    scene = _scene()
    snapshot = snapshot_of(scene)
    state, links = Perception(scene).state(snapshot)
    assert np.array_equal(state.row, snapshot.state.row)
    assert links == snapshot.interactions


def test_people_out_of_view_are_absent() -> None:
    scene = _scene()
    snapshot = snapshot_of(scene)
    perception = Perception(scene, Sensing(angle=math.pi / 2, distance=4.0))
    state, links = perception.state(snapshot)
    assert state.is_present is not None
    seen = Snapshot.of_state(0, perception.scene, state, links).humans
    assert len(seen) < len(snapshot.humans)
    for position in seen.position:
        ahead, left = snapshot.robot.pose.to_local(tuple(position))
        assert abs(math.atan2(left, ahead)) <= math.pi / 4 + 0.2  # of a body that is partly in view
    hidden = {human.id for human in scene.humans} - set(seen.id.tolist())
    assert hidden
    for link in links:
        assert not hidden & {link.src, link.dst}
    far = {human.id: human.pose.x for human in perception.scene.humans}
    assert all(far[id] > scene.outline[:, 0].max() for id in hidden)


def test_noise_differs_between_ticks_and_is_the_same_in_every_run() -> None:
    scene = _scene()
    snapshot = snapshot_of(scene)
    sensing = Sensing(noise=0.1, velocity_noise=0.2)
    rows = [Perception(scene, sensing).state(snapshot)[0].humans for _ in range(2)]
    assert np.array_equal(rows[0], rows[1])
    errors = rows[0][:, :2] - snapshot.state.humans[:, :2]
    assert 0.0 < np.abs(errors).max() < 0.6
    assert np.array_equal(rows[0][:, 4:6], snapshot.state.humans[:, 4:6])
