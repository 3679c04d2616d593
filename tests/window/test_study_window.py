"""A whole study in the window, by keys and clicks, and the same files as in a browser."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pygame
import pytest

import sonata2d as s2
from sonata2d.agents.controllers.teleoperation import DEFAULT_MAPPINGS
from sonata2d.collect.texts import choose_language
from sonata2d.datasets import verify
from sonata2d.study.folder import StudyFolder
from sonata2d.study.load import load_study
from sonata2d.study.markdown import Paragraph, paragraphs_of
from sonata2d.study.participant import Participant
from sonata2d.study.report import results_of
from sonata2d.window.input import InputDevices
from sonata2d.window.rate_screen import RateScreen
from sonata2d.window.study_flow import StudyDriveScreen, StudyFlow
from sonata2d.window.study_pages import PageScreen, QuestionsScreen

from .fake_devices import FakePads
from .volunteer import Person

STUDY = """\
title: {en: Passing people, de: An Menschen vorbei}
languages: [en, de]
pages:
  - title: {en: Welcome, de: Willkommen}
    text:
      en: "You **drive** a robot.\\n\\n- One [site](https://example.org)\\n- Two\\n\\n1. First\\n2. Second"
      de: "Sie **fahren** einen Roboter."
consent:
  title: {en: Consent, de: Einwilligung}
  text: {en: Runs are stored., de: Fahrten werden gespeichert.}
  statements: [{en: I am 18 or older., de: Ich bin 18 oder älter.}, {en: Freely., de: Freiwillig.}]
demographics:
  - {name: age, kind: number, question: {en: Your age, de: Ihr Alter}, minimum: 18}
  - {name: remark, kind: text, question: {en: Anything else, de: Noch etwas}, required: false}
practice: {scenario: room.yaml}
runs:
  - scenario: room.yaml
    runs: 2
    label: {question: {en: How polite, de: Wie höflich}, classes: {en: [rude, kind], de: [grob, nett]}}
after_run:
  - name: felt
    kind: likert
    question: {en: How was it, de: Wie war es}
    items: {safe: {en: I felt safe, de: Ich war sicher}, calm: {en: I was calm, de: Ich war ruhig}}
    ends: [{en: never, de: nie}, {en: always, de: immer}]
ratings:
  - name: polite
    folder: recorded
    repeats: 0
    question: {name: polite, kind: yes_no, question: {en: Was it polite, de: War das höflich}}
minimum_length: 0.3
changes: [view]
redo: false
"""
ROOM = """\
extends: empty
label: {kind: classes, classes: [rude, kind], question: How polite}
"""
ENTER = pygame.K_RETURN


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recorded runs of a second."""
    folder = tmp_path_factory.mktemp("recorded") / "runs"
    config = s2.load_scenario("empty").changed(rules={"time_limit": 1.0})
    s2.generate_dataset(folder, config, "straight-to-goal", episodes=2, workers=1)
    return folder


@pytest.fixture
def arrive(tmp_path: Path, recorded: Path) -> Iterator[Callable[..., Person]]:
    """Opens the window for a participant."""
    (tmp_path / "study.yaml").write_text(STUDY, encoding="utf-8")
    (tmp_path / "room.yaml").write_text(ROOM)
    (tmp_path / "recorded").symlink_to(recorded)
    arrived: list[Participant] = []

    def arrive(size: tuple[int, int] = (1000, 700)) -> Person:
        folder = StudyFolder(tmp_path / "out", load_study(tmp_path / "study.yaml"))
        for participant in arrived:
            participant.close()
        arrived.append(Participant(folder, "p1", mappings=DEFAULT_MAPPINGS))
        return Participating(lambda: StudyFlow(arrived[-1], InputDevices(pads=FakePads())).screen(), size)

    yield arrive
    for participant in arrived:
        participant.close()
    choose_language("en")


class Participating(Person):
    """A person who waits for what a key or a click does: text fields pass Enter on in the next frame."""

    def press(self, *keys: int, mod: int = 0) -> None:
        for key in keys:
            super().press(key, mod=mod)
            self.frames(3)

    def push(self, text: str) -> None:
        super().push(text)
        self.frames(3)


def consent(person: Person) -> None:
    person.press(ENTER)
    person.press(pygame.K_1, pygame.K_2, ENTER)


def prepare(person: Person) -> None:
    """Go on to the practice."""
    consent(person)
    person.type("44")
    person.press(ENTER)
    person.press(ENTER)  # an optional question


def drive(person: Person, seconds: float = 0.6) -> None:
    person.hold(pygame.K_w)
    person.wait(seconds)
    person.hold()
    person.press(ENTER)


def screen_of(person: Person) -> object:
    return person.screen


