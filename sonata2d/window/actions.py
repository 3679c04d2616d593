"""Actions that a driver requests with a key or button besides driving, their default controls, and names of keys."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

import pygame


class Action(StrEnum):
    """A request to the window; the value is its name in the file of controls."""

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
    FULLSCREEN = "fullscreen"
    QUIT = "quit"
    NEW_PERSON = "new_person"

    @property
    def level(self) -> int:
        """Number of the requested label, 1 to 9; 0 for all other actions."""
        return int(self.value[6:]) if self.value[6:].isdigit() else 0


KEYBOARD_ACTIONS: Mapping[str, Action] = {
    "return": Action.CONFIRM, "enter": Action.CONFIRM, "backspace": Action.DISCARD, "r": Action.REDO,
    "n": Action.NEXT, "ctrl+z": Action.UNDO, "p": Action.PAUSE, "escape": Action.MENU, "f1": Action.HELP,
    "h": Action.HUD, "v": Action.VIEW, "z": Action.ZONES, "+": Action.ZOOM_IN, "=": Action.ZOOM_IN,
    "[+]": Action.ZOOM_IN, "-": Action.ZOOM_OUT, "[-]": Action.ZOOM_OUT, "page up": Action.LABEL_UP,
    "page down": Action.LABEL_DOWN, "g": Action.SCENE, "f11": Action.FULLSCREEN,
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
