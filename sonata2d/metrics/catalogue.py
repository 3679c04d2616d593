"""All metrics by name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from ..errors import MetricError
from . import disturbance, meetings, outcomes, space, ways
from .definition import Metric
from .variants import VARIANTS

FAMILIES: dict[str, tuple[Metric, ...]] = {
    "Arriving and touching": outcomes.METRICS,
    "The way and the motion": ways.METRICS,
    "Room left to people and things": space.METRICS,
    "Meetings": meetings.METRICS,
    "What it cost the people": disturbance.METRICS,
}
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
    near = difflib.get_close_matches(name, ALL, 1)
    hint = f"did you mean {near[0]!r}?" if near else "docs/metrics.md lists them"
    raise MetricError(f"no metric is named {name!r}; {hint}")
