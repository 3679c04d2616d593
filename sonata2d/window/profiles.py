"""Profiles of devices: the default controls, and the file `controls.toml` of a user that changes them."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import platformdirs
import pygame
from pydantic import Field, ValidationError

from ..agents.controllers.teleoperation import DEFAULT_CONTROLS, DIRECTIONS, Axis, DeviceMapping, Direction
from ..core.bounds import Fraction
from ..errors import ConfigError
from ..record.files import write_atomically
from ..registry import did_you_mean
from ..scenegen.scenario.base import Settings
from ..scenegen.scenario.parse import parse_settings
from ..scenegen.scenario.problems import problem_of
from .actions import Action

FOLDER_VARIABLE = "SONATA2D_CONFIG"
AXES = ("left_x", "left_y", "right_x", "right_y", "left_trigger", "right_trigger")  # index: SDL's number
BUTTONS = (
    "a", "b", "x", "y", "back", "guide", "start", "left_stick", "right_stick", "left_shoulder", "right_shoulder",
    "dpad_up", "dpad_down", "dpad_left", "dpad_right", "misc1", "paddle1", "paddle2", "paddle3", "paddle4", "touchpad",
)  # index: SDL's number  # fmt: skip

_FIXED = ("escape", "f12")  # keys of the menu and of screenshots, which every screen has
_MOUSE = ("drag_x", "drag_y", "wheel_up", "wheel_down", "middle_button", "right_button")
_NUMBERED = re.compile(r"(axis|button)\d+|hat\d+_[xy]")  # controls of devices without names in SDL


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

    def controls_of(self, *targets: Axis | Action) -> dict[str, float]:
        """The controls that drive along an axis of the robot, with their gains, or that request an action, with 1."""
        driving = {control: gain for control, (axis, gain) in self.mapping.controls.items() if axis in targets}
        return driving | {control: 1.0 for control, action in self.actions.items() if action in targets}


class _DeviceSettings(Settings):
    """The tables of one device in the file; None for a table, or a number, that is left out."""

    dead_zone: Fraction | None = None
    curve: Fraction | None = None
    drive: dict[str, Direction] | None = None
    actions: dict[str, Action] | None = None

    def profile(self, device: str, default: Profile) -> Profile:
        """The default profile, in which the tables of the file replace the default tables.

        Raises:
            ConfigError: a control or an action does not exist, or a control has two uses.
        """
        for table, entries in (("drive", self.drive), ("actions", self.actions)):
            for control in entries or ():
                _require_control(device, control, f"{device}.{table}")
        base = default.mapping
        controls = base.controls if self.drive is None else {c: DIRECTIONS[d] for c, d in self.drive.items()}
        actions = default.actions if self.actions is None else self.actions
        if device == "keyboard":
            actions = {"escape": Action.MENU, **actions}
        for control, action in actions.items():
            if control in controls:
                raise ConfigError(
                    f"{device}: {control!r} drives ({controls[control][0]}) and requests {str(action)!r};"
                    f" list it in one of the tables [{device}.drive] and [{device}.actions] only"
                )
        dead_zone = base.dead_zone if self.dead_zone is None else min(self.dead_zone, 0.9999)
        return Profile(DeviceMapping(controls, dead_zone, base.curve if self.curve is None else self.curve), actions)


class _FileSettings(Settings):
    """The file of controls."""

    keyboard: _DeviceSettings = _DeviceSettings()
    mouse: _DeviceSettings = _DeviceSettings()
    pad: _DeviceSettings = _DeviceSettings()
    pads: dict[str, _DeviceSettings] = Field(default_factory=dict)


def controls_file() -> Path:
    """Path of the file of controls: in the folder that the variable SONATA2D_CONFIG names, or in the user's own."""
    folder = os.environ.get(FOLDER_VARIABLE) or platformdirs.user_config_path("sonata2d", appauthor=False)
    return Path(folder) / DEFAULT_CONTROLS.name


def read_profiles(path: Path | None = None) -> dict[str, Profile]:
    """Read the file of controls; without a file, the defaults.

    Args:
        path: of the file; `controls_file()` by default.

    Returns:
        The profiles of `keyboard`, `mouse`, `pad`, and `pads.NAME` for pads of a name.

    Raises:
        ConfigError: the file cannot be read, or a key or value is wrong; names the file, the key and the value.
    """
    path = path or controls_file()
    if not path.exists():
        return dict(DEFAULT_PROFILES)
    try:
        return _profiles_in(path, DEFAULT_PROFILES)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error} (correct the file, or delete it to use the default controls)") from None


def write_default_controls(path: Path | None = None) -> Path:
    """Write the default controls to a new file, to be edited.

    Args:
        path: of the file; `controls_file()` by default.

    Returns:
        The path.

    Raises:
        ConfigError: the file exists.
        RecordError: the file cannot be written.
    """
    path = path or controls_file()
    if path.exists():
        raise ConfigError(f"{path} exists; edit it, or delete it first")
    write_atomically(path, DEFAULT_CONTROLS.read_bytes())
    return path


def _profiles_in(path: Path, defaults: Mapping[str, Profile]) -> dict[str, Profile]:
    """The profiles of a file, by device, with defaults for the tables that it leaves out."""
    settings = parse_settings(path, "file of controls")
    try:
        file = _FileSettings.model_validate(settings)
    except ValidationError as error:
        raise ConfigError(problem_of(settings, error)[1]) from None
    profiles = {name: getattr(file, name).profile(name, default) for name, default in defaults.items()}
    pads = {f"pads.{name}": device for name, device in file.pads.items()}
    return profiles | {name: device.profile(name, profiles["pad"]) for name, device in pads.items()}


def _require_control(device: str, control: str, place: str) -> None:
    """Require that a device has a control.

    Raises:
        ConfigError: it has not, or the control has a fixed use.
    """
    if device == "keyboard":
        key = control.removeprefix("ctrl+").removeprefix("alt+")
        if key in _FIXED:
            raise ConfigError(f"{place}.{control}: this key has a fixed use; choose another key")
        if key != key.lower() or not _is_key(key):
            raise ConfigError(f"{place}.{control}: no key has this name; names are like w, up, page up, [4] and ctrl+z")
        return
    known = _MOUSE if device == "mouse" else (*AXES, *BUTTONS)
    control = control.removeprefix("-") if place.endswith("actions") else control  # the negative half of an axis
    if control not in known and not (device != "mouse" and _NUMBERED.fullmatch(control)):
        hint = did_you_mean(control, known) or f"; controls are {', '.join(known)}"
        numbered = "" if device == "mouse" else ", or axis0, button3, hat0_x for devices whose controls have no names"
        raise ConfigError(f"{place}.{control}: there is no such control{hint}{numbered}")


def _is_key(name: str) -> bool:
    """Whether SDL knows a key of this name."""
    with warnings.catch_warnings():  # pygame warns before the window is open, but names do not depend on it
        warnings.simplefilter("ignore")
        try:
            pygame.key.key_code(name)
        except ValueError:
            return False
    return True


DEFAULT_PROFILES: Mapping[str, Profile] = _profiles_in(
    DEFAULT_CONTROLS, dict.fromkeys(("keyboard", "mouse", "pad"), Profile(DeviceMapping({}), {}))
)
