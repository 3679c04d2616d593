"""Settings kept between sessions: what each control of a device does."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, Self

import platformdirs

from ..agents.controllers.teleoperation import DEFAULT_MAPPINGS, Axis, DeviceMapping
from ..collect.texts import text
from ..errors import RecordError
from ..record.files import write_atomically
from .actions import KEYBOARD_ACTIONS, MOUSE_ACTIONS, PAD_ACTIONS, Action, control_text

logger = logging.getLogger(__name__)

FOLDER_VARIABLE = "SONATA2D_CONFIG"
_DEVICES = "devices.json"
_ACTIONS = {"keyboard": KEYBOARD_ACTIONS, "mouse": MOUSE_ACTIONS}
_MIN_MOVE = 0.6  # deflection that selects a control for a new assignment
_MODIFIERS = frozenset(f"{side} {key}" for side in ("left", "right") for key in ("ctrl", "shift", "alt", "meta"))
_RESERVED = frozenset({"escape", "delete", "f12", "caps lock", "numlock", ""}) | _MODIFIERS  # cannot be assigned
_STICKS = {"left": "left_stick", "right": "right_stick", "drag": "drag"}
_STICK_ENDS = {f"{stick}_{axis}": ends for stick in _STICKS for axis, ends in
               (("x", ("left", "right")), ("y", ("up", "down")))}  # fmt: skip


class Drive(NamedTuple):
    """One direction of driving: an axis of the robot, and the sign along it, 1 or -1."""

    axis: Axis
    sign: float
    name: str

    @property
    def text(self) -> str:
        """Description for the controls page."""
        return text(f"action.{self.name}")


Target = Drive | Action
DRIVES = (
    Drive("ahead", 1.0, "ahead"),
    Drive("ahead", -1.0, "back"),
    Drive("turn", 1.0, "turn_left"),
    Drive("turn", -1.0, "turn_right"),
    Drive("left", 1.0, "left"),
    Drive("left", -1.0, "right"),
    Drive("brake", 1.0, "brake"),
)
TARGETS: tuple[Target, ...] = (  # Esc is fixed, and a new driver takes over by the menu only
    *DRIVES,
    *(action for action in Action if action not in (Action.MENU, Action.NEW_PERSON)),
)


@dataclass(frozen=True, slots=True)
class Profile:
    """Control assignments of one device.

    A control either drives or requests an action. An axis requests its action beyond half of its range; a leading `-`
    names its negative half.

    Attributes:
        mapping: the controls that drive.
        actions: the controls that request actions.
    """

    mapping: DeviceMapping
    actions: Mapping[str, Action]

    @classmethod
    def default(cls, key: str) -> Self:
        """Default profile of `keyboard`, `mouse`, or a pad (any other key)."""
        return cls(DEFAULT_MAPPINGS.get(key, DEFAULT_MAPPINGS["pad"]), _ACTIONS.get(key, PAD_ACTIONS))

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Inverse of `settings`.

        Raises:
            ValueError, KeyError, TypeError, AttributeError: the settings do not describe a profile.
        """
        actions = {str(control): Action(action) for control, action in settings["actions"].items()}
        return cls(DeviceMapping.from_settings(settings["hand"]), actions)

    def settings(self) -> dict[str, Any]:
        """The profile as a JSON object."""
        return {"hand": self.mapping.settings(), "actions": {control: str(a) for control, a in self.actions.items()}}

    def assigned(self, target: Target, control: str, value: float) -> Profile:
        """Copy in which a control does this and nothing else.

        A key or button is added to those that did it before; a stick replaces another stick.

        Args:
            target: what the control does.
            control: its name.
            value: its deflection while it was selected, -1 to 1; the sign selects the half of an axis.
        """
        sign = 1.0 if value > 0 else -1.0
        if isinstance(target, Drive):
            both = (control, f"-{control}")
            free = self._without(both, both)
            controls = dict(free.mapping.controls)
            if has_two_ends(control):
                controls = {c: a for c, a in controls.items() if a[0] != target.axis or not has_two_ends(c)}
            controls[control] = (target.axis, target.sign * sign)
            return replace(free, mapping=replace(free.mapping, controls=controls))
        end = control if sign > 0 else f"-{control}"
        free = self._without((control, end), (end,))
        return replace(free, actions={**free.actions, end: target})

    def cleared(self, target: Target) -> Profile:
        """Copy in which no control does this. A stick that did it loses its opposite direction as well."""
        if isinstance(target, Drive):
            driving = [c for c, (axis, gain) in self.mapping.controls.items() if _drives(c, axis, gain, target)]
            return self._without(driving, driving)
        return self._without((), [c for c, action in self.actions.items() if action == target])

    def texts(self, target: Target, *, named: bool) -> str:
        """Readable names of the controls that do this, of a device whose controls are named or numbered."""
        if isinstance(target, Drive):
            controls = self.mapping.controls.items()
            ends = [(c, target.sign * gain) for c, (axis, gain) in controls if _drives(c, axis, gain, target)]
            texts = [_end_text(c, sign) for c, sign in ends if _is_numbered(c) is not named]
        else:
            own = [c for c, action in self.actions.items() if action == target]
            texts = [control_text(c) for c in own if _is_numbered(c.lstrip("-")) is not named]
        return ", ".join(texts)

    def _without(self, driving: Collection[str], acting: Collection[str]) -> Profile:
        """Copy in which some controls do not drive, and some do not request actions."""
        controls = {c: assignment for c, assignment in self.mapping.controls.items() if c not in driving}
        actions = {c: action for c, action in self.actions.items() if c not in acting}
        return Profile(replace(self.mapping, controls=controls), actions)


