"""Where things are on the screen that sets up the controls, and its widgets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple
from warnings import catch_warnings, simplefilter

import pygame
from pygame_gui import UIManager
from pygame_gui.elements import UIButton, UIHorizontalSlider, UILabel, UIScrollingContainer

from .actions import Action
from .bindings import DIRECTIONS, Direction, Target

TARGETS: tuple[Target, ...] = (*DIRECTIONS, *(action for action in Action if action is not Action.MENU))  # Esc stays
MOST_DEAD_ZONE = 0.5
_LEFT = {"text_horiz_alignment": "left", "text_horiz_alignment_padding": "8"}
_CHOSEN = {"normal_bg": "#0072B2", "hovered_bg": "#0072B2", "normal_text": "#FFFFFF", "hovered_text": "#FFFFFF"}
_WAITING = {"normal_bg": "#FFF3D6", "hovered_bg": "#FFF3D6", "normal_border": "#E69F00", "hovered_border": "#E69F00"}


class Places(NamedTuple):
    """Boxes of the screen's parts, pixels."""

    title: pygame.Rect
    devices: pygame.Rect
    live: pygame.Rect  # the panel in which the device is drawn
    sliders: pygame.Rect
    rows: pygame.Rect
    status: pygame.Rect
    buttons: pygame.Rect
    row: int  # height of a line of widgets
    gap: int


