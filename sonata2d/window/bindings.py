"""Which control does what, and how that is changed: profiles to profiles, without a pixel."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from ..agents.controllers.teleoperation import Axis
from .actions import Action, in_words
from .hands import Move
from .profiles import Profile

DELIBERATE = 0.6  # so far a control is moved to be bound
_MODIFIERS = frozenset(f"{side} {key}" for side in ("left", "right") for key in ("ctrl", "shift", "alt", "meta"))
_FIXED = frozenset({"escape", "f12", "caps lock", "numlock", ""}) | _MODIFIERS  # keys that cannot be bound
_ENDS = {"left_x": ("left", "right"), "right_x": ("left", "right"), "drag_x": ("left", "right"),
         "left_y": ("up", "down"), "right_y": ("up", "down"), "drag_y": ("up", "down")}  # fmt: skip
_OWNERS = {"left": "left stick", "right": "right stick", "drag": "drag"}


class Direction(NamedTuple):
    """A way to drive: an axis of the robot, and which way along it, 1 or -1."""

    axis: Axis
    way: float
    meaning: str


Target = Direction | Action

DIRECTIONS = (
    Direction("ahead", 1.0, "ahead"),
    Direction("ahead", -1.0, "back"),
    Direction("turn", 1.0, "turn left"),
    Direction("turn", -1.0, "turn right"),
    Direction("left", 1.0, "sideways left"),
    Direction("left", -1.0, "sideways right"),
    Direction("brake", 1.0, "brake"),
)


def bound(profile: Profile, target: Target, move: Move) -> Profile:
    """The profile in which a control, moved this way, does this and nothing else.

    A key or button joins those that did it before; a stick takes the place of another stick.
    """
    way = 1.0 if move.value > 0 else -1.0
    if isinstance(target, Direction):
        free = _without(profile, (move.control, f"-{move.control}"))
        kept = free.hand.controls
        if has_two_ends(move.control):
            kept = {c: b for c, b in kept.items() if b[0] != target.axis or not has_two_ends(c)}
        return replace(free, hand=replace(free.hand, controls={**kept, move.control: (target.axis, target.way * way)}))
    control = move.control if way > 0 else f"-{move.control}"
    free = _without(profile, (move.control, control), actions=(control,))
    return replace(free, actions={**free.actions, control: target})


def cleared(profile: Profile, target: Target) -> Profile:
    """The profile in which nothing does this. A stick that did it does its opposite no more either."""
    if isinstance(target, Direction):
        return _without(
            profile, [control for control, bind in profile.hand.controls.items() if _does(control, bind, target)]
        )
    return replace(
        profile, actions={control: action for control, action in profile.actions.items() if action != target}
    )


def inverted(profile: Profile, axis: Axis) -> Profile:
    """The profile in which whatever moves the robot along an axis does so the other way round."""
    controls = {c: (to, -share if to == axis else share) for c, (to, share) in profile.hand.controls.items()}
    return replace(profile, hand=replace(profile.hand, controls=controls))


def in_short(profile: Profile, target: Target, *, named: bool) -> str:
    """The controls that do it, in words, for a device whose controls have names or are numbered."""
    if isinstance(target, Direction):
        ways = {c: target.way * share for c, (_, share) in profile.hand.controls.items()}
        does = [
            _told(c, ways[c]) for c, bind in profile.hand.controls.items() if _does(c, bind, target) and _fits(c, named)
        ]
    else:
        does = [
            in_words(c) for c, action in profile.actions.items() if action == target and _fits(c.lstrip("-"), named)
        ]
    return ", ".join(does)


def is_bindable(move: Move) -> bool:
    """Whether a move is meant to choose its control: far enough, and no key that is taken."""
    return abs(move.value) >= DELIBERATE and move.control not in _FIXED


def has_two_ends(control: str) -> bool:
    """Whether it goes both ways from its rest, as a stick does and a button does not."""
    return control in _ENDS or (is_numbered(control) and not control.startswith("button"))


def is_numbered(control: str) -> bool:
    """Whether it is a control of a device that SDL has no names for: `axis0`, `button3`, `hat0_x`."""
    return control[:-1].startswith(("axis", "button", "hat")) and control.rstrip("_xy")[-1:].isdigit()


def _without(profile: Profile, driving: Iterable[str], actions: Iterable[str] | None = None) -> Profile:
    """The profile in which these controls do nothing; if actions are given, only those ask for nothing."""
    gone = set(driving)
    mute = gone if actions is None else set(actions)
    controls = {c: bind for c, bind in profile.hand.controls.items() if c not in gone}
    asking = {c: action for c, action in profile.actions.items() if c not in mute}
    return Profile(replace(profile.hand, controls=controls), asking)


def _does(control: str, bind: tuple[Axis, float], target: Direction) -> bool:
    axis, share = bind
    return axis == target.axis and (has_two_ends(control) or share * target.way > 0)


def _fits(control: str, named: bool) -> bool:
    return is_numbered(control) is not named


def _told(control: str, way: float) -> str:
    """A control that drives, and to which end: `left stick up`."""
    if control in _ENDS:
        return f"{_OWNERS[control[:-2]]} {_ENDS[control][way > 0]}"
    if has_two_ends(control):
        return in_words(control if way > 0 else f"-{control}") + (" plus" if way > 0 and "hat" not in control else "")
    return in_words(control)
