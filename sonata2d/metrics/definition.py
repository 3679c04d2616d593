"""The definition of a metric: one number of an episode, with its unit, formula, source and the data that it needs."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Literal, get_args

from ..core.scene import Unmeasured
from ..record.record import EpisodeRecord
from ..registry import did_you_mean
from .trajectory import Trajectory

DEFINITIONS_VERSION = 3  # of all metrics together; raised when a formula changes
OURS = "sonata2d"  # source of a formula that is not published elsewhere

Better = Literal["more", "less", "neither"]
ARROWS: dict[Better, str] = {"more": "↑", "less": "↓", "neither": " "}
Function = Callable[[Trajectory], float | None]

Need = Literal[
    Unmeasured,
    "goal.distance", "goal.theta", "goal.angle", "robot.radius", "robot.limits", "humans.radius",
    "humans.desired_speed", "humans.group", "walls", "objects", "frames.interactions", "frames.command",
    "frames.guarded", "frames.contacts", "frames.events",
]  # fmt: skip
"""Data that an imported episode may lack: a name of `Scene.unmeasured`, or a key of the episode file."""

NEEDS: tuple[Need, ...] = get_args(Need)
GOAL: tuple[Need, ...] = ("robot", "goal", "goal.distance")  # of whether and when the robot reaches the goal
BODIES: tuple[Need, ...] = ("robot", "robot.radius", "humans.radius")  # of clearances to people
OBSTACLES: tuple[Need, ...] = ("robot", "robot.radius", "walls", "objects")  # of clearances to walls and furniture


@dataclass(frozen=True, slots=True)
class Metric:
    """One number of an episode.

    Most metrics are made from a function by the decorator `metric`, which takes the formula from the docstring.

    Attributes:
        name: in files and tables; the variant of another project starts with the project, as in
            `hunavsim.stalled_time`.
        unit: an SI unit, `share` (a fraction, 0 to 1), `count` or `0/1`.
        better: `more`, `less` or `neither`: what a controller should achieve.
        formula: in words and symbols, as printed in docs/metrics.md.
        source: the paper or program that defines it; `sonata2d` for definitions of this package.
        function: computes the value; returns None where the metric is not defined, e.g. a distance to humans in an
            episode without humans.
        headline: whether the short table and the picture show it.
        variant_of: name of the metric of this package to compare a variant with.
        needs: data without which the value means nothing, from `NEEDS`; the metric is not computed for an imported
            episode that lacks one of them. `seed` stands for `Trajectory.undisturbed`: the seed is run again.

    Raises:
        ValueError: `better` or a name in `needs` is unknown.

    >>> Metric("duration", "s", "less", "t_end - t_0", "mine", lambda trajectory: trajectory.total_time, needs=()).unit
    's'
    """

    name: str
    unit: str
    better: Better
    formula: str
    source: str
    function: Function = field(repr=False)
    headline: bool = False
    variant_of: str | None = None
    needs: Collection[Need] = field(kw_only=True)

    def __post_init__(self) -> None:
        if self.better not in ARROWS:
            raise ValueError(f"metric {self.name!r}: better is {self.better!r}; use {', '.join(ARROWS)}")
        needs = {self.needs} if isinstance(self.needs, str) else set(self.needs)
        if unknown := sorted(needs - set(NEEDS)):
            hint = did_you_mean(unknown[0], NEEDS) or f"; use {', '.join(NEEDS)}"
            raise ValueError(f"metric {self.name!r}: needs has the unknown name {unknown[0]!r}{hint}")
        object.__setattr__(self, "needs", frozenset(needs))

    def of(self, trajectory: Trajectory) -> float | None:
        """Compute the value for one episode, rounded to 1e-6; None where the metric is not defined or not finite."""
        value = self.function(trajectory)
        return None if value is None or not math.isfinite(value) else round(float(value), 6) + 0.0


def metric(
    unit: str,
    better: Better,
    *,
    needs: Collection[Need],
    headline: bool = False,
    name: str | None = None,
    variant_of: str | None = None,
) -> Callable[[Function], Metric]:
    """Decorator that makes a metric of a function.

    The docstring of the function is the formula, with the cases in which the metric is not defined. A last paragraph
    `Source: ...` names the paper or program that defines it; without one it is a definition of this package.

    Args:
        unit, better, needs, headline, variant_of: as for `Metric`.
        name: by default the name of the function.

    >>> @metric("s", "less", needs={"robot"})
    ... def duration(trajectory):
    ...     \"\"\"t_end - t_0.\"\"\"
    ...     return trajectory.total_time
    >>> duration.name, duration.formula
    ('duration', 't_end - t_0')
    """

    def decorate(function: Function) -> Metric:
        text = " ".join((inspect.getdoc(function) or "").split())  # empty under `python -OO`
        formula, _, source = text.partition(" Source: ")
        return Metric(
            name or function.__name__, unit, better, formula.removesuffix("."), source.removesuffix(".") or OURS,
            function, headline, variant_of, needs=needs,
        )  # fmt: skip

    return decorate


def missing_data(record: EpisodeRecord) -> frozenset[str]:
    """The names in `NEEDS` of the data that the source of an imported episode lacks; empty for other episodes."""
    lacks = (record.document.get("imported") or {}).get("lacks", ())
    return (record.scene().unmeasured | set(lacks)) & set(NEEDS)
