"""The researcher's page: progress, live view, break, links, export, agreement; and the preview."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from sonata2d_cli.main import main
from websockets.exceptions import ConnectionClosed, InvalidStatus

from sonata2d.datasets import verify
from sonata2d.study.export import export_study
from sonata2d.study.participant import Participant

from .conftest import Served
from .test_browser import at_practice, end, go_on, opened, prepare
from .test_server import Client, client_of, fetch


def page_of(served: Served) -> str:
    return f"{served.url}/r/{served.links.researcher}"


def finish_practice(client: Client) -> dict[str, Any]:
    """Go on to the first run."""
    run = client.prepare()["drive"]["run"]
    for number in range(4):
        client.tick(run, number, round_trip=0.02)
    client.ask(type="stop", run=run)
    return client.ask(type="finish_practice", run=run)


def keep_a_run(client: Client, run: int) -> dict[str, Any]:
    for number in range(6):
        client.tick(run, number)
    client.ask(type="stop", run=run)
    return client.ask(type="keep", run=run, label=2)


def test_only_the_researcher_sees_the_page(served: Served) -> None:
    token = served.link().rpartition("/")[2]
    for other in ("unknown", token, served.links.open):
        assert fetch(f"{served.url}/r/{other}")[0] == 404
        assert fetch(f"{served.url}/r/{other}/export.zip?personal=1")[0] == 404
        with pytest.raises((ConnectionClosed, InvalidStatus)), client_of(f"{served.url}/r/{other}") as client:
            client.receive()
    assert fetch(page_of(served))[0] == 200
    with client_of(page_of(served)) as client:  # a message of participants
        assert client.ask(type="hello", protocol=2)["type"] == "error"


def test_progress_of_participants(served: Served) -> None:
    served.server.new_participant()
    with client_of(served.link()) as participant, client_of(page_of(served)) as researcher:
        first, second = researcher.ask(type="overview")["participants"]
        assert (first["kind"], first["progress"], first["isOpen"], first["status"]) == ("page", [0, 12], False, None)
        assert second["isOpen"] is True
        keep_a_run(participant, finish_practice(participant)["drive"]["run"])
        first, second = researcher.ask(type="overview")["participants"]
        assert (second["kind"], second["step"], second["runs"]) == ("questions", "after-run-1", [1, 3])
        assert (second["isOpen"], second["roundTrip"], second["language"]) == (True, 0.02, "en")
        assert second["lastEvent"].startswith("20")
    served.stop()
    served.start()  # what is stored says the same
    with client_of(page_of(served)) as researcher:
        again = researcher.ask(type="overview")["participants"][1]
        same = ("id", "token", "kind", "step", "progress", "runs", "language", "lastEvent")
        assert [again[key] for key in same] == [second[key] for key in same]
        assert again["isOpen"] is False


def test_all_runs_are_paused_and_go_on(served: Served) -> None:
    with client_of(served.link()) as participant, client_of(page_of(served)) as researcher:
        run = participant.prepare()["drive"]["run"]
        participant.tick(run, 0, ("keyboard", "w", 1.0))
        assert researcher.ask(type="pause_study", value=True)["isStudyPaused"] is True
        paused = participant.tick(run, 1)
        assert (paused["ticks"], paused["status"], paused["isStudyPaused"]) == (1, "paused", True)
        assert researcher.ask(type="pause_study", value=False)["isStudyPaused"] is False
        assert participant.tick(run, 1)["ticks"] == 2


def test_the_live_view_sends_a_scene_once(served: Served) -> None:
    with client_of(served.link()) as participant, client_of(page_of(served)) as researcher:
        assert researcher.ask(type="look", participant="p001")["drive"] is None
        run = participant.prepare()["drive"]["run"]
        first = researcher.ask(type="look", participant="p001")["drive"]
        assert first["data"]["robotRadius"] > 0
        state = participant.tick(run, 0)["state"]
        second = researcher.ask(type="look", participant="p001", scene=first["scene"])["drive"]
        assert (second["ticks"], second["state"], "data" in second) == (1, state, False)


def test_links_for_new_participants(served: Served) -> None:
    with client_of(page_of(served)) as researcher:
        rows = researcher.ask(type="add", count=3)["participants"]
        assert [row["id"] for row in rows] == ["p001", "p002", "p003"]
        assert len({row["token"] for row in rows}) == 3
        assert researcher.ask(type="add", count=0)["type"] == "error"


def test_the_export_has_everything_but_links(served: Served, tmp_path: Path) -> None:
    with client_of(served.link()) as participant:
        keep_a_run(participant, finish_practice(participant)["drive"]["run"])
        status, data, headers = fetch(f"{page_of(served)}/export.zip")
        assert (status, headers["Content-Disposition"]) == (200, 'attachment; filename="out.zip"')
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path / "copy")
        assert b",choices," not in archive.read("tables/answers.csv")
    copy = tmp_path / "copy"
    assert verify(copy, replay=True, rerun=True) == []
    assert {"tables/runs.csv", "study/answers/p001.jsonl", "rated/polite/000000.json", "study/study.json"} <= {*names}
    assert not any("personal" in name or "links" in name or ".lock" in name for name in names)
    token = served.links.tokens()["p001"].encode()
    assert not any(token in path.read_bytes() for path in copy.rglob("*") if path.is_file())
    assert not [*(served.out / "study").glob("*.zip")]
    with zipfile.ZipFile(export_study(served.out, tmp_path / "all.zip", personal=True)) as archive:
        assert b'"age":20' in archive.read("study/personal/p001.jsonl")
        assert b"demographics,,age,,20" in archive.read("tables/answers.csv")


def test_agreement_of_ratings(served: Served) -> None:
    with client_of(page_of(served)) as researcher:
        (before,) = researcher.ask(type="agreement")["blocks"]
        assert (before["ratings"], before["alpha"], before["same"]) == (0, None, None)
        for answers in ([True] * 5, [True] * 3 + [False] * 2):
            served.server.new_participant()
            participant = Participant(served.server.folder, served.server.folder.participants[-1])
            while participant.step.kind != "ratings":
                participant.skip(participant.step.id)
            for answer in answers:
                participant.rate(answer, seconds=1.0, whole=True)
            participant.close()
        (block,) = researcher.ask(type="agreement")["blocks"]
    assert (block["raters"], block["ratings"], block["shared"]) == (2, 10, 5)
    assert block["measure"] == "Krippendorff's alpha, nominal"
    assert block["alpha"] == pytest.approx(1 - 9 * 4 / (2 * 8 * 2))  # 2 disagreements; 8 yes and 2 no
    assert len(block["disputed"]) == 2
    assert set(block["disputed"][0]["labels"].values()) == {"yes", "no"}


def test_the_page_in_a_browser(browser: Any, served: Served, tmp_path: Path) -> None:
    participant = at_practice(browser, served.link())
    page = opened(browser, page_of(served), accept_downloads=True)
    page.wait_for_selector("#rows tr")
    participant.bring_to_front()
    participant.locator("#canvas").focus()
    participant.keyboard.down("w")
    participant.wait_for_selector("#status.driving")
    page.locator("#rows button", has_text="p001").evaluate("button => button.click()")
    page.wait_for_selector("#screen:not([hidden])")
    page.get_by_text("practises (practice-1) · recording").wait_for()
    page.locator("#pause").evaluate("button => button.click()")
    participant.get_by_text("The study is paused for a moment. Please wait.").wait_for()
    participant.wait_for_selector("#status.paused")
    page.locator("#pause").evaluate("button => button.click()")
    participant.get_by_text("Paused. Drive on when you are ready.").wait_for()
    participant.keyboard.up("w")
    participant.keyboard.down("w")
    participant.wait_for_selector("#status.driving")
    participant.keyboard.up("w")
    page.bring_to_front()
    page.locator("#number").fill("2")
    page.get_by_role("button", name="Make links").click()
    page.wait_for_selector("#rows tr:nth-child(3)")
    link = page.get_by_label("Link p003").input_value()
    assert fetch(link)[0] == 200
    with page.expect_download() as download:
        page.get_by_role("link", name="Download all without personal answers").click()
    download.value.save_as(tmp_path / "export.zip")
    assert "study/answers/p001.jsonl" in zipfile.ZipFile(tmp_path / "export.zip").namelist()
    assert page.problems == participant.problems == []
    page.context.close()
    participant.context.close()


def test_steps_of_a_preview_can_be_skipped(browser: Any, study_folder: Path) -> None:
    served = Served(study_folder, is_preview=True)
    try:
        page = opened(browser, served.link())
        page.wait_for_selector("#preview:not([hidden])")
        titles = []
        while page.locator("#skip").is_visible():
            before = page.locator("#progress").get_attribute("value")
            titles.append(before)
            page.get_by_role("button", name="Skip this step").click()
            page.locator(f'#progress:not([value="{before}"])').wait_for()
        assert len(titles) == 12
        assert page.problems == []
        page.context.close()
    finally:
        served.stop()


def test_steps_of_a_study_cannot_be_skipped(served: Served) -> None:
    with client_of(served.link()) as client:
        view = client.ask(type="hello", protocol=2)
        assert view["isPreview"] is False
        skipped = client.ask(type="skip", step="page-1")
        assert (skipped["step"]["id"], skipped["problem"]) == ("page-1", "steps can be skipped in a preview only")


def test_help_shows_keys_and_symbols(browser: Any, served: Served) -> None:
    page = opened(browser, served.link())
    prepare(page)
    page.locator("#canvas").focus()
    page.keyboard.down("w")
    page.wait_for_selector("#status.driving")
    page.keyboard.up("w")
    page.keyboard.press("F1")
    page.wait_for_selector("#status.paused")
    assert page.locator("#help").get_by_text("personal space", exact=True).is_visible()
    assert page.locator("#legend li").count() >= 2
    page.get_by_role("button", name="Close").click()
    page.keyboard.press("h")
    assert not page.locator("#readings").is_visible()
    end(page)
    go_on(page)
    assert page.problems == []
    page.context.close()


def test_completions_by_condition_filter_and_undefined_agreement(browser: Any, study_folder: Path) -> None:
    path = study_folder / "study.yaml"
    blocks = "order: between\nruns:\n  - {scenario: plain.yaml, runs: 1}\n  - scenario: room.yaml\n    runs: 1"
    (study_folder / "plain.yaml").write_text("extends: sonata-2020\n")
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("runs:\n  - scenario: room.yaml\n    runs: 3", blocks), encoding="utf-8")
    served = Served(study_folder)
    try:
        for k in range(3):
            served.server.new_participant()
            participant = Participant(served.server.folder, f"p00{k + 1}")
            while participant.step.kind != "thanks" and not (k == 2 and participant.step.kind == "run"):
                if participant.step.kind == "ratings":
                    participant.rate(True, seconds=1.0, whole=True)
                else:
                    participant.skip(participant.step.id)
            participant.close()
        with client_of(page_of(served)) as client:
            overview = client.ask(type="overview")
            assert overview["conditions"] == ["0: plain", "1: room"]
            assert [row["condition"] for row in overview["participants"]] == ["0: plain", "1: room", "0: plain"]
        page = opened(browser, page_of(served))
        page.get_by_text("Finished, by condition: 0: plain (1), 1: room (1)", exact=True).wait_for()
        page.get_by_text("Krippendorff's alpha, nominal: undefined").wait_for()
        assert re.search(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d \(\d+ .*ago\)", page.locator("#rows").inner_text())
        visible = page.locator("#rows tr:visible")
        for words, count in (("plain", 2), ("plain finished", 1), ("nobody", 0), ("", 3)):
            page.get_by_label("Show only rows with").fill(words)
            assert visible.count() == count
        assert page.problems == []
        page.context.close()
    finally:
        served.stop()


def test_places_of_the_quota_by_answer(browser: Any, study_folder: Path) -> None:
    path = study_folder / "study.yaml"
    question = "question: {en: Gender, de: Geschlecht, zh: 性别}"
    classes = "classes: {en: [woman, man], de: [Frau, Mann], zh: [女, 男]}"
    asked = f"  - {{name: gender, kind: classes, {classes}, {question}}}\n"
    text = path.read_text(encoding="utf-8").replace("demographics:\n", f"demographics:\n{asked}")
    path.write_text(text + "quota: {question: gender, places: [3, 2]}\n", encoding="utf-8")
    result = CliRunner().invoke(main, ["study", "check", str(path)])
    assert result.output.splitlines()[-1] == "places by gender: woman 3, man 2"
    served = Served(study_folder)
    try:
        for answer in (1, 2, 2):
            served.server.new_participant()
            participant = Participant(served.server.folder, served.server.folder.participants[-1])
            while participant.step.id != "demographics":
                participant.skip(participant.step.id)
            participant.answer("demographics", {"gender": answer, "age": 30})
            participant.close()
        page = opened(browser, page_of(served))
        page.get_by_text("Places taken, by the answer to “gender”: woman (1/3), man (2/2)", exact=True).wait_for()
        assert page.problems == []
        page.context.close()
        personal = served.server.folder.personal_of("p001")
        personal.write_text("x\n" + personal.read_text())
    finally:
        served.stop()
    again = Served(study_folder)
    try:
        with client_of(page_of(again)) as client:
            overview = client.ask(type="overview")  # the page works with a damaged file, and names it
            assert len(overview["participants"]) == 3
            assert "p001.jsonl, line 1" in overview["problem"]
    finally:
        again.stop()


def test_a_study_without_conditions_shows_none(browser: Any, served: Served) -> None:
    page = opened(browser, page_of(served))
    page.wait_for_selector("#rows", state="attached")
    page.wait_for_function("document.getElementById('summary').textContent")
    assert not page.locator("#completions").is_visible()
    assert not page.locator("#quota").is_visible()
    page.context.close()
