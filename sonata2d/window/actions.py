"""What a person can ask of the window besides driving, by which key or button, and how these are called."""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import StrEnum

import pygame


class Action(StrEnum):
    """What a person can ask of the window; the value is what files say."""

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

    @property
    def level(self) -> int:
        """Which label is asked for, 1 to 9; 0: none in particular."""
        return int(self.value[6:]) if self.value[6:].isdigit() else 0

    @property
    def meaning(self) -> str:
        """In words, for help page and remapping."""
        return f"label {self.level}" if self.level else MEANINGS[self]


MEANINGS: Mapping[Action, str] = {
    Action.CONFIRM: "start / keep the run",
    Action.DISCARD: "discard the run",
    Action.REDO: "redo the same scene",
    Action.NEXT: "another scene",
    Action.UNDO: "undo the last keep",
    Action.PAUSE: "pause",
    Action.MENU: "menu",
    Action.HELP: "help",
    Action.HUD: "show / hide readings",
    Action.VIEW: "switch camera",
    Action.ZONES: "personal space",
    Action.ZOOM_IN: "zoom in",
    Action.ZOOM_OUT: "zoom out",
    Action.LABEL_UP: "label up",
    Action.LABEL_DOWN: "label down",
    Action.SCENE: "scene settings",
    Action.REMAP: "set up the controls",
    Action.FULLSCREEN: "full screen",
    Action.QUIT: "close the window",
}

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
    # a device that SDL has no names for
    "button0": Action.CONFIRM, "button1": Action.DISCARD, "button2": Action.REDO, "button3": Action.NEXT,
    "hat0_y": Action.LABEL_UP, "-hat0_y": Action.LABEL_DOWN,
}  # fmt: skip

# For the help page: keys and buttons as they are unless remapped, and what they do.
KEYS: tuple[tuple[str, str], ...] = (
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
    ("1 to 9", "label k"),
    ("Wheel, Page keys, triggers", "label up, down"),
    ("V, press right stick", "switch camera"),
    ("H, press left stick", "show / hide readings"),
    ("Z", "personal space"),
    ("+ -", "zoom"),
    ("G", "scene settings"),
    ("K", "set up the controls"),
    ("F11", "full screen"),
    ("F12", "picture of the window"),
    ("F1", "this help"),
    ("Esc", "menu"),
    ("Ctrl+Q", "close the window"),
)

_WORDS = {
    "return": "Enter", "enter": "Num Enter", "escape": "Esc", "drag_x": "drag sideways",
    "drag_y": "drag up and down", "wheel_up": "wheel up", "wheel_down": "wheel down",
    "left_x": "left stick sideways", "left_y": "left stick up and down", "right_x": "right stick sideways",
    "right_y": "right stick up and down", "left_stick": "left stick press", "right_stick": "right stick press",
}  # fmt: skip
_NUMBERED = re.compile(r"(-?)(axis|button|hat)(\d+)(?:_([xy]))?")
_HAT_ENDS = {("", "x"): " right", ("-", "x"): " left", ("", "y"): " up", ("-", "y"): " down"}
_FIRST_LETTER, _FIRST_DIGIT = pygame.KSCAN_A, pygame.KSCAN_1


def key_of(event: pygame.Event) -> str:
    """The name of the key that went down or up: `w`, `up`, `space`.

    The row of digits goes by place, since some layouts have other signs there; so do letters of other scripts.
    """
    place = int(getattr(event, "scancode", 0))
    name = pygame.key.name(event.key).lower()
    if _FIRST_DIGIT <= place <= pygame.KSCAN_0 and not name.isdigit():
        return "1234567890"[place - _FIRST_DIGIT]
    if _FIRST_LETTER <= place <= pygame.KSCAN_Z and not (name and name.isascii()):
        return "abcdefghijklmnopqrstuvwxyz"[place - _FIRST_LETTER]
    return name


def with_modifiers(event: pygame.Event) -> str:
    """`key_of`, after `ctrl+` or `alt+` where these are held, so that Ctrl+W does not drive.

    AltGr is neither: it writes signs on many layouts.
    """
    mods = int(getattr(event, "mod", 0))
    ctrl = "ctrl+" if mods & (pygame.KMOD_CTRL | pygame.KMOD_META) else ""
    return ctrl + ("alt+" if mods & pygame.KMOD_LALT else "") + key_of(event)


def action_of(event: pygame.Event, keys: Mapping[str, Action] = KEYBOARD_ACTIONS) -> Action | None:
    """What a key or the mouse's wheel asks for, for a screen without `Hands` (which know pads, and remapped keys)."""
    if event.type == pygame.KEYDOWN:
        return keys.get(with_modifiers(event))
    if event.type == pygame.MOUSEWHEEL and event.y:
        return MOUSE_ACTIONS["wheel_up" if event.y > 0 else "wheel_down"]
    return None


def in_words(control: str) -> str:
    """A control as people call it.

    >>> [in_words(control) for control in ("left_shoulder", "ctrl+z", "-axis3", "hat0_y", "w", "[4]", "page up")]
    ['left shoulder', 'Ctrl+Z', 'axis 3 minus', 'hat 0 up', 'W', 'Num 4', 'Page Up']
    """
    if control in _WORDS:
        return _WORDS[control]
    if len(control) == 1:
        return control.upper()
    if control.startswith("["):
        return f"Num {control[1:-1]}"
    numbered = _NUMBERED.fullmatch(control)
    if numbered:
        minus, kind, number, side = numbered.groups()
        end = _HAT_ENDS.get((minus, side), " minus" if minus else "")
        return f"{kind} {number}{end}"
    if control.startswith("-"):
        return f"{in_words(control[1:])} minus"
    if "_" in control:
        return control.replace("dpad", "d-pad").replace("_", " ")
    return "+".join(" ".join(word.capitalize() for word in part.split(" ")) for part in control.split("+"))
