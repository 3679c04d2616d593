"""A person drives in the window: what they press is what happens, and what they keep can be proven."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pygame
import pytest
from click.testing import CliRunner
from pygame_gui.elements import UIButton
from sonata2d_cli import main

from sonata2d.collect.session import Session
from sonata2d.datasets.verification import verify
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.window.collect_screen import CollectScreen
from sonata2d.window.hands import Hands

from .fake_devices import PretendPlugs, axis, plugged_in, unplugged
from .volunteer import Person

SCENE: dict[str, Any] = {"room": {"kinds": "square", "side": 6}, "humans": [1, 2], "relations": 0, "tables": 0}


class Desk:
    """A person, the session they drive, and the pads that can be plugged in."""

    def __init__(self, folder: Path, size: tuple[int, int] = (1000, 700), **scene: Any) -> None:
        self.plugs = PretendPlugs()
        self.folder, self._scene = folder, SCENE | scene
        self.person = Person(self._screen, size)

    def _screen(self) -> CollectScreen:
        hands = Hands(plugs=self.plugs)
        self.session = Session(self.folder, "zoe", ScenarioConfig(**self._scene), hands=hands.hands)
        self.screen = CollectScreen(self.session, hands, runs=3)
        return self.screen


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Desk]]:
    monkeypatch.setenv("SONATA2D_CONFIG", str(tmp_path / "config"))
    opened: list[Desk] = []

    def make(**more: Any) -> Desk:
        opened.append(Desk(tmp_path / "runs", **more))
        return opened[-1]

    yield make
    for one in opened:
        one.session._journal.shut()
        one.session._folder._lock.release()
    pygame.quit()


def test_three_runs_kept_discarded_and_driven_again(desk: Callable[..., Desk]) -> None:
    it = desk()
    person, session = it.person, it.session
    person.drive(session)
    assert session.outcome is not None
    assert session.outcome.status == "goal"
    person.press(pygame.K_RETURN)
    assert (session.kept, session.state, session.scene.episode) == (1, "waiting", 1)
    person.drive(session)
    person.press(pygame.K_BACKSPACE)
    assert (session.kept, session.state, session.scene.episode) == (1, "waiting", 2)
    person.drive(session, seconds=1.0)
    person.press(pygame.K_r)
    assert (session.state, session.ticks, session.scene.episode) == ("waiting", 0, 2)
    person.drive(session)
    person.press(pygame.K_RETURN)
    assert session.kept == 2
    person.press(pygame.K_q, mod=pygame.KMOD_CTRL)
    assert person.screen is None
    assert verify(it.folder, replay=True, rerun=True) == []
    assert verify(it.folder / "discarded", replay=True, rerun=True) == []
    assert len(list((it.folder / "discarded").iterdir())) == 2


def test_the_world_waits_for_the_first_input(desk: Callable[..., Desk]) -> None:
    it = desk()
    it.person.wait(1.0)
    it.person.press(pygame.K_v, pygame.K_h, pygame.K_z, pygame.K_PLUS)
    assert (it.session.state, it.session.ticks) == ("waiting", 0)
    it.person.hold(pygame.K_w)
    it.person.wait(1.0)
    assert it.session.state == "driving"
    assert 9 <= it.session.ticks <= 12, "ten ticks a second, whatever the pictures"


def test_keys_drive_and_labels_are_noted(desk: Callable[..., Desk]) -> None:
    it = desk(label={"kind": "classes", "classes": 5, "when": "frame"})
    it.person.press(pygame.K_2)
    it.person.hold(pygame.K_w, pygame.K_a)
    it.person.wait(0.5)
    it.person.press(pygame.K_4)
    it.person.wait(0.5)
    it.person.press(pygame.K_RETURN, pygame.K_RETURN)
    (path,) = it.folder.glob("zoe__*.json")
    record = read_episode(path)
    labels = [label["label"] for label in record.labels]
    assert labels[0] == 2
    assert labels[-1] == 4
    assert record.command[2].tolist() == [1.0, 0.0, 1.5]
    assert verify(it.folder, replay=True, rerun=True) == []


def test_a_run_with_a_question_is_kept_once_it_is_answered(desk: Callable[..., Desk]) -> None:
    it = desk(label={"kind": "slider", "question": "How comfortable was it?"})
    it.person.hold(pygame.K_w)
    it.person.wait(0.5)
    it.person.press(pygame.K_RETURN, pygame.K_RETURN)
    assert (it.session.state, it.session.kept) == ("ended", 0)
    it.person.press(pygame.K_9, pygame.K_PAGEDOWN, pygame.K_RETURN)
    assert it.session.kept == 1
    (path,) = it.folder.glob("zoe__*.json")
    assert read_episode(path).label == pytest.approx(0.95)


def test_a_text_is_typed_and_its_letters_do_nothing_else(desk: Callable[..., Desk]) -> None:
    it = desk(label={"kind": "text", "question": "What was odd?"})
    it.person.hold(pygame.K_w)
    it.person.wait(0.5)
    it.person.hold()
    it.person.press(pygame.K_RETURN)
    for letter in "rn":
        pygame.event.post(pygame.event.Event(pygame.TEXTINPUT, text=letter))
        it.person.press(ord(letter))
    assert it.session.state == "ended"
    it.person.press(pygame.K_RETURN)
    it.person.wait()
    (path,) = it.folder.glob("zoe__*.json")
    assert read_episode(path).label == "rn"


def test_an_unplugged_pad_stops_the_robot_and_pauses(desk: Callable[..., Desk]) -> None:
    it = desk()
    pad = it.plugs.plug()
    pygame.event.post(plugged_in())
    it.person.wait()
    pygame.event.post(axis(pad, "left_y", -1.0))
    it.person.wait(1.0)
    assert it.session.state == "driving"
    assert it.session.after.robot.twist.vx > 0.5
    it.plugs.unplug(pad)
    pygame.event.post(unplugged(pad))
    it.person.wait(1.0)
    ticks = it.session.ticks
    assert it.session.state == "paused"
    it.person.wait(1.0)
    assert it.session.ticks == ticks
    again = it.plugs.plug()
    pygame.event.post(plugged_in())
    it.person.wait()
    pygame.event.post(axis(again, "left_y", -0.9))
    it.person.wait(0.3)
    assert it.session.state == "driving"
    it.person.press(pygame.K_RETURN, pygame.K_RETURN)
    (path,) = it.folder.glob("zoe__*.json")
    events = [event for frame in read_episode(path).frames() for event in frame.snapshot.events]
    assert [(event.device, event.value) for event in events] == [("pad0", -1.0), ("pad0", -0.9)]
    assert verify(it.folder, replay=True, rerun=True) == []


def test_pause_help_and_menu_hold_the_world(desk: Callable[..., Desk]) -> None:
    it = desk()
    for key in (pygame.K_p, pygame.K_F1, pygame.K_ESCAPE, pygame.K_g):
        it.person.hold(pygame.K_w)
        it.person.wait(0.3)
        assert it.session.state == "driving", pygame.key.name(key)
        it.person.hold()
        it.person.press(key)
        ticks = it.session.ticks
        it.person.wait(0.5)
        assert (it.session.state, it.session.ticks) == ("paused", ticks), pygame.key.name(key)
        it.person.press(pygame.K_ESCAPE if key == pygame.K_g else key)


def test_a_window_closed_in_mid_run_loses_nothing(desk: Callable[..., Desk]) -> None:
    it = desk()
    it.person.hold(pygame.K_w)
    it.person.wait(1.5)
    ticks = it.session.ticks
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    it.person.wait()
    assert it.person.screen is None
    again = desk()
    assert again.session.ticks == ticks
    assert again.session.recovered == pytest.approx(ticks * 0.1)


def test_a_slow_window_drops_ticks_and_counts_them(desk: Callable[..., Desk]) -> None:
    it = desk()
    it.person.hold(pygame.K_w)
    it.person.wait(0.5)
    before = it.session.ticks
    it.screen.advance(2.0)
    assert it.session.ticks - before <= 4
    assert it.session.dropped >= 15


def test_the_scene_panel_changes_counts_from_the_next_scene_on(desk: Callable[..., Desk]) -> None:
    it = desk()
    it.person.press(pygame.K_g)
    panel = it.screen._desk._panel
    assert panel is not None
    (plus,) = [button for button, change in panel._changes.items() if change == (panel._rows["humans"], 0, 1)]
    for _ in range(3):
        it.person.click(*plus.rect.center)
    it.person.wait()
    assert (panel._rows["humans"].low, panel._rows["humans"].high) == (4, 4), "the most follows the least"
    it.person.click(*panel._apply.rect.center)
    it.person.wait()
    assert len(it.session.scene.humans) == 4
    assert it.session.state == "waiting"


def test_a_tap_between_two_ticks_is_driven(desk: Callable[..., Desk]) -> None:
    it = desk()
    it.person.hold(pygame.K_w)
    it.person.wait(0.31)
    for _ in range(3):
        it.person.hold(pygame.K_w, pygame.K_a)
        it.person.wait(0.034)
        it.person.hold(pygame.K_w)
        it.person.wait(0.4)
    taps = [e for m in it.session._run.past for e in m.events if e.control == "a"]
    assert [event.value for event in taps] == [1.0, 0.0] * 3


def test_an_answer_outlives_menu_help_and_resizing(desk: Callable[..., Desk]) -> None:
    it = desk(label={"kind": "text", "question": "What was odd?"})
    it.person.hold(pygame.K_w)
    it.person.wait(0.4)
    it.person.hold()
    it.person.press(pygame.K_RETURN)
    for letter in "ox":
        pygame.event.post(pygame.event.Event(pygame.TEXTINPUT, text=letter))
        it.person.press(ord(letter))
    it.person.press(pygame.K_ESCAPE, pygame.K_ESCAPE, pygame.K_F1, pygame.K_ESCAPE)
    pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, size=(1000, 700), w=1000, h=700))
    it.person.wait()
    it.person.click(500, 120)
    for letter in "rn":  # they would drive again, or ask for another scene
        it.person.press(ord(letter))
    assert it.session.state == "ended"
    it.person.press(pygame.K_RETURN)
    it.person.wait()
    (path,) = it.folder.glob("zoe__*.json")
    assert str(read_episode(path).label).startswith("ox")


def test_ctrl_q_closes_from_everywhere_and_loses_nothing(desk: Callable[..., Desk]) -> None:
    for keys in ((pygame.K_g,), (pygame.K_F1,), (pygame.K_ESCAPE,), (pygame.K_k,), ()):
        it = desk(label={"kind": "text"})
        if not keys:
            it.person.hold(pygame.K_w)
            it.person.wait(0.4)
            it.person.press(pygame.K_RETURN)
        it.person.press(*keys)
        it.person.press(pygame.K_q, mod=pygame.KMOD_CTRL)
        it.person.wait(0.1)
        assert it.person.screen is None, keys
    assert desk(label={"kind": "text"}).session.state == "ended", "the run that was left open is there again"


def test_a_key_let_go_of_over_the_panel_is_let_go_of(desk: Callable[..., Desk]) -> None:
    it = desk()
    it.person.hold(pygame.K_SPACE)
    it.person.wait(0.2)
    it.person.press(pygame.K_g)
    it.person.hold()
    it.person.press(pygame.K_ESCAPE)
    it.person.hold(pygame.K_w)
    it.person.wait(1.0)
    assert it.session.after.robot.twist.vx > 0.5


def test_a_stick_on_its_way_back_does_not_end_a_pause(desk: Callable[..., Desk]) -> None:
    it = desk()
    pad = it.plugs.plug()
    pygame.event.post(plugged_in())
    it.person.wait()
    for value, state in ((-1.0, "driving"), (None, "paused"), (-0.9, "paused"), (0.0, "paused"), (-0.5, "driving")):
        if value is None:
            it.person.press(pygame.K_p)
        else:
            pygame.event.post(axis(pad, "left_y", value))
            it.person.wait(0.3)
        assert it.session.state == state, value


def test_controls_are_set_up_between_runs(desk: Callable[..., Desk]) -> None:
    it = desk()
    it.person.hold(pygame.K_w)
    it.person.wait(0.5)
    it.person.press(pygame.K_k)
    assert it.person.screen is it.screen
    assert it.session.state == "paused"


def test_full_screen_where_there_is_none_is_told(desk: Callable[..., Desk], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> None:
        raise pygame.error("That operation is not supported")

    it = desk()
    monkeypatch.setattr(pygame.display, "toggle_fullscreen", refuse)
    it.person.press(pygame.K_F11)
    assert it.person.screen is it.screen
    assert "not supported" in it.screen._notice


def test_when_all_runs_are_kept_it_says_so(desk: Callable[..., Desk]) -> None:
    it = desk()
    for _ in range(3):
        it.person.hold(pygame.K_w)
        it.person.wait(0.4)
        it.person.hold()
        it.person.press(pygame.K_RETURN, pygame.K_RETURN)
    assert it.screen._desk.is_done
    it.person.press(pygame.K_RETURN)
    assert not it.screen._desk.is_done
    it.person.hold(pygame.K_w)
    it.person.wait(0.4)
    assert it.session.state == "driving"


def test_undo_brings_the_run_back_with_its_answer(desk: Callable[..., Desk]) -> None:
    it = desk(label={"kind": "yes_no"})
    it.person.hold(pygame.K_w)
    it.person.wait(0.4)
    it.person.hold()
    it.person.press(pygame.K_RETURN, pygame.K_1, pygame.K_RETURN)
    it.person.press(pygame.K_z, mod=pygame.KMOD_CTRL)
    assert (it.session.state, it.session.kept) == ("ended", 0)
    assert it.screen._desk.label is True, "1 is the first answer, yes"
    texts = [widget.text for widget in it.person.stage.ui.get_sprite_group().sprites() if isinstance(widget, UIButton)]
    assert sorted(texts) == sorted(set(texts)), "no button of an earlier card is left over"
    it.person.press(pygame.K_n, pygame.K_RETURN)
    (path,) = it.folder.glob("zoe__*.json")
    assert read_episode(path).label is False
    told = CliRunner().invoke(main, ["describe", str(it.folder)]).output
    assert "answers to 'label'  1 no" in told


def test_every_size_and_state_is_drawn(desk: Callable[..., Desk]) -> None:
    it = desk(label={"kind": "yes_no", "question": "Was it polite?"})
    for size in ((640, 480), (1600, 900)):
        pygame.display.set_mode(size, pygame.RESIZABLE)
        pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, size=size, w=size[0], h=size[1]))
        for key in (pygame.K_F1, pygame.K_F1, pygame.K_ESCAPE, pygame.K_ESCAPE, pygame.K_g, pygame.K_ESCAPE):
            it.person.press(key)
            assert it.person.stage.size == size
        it.person.drive(it.session, seconds=0.5)
        it.person.press(pygame.K_p, pygame.K_RETURN, pygame.K_RETURN, pygame.K_y)
        it.person.press(pygame.K_BACKSPACE)
