"""What cannot be measured of an imported run: whatever rests on what its source did not tell."""

from __future__ import annotations

from ..record.record import EpisodeRecord
from .definition import Metric

_GOAL = ("success", "timeout", "time_to_goal", "spl", "stl", "shortest_length")
_TOUCH = ("collisions", "human_collisions", "robot_on_person", "person_on_robot", "both_on_each_other")
_NEAR = ("human_clearance", "personal_space", "zone", "time_to_collision")

# A key of `imported.lacks`: how the names of the metrics begin that rest on it.
RESTS_ON: dict[str, tuple[str, ...]] = {
    "robot": ("",),  # all of them
    "goal": _GOAL,
    "goal.distance": _GOAL,
    "outcome": ("timeout",),
    "robot.limits": ("stl",),
    "robot.radius": (
        *_TOUCH, *_NEAR, "success_strict", "object_collisions", "wall_collisions", "time_to_first_collision",
        "obstacle_clearance", "shortest_length", "spl", "stl", "group_intrusion", "interaction_intrusion",
    ),
    "humans.radius": (*_TOUCH, *_NEAR, "success_strict", "time_to_first_collision", "group_intrusion"),
    "humans.desired_speed": ("human_speed_ratio",),
    "humans.group": ("group_intrusion",),
    "frames.interactions": ("interaction_intrusion",),
}  # fmt: skip


def is_measurable(metric: Metric, record: EpisodeRecord) -> bool:
    """Whether a run tells all that a metric rests on; a variant rests on what the metric does that it varies."""
    lacks = (record.document.get("imported") or {}).get("lacks", ())
    names = (metric.name, metric.variant_of or metric.name)
    return not any(name.startswith(RESTS_ON.get(key, ())) for key in lacks for name in names)
