"""Slow, cut and repeated connections, a killed server, a closed tab, and other devices than the keyboard."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest
from websockets.exceptions import ConnectionClosed

from sonata2d.core.devices import NETWORK_DEVICE
from sonata2d.datasets import verify
from sonata2d.record.reader import read_episode

from .conftest import Served
from .proxy import Proxy
from .test_browser import at_first_run, at_practice, drive_with_keys, end, opened, waiting
from .test_server import client_of

FRAME_ROOM = "extends: empty\nlabel: {kind: classes, classes: [bad, fair, good], question: How is it, when: frame}\n"


def presses(path: Path) -> list[list[tuple[str, str, float]]]:
    """The events of each tick but those of the connection."""
    rows = [[*snapshot.events] for snapshot in read_episode(path).snapshots()]
    return [[(e.device, e.control, e.value) for e in row if e.device != NETWORK_DEVICE] for row in rows]


def test_a_bad_connection_loses_no_tick_and_doubles_none(served: Served) -> None:
    """Each tick has one event; messages are late, repeated after a cut, and answered at most once."""
    token, rng = served.link().rpartition("/")[2], random.Random(2)
    sent: dict[int, float] = {}
    paused: set[int] = set()
    with Proxy(served.port, delay=0.005, jitter=0.02, loss=0.05, stall=0.1) as proxy:
        number, cuts = 0, 0
        while number < 60:
            with client_of(f"http://127.0.0.1:{proxy.port}/s/{token}") as client:
                drive = client.prepare()["drive"]
                number, run = drive["ticks"], drive["run"]
                paused.add(number)
                wanted = number
                try:
                    while number < 60:
                        while wanted < number + 5:  # several on the way, some of them twice
                            value = sent.setdefault(wanted, round(rng.uniform(0.1, 1.0), 3))
                            event = {"device": "pad0", "control": "left_y", "value": -value}
                            tick = json.dumps({"type": "tick", "run": run, "number": wanted, "events": [event]})
                            client.socket.send(tick)
                            if rng.random() < 0.2:
                                client.socket.send(tick)
                            wanted += 1
                        answer = client.receive()
                        if answer["type"] == "tick":
                            number = max(number, answer["ticks"])
                        if cuts < 4 and number > 12 * (cuts + 1):
                            cuts += 1
                            proxy.cut()
                except (ConnectionClosed, TimeoutError):
                    continue
        with client_of(f"{served.url}/s/{token}") as client:
            drive = client.prepare()["drive"]
            client.ask(type="stop", run=drive["run"])
            client.ask(type="finish_practice", run=drive["run"])
    (path,) = (served.out / "discarded").iterdir()
    recorded = [events for events in presses(path) if not any(control == "stop" for _, control, _ in events)]
    assert len(recorded) >= 60
    for number, events in enumerate(recorded[:60]):
        assert [value for _, _, value in events if value] == [-sent[number]]
    assert cuts == 4
    assert len(paused) > 3
    assert verify(served.out / "discarded", replay=True, rerun=True) == []


def test_a_page_with_a_slow_connection(browser: Any, served: Served) -> None:
    token = served.link().rpartition("/")[2]
    with Proxy(served.port, delay=0.06, jitter=0.06, loss=0.02) as proxy:
        page = at_first_run(browser, f"{served.url}/s/{token}", f"http://127.0.0.1:{proxy.port}/s/{token}")
        drive_with_keys(page, 1000)
        proxy.cut()
        page.get_by_text("The connection is lost. Trying again …").wait_for()
        page.wait_for_selector("#status.paused")
        drive_with_keys(page, 500)
        end(page)
        page.get_by_role("radio", name="fair").check()
        page.get_by_role("button", name="Keep", exact=True).click()
        page.get_by_text("Effort").wait_for()
        assert [problem for problem in page.problems if "WebSocket" not in problem] == []
        page.context.close()
    (path,) = served.out.glob("p001__*.json")
    record = read_episode(path)
    assert 0.1 < sorted(record.round_trips[5:])[len(record.round_trips[5:]) // 2] < 0.6
    assert verify(served.out, replay=True, rerun=True) == []
    ticks = [snapshot.tick for snapshot in record.snapshots()]
    assert ticks == list(range(len(ticks)))


def test_a_closed_tab_stops_the_robot_and_keeps_the_journal(browser: Any, served: Served) -> None:
    link = served.link()
    page = at_practice(browser, link)
    page.locator("#canvas").focus()
    page.keyboard.down("w")
    page.wait_for_selector("#status.driving")
    page.wait_for_timeout(400)
    page.context.close()
    session = served.server.sessions["p001"].participant.session
    assert session is not None
    until = time.monotonic() + 10
    while session.state == "driving" and time.monotonic() < until:
        time.sleep(0.02)
    assert (session.state, session.ticks > 2) == ("paused", True)
    ticks = session.ticks
    page = opened(browser, link)
    page.wait_for_selector("#status.paused")
    assert served.server.sessions["p001"].participant.session is session
    assert session.ticks == ticks
    page.context.close()


@contextmanager
def server_process(folder: Path, port: int) -> Iterator[tuple[subprocess.Popen[str], dict[str, str]]]:
    """`sonata2d serve` in a process of its own, and its links."""
    command = f"-m sonata2d_cli serve study.yaml out --port {port} --participants 1 --json"
    words, pipe = [sys.executable, *command.split()], subprocess.PIPE
    process = subprocess.Popen(words, cwd=folder, stdout=pipe, stderr=pipe, text=True)
    try:
        assert process.stdout is not None
        printed = ""
        while not printed.rstrip().endswith("}"):
            line = process.stdout.readline()
            assert line, process.communicate()[1]
            printed += line
        yield process, json.loads(printed)
    finally:
        process.kill()
        process.communicate()


@pytest.mark.skipif(os.name != "posix", reason="SIGKILL exists on POSIX systems only")
def test_a_killed_server_goes_on_where_it_was(browser: Any, study_folder: Path) -> None:
    with server_process(study_folder, 0) as (process, links):
        port = int(re.findall(r":(\d+)/", links["p001"])[0])
        page = at_first_run(browser, links["p001"])
        drive_with_keys(page, 800)
        page.keyboard.down("w")
        page.wait_for_timeout(200)
        process.send_signal(signal.SIGKILL)
        page.get_by_text("The connection is lost. Trying again …").wait_for()
        page.keyboard.up("w")
    with server_process(study_folder, port):
        page.wait_for_selector("#status.paused")
        drive_with_keys(page, 400)
        end(page)
        page.get_by_role("radio", name="kind").check()
        page.get_by_role("button", name="Keep", exact=True).click()
        page.get_by_text("Effort").wait_for()
        page.context.close()
    (path,) = (study_folder / "out").glob("p001__*.json")
    assert read_episode(path).states.time[-1] > 1.0
    assert verify(study_folder / "out", replay=True, rerun=True) == []


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
def test_ctrl_c_twice_stops_the_server_without_a_traceback(study_folder: Path) -> None:
    with server_process(study_folder, 0) as (process, links):
        with urlopen(links["p001"]) as answer:  # it serves
            assert answer.status == 200
        process.send_signal(signal.SIGINT)
        time.sleep(0.01)  # else they are one signal
        process.send_signal(signal.SIGINT)
        process.wait(30)
        assert process.stderr is not None
        lines = process.stderr.read().splitlines()
    assert "Traceback (most recent call last):" not in lines
    assert lines[-1] in ("stopped; the same command continues the study", "interrupted")  # if it had nearly ended


def test_labels_are_given_while_driving(browser: Any, study_folder: Path) -> None:
    (study_folder / "room.yaml").write_text(FRAME_ROOM)
    served = Served(study_folder)
    try:
        page = at_first_run(browser, served.link())
        page.locator("#canvas").focus()
        page.keyboard.down("w")
        page.wait_for_selector("#status.driving")
        page.keyboard.press("2")
        page.wait_for_timeout(400)
        page.keyboard.press("PageUp")
        page.wait_for_timeout(400)
        page.locator("#while").get_by_role("radio", name="rude").check()  # with the mouse
        page.wait_for_timeout(200)
        page.keyboard.up("w")
        page.keyboard.down("a")  # keys still drive
        page.wait_for_timeout(300)
        page.keyboard.up("a")
        end(page)
        page.get_by_role("button", name="Keep", exact=True).click()
        page.get_by_text("Effort").wait_for()
        assert page.problems == []
        page.context.close()
    finally:
        served.stop()
    (path,) = served.out.glob("p001__*.json")
    labels = [frame.label["label"] for frame in read_episode(path).frames()]
    assert ("keyboard", "a", 1.0) in [event for row in presses(path) for event in row]
    assert [labels[0], *(b for a, b in pairwise(labels) if b != a)] == [None, 2, 3, 1]
    assert verify(served.out, replay=True, rerun=True) == []


GAME_PAD = """
window.pad = {mapping: "standard", connected: true, index: 0, id: "test", axes: [0, 0, 0, 0],
  buttons: Array.from({length: 16}, () => ({value: 0, pressed: false}))};
