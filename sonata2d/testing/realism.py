"""The people of sonata2d behind the door of a check against recorded pedestrians: the world and crowd users get."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ..agents.pedestrians.crowd import Crowd
from ..core.entities import DEFAULT_MODEL, PERSON_RADIUS, Goal, Group, Human, Robot, Wall
from ..core.geometry import Barriers, Pose, Twist, segment_distances
from ..core.portable_math import Array
from ..core.scene import Rules, Scene
from ..sim.world import World

MARGIN = 30.0  # m, round everything: the room's own walls are far away
BEYOND = 1.0  # m, beyond what can be walked in the time, that people look ahead for walls
BESIDE = 0.02  # m, from a wall, where one may still walk along it
STANDS = 1e-6  # m: a goal nearer than this is where one is


def simulate(
    initial_positions: Array,
    initial_velocities: Array,
    goals: Array,
    desired_speeds: Array,
    obstacles: Array,
    dt: float,
    steps: int,
    groups: Any = None,
    *,
    model: str = DEFAULT_MODEL,
    radius: float = PERSON_RADIUS,
) -> Array:
    """Let people walk from a given state.

    A goal tells where to: it often lies far beyond what can be walked in the time, and may lie behind a wall that
    nobody gets to. So who has nothing in the way for as far as they can get goes straight on, and only the others look
    for a way round.

    Args:
        initial_positions, initial_velocities: (N, 2), m and m/s.
        goals: (N, 2), m, one place for each; who is there already stands.
        desired_speeds: (N,), m/s.
        obstacles: (M, 4), walls as x1, y1, x2, y2, m.
        dt: s, between returned positions.
        steps: how many to return.
        groups: (N,) of int; people of one number above 0 walk together. None: all are alone.
        model: name of the walking model.
        radius: of everybody, m.

    Returns:
        (steps, N, 2), m, the first one dt after the start.
    """
    goals = within_reach(initial_positions, goals, desired_speeds * (dt * steps) + BEYOND, obstacles)
    scene = scene_of_state(initial_positions, initial_velocities, goals, desired_speeds, obstacles, dt, groups,
                           model=model, radius=radius)  # fmt: skip
    world, crowd = World(scene), Crowd(scene)
    path = np.empty((steps, len(initial_positions), 2))
    for step in range(steps):
        world.step(Twist(), crowd.act(world.snapshot()))
        path[step] = world.snapshot().humans.position
    return path


def within_reach(positions: Array, goals: Array, reach: Array, obstacles: Array) -> Array:
    """Goals (N, 2), m, no farther than their reach (N,), m, for those who have no wall (M, 4) on the way to there."""
    way = goals - positions
    far = np.maximum(np.sqrt((way * way).sum(axis=1)), 1e-9)
    nearer = positions + way * (np.minimum(reach, far) / far)[:, None]
    walls = Barriers.of(((a, b), (c, d), 0.0) for a, b, c, d in obstacles.tolist())
    is_clear: Any = segment_distances(positions, nearer, walls).min(axis=0, initial=np.inf) > BESIDE
    return np.where(is_clear[:, None], nearer, goals)


def scene_of_state(
    positions: Array, velocities: Array, goals: Array, speeds: Array, obstacles: Array, dt: float, groups: Any,
    *, model: str, radius: float,
) -> Scene:  # fmt: skip
    """People in a given state, each with a goal, and a robot far away that nobody minds."""
    stands = np.sqrt(((goals - positions) * (goals - positions)).sum(axis=1)) < STANDS
    companies = np.zeros(len(positions), dtype=int) if groups is None else np.where(stands, 0, np.asarray(groups))
    members: dict[int, list[int]] = {}
    for k, group in enumerate(companies.tolist()):
        if group > 0:
            members.setdefault(group, []).append(k + 1)
    company = {human: group for group, humans in members.items() if len(humans) > 1 for human in humans}
    places = np.concatenate((positions, goals, obstacles.reshape(-1, 2)))
    (x0, y0), (x1, y1) = (places.min(axis=0) - MARGIN).tolist(), (places.max(axis=0) + MARGIN).tolist()
    walking = (goals - positions).tolist()
    return Scene(
        name="recorded",
        family="recorded/given",
        polygon=((x0, y0), (x1, y0), (x1, y1), (x0, y1)),
        walls=tuple(Wall((a, b), (c, d)) for a, b, c, d in obstacles.tolist()),
        furniture=(),
        humans=tuple(
            Human(
                id=k + 1,
                pose=Pose(x, y, float(np.arctan2(walking[k][1], walking[k][0]))),
                radius=radius,
                desired_speed=float(speeds[k]),
                behaviour="standing" if stands[k] else "walking",
                model=model,
                reacts_to_robot=0.0,
                group=company.get(k + 1),
                goals=() if stands[k] else ((float(goals[k, 0]), float(goals[k, 1])),),
                velocity=(float(velocities[k, 0]), float(velocities[k, 1])),
            )
            for k, (x, y) in enumerate(positions.tolist())
        ),
        robot=Robot(Pose(x0 + 1.0, y0 + 1.0)),
        goal=Goal(x1 - 1.0, y1 - 1.0),
        groups=tuple(Group(g, "walking", tuple(humans)) for g, humans in members.items() if len(humans) > 1),
        rules=Rules(dt=dt),
    )


# The same people under the laws of the literature.
moussaid2009 = partial(simulate, model="moussaid2009")
helbing1995 = partial(simulate, model="helbing1995")
helbing2000 = partial(simulate, model="helbing2000")
farina2017 = partial(simulate, model="farina2017")
orca2011 = partial(simulate, model="orca2011")
