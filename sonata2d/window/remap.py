"""The screen on which a person sets up the controls: what each one does, dead zone and curve."""

from __future__ import annotations

from dataclasses import replace

import pygame
import pygame_gui

from ..view.fonts import rendered, shortened
from ..view.palette import FLOOR, INK, PAPER
from .bindings import Direction, Target, bound, cleared, in_short, inverted, is_bindable
from .hands import Device, Hands, Move
from .profiles import Profile, Profiles
from .remap_layout import MOST_DEAD_ZONE, Places, Row, Widgets, places_for, widgets_for
from .remap_picture import DevicePicture, sticks_of
from .stage import Screen, Stage

_HINT = "Click what you want to set, then press or move a control."
_WAITS = "Press or move the control for: {}. Esc leaves it as it is."
_UNSAVED = "Not saved yet. Back once more leaves all as it was."


class RemapScreen:
    """Set up keyboard, mouse and pads; nothing holds before it is saved.

    Runs that are under way are driven as they began: enter between runs, or make the controller anew.

    Args:
        hands: what the person has.
        profiles: where it is kept.
        back: the screen to go back to.
    """

    def __init__(self, hands: Hands, profiles: Profiles, back: Screen) -> None:
        self._hands, self._profiles, self._back = hands, profiles, back
        self._drafts: dict[str, Profile] = {}  # by key of the device: what is not saved yet
        self._values: dict[str, dict[str, float]] = {}  # by slot: where controls stand
        self._slot = "keyboard"
        self._waiting: Target | None = None
        self._leaves = self._was_warned = False
        self._devices: list[Device] = []

    # As a screen

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        self._hands.release()
        self._leaves = self._was_warned = False
        self._build()

    def handle(self, event: pygame.Event) -> None:
        if event.type == pygame.QUIT:  # the screen behind puts away what must not be lost
            self._leaves = True
            pygame.event.post(event)
        elif event.type == pygame_gui.UI_BUTTON_PRESSED:
            self._pressed(event.ui_element)
        elif event.type == pygame_gui.UI_HORIZONTAL_SLIDER_MOVED:
            self._slid()
        elif event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE:
            if self._waiting is None:
                self._go_back()
            self._wait_for(None)
        else:
            for move in self._hands.moves(event, self._stage.size):
                self._moved(move)

    def advance(self, seconds: float) -> Screen | None:
        if self._hands.devices() != self._devices:
            self._build()
        return self._back if self._leaves else self

    def draw(self, surface: pygame.Surface) -> None:
        surface.fill(FLOOR)
        box, gap, is_named = self._places.live, self._places.gap, self._is_named
        pygame.draw.rect(surface, PAPER, box, border_radius=8)
        values, sticks, size = (
            self._values.get(self._slot, {}),
            sticks_of(self._slot, is_named),
            round(self._places.row * 0.55),
        )
        picture = DevicePicture(surface, self.profile.hand, values, sticks, is_named, size)
        picture.draw(box.inflate(-2 * gap, -2 * gap))
        place = self._places.status
        line = rendered(shortened(self._status, place.width, size), size, INK)
        surface.blit(line, line.get_rect(midleft=(place.left + 8, place.centery)))

    def leave(self) -> None:
        self._hands.release()

    # What it shows

    @property
    def profile(self) -> Profile:
        """Of the device on show, as it was changed here."""
        return self._drafts.get(self._key) or self._profiles.of(self._key)

    @property
    def _key(self) -> str:
        return self._hands.key(self._slot)

    @property
    def _is_named(self) -> bool:
        return self._hands.is_named(self._slot)

    def _build(self) -> None:
        """All widgets anew: for another size, another device, or a device that came or went."""
        self._devices = self._hands.devices()
        slots = [device.slot for device in self._devices]
        if self._slot not in slots:
            self._slot, self._waiting = slots[0], None
        stage = self._stage
        stage.ui.clear_and_reset()
        self._places: Places = places_for(stage.size, stage.scale)
        names = [device.name for device in self._devices]
        self._widgets: Widgets = widgets_for(stage.ui, self._places, names, slots.index(self._slot))
        self._set_sliders()
        self._tell(_WAITS.format(self._waiting.meaning) if self._waiting else _HINT)

    def _tell(self, status: str) -> None:
        """Let the widgets say how things are."""
        for row in self._widgets.rows:
            waits = row.target == self._waiting
            words = "press or move …" if waits else in_short(self.profile, row.target, named=self._is_named) or "–"
            if row.bind.text != words:  # a button is slow to change
                row.bind.change_object_id("#waiting" if waits else "#bind")
                row.bind.set_text(words)
        hand = self.profile.hand
        self._widgets.dead_zone.words.set_text(f"Dead zone  {hand.dead_zone:.2f}")
        self._widgets.curve.words.set_text(f"Curve  {hand.curve:.2f}")
        self._status = status

    def _set_sliders(self) -> None:
        hand = self.profile.hand
        self._widgets.dead_zone.slider.set_current_value(min(hand.dead_zone, MOST_DEAD_ZONE))
        self._widgets.curve.slider.set_current_value(hand.curve)
        if not sticks_of(self._slot, self._is_named):  # keys are all or nothing
            self._widgets.dead_zone.slider.disable()
            self._widgets.curve.slider.disable()

    # What a person does

    def _pressed(self, button: object) -> None:
        """A button of the screen."""
        widgets = self._widgets
        if button is widgets.reset:
            self._change(Profile.stock(self._key), "As it is unless set up. Not saved yet.")
            self._set_sliders()
        elif button is widgets.save:
            self._save()
        elif button is widgets.back:
            self._go_back()
        elif button in widgets.devices:
            self._slot, self._waiting = self._devices[widgets.devices.index(button)].slot, None
            self._build()
        for row in widgets.rows:
            self._pressed_in(row, button)

    def _pressed_in(self, row: Row, button: object) -> None:
        if button is row.bind:
            self._wait_for(row.target)
        elif button is row.clear:
            self._change(cleared(self.profile, row.target), f"Nothing does this now: {row.target.meaning}.")
        elif button is row.invert and isinstance(row.target, Direction):
            self._change(inverted(self.profile, row.target.axis), f"The other way round now: {row.target.meaning}.")

    def _wait_for(self, target: Target | None) -> None:
        """The next control that is moved will do this; None: no longer."""
        self._waiting = target
        if not self._leaves:
            self._tell(_WAITS.format(target.meaning) if target else _UNSAVED if self._was_warned else _HINT)

    def _moved(self, move: Move) -> None:
        """A control stands elsewhere; if one was waited for, it is this one."""
        self._values.setdefault(move.slot, {})[move.control] = move.value
        if self._waiting and move.slot == self._slot and is_bindable(move):
            target, self._waiting = self._waiting, None
            self._change(bound(self.profile, target, move), f"Set: {target.meaning}. Not saved yet.")

    def _slid(self) -> None:
        dead_zone = self._widgets.dead_zone.slider.get_current_value()
        curve = self._widgets.curve.slider.get_current_value()
        hand = replace(self.profile.hand, dead_zone=round(dead_zone, 2), curve=round(curve, 2))
        self._change(replace(self.profile, hand=hand), "Not saved yet.")

    def _change(self, profile: Profile, status: str) -> None:
        self._drafts[self._key], self._was_warned = profile, False
        self._waiting = None
        self._tell(status)

    def _save(self) -> None:
        for key, profile in self._drafts.items():
            self._profiles.put(key, profile)
        kept = self._profiles.save()
        self._drafts.clear()
        self._tell("Saved." if kept else f"Holds for now, but: {self._profiles.notice}")

    def _go_back(self) -> None:
        """Leave; what is not saved is dropped only if asked twice."""
        self._leaves = not self._drafts or self._was_warned
        self._was_warned = True
        if self._leaves:
            self._drafts.clear()
        else:
            self._tell(_UNSAVED)