navigator.getGamepads = () => [window.pad];
"""


def driven_by_a_pad(browser: Any, link: str) -> Any:
    """A page on which a game pad drives ahead."""
    with client_of(link) as client:
        client.prepare()
    context = browser.new_context(viewport={"width": 1000, "height": 760})
    context.add_init_script(GAME_PAD)
    page = context.new_page()
    page.set_default_timeout(15_000)
    page.goto(link)
    waiting(page)
    page.evaluate("pad.axes = [0.2, -0.9, 0, 0]")
    page.wait_for_selector("#status.driving")
    return page


def test_a_game_pad_drives(browser: Any, served: Served) -> None:
    page = driven_by_a_pad(browser, served.link())
    page.wait_for_timeout(500)
    page.evaluate("pad.axes = [0, 0, 0, 0]")
    page.wait_for_timeout(200)
    for pressed in ("true", "false"):  # button A ends the run, and goes on from the practice
        page.evaluate(f"pad.buttons[0] = {{value: {int(pressed == 'true')}, pressed: {pressed}}}")
        page.wait_for_timeout(200)
    page.wait_for_selector("#card:not([hidden])")
    page.wait_for_timeout(600)  # a button that is pressed at once could be meant for the run
    page.evaluate("pad.buttons[0] = {value: 1, pressed: true}")
    page.wait_for_selector("#status.waiting")
    page.context.close()
    (path,) = (served.out / "discarded").iterdir()
    events = [event for row in presses(path) for event in row]
    assert {device for device, _, _ in events} == {"pad0", "window"}
    assert min(value for _, control, value in events if control == "left_y") == -0.9
