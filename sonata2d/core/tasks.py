"""Tasks of a robot whose goal is not one fixed pose: places in order, and people to meet, follow, lead or wait for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from .entities import ANY_HEADING, Goal, Human
from .geometry import Point, quantised
from .humans import BODY_X, BODY_Y, X, Y
from .portable_math import Array
from .snapshot import Snapshot

_CELL = 0.25  # m; goals that move are on a grid of this size, so that planners do not plan anew in each tick
BESIDE = 0.9  # m, from the person to the goal of a robot that accompanies it
ARRIVED = 0.6  # m, within which a person has come to the end of its way


def next_stage(goal: Goal, stage: int, robot: Point) -> int:
    """The number of places that the robot has reached, of all but the last one.

    Args:
        goal: of the scene.
        stage: the number at the tick before.
        robot: its position, m.
    """
    places = (goal.position, *goal.then)
    while stage < len(goal.then) and _distance(places[stage], robot) <= goal.distance:
        stage += 1
    return stage


def set_present_goal(snapshot: Snapshot, stage: int) -> None:
    """Give a new snapshot the scene with the goal of its tick.

    Args:
        snapshot: of the scene as generated, whose goal moves; is changed.
        stage: see `next_stage`.
    """
    object.__setattr__(snapshot, "scene", snapshot.scene.with_goal(_present_goal(snapshot, stage)))


def is_done(snapshot: Snapshot) -> bool:
    """Whether the robot has done its task at a snapshot."""
    goal = snapshot.goal
    if goal.person is None:
        return not goal.then and goal.is_reached(snapshot.robot.pose)
    human, person = _person(snapshot, goal.person)
    if person is None:
        return False
    place = float(person[X]), float(person[Y])
    if _distance(place, snapshot.robot.position) > goal.near:
        return False
    if goal.task in ("lead", "wait"):
        return goal.is_reached(snapshot.robot.pose)
    if goal.task == "meet":
        return True
    return _distance(place, human.goals[-1]) <= ARRIVED


def _present_goal(snapshot: Snapshot, stage: int) -> Goal:
    """The goal at the tick of a snapshot; while the person is absent, the place of the robot, which so stays there."""
    scene, goal = snapshot.scene, snapshot.scene.goal
    if goal.then:
        x, y = (goal.position, *goal.then)[stage]
        left = goal.then[stage:]
        return replace(goal, x=x, y=y, then=left, angle=ANY_HEADING if left else goal.angle)
    assert goal.person is not None
    _, person = _person(snapshot, goal.person)
    if person is None:
        x, y = map(_on_grid, snapshot.robot.position)
        return replace(goal, x=x, y=y)
    x, y = quantised(float(person[X])), quantised(float(person[Y]))
    if goal.task != "accompany":
        return replace(goal, x=_on_grid(x), y=_on_grid(y))
    robot, aside = snapshot.robot.position, (-float(person[BODY_Y]) * BESIDE, float(person[BODY_X]) * BESIDE)
    places = [(x + sign * aside[0], y + sign * aside[1]) for sign in (1.0, -1.0)]
    is_free = scene.is_on_floor(np.array(places))
    places = [place for place, free in zip(places, is_free.tolist(), strict=True) if free] or [(x, y)]
    best = min(places, key=lambda place: _distance(place, robot))
    return replace(goal, x=_on_grid(best[0]), y=_on_grid(best[1]))


def _person(snapshot: Snapshot, id: int) -> tuple[Human, Array | None]:
    """A person of the scene, and its row of `State.humans`; None: it is absent."""
    scene, state = snapshot.scene, snapshot.state
    k = scene.human_table.row[id]
    return scene.humans[k], state.humans[k] if state.is_present is None or state.is_present[k] else None


def _on_grid(value: float) -> float:
    return quantised(round(quantised(value) / _CELL) * _CELL)


def _distance(a: Point, b: Point) -> float:
    dx, dy = quantised(a[0]) - quantised(b[0]), quantised(a[1]) - quantised(b[1])
    return math.sqrt(dx * dx + dy * dy)
