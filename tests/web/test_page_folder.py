"""The folder of the page: from which distribution it is written, and how pages of both kinds use it in a browser."""

from __future__ import annotations

import hashlib
import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from sonata2d_cli import main

from sonata2d.errors import ConfigError
from sonata2d.record.reader import read_episode
from sonata2d.study.report import results_of
from sonata2d.web.page_folder import read_page, write_page

from .conftest import WHEEL_TAG, Served, answering, list_engine
from .proxy import Proxy
from .test_browser import at_practice, drive_with_keys, end, go_on, waiting
from .test_server import fetch


def test_the_page_has_what_it_needs_and_no_more(tmp_path: Path, distribution: Path, site: str) -> None:
    read: list[str] = []
    size = write_page(tmp_path / "page", f"{site}pyodide", index=f"{site}simple", advance=read.append)
    files = {
        path.relative_to(tmp_path / "page").as_posix() for path in (tmp_path / "page").rglob("*") if path.is_file()
    }
    assert {"index.html", "worker.js", "drawing.js", "sonata2d.zip", "pyodide/pyodide.asm.wasm"} <= files
    lock = json.loads((tmp_path / "page/pyodide/pyodide-lock.json").read_text())
    assert set(lock["packages"]) == {
        "numpy", "cffi", "orjson", "pyyaml", "pydantic", "pydantic-core", "lazy-loader", "cloudpickle",
        "annotated-types", "typing-extensions", "pycparser", "pymunk",
    }  # fmt: skip
    for entry in lock["packages"].values():
        wheel = (tmp_path / "page/pyodide" / entry["file_name"]).read_bytes()
        assert entry["sha256"] == hashlib.sha256(wheel).hexdigest()
    assert not any("scipy" in name for name in (*read, *files))
    assert size == sum((tmp_path / "page" / name).stat().st_size for name in files)
    data = (tmp_path / "page/index.html").read_text()
    assert "crowded-hall" in data
    assert "social-planner" in data
    assert write_page(tmp_path / "page", str(distribution), index=f"{site}simple") == size  # again


def test_a_wheel_of_ones_own_replaces_that_of_the_distribution(tmp_path: Path, distribution: Path, site: str) -> None:
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    (wheels / f"pydantic_core-2.0-{WHEEL_TAG}.whl").write_bytes(b"another")
    write_page(tmp_path / "page", str(distribution), wheels=wheels, index=f"{site}simple")
    packages = json.loads((tmp_path / "page/pyodide/pyodide-lock.json").read_text())["packages"]
    assert packages["pydantic-core"]["version"] == "2.0"
    assert (tmp_path / "page/pyodide" / packages["pydantic-core"]["file_name"]).read_bytes() == b"another"


def test_what_cannot_be_read_is_named(tmp_path: Path, distribution: Path, site: str) -> None:
    out = tmp_path / "page"

    def refused(source: object = distribution, index: str = f"{site}simple") -> str:
        with pytest.raises(ConfigError) as caught:
            write_page(out, str(source), index=index)
        assert not out.exists()  # nothing is written before everything is there
        return str(caught.value)

    assert "nowhere/pyodide-lock.json cannot be read" in refused(tmp_path / "nowhere")
    assert "simply/pymunk/ cannot be read: File not found" in refused(index=f"{site}simply")
    wheels = tmp_path / "old"
    wheels.mkdir()
    (wheels / f"pymunk-7.0-{WHEEL_TAG}.whl").write_bytes(b"")
    with pytest.raises(ConfigError, match=r"is pymunk 7\.0, and .* is installed here"):
        write_page(out, str(distribution), wheels=wheels)
    list_engine(tmp_path, "1.0")
    assert f"no wheel of pymunk {version('pymunk')} for pyemscripten_2026_0_wasm32" in refused()
    list_engine(tmp_path, version("pymunk"))
    (distribution / f"orjson-1.0-{WHEEL_TAG}.whl").write_bytes(b"cut")
    assert "is damaged" in refused()
    lock = json.loads((distribution / "pyodide-lock.json").read_text())
    del lock["packages"]["orjson"]
    (distribution / "pyodide-lock.json").write_text(json.dumps(lock))
    assert "lists no package orjson; --wheels names a folder" in refused()
    (distribution / "pyodide-lock.json").write_text("<html>")
    assert "is not the list of a distribution of Pyodide" in refused()
    with pytest.raises(ConfigError, match="has no wheels"):
        write_page(out, str(distribution), wheels=tmp_path / "none")


