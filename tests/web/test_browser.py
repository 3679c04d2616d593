"""A whole study in headless Chromium, by real key, mouse and touch events."""

from __future__ import annotations

import base64
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sonata2d.collect.session import Session
from sonata2d.core.devices import NETWORK_DEVICE
from sonata2d.datasets import verify
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.load import load_scenario
from sonata2d.study.report import results_of
from sonata2d.web.server import MAPPINGS

from .conftest import Served
from .test_server import client_of, fetch

_STEP = "#step:not([hidden]) #title"


def opened(browser: Any, link: str, **settings: Any) -> Any:
    """A page, whose errors fail the test."""
    context = browser.new_context(viewport={"width": 1000, "height": 760}, **settings)
    page = context.new_page()
    page.set_default_timeout(15_000)
    page.problems = []
    page.on("pageerror", lambda error: page.problems.append(str(error)))
    page.on("console", lambda message: page.problems.append(message.text) if message.type == "error" else None)
    page.on("request", lambda request: page.problems.append(request.url) if "127.0.0.1" not in request.url else None)
    page.goto(link)
    return page


def go_on(page: Any) -> None:
    page.get_by_role("button", name="Continue", exact=True).click()


def drive_with_keys(page: Any, ms: int = 700) -> None:
    page.locator("#canvas").focus()
    page.keyboard.down("w")
    page.wait_for_selector("#status.driving")
    page.wait_for_timeout(ms)
    page.keyboard.up("w")
    page.wait_for_timeout(150)


def end(page: Any) -> None:
    page.get_by_role("button", name="End the run").click()
    page.wait_for_selector("#card:not([hidden])")


def prepare(page: Any) -> None:
    """Go on to the practice."""
    page.wait_for_selector(_STEP)
    go_on(page)
    page.get_by_role("button", name="I agree", exact=True).click()  # without a tick
    assert page.locator(".problem:visible").inner_text() == "Please tick all statements, or do not take part."
    page.get_by_label("I am 18 or older.").check()
    page.get_by_role("button", name="I agree", exact=True).click()
    page.get_by_label("Your age").fill("17")
    go_on(page)
    assert "from 18" in page.locator(".question .problem").inner_text()
    page.get_by_label("Your age").fill("44")
    go_on(page)
    page.wait_for_selector("#status.waiting")


def practise(page: Any) -> None:
    drive_with_keys(page, 300)
    end(page)
    go_on(page)
    page.wait_for_selector("#status.waiting")


def at_practice(browser: Any, link: str, proxied: str | None = None) -> Any:
    """A page that waits for the practice; the steps before are taken without the browser.

    Args:
        browser: Chromium.
        link: of the participant.
        proxied: the link that the page opens.
    """
    with client_of(link) as client:
        client.prepare()
    return waiting(opened(browser, proxied or link))


def at_first_run(browser: Any, link: str, proxied: str | None = None) -> Any:
    """A page that waits for the first run; see `at_practice`."""
    with client_of(link) as client:
        run = client.prepare()["drive"]["run"]
        for number in range(3):
            client.tick(run, number, ("keyboard", "w", 1.0))
        client.ask(type="stop", run=run)
        client.ask(type="finish_practice", run=run)
    return waiting(opened(browser, proxied or link))


def waiting(page: Any) -> Any:
    page.wait_for_selector("#status.waiting")
    return page


def answer_effort(page: Any, effort: int) -> None:
    page.wait_for_selector(_STEP)
    page.get_by_role("radio", name=str(effort), exact=True).check()
    go_on(page)


def test_pictures_of_texts_are_shown(browser: Any, study_folder: Path) -> None:
    logo = base64.b64decode(  # 3 × 2 pixels
        "iVBORw0KGgoAAAANSUhEUgAAAAMAAAACCAIAAAASFvFNAAAAEElEQVR4nGP4z8AAQQxwFgBB0gX7h/C5SAAAAABJRU5ErkJggg=="
    )
    (study_folder / "logo.png").write_bytes(logo)
    drawing = '<svg xmlns="http://www.w3.org/2000/svg" width="7" height="5"><script>alert(1)</script></svg>'
    (study_folder / "plan.svg").write_text(drawing)
    path = study_folder / "study.yaml"
    text = path.read_text(encoding="utf-8").replace("You **drive**", "![Logo](logo.png) ![](plan.svg) You **drive**")
    path.write_text(text, encoding="utf-8")
    served = Served(study_folder)
    try:
        page = opened(browser, served.link())
        page.wait_for_selector("#step .prose img")
        page.wait_for_function("[...document.querySelectorAll('#step .prose img')].every(each => each.naturalWidth)")
        sizes = (
            "[...document.querySelectorAll('#step .prose img')].map(each => [each.naturalWidth, each.naturalHeight])"
        )
        assert page.evaluate(sizes) == [[3, 2], [7, 5]]
        assert page.get_by_alt_text("Logo").count() == 1
        assert page.problems == []
        page.context.close()
        assert fetch(f"{served.url}/pictures/study.json")[0] == 404
        assert fetch(f"{served.url}/pictures/..%2fstudy.json")[0] == 404
    finally:
        served.stop()


