"""The pedestrians as one function, for checks that compare simulated trajectories with recorded ones."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..agents.pedestrians.crowd import Crowd
from ..core.entities import DEFAULT_MODEL, PERSON_BREADTH, PERSON_RADIUS, Goal, Group, Human, Robot, Wall
from ..core.geometry import Pose, Twist
from ..core.portable_math import Array, IntArray, angle_of
from ..core.scene import Rules, Scene
from ..core.vectors import X, Y, lengths
from ..sim.world import World

_MARGIN = 30.0  # m, from all positions to the outline of the room, which has no influence at this distance
_PASSING_DISTANCE = 1.0  # m; a goal nearer than this is carried on, because pedestrians stop near their last goal
_STANDING_DISTANCE = 1e-6  # m; a pedestrian nearer to its goal than this stands


def simulate(
    initial_positions: Array,
    initial_velocities: Array,
    goals: Array,
    desired_speeds: Array,
    obstacles: Array,
    dt: float,
    steps: int,
    groups: IntArray | None = None,
    *,
    model: str = DEFAULT_MODEL,
    radius: float = PERSON_RADIUS,
    breadth: float = PERSON_BREADTH,
    seed: int = 0,
) -> Array:
    """Simulate pedestrians from a given state, without a robot near them.

    Pedestrians search for paths to their goals round the walls, and walk straight to a goal that they cannot reach.
    They start with the heading, and in narrow gaps with the turn of the shoulders, that they would take there.

    Args:
        initial_positions, initial_velocities: (N, 2), m and m/s.
        goals: (N, 2), m; a pedestrian that is at its goal stands, and one that comes to it stops near it, but walks on
            if it starts less than 1 m from it.
        desired_speeds: (N,), m/s.
        obstacles: (M, 4), walls as x1, y1, x2, y2, m.
        dt: time between returned positions, s.
        steps: number of returned positions.
        groups: (N,) of int; pedestrians with the same number above 0 walk together. None: no groups.
        model: name of the pedestrian model.
        radius, breadth: of all pedestrians, m; see `Human`.
        seed: of the deviations of walkers from their course and speed. No run can foresee those of recorded people, so
            that several runs are compared with a recording, and the best one counts, as in forecasting.

    Returns:
        Positions (steps, N, 2), m; the first ones are dt after the start.
    """
    scene = scene_from_state(
        initial_positions, initial_velocities, goals, desired_speeds, obstacles, groups,
        dt=dt, model=model, radius=radius, breadth=breadth, seed=seed,
    )  # fmt: skip
    first = Crowd(scene)
    facing = first.act(World(scene).snapshot()).facing.tolist()
    scene = replace(scene, humans=tuple(_turned(h, x, y) for h, (x, y) in zip(scene.humans, facing, strict=True)))
    world, crowd = World(scene), Crowd(scene)
    crowd.turn_shoulders_like(first)
    positions = np.empty((steps, len(initial_positions), 2))
    for step in range(steps):
        world.step(Twist(), crowd.act(world.snapshot()))
        positions[step] = world.snapshot().humans.position
    return positions


def _turned(human: Human, x: float, y: float) -> Human:
    """A pedestrian with the heading of a unit vector."""
    return replace(human, pose=Pose(human.pose.x, human.pose.y, angle_of(y, x)))


def scene_from_state(
    positions: Array, velocities: Array, goals: Array, speeds: Array, obstacles: Array, groups: IntArray | None,
    *, dt: float, model: str, radius: float, breadth: float, seed: int,
) -> Scene:  # fmt: skip
    """A scene of pedestrians in a given state, each with a goal, and a robot far away that they ignore.

    Args:
        positions, velocities, goals: (N, 2), m and m/s.
        speeds: (N,), desired speeds, m/s.
        obstacles, groups, dt, model, radius, breadth, seed: as for `simulate`.
    """
    offset = goals - positions
    distance = lengths(offset)
    stands = distance < _STANDING_DISTANCE
    scale = np.where(distance < _PASSING_DISTANCE, _PASSING_DISTANCE / np.maximum(distance, _STANDING_DISTANCE), 1.0)
    goals = np.where(stands[:, None], goals, positions + offset * scale[:, None])
    numbers = np.zeros(len(positions), dtype=int) if groups is None else np.where(stands, 0, np.asarray(groups))
    members: dict[int, list[int]] = {}
    for k, number in enumerate(numbers.tolist()):
        if number > 0:
            members.setdefault(number, []).append(k + 1)
    members = {number: humans for number, humans in members.items() if len(humans) > 1}
    group_of = {human: number for number, humans in members.items() for human in humans}
    points = np.concatenate((positions, goals, obstacles.reshape(-1, 2)))
    (x0, y0), (x1, y1) = (points.min(axis=0) - _MARGIN).tolist(), (points.max(axis=0) + _MARGIN).tolist()
    return Scene(
        name="recorded",
        family="recorded/given",
        polygon=((x0, y0), (x1, y0), (x1, y1), (x0, y1)),
        walls=tuple(Wall((a, b), (c, d)) for a, b, c, d in obstacles.tolist()),
        furniture=(),
        humans=tuple(
            Human(
                id=k + 1,
                pose=Pose(x, y, angle_of(float(offset[k, Y]), float(offset[k, X]))),
                radius=radius,
                desired_speed=float(speeds[k]),
                behaviour="standing" if stands[k] else "walking",
                model=model,
                reacts_to_robot=0.0,
                group=group_of.get(k + 1),
                goals=() if stands[k] else ((float(goals[k, X]), float(goals[k, Y])),),
                velocity=(float(velocities[k, X]), float(velocities[k, Y])),
                breadth=breadth,
            )
            for k, (x, y) in enumerate(positions.tolist())
        ),
        robot=Robot(Pose(x0 + 1.0, y0 + 1.0)),
        goal=Goal(x1 - 1.0, y1 - 1.0),
        groups=tuple(Group(number, "walking", tuple(humans)) for number, humans in members.items()),
        rules=Rules(dt=dt),
        seed=seed,
    )


# The same function with the pedestrian models of the literature.
moussaid2009 = partial(simulate, model="moussaid2009")
helbing1995 = partial(simulate, model="helbing1995")
helbing2000 = partial(simulate, model="helbing2000")
farina2017 = partial(simulate, model="farina2017")
orca2011 = partial(simulate, model="orca2011")
