"""The mirror image of what a file holds, left for right, part by part; each is its own inverse to the bit.

The mirror lies along the world's x axis: y becomes -y. A sign is all that changes, so no digit is lost. Polygons are
turned round, to stay counter-clockwise, and so are walls, to keep the room on the same hand; their order and so their
indices stay. People and the robot are alike on both hands, so theta becomes -theta. So do things, but for an oblong
one: its front is to its right, and stays there only if it is turned by half a turn as well.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..core.geometry import quantised
from ..core.portable_math import PI
from ..core.vectors import wrap_angle
from ..errors import RecordError
from ..record.layout import Tree

HALF_TURN = 3.1416  # at a file's precision; there -3.1416 is not written, so it is its own mirror image
ROBOT_SIGNS, HUMAN_SIGNS, TWIST_SIGNS = (1, 2, 4, 5), (1, 2, 4, 5, 6), (1, 2)  # columns that change sign
ROW_ANGLES = (2, 6)
SIDEWAYS = ("left", "turn")  # axes of the robot, as hands are bound to them


def flipped(value: Any) -> Any:
    """The number with the other sign, an int as an int, and never -0.0."""
    return 0 - value


def flipped_angle(theta: Any) -> Any:
    """An angle as seen in the mirror."""
    return theta if abs(theta) == HALF_TURN else flipped(theta)


def turned_angle(theta: Any) -> float:
    """pi - theta, as a multiple of the file's precision where theta is one: then twice gives theta."""
    if quantised(theta) != theta:
        return wrap_angle(PI - theta)
    turned = quantised(HALF_TURN - theta)
    return turned if turned <= HALF_TURN else quantised(turned - 2 * HALF_TURN)


def comes_back(theta: Any) -> bool:
    """Whether `turned_angle` gives it again, in the same writing, when it is turned twice."""
    return repr(turned_angle(turned_angle(theta))) == repr(theta)


def is_oblong(thing: Tree) -> bool:
    """Whether a thing is longer along its x than wide."""
    shape = thing["shape"]
    return shape["type"] == "rectangle" and bool(shape["length"] > shape["width"])


def placed_image(told: Tree) -> Tree:
    """Of anything with a pose."""
    return told | {"y": flipped(told["y"]), "theta": flipped_angle(told["theta"])}


def human_image(told: Tree) -> Tree:
    """Of a person, with their goals, their track and their velocity; older files have none of these."""
    image = placed_image(told)
    for key in ("goals", "track"):
        if key in told:
            image[key] = [[x, flipped(y)] for x, y in told[key]]
    if "velocity" in told:
        image["velocity"] = [told["velocity"][0], flipped(told["velocity"][1])]
    return image


def objects_image(told: list[Tree], known: dict[int, Any]) -> list[Tree]:
    """Of the things in a room.

    Args:
        told: as in the file.
        known: thetas by index, of those that turning back does not give.
    """
    images = [placed_image(thing) for thing in told]
    for k, thing in enumerate(told):
        if is_oblong(thing):
            images[k]["theta"] = known[k] if k in known else turned_angle(thing["theta"])
    return images


def room_image(told: Tree) -> Tree:
    """Of the outline: counter-clockwise again."""
    return told | {"polygon": [[x, flipped(y)] for x, y in reversed(told["polygon"])]}


def walls_image(told: list[Any]) -> list[list[Any]]:
    """Of the walls, in the same order, each from its other end."""
    return [[x2, flipped(y2), x1, flipped(y1)] for x1, y1, x2, y2 in told]


def rules_image(told: Tree) -> Tree:
    """Of the rules: people evade to their other side."""
    return told | {"side": flipped(told["side"])}


def controller_image(told: Tree | None) -> Tree | None:
    """Of who drove. A person's hands did what they did; what their controls mean is mirrored.

    So the same device events ask for the mirrored twists, whatever each control is bound to.
    """
    hands = ((told or {}).get("settings") or {}).get("hands")
    if told is None or told["path"] != "teleoperation" or not hands:
        return told
    return told | {"settings": told["settings"] | {"hands": {kind: _hand(hand) for kind, hand in hands.items()}}}


def _hand(told: Tree) -> Tree:
    controls = {
        control: [axis, flipped(share) if axis in SIDEWAYS else share]
        for control, (axis, share) in told["controls"].items()
    }
    return told | {"controls": controls}


def look_image(look: Tree) -> Tree:
    """Of what is seen at a tick. Who it is, what they do and touch stays."""
    humans = [None if row is None else _row(row, HUMAN_SIGNS) for row in look["humans"]]
    return look | {"robot": _row(look["robot"], ROBOT_SIGNS), "humans": humans}


def frame_image(frame: Tree, label: Callable[[Any], Any] | None) -> Tree:
    """Of a frame: what is seen, the commands, and the label if there is a function for it.

    Of the final look too: imported runs may have a command there.
    """
    image = look_image(frame)
    for key in ("command", "executed"):
        if key in frame:
            image[key] = _row(frame[key], TWIST_SIGNS)
    if label is not None and "label" in frame:
        image["label"] = label(frame["label"])
    return image


def twist_image(label: Any) -> list[Any]:
    """Of a label that is a twist, [vx, vy, omega]: sideways and turning change sign.

    >>> twist_image([0.5, 0.1, -0.3])
    [0.5, -0.1, 0.3]

    Raises:
        RecordError: the label is no twist.
    """
    is_twist = isinstance(label, list) and len(label) == 3 and all(type(value) in (int, float) for value in label)
    if not is_twist:
        raise RecordError(f"the label {label!r} is no twist [vx, vy, omega]; mirror with labels that stay")
    return _row(label, TWIST_SIGNS)


def _row(row: list[Any], signs: tuple[int, ...]) -> list[Any]:
    """A row with the other sign in some columns; those of twists hold no angle."""
    image = list(row)
    for k in signs:
        image[k] = flipped_angle(row[k]) if k in ROW_ANGLES and len(row) > 3 else flipped(row[k])
    return image
