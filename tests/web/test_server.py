"""The server: links, messages that do not fit, two pages with one link, interruptions."""

from __future__ import annotations

import asyncio
import json
import random
import socket
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from sonata2d.record.reader import read_episode
from sonata2d.web.participant_session import ParticipantSession
from sonata2d.web.server import StudyServer, _Connection

from .conftest import Served


class Client:
    """A page without a browser."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket

    def ask(self, **message: Any) -> dict[str, Any]:
        """Send a message; returns the answer."""
        self.socket.send(json.dumps(message))
        return self.receive()

    def drain(self) -> None:
        """Receive until the server closes the connection."""
        while True:
            self.receive()

    def receive(self) -> dict[str, Any]:
        answer: dict[str, Any] = json.loads(self.socket.recv(timeout=10))
        return answer

    def prepare(self) -> dict[str, Any]:
        """Go on to the practice; returns what the page shows."""
        view = self.ask(type="hello", protocol=2)
        if view["step"]["kind"] == "page":
            self.ask(type="read", step="page-1")
            self.ask(type="consent", step="consent", ticked=[True])
            view = self.ask(type="answer", step="demographics", values={"age": 20})
        return view

    def tick(self, run: int, number: int, *events: tuple[str, str, float], **more: Any) -> dict[str, Any]:
        rows = [{"device": device, "control": control, "value": value} for device, control, value in events]
        return self.ask(type="tick", run=run, number=number, events=rows, **more)


@contextmanager
def client_of(link: str, **settings: Any) -> Iterator[Client]:
    with connect(link.replace("http", "ws", 1) + "/socket", **settings) as socket:
        yield Client(socket)


def fetch(url: str, data: bytes | None = None, **headers: str) -> tuple[int, bytes, Any]:
    request = urllib.request.Request(url, data, headers)
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, answer.read(), answer.headers
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read(), error.headers


def test_unknown_addresses_lead_nowhere(served: Served) -> None:
    for path in ("/s/unknown", "/j/unknown", "/static/../server.py", "/static/%2e%2e%2fserver.py", "/links.json"):
        assert fetch(served.url + path)[0] == 404
    assert fetch(served.url + "/")[0] == 200
    status, _, headers = fetch(served.link())
    assert status == 200
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert headers["Set-Cookie"] is None
    assert headers["Cache-Control"] == "no-store"


def test_the_open_link_needs_a_click_on_the_same_page(served: Served) -> None:
    link = f"{served.url}/j/{served.links.open}"
    assert fetch(link)[0] == 200
    assert served.server.folder.participants == []
    assert fetch(link, b"", Origin="https://example.org")[0] == 403
    status, page, _ = fetch(link, b"", Origin=served.url)
    assert (status, b"/static/page.js" in page) == (200, True)
    assert served.server.folder.participants == ["p001"]


def test_a_page_of_another_site_cannot_connect(served: Served) -> None:
    with pytest.raises(InvalidStatus), client_of(served.link(), origin="https://example.org"):
        pass


def test_an_unknown_link_is_told_so(served: Served) -> None:
    with client_of(f"{served.url}/s/unknown") as client, pytest.raises(ConnectionClosed) as caught:
        client.receive()
    assert caught.value.rcvd is not None
    assert caught.value.rcvd.code == 4003


def test_a_tick_that_arrives_twice_is_simulated_once(served: Served) -> None:
    with client_of(served.link()) as client:
        run = client.prepare()["drive"]["run"]
        first = client.tick(run, 0, ("keyboard", "w", 1.0), round_trip=0.04)
        assert (first["ticks"], first["status"]) == (1, "driving")
        again = client.tick(run, 0, ("keyboard", "w", 1.0), round_trip=0.04)
        assert (again["ticks"], again["state"]) == (1, first["state"])
        assert client.tick(run, 1)["ticks"] == 2
        assert client.tick(run, 7)["type"] == "view"  # some are missing: the page gets the present state
        client.socket.send(json.dumps({"type": "tick", "run": run + 1, "number": 2}))  # of another run: no answer
        assert client.tick(run, 2)["ticks"] == 3


def test_a_lost_connection_stops_the_robot_and_keeps_the_run(served: Served) -> None:
    link = served.link()
    with client_of(link) as client:
        run = client.prepare()["drive"]["run"]
        for number in range(5):
            client.tick(run, number, *([("keyboard", "w", 1.0)] if number == 0 else []))
    with client_of(link) as client:
        drive = client.prepare()["drive"]
        assert (drive["status"], drive["ticks"]) == ("paused", 5)
        client.tick(drive["run"], 5)
        client.ask(type="stop", run=drive["run"])
        client.ask(type="finish_practice", run=drive["run"])
    (path,) = (served.out / "discarded").iterdir()
    events = [[(e.control, e.value) for e in snapshot.events] for snapshot in read_episode(path).snapshots()]
    assert events[:6] == [[("w", 1.0)], [], [], [], [], [("w", 0.0)]]  # nobody presses the key any more


def test_the_server_starts_again_in_the_middle_of_a_run(served: Served) -> None:
    token = served.server.new_participant()
    with client_of(f"{served.url}/s/{token}") as client:
        run = client.prepare()["drive"]["run"]
        for number in range(4):
            client.tick(run, number)
        served.stop()
    served.start()
    with client_of(f"{served.url}/s/{token}") as client:
        drive = client.prepare()["drive"]
        assert (drive["status"], drive["ticks"]) == ("paused", 4)
        assert client.tick(drive["run"], 4)["ticks"] == 5


def test_the_memory_of_participants_who_are_away_is_freed(served: Served) -> None:
    away, here = served.link(), served.link()
    with client_of(away) as client:
        run = client.prepare()["drive"]["run"]
        for number in range(3):
            client.tick(run, number)
    with client_of(here) as client, client_of(f"{served.url}/r/{served.links.researcher}") as researcher:
        client.prepare()
        researcher.ask(type="overview")
        until = time.monotonic() + 10
        while set(served.server.sessions) != {"p002"} and time.monotonic() < until:
            served.call(served.server.close_sessions(0.0))
        assert set(served.server.sessions) == {"p002"}
        rows = researcher.ask(type="overview")["participants"]
        assert [row["step"] for row in rows] == ["practice-1", "practice-1"]
    with client_of(away) as client:
        drive = client.prepare()["drive"]
        assert (drive["status"], drive["ticks"]) == ("paused", 3)
        assert client.tick(drive["run"], 3)["ticks"] == 4


def test_a_page_replaces_its_own_lost_connection(study_folder: Path) -> None:
    served = Served(study_folder, takeover="first")
    try:
        link = served.link().replace("http", "ws", 1) + "/socket"
        with connect(f"{link}?page=a") as lost, connect(f"{link}?page=a") as again, connect(f"{link}?page=b") as other:
            assert Client(again).prepare()["drive"]["ticks"] == 0
            for loser, code in ((lost, 4001), (other, 4002)):
                with pytest.raises(ConnectionClosed) as caught:
                    Client(loser).drain()
                assert caught.value.rcvd is not None
                assert caught.value.rcvd.code == code
    finally:
        served.stop()


def test_a_page_is_told_that_it_is_replaced_while_its_session_opens(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The former page ends as soon as it is replaced, before the later one has closed it."""
    session_of, close = StudyServer._session_of, _Connection.close

    async def slow_session(server: StudyServer, id: str) -> ParticipantSession:
        page, session = server._pages[id], await session_of(server, id)
        while page.name == "former" and not page.is_replaced:
            await asyncio.sleep(0.01)
        return session

    async def slow_close(page: _Connection, code: int) -> None:
        await asyncio.sleep(0.2)
        await close(page, code)

    monkeypatch.setattr(StudyServer, "_session_of", slow_session)
    monkeypatch.setattr(_Connection, "close", slow_close)
    link = served.link().replace("http", "ws", 1) + "/socket"
    with connect(f"{link}?page=former") as former, connect(f"{link}?page=later") as later:
        assert Client(later).prepare()["drive"]["ticks"] == 0
        with pytest.raises(ConnectionClosed) as caught:
            Client(former).drain()
        assert caught.value.rcvd is not None
        assert caught.value.rcvd.code == 4001


