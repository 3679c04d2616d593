"""From a panel to the study and back, and ratings by the server's clock."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from sonata2d.collect.rating import ratings_of
from sonata2d.study.folder import StudyFolder
from sonata2d.study.load import load_study
from sonata2d.study.participant import Participant
from sonata2d.study.report import results_of
from sonata2d.web import messages as m
from sonata2d.web.participant_session import ParticipantSession

from .conftest import STUDY_TEXT, Served
from .proxy import Proxy
from .test_browser import drive_with_keys, end, go_on, opened, waiting
from .test_server import client_of, fetch

PANEL = """\
participants: 2
recruitment:
  ids: [PROLIFIC_PID]
  complete: https://panel.example/done?cc=C1
  declined: NO-CONSENT
  full: https://panel.example/full?pid={PROLIFIC_PID}
"""


@pytest.fixture
def panel(study_folder: Path) -> Any:
    (study_folder / "study.yaml").write_text(STUDY_TEXT + PANEL)
    served = Served(study_folder)
    yield served
    served.stop()


def test_a_panel_sends_ids_and_gets_people_back(panel: Served) -> None:
    link = f"{panel.url}/j/{panel.links.open}?PROLIFIC_PID="
    for pid in ("5f1", "7a2", "5f1"):
        status, page, _ = fetch(f"{link}{pid}", b"", Origin=panel.url)
        assert (status, b"/static/page.js" in page) == (200, True)
    assert panel.server.folder.participants == ["p001", "p002"]
    status, page, _ = fetch(f"{link}9c3", b"", Origin=panel.url)
    assert status == 403
    assert b'href="https://panel.example/full?pid=9c3"' in page
    tokens = panel.links.tokens()
    with client_of(f"{panel.url}/s/{tokens['p001']}") as client:
        client.ask(type="hello", protocol=2)
        client.ask(type="read", step="page-1")
        view = client.ask(type="decline", step="consent")
        assert view["step"]["leave"] == {"code": "NO-CONSENT"}
    status, _, _ = fetch(f"{link}9c3", b"", Origin=panel.url)  # the place of the one who declined
    assert status == 200
    line = json.loads((panel.out / "study" / "personal" / "p003.jsonl").read_text().splitlines()[0])
    assert line["values"] == {"PROLIFIC_PID": "9c3"}


def _rating(study_folder: Path) -> tuple[ParticipantSession, list[float]]:
    """A session that shows the first run to rate, and its clock."""
    before, ratings, end = (STUDY_TEXT.index(f"{section}:") for section in ("demographics", "ratings", "end"))
    text = STUDY_TEXT[:before] + STUDY_TEXT[ratings:end]
    (study_folder / "study.yaml").write_text(text)
    participant = Participant(StudyFolder(study_folder / "out", load_study(study_folder / "study.yaml")), "p001")
    clock = [100.0]
    session = ParticipantSession(participant, clock=lambda: clock[0])
    participant.read("page-1")
    participant.consent("consent", [True])
    session.view()
    return session, clock


def test_a_rating_before_the_run_can_have_been_seen_is_refused(study_folder: Path) -> None:
    session, clock = _rating(study_folder)
    rated = session.participant.rating
    assert rated is not None
    record = session.participant.record
    assert record is not None
    duration = float(record.states.time[-1])
    message = m.Rate(type="rate", shown=session.shown, label=True, seconds=999.0, whole=True)
    clock[0] += 0.5 * duration
    with pytest.raises(ValueError, match="the run has not been shown to its end"):
        session._perform(message)
    assert ratings_of(rated.folder) == []
    clock[0] += duration
    session._perform(message)
    (rating,) = ratings_of(rated.folder)
    assert rating.seconds == pytest.approx(1.5 * duration, abs=0.02)  # by the clock of the server
    session.view()  # shows the next run
    with pytest.raises(ValueError, match="this run is rated"):
        session._perform(message)
    session.participant.close()


def test_in_a_browser_from_the_address_of_the_panel_to_the_code(browser: Any, panel: Served, tmp_path: Path) -> None:
    page = opened(browser, f"{panel.url}/j/{panel.links.open}?PROLIFIC_PID=5f1")
    page.get_by_role("button", name="Take part", exact=True).click()
    page.wait_for_selector("#step:not([hidden]) #title")
    page.get_by_role("button", name="Continue", exact=True).click()
    page.get_by_role("button", name="I do not agree", exact=True).click()
    page.wait_for_selector("#code")
    assert page.locator("#code").text_content() == "NO-CONSENT"
    page.get_by_role("button", name="I changed my mind", exact=True).click()
    session = panel.server.sessions["p001"].participant
    assert session.external == {"PROLIFIC_PID": "5f1"}
    assert page.problems == []
    again = opened(browser, f"{panel.url}/j/{panel.links.open}?PROLIFIC_PID=5f1")
    again.get_by_role("button", name="Take part", exact=True).click()
    again.wait_for_selector("#step:not([hidden]) #title")
    assert panel.server.folder.participants == ["p001"]
    for each in (page, again):
        each.context.close()


def test_a_device_that_lacks_something_is_told_so(browser: Any, study_folder: Path) -> None:
    (study_folder / "study.yaml").write_text(STUDY_TEXT + "requires: {keyboard: true, width: 800}\n")
    served = Served(study_folder)
    try:
        page = opened(browser, served.link())
        page.wait_for_selector("#step:not([hidden]) .prose")
        page.set_viewport_size({"width": 600, "height": 760})
        page.wait_for_selector("#missing")
        assert "needs a window of 800 px" in page.locator("#missing").text_content()
        page.set_viewport_size({"width": 900, "height": 760})
        page.wait_for_selector("#step:not([hidden]) .prose")
        phone = opened(browser, served.link(), is_mobile=True, has_touch=True)
        phone.wait_for_selector("#missing")
        assert "needs a keyboard" in phone.locator("#missing").text_content()
        assert page.problems == phone.problems == []
        number = len(served.server.folder.participants)
        joining = opened(browser, f"{served.url}/j/{served.links.open}", is_mobile=True, has_touch=True)
        joining.get_by_text("needs a keyboard").wait_for()
        assert not joining.locator("button").is_visible()
        desktop = opened(browser, f"{served.url}/j/{served.links.open}")
        desktop.set_viewport_size({"width": 600, "height": 760})
        desktop.get_by_text("needs a window of 800 px").wait_for()
        assert len(served.server.folder.participants) == number  # neither took a place
        desktop.set_viewport_size({"width": 900, "height": 760})
        desktop.get_by_role("button").click()
        desktop.wait_for_selector("#step:not([hidden]) .prose")
        for each in (page, phone, joining, desktop):
            each.context.close()
    finally:
        served.stop()


def test_the_first_tab_can_go_on_after_a_second_one(browser: Any, panel: Served) -> None:
    link = panel.link()
    first = opened(browser, link)
    first.wait_for_selector("#step:not([hidden]) .prose")
    second = opened(browser, link)
    second.wait_for_selector("#step:not([hidden]) .prose")
    first.wait_for_selector("#here")
    second.context.close()
    first.locator("#here").click()
    first.wait_for_selector("#step:not([hidden]) .prose")
    assert first.locator("#here").count() == 0
    first.context.close()


RULED = """\
title: Rules
consent: {title: Consent, text: "Runs are **stored**.", statements: [I take part.]}
practice:
  scenario: empty
  text: Reach the target.
  check: [{name: task, kind: yes_no, question: Must it be reached, right: true, until_right: true}]
  must_reach_goal: true
