"""What is clicked and then moved does what was asked, and holds once it is saved."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pygame
import pygame_gui
import pytest

from sonata2d.window.actions import Action
from sonata2d.window.bindings import DIRECTIONS, Target, bound, cleared, in_short, inverted, is_bindable
from sonata2d.window.hands import Hands, Move
from sonata2d.window.profiles import Profile, Profiles
from sonata2d.window.remap import RemapScreen
from sonata2d.window.remap_layout import TARGETS
from sonata2d.window.stage import Stage

from . import fake_devices as p

AHEAD, BACK, LEFT, RIGHT, ASIDE, _, BRAKE = DIRECTIONS


def moved(control: str, value: float = 1.0) -> Move:
    return Move("any", control, value, True)


# Profiles to profiles


def test_a_stick_moved_for_ahead_does_back_the_other_way() -> None:
    profile = bound(Profile.stock("pad"), AHEAD, moved("right_y", -0.8))
    assert profile.hand.read({"right_y": -1.0})["ahead"] == pytest.approx(1.0)
    assert profile.hand.read({"left_y": -1.0})["ahead"] == 0.0  # the stick that did it before does it no more
    assert in_short(profile, AHEAD, named=True) == "right stick up"
    assert in_short(profile, BACK, named=True) == "right stick down"


def test_a_stick_moved_for_back_is_the_same_the_other_way() -> None:
    assert bound(Profile.stock("pad"), BACK, moved("right_y", 0.9)) == bound(
        Profile.stock("pad"), AHEAD, moved("right_y", -0.8)
    )


def test_a_key_joins_the_keys_that_do_it() -> None:
    profile = bound(Profile.stock("keyboard"), AHEAD, moved("i"))
    assert in_short(profile, AHEAD, named=True) == "W, Up, I"


def test_a_control_does_one_thing_only() -> None:
    profile = bound(Profile.stock("keyboard"), AHEAD, moved("n"))
    assert "n" not in profile.actions
    profile = bound(profile, Action.PAUSE, moved("w"))
    assert "w" not in profile.hand.controls
    assert profile.actions["w"] is Action.PAUSE
    profile = bound(Profile.stock("pad"), LEFT, moved("right_trigger"))
    assert "right_trigger" not in profile.actions


def test_both_ends_of_a_hat_can_ask_for_different_things() -> None:
    profile = bound(Profile.stock("pad"), Action.ZOOM_IN, moved("hat0_x", 1.0))
    profile = bound(profile, Action.ZOOM_OUT, moved("hat0_x", -1.0))
    assert in_short(profile, Action.ZOOM_IN, named=False) == "hat 0 right"
    assert in_short(profile, Action.ZOOM_OUT, named=False) == "hat 0 left"


@pytest.mark.parametrize("kind", ["keyboard", "mouse", "pad"])
@pytest.mark.parametrize("target", TARGETS)
def test_what_is_cleared_nothing_does(kind: str, target: Target) -> None:
    profile = cleared(Profile.stock(kind), target)
    assert in_short(profile, target, named=True) == in_short(profile, target, named=False) == ""


def test_clearing_one_way_leaves_the_keys_of_the_other() -> None:
    profile = cleared(Profile.stock("keyboard"), AHEAD)
    assert in_short(profile, BACK, named=True) == "S, Down"


def test_inverting_twice_changes_nothing() -> None:
    stock = Profile.stock("pad")
    once = inverted(stock, "turn")
    assert once.hand.read({"left_x": 1.0})["turn"] == -stock.hand.read({"left_x": 1.0})["turn"] != 0.0
    assert once.hand.read({"left_y": 1.0}) == stock.hand.read({"left_y": 1.0})
    assert inverted(once, "turn") == stock


def test_escape_modifiers_and_small_moves_bind_nothing() -> None:
    assert is_bindable(moved("w"))
    assert is_bindable(moved("left_x", -0.7))
    assert not any(map(is_bindable, (moved("escape"), moved("left ctrl"), moved("left_x", 0.4), moved("w", 0.0))))


# The screen


@pytest.fixture
def stage() -> Iterator[Stage]:
    yield Stage(size=(1000, 700), fps=0)
    pygame.quit()


class Desk:
    """A remapping screen on a stage, and a person in front of it."""

    def __init__(self, stage: Stage, folder: Path) -> None:
        self.stage, self.folder, self.plugs = stage, folder, p.PretendPlugs()
        self.profiles = Profiles(folder)
        self.hands = Hands(self.profiles, self.plugs)
        self.screen = RemapScreen(self.hands, self.profiles, Elsewhere())
        self.screen.enter(stage)

    def does(self, *events: pygame.Event) -> object:
        """Things happen, and a picture is drawn; answers what is shown next."""
        pygame.event.clear()
        for event in events:
            pygame.event.post(event)
        return self.stage.turn(self.screen)

    def press(self, button: object) -> object:
        return self.does(pygame.event.Event(pygame_gui.UI_BUTTON_PRESSED, ui_element=button))

    def row(self, target: Target) -> object:
        return next(row for row in self.screen._widgets.rows if row.target == target)

    def choose(self, target: Target) -> None:
        self.press(self.row(target).bind)  # type: ignore[attr-defined]

    def words(self, target: Target) -> str:
        return str(self.row(target).bind.text)  # type: ignore[attr-defined]


class Elsewhere:
    """The screen to go back to."""

    def enter(self, stage: Stage) -> None: ...

    def handle(self, event: pygame.Event) -> None: ...

    def advance(self, seconds: float) -> Elsewhere:
        return self

    def draw(self, surface: pygame.Surface) -> None: ...

    def leave(self) -> None: ...


@pytest.fixture
def desk(stage: Stage, tmp_path: Path) -> Desk:
    return Desk(stage, tmp_path)


def test_a_key_pressed_after_a_click_is_bound_and_kept(desk: Desk) -> None:
    desk.choose(BRAKE)
    assert desk.words(BRAKE).startswith("press")
    desk.does(p.key(pygame.K_b))
    assert desk.words(BRAKE) == "Space, B"
    assert "b" not in desk.profiles.of("keyboard").hand.controls  # not before it is saved
    desk.press(desk.screen._widgets.save)
    assert "b" in Profiles(desk.folder).of("keyboard").hand.controls
    assert isinstance(desk.press(desk.screen._widgets.back), Elsewhere)


def test_escape_while_it_waits_leaves_all_as_it_was(desk: Desk) -> None:
    desk.choose(AHEAD)
    assert desk.does(p.key(pygame.K_ESCAPE)) is desk.screen
    desk.does(p.key(pygame.K_i))
    assert desk.words(AHEAD) == "W, Up"
    assert isinstance(desk.does(p.key(pygame.K_ESCAPE)), Elsewhere)


def test_leaving_with_changes_takes_a_second_asking(desk: Desk) -> None:
    desk.press(desk.row(AHEAD).clear)  # type: ignore[attr-defined]
    assert desk.words(AHEAD) == "–"
    assert desk.press(desk.screen._widgets.back) is desk.screen
    assert "Not saved" in desk.screen._status
    assert isinstance(desk.press(desk.screen._widgets.back), Elsewhere)
    assert desk.profiles.of("keyboard") == Profile.stock("keyboard")


def test_pads_come_and_go_on_the_screen(desk: Desk) -> None:
    instance = desk.plugs.plug()
    desk.does(p.plugged_in())
    assert [button.text for button in desk.screen._widgets.devices] == ["Keyboard", "Mouse", "Pad"]
    desk.press(desk.screen._widgets.devices[2])
    desk.choose(ASIDE)
    desk.does(p.axis(instance, "right_y", 0.3), p.axis(instance, "right_y", 0.9), p.axis(instance, "left_x", 1.0))
    assert desk.words(ASIDE) == "right stick down"
    desk.plugs.unplug(instance)
    desk.does(p.unplugged(instance))
    assert len(desk.screen._widgets.devices) == 2
    assert desk.words(AHEAD) == "W, Up"


def test_a_click_on_the_device_that_was_just_unplugged_is_harmless(desk: Desk) -> None:
    instance = desk.plugs.plug(p.STICK, named=False)
    desk.does(p.plugged_in())
    desk.press(desk.screen._widgets.devices[2])
    click = pygame.event.Event(pygame_gui.UI_BUTTON_PRESSED, ui_element=desk.row(AHEAD).bind)  # type: ignore[attr-defined]
    desk.plugs.unplug(instance)
    desk.does(p.unplugged(instance), click)
    assert desk.words(AHEAD) == "W, Up"


def test_another_device_than_the_one_on_show_binds_nothing(desk: Desk) -> None:
    instance = desk.plugs.plug()
    desk.does(p.plugged_in())
    desk.choose(AHEAD)
    desk.does(p.button(instance, "a"))
    assert desk.words(AHEAD).startswith("press")


def test_sliders_shape_the_answer_and_reset_undoes_it(desk: Desk) -> None:
    desk.press(desk.screen._widgets.devices[1])
    slider = desk.screen._widgets.dead_zone.slider
    slider.set_current_value(0.25)
    desk.does(pygame.event.Event(pygame_gui.UI_HORIZONTAL_SLIDER_MOVED, ui_element=slider, value=0.25))
    assert desk.screen.profile.hand.dead_zone == pytest.approx(0.25, abs=0.01)
    desk.press(desk.row(LEFT).invert)  # type: ignore[attr-defined]
    assert desk.words(RIGHT) == "drag left"
    desk.press(desk.screen._widgets.reset)
    assert desk.screen.profile == Profile.stock("mouse")


def test_a_folder_that_cannot_be_written_is_told_on_the_screen(stage: Stage, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    desk = Desk(stage, tmp_path / "file")
    desk.press(desk.row(BRAKE).clear)  # type: ignore[attr-defined]
    desk.press(desk.screen._widgets.save)
    assert "cannot be written" in desk.screen._status
    assert "space" not in desk.profiles.of("keyboard").hand.controls  # it holds for this session all the same


def test_nothing_that_was_done_here_drives_afterwards(desk: Desk) -> None:
    desk.does(p.key(pygame.K_w), p.mouse(pygame.MOUSEBUTTONDOWN, 100, 300), p.mouse(pygame.MOUSEMOTION, 100, 200))
    desk.screen.leave()
    assert desk.hands.look() == ()
    assert desk.hands.drag is None


@pytest.mark.parametrize("size", [(1280, 800), (800, 600), (640, 480)])
@pytest.mark.parametrize("device", [0, 1, 2, 3])
def test_it_draws_in_every_size_for_every_device(size: tuple[int, int], device: int, tmp_path: Path) -> None:
    stage = Stage(size=size, fps=0)
    desk = Desk(stage, tmp_path)
    desk.plugs.plug()
    desk.plugs.plug(p.STICK, "Flight stick with a very long name indeed (USB)", named=False)
    desk.does(p.plugged_in())
    desk.press(desk.screen._widgets.devices[device])
    live = desk.screen._places.live
    at_rest = pygame.image.tobytes(stage.surface.subsurface(live), "RGB")
    desk.does(p.key(pygame.K_w), p.axis(1, "left_y", -1.0), p.raw_axis(2, 1, 0.0), p.raw_axis(2, 1, -1.0),
              p.mouse(pygame.MOUSEBUTTONDOWN, 50, live.centery), p.mouse(pygame.MOUSEMOTION, 50, live.top))  # fmt: skip
    assert pygame.image.tobytes(stage.surface.subsurface(live), "RGB") != at_rest
    pygame.quit()
