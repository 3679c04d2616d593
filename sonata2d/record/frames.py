"""What a recorder noted, made the frames of the file: angles and rounding, once for the whole episode."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.devices import DeviceEvent
from ..core.entities import Interaction
from ..core.geometry import quantised
from ..core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY, X, Y
from ..core.portable_math import Array, arctan2
from ..core.snapshot import Contact
from .canonical import plain, refuse_unfinite, rounded, rounded_rows
from .layout import COMMAND_NAMES, HUMAN_ANGLES, HUMAN_NAMES, ROBOT_ANGLES, ROBOT_NAMES, Tree, interaction_rows

Act = tuple[tuple[float, float, float], Any, tuple[DeviceEvent, ...]]  # command, label, events
Told = tuple[
    int, float, bool, tuple[Interaction, ...], tuple[Contact, ...]
]  # tick, time, guarded, interactions, contacts


def robot_rows(looks: Array) -> tuple[Array, Array]:
    """Robot rows (T, 6) and executed twists (T, 3) of T looks; (T, 10) in the recorder's order."""
    robot = np.stack((looks[:, 0], looks[:, 1], arctan2(looks[:, 3], looks[:, 2]), *looks[:, 4:7].T), axis=1)
    refuse_unfinite(robot, ROBOT_NAMES, "the robot")
    refuse_unfinite(looks[:, 7:], COMMAND_NAMES, "the executed command")
    return rounded_rows(robot, ROBOT_ANGLES), rounded(looks[:, 7:])


def human_rows(state: Array, present: Any, ids: list[int]) -> list[Any]:
    """Rows of each look, (N, 7) each; None in place of the row of whoever is not present.

    Args:
        state: (T, N, 9), as in a snapshot.
        present: (T, N) of bool.
        ids: of the people.
    """
    s = state.reshape(len(state), len(ids), 9)
    theta, head = arctan2(s[..., BODY_Y], s[..., BODY_X]), arctan2(s[..., GAZE_Y], s[..., GAZE_X])
    rows = np.stack((s[..., X], s[..., Y], theta, s[..., VX], s[..., VY], s[..., OMEGA], head), axis=-1)
    refuse_unfinite(np.where(present[..., None], rows, 0.0), HUMAN_NAMES, "human", ids)
    rows = rounded_rows(rows, HUMAN_ANGLES)
    if present.all():
        return list(rows)
    pairs = (zip(look.tolist(), there.tolist(), strict=True) for look, there in zip(rows, present, strict=True))
    return [[row if here else None for row, here in pair] for pair in pairs]


def looks_of(told: list[Told], robot: list[list[float]], humans: list[Any], activity: Any) -> list[Tree]:
    """What every look shows, without commands."""
    looks, shown, rows = [], None, []
    for (tick, time, _, interactions, contacts), body, people, doing in zip(told, robot, humans, activity, strict=True):
        if interactions is not shown:  # they seldom change
            shown, rows = interactions, interaction_rows(interactions)
        looks.append(
            {
                "tick": tick,
                "time": quantised(time),
                "robot": body,
                "humans": people,
                "activity": doing,
                "interactions": rows,
                "contacts": [_contact(contact) for contact in contacts],
            }
        )
    return looks


def frame_of(look: Tree, command: list[float], executed: list[float], after: Told, act: Act) -> Tree:
    """A look with what was done about it; the look after it knows what came of the command."""
    frame = {
        "tick": look["tick"],
        "time": look["time"],
        "robot": look["robot"],
        "command": command,
        "executed": executed,
        "guarded": after[2],
        "humans": look["humans"],
        "activity": look["activity"],
        "interactions": look["interactions"],
        "contacts": look["contacts"],
        "events": event_rows(act[2], look["tick"]),
    }
    return frame if act[1] is None else frame | {"label": act[1]}


def _contact(contact: Contact) -> Tree:
    return {
        "kind": contact.kind,
        "id": contact.id,
        "robot_at_fault": contact.robot_at_fault,
        "other_at_fault": contact.other_at_fault,
    }


def event_rows(events: tuple[DeviceEvent, ...], tick: int) -> list[Tree]:
    """What a person did to devices until a tick."""
    place = f"device event at tick {tick}"
    return [{"device": e.device, "control": e.control, "value": plain(float(e.value), place)} for e in events]
