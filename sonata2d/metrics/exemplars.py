"""The best and the worst episode of an evaluation, by criteria that the evaluation page states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..core.wording import counted
from .evaluation import Measured

COMPLIANCE = f"personal_space_compliance_{INTIMATE_DISTANCE:.2f}"


class Criterion(NamedTuple):
    """A sort key of episodes.

    Attributes:
        text: in the rule, as the page states it.
        key: the episode with the largest value comes first; the next criterion decides between equals.
        fault: says that the best episode misses the criterion, or that the worst episode is the worst by it; may
            contain `{count}` collisions and `{percent}` of the states, of the key. Empty: nothing is said.
    """

    text: str
    key: Callable[[Measured], float]
    fault: str = ""


def _value(episode: Measured, name: str, default: float = 0.0) -> float:
    """A metric of an episode; the default where it is not defined."""
    value = episode.values.get(name)
    return default if value is None else value


def _clearance(episode: Measured) -> float:
    return _value(episode, "human_clearance_min", PERSONAL_DISTANCE)


def _respects_space(episode: Measured) -> bool:
    intrusion = _value(episode, "group_intrusion") + _value(episode, "interaction_intrusion")
    return intrusion == 0.0 and _value(episode, COMPLIANCE, 1.0) == 1.0


BEST = (
    Criterion("the goal was reached", lambda e: _value(e, "success") > 0.0, "the goal was not reached"),
    Criterion("there was no collision", lambda e: _value(e, "collisions") == 0.0, "there was a collision"),
    Criterion(
        f"no person was nearer than {INTIMATE_DISTANCE:g} m and no group or interaction was intruded upon",
        _respects_space, "the personal space of a person was intruded upon",
    ),
    Criterion(
        f"a person was nearer than {PERSONAL_DISTANCE:g} m, so that the robot did pass people",
        lambda e: _clearance(e) < PERSONAL_DISTANCE, f"no person was within {PERSONAL_DISTANCE:g} m",
    ),
    Criterion("the highest SPL, to 0.01", lambda e: round(_value(e, "spl"), 2)),
    Criterion("the smallest clearance to a person", lambda e: -_clearance(e)),
)  # fmt: skip
WORST = (
    Criterion(
        "most collisions with people that the robot caused",
        lambda e: _value(e, "robot_on_person"), "the robot caused {count} with people",
    ),
    Criterion("goal not reached", lambda e: _value(e, "success", 1.0) == 0.0, "the goal was not reached"),
    Criterion(
        "most collisions with walls and furniture",
        lambda e: _value(e, "wall_collisions") + _value(e, "object_collisions"), "{count} with walls or furniture",
    ),
    Criterion(
        "lowest personal-space compliance", lambda e: 1.0 - _value(e, COMPLIANCE, 1.0),
        f"nearer than {INTIMATE_DISTANCE:g} m to a person in {{percent:.0f}} % of the states",
    ),
    Criterion("lowest SPL", lambda e: -_value(e, "spl")),
)  # fmt: skip


def best_of(episodes: Sequence[Measured]) -> Measured:
    """The best episode by the criteria of `BEST`; the first of equals."""
    return max(episodes, key=lambda episode: [criterion.key(episode) for criterion in BEST])


def worst_of(episodes: Sequence[Measured]) -> Measured:
    """The worst episode by the criteria of `WORST`; the first of equals."""
    return max(episodes, key=lambda episode: [criterion.key(episode) for criterion in WORST])


def why_best(episode: Measured) -> str:
    """Explain why `best_of` chose an episode, and which criteria even the best one misses."""
    missed = [criterion.fault for criterion in BEST if criterion.fault and not criterion.key(episode)]
    spl = f"SPL {_value(episode, 'spl'):.2f}"
    if not BEST[0].key(episode):
        return "no episode reached the goal; this one comes first by the other criteria"
    if missed:
        return f"goal reached, but {' and '.join(missed)}; no episode did better; {spl}"
    return f"goal reached past people, without collision or intrusion into personal space; {spl}"


def why_worst(episode: Measured) -> str:
    """Explain why `worst_of` chose an episode: the first criterion by which it has a fault."""
    for criterion in WORST:
        fault = criterion.key(episode)
        if criterion.fault and fault:
            return criterion.fault.format(count=counted(round(fault), "collision"), percent=100.0 * fault)
    return f"the lowest SPL, {_value(episode, 'spl'):.2f}; goal reached without collision or intrusion"
