"""Towards the robot: who ignores it, avoids it, stops, comes to see it or is scared does just that, and gets on."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.core.entities import Human, Limits, Reaction, Wall
from sonata2d.core.geometry import Pose, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.scenegen.scenario.social import ClearanceConfig
from sonata2d.sim.world import World

from ..conftest import room, walker

HALL = ((-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-8.0, 8.0))
KINDS: tuple[Reaction, ...] = ("ignores", "avoids", "stops", "curious", "scared")


def watched(scene: Scene, speed: float, ticks: int, until: float = 7.0) -> list[Snapshot]:
    """What happens while the robot drives straight ahead, as far as x = `until`."""
    world, crowd, seen = World(scene), Crowd(scene), []
    for _ in range(ticks):
        seen.append(world.snapshot())
        drives = seen[-1].robot.position[0] < until
        world.step(Twist(speed if drives else 0.0), crowd.act(seen[-1]))
    return seen


def crosser(reaction: Reaction, clearance: float = 0.83, goal: float = 7.0) -> Human:
    """Somebody who comes up from below at full speed, and would cross at the middle after 4.6 s."""
    place, up = Pose(0.0, -6.0, math.pi / 2), (0.0, 1.3)
    return Human(
        1, place, behaviour="walking", goals=((0.0, goal),), velocity=up, reaction=reaction, robot_clearance=clearance
    )


def crossing(reaction: Reaction, late: float = 0.0, clearance: float = 0.83) -> list[Snapshot]:
    """They and the robot would be `late` m apart from being at the middle at once."""
    robot = Pose(-4.6 - late, 0.0)
    return watched(room([crosser(reaction, clearance)], robot=robot, polygon=HALL, limits=Limits()), 1.0, 95)


def gaps(seen: list[Snapshot], k: int = 0) -> Array:
    """(T,), m, from outline to outline."""
    apart = np.array([s.humans.position[k] - s.robot.position for s in seen])
    return np.sqrt(apart[:, 0] ** 2 + apart[:, 1] ** 2) - seen[0].humans.radius[k] - seen[0].robot.radius


def looks_at_robot(seen: list[Snapshot], k: int = 0) -> float:
    """Share of the looks in which somebody's head points within 15 degrees of the robot."""
    to = np.array([s.robot.position - s.humans.position[k] for s in seen])
    head = np.array([s.humans.look[k] for s in seen])
    return float(((to * head).sum(axis=1) > math.cos(0.26) * np.linalg.norm(to, axis=1)).mean())


def test_crossing_walkers_keep_the_clearance_of_the_measured_ones() -> None:
    """0.83 ± 0.27 m, from outline to outline; the distribution is cut at two deviations."""
    rng, law, kept, asked = RandomStream(1, 0, "scene"), ClearanceConfig(), [], []
    for _ in range(24):
        asked.append(rng.normal(law.mean, law.sd, law.min, law.max))
        kept.append(gaps(crossing("avoids", rng.uniform(-0.5, 0.5), asked[-1])).min())
    assert np.mean(kept) == pytest.approx(0.83, abs=0.1)
    assert 0.18 < np.std(kept) < 0.32
    assert np.abs(np.array(kept) - asked).max() < 0.1


def test_who_avoids_gives_way_behind_the_robot() -> None:
    seen = crossing("avoids")
    at = int(np.abs([s.humans.position[0, 1] for s in seen]).argmin())
    assert seen[at].humans.position[0, 0] < seen[at].robot.position[0]


def test_who_ignores_the_robot_walks_as_if_it_were_far_away() -> None:
    near = watched(room([crosser("ignores")], robot=Pose(-4.0, 2.0), polygon=HALL), 0.0, 60)
    far = watched(room([crosser("ignores")], robot=Pose(-7.0, 7.0), polygon=HALL), 0.0, 60)
    assert all((a.humans.state == b.humans.state).all() for a, b in zip(near, far, strict=True))


def test_who_stops_stands_until_the_robot_has_passed_and_goes_on() -> None:
    seen = crossing("stops")
    speed = np.array([np.linalg.norm(s.humans.velocity[0]) for s in seen])
    stood = np.flatnonzero(speed[10:] < 0.25) + 10
    assert len(stood) > 5
    assert all(seen[int(k)].robot.position[0] < 0.5 for k in stood[stood < 80])
    assert seen[-1].humans.position[0, 1] > 2.0
    assert gaps(seen).min() > 0.3


