"""The controls page and the profiles it changes: a click and a key press assign a control, and saving stores it."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import pygame
import pygame_gui
import pytest
from pygame_gui.core import UIElement
from pygame_gui.elements import UIButton, UIHorizontalSlider, UILabel

from sonata2d.window.actions import Action
from sonata2d.window.controls_screen import ControlsScreen
from sonata2d.window.input import InputDevices
from sonata2d.window.profiles import DRIVES, TARGETS, Profile, Profiles, Target, is_assignable
from sonata2d.window.stage import Stage

from . import fake_devices as p
from .volunteer import Person

Widget = TypeVar("Widget", bound=UIElement)
AHEAD, BACK, LEFT, _, SIDEWAYS, _, BRAKE = DRIVES
KEYBOARD, PAD = Profile.default("keyboard"), Profile.default("pad")


# Profiles


def test_a_stick_assigned_to_ahead_drives_back_the_other_way() -> None:
    profile = PAD.assigned(AHEAD, "right_y", -0.8)
    assert profile.mapping.read({"right_y": -1.0})["ahead"] == pytest.approx(1.0)
    assert profile.mapping.read({"left_y": -1.0})["ahead"] == 0.0  # the previous stick is replaced
    assert profile.texts(AHEAD, named=True) == "right stick up"
    assert profile.texts(BACK, named=True) == "right stick down"
    assert profile == PAD.assigned(BACK, "right_y", 0.9)


def test_a_key_is_added_to_the_keys_of_an_action() -> None:
    assert KEYBOARD.assigned(AHEAD, "i", 1.0).texts(AHEAD, named=True) == "W, Up, I"


def test_a_control_does_one_thing_only() -> None:
    profile = KEYBOARD.assigned(AHEAD, "n", 1.0)
    assert "n" not in profile.actions
    profile = profile.assigned(Action.PAUSE, "w", 1.0)
    assert "w" not in profile.mapping.controls
    assert profile.actions["w"] is Action.PAUSE
    assert "right_trigger" not in PAD.assigned(LEFT, "right_trigger", 1.0).actions


def test_both_ends_of_a_hat_request_different_actions() -> None:
    profile = PAD.assigned(Action.ZOOM_IN, "hat0_x", 1.0).assigned(Action.ZOOM_OUT, "hat0_x", -1.0)
    assert profile.texts(Action.ZOOM_IN, named=False) == "hat 0 right"
    assert profile.texts(Action.ZOOM_OUT, named=False) == "hat 0 left"


@pytest.mark.parametrize("kind", ["keyboard", "mouse", "pad"])
@pytest.mark.parametrize("target", TARGETS)
def test_a_cleared_target_has_no_control(kind: str, target: Target) -> None:
    profile = Profile.default(kind).cleared(target)
    assert profile.texts(target, named=True) == profile.texts(target, named=False) == ""


def test_clearing_one_direction_leaves_the_keys_of_the_other() -> None:
    assert KEYBOARD.cleared(AHEAD).texts(BACK, named=True) == "S, Down"


def test_reserved_keys_and_small_moves_are_not_assignable() -> None:
    assert is_assignable("w", 1.0)
    assert is_assignable("left_x", -0.7)
    refused = (("escape", 1.0), ("delete", 1.0), ("left ctrl", 1.0), ("left_x", 0.4), ("w", 0.0))
    assert not any(is_assignable(*move) for move in refused)


# The page


class BackScreen:
    """The screen to return to."""

    def enter(self, stage: Stage) -> None: ...

    def handle(self, event: pygame.Event) -> None: ...

    def advance(self, seconds: float) -> BackScreen:
        return self

    def draw(self, surface: pygame.Surface) -> None: ...

    def leave(self) -> None: ...


class Editor(Person):
    """A person at the controls page."""

    def __init__(self, folder: Path, size: tuple[int, int] = (1000, 700)) -> None:
        self.folder, self.pads, self.profiles = folder, p.FakePads(), Profiles(folder)
        super().__init__(self._make, size)

    def _make(self) -> ControlsScreen:
        self.devices = InputDevices(self.profiles, self.pads)
        self.page = ControlsScreen(self.devices, BackScreen())
        return self.page

    @property
    def is_back(self) -> bool:
        return isinstance(self.screen, BackScreen)

    def post(self, *events: pygame.Event) -> None:
        """Post events and show a frame."""
        for event in events:
            pygame.event.post(event)
        self.wait()

    def plug(self, guid: str = p.XBOX, name: str = "Pad", *, named: bool = True) -> int:
        """Connect a pad; returns its instance."""
        instance = self.pads.plug(guid, name, named=named)
        self.post(p.plugged_in())
        return instance

    def widgets(self, kind: type[Widget]) -> list[Widget]:
        """The widgets of a kind on show."""
        return [widget for widget in self.stage.ui.get_sprite_group().sprites() if isinstance(widget, kind)]

    def row(self, target: Target) -> UIButton:
        """The button beside the text of a target."""
        (label,) = [label for label in self.widgets(UILabel) if label.text == target.text]
        line = [button for button in self.widgets(UIButton) if button.rect.top == label.rect.top]
        return min((button for button in line if button.rect.left >= label.rect.right), key=lambda b: b.rect.left)

    def choose(self, target: Target) -> None:
        """Push the button of a target, even if it is scrolled out of view."""
        self.row(target).on_self_event(pygame_gui.UI_BUTTON_PRESSED)
        self.wait()

    def text(self, target: Target) -> str:
        return str(self.row(target).text)

    @property
    def tabs(self) -> list[str]:
        """Names of the devices that can be chosen, from left to right."""
        top = self.buttons["Keyboard"].top
        return [name for name, rect in self.buttons.items() if rect.top == top]


@pytest.fixture
def editor(tmp_path: Path) -> Editor:
    return Editor(tmp_path)


def test_a_key_pressed_after_a_click_is_assigned_and_saved(editor: Editor) -> None:
    editor.click(*editor.row(BRAKE).rect.center)
    assert editor.text(BRAKE).startswith("press")
    editor.post(p.key(pygame.K_b))
    assert editor.text(BRAKE) == "Space, B"
    assert "b" not in editor.profiles.of("keyboard").mapping.controls  # not before it is saved
    editor.push("Save")
    assert "b" in Profiles(editor.folder).of("keyboard").mapping.controls
    assert editor.is_back


def test_escape_while_waiting_changes_nothing(editor: Editor) -> None:
    editor.choose(AHEAD)
    editor.post(p.key(pygame.K_ESCAPE))
    assert editor.screen is editor.page
    editor.post(p.key(pygame.K_i))
    assert editor.text(AHEAD) == "W, Up"
    editor.post(p.key(pygame.K_ESCAPE))
    assert editor.is_back


def test_unsaved_changes_are_dropped_at_the_second_request(editor: Editor) -> None:
    editor.choose(AHEAD)
    editor.post(p.key(pygame.K_DELETE))
    assert editor.text(AHEAD) == "–"
    editor.push("Cancel")
    assert editor.screen is editor.page
    assert "Not saved" in editor.page.status
    editor.push("Cancel")
    assert editor.is_back
    assert editor.profiles.of("keyboard") == KEYBOARD


def test_pads_appear_and_disappear_on_the_page(editor: Editor) -> None:
    instance = editor.plug()
    assert editor.tabs == ["Keyboard", "Mouse", "Pad"]
    editor.push("Pad")
    editor.choose(SIDEWAYS)
    editor.post(p.axis(instance, "right_y", 0.3), p.axis(instance, "right_y", 0.9), p.axis(instance, "left_x", 1.0))
    assert editor.text(SIDEWAYS) == "right stick down"
    editor.pads.unplug(instance)
    editor.post(p.unplugged(instance))
    assert editor.tabs == ["Keyboard", "Mouse"]
    assert editor.text(AHEAD) == "W, Up"


def test_a_click_for_a_device_that_was_just_disconnected_is_harmless(editor: Editor) -> None:
    instance = editor.plug(p.STICK, named=False)
    editor.push(editor.tabs[2])
    editor.pads.unplug(instance)
    editor.page.handle(p.unplugged(instance))
    editor.choose(AHEAD)
    assert editor.text(AHEAD) == "W, Up"


def test_a_device_that_is_not_on_show_assigns_nothing(editor: Editor) -> None:
    instance = editor.plug()
    editor.choose(AHEAD)
    editor.post(p.button(instance, "a"))
    assert editor.text(AHEAD).startswith("press")


def test_sliders_change_the_mapping_and_reset_restores_the_defaults(editor: Editor) -> None:
    editor.push("Mouse")
    slider = min(editor.widgets(UIHorizontalSlider), key=lambda slider: slider.rect.left)  # the dead zone's
    slider.set_current_value(0.25)
    editor.post(pygame.event.Event(pygame_gui.UI_HORIZONTAL_SLIDER_MOVED, ui_element=slider, value=0.25))
    assert editor.page.profile.mapping.dead_zone == pytest.approx(0.25, abs=0.01)
    editor.push("Reset")
    assert editor.page.profile == Profile.default("mouse")


def test_a_folder_that_cannot_be_written_is_reported_on_the_page(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    editor = Editor(tmp_path / "file")
    editor.choose(BRAKE)
    editor.post(p.key(pygame.K_DELETE))
    editor.push("Save")
    assert "cannot be written" in editor.page.status
    assert "space" not in editor.profiles.of("keyboard").mapping.controls  # the change holds for this session


def test_input_on_the_page_does_not_drive_afterwards(editor: Editor) -> None:
    editor.post(p.key(pygame.K_w), p.mouse(pygame.MOUSEBUTTONDOWN, 100, 300), p.mouse(pygame.MOUSEMOTION, 100, 200))
    editor.page.leave()
    assert editor.devices.poll() == ()
    assert editor.devices.joystick is None


@pytest.mark.parametrize("size", [(1280, 800), (800, 600), (640, 480)])
@pytest.mark.parametrize("device", [0, 1, 2, 3])
def test_the_page_fits_every_size_for_every_device(size: tuple[int, int], device: int, tmp_path: Path) -> None:
    editor = Editor(tmp_path, size)
    editor.plug()
    editor.plug(p.STICK, "Flight stick with a very long name indeed (USB)", named=False)
    editor.push(editor.tabs[device])
    window, buttons = editor.stage.surface.get_rect(), editor.buttons
    assert all(window.contains(buttons[name]) for name in (*editor.tabs, "Reset", "Save", "Cancel"))
    rows = [editor.row(target).rect for target in TARGETS]
    assert all(window.left < rect.left and rect.right < window.right for rect in rows)
    assert editor.text(TARGETS[0])
    editor.choose(BRAKE)
    assert editor.text(BRAKE).startswith("press")
