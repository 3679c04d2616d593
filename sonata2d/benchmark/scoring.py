"""Scores: values of each scene, and summaries in the groups task, safety and people."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..metrics.catalogue import METRICS
from ..metrics.disturbance import without_robot
from ..metrics.situations import judge
from ..metrics.summary import bootstrap_interval, wilson_interval
from ..metrics.trajectory import Trajectory
from ..record.record import EpisodeRecord

Group = Literal["task", "safety", "people"]
Values = Mapping[str, float | None]
FRONT = ("stl", "safe", "polite")
"""A score of each group, in which the Pareto front is taken; failed scenes count as 0 in all of them."""

_POLITE_PSC, _MOST_INTRUSION = 0.8, 0.05
_FAR = 10.0  # s, to which times to collision are cut, so that scenes without an approach count
_METRICS = {
    "success": "success",
    "spl": "spl",
    "stl": "stl",
    "time_to_collision": "time_to_collision_min",
    "psc": "personal_space_compliance_0.45",
    "group_intrusion": "group_intrusion",
    "interaction_intrusion": "interaction_intrusion",
    "human_slowing": "human_slowing",
    "human_deviation": "human_deviation_mean",
}


@dataclass(frozen=True, slots=True)
class Score:
    """A number of a row.

    Attributes:
        group: that it belongs to.
        kind: of the number: share of scenes with Wilson interval, mean with bootstrap interval, or 5th percentile.
        better: direction.
        unit: SI unit, or `share`.
        meaning: in words.
    """

    group: Group
    kind: Literal["share", "mean", "low"]
    better: Literal["more", "less"]
    unit: str
    meaning: str


SCORES: dict[str, Score] = {
    "success": Score("task", "share", "more", "share", "the goal is reached within the limit of the scene"),
    "stl": Score("task", "mean", "more", "share", "success weighted by time; 0 for failed scenes"),
    "spl": Score("task", "mean", "more", "share", "success weighted by path length; 0 for failed scenes"),
    "time_ratio": Score("task", "mean", "less", "", "time, or the limit if it failed, over that of the shortest path"),
    "safe": Score("safety", "share", "more", "share", "the goal is reached without a contact by the robot's fault"),
    "contact_at_fault": Score("safety", "share", "less", "share", "a contact with a person by the robot's own motion"),
    "contact": Score("safety", "share", "less", "share", "any contact"),
    "obstacle_contact": Score("safety", "share", "less", "share", "a contact with walls, doors or furniture"),
    "time_to_collision": Score("safety", "low", "more", "s", "least time to collision, cut at 10 s; 5th percentile"),
    "polite": Score("people", "share", "more", "share", "the goal is reached, psc ≥ 0.8, interaction_intrusion ≤ 0.05"),
    "psc": Score("people", "mean", "more", "share", "share of the time at more than 0.45 m from all people"),
    "group_intrusion": Score("people", "mean", "less", "share", "share of the time within a talking group"),
    "interaction_intrusion": Score("people", "mean", "less", "share", "share of the time within an interaction"),
    "human_slowing": Score("people", "mean", "less", "m/s", "people are slower than without a robot"),
    "human_deviation": Score("people", "mean", "less", "m", "distance of people from where they are without a robot"),
}


def values_of(record: EpisodeRecord, situation: str | None) -> dict[str, float | None]:
    """The values of a scene; None where one is not defined.

    Args:
        record: of the episode.
        situation: that the scene is to show.
    """
    record = record.until_arrival()
    trajectory = Trajectory(record, without_robot(record))
    values = {name: METRICS[metric].of(trajectory) for name, metric in _METRICS.items()}
    collisions = trajectory.collisions
    with_people = [collision for collision in collisions if collision.kind == "human"]
    values["contact_at_fault"] = float(any(collision.robot_at_fault for collision in with_people))
    values["contact"] = float(bool(collisions))
    values["obstacle_contact"] = float(len(with_people) < len(collisions))
    values["time_to_collision"] = min(_or(values["time_to_collision"], _FAR), _FAR)
    for name in ("spl", "stl"):
        if values[name] is None:  # no path is known
            values[name] = values["success"]
    values["time_ratio"] = _time_ratio(trajectory, values["success"] == 1.0)
    values |= judged(values)
    if situation is not None:
        values["took_place"] = float(judge(situation, record).took_place)
    return values


def judged(values: Values) -> dict[str, float | None]:
    """Whether a scene is solved safely, politely, and both: 1 or 0. A scene whose goal is not reached is neither.

    Args:
        values: of the scene.
    """
    is_solved = values["success"] == 1.0
    is_safe = is_solved and values["contact_at_fault"] == 0.0 and values["obstacle_contact"] == 0.0
    is_near = _or(values["psc"], 1.0) < _POLITE_PSC
    intrudes = _or(values["interaction_intrusion"], 0.0) > _MOST_INTRUSION
    is_polite = is_solved and not is_near and not intrudes
    return {"safe": float(is_safe), "polite": float(is_polite), "strict": float(is_safe and is_polite)}


def _time_ratio(trajectory: Trajectory, has_arrived: bool) -> float | None:
    """Time of the robot, or the limit of a failed scene, over the time of the shortest path at top speed."""
    scene = trajectory.scene
    shortest = trajectory.shortest_path
    if not shortest or not math.isfinite(shortest) or scene.goal.moves:
        return None
    taken = float(trajectory.time[-1] - trajectory.time[0]) if has_arrived else scene.rules.time_limit
    return round(taken * scene.robot.top_speed / shortest, 6)


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


def third_of(difficulty: float | None, thirds: tuple[float, float]) -> int | None:
    """0, 1 or 2 of the easiest, middle and hardest third of a part; None where difficulty is not defined."""
    return None if difficulty is None else int(difficulty >= thirds[0]) + int(difficulty >= thirds[1])


def summary(values: Sequence[Values], thirds: Sequence[int | None]) -> dict[str, Any]:
    """The scores of some scenes, as rows hold them.

    Args:
        values: of each scene.
        thirds: of each scene, see `third_of`.
    """
    groups: dict[str, dict[str, Any]] = {"task": {}, "safety": {}, "people": {}}
    for name, score in SCORES.items():
        groups[score.group][name] = _summarised([each[name] for each in values], score.kind)
    known = {*SCORES, "strict"}
    advisory = list(dict.fromkeys(name for each in values for name in each if name not in known))
    by_third = [[each["strict"] for each, t in zip(values, thirds, strict=True) if t == third] for third in range(3)]
    return {
        "scenes": len(values),
        "strict": _summarised([each["strict"] for each in values], "share"),
        **groups,
        "strict_by_thirds": [_summarised(part, "share") for part in by_third],
        "advisory": {name: _summarised([each.get(name) for each in values], "mean") for name in advisory},
    }


def _summarised(values: Sequence[float | None], kind: str) -> Any:
    """Value, interval and number of scenes."""
    defined = [value for value in values if value is not None]
    if not defined:
        return {"value": None, "low": None, "high": None, "n": 0}
    numbers = np.array(defined)
    if kind == "share":
        count = round(sum(defined))
        value, interval = round(count / len(defined), 6), wilson_interval(count, len(defined))
        return {"value": value, "low": interval.low, "high": interval.high, "n": len(defined)}
    if kind == "low":
        value = sorted(defined)[max(math.ceil(0.05 * len(defined)) - 1, 0)]
        return {"value": round(value, 6), "low": None, "high": None, "n": len(defined)}
    value = round(math.fsum(defined) / len(defined), 6) + 0.0
    ends = bootstrap_interval(numbers)
    low, high = ends or (None, None)
    return {"value": value, "low": low, "high": high, "n": len(defined)}
