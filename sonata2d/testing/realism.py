"""The pedestrians as one function, for checks that compare simulated trajectories with recorded ones."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..agents.pedestrians.crowd import Crowd
from ..core.entities import DEFAULT_MODEL, PERSON_RADIUS, Goal, Group, Human, Robot, Wall
from ..core.geometry import Barriers, Pose, Twist, segment_distances
from ..core.portable_math import Array, BoolArray, IntArray
from ..core.scene import Rules, Scene
from ..core.vectors import X, Y, lengths
from ..sim.world import World

MARGIN = 30.0  # m, from all positions to the outline of the room, which has no influence at this distance
LOOKAHEAD = 1.0  # m, added to the distance that can be walked, within which walls can block the straight path
WALL_CLEARANCE = 0.02  # m; a path nearer to a wall than this is blocked
STANDING_DISTANCE = 1e-6  # m; a pedestrian nearer to its goal than this stands


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
) -> Array:
    """Simulate pedestrians from a given state, without a robot near them.

    A goal gives a direction: it often lies far beyond the distance that can be walked in the time, and it can lie
    behind a wall that no pedestrian reaches. Pedestrians therefore walk straight ahead if nothing blocks the part of
    the straight path that they can walk; only the others search for a path round the walls.

    Args:
        initial_positions, initial_velocities: (N, 2), m and m/s.
        goals: (N, 2), m; a pedestrian that is at its goal stands.
        desired_speeds: (N,), m/s.
        obstacles: (M, 4), walls as x1, y1, x2, y2, m.
        dt: time between returned positions, s.
        steps: number of returned positions.
        groups: (N,) of int; pedestrians with the same number above 0 walk together. None: no groups.
        model: name of the pedestrian model.
        radius: of all pedestrians, m.

    Returns:
        Positions (steps, N, 2), m; the first ones are dt after the start.
    """
    goals = reachable_goals(initial_positions, goals, desired_speeds * (dt * steps) + LOOKAHEAD, obstacles)
    scene = scene_from_state(
        initial_positions, initial_velocities, goals, desired_speeds, obstacles, groups,
        dt=dt, model=model, radius=radius,
    )  # fmt: skip
    world, crowd = World(scene), Crowd(scene)
    positions = np.empty((steps, len(initial_positions), 2))
    for step in range(steps):
        world.step(Twist(), crowd.act(world.snapshot()))
        positions[step] = world.snapshot().humans.position
    return positions


def reachable_goals(positions: Array, goals: Array, max_distance: Array, obstacles: Array) -> Array:
    """Goals moved to the distance that can be walked, unless a wall blocks the straight path to there.

    Args:
        positions, goals: (N, 2), m.
        max_distance: (N,), m.
        obstacles: (M, 4), walls as x1, y1, x2, y2, m.

    Returns:
        (N, 2), m.
    """
    offset = goals - positions
    distance = np.maximum(lengths(offset), 1e-9)
    nearer = positions + offset * (np.minimum(max_distance, distance) / distance)[:, None]
    walls = Barriers.of(((a, b), (c, d), 0.0) for a, b, c, d in obstacles.tolist())
    gaps = segment_distances(positions, nearer, walls).min(axis=0, initial=np.inf)
    is_clear: BoolArray = gaps > WALL_CLEARANCE
    return np.where(is_clear[:, None], nearer, goals)


def scene_from_state(
    positions: Array, velocities: Array, goals: Array, speeds: Array, obstacles: Array, groups: IntArray | None,
    *, dt: float, model: str, radius: float,
) -> Scene:  # fmt: skip
    """A scene of pedestrians in a given state, each with a goal, and a robot far away that they ignore.

    Args:
        positions, velocities, goals: (N, 2), m and m/s.
        speeds: (N,), desired speeds, m/s.
        obstacles, groups, dt, model, radius: as for `simulate`.
    """
    offset = goals - positions
    stands = lengths(offset) < STANDING_DISTANCE
    numbers = np.zeros(len(positions), dtype=int) if groups is None else np.where(stands, 0, np.asarray(groups))
    members: dict[int, list[int]] = {}
    for k, number in enumerate(numbers.tolist()):
        if number > 0:
            members.setdefault(number, []).append(k + 1)
    members = {number: humans for number, humans in members.items() if len(humans) > 1}
    group_of = {human: number for number, humans in members.items() for human in humans}
    points = np.concatenate((positions, goals, obstacles.reshape(-1, 2)))
    (x0, y0), (x1, y1) = (points.min(axis=0) - MARGIN).tolist(), (points.max(axis=0) + MARGIN).tolist()
    return Scene(
        name="recorded",
        family="recorded/given",
        polygon=((x0, y0), (x1, y0), (x1, y1), (x0, y1)),
        walls=tuple(Wall((a, b), (c, d)) for a, b, c, d in obstacles.tolist()),
        furniture=(),
        humans=tuple(
            Human(
                id=k + 1,
                pose=Pose(x, y, float(np.arctan2(offset[k, Y], offset[k, X]))),
                radius=radius,
                desired_speed=float(speeds[k]),
                behaviour="standing" if stands[k] else "walking",
                model=model,
                reacts_to_robot=0.0,
                group=group_of.get(k + 1),
                goals=() if stands[k] else ((float(goals[k, X]), float(goals[k, Y])),),
                velocity=(float(velocities[k, X]), float(velocities[k, Y])),
            )
            for k, (x, y) in enumerate(positions.tolist())
        ),
        robot=Robot(Pose(x0 + 1.0, y0 + 1.0)),
        goal=Goal(x1 - 1.0, y1 - 1.0),
        groups=tuple(Group(number, "walking", tuple(humans)) for number, humans in members.items()),
        rules=Rules(dt=dt),
    )


# The same function with the pedestrian models of the literature.
moussaid2009 = partial(simulate, model="moussaid2009")
helbing1995 = partial(simulate, model="helbing1995")
helbing2000 = partial(simulate, model="helbing2000")
farina2017 = partial(simulate, model="farina2017")
orca2011 = partial(simulate, model="orca2011")