def test_a_whole_study(browser: Any, served: Served) -> None:
    page = opened(browser, f"{served.url}/j/{served.links.open}")
    page.get_by_role("button", name="Take part").click()
    page.wait_for_selector(_STEP)
    assert re.fullmatch(rf"{served.url}/s/[\w-]{{22}}", page.url)
    assert "<script>" in page.locator("#step .prose").inner_text()
    assert page.locator("#step .prose img, #step .prose script").count() == 0
    prepare(page)
    practise(page)

    drive_with_keys(page)  # kept, taken back, and kept with another answer
    end(page)
    page.get_by_role("button", name="Keep", exact=True).click()
    assert page.locator("#card .problem:visible").inner_text() == "Answer the question first, or discard the run."
    page.get_by_role("radio", name="kind").check()
    page.get_by_role("button", name="Keep", exact=True).click()
    page.wait_for_selector(_STEP)
    page.get_by_role("button", name="Take back the last run").click()
    page.wait_for_selector("#card:not([hidden])")
    assert page.get_by_role("radio", name="kind").is_checked()
    page.get_by_role("radio", name="fair").check()
    page.get_by_role("button", name="Keep", exact=True).click()
    answer_effort(page, 2)

    page.wait_for_selector("#status.waiting")  # with the mouse; discarded, so another scene follows
    box = page.locator("#canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 20, y - 90, steps=5)
    page.wait_for_selector("#status.driving")
    page.wait_for_timeout(600)
    page.mouse.up()
    page.wait_for_timeout(150)
    end(page)
    page.get_by_role("button", name="Discard", exact=True).click()
    page.wait_for_selector("#status.waiting")
    drive_with_keys(page, 400)  # driven again
    page.keyboard.press("Enter")
    page.wait_for_selector("#card:not([hidden])")
    page.get_by_role("button", name="Again", exact=True).click()
    page.wait_for_selector("#status.waiting")
    drive_with_keys(page)
    page.keyboard.press("Enter")
    page.get_by_role("radio", name="rude").check()
    page.get_by_role("button", name="Keep", exact=True).click()
    answer_effort(page, 3)

    page.wait_for_selector("#status.waiting")  # paused, and continued after the page was loaded again
    drive_with_keys(page, 500)
    page.keyboard.press("p")
    page.wait_for_selector("#status.paused")
    page.reload()
    page.wait_for_selector("#status.paused")
    drive_with_keys(page, 500)
    end(page)
    page.get_by_role("radio", name="kind").check()
    page.get_by_role("button", name="Keep", exact=True).click()
    answer_effort(page, 4)

    for k in range(5):
        page.wait_for_selector("#watching:not([hidden])")
        page.locator("#rated", has_text=re.compile(rf"^{20 * k} %")).wait_for()
        page.wait_for_selector("#rating input:not(:disabled)")
        page.get_by_role("radio", name="yes" if k % 2 else "no", exact=True).check()
        page.get_by_role("button", name="Save & next").click()
    page.wait_for_selector(".table")
    go_on(page)
    assert page.locator("form > .problem").inner_text() == "Questions without an answer: 1"
    for row in page.locator(".table .row:not(.head)").all():
        row.locator("input").nth(6).check()
    go_on(page)
    page.wait_for_selector("text=You have finished.")
    assert page.problems == []
    page.context.close()

    tables = results_of(served.out, personal=True)
    assert [row["label"] for row in tables["runs"]] == [2, 1, 3]
    assert [row["step"] for row in tables["runs"]] == ["run-1", "run-2", "run-3"]
    assert all(0.0 < row["round_trip_median"] < 1.0 for row in tables["runs"])
    answers = {(row["step"], row["question"], row["item"]): row["value"] for row in tables["answers"]}
    assert answers["demographics", "age", ""] == 44
    assert [answers[f"after-run-{k}", "effort", ""] for k in (1, 2, 3)] == [2, 3, 4]
    assert answers["end", "rosas", "social"] == 7
    assert [row["label"] for row in tables["ratings"]] == [False, True, False, True, False]
    assert verify(served.out, replay=True, rerun=True) == []
    assert verify(served.out / "discarded", replay=True, rerun=True) == []
    for row in tables["runs"]:
        require_equal_to_a_session(served.out / row["file"], served.folder)


def require_equal_to_a_session(path: Path, folder: Path) -> None:
    """A session that gets the same events writes the same bytes."""
    record = read_episode(path)
    config, number = load_scenario(folder / "room.yaml"), record.episode
    when = datetime.strptime(path.name.split("__")[1], "%Y%m%dT%H%M%SZ").replace(tzinfo=UTC)
    out = folder / "again" / path.stem
    session = Session(
        out, record.contributor or "", config, mappings=MAPPINGS, schedule=lambda kept: (config, number),
        now=lambda: when,
    )  # fmt: skip
    events = [snapshot.events for snapshot in record.snapshots()]
    assert any(event.device == NETWORK_DEVICE for tick in events for event in tick)
    for tick in events:
        session.tick(tick)
    written = session.keep(record.label)
    session.close()
    assert written.name.removesuffix(".json").startswith(path.name.removesuffix(".json").rpartition("__")[0])
    # the name, which the file contains, has a number if the run was driven several times in one second
    data = written.read_bytes().replace(written.stem.encode(), path.stem.encode())
    assert data == path.read_bytes()


def test_a_page_that_is_touched(browser: Any, served: Served) -> None:
    page = opened(browser, served.link(), has_touch=True, is_mobile=True)
    page.set_viewport_size({"width": 360, "height": 740})
    prepare(page)
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    box = page.locator("#canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] * 0.6
    touch = page.context.new_cdp_session(page)

    def send(kind: str, *points: tuple[float, float]) -> None:
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": a, "y": b} for a, b in points]})

    send("touchStart", (x, y))
    for k in range(1, 6):
        send("touchMove", (x, y - 16 * k))
    page.wait_for_selector("#status.driving")
    page.wait_for_timeout(500)
    send("touchEnd")
    page.wait_for_timeout(150)
    page.get_by_role("button", name="End the run").tap()
    page.get_by_role("button", name="Continue", exact=True).tap()
    page.wait_for_selector("#status.waiting")
    assert page.problems == []
    page.context.close()
    (path,) = (served.out / "discarded").iterdir()
    events = [event for snapshot in read_episode(path).snapshots() for event in snapshot.events]
    assert {event.device for event in events} == {"touch", NETWORK_DEVICE, "window"}
    assert min(event.value for event in events if event.control == "drag_y") < -0.5


def tab_to(page: Any, words: str) -> None:
    """Move the focus with the Tab key to an element with these words, or with this label."""
    script = """() => { const e = document.activeElement, labels = [...(e.labels || [])];
      return [e, ...labels].map(one => one.textContent.trim()).concat(e.getAttribute("aria-label")); }"""
    for _ in range(40):
        page.keyboard.press("Tab")
        if words in page.evaluate(script):
            return
    raise AssertionError(f"the Tab key does not reach {words!r}")


def test_everything_but_driving_by_keyboard_alone(browser: Any, served: Served) -> None:
    page = opened(browser, served.link())
    page.wait_for_selector(_STEP)
    tab_to(page, "Continue")
    page.keyboard.press("Enter")
    page.get_by_text("Runs are stored.").wait_for()
    assert page.evaluate("document.activeElement.id") == "title"  # a screen reader goes on from here
    tab_to(page, "I am 18 or older.")
    page.keyboard.press("Space")
    tab_to(page, "I agree")
    page.keyboard.press("Enter")
    page.get_by_label("Your age").wait_for()
    tab_to(page, "Your age")
    page.keyboard.type("44")
    page.keyboard.press("Enter")
    for _ in range(2):  # the practice, and a run; the scene has the focus
        page.wait_for_selector("#status.waiting")
        page.keyboard.down("ArrowUp")
        page.wait_for_selector("#status.driving")
        page.wait_for_timeout(500)
        page.keyboard.up("ArrowUp")
        page.keyboard.press("Enter")
        page.wait_for_selector("#card:not([hidden])")
        page.keyboard.press("Enter")  # just after the end, it could be meant for the run
        page.wait_for_timeout(600)
        assert page.locator("#card").is_visible()
        if page.get_by_role("radio", name="fair").count():
            page.keyboard.press("2")
        page.keyboard.press("Enter")
        page.wait_for_selector("#card", state="hidden")
    page.get_by_text("Effort").wait_for()
    tab_to(page, "1")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    page.wait_for_selector("#status.waiting")
    assert page.locator("#count").inner_text() == "run 2 of 3"
    assert page.problems == []
    page.context.close()
    answers = results_of(served.out)["answers"]
    assert [(row["question"], row["value"]) for row in answers] == [("effort", 2)]
