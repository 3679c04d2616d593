"""People in groups: where they face and look, and that others go round what they share."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sonata2d.core.entities import TALKING, Formation, Group, Human, Interaction
from sonata2d.core.geometry import Pose, inside_polygon
from sonata2d.core.scene import Scene
from sonata2d.scenegen.sampling import talking

from ..conftest import room, walker
from .test_crowd import watched


def group(formation: Formation, size: int, *, told: bool = True, others: tuple[Human, ...] = ()) -> Scene:
    """A talking group round the origin, in a formation that the scene tells or not."""
    people = tuple(Human(k, pose, group=1) for k, pose in enumerate(talking(formation, size, 1.0).poses, 1))
    ids = tuple(human.id for human in people)
    ties = tuple(Interaction(a, TALKING, b) for a in ids for b in ids if a < b)
    own = Group(1, "talking", ids, formation if told else None)
    return room([*people, *others], groups=(own,), interactions=ties, robot=Pose(-3.5, -3.5))


@pytest.mark.parametrize(("formation", "size"), [("l", 2), ("side_by_side", 2), ("circle", 5), ("semicircle", 4)])
def test_who_talks_in_a_formation_keeps_it(formation: Formation, size: int) -> None:
    seen = watched(group(formation, size), 4.0)
    start, end = seen[0].humans, seen[-1].humans
    assert np.allclose(start.direction, end.direction, atol=1e-6)
    assert np.abs(start.position - end.position).max() < 0.02


@pytest.mark.parametrize("size", [3, 4, 6])
def test_without_a_formation_people_turn_to_the_middle_of_the_others(size: int) -> None:
    scene = group("circle", size, told=False)
    astray = tuple(replace(human, pose=replace(human.pose, theta=1.0)) for human in scene.humans)
    end = watched(replace(scene, humans=astray), 3.0)[-1].humans
    for k, human in enumerate(end):
        others = np.delete(end.position, k, axis=0).mean(axis=0)
        ahead, left = human.pose.to_local((float(others[0]), float(others[1])))
        assert abs(math.atan2(left, ahead)) < 0.02


def test_two_who_talk_face_each_other_as_ever() -> None:
    end = watched(group("l", 2, told=False), 3.0)[-1].humans
    assert np.allclose(end.direction[0], -end.direction[1], atol=1e-2)


def test_walkers_go_round_a_talking_group_not_through() -> None:
    passer = replace(walker(9, -3.0, 0.1), behaviour="walking", goals=((3.0, 0.1),), desired_speed=1.3)
    seen = watched(group("circle", 6, others=(passer,)), 8.0)
    ring = seen[0].humans.position[:6]
    ways = np.array([look.humans.position[6] for look in seen])
    assert not inside_polygon(ways, ring).any()
    assert ways[-1] == pytest.approx((3.0, 0.1), abs=0.6)
