"""What a person set up, kept between sessions: how each device is read, and the last choices."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import platformdirs

from ..agents.controllers.teleoperation import HANDS, Hand
from ..errors import RecordError
from ..record.files import write_atomically
from .actions import KEYBOARD_ACTIONS, MOUSE_ACTIONS, PAD_ACTIONS, Action

LOG = logging.getLogger(__name__)

FOLDER_VARIABLE = "SONATA2D_CONFIG"
_DEVICES, _SETTINGS = "devices.json", "settings.json"
_ACTIONS = {"keyboard": KEYBOARD_ACTIONS, "mouse": MOUSE_ACTIONS}


@dataclass(frozen=True, slots=True)
class Profile:
    """How a device is read: its controls that drive, and those that ask something of the window.

    A control that drives asks for nothing. An axis asks when it passes its half; `-` before its name is its other side.
    """

    hand: Hand
    actions: Mapping[str, Action]

    @classmethod
    def stock(cls, key: str) -> Self:
        """As it is before anyone sets it up."""
        return cls(HANDS.get(key, HANDS["pad"]), _ACTIONS.get(key, PAD_ACTIONS))

    @classmethod
    def restored(cls, told: Mapping[str, Any]) -> Self:
        """The inverse of `settings`.

        Raises:
            ValueError, KeyError, TypeError, AttributeError: it tells of no profile.
        """
        actions = {str(control): Action(asked) for control, asked in told["actions"].items()}
        return cls(Hand.restored(told["hand"]), actions)

    def settings(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {"hand": self.hand.settings(), "actions": {control: str(a) for control, a in self.actions.items()}}


class Profiles:
    """The profiles of all devices: by GUID for pads, `keyboard` and `mouse`.

    Args:
        folder: of the settings; the user's own unless given, or named by the variable SONATA2D_CONFIG.

    Attributes:
        notice: what went wrong with the file, for the person; empty if nothing did.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._path = (folder or config_folder()) / _DEVICES
        self.notice = ""
        self._devices: dict[str, Profile] = {}
        read = read_json(self._path)
        try:
            self._devices = {key: Profile.restored(told) for key, told in read.get("devices", {}).items()}
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            self.notice = put_aside(self._path, f"says what cannot be used ({error})")

    def of(self, key: str) -> Profile:
        """How a device is read."""
        return self._devices.get(key) or Profile.stock(key)

    def put(self, key: str, profile: Profile) -> None:
        """It is read this way from now on; `save` keeps it."""
        self._devices[key] = profile

    def reset(self, key: str) -> None:
        """It is read as if nobody had set it up."""
        self._devices.pop(key, None)

    def save(self) -> bool:
        """Keep the profiles for the next session; False, with a `notice`, if that cannot be."""
        told = {"devices": {key: profile.settings() for key, profile in self._devices.items()}}
        self.notice = write_json(self._path, told)
        return not self.notice


def remembered(folder: Path | None = None) -> dict[str, Any]:
    """What `remember` kept: the contributor's name and the last choices; empty at first."""
    return read_json((folder or config_folder()) / _SETTINGS)


def remember(folder: Path | None = None, **choices: Any) -> str:
    """Keep choices for the next session, besides those kept before. Answers what went wrong, or nothing."""
    path = (folder or config_folder()) / _SETTINGS
    return write_json(path, read_json(path) | choices)


def config_folder() -> Path:
    """Where settings are kept."""
    return Path(os.environ.get(FOLDER_VARIABLE) or platformdirs.user_config_path("sonata2d", appauthor=False))


def read_json(path: Path) -> dict[str, Any]:
    """The object in a file; empty if there is none. A file that holds no such thing is put aside."""
    try:
        read = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except OSError as error:
        LOG.warning("%s cannot be read: %s", path, error.strerror or error)
        return {}
    except (ValueError, RecursionError) as error:
        put_aside(path, f"is damaged ({error})")
        return {}
    if not isinstance(read, dict):
        put_aside(path, "holds no settings")
        return {}
    return read


def put_aside(path: Path, why: str) -> str:
    """Rename a file that cannot be used, so that what is in it is not written over. Answers what to tell the person."""
    aside = path.with_name(path.name + ".damaged")
    try:
        os.replace(path, aside)
    except OSError as error:
        notice = f"{path} {why}, and cannot be put aside: {error.strerror or error}; the usual settings are used"
    else:
        notice = f"{path} {why}; it is now {aside.name}, and the usual settings are used"
    LOG.warning("%s", notice)
    return notice


def write_json(path: Path, told: Mapping[str, Any]) -> str:
    """Write a file so that the old one or the new one is there, whole. Answers what went wrong, or nothing."""
    try:
        write_atomically(path, json.dumps(told, indent=2, sort_keys=True).encode())
    except RecordError as error:
        notice = f"{error}; name another folder in {FOLDER_VARIABLE}"
        LOG.warning("%s", notice)
        return notice
    return ""