def is_assignable(control: str, value: float) -> bool:
    """Whether a move selects a control for a new assignment: far enough, and not a reserved key."""
    return abs(value) >= _MIN_MOVE and control not in _RESERVED


def has_two_ends(control: str) -> bool:
    """Whether a control moves both ways from its rest, like a stick and unlike a button."""
    return control in _STICK_ENDS or (_is_numbered(control) and not control.startswith("button"))


def _is_numbered(control: str) -> bool:
    """Whether the control is of a device without names in SDL: `axis0`, `button3`, `hat0_x`."""
    return control[:-1].startswith(("axis", "button", "hat")) and control.rstrip("_xy")[-1:].isdigit()


def _drives(control: str, axis: Axis, gain: float, target: Drive) -> bool:
    return axis == target.axis and (has_two_ends(control) or gain * target.sign > 0)


def _end_text(control: str, sign: float) -> str:
    """Readable name of one end of a driving control: `left stick up`."""
    if control in _STICK_ENDS:
        return text(f"control.{_STICKS[control[:-2]]}_{_STICK_ENDS[control][sign > 0]}")
    if has_two_ends(control):
        name = control_text(control if sign > 0 else f"-{control}")
        return text("control.plus", control=name) if sign > 0 and "hat" not in control else name
    return control_text(control)


class Profiles:
    """The profiles of all devices, stored in `devices.json`: by GUID for pads, `keyboard` and `mouse`.

    Args:
        folder: of the file; by default the folder named by the variable SONATA2D_CONFIG, or the user's own.

    Attributes:
        notice: message for the driver about a problem with the file; empty if there is none.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._path = (folder or config_folder()) / _DEVICES
        self.notice = ""
        self._devices: dict[str, Profile] = {}
        read = read_json(self._path)
        try:
            self._devices = {key: Profile.from_settings(one) for key, one in read.get("devices", {}).items()}
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            self.notice = set_aside(self._path, f"has invalid entries ({error})")

    def of(self, key: str) -> Profile:
        """Profile of a device; the default profile if none is stored."""
        return self._devices.get(key) or Profile.default(key)

    def put(self, key: str, profile: Profile) -> None:
        """Use this profile from now on; `save` writes it."""
        self._devices[key] = profile

    def save(self) -> bool:
        """Write the profiles; returns False and sets `notice` if that fails."""
        settings = {"devices": {key: profile.settings() for key, profile in self._devices.items()}}
        self.notice = write_json(self._path, settings)
        return not self.notice


def config_folder() -> Path:
    """Folder of the settings."""
    return Path(os.environ.get(FOLDER_VARIABLE) or platformdirs.user_config_path("sonata2d", appauthor=False))


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object; empty if the file does not exist. A damaged file is set aside."""
    try:
        read = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except OSError as error:
        logger.warning("%s cannot be read: %s", path, error.strerror or error)
        return {}
    except (ValueError, RecursionError) as error:
        set_aside(path, f"is damaged ({error})")
        return {}
    if not isinstance(read, dict):
        set_aside(path, "is not a JSON object")
        return {}
    return read


def set_aside(path: Path, reason: str) -> str:
    """Rename a file that cannot be used, so that it is not overwritten; returns a message for the driver."""
    aside = path.with_name(path.name + ".damaged")
    try:
        os.replace(path, aside)
    except OSError as error:
        notice = f"{path} {reason} and cannot be renamed: {error.strerror or error}; default settings are used"
    else:
        notice = f"{path} {reason}; it was renamed to {aside.name}, and default settings are used"
    logger.warning("%s", notice)
    return notice


def write_json(path: Path, content: Mapping[str, Any]) -> str:
    """Replace a file as a whole, or leave it unchanged; returns an error message or an empty text."""
    try:
        write_atomically(path, json.dumps(content, indent=2, sort_keys=True).encode())
    except RecordError as error:
        notice = f"{error}; set {FOLDER_VARIABLE} to another folder"
        logger.warning("%s", notice)
        return notice
    return ""
