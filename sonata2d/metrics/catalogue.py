"""All metrics by name."""

from __future__ import annotations

from collections.abc import Iterable

from ..errors import MetricError
from ..registry import METRICS as PLUGINS
from ..registry import did_you_mean
from . import disturbance, interactions, outcomes, paths, space
from .definition import Metric
from .interop import VARIANTS

FAMILIES: dict[str, tuple[Metric, ...]] = {
    "Arriving and touching": outcomes.METRICS,
    "The way and the motion": paths.METRICS,
    "Room left to people and things": space.METRICS,
    "Meetings": interactions.METRICS,
    "What it cost the people": disturbance.METRICS,
}


def _problem(found: object) -> str | None:
    """Why an object cannot be used as a metric."""
    return None if isinstance(found, Metric) else "is no Metric; it must be sonata2d.metrics.Metric(...)"


if PLUGINS.plugins:
    FAMILIES["Plug-ins"] = tuple(PLUGINS.load_all(_problem).values())
METRICS: dict[str, Metric] = {metric.name: metric for family in FAMILIES.values() for metric in family}
ALL: dict[str, Metric] = METRICS | {metric.name: metric for metric in VARIANTS}


def named(names: Iterable[str]) -> tuple[Metric, ...]:
    """The metrics of these names; `hunavsim` alone stands for all of its variants, `all` for all there is.

    Raises:
        MetricError: there is none of a name.
    """
    return tuple(dict.fromkeys(metric for name in names for metric in _of(name)))


def headline() -> tuple[Metric, ...]:
    """Those that short tables and the picture show."""
    return tuple(metric for metric in METRICS.values() if metric.headline)


def _of(name: str) -> tuple[Metric, ...]:
    if name == "all":
        return tuple(METRICS.values())
    found = tuple(metric for metric in ALL.values() if metric.name == name or metric.name.startswith(f"{name}."))
    if found:
        return found
    raise MetricError(f"no metric is named {name!r}{did_you_mean(name, ALL) or '; docs/metrics.md lists them'}")
