"""The controls that the window shows: rows of the help page, and the keys along the lower edge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from typing import NamedTuple

from ..agents.controllers.teleoperation import Axis
from ..collect.texts import text
from .actions import Action
from .profiles import DEFAULT_PROFILES, Profile


class _Row(NamedTuple):
    """A control and its meaning.

    Attributes:
        keys: the default controls as they are printed on them, or the key of their text.
        meaning: key of the text.
        targets: axes of the robot and actions of the controls; empty for keys that cannot be changed.
        device: `keyboard`, `mouse` or `pad` if the help page shows its controls only; empty for all devices.
    """

    keys: str
    meaning: str
    targets: tuple[Axis | Action, ...] = ()
    device: str = ""


_LABELS = tuple(action for action in Action if action.level)
_HELP = (
    _Row("help.ahead_keys", "help.ahead", ("ahead",), "keyboard"),
    _Row("help.turn_keys", "help.turn", ("turn",), "keyboard"),
    _Row("Q E", "help.sideways", ("left",), "keyboard"),
    _Row("player.space_key", "help.brake", ("brake",), "keyboard"),
    _Row("help.mouse_keys", "help.mouse", ("ahead", "turn"), "mouse"),
    _Row("help.left_stick_keys", "help.left_stick", ("ahead", "turn"), "pad"),
    _Row("help.right_stick_keys", "help.sideways", ("left",), "pad"),
    _Row("help.shoulder_keys", "help.brake", ("brake",), "pad"),
    _Row("help.confirm_keys", "help.confirm", (Action.CONFIRM,)),
    _Row("help.discard_keys", "action.discard", (Action.DISCARD,)),
    _Row("help.redo_keys", "action.redo", (Action.REDO,)),
    _Row("help.next_keys", "action.next", (Action.NEXT,)),
    _Row("help.undo_keys", "action.undo", (Action.UNDO,)),
    _Row("help.pause_keys", "action.pause", (Action.PAUSE,)),
    _Row("help.label_keys", "help.labels", _LABELS),
    _Row("help.label_step_keys", "help.label_step", (Action.LABEL_UP, Action.LABEL_DOWN)),
    _Row("help.view_keys", "action.view", (Action.VIEW,)),
    _Row("help.hud_keys", "action.hud", (Action.HUD,)),
    _Row("Z", "action.zones", (Action.ZONES,)),
    _Row("+ -", "help.zoom", (Action.ZOOM_IN, Action.ZOOM_OUT)),
    _Row("G", "action.scene", (Action.SCENE,)),
    _Row("F11", "action.fullscreen", (Action.FULLSCREEN,)),
    _Row("F12", "help.screenshot"),
    _Row("F1", "help.this", (Action.HELP,)),
    _Row("Esc", "action.menu"),
    _Row("Ctrl+Q", "action.quit"),
)

_DRIVE = _Row("keys.driving_keys", "keys.drive", ("ahead", "turn"))
_KEEP = _Row("Enter", "keys.keep", (Action.CONFIRM,))
_REDO = _Row("R", "keys.redo", (Action.REDO,))
_NEXT = _Row("N", "keys.another_scene", (Action.NEXT,))
_VIEW = _Row("V", "keys.camera", (Action.VIEW,))
_SCENE = _Row("G", "keys.scene", (Action.SCENE,))
_ZONES = _Row("Z", "keys.zones", (Action.ZONES,))
_SHOW_HELP = _Row("F1", "keys.help", (Action.HELP,))
_KEYS: dict[str, tuple[_Row, ...]] = {
    "waiting": (_DRIVE, _NEXT, _VIEW, _SCENE, _ZONES, _SHOW_HELP),
    "driving": (
        _DRIVE,
        _Row("Enter", "keys.end_run", (Action.CONFIRM,)),
        _Row("P", "keys.pause", (Action.PAUSE,)),
        _VIEW,
        _Row("H", "keys.readings", (Action.HUD,)),
        _SHOW_HELP,
    ),
    "paused": (_Row("P", "keys.continue", (Action.PAUSE,)), _REDO, _NEXT, _SHOW_HELP),
    "ended": (_KEEP, _Row("Backspace", "keys.discard", (Action.DISCARD,)), _REDO, _SHOW_HELP),
    "watching": (
        _Row("P", "keys.pause", (Action.PAUSE,)),
        _Row("N", "keys.next_scene", (Action.NEXT,)),
        _Row("R", "keys.again", (Action.REDO,)),
        _Row("+ -", "keys.speed", (Action.ZOOM_IN, Action.ZOOM_OUT)),
        _VIEW,
        _ZONES,
    ),
    "typing": (_KEEP, _Row("Esc", "keys.menu"), _Row("Ctrl+Q", "keys.close")),  # letters belong to a text
}


def help_rows(profiles: Mapping[str, Profile], hidden: Set[Action]) -> list[tuple[str, str]]:
    """Rows of the help page without some actions: controls and their meanings."""
    return [
        (_controls(row, profiles, [row.device] if row.device else list(DEFAULT_PROFILES)), text(row.meaning))
        for row in _HELP
        if not hidden & set(row.targets)
    ]


def keys_of(state: str, profiles: Mapping[str, Profile], hidden: Set[Action]) -> tuple[tuple[str, str], ...]:
    """Keys and their functions in a state of the session, or while `typing` or `watching`, without some actions."""
    rows = [row for row in _KEYS[state] if not hidden & set(row.targets)]
    return tuple((_controls(row, profiles, ["keyboard"]), text(row.meaning)) for row in rows)


def _controls(row: _Row, profiles: Mapping[str, Profile], devices: Sequence[str]) -> str:
    """The text of default controls; the names in the file of controls if the user has changed them."""
    controls = {device: profiles[device].controls_of(*row.targets) for device in devices}
    if all(controls[device] == DEFAULT_PROFILES[device].controls_of(*row.targets) for device in devices):
        return text(row.keys) if "." in row.keys else row.keys
    names = (name if device == "keyboard" else f"{device} {name}" for device in devices for name in controls[device])
    return ", ".join(names) or "–"