def test_the_command_writes_a_page(tmp_path: Path, distribution: Path, site: str, monkeypatch: Any) -> None:
    monkeypatch.setattr("sonata2d.web.page_folder.INDEX", f"{site}simple/")
    words = ["page", str(tmp_path / "page"), "--pyodide", str(distribution)]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    assert "http.server" in result.output
    assert (tmp_path / "page/index.html").exists()


def test_a_page_of_another_version_is_refused(tmp_path: Path, page: Path, monkeypatch: Any) -> None:
    (page / "private").mkdir()
    (page / "private" / "links.json").write_text("{}")
    content = read_page(page)
    assert "worker.js" in content
    assert not any("links" in name for name in content)  # only files of the page are served
    with pytest.raises(ConfigError, match="is no page of the simulator"):
        read_page(tmp_path)
    lock = (page / "pyodide/pyodide-lock.json").read_text()
    (page / "pyodide/pyodide-lock.json").write_text(lock.replace(f'"{version("pymunk")}"', '"7.0"'))
    with pytest.raises(ConfigError, match="of another version than this installation"):
        read_page(page)
    (page / "pyodide/pyodide-lock.json").write_text(lock)
    monkeypatch.setattr("sonata2d.web.page_folder._PARTS", ("version.py",))
    with pytest.raises(ConfigError, match="write it again: sonata2d page"):
        read_page(page)


# -- in a browser


def test_a_page_without_a_server(browser: Any, page: Path, site: str, tmp_path: Path) -> None:
    context = browser.new_context(viewport={"width": 1000, "height": 800}, accept_downloads=True)
    answering(context, tmp_path)
    tab = context.new_page()
    problems: list[str] = []
    tab.on("pageerror", lambda error: problems.append(str(error)))
    tab.goto(f"{site}page/index.html?scenario=empty&seed=4")
    tab.wait_for_selector("#status.waiting")
    tab.locator("#canvas").focus()
    tab.keyboard.down("ArrowUp")
    tab.wait_for_selector("#status.driving")
    tab.wait_for_timeout(800)
    tab.keyboard.up("ArrowUp")
    assert float(tab.inner_text("#speed").split()[0]) > 0.2
    tab.get_by_role("button", name="Pause").click()
    tab.wait_for_selector("#status.paused")

    tab.select_option("#controller", "straight-to-goal")  # opens the scene anew
    tab.wait_for_selector("#status.waiting")
    tab.get_by_role("button", name="Start").click()
    tab.wait_for_selector("#status.ended", timeout=40000)
    assert tab.inner_text("#hint") == "The robot reached its goal."
    with tab.expect_download() as download:
        tab.get_by_role("button", name="Save the episode").click()
    download.value.save_as(tmp_path / "saved.json")
    record = read_episode(tmp_path / "saved.json")
    assert (record.outcome.status, record.scene().seed) == ("goal", 4)

    tab.select_option("#controller", "own")
    code = tab.input_value("#code")
    tab.fill("#code", code.replace("math.atan2(y, x)", "math.atan2(y, oops)"))
    tab.get_by_role("button", name="Run this code").click()
    tab.wait_for_selector("#problem:not([hidden])")
    line = 1 + code.splitlines().index(next(row for row in code.splitlines() if "atan2" in row))
    assert tab.inner_text("#problem").startswith(f"Line {line}: NameError")
    tab.fill("#code", code)
    tab.get_by_role("button", name="Run this code").click()
    tab.wait_for_selector("#status.driving")
    assert tab.is_hidden("#problem")

    tab.select_option("#scenario", "lively")
    tab.locator("#wandering").fill("9")
    tab.locator("#standing").fill("0")
    tab.wait_for_function("drive => location.search.includes('wandering=9')")
    assert "standing=0" in tab.url
    assert "scenario=lively" in tab.url
    assert problems == []
    context.close()