def places_for(size: tuple[int, int], scale: float) -> Places:
    """The boxes for a window of so many pixels."""
    width, height = size
    gap, row = round(16 * scale), max(round(36 * scale), 30)
    left = round(width * 0.38)
    top = gap + 2 * row + 2 * gap
    bottom = height - 2 * gap - row
    sliders = pygame.Rect(gap, bottom - 2 * row - gap // 2, left, 2 * row + gap // 2)
    buttons = pygame.Rect(0, 0, round(width * 0.45), row)
    buttons.bottomright = width - gap, height - gap
    return Places(
        title=pygame.Rect(gap, gap, width - 2 * gap, row),
        devices=pygame.Rect(gap, gap + row + gap // 2, width - 2 * gap, row),
        live=pygame.Rect(gap, top, left, sliders.top - gap - top),
        sliders=sliders,
        rows=pygame.Rect(left + 2 * gap, top, width - left - 3 * gap, bottom - top),
        status=pygame.Rect(gap, height - gap - row, buttons.left - 2 * gap, row),
        buttons=buttons,
        row=row,
        gap=gap,
    )


class Row(NamedTuple):
    """One thing a control can do, and the buttons that change by what."""

    target: Target
    bind: UIButton
    clear: UIButton
    invert: UIButton | None


class Slider(NamedTuple):
    """A slider and the line that tells what it says."""

    words: UILabel
    slider: UIHorizontalSlider


class Widgets(NamedTuple):
    """All widgets of the screen that do something."""

    devices: list[UIButton]
    rows: list[Row]
    dead_zone: Slider
    curve: Slider
    reset: UIButton
    save: UIButton
    back: UIButton


def widgets_for(ui: UIManager, places: Places, devices: Sequence[str], chosen: int) -> Widgets:
    """Make the widgets.

    Args:
        devices: their names; number `chosen` is the one on show.
    """
    ui.get_theme().load_theme(_theme(places.row))
    UILabel(places.title, "Set up the controls", ui, object_id="#title")
    reset, save, back = _side_by_side(ui, places.buttons, ("Reset", "Save", "Back"), places.gap)
    return Widgets(
        devices=_side_by_side(ui, places.devices, devices, places.gap, chosen),
        rows=_rows(ui, places),
        dead_zone=_slider(ui, places, 0, MOST_DEAD_ZONE),
        curve=_slider(ui, places, 1, 1.0),
        reset=reset,
        save=save,
        back=back,
    )


def _theme(row: int) -> dict[str, Any]:
    """What the window's own theme does not say, for lines so high."""
    title = {"name": "noto_sans", "size": str(round(row * 0.62)), "bold": "1"}
    heading = {"name": "noto_sans", "size": str(round(row * 0.45)), "bold": "1"}
    return {
        "#words": {"misc": _LEFT},
        "#title": {"misc": _LEFT, "font": title},
        "#heading": {"misc": _LEFT, "font": heading},
        "#bind": {"misc": _LEFT},
        "#waiting": {"misc": _LEFT, "colours": _WAITING},
        "#chosen": {"colours": _CHOSEN},
        "horizontal_slider": {"colours": {"disabled_dark_bg": "#F0F0F0"}},
    }


def _side_by_side(
    ui: UIManager, box: pygame.Rect, names: Sequence[str], gap: int, chosen: int | None = None
) -> list[UIButton]:
    """Buttons of one width, no wider than a quarter of the window."""
    width = min((box.width - gap * (len(names) - 1)) // len(names), ui.window_resolution[0] // 4)
    boxes = [pygame.Rect(box.left + k * (width + gap), box.top, width, box.height) for k in range(len(names))]
    ids = ["#chosen" if k == chosen else None for k in range(len(names))]
    return [UIButton(b, name, ui, object_id=i) for b, name, i in zip(boxes, names, ids, strict=True)]


def _slider(ui: UIManager, places: Places, number: int, most: float) -> Slider:
    box = places.sliders.move(0, number * (places.row + places.gap // 2))
    words = pygame.Rect(box.left, box.top, round(4.2 * places.row), places.row)
    slider = pygame.Rect(words.right, box.top, box.right - words.right, places.row)
    return Slider(
        UILabel(words, "", ui, object_id="#words"),
        UIHorizontalSlider(slider, 0.0, (0.0, most), ui, click_increment=0.01),
    )


def _rows(ui: UIManager, places: Places) -> list[Row]:
    """A line for each thing a control can do, in a list that scrolls, under two headings."""
    holder = UIScrollingContainer(places.rows, ui, allow_scroll_x=False)
    width, step = places.rows.width - 26, places.row + 4
    holder.set_scrollable_area_dimensions((width, step * (len(TARGETS) + 2)))
    rows = []
    for k, target in enumerate(TARGETS):
        line = k + (1 if isinstance(target, Direction) else 2)
        if k in (0, len(DIRECTIONS)):
            heading = pygame.Rect(0, (line - 1) * step, width, places.row)
            words = "Ask of the window" if k else "Drive"
            UILabel(heading, words, ui, container=holder, object_id="#heading")
        rows.append(_row(ui, holder, target, pygame.Rect(0, line * step, width, places.row)))
    return rows


def _row(ui: UIManager, holder: UIScrollingContainer, target: Target, box: pygame.Rect) -> Row:
    h = box.height
    can_invert = isinstance(target, Direction) and target.way > 0 and target.axis != "brake"
    is_narrow = box.width < 12 * h
    words = pygame.Rect(box.left, box.top, min(5 * h + 4, box.width // 2), h)
    clear = pygame.Rect(box.right - h, box.top, h, h)
    invert = clear.move(-h - 4, 0) if is_narrow else pygame.Rect(clear.left - 4 - 2 * h, box.top, 2 * h, h)
    bind = pygame.Rect(words.right, box.top, (invert if can_invert else clear).left - 4 - words.right, h)
    with catch_warnings():
        simplefilter("ignore", UserWarning)  # in a very narrow window some words are cut
        UILabel(words, target.meaning, ui, container=holder, object_id="#words")
    turn = "±" if is_narrow else "invert"
    return Row(
        target,
        UIButton(bind, "", ui, container=holder, object_id="#bind"),
        UIButton(clear, "×", ui, container=holder, tool_tip_text="nothing does this"),
        UIButton(invert, turn, ui, container=holder, tool_tip_text="the other way round") if can_invert else None,
    )
