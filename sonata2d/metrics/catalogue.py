"""All metrics by name, and which of them an imported episode lacks the data for."""

from __future__ import annotations

import warnings
from collections.abc import Container, Iterable, Iterator

from ..errors import MetricError, PluginWarning
from ..record.record import EpisodeRecord
from ..registry import METRICS as PLUGINS, did_you_mean
from . import disturbance, driving, interactions, outcomes, paths, space
from .definition import Metric
from .interop import VARIANTS

FAMILIES: dict[str, tuple[Metric, ...]] = {
    "Success, collisions and time": outcomes.METRICS,
    "Path and motion": paths.METRICS,
    "Distance to people and obstacles": space.METRICS,
    "Interactions": interactions.METRICS,
    "Effect on people": disturbance.METRICS,
    "Delay of the driver": driving.METRICS,
}


def plugin_problem(plugin: object) -> str | None:
    """The reason why an object cannot be used as a metric, or None."""
    return None if isinstance(plugin, Metric) else "is not a Metric; it must be a sonata2d.metrics.Metric(...)"


def _plugin_metrics(taken: Container[str]) -> Iterator[Metric]:
    """The metrics of plug-ins; one whose name is taken, or differs from its entry point, is skipped with a warning."""
    for name, metric in PLUGINS.load_all(plugin_problem).items():
        if metric.name != name:
            problem = f"its metric is named {metric.name!r}; give the entry point the same name"
        elif name in taken:
            problem = "the name is taken; rename the metric"
        else:
            yield metric
            continue
        warnings.warn(f"metric plug-in {name!r} is skipped: {problem}", PluginWarning, stacklevel=2)


if PLUGINS.plugins:
    _built_in = {metric.name for family in (*FAMILIES.values(), VARIANTS) for metric in family}
    FAMILIES["Plug-ins"] = tuple(_plugin_metrics({"all", *_built_in}))
METRICS: dict[str, Metric] = {metric.name: metric for family in FAMILIES.values() for metric in family}
ALL: dict[str, Metric] = METRICS | {metric.name: metric for metric in VARIANTS}  # with other projects' variants


def select_metrics(names: Iterable[str]) -> tuple[Metric, ...]:
    """Metrics by name, without duplicates.

    Args:
        names: names of metrics; the name of a project, e.g. `hunavsim`, selects all its variants, and `all` selects
            every metric except variants.

    Raises:
        MetricError: a name is unknown.
    """
    return tuple(dict.fromkeys(metric for name in names for metric in _select(name)))


def headline_metrics() -> tuple[Metric, ...]:
    """The metrics shown in the short table and in the picture."""
    return tuple(metric for metric in METRICS.values() if metric.headline)


def _select(name: str) -> tuple[Metric, ...]:
    if name == "all":
        return tuple(METRICS.values())
    found = tuple(metric for metric in ALL.values() if metric.name == name or metric.name.startswith(f"{name}."))
    if found:
        return found
    projects = {metric.name.partition(".")[0] for metric in VARIANTS}
    hint = did_you_mean(name, [*ALL, *sorted(projects), "all"]) or "; docs/metrics.md lists them"
    raise MetricError(f"no metric is named {name!r}{hint}")


_GOAL = ("success", "timeout", "time_to_goal", "spl", "stl", "shortest_length")
_COLLISION = ("collisions", "human_collisions", "robot_on_person", "person_on_robot", "both_on_each_other")
_CLEARANCE = ("human_clearance", "personal_space", "zone", "time_to_collision")

# Names of the metrics, or their first letters, that need each piece of data that `imported.lacks` of a file can name.
METRICS_REQUIRING: dict[str, tuple[str, ...]] = {
    "robot": ("",),  # all metrics
    "goal": _GOAL,
    "goal.distance": _GOAL,
    "outcome": ("timeout",),
    "robot.limits": ("stl",),
    "robot.radius": (
        *_COLLISION, *_CLEARANCE, "success_strict", "object_collisions", "wall_collisions", "time_to_first_collision",
        "obstacle_clearance", "shortest_length", "spl", "stl", "group_intrusion", "interaction_intrusion",
    ),
    "humans.radius": (*_COLLISION, *_CLEARANCE, "success_strict", "time_to_first_collision", "group_intrusion"),
    "humans.desired_speed": ("human_speed_ratio",),
    "humans.group": ("group_intrusion",),
    "frames.interactions": ("interaction_intrusion",),
}  # fmt: skip


def is_measurable(metric: Metric, record: EpisodeRecord) -> bool:
    """Whether an episode has the data that a metric needs; a variant needs what the metric of this package needs."""
    lacks = (record.document.get("imported") or {}).get("lacks", ())
    names = (metric.name, metric.variant_of or metric.name)
    return not any(name.startswith(METRICS_REQUIRING.get(key, ())) for key in lacks for name in names)
