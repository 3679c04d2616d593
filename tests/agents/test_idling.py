"""People who stand shift their weight, turn a little, and look round or at who passes."""

from __future__ import annotations

import numpy as np
import pytest

from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.core.entities import Furniture, Human, Interaction
from sonata2d.core.geometry import Disc, Pose, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.relations import TALKING
from sonata2d.core.scene import Scene
from sonata2d.sim.world import World

from ..conftest import room, walker

CORNER = Pose(-3.5, -3.5)


def motion(scene: Scene, seconds: float) -> tuple[Array, Array, Array]:
    """Positions, m, and directions of bodies and heads, rad; (T, N, 2), (T, N) and (T, N)."""
    world, crowd, places, bodies, heads = World(scene), Crowd(scene), [], [], []
    for _ in range(round(10 * seconds)):
        snapshot = world.snapshot()
        places.append(snapshot.humans.position)
        bodies.append([human.pose.theta for human in snapshot.humans])
        heads.append([human.head for human in snapshot.humans])
        world.step(Twist(), crowd.act(snapshot))
    return np.array(places), np.unwrap(bodies, axis=0), np.unwrap(heads, axis=0)


def test_a_person_who_stands_is_never_without_motion_and_stays_in_its_place() -> None:
    places, bodies, heads = motion(room([Human(1, Pose(0.0, 0.0))], robot=CORNER), 120.0)
    for start in range(0, 900, 100):
        part = slice(start, start + 300)
        assert np.ptp(places[part, 0], axis=0).max() > 0.01
        assert np.ptp(bodies[part, 0]) > 0.02
        assert np.ptp(heads[part, 0]) > 0.2
    assert np.abs(places[:, 0]).max() < 0.06
    assert np.abs(bodies[:, 0]).max() < 0.25
    assert np.abs(heads[:, 0]).max() < 1.45


def test_it_looks_at_a_walker_that_passes() -> None:
    others = [walker(k, -6.0 - 3.0 * k, 1.5, behaviour="walking", goals=((12.0, 1.5),)) for k in range(2, 12)]
    hall = ((-45.0, -4.0), (20.0, -4.0), (20.0, 4.0), (-45.0, 4.0))
    scene = room([Human(1, Pose(0.0, 0.0, 1.5708)), *others], robot=Pose(-44.0, -3.0), polygon=hall, seed=2)
    places, _, heads = motion(scene, 25.0)
    to = np.arctan2(places[:, 1:, 1] - places[:, :1, 1], places[:, 1:, 0] - places[:, :1, 0])
    is_near = np.hypot(*np.moveaxis(places[:, 1:] - places[:, :1], -1, 0)) < 3.0
    is_looked_at = (np.abs((heads[:, :1] - to + np.pi) % (2.0 * np.pi) - np.pi) < 0.15) & is_near
    is_away = np.abs(heads[:, 0] - 1.5708) > 0.4
    assert is_away.any()
    assert is_looked_at[is_away].any(axis=1).mean() > 0.3


def test_nobody_shifts_into_furniture() -> None:
    plant = Furniture(9, "plant", Pose(0.4, 0.0), Disc(0.15))
    places, _, _ = motion(room([Human(1, Pose(0.0, 0.0))], [plant], robot=CORNER), 40.0)
    assert np.abs(places[:, 0]).max() < 0.01


def test_people_who_talk_look_at_each_other_only() -> None:
    pair = [Human(1, Pose(-0.5, 0.0, 0.0)), Human(2, Pose(0.5, 0.0, np.pi))]
    scene = room(pair, robot=CORNER, interactions=(Interaction(1, TALKING, 2),))
    _, bodies, heads = motion(scene, 40.0)
    assert np.abs(heads[10:, 0]).max() < 0.3
    assert np.ptp(bodies[:, 0]) > 0.05
    assert np.abs(bodies[:, 0]).max() == pytest.approx(0.15, abs=0.12)
