"""Actions that a person requests with a key or button besides driving: names, default controls and texts."""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import StrEnum
from typing import Self

import pygame


class Action(StrEnum):
    """A request to the window.

    Attributes:
        value: name in the profiles file.
        text: description for the controls page.
    """

    text: str

    def __new__(cls, value: str, text: str = "") -> Self:
        member = str.__new__(cls, value)
        member._value_, member.text = value, text
        return member

    CONFIRM = "confirm", "start / keep the run"
    DISCARD = "discard", "discard the run"
    REDO = "redo", "redo the same scene"
    NEXT = "next", "another scene"
    UNDO = "undo", "undo the last keep"
    PAUSE = "pause", "pause"
    MENU = "menu", "menu"
    HELP = "help", "help"
    HUD = "hud", "show / hide readings"
    VIEW = "view", "switch camera"
    ZONES = "zones", "personal space"
    ZOOM_IN = "zoom_in", "zoom in"
    ZOOM_OUT = "zoom_out", "zoom out"
    LABEL_UP = "label_up", "label up"
    LABEL_DOWN = "label_down", "label down"
    LABEL_1 = "label_1", "label 1"
    LABEL_2 = "label_2", "label 2"
    LABEL_3 = "label_3", "label 3"
    LABEL_4 = "label_4", "label 4"
    LABEL_5 = "label_5", "label 5"
    LABEL_6 = "label_6", "label 6"
    LABEL_7 = "label_7", "label 7"
    LABEL_8 = "label_8", "label 8"
    LABEL_9 = "label_9", "label 9"
    SCENE = "scene", "scene settings"
    REMAP = "remap", "set up the controls"
    FULLSCREEN = "fullscreen", "full screen"
    QUIT = "quit", "close the window"

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

# Rows of the help page: default control, and what it does.
HELP: tuple[tuple[str, str], ...] = (
    ("W S or up, down", "drive ahead, back"),
    ("A D or left, right", "turn"),
    ("Q E", "sideways, if the robot can"),
    ("Space", "brake"),
    ("Drag the mouse", "drive: up is ahead"),
    ("Left stick", "drive and turn"),
    ("Right stick", "sideways, if the robot can"),
    ("Left shoulder", "brake"),
    ("Enter, pad A", "start; keep the run"),
    ("Backspace, pad B", "discard the run"),
    ("R, pad X", "redo the same scene"),
    ("N, pad Y", "another scene"),
    ("Ctrl+Z, pad Back", "undo the last keep"),
    ("P, pad Start", "pause"),
    ("1 to 9", "label 1 to 9"),
    ("Wheel, Page keys, triggers", "label up, down"),
    ("V, press right stick", "switch camera"),
    ("H, press left stick", "show / hide readings"),
    ("Z", "personal space"),
    ("+ -", "zoom"),
    ("G", "scene settings"),
    ("K", "set up the controls"),
    ("F11", "full screen"),
    ("F12", "save a screenshot"),
    ("F1", "this help"),
    ("Esc", "menu"),
    ("Ctrl+Q", "close the window"),
)

_CONTROL_TEXTS = {
    "return": "Enter", "enter": "Num Enter", "escape": "Esc", "drag_x": "drag sideways",
    "drag_y": "drag up and down", "wheel_up": "wheel up", "wheel_down": "wheel down",
    "left_x": "left stick sideways", "left_y": "left stick up and down", "right_x": "right stick sideways",
    "right_y": "right stick up and down", "left_stick": "left stick press", "right_stick": "right stick press",
}  # fmt: skip
_NUMBERED = re.compile(r"(-?)(axis|button|hat)(\d+)(?:_([xy]))?")
_HAT_ENDS = {("", "x"): " right", ("-", "x"): " left", ("", "y"): " up", ("-", "y"): " down"}
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
    if control in _CONTROL_TEXTS:
        return _CONTROL_TEXTS[control]
    if len(control) == 1:
        return control.upper()
    if control.startswith("["):  # SDL's name of a key of the number pad
        return f"Num {control[1:-1]}"
    numbered = _NUMBERED.fullmatch(control)
    if numbered:
        minus, kind, number, side = numbered.groups()
        end = _HAT_ENDS.get((minus, side), " minus" if minus else "")
        return f"{kind} {number}{end}"
    if control.startswith("-"):
        return f"{control_text(control[1:])} minus"
    if "_" in control:
        return control.replace("dpad", "d-pad").replace("_", " ")
    return "+".join(" ".join(word.capitalize() for word in part.split(" ")) for part in control.split("+"))
