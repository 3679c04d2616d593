"""Connections that are stalled, replaced or hostile, and the messages about problems that pages receive."""

from __future__ import annotations

import logging
import socket
import threading
import time
from contextlib import suppress
from http.client import HTTPException
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus

from sonata2d.errors import ConfigError, RecordError
from sonata2d.study.participant import Participant
from sonata2d.web.serve import _check_url

from .conftest import Served
from .test_server import client_of, fetch


def raw_page(served: Served, link: str) -> socket.socket:
    """A web socket whose other side reads only what a test reads."""
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    raw.settimeout(10)
    raw.connect(("127.0.0.1", served.port))
    lines = [
        f"GET {link.removeprefix(served.url)}/socket HTTP/1.1", "Host: x", "Upgrade: websocket", "Connection: Upgrade",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13", "", "",
    ]  # fmt: skip
    raw.sendall("\r\n".join(lines).encode())
    assert b"101" in raw.recv(1000)
    return raw


def frame(data: bytes) -> bytes:
    """A short text message of a web socket."""
    return bytes([0x81, 0x80 | len(data)]) + b"\0\0\0\0" + data


def test_a_page_that_reads_nothing_keeps_nobody_out(served: Served) -> None:
    link = served.link()
    with client_of(link) as client:
        client.prepare()
    raw = raw_page(served, link)
    raw.settimeout(1.0)
    with suppress(TimeoutError):  # until the server reads no more, because nothing is read of what it sent
        while True:
            raw.sendall(frame(b'{"type":"hello","protocol":1}') * 10)
    began = time.monotonic()
    with client_of(link) as client:
        assert client.ask(type="hello", protocol=2)["type"] == "view"
        assert time.monotonic() - began < 5.0
        assert served.server._open <= 2
    for _ in range(5):
        with client_of(link):
            pass
    until = time.monotonic() + 10
    while served.server._open and time.monotonic() < until:
        time.sleep(0.05)
    assert served.server._open == 0
    raw.close()


