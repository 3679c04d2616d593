"""All metrics by name: built-in ones, plug-ins, and the variants of other projects."""

from __future__ import annotations

import warnings
from collections.abc import Container, Iterable, Iterator

from ..errors import MetricError, PluginWarning
from ..registry import METRICS as PLUGINS, did_you_mean
from . import areas, disturbance, driving, fleet, interactions, outcomes, paths, space
from .definition import Metric
from .interop import VARIANTS

FAMILIES: dict[str, tuple[Metric, ...]] = {
    "Success, collisions and time": outcomes.METRICS,
    "Path and motion": paths.METRICS,
    "Distance to people and obstacles": space.METRICS,
    "Interactions": interactions.METRICS,
    "Areas with rules": areas.METRICS,
    "Effect on people": disturbance.METRICS,
    "Several robots": fleet.METRICS,
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
NEEDING_RERUN = frozenset(name for name, metric in ALL.items() if "seed" in metric.needs)


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


def metric_named(name: str) -> Metric:
    """The metric of a name.

    Raises:
        MetricError: no metric has this name.
    """
    if name not in ALL:
        projects = {metric.name.partition(".")[0] for metric in VARIANTS}
        known = [*ALL, *sorted(projects), "all"]
        hint = did_you_mean(name, known) or "; docs/metrics.md lists them; a plug-in's package must be installed"
        raise MetricError(f"no metric is named {name!r}{hint}")
    return ALL[name]


def _select(name: str) -> tuple[Metric, ...]:
    if name == "all":
        return tuple(METRICS.values())
    variants = tuple(metric for metric in ALL.values() if metric.name.startswith(f"{name}."))
    return variants or (metric_named(name),)
