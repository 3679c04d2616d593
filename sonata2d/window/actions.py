"""Actions that a driver requests with a key or button besides driving: names, default controls and texts."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from enum import StrEnum

import pygame

from ..collect.texts import text


class Action(StrEnum):
    """A request to the window; the value is its name in the profiles file."""

    CONFIRM = "confirm"
    DISCARD = "discard"
    REDO = "redo"
    NEXT = "next"
    UNDO = "undo"
    PAUSE = "pause"
    MENU = "menu"
    HELP = "help"
    HUD = "hud"
    VIEW = "view"
    ZONES = "zones"
    ZOOM_IN = "zoom_in"
    ZOOM_OUT = "zoom_out"
    LABEL_UP = "label_up"
    LABEL_DOWN = "label_down"
    LABEL_1 = "label_1"
    LABEL_2 = "label_2"
    LABEL_3 = "label_3"
    LABEL_4 = "label_4"
    LABEL_5 = "label_5"
    LABEL_6 = "label_6"
    LABEL_7 = "label_7"
    LABEL_8 = "label_8"
    LABEL_9 = "label_9"
    SCENE = "scene"
    REMAP = "remap"
    FULLSCREEN = "fullscreen"
    QUIT = "quit"
    NEW_PERSON = "new_person"

    @property
    def text(self) -> str:
        """Description for the controls page."""
        return text("action.label", number=self.level) if self.level else text(f"action.{self.value}")

    @property
    def level(self) -> int:
        """Number of the requested label, 1 to 9; 0 for all other actions."""
        return int(self.value[6:]) if self.value[6:].isdigit() else 0


KEYBOARD_ACTIONS: Mapping[str, Action] = {
    "return": Action.CONFIRM, "enter": Action.CONFIRM, "backspace": Action.DISCARD, "r": Action.REDO,
    "n": Action.NEXT, "ctrl+z": Action.UNDO, "p": Action.PAUSE, "escape": Action.MENU, "f1": Action.HELP,
    "h": Action.HUD, "v": Action.VIEW, "z": Action.ZONES, "+": Action.ZOOM_IN, "=": Action.ZOOM_IN,
    "[+]": Action.ZOOM_IN, "-": Action.ZOOM_OUT, "[-]": Action.ZOOM_OUT, "page up": Action.LABEL_UP,
    "page down": Action.LABEL_DOWN, "g": Action.SCENE, "k": Action.REMAP, "f11": Action.FULLSCREEN,
    "ctrl+q": Action.QUIT,
    **{str(k): Action(f"label_{k}") for k in range(1, 10)},
    **{f"[{k}]": Action(f"label_{k}") for k in range(1, 10)},
}  # fmt: skip
MOUSE_ACTIONS: Mapping[str, Action] = {"wheel_up": Action.LABEL_UP, "wheel_down": Action.LABEL_DOWN}
PAD_ACTIONS: Mapping[str, Action] = {
    "a": Action.CONFIRM, "b": Action.DISCARD, "x": Action.REDO, "y": Action.NEXT, "start": Action.PAUSE,
    "back": Action.UNDO, "dpad_up": Action.LABEL_UP, "dpad_down": Action.LABEL_DOWN,
    "right_trigger": Action.LABEL_UP, "left_trigger": Action.LABEL_DOWN, "right_stick": Action.VIEW,
    "left_stick": Action.HUD,
    # devices whose controls have no names in SDL
    "button0": Action.CONFIRM, "button1": Action.DISCARD, "button2": Action.REDO, "button3": Action.NEXT,
    "hat0_y": Action.LABEL_UP, "-hat0_y": Action.LABEL_DOWN,
}  # fmt: skip

# Rows of the help page: the keys, or the key of their text; and the key of what they do.
_HELP = (
    ("help.ahead_keys", "help.ahead"),
    ("help.turn_keys", "help.turn"),
    ("Q E", "help.sideways"),
    ("player.space_key", "help.brake"),
    ("help.mouse_keys", "help.mouse"),
    ("help.left_stick_keys", "help.left_stick"),
    ("help.right_stick_keys", "help.sideways"),
    ("help.shoulder_keys", "help.brake"),
    ("help.confirm_keys", "help.confirm"),
    ("help.discard_keys", "action.discard"),
    ("help.redo_keys", "action.redo"),
    ("help.next_keys", "action.next"),
    ("help.undo_keys", "action.undo"),
    ("help.pause_keys", "action.pause"),
    ("help.label_keys", "help.labels"),
    ("help.label_step_keys", "help.label_step"),
    ("help.view_keys", "action.view"),
    ("help.hud_keys", "action.hud"),
    ("Z", "action.zones"),
    ("+ -", "help.zoom"),
    ("G", "action.scene"),
    ("K", "action.remap"),
    ("F11", "action.fullscreen"),
    ("F12", "help.screenshot"),
    ("F1", "help.this"),
    ("Esc", "action.menu"),
    ("Ctrl+Q", "action.quit"),
)


# Texts of actions that are not named after them.
_ACTION_TEXTS = {
    "help.zoom": Action.ZOOM_IN, "keys.another_scene": Action.NEXT, "keys.camera": Action.VIEW,
    "keys.scene": Action.SCENE, "keys.zones": Action.ZONES, "keys.redo": Action.REDO, "keys.discard": Action.DISCARD,
    "keys.keep": Action.CONFIRM, "help.confirm": Action.CONFIRM, "keys.menu": Action.MENU,
}  # fmt: skip


def is_about(key: str, actions: Collection[Action]) -> bool:
    """Whether a text describes one of some actions.

    >>> is_about("action.scene", [Action.SCENE]), is_about("keys.camera", [Action.SCENE])
    (True, False)
    """
    return (_ACTION_TEXTS.get(key) or key.removeprefix("action.")) in actions


def help_rows(hidden: Collection[Action] = ()) -> list[tuple[str, str]]:
    """Rows of the help page without some actions: default control, and what it does."""
    rows = [row for row in _HELP if not is_about(row[1], hidden)]
    return [(text(keys) if keys.startswith("help.") else keys, text(meaning)) for keys, meaning in rows]


_NAMED = frozenset({  # controls that have a text
    "return", "enter", "escape", "drag_x", "drag_y", "wheel_up", "wheel_down",
    "left_x", "left_y", "right_x", "right_y", "left_stick", "right_stick",
})  # fmt: skip
_NUMBERED = re.compile(r"(-?)(axis|button|hat)(\d+)(?:_([xy]))?")
_HAT_ENDS = {("", "x"): "right", ("-", "x"): "left", ("", "y"): "up", ("-", "y"): "down"}
_FIRST_LETTER, _FIRST_DIGIT = pygame.KSCAN_A, pygame.KSCAN_1


def key_name(event: pygame.Event) -> str:
    """Name of the key of a KEYDOWN or KEYUP event: `w`, `up`, `space`.

    Digits are identified by position, because some layouts have other characters in that row; letters are identified
    by position on layouts of other scripts.
    """
    scancode = int(getattr(event, "scancode", 0))
    name = pygame.key.name(event.key).lower()
    if _FIRST_DIGIT <= scancode <= pygame.KSCAN_0 and not name.isdigit():
        return "1234567890"[scancode - _FIRST_DIGIT]
    if _FIRST_LETTER <= scancode <= pygame.KSCAN_Z and not (name and name.isascii()):
        return "abcdefghijklmnopqrstuvwxyz"[scancode - _FIRST_LETTER]
    return name


def key_with_modifiers(event: pygame.Event) -> str:
    """`key_name` with the prefixes `ctrl+` and `alt+` of the modifiers held, so that Ctrl+W does not drive.

    AltGr does not count as a modifier: many layouts need it for characters.
    """
    mods = int(getattr(event, "mod", 0))
    ctrl = "ctrl+" if mods & (pygame.KMOD_CTRL | pygame.KMOD_META) else ""
    return ctrl + ("alt+" if mods & pygame.KMOD_LALT else "") + key_name(event)


def control_text(control: str) -> str:
    """Readable name of a control; a leading `-` is the negative half of an axis.

    >>> [control_text(control) for control in ("left_shoulder", "ctrl+z", "-axis3", "hat0_y", "w", "[4]", "page up")]
    ['left shoulder', 'Ctrl+Z', 'axis 3 minus', 'hat 0 up', 'W', 'Num 4', 'Page Up']
    """
    if control in _NAMED:
        return text(f"control.{control}")
    if len(control) == 1:
        return control.upper()
    if control.startswith("["):  # SDL's name of a key of the number pad
        return text("control.number_pad", key=control[1:-1])
    numbered = _NUMBERED.fullmatch(control)
    if numbered:
        minus, kind, number, side = numbered.groups()
        if (minus, side) in _HAT_ENDS:
            return text(f"control.hat_{_HAT_ENDS[minus, side]}", number=number)
        name = text(f"control.{kind}", number=number)
        return text("control.minus", control=name) if minus else name
    if control.startswith("-"):
        return text("control.minus", control=control_text(control[1:]))
    if "_" in control:
        return control.replace("dpad", "d-pad").replace("_", " ")
    return "+".join(" ".join(word.capitalize() for word in part.split(" ")) for part in control.split("+"))