runs: [{scenario: empty}]
minimum_length: 2
minimum_distance: 0.5
must_reach_goal: true
requires: {round_trip: 0.3}
"""


@pytest.fixture
def ruled(study_folder: Path) -> Any:
    (study_folder / "study.yaml").write_text(RULED)
    served = Served(study_folder)
    yield served
    served.stop()


def test_rules_are_told_before_and_kept(browser: Any, ruled: Served, tmp_path: Path) -> None:
    tab = opened(browser, ruled.link(), accept_downloads=True)
    with tab.expect_download() as download:
        tab.get_by_role("button", name="Save this text").click()
    download.value.save_as(tmp_path / "consent.html")
    saved = (tmp_path / "consent.html").read_text(encoding="utf-8")
    assert "<strong>stored</strong>" in saved
    assert "I take part." in saved
    assert "p001" in saved
    tab.get_by_label("I take part.").check()
    tab.get_by_role("button", name="I agree", exact=True).click()
    tab.get_by_role("radio", name="no", exact=True).check()
    assert tab.locator(".prose").inner_text() == "Reach the target."
    go_on(tab)
    tab.wait_for_selector("#problem:not([hidden])")
    assert tab.inner_text("#problem").startswith("Not all answers are right.")
    tab.get_by_role("radio", name="yes", exact=True).check()
    go_on(tab)
    waiting(tab)
    drive_with_keys(tab, 300)
    end(tab)
    assert "Please try again: drive to the green target." in tab.inner_text("#card")
    assert tab.locator("#card").get_by_role("button").all_inner_texts() == ["Again"]
    for attempt in range(4):  # the fifth try may fail
        tab.locator("#card").get_by_role("button", name="Again").click()
        waiting(tab)
        drive_with_keys(tab, 300)
        end(tab)
        assert tab.locator("#card").get_by_role("button", name="Continue").count() == (attempt == 3)
    go_on(tab)
    waiting(tab)
    assert tab.inner_text("#hint").endswith(
        "Only runs that reach it count. Drive 0.5 m or more. Drive for 2 s or more."
    )
    drive_with_keys(tab, 300)
    end(tab)
    assert "Runs of 2 s or more can be kept." in tab.inner_text("#card")
    assert tab.problems == []
    tab.context.close()
    (row,) = results_of(ruled.out)["participants"]
    assert row["window"] == "1000x760"
    assert row["touch"] is False


def test_a_slow_connection_is_told_before_the_first_step(browser: Any, ruled: Served) -> None:
    link = ruled.link()
    with Proxy(ruled.port, delay=0.25) as proxy:
        tab = opened(browser, link.replace(str(ruled.port), str(proxy.port)))
        tab.wait_for_selector("#missing")
        assert tab.inner_text("#missing") == "The connection is measured …"  # nothing is asked before
        tab.locator("#missing", has_text="and 0.3 s are allowed").wait_for()
        tab.context.close()
    tab = opened(browser, link)
    tab.wait_for_selector("#tick-0")
    assert tab.locator("#missing").count() == 0
    tab.context.close()
