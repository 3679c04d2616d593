"""The driving screen: keys and pads drive, runs are kept, discarded and undone, and kept runs verify."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pygame
import pytest
from click.testing import CliRunner
from pygame_gui.elements import UIButton
from sonata2d_cli import main

from sonata2d.datasets import verify
from sonata2d.record.reader import read_episode
from sonata2d.view.painter import Painter
from sonata2d.view.projection import Camera
from sonata2d.window.collect_screen import CollectScreen
from sonata2d.window.hud import Hud, free_area
from sonata2d.window.input import InputDevices
from sonata2d.window.name_screen import NameScreen

from .conftest import Line
from .driver import PASSERS, Driver
from .fake_devices import unplugged

TEXT = {"kind": "text", "question": "What was odd?"}


def test_runs_are_kept_discarded_and_redone(driver: Callable[..., Driver]) -> None:
    person = driver()
    session = person.session
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
    assert verify(person.folder, replay=True, rerun=True) == []
    assert verify(person.folder / "discarded", replay=True, rerun=True) == []
    assert len(list((person.folder / "discarded").iterdir())) == 2


def test_the_world_waits_for_the_first_input(driver: Callable[..., Driver]) -> None:
    person = driver()
    person.wait(1.0)
    person.press(pygame.K_v, pygame.K_h, pygame.K_z, pygame.K_PLUS)
    assert (person.session.state, person.session.ticks) == ("waiting", 0)
    person.hold(pygame.K_w)
    person.wait(1.0)
    assert person.session.state == "driving"
    assert 9 <= person.session.ticks <= 12, "ten ticks per second, independent of the frame rate"


def test_keys_drive_and_labels_are_recorded(driver: Callable[..., Driver]) -> None:
    person = driver(label={"kind": "classes", "classes": 5, "when": "frame"})
    person.press(pygame.K_2)
    person.hold(pygame.K_w, pygame.K_a)
    person.wait(0.5)
    person.press(pygame.K_4)
    person.wait(0.5)
    person.press(pygame.K_RETURN, pygame.K_RETURN)
    record = read_episode(person.kept_file())
    labels = [label["label"] for label in record.labels]
    assert labels[0] == 2
    assert labels[-1] == 4
    assert record.command[2].tolist() == [1.0, 0.0, 1.5]
    assert verify(person.folder, replay=True, rerun=True) == []


def test_a_run_with_a_question_is_kept_after_the_answer(driver: Callable[..., Driver]) -> None:
    person = driver(label={"kind": "slider", "question": "How comfortable was it?"})
    person.hold(pygame.K_w)
    person.wait(0.5)
    person.press(pygame.K_RETURN, pygame.K_RETURN)
    assert (person.session.state, person.session.kept) == ("ended", 0)
    person.press(pygame.K_9, pygame.K_PAGEDOWN, pygame.K_RETURN)
    assert person.session.kept == 1
    assert read_episode(person.kept_file()).label == pytest.approx(0.95)


def test_letters_of_a_text_answer_trigger_no_actions(driver: Callable[..., Driver]) -> None:
    person = driver(label=TEXT)
    person.drive_briefly(0.5)
    person.press(pygame.K_RETURN)
    person.type("rn")
    assert person.session.state == "ended"
    person.press(pygame.K_RETURN)
    person.wait()
    assert read_episode(person.kept_file()).label == "rn"


def test_disconnecting_a_pad_stops_the_robot_and_pauses(driver: Callable[..., Driver]) -> None:
    person = driver()
    pad = person.plug_in()
    person.tilt(pad, -1.0, 1.0)
    assert person.session.state == "driving"
    assert person.session.after.robot.twist.vx > 0.5
    person.pads.unplug(pad)
    pygame.event.post(unplugged(pad))
    person.wait(1.0)
    ticks = person.session.ticks
    assert person.session.state == "paused"
    person.wait(1.0)
    assert person.session.ticks == ticks
    person.tilt(person.plug_in(), -0.9, 0.3)
    assert person.session.state == "driving"
    person.press(pygame.K_RETURN, pygame.K_RETURN)
    events = [event for frame in read_episode(person.kept_file()).frames() for event in frame.snapshot.events]
    assert [(event.device, event.value) for event in events] == [("pad0", -1.0), ("pad0", -0.9)]
    assert verify(person.folder, replay=True, rerun=True) == []


def test_pause_help_and_menu_stop_the_world(driver: Callable[..., Driver]) -> None:
    person = driver()
    for key in (pygame.K_p, pygame.K_F1, pygame.K_ESCAPE, pygame.K_g):
        person.hold(pygame.K_w)
        person.wait(0.3)
        assert person.session.state == "driving", pygame.key.name(key)
        person.hold()
        person.press(key)
        ticks = person.session.ticks
        person.wait(0.5)
        assert (person.session.state, person.session.ticks) == ("paused", ticks), pygame.key.name(key)
        person.press(pygame.K_ESCAPE if key == pygame.K_g else key)


def test_help_explains_the_symbols(driver: Callable[..., Driver], drawn: list[Line]) -> None:
    person = driver()
    person.wait(0.2)
    assert "field of view" not in {words for words, _ in drawn}
    person.press(pygame.K_F1)
    person.wait(0.2)
    assert {"field of view", "robot", "goal"} <= {words for words, _ in drawn}


def test_closing_the_window_during_a_run_loses_nothing(driver: Callable[..., Driver]) -> None:
    person = driver()
    person.hold(pygame.K_w)
    person.wait(1.5)
    ticks = person.session.ticks
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    person.wait()
    assert person.screen is None
    again = driver()
    assert again.session.ticks == ticks
    assert again.session.recovered == pytest.approx(ticks * 0.1)


def test_a_slow_window_drops_ticks_and_counts_them(driver: Callable[..., Driver]) -> None:
    person = driver()
    person.hold(pygame.K_w)
    person.wait(0.5)
    before = person.session.ticks
    person.collect.advance(2.0)
    assert person.session.ticks - before <= 4
    assert person.session.dropped_ticks >= 15


def test_the_scene_panel_changes_counts_of_the_next_scene(driver: Callable[..., Driver]) -> None:
    person = driver()
    person.press(pygame.K_g)
    panel = person.collect.overlay.panel
    assert panel is not None
    row = panel.rows["humans"]
    number = row.fields[0].rect
    for _ in range(3):
        person.click(number.right + number.height // 2, number.centery)  # the plus is beside the number
    person.wait()
    assert (row.low, row.high) == (4, 4), "the maximum follows the minimum"
    person.push("New scene")
    assert len(person.session.scene.humans) == 4
    assert person.session.state == "waiting"


def test_a_tap_between_two_ticks_is_recorded(driver: Callable[..., Driver]) -> None:
    person = driver()
    person.hold(pygame.K_w)
    person.wait(0.31)
    for _ in range(3):
        person.hold(pygame.K_w, pygame.K_a)
        person.wait(0.034)
        person.hold(pygame.K_w)
        person.wait(0.4)
    taps = [e for m in person.session._episode.past for e in m.events if e.control == "a"]
    assert [event.value for event in taps] == [1.0, 0.0] * 3


def test_an_answer_outlives_menu_help_and_resizing(driver: Callable[..., Driver]) -> None:
    person = driver(label=TEXT)
    person.drive_briefly()
    person.press(pygame.K_RETURN)
    person.type("ox")
    person.press(pygame.K_ESCAPE, pygame.K_ESCAPE, pygame.K_F1, pygame.K_ESCAPE)
    person.resize((1000, 700))
    person.click(500, 120)
    for letter in "rn":  # keys of "redo" and "another scene"
        person.press(ord(letter))
    assert person.session.state == "ended"
    person.press(pygame.K_RETURN)
    person.wait()
    assert str(read_episode(person.kept_file()).label).startswith("ox")


def test_ctrl_q_closes_from_everywhere_and_loses_nothing(driver: Callable[..., Driver]) -> None:
    for keys in ((pygame.K_g,), (pygame.K_F1,), (pygame.K_ESCAPE,), ()):
        person = driver(label={"kind": "text"})
        if not keys:
            person.hold(pygame.K_w)
            person.wait(0.4)
            person.press(pygame.K_RETURN)
        person.press(*keys)
        person.press(pygame.K_q, mod=pygame.KMOD_CTRL)
        person.wait(0.1)
        assert person.screen is None, keys
    assert driver(label={"kind": "text"}).session.state == "ended", "the open run continues"


def test_a_key_released_over_the_panel_is_released(driver: Callable[..., Driver]) -> None:
    person = driver()
    person.hold(pygame.K_SPACE)
    person.wait(0.2)
    person.press(pygame.K_g)
    person.hold()
    person.press(pygame.K_ESCAPE)
    person.hold(pygame.K_w)
    person.wait(1.0)
    assert person.session.after.robot.twist.vx > 0.5


def test_a_stick_returning_to_its_centre_does_not_end_a_pause(driver: Callable[..., Driver]) -> None:
    person = driver()
    pad = person.plug_in()
    for value, state in ((-1.0, "driving"), (None, "paused"), (-0.9, "paused"), (0.0, "paused"), (-0.5, "driving")):
        if value is None:
            person.press(pygame.K_p)
        else:
            person.tilt(pad, value, 0.3)
        assert person.session.state == state, value


def test_an_error_of_full_screen_is_shown(driver: Callable[..., Driver], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> None:
        raise pygame.error("That operation is not supported")

    person = driver()
    monkeypatch.setattr(pygame.display, "toggle_fullscreen", refuse)
    person.press(pygame.K_F11)
    assert person.screen is person.collect
    assert "not supported" in person.collect.notice


def test_the_screen_says_that_all_runs_are_kept(driver: Callable[..., Driver]) -> None:
    person = driver()
    for _ in range(3):
        person.drive_briefly()
        person.press(pygame.K_RETURN, pygame.K_RETURN)
    assert "Drive on" in person.buttons
    person.press(pygame.K_RETURN)
    assert "Drive on" not in person.buttons
    person.hold(pygame.K_w)
    person.wait(0.4)
    assert person.session.state == "driving"


def test_undo_brings_the_run_back_with_its_answer(driver: Callable[..., Driver]) -> None:
    person = driver(label={"kind": "yes_no"})
    person.drive_briefly()
    person.press(pygame.K_RETURN, pygame.K_1, pygame.K_RETURN)
    person.press(pygame.K_z, mod=pygame.KMOD_CTRL)
    assert (person.session.state, person.session.kept) == ("ended", 0)
    assert person.collect.overlay.answer is not None
    assert person.collect.overlay.answer.label is True, "1 is the first answer, yes"
    texts = [widget.text for widget in person.stage.ui.get_sprite_group().sprites() if isinstance(widget, UIButton)]
    assert sorted(texts) == sorted(set(texts)), "no button of an earlier card remains"
    person.press(pygame.K_n, pygame.K_RETURN)
    assert read_episode(person.kept_file()).label is False
    output = CliRunner().invoke(main, ["describe", str(person.folder)]).output
    assert "answers to 'label'  1 no" in output


def test_runs_among_people_who_enter_and_leave_verify(driver: Callable[..., Driver]) -> None:
    journey = {"robot": {"pose": (-1.5, 0.0, 0.0)}, "goal": {"position": (0.0, 0.0)}}
    person = driver(size=(500, 400), people=PASSERS, humans=0, **journey)
    person.drive(person.session)
    assert person.session.outcome is not None
    person.press(pygame.K_RETURN)
    assert person.session.kept == 1
    assert verify(person.folder, replay=True) == []


def test_the_question_is_the_headline_and_long_answers_are_shown_in_full(
    driver: Callable[..., Driver], drawn: list[Line]
) -> None:
    answers = ["rude", "poor", "fair", "good", "so polite that I would like to meet it every day, " * 3]
    question = "How polite was the robot to all people in this room, from the start of the run to its end?"
    person = driver(label={"kind": "classes", "question": question, "classes": answers})
    person.press(pygame.K_h)  # no readings
    person.drive_briefly()
    person.press(pygame.K_RETURN)
    drawn.clear()
    person.wait()
    largest = max(size for _, size in drawn)
    assert " ".join(words for words, size in drawn if size == largest) == question
    shown = " ".join(words for words, _ in drawn)
    assert all(f"{k} {name}".strip() in shown for k, name in enumerate(answers, 1))
    card, answer = person.collect.overlay.card, person.collect.overlay.answer
    assert card is not None
    assert answer is not None
    assert answer.choices is not None
    assert all(card.box.contains(place) for place in answer.choices.places)


def test_a_very_short_run_is_pointed_out_and_can_still_be_kept(
    driver: Callable[..., Driver], drawn: list[Line]
) -> None:
    person = driver()
    person.drive_briefly(0.6)
    person.press(pygame.K_RETURN)
    person.wait()
    assert any("only 0.6 s long" in words for words, _ in drawn)
    person.press(pygame.K_RETURN)
    assert person.session.kept == 1


def test_volunteers_read_neither_file_names_nor_folders(driver: Callable[..., Driver]) -> None:
    person = driver()
    for key in (pygame.K_RETURN, pygame.K_BACKSPACE, pygame.K_r):
        person.drive_briefly()
        person.press(pygame.K_RETURN, key)
        assert person.collect.notice
        assert not any(word in person.collect.notice for word in ("zoe", "json", "discarded", "/"))


def test_a_notice_is_shown_once_and_beside_the_card(driver: Callable[..., Driver], drawn: list[Line]) -> None:
    notice = "Answer the question first, or discard the run."
    person = driver(label=TEXT)
    person.drive_briefly()
    person.press(pygame.K_RETURN, pygame.K_RETURN)
    drawn.clear()
    person.wait()
    assert [words for words, _ in drawn].count(notice) == 1
    person.type("x")
    drawn.clear()
    person.wait()
    assert notice not in {words for words, _ in drawn}, "it is answered"


def test_the_scenes_of_a_study_are_fixed_unless_the_researcher_allows_changes(
    driver: Callable[..., Driver], drawn: list[Line]
) -> None:
    person = driver(size=(1600, 900))
    person.wait()
    assert "G" in {words for words, _ in drawn}
    person.collect = CollectScreen(person.session, InputDevices(pads=person.pads))
    person.screen = person.collect
    person.screen.enter(person.stage)
    drawn.clear()
    person.press(pygame.K_g)
    assert person.collect.overlay.panel is None
    assert "G" not in {words for words, _ in drawn}
    person.press(pygame.K_ESCAPE)
    assert "Menu" in {words for words, _ in drawn}
    assert "Scene settings" not in person.buttons


def test_a_new_person_starts_with_an_empty_name(driver: Callable[..., Driver]) -> None:
    person = driver()
    names: list[str] = []
    ask = NameScreen(lambda name: names.append(name) or person.collect)  # type: ignore[func-returns-value]
    person.collect = CollectScreen(person.session, InputDevices(pads=person.pads), new_person=lambda: ask)
    person.screen = person.collect
    person.screen.enter(person.stage)
    person.press(pygame.K_ESCAPE)
    person.push("New driver")
    assert person.screen is ask
    assert ask.answer is not None
    assert ask.answer.label is None
    for letter in "李Ω😀":
        pygame.event.post(pygame.event.Event(pygame.TEXTINPUT, text=letter))
    person.wait()
    assert ask.answer.label == "李Ω😀"
    field = ask.answer._entry
    assert field is not None
    pictures = [pygame.image.tobytes(field.font.render_premul(c, pygame.Color("black")), "RGBA") for c in "李王"]
    assert pictures[0] != pictures[1], "widgets draw the characters, not boxes"
    Driver(person.folder).session.close()  # the folder is free for the next session of the same person


def test_the_enter_key_that_ends_the_name_does_not_start_the_run(driver: Callable[..., Driver]) -> None:
    person = driver()
    person.screen = NameScreen(lambda name: person.collect)
    person.screen.enter(person.stage)
    person.hold(pygame.K_RETURN)
    person.wait(0.1)
    assert person.screen is person.collect
    for _ in range(3):  # key repeat, as long as the key is held
        person._post(pygame.K_RETURN, True)
        person.wait()
    person.hold()
    person.wait()
    assert (person.session.state, person.session.ticks) == ("waiting", 0)
    person.press(pygame.K_RETURN)
    assert person.session.state == "driving", "Enter counts again once it has been released"


def test_counts_can_be_typed(driver: Callable[..., Driver]) -> None:
    person = driver()
    person.press(pygame.K_g)
    panel = person.collect.overlay.panel
    assert panel is not None
    row = panel.rows["humans"]
    person.click(*row.fields[0].rect.center)
    person.type("5")
    person.wait()
    assert (row.low, row.high) == (5, 5), "the maximum follows the minimum"
    assert row.fields[1].get_text() == "5"
    person.push("New scene")
    assert len(person.session.scene.humans) == 5


def test_counts_that_contradict_each_other_are_explained_in_the_panel(driver: Callable[..., Driver]) -> None:
    person = driver(room={"kinds": "square", "side": 4})
    person.press(pygame.K_g)
    panel = person.collect.overlay.panel
    assert panel is not None
    panel.rows["humans"].change(0, 99)
    person.push("New scene")
    assert person.collect.overlay.panel is panel
    assert panel.problem


@pytest.mark.parametrize("size", [(640, 480), (1280, 800)])
def test_neither_readings_nor_the_card_of_an_ended_run_cover_the_scene(
    size: tuple[int, int], driver: Callable[..., Driver], monkeypatch: pytest.MonkeyPatch
) -> None:
    areas: list[pygame.Rect] = []
    draw = Painter.draw

    def noted(painter: Painter, surface: pygame.Surface, *values: Any, **settings: Any) -> Camera:
        areas.append(pygame.Rect(surface.get_abs_offset(), surface.get_size()))
        return draw(painter, surface, *values, **settings)

    monkeypatch.setattr(Painter, "draw", noted)
    person = driver(size=size, label={"kind": "yes_no", "question": "Was it polite?"})
    person.drive_briefly()
    free = free_area(person.stage.surface, Hud(keys=(("F1", "help"),)), scale=person.stage.scale)
    assert areas[-1] == free
    person.press(pygame.K_RETURN)
    person.wait()
    card = person.collect.overlay.card
    assert card is not None
    assert free.contains(areas[-1])
    assert not card.box.colliderect(areas[-1])
