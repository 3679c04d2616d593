"""Actions that a driver requests with a key or button besides driving, and names of keys."""

from __future__ import annotations

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
