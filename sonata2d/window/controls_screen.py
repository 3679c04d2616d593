"""The page that sets up the controls: a list of actions with their controls, dead zone and curve."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UIHorizontalSlider, UILabel, UIScrollingContainer

from ..collect.texts import text
from ..view.palette import FLOOR
from .input import KEYBOARD, Device, InputDevices, Move
from .profiles import TARGETS, Profile, Target, is_assignable
from .stage import Screen, Stage
from .widgets import SMALL, ButtonSpec, button_row, fitted, text_size, write

_MAX_DEAD_ZONE = 0.5
_TWO_COLUMNS = 900  # px at scale 1, smallest window width for two columns


class ControlsScreen:
    """Assigns keys, buttons and sticks to actions; changes take effect when they are saved.

    A run in progress keeps the mapping it began with, so open this page between runs.

    Args:
        devices: keyboard, mouse and pads.
        back: screen to return to.

    Attributes:
        status: the message on show: what to do, or what was done.
    """

    def __init__(self, devices: InputDevices, back: Screen) -> None:
        self._input, self._back = devices, back
        self._drafts: dict[str, Profile] = {}  # by key of the device: changes that are not saved
        self._slot = KEYBOARD
        self._waiting: Target | None = None
        self._leaving = self._was_warned = False
        self._devices: list[Device] = []

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        self._input.release()
        self._leaving = self._was_warned = False
        self._build()

    def handle(self, event: pygame.Event) -> None:
        is_key = event.type == pygame.KEYDOWN
        if event.type == pygame.QUIT:  # the screen behind this one saves what must not be lost
            self._leaving = True
            pygame.event.post(event)
        elif event.type == pygame_gui.UI_HORIZONTAL_SLIDER_MOVED:
            self._shape()
        elif is_key and event.key == pygame.K_ESCAPE:
            if self._waiting is None:
                self._cancel()
            else:
                self._wait_for(None)
        elif is_key and event.key == pygame.K_DELETE and self._waiting is not None:
            self._change(self.profile.cleared(self._waiting), text("controls.none", action=self._waiting.text))
        else:
            for move in self._input.moves(event, self._stage.size):
                self._assign(move)

    def advance(self, seconds: float) -> Screen | None:
        if self._input.devices() != self._devices:  # a pad was connected or disconnected
            self._build()
        return self._back if self._leaving else self

    def draw(self, surface: pygame.Surface) -> None:
        surface.fill(FLOOR)
        box, size = self._status_box, text_size(SMALL, self._stage.scale)
        write(surface, self.status, (box.left + 8, box.centery), size=size, max_width=box.width - 8)

    def leave(self) -> None:
        self._input.release()

    @property
    def profile(self) -> Profile:
        """Profile of the device on show, with the changes made here."""
        return self._drafts.get(self._key) or self._input.profiles.of(self._key)

    @property
    def _key(self) -> str:
        return self._input.profile_key(self._slot)

    # Widgets

    def _build(self) -> None:
        """Create all widgets for the window's size, the device on show and the connected devices."""
        self._devices = self._input.devices()
        slots = [device.slot for device in self._devices]
        if self._slot not in slots:
            self._slot, self._waiting = KEYBOARD, None
        ui, (width, height) = self._stage.ui, self._stage.size
        gap, row = round(16 * self._stage.scale), max(round(34 * self._stage.scale), 28)
        inner = width - 2 * gap
        ui.clear_and_reset()
        UILabel(pygame.Rect(gap, gap // 2, inner, row), text("controls.title"), ui, object_id="#title")
        tabs = pygame.Rect(gap, gap + row, min(inner, inner * len(slots) // 4), row)
        specs: list[ButtonSpec] = [(device.name, partial(self._show, device.slot), "") for device in self._devices]
        self._tabs = button_row(ui, tabs, specs, equal=True)
        self._tabs[slots.index(self._slot)].select()
        buttons = pygame.Rect(0, height - gap - row, round(width * 0.45), row)
        buttons.right = gap + inner
        specs = [
            (text("controls.reset"), self._reset, text("controls.reset_tip")),
            (text("controls.save"), self._save, ""),
            (text("controls.cancel"), self._cancel, text("controls.cancel_tip")),
        ]
        self._reset_button, self._save_button, self._cancel_button = button_row(ui, buttons, specs, equal=True)
        self._status_box = tabs.move(0, row)
        self._status_box.width = inner
        sliders = pygame.Rect(gap, buttons.top - row - gap // 2, (inner - gap) // 2, row)
        self._dead_zone = self._slider(sliders, _MAX_DEAD_ZONE)
        self._curve = self._slider(sliders.move(sliders.width + gap, 0), 1.0)
        top = self._status_box.bottom + gap // 2
        self._build_list(pygame.Rect(gap, top, inner, sliders.top - gap - top))
        self._set_sliders()
        self._refresh(self._waiting_text(self._waiting) if self._waiting else text("controls.hint"))

    def _build_list(self, box: pygame.Rect) -> None:
        """One line per action, in one or two columns: its text, and a button with its controls."""
        ui, pitch = self._stage.ui, max(round(32 * self._stage.scale), 26)
        columns = 2 if box.width >= _TWO_COLUMNS * self._stage.scale else 1
        lines, width = -(-len(TARGETS) // columns), box.width - 24  # room for the scroll bar
        area = UIScrollingContainer(box, ui, allow_scroll_x=False)
        area.set_scrollable_area_dimensions((width, lines * pitch))
        self._rows: dict[Target, UIButton] = {}
        for k, target in enumerate(TARGETS):
            place = pygame.Rect(
                k // lines * width // columns, k % lines * pitch, 0, pitch - round(4 * self._stage.scale)
            )
            place.width = round(0.36 * width / columns)
            UILabel(place, fitted(ui, target.text, place.width - 12), ui, container=area, object_id="#control")
            place = pygame.Rect(place.right, place.top, round(0.6 * width / columns), place.height)
            command = partial(self._wait_for, target)
            self._rows[target] = UIButton(place, "", ui, container=area, object_id="#control", command=command)

    def _slider(self, box: pygame.Rect, maximum: float) -> tuple[UILabel, UIHorizontalSlider]:
        """A label and its slider from 0 to a maximum."""
        label = pygame.Rect(box.left, box.top, round(4.2 * box.height), box.height)
        place = pygame.Rect(label.right, box.top, box.right - label.right, box.height)
        slider = UIHorizontalSlider(place, 0.0, (0.0, maximum), self._stage.ui, click_increment=0.01)
        return UILabel(label, "", self._stage.ui, object_id="#control"), slider

    def _set_sliders(self) -> None:
        (_, dead_zone), (_, curve), mapping = self._dead_zone, self._curve, self.profile.mapping
        dead_zone.set_current_value(min(mapping.dead_zone, _MAX_DEAD_ZONE))
        curve.set_current_value(mapping.curve)
        if self._slot == KEYBOARD:  # keys have no range
            dead_zone.disable()
            curve.disable()

    def _refresh(self, status: str) -> None:
        """Show the current assignments and a message."""
        self.status, is_named = status, self._input.is_named(self._slot)
        for target, button in self._rows.items():
            is_waiting = target == self._waiting
            controls = self.profile.texts(target, named=is_named) or text("controls.nothing")
            words = text("controls.press") if is_waiting else controls
            words = fitted(self._stage.ui, words, button.rect.width - 8)
            if button.text != words:  # rebuilding a button is slow
                button.set_text(words)
            if is_waiting:
                button.select()
            elif button.is_selected:
                button.unselect()
        self._dead_zone[0].set_text(text("controls.dead_zone", value=f"{self.profile.mapping.dead_zone:.2f}"))
        self._curve[0].set_text(text("controls.curve", value=f"{self.profile.mapping.curve:.2f}"))

    # Input of the driver

    def _show(self, slot: str) -> None:
        """Show another device."""
        self._slot, self._waiting = slot, None
        self._build()

    def _wait_for(self, target: Target | None) -> None:
        """Assign the next control that is moved to a target; None stops waiting."""
        self._waiting = target
        if target is not None:
            self._refresh(self._waiting_text(target))
        else:
            self._refresh(text("controls.unsaved" if self._was_warned else "controls.hint"))

    @staticmethod
    def _waiting_text(target: Target) -> str:
        return text("controls.waiting", action=target.text)

    def _assign(self, move: Move) -> None:
        """Assign a moved control of the device on show to the target that waits for it."""
        if self._waiting and move.slot == self._slot and is_assignable(move.control, move.value):
            target = self._waiting
            status = text("controls.set", action=target.text)
            self._change(self.profile.assigned(target, move.control, move.value), status)

    def _shape(self) -> None:
        """Take over the values of the sliders."""
        dead_zone, curve = (slider.get_current_value() for _, slider in (self._dead_zone, self._curve))
        mapping = replace(self.profile.mapping, dead_zone=round(dead_zone, 2), curve=round(curve, 2))
        self._change(replace(self.profile, mapping=mapping), text("controls.shaped"))

    def _change(self, profile: Profile, status: str) -> None:
        self._drafts[self._key], self._was_warned, self._waiting = profile, False, None
        self._refresh(status)

    def _reset(self) -> None:
        self._change(Profile.default(self._key), text("controls.reset_done"))
        self._set_sliders()

    def _save(self) -> None:
        """Save and return; if the file cannot be written, the changes hold for this session."""
        for key, profile in self._drafts.items():
            self._input.profiles.put(key, profile)
        self._drafts.clear()
        if self._input.profiles.save():
            self._leaving = True
        else:
            self._refresh(text("controls.not_stored", problem=self._input.profiles.notice))

    def _cancel(self) -> None:
        """Return without saving; unsaved changes are dropped only at the second request."""
        self._leaving = not self._drafts or self._was_warned
        self._was_warned = True
        if self._leaving:
            self._drafts.clear()
        else:
            self._refresh(text("controls.unsaved"))