def test_a_whole_study(arrive: Callable[..., Person], tmp_path: Path) -> None:
    person = arrive()
    assert isinstance(screen_of(person), PageScreen)
    person.press(ENTER)
    person.press(ENTER)  # nothing is ticked
    assert isinstance(screen_of(person), PageScreen)
    person.press(pygame.K_1, pygame.K_2, ENTER)
    assert isinstance(screen_of(person), QuestionsScreen)
    person.type("17")
    person.press(ENTER)  # too young
    person.press(pygame.K_BACKSPACE, pygame.K_BACKSPACE)
    person.type("44")
    person.press(ENTER, ENTER)
    assert isinstance(screen_of(person), StudyDriveScreen)
    drive(person)
    person.push("Continue")

    drive(person)  # kept, taken back, and kept with another answer
    person.press(ENTER)  # without an answer
    assert isinstance(screen_of(person), StudyDriveScreen)
    person.press(pygame.K_1, ENTER)
    assert isinstance(screen_of(person), QuestionsScreen)
    person.push("Take back the last run")
    screen = screen_of(person)
    assert isinstance(screen, StudyDriveScreen)
    assert screen.answer is not None
    assert screen.answer.label == 1
    person.press(pygame.K_2, ENTER)
    person.press(pygame.K_5, ENTER)
    person.push("Back")
    person.press(ENTER, pygame.K_3, ENTER)

    drive(person)  # discarded: another scene follows
    person.press(pygame.K_BACKSPACE)
    drive(person, 0.1)  # too short to be kept
    assert "Keep (Enter)" not in person.buttons
    person.push("Again (R)")
    drive(person)
    person.press(pygame.K_1, ENTER)
    person.press(pygame.K_1, ENTER, pygame.K_2, ENTER)

    assert isinstance(screen_of(person), RateScreen)
    person.press(ENTER)
    for key in (pygame.K_y, pygame.K_n):
        person.wait(2.5)
        person.press(key, ENTER)
    person.press(ENTER)
    assert isinstance(screen_of(person), PageScreen)
    person.push("Close the window")
    assert not person.is_open

    out = tmp_path / "out"
    assert verify(out, replay=True, rerun=True) == []
    assert verify(out / "discarded", replay=True, rerun=True) == []
    tables = results_of(out, personal=True)
    assert [(row["step"], row["label"]) for row in tables["runs"]] == [("run-1", 2), ("run-2", 1)]
    answers = {(row["step"], row["question"], row["item"]): row["value"] for row in tables["answers"]}
    assert answers == {
        ("demographics", "age", ""): 44, ("after-run-1", "felt", "safe"): 5, ("after-run-1", "felt", "calm"): 3,
        ("after-run-2", "felt", "safe"): 1, ("after-run-2", "felt", "calm"): 2,
    }  # fmt: skip
    assert sorted(row["label"] for row in tables["ratings"]) == [False, True]


def test_the_window_continues_where_it_was_closed(arrive: Callable[..., Person]) -> None:
    person = arrive()
    prepare(person)
    drive(person)
    person.push("Continue")
    person.hold(pygame.K_w)
    person.wait(0.5)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    person.frames(2)
    assert not person.is_open
    again = arrive()
    screen = screen_of(again)
    assert isinstance(screen, StudyDriveScreen)
    assert (screen.session.state, screen.session.ticks > 2) == ("paused", True)


def test_a_participant_reads_in_another_language(arrive: Callable[..., Person]) -> None:
    person = arrive()
    person.push("Deutsch")
    person.push("Weiter")
    person.press(pygame.K_1, pygame.K_2)
    person.push("Ich stimme zu")
    person.type("30")
    person.push("Weiter")
    person.push("Weiter")
    drive(person)
    person.push("Weiter")
    drive(person)
    screen = screen_of(person)
    assert isinstance(screen, StudyDriveScreen)
    assert screen.label_spec.classes == ("grob", "nett")


def test_consent_can_be_declined_and_reconsidered(arrive: Callable[..., Person]) -> None:
    person = arrive()
    person.press(ENTER)
    person.push("I do not agree")
    person.push("I changed my mind")
    person.click(*(120, 300))  # beside the statements
    assert isinstance(screen_of(person), PageScreen)
    assert "I agree" in person.buttons


def test_only_what_the_study_lets_change_can_be_changed(arrive: Callable[..., Person]) -> None:
    person = arrive()
    prepare(person)
    screen = screen_of(person)
    assert isinstance(screen, StudyDriveScreen)
    scene = screen.session.scene
    person.press(pygame.K_n, pygame.K_g, pygame.K_z, pygame.K_v)
    assert screen.session.scene is scene
    assert (screen._camera.view, screen._camera.zones) == ("top", False)
    person.press(pygame.K_ESCAPE)
    assert set(person.buttons) == {"Continue", "The same scene again", "Keys and buttons", "Quit"}


@pytest.mark.parametrize("size", [(640, 480), (1600, 1000)])
def test_pages_fit_into_any_window(size: tuple[int, int], arrive: Callable[..., Person]) -> None:
    person = arrive(size)
    for _ in range(3):
        assert all(person.stage.surface.get_rect().contains(box) for box in person.buttons.values())
        person.press(pygame.K_PAGEDOWN, pygame.K_1, pygame.K_2, ENTER)


def test_paragraphs_of_markdown() -> None:
    words = "# Title\n\nOne *line*\nmore.  \nNext\n\n> quoted\n\n- a\n  1. b\n- <b>\n\n"
    words += "```\nx  y\nz\n```\n\n|p|q|\n|-|-|\n|1|2|\n"
    assert paragraphs_of(words) == [
        Paragraph("Title", "heading"),
        Paragraph("One line more.\nNext"),
        Paragraph("quoted", indent=1),
        Paragraph("a", indent=1, mark="•"),
        Paragraph("b", indent=2, mark="1."),
        Paragraph("<b>", indent=1, mark="•"),
        Paragraph("x  y\nz", "code"),
        Paragraph("p   q"),
        Paragraph("1   2"),
    ]
