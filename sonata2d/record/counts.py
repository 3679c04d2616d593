"""Counts of a run for a manifest: frames with contacts of its robots, and commands beyond their limits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import get_args

import numpy as np

from ..core.entities import Robot
from ..core.portable_math import Array
from ..core.snapshot import Contact, ContactKind
from .layout import COMMAND_NAMES, JsonDict

CONTACT_KINDS = get_args(ContactKind)
ANY_KIND = "any"
_LIMIT_TOLERANCE = 2e-4  # m/s, rad/s: recorded commands are rounded to 1e-4


def run_counts(robots: Sequence[Robot], contacts: Iterable[Iterable[Contact]], commands: Array) -> JsonDict:
    """Return the counts of one run: the keys `contacts` and `commands_beyond_limits` of its manifest row.

    Args:
        robots: R of them.
        contacts: of all robots, in each of the T + 1 states.
        commands: (R, T, 3), vx, vy (m/s), omega (rad/s), body frame.
    """
    return {"contacts": count_contacts(contacts), "commands_beyond_limits": commands_beyond_limits(robots, commands)}


def merged_counts(first: JsonDict, second: JsonDict) -> JsonDict:
    """The counts of a run by those of its two parts, see `run_counts`."""
    contacts: dict[str, dict[str, int]] = {}
    for kind in (ANY_KIND, *CONTACT_KINDS):
        parts = [part["contacts"][kind] for part in (first, second) if kind in part["contacts"]]
        if parts:
            contacts[kind] = {key: sum(part[key] for part in parts) for key in parts[0]}
    beyond: dict[str, dict[str, float]] = {}
    for name in COMMAND_NAMES:
        key = "commands_beyond_limits"
        excesses = [part[key][name] for part in (first, second) if name in part[key]]
        if excesses:
            worst = max(excesses, key=lambda excess: excess["command"] - excess["limit"])
            beyond[name] = worst | {"frames": sum(excess["frames"] for excess in excesses)}
    return {"contacts": contacts, "commands_beyond_limits": beyond}


def count_contacts(contacts: Iterable[Iterable[Contact]]) -> dict[str, dict[str, int]]:
    """Count the frames in which the robot, or one of several, is in contact.

    A frame counts as in contact if a contact is detected during its tick; the file states it in the next state, which
    is the final state for the last frame.

    Args:
        contacts: of each of the T + 1 states.

    Returns:
        By kind of contact (human, object, wall, door, robot, and any): number of frames, and number of frames in which
        the robot or the other side is at fault; both can be, or neither. Kinds without a contact are left out.
    """
    counts: dict[str, dict[str, int]] = {}
    for state in contacts:
        faults: dict[str, tuple[bool, bool]] = {}
        for contact in state:
            for kind in (ANY_KIND, contact.kind):
                robot, other = faults.get(kind, (False, False))
                faults[kind] = robot or contact.robot_at_fault, other or contact.other_at_fault
        for kind, (robot, other) in faults.items():
            count = counts.setdefault(kind, {"frames": 0, "robot_at_fault": 0, "other_at_fault": 0})
            count["frames"] += 1
            count["robot_at_fault"] += robot
            count["other_at_fault"] += other
    return {kind: counts[kind] for kind in (ANY_KIND, *CONTACT_KINDS) if kind in counts}


def commands_beyond_limits(robots: Sequence[Robot], commands: Array) -> dict[str, dict[str, float]]:
    """Count the frames in which a command exceeds the velocity limits of the robot's drive, which executes less then.

    Args:
        robots: R of them, with kinematics and limits; the sideways limit of a unicycle is 0.
        commands: (R, T, 3), columns vx (m/s), vy (m/s), omega (rad/s), body frame.

    Returns:
        By component (vx, vy, omega): number of frames, and the command that exceeds its limit most, with that limit;
        without signs, so that a mirror image has the same. Components that stay within their limits are left out.
    """
    bounds = [(each.limits, each.sideways_limit) for each in robots]
    lower = np.array([(-limits.back, -sideways, -limits.turn) for limits, sideways in bounds])[:, None]
    upper = np.array([(limits.ahead, sideways, limits.turn) for limits, sideways in bounds])[:, None]
    excess = np.maximum(commands - upper, lower - commands)
    excesses: dict[str, dict[str, float]] = {}
    for k in np.flatnonzero((excess > _LIMIT_TOLERANCE).any(axis=(0, 1))).tolist():
        robot, frame = divmod(int(np.argmax(excess[..., k])), excess.shape[1])
        value = float(commands[robot, frame, k])
        excesses[COMMAND_NAMES[k]] = {
            "frames": int(np.count_nonzero((excess[..., k] > _LIMIT_TOLERANCE).any(axis=0))),
            "command": abs(value),
            "limit": abs(float((upper if value > 0.0 else lower)[robot, 0, k])),
        }
    return excesses