def test_a_connection_without_a_request_is_closed(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sonata2d.web.protocol._TIMEOUT_S", 0.3)
    with client_of(served.link()) as client:
        silent, half = (socket.create_connection(("127.0.0.1", served.port), timeout=10) for _ in range(2))
        half.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n")
        for link in (silent, half):
            assert link.recv(1) == b""
            link.close()
        assert client.ask(type="hello", protocol=2)["type"] == "view"  # a page may be silent for longer


def test_a_damaged_file_is_named_to_the_researcher(served: Served) -> None:
    served.link()
    path = served.out / "study" / "answers" / "p001.jsonl"
    path.parent.mkdir()
    path.write_text("x\n")
    with client_of(f"{served.url}/r/{served.links.researcher}") as researcher:
        assert "p001.jsonl, line 1" in researcher.ask(type="overview")["problem"]


@pytest.mark.parametrize("takeover", ["newest", "first"])
def test_of_two_pages_with_one_link_one_drives(takeover: str, study_folder: Path) -> None:
    served = Served(study_folder, takeover=takeover)
    try:
        link = served.link()
        with client_of(link) as one:
            run = one.prepare()["drive"]["run"]
            one.tick(run, 0)
            with client_of(link) as two:
                if takeover == "first":
                    loser, code = two, 4002
                    assert one.tick(run, 1)["ticks"] == 2
                else:
                    loser, code = one, 4001
                    drive = two.prepare()["drive"]
                    assert two.tick(drive["run"], drive["ticks"])["ticks"] == 2
                with pytest.raises(ConnectionClosed) as caught:
                    loser.drain()
                assert caught.value.rcvd is not None
                assert caught.value.rcvd.code == code
    finally:
        served.stop()


def test_a_page_cannot_drive_faster_than_time_passes(served: Served) -> None:
    slept: list[float] = []

    async def sleep(seconds: float) -> None:
        slept.append(seconds)

    with client_of(served.link()) as client:
        run = client.prepare()["drive"]["run"]
        session = served.server.sessions["p001"]
        session._clock, session._sleep, session._filled = lambda: 0.0, sleep, 0.0
        for number in range(25):
            client.tick(run, number)
    assert [round(seconds, 3) for seconds in slept] == [round(0.1 * k / 1.1, 3) for k in range(1, 6)]


def hostile_messages(rng: random.Random, run: int) -> Iterator[str | bytes]:
    """Messages that no page sends, some of them about a participant's first run."""
    yield from ("", "null", "[]", "{}", "{", '"tick"', "\x00", b"\xff\xfe", '{"type": "tick"}', '{"type": "close"}')
    yield '{"type":"hello","protocol":99}'
    yield '{"type":"answer","step":"demographics","values":' + '{"a":' * 5000 + "1" + "}" * 5001
    yield json.dumps({"type": "read", "step": "../../etc/passwd"})
    yield json.dumps({"type": "keep", "run": run, "label": "x" * 5000})
    yield json.dumps({"type": "rate", "shown": 1, "label": True, "seconds": 1e300, "whole": True})
    while True:
        yield rng.randbytes(rng.randrange(200))
        yield json.dumps(
            {"type": rng.choice(["tick", "keep", "undo", "rate", "answer"]), "run": rng.choice([run, -1, 1e9])}
        )
        event = {
            "device": rng.choice(["keyboard", "network", "window", "../x"]),
            "control": "w",
            "value": rng.uniform(-2, 2),
        }
        yield json.dumps(
            {"type": "tick", "run": run, "number": rng.randrange(-1, 3), "events": [event] * rng.randrange(80)}
        )


def test_hostile_messages_disturb_nobody(
    served: Served, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """The long version of this test is benchmarks/hostile.py."""
    attacked, other = served.link(), served.link()
    with client_of(attacked) as attacker:
        messages = hostile_messages(random.Random(1), attacker.prepare()["drive"]["run"])
    with client_of(other) as client:
        run, number = client.prepare()["drive"]["run"], 0
        sent = 0
        while sent < 300:
            with client_of(attacked) as attacker:
                try:
                    for _ in range(30):
                        attacker.socket.send(next(messages))
                        sent += 1
                    attacker.drain()
                except (ConnectionClosed, TimeoutError):
                    pass
            number = client.tick(run, number)["ticks"]
        assert number > 5
        with client_of(attacked) as attacker:
            attacker.socket.send("x" * 100_000)
            with pytest.raises(ConnectionClosed):
                attacker.drain()
        assert client.tick(run, number)["ticks"] == number + 1
    captured = capfd.readouterr()
    assert "Traceback" not in captured.err + captured.out + caplog.text
    assert {path.name for path in served.folder.iterdir()} == {"study.yaml", "room.yaml", "recorded", "out"}