@pytest.mark.parametrize("reaction", KINDS[1:])
def test_nobody_is_held_for_ever_by_a_robot_that_waits_in_the_way(reaction: Reaction) -> None:
    seen = watched(room([crosser(reaction, goal=4.0)], robot=Pose(0.0, 0.0), polygon=HALL), 0.0, 300)
    assert seen[-1].humans.position[0, 1] > 3.0
    assert gaps(seen).min() > 0.0


def test_the_curious_come_to_a_social_distance_face_the_robot_and_lose_interest() -> None:
    scene = room([crosser("curious")], robot=Pose(-2.0, 0.0), polygon=HALL)
    seen = watched(scene, 0.0, 250)
    near = [s for s, gap in zip(seen, gaps(seen), strict=True) if abs(gap - 1.2) < 0.15]
    assert len(near) > 40
    there = near[20].humans
    to = np.array(near[20].robot.position) - there.position[0]
    assert there.direction[0] @ to > 0.98 * np.linalg.norm(to)
    assert there.look[0] @ to > 0.98 * np.linalg.norm(to)
    assert seen[-1].humans.position[0, 1] > 4.0


def test_the_scared_keep_farther_away_and_look_more_than_who_avoids() -> None:
    runs = {kind: crossing(kind) for kind in ("avoids", "scared")}
    assert gaps(runs["scared"]).min() > gaps(runs["avoids"]).min() + 0.4
    assert looks_at_robot(runs["scared"][10:50]) > looks_at_robot(runs["avoids"][10:50])


def test_the_scared_who_stand_step_back_and_return() -> None:
    scene = room([Human(1, Pose(0.0, 1.0, -1.5), reaction="scared")], robot=Pose(-5.0, 0.0), polygon=HALL)
    seen = watched(scene, 1.0, 140)
    moved = np.array([np.linalg.norm(s.humans.position[0] - (0.0, 1.0)) for s in seen])
    assert 0.3 < moved.max() < 0.85
    assert moved[-1] < 0.05


def test_glances_of_who_stands_are_as_the_reaction() -> None:
    share = {}
    for kind in KINDS:
        scene = room([Human(1, Pose(0.0, 1.5, math.pi), reaction=kind)], robot=Pose(-4.0, 0.0), polygon=HALL)
        share[kind] = looks_at_robot(watched(scene, 1.0, 45))
    assert share["ignores"] < 0.1
    assert share["ignores"] < share["avoids"] < share["scared"]
    assert share["curious"] > 0.5


def test_a_reaction_does_not_go_through_walls() -> None:
    wall = [Wall((-8.0, 0.6), (8.0, 0.6))]
    stander = Human(1, Pose(0.0, 1.5, -1.5), reaction="scared")
    seen = watched(room([stander], robot=Pose(-4.0, 0.0), polygon=HALL, inner=wall), 1.0, 70)
    assert np.ptp([s.humans.head[0] for s in seen]) < 1e-6
    assert np.abs(np.array([s.humans.position[0] for s in seen]) - (0.0, 1.5)).max() < 1e-6


@pytest.mark.parametrize("reaction", KINDS)
def test_reactions_are_mirrored_with_the_scene(reaction: Reaction) -> None:
    ends = []
    for side in (1, -1):
        sides: Literal[-1, 1] = 1 if side == 1 else -1
        people = [
            replace(crosser(reaction), pose=Pose(0.0, -6.0 * side, side * math.pi / 2), velocity=(0.0, 1.3 * side),
                    goals=((0.0, 7.0 * side),)),
            Human(2, Pose(1.0, 1.4 * side, -1.5 * side), reaction=reaction),
        ]  # fmt: skip
        scene = room(people, robot=Pose(-4.6, 0.0), polygon=HALL, rules=Rules(side=sides), limits=Limits())
        ends.append(np.array([s.humans.state for s in watched(scene, 1.0, 90)]))
    signs = np.array([1, -1, 1, -1, 1, -1, 1, -1, -1])
    assert ends[0] == pytest.approx(ends[1] * signs, abs=1e-6)


def test_zero_and_ignores_are_the_same() -> None:
    assert walker(1, 0.0, 0.0, reacts_to_robot=0.0).reaction == "ignores"
    assert walker(1, 0.0, 0.0, reaction="ignores").reacts_to_robot == 0.0
