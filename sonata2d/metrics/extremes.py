"""Which of many runs shows a controller at its best, and which at its worst: by rule, so that anyone picks the same."""

from __future__ import annotations

from collections.abc import Sequence

from ..proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from .measure import Measured

COMPLIANCE = f"personal_space_compliance_{INTIMATE_DISTANCE:.2f}"

BEST_RULE = (
    f"Best: the goal was reached; nothing was touched; nobody was nearer than {INTIMATE_DISTANCE:g} m, and no group or"
    f" interaction was cut; but somebody was met, nearer than {PERSONAL_DISTANCE:g} m. Of these runs the one with the"
    " highest SPL (to 0.01), and of equals the closest meeting. Where no run does all that, one that does the most from"
    " the start of the list."
)
WORST_RULE = (
    "Worst: the run with the most touches of people by the robot's fault; without any, one that did not reach the goal;"
    " then one that touched a wall or furniture; then the lowest personal-space compliance; then the lowest SPL."
)


def best_of(runs: Sequence[Measured]) -> Measured:
    """The run that `BEST_RULE` tells; the first of equals."""
    return max(runs, key=_goodness)


def worst_of(runs: Sequence[Measured]) -> Measured:
    """The run that `WORST_RULE` tells; the first of equals."""
    return max(runs, key=_badness)


def why_best(run: Measured) -> str:
    """What made it the best, or what even the best lacks."""
    reached, untouched, kept, met, *_ = _goodness(run)
    if not reached:
        return "no run reached the goal; this one is the nearest to it by the rule"
    lacks = [
        text
        for is_so, text in (
            (untouched, "something was touched"),
            (kept, "somebody's space was intruded upon"),
            (met, f"nobody was met within {PERSONAL_DISTANCE:g} m"),
        )
        if not is_so
    ]
    if lacks:
        return f"goal reached, though {' and '.join(lacks)}: no run did better; SPL {_value(run, 'spl'):.2f}"
    return f"goal reached past people, nothing touched, nobody's space intruded upon; SPL {_value(run, 'spl'):.2f}"


def why_worst(run: Measured) -> str:
    """What made it the worst."""
    touches, missed, things, intruded, _ = _badness(run)
    if touches:
        return f"touched people by its own fault: {touches:.0f} time{'s' if touches > 1 else ''}"
    if missed:
        return "did not reach the goal"
    if things:
        return f"touched walls or furniture: {things:.0f} time{'s' if things > 1 else ''}"
    if intruded:
        return f"nearer than {INTIMATE_DISTANCE:g} m to somebody in {100.0 * intruded:.0f} % of its looks"
    return f"the lowest SPL, {_value(run, 'spl'):.2f}; it reached the goal, touched nothing and kept its distance"


def _goodness(run: Measured) -> tuple[bool, bool, bool, bool, float, float]:
    """More is better, the first thing first."""
    nearest = _value(run, "human_clearance_min", PERSONAL_DISTANCE)
    between = _value(run, "group_intrusion") + _value(run, "interaction_intrusion")
    return (
        _value(run, "success") > 0.0,
        _value(run, "collisions") == 0.0,
        between == 0.0 and _value(run, COMPLIANCE, 1.0) == 1.0,
        nearest < PERSONAL_DISTANCE,
        round(_value(run, "spl"), 2),
        -nearest,
    )


def _badness(run: Measured) -> tuple[float, bool, float, float, float]:
    """More is worse, the first thing first."""
    return (
        _value(run, "robot_on_person"),
        _value(run, "success", 1.0) == 0.0,
        _value(run, "wall_collisions") + _value(run, "object_collisions"),
        1.0 - _value(run, COMPLIANCE, 1.0),
        -_value(run, "spl"),
    )


def _value(run: Measured, name: str, otherwise: float = 0.0) -> float:
    """A metric of a run; something else where it is not defined."""
    value = run.values.get(name)
    return otherwise if value is None else value
