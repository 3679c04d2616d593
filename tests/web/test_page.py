"""What keys, pads, buttons and languages do on the page besides driving."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sonata2d.record.reader import read_episode
from sonata2d.registry import QUESTION_KINDS
from sonata2d.study import Question
from sonata2d.study.report import results_of

from .conftest import Served
from .proxy import Proxy
from .test_browser import at_first_run, at_practice, drive_with_keys, end, go_on, opened
from .test_robustness import driven_by_a_pad


def session_of(served: Served, id: str = "p001") -> Any:
    session = served.server.sessions[id].participant.session
    assert session is not None
    return session


def test_keys_drive_after_a_click_on_a_button(browser: Any, served: Served) -> None:
    page = at_practice(browser, served.link())
    for name in ("Camera", "Zoom in"):
        page.get_by_role("button", name=name).click()
        page.keyboard.down("w")
        page.wait_for_selector("#status.driving")
        page.wait_for_timeout(400)
        assert page.evaluate("document.activeElement.id") == "canvas"
        page.keyboard.up("w")
    page.get_by_role("button", name="Help").click()
    page.wait_for_selector("#help[open]")
    page.keyboard.press("w")  # behind the help, no key drives
    page.get_by_role("button", name="Close").click()
    page.wait_for_selector("#status.paused")
    ticks = session_of(served).ticks
    page.wait_for_timeout(300)
    assert session_of(served).ticks == ticks
    assert page.problems == []
    page.context.close()


def test_keys_of_other_alphabets_drive(browser: Any, served: Served) -> None:
    page = at_practice(browser, served.link())
    page.locator("#canvas").focus()
    event = "new KeyboardEvent('{}', {{key: '{}', code: 'KeyW', bubbles: true}})"
    page.evaluate("event => dispatchEvent(" + event.format("keydown", "ц") + ")", None)
    page.wait_for_selector("#status.driving")
    page.wait_for_timeout(300)
    page.evaluate("event => dispatchEvent(" + event.format("keyup", "Ц") + ")", None)
    page.wait_for_timeout(300)
    events = [(e.control, e.value) for tick in session_of(served)._episode.past for e in tick.events]
    assert [event for event in events if event[0] == "w"] == [("w", 1.0), ("w", 0.0)]
    page.context.close()


def test_a_pad_that_is_gone_drives_no_more(browser: Any, served: Served) -> None:
    page = driven_by_a_pad(browser, served.link())
    page.wait_for_timeout(400)
    page.evaluate("""() => {
      const lost = window.pad;
      navigator.getGamepads = () => [null];
      dispatchEvent(Object.assign(new Event("gamepaddisconnected"), {gamepad: lost}));
    }""")
    page.wait_for_selector("#status.paused")
    page.get_by_text("test was disconnected and the robot stands still").wait_for()
    ticks = session_of(served).ticks
    page.wait_for_timeout(400)
    assert session_of(served).ticks == ticks
    page.context.close()


def test_keys_that_are_held_do_not_answer_the_card(browser: Any, served: Served) -> None:
    page = at_first_run(browser, served.link())
    drive_with_keys(page)
    for _ in range(4):  # held: the browser repeats the key
        page.keyboard.down("Enter")
        page.wait_for_timeout(60)
    page.keyboard.up("Enter")
    page.keyboard.press("Space")  # the brake, just after the end
    page.keyboard.press("ArrowDown")
    assert page.locator("#card").is_visible()
    assert page.locator("#card input:checked").count() == 0
    page.wait_for_timeout(600)
    page.get_by_role("radio", name="fair").focus()
    page.keyboard.press("Space")
    page.keyboard.press("Enter")
    page.get_by_text("Effort").wait_for()
    page.keyboard.press("Control+z")
    page.wait_for_selector("#card:not([hidden])")
    page.context.close()


def test_answers_outlast_a_change_of_language(browser: Any, served: Served) -> None:
    page = at_first_run(browser, served.link())
    drive_with_keys(page)
    end(page)
    page.get_by_role("radio", name="fair").check()
    page.locator("#language").select_option("de")
    page.get_by_role("radio", name="gut").wait_for()
    assert page.get_by_role("radio", name="gut").is_checked()
    page.get_by_role("button", name="Behalten").click()
    page.get_by_text("Mühe").wait_for()
    page.get_by_role("radio", name="4", exact=True).check()
    page.locator("#language").select_option("en")
    page.get_by_text("Effort").wait_for()
    assert page.get_by_role("radio", name="4", exact=True).is_checked()
    go_on(page)
    page.wait_for_selector("#status.waiting")
    assert page.problems == []
    page.context.close()


def test_a_label_that_is_moved_before_the_start_is_the_first_one(browser: Any, study_folder: Path) -> None:
    (study_folder / "room.yaml").write_text("extends: empty\nlabel: {kind: slider, question: How is it, when: frame}\n")
    text = (study_folder / "study.yaml").read_text(encoding="utf-8")
    block = text[text.index("    label:\n") : text.index("after_run:")]
    label = "    label: {question: {en: How, de: Wie, zh: 如何}, ends: {en: [a, b], de: [a, b], zh: [a, b]}}\n"
    (study_folder / "study.yaml").write_text(text.replace(block, label), encoding="utf-8")
    served = Served(study_folder)
    try:
        page = at_first_run(browser, served.link())
        slider = page.locator("#while input[type=range]")
        for k in range(100):  # as while it is dragged
            slider.evaluate("(input, k) => { input.value = k / 100; input.dispatchEvent(new Event('input')); }", k)
        drive_with_keys(page, 500)
        end(page)
        page.get_by_role("button", name="Keep", exact=True).click()
        page.get_by_text("Effort").wait_for()
        assert page.problems == []
        page.context.close()
    finally:
        served.stop()
    (path,) = served.out.glob("p001__*.json")
    assert {frame.label["label"] for frame in read_episode(path).frames()} == {0.99}


def test_a_language_that_is_chosen_while_driving_pauses_the_run(browser: Any, served: Served) -> None:
    token = served.link().rpartition("/")[2]
    with Proxy(served.port, delay=0.2) as proxy:  # ticks are on their way when the message is sent
        page = at_practice(browser, f"{served.url}/s/{token}", f"http://127.0.0.1:{proxy.port}/s/{token}")
        page.locator("#canvas").focus()
        page.keyboard.down("w")
        page.wait_for_selector("#status.driving")
        page.wait_for_timeout(800)
        page.locator("#language").select_option("de")
        page.wait_for_selector("#status.paused")
        page.keyboard.up("w")
        page.wait_for_timeout(500)
        session = session_of(served)
        ticks = session.ticks
        page.wait_for_timeout(300)
        assert (session.state, session.ticks) == ("paused", ticks)
        page.locator("#canvas").focus()
        page.keyboard.down("a")
        page.wait_for_selector("#status.driving")
        page.wait_for_timeout(600)
        page.keyboard.up("a")
        page.wait_for_timeout(600)
        assert page.problems == []
        page.context.close()
    events = [(e.control, e.value) for tick in session._episode.past for e in tick.events]
    assert [value for control, value in events if control == "w"] == [1.0, 0.0]
    assert [value for control, value in events if control == "a"] == [1.0, 0.0]


def test_a_number_that_is_not_complete_is_refused_and_not_taken_for_no_answer(browser: Any, served: Served) -> None:
    page = opened(browser, served.link())
    page.get_by_role("button", name="Continue", exact=True).click()
    page.get_by_label("I am 18 or older.").check()
    page.get_by_role("button", name="I agree", exact=True).click()
    page.get_by_label("Your age").press_sequentially("4e")
    assert page.get_by_label("Your age").input_value() == "", "the browser gives the page no text"
    go_on(page)
    page.get_by_text("Please give a number from 18 to").wait_for()
    page.get_by_label("Your age").fill("44")
    go_on(page)
    page.wait_for_selector("#status.waiting")
    page.context.close()


class Past(Question):
    """A date before 2020."""

    renderer = "input"

    input: str = "date"

    def check(self, value: Any) -> Any:
        if not str(value) < "2020":
            raise self.refusal(value, "a date before 2020")
        return value


class Colour(Question):
    """A colour; the page has no renderer of this name."""

    renderer = "palette"


def test_kinds_of_other_packages_are_drawn_and_checked(browser: Any, study_folder: Path) -> None:
    for name, kind in (("past", Past), ("colour", Colour)):
        QUESTION_KINDS.register(name, kind)
    questions = "".join(
        f"  - {{name: {name}, kind: {name}, question: {{en: {text}, de: {text}, zh: {text}}}}}\n"
        for name, text in (("past", "Since"), ("colour", "Colour"))
    )
    text = (study_folder / "study.yaml").read_text(encoding="utf-8")
    text = text.replace("demographics:\n", f"demographics:\n{questions}")
    (study_folder / "study.yaml").write_text(text, encoding="utf-8")
    served = Served(study_folder)
    try:
        page = opened(browser, served.link())
        page.get_by_role("button", name="Continue", exact=True).click()
        page.get_by_label("I am 18 or older.").check()
        page.get_by_role("button", name="I agree", exact=True).click()
        page.get_by_label("Your age").fill("44")
        page.get_by_label("Since").fill("2024-05-17")
        go_on(page)
        assert page.locator("form > .problem").inner_text() == "Questions without an answer: 1"
        page.get_by_label("Colour").fill("red")
        go_on(page)
        page.get_by_text(
            "That was not possible. Please try again. (past is '2024-05-17'; a date before 2020"
        ).wait_for()
        assert page.locator("textarea").input_value() == "red"
        page.get_by_label("Since").fill("2019-05-17")
        go_on(page)
        page.wait_for_selector("#status.waiting")
        assert page.problems == []
        page.context.close()
    finally:
        served.stop()
        for name in ("past", "colour"):
            del QUESTION_KINDS.registered[name]
    answers = {row["question"]: row["value"] for row in results_of(served.out, personal=True)["answers"]}
    assert answers == {"age": 44, "past": "2019-05-17", "colour": "red"}