class _Answered:
    """A browser whose workers ask a simulator of this Python; see `answering`."""

    def __init__(self, browser: Any, folder: Path, change: Any = lambda answer: answer) -> None:
        self._browser, self._folder, self._change = browser, folder, change

    def new_context(self, **settings: Any) -> Any:
        context = self._browser.new_context(**settings)
        answering(context, self._folder, self._change)
        return context


def test_a_study_shows_ticks_before_the_server_answers(
    browser: Any, study_folder: Path, page: Path, tmp_path: Path
) -> None:
    served = Served(study_folder, page=page)
    try:
        with Proxy(served.port, delay=0.2) as proxy:
            link = served.link()
            tab = at_practice(_Answered(browser, tmp_path), link, link.replace(str(served.port), str(proxy.port)))
            drive_with_keys(tab, 1500)
            end(tab)
            go_on(tab)
            waiting(tab)
            drive_with_keys(tab, 1500)
            end(tab)
            tab.get_by_label("fair").check()
            tab.locator("#card").get_by_role("button", name="Keep").click()
            tab.wait_for_selector("#step:not([hidden])")
            assert tab.problems == []
            tab.context.close()
        (path,) = served.out.glob("p001__*.json")
        record = read_episode(path)
        assert record.predicted.mean() > 0.5
        assert record.round_trip_summary()[0] > 0.35  # type: ignore[index]
        (row,) = results_of(served.out)["runs"]
        assert row["predicted"] > 0.5
    finally:
        served.stop()


def test_a_page_that_simulates_something_else_shows_the_server(
    browser: Any, study_folder: Path, page: Path, tmp_path: Path
) -> None:
    def shifted(answer: Any) -> Any:
        if answer and answer["type"] == "tick" and answer["ticks"] > 3:
            answer["state"]["robot"][0] += 1.0
        return answer

    served = Served(study_folder, page=page)
    try:
        with Proxy(served.port, delay=0.1) as proxy:
            link = served.link()
            proxied = link.replace(str(served.port), str(proxy.port))
            tab = at_practice(_Answered(browser, tmp_path, shifted), link, proxied)
            drive_with_keys(tab, 2000)
            tab.wait_for_timeout(500)
            session = served.server.sessions["p001"].driven_run
            assert session is not None
            shown = tab.evaluate("document.getElementById('goal').textContent")
            distance = session.after.robot.pose
            goal = session.scene.goal.position
            real = ((distance.x - goal[0]) ** 2 + (distance.y - goal[1]) ** 2) ** 0.5
            assert abs(float(shown.split(":")[1].split()[0]) - real) < 0.5
            controls = [(event.control, event.value) for events in session.past_events for event in events]
            assert controls.count(("predicted", 1.0)) == 1
            assert controls[-1:] != [("predicted", 1.0)]
            assert ("predicted", 0.0) in controls
            assert tab.problems == []
            tab.context.close()
    finally:
        served.stop()


def test_files_of_the_simulator_are_served_for_pages_only(study_folder: Path, page: Path) -> None:
    served = Served(study_folder, page=page)
    try:
        place = served.server._simulator_place
        status, content, headers = fetch(f"{served.url}{place}pyodide/pyodide.asm.wasm")
        assert (status, content) == (200, b"pyodide.asm.wasm")
        assert headers["Content-Type"] == "application/wasm"
        assert "immutable" in headers["Cache-Control"]
        status, content, headers = fetch(f"{served.url}{place}drive.js", **{"Accept-Encoding": "gzip"})
        assert headers["Content-Encoding"] == "gzip"
        assert content.startswith(b"\x1f\x8b")
        for name in (
            f"{place}missing.js",
            f"{place}../{place}drive.js",
            "/simulator/0/drive.js",
            f"{place}%2e%2e/study.yaml",
        ):
            assert fetch(served.url + name)[0] == 404
    finally:
        served.stop()