def test_each_request_of_a_connection_must_be_complete(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sonata2d.web.protocol._TIMEOUT_S", 0.3)
    with socket.create_connection(("127.0.0.1", served.port), timeout=4) as raw:
        raw.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        assert b"200 OK" in raw.recv(4096)
        raw.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n")
        while raw.recv(4096):
            pass  # until the server closes the connection


def test_bytes_that_are_no_text_leave_no_traceback(
    served: Served, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    for count in (1, 3):
        raw = raw_page(served, served.link())
        raw.sendall(frame(b"\xff\xfe") * count)
        with suppress(ConnectionResetError):
            assert raw.recv(1000)[:4] in (b"\x88\x02\x03\xef", b"")  # closed with code 1007
        raw.close()
    captured = capfd.readouterr()
    assert "Traceback" not in captured.err + captured.out + caplog.text


def test_a_request_that_the_server_stops_leaves_no_traceback(
    study_folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    has_begun = threading.Event()

    def slow_archive(*_: object, **__: object) -> None:
        has_begun.set()
        time.sleep(3)  # longer than the server waits for it

    monkeypatch.setattr("sonata2d.web.server.write_archive", slow_archive)
    served = Served(study_folder)

    def download() -> None:
        with suppress(OSError, HTTPException):
            fetch(f"{served.url}/r/{served.links.researcher}/export.zip")

    downloading = threading.Thread(target=download)
    downloading.start()
    has_begun.wait()
    served.stop()
    downloading.join()
    assert "a request was not answered, because the server stops" in caplog.messages
    assert "Traceback" not in caplog.text


def test_numbers_of_runs_are_new_after_a_restart(served: Served) -> None:
    token = served.link().rpartition("/")[2]
    numbers = []
    for _ in range(2):
        with client_of(f"{served.url}/s/{token}") as client:
            drive = client.prepare()["drive"]
            numbers.append(drive["run"])
            client.tick(drive["run"], drive["ticks"])
        served.stop()
        served.start()
    assert numbers[0] != numbers[1]


def test_a_view_in_the_middle_of_a_run_releases_all_controls(served: Served) -> None:
    with client_of(served.link()) as client:
        run = client.prepare()["drive"]["run"]
        client.tick(run, 0, ("keyboard", "w", 1.0))
        assert client.tick(run, 1)["status"] == "driving"
        view = client.ask(type="language", language="de")
        assert (view["language"], view["drive"]["status"]) == ("de", "paused")
        session = served.server.sessions["p001"].participant.session
        assert session is not None
        for number in range(2, 20):
            client.tick(run, number)
        assert abs(session.after.robot.twist.vx) < 0.01
        view = client.ask(type="tick", run=run, number=99)  # messages are missing before this one
        assert view["drive"]["status"] == "paused"


def test_a_page_of_the_announced_address_may_connect(study_folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    served = Served(study_folder, url="https://study.example.org")
    try:
        link = served.link()
        with client_of(link, origin="https://study.example.org") as client:
            assert client.ask(type="hello", protocol=2)["type"] == "view"
        for _ in range(2):
            with pytest.raises(Exception, match="403"), client_of(link, origin="https://evil.example"):
                pass
        warnings = [record for record in caplog.records if record.levelno == logging.WARNING]
        assert [record.name for record in warnings] == ["sonata2d.web.server"]  # once
        assert "https://evil.example" in warnings[0].getMessage()
        assert "Host header" in warnings[0].getMessage()
    finally:
        served.stop()


@pytest.mark.parametrize("origin", ["http://[", "http://[::1", "//]", "null", "http://[x]", ""])
def test_an_origin_that_is_no_address_is_of_another_site(served: Served, origin: str) -> None:
    assert fetch(f"{served.url}/j/{served.links.open}", b"", Origin=origin)[0] == 403
    for link in (served.link(), f"{served.url}/r/{served.links.researcher}"):
        with pytest.raises(InvalidStatus) as caught, client_of(link, additional_headers={"Origin": origin}):
            pass
        assert caught.value.response.status_code == 403
    assert fetch(served.url, Host="[")[0] == 200


@pytest.mark.parametrize("number", [2**53 + 1, 2**63, 2**64, -(2**64), 10**400])
def test_a_number_that_cannot_be_sent_back_is_refused(served: Served, number: int) -> None:
    with client_of(served.link()) as client, client_of(f"{served.url}/r/{served.links.researcher}") as researcher:
        run = client.prepare()["drive"]["run"]
        client.tick(run, 0)
        client.ask(type="stop", run=run)
        for message in (
            {"type": "tick", "run": run, "number": number}, {"type": "tick", "run": number, "number": 0},
            {"type": "stop", "run": number}, {"type": "rate", "shown": number, "label": 1, "seconds": 1, "whole": True},
            {"type": "hello", "protocol": number},
        ):  # fmt: skip
            answer = client.ask(**message)
            assert (answer["type"], answer["problemKind"]) == ("error", "refused"), message
        answer = client.ask(type="answer", step="practice-1", values={"age": number})
        assert answer["problemKind"] == "refused"
        assert client.tick(run, 2**53)["status"] == "ended"
        assert researcher.ask(type="add", count=number)["type"] == "error"


def test_idle_strangers_keep_nobody_out(study_folder: Path) -> None:
    served = Served(study_folder, connections=5)
    try:
        link = served.link()
        with client_of(link) as client:
            strangers = [socket.create_connection(("127.0.0.1", served.port), timeout=10) for _ in range(170)]
            assert fetch(link)[0] == 200
            strangers += [raw_page(served, f"{served.url}/s/unknown") for _ in range(120)]  # they do not close
            assert fetch(link)[0] == 200
            assert strangers[0].recv(1) == b""  # the oldest is cut off
            assert client.prepare()["drive"]["ticks"] == 0
            for each in strangers:
                each.close()
    finally:
        served.stop()


@pytest.mark.parametrize("url", ["study.example.org", "ftp://example.org", "https://example.org/study", "https:///x"])
def test_an_address_that_no_link_can_have_is_refused(url: str) -> None:
    _check_url("https://study.example.org:8443/")
    with pytest.raises(ConfigError, match="--url"):
        _check_url(url)


def test_addresses_without_a_page_are_answered_in_the_language_of_the_browser(served: Served) -> None:
    for path, code in (("/", 200), ("/s/unknown", 404), ("/elsewhere", 404), ("/static/none", 404)):
        status, body, _ = fetch(served.url + path, **{"Accept-Language": "de-AT,en;q=0.5"})
        assert status == code
        assert '<html lang="de">' in body.decode()
    assert "Unbekannter Link" in body.decode()


def test_a_run_that_cannot_be_continued_is_announced(served: Served) -> None:
    token = served.link().rpartition("/")[2]
    with client_of(f"{served.url}/s/{token}") as client:
        drive = client.prepare()["drive"]
        assert drive["isRestarted"] is False
        client.tick(drive["run"], 0)
    served.stop()
    (journal,) = (served.out / "journal").glob("p001*.jsonl")
    journal.write_text("x\ny\nz\n")
    served.start()
    with client_of(f"{served.url}/s/{token}") as client:
        drive = client.prepare()["drive"]
        assert (drive["isRestarted"], drive["ticks"]) == (True, 0)
        client.tick(drive["run"], 0)
        assert client.ask(type="hello", protocol=2)["drive"]["isRestarted"] is False


def test_participants_see_no_paths_of_the_server(
    served: Served, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: object) -> None:
        raise RecordError(f"{served.out} cannot be written: No space left on device")

    with client_of(served.link()) as client:
        client.ask(type="hello", protocol=2)
        monkeypatch.setattr(Participant, "read", fail)
        view = client.ask(type="read", step="page-1")
        assert (view["problemKind"], str(served.out) in view["problem"]) == ("failed", False)
        assert "No space left on device" in caplog.text
        refused = client.ask(type="consent", step="consent", ticked=[True])
        assert (refused["problemKind"], refused["problem"]) == ("refused", "the present step is page-1, not consent")
