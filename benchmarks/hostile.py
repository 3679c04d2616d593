"""Hostile messages and requests to a study's server, while a participant drives.

python benchmarks/hostile.py [--count 10000] [--seed 0]

A third of the attacks each: web-socket messages with a valid token (random bytes, wrong types, huge numbers, deep
nesting, messages out of turn), HTTP requests (path names, tokens of others, wrong methods, long addresses and headers),
and bytes that are no HTTP at all. Reports what the server wrote to its log, which files exist outside the study's
folder, and how the other participant was affected.
"""

from __future__ import annotations

import argparse
import asyncio
import http.client
import json
import os
import random
import socket
import string
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

import websockets
from study_server import served_study

from sonata2d.datasets import verify

STUDY = """\
title: Hostile
pages: [{title: Welcome, text: Hello}]
demographics: [{name: age, kind: number, question: Age}, {name: remark, kind: text, question: Remark, required: false}]
runs: [{scenario: sonata-2020, runs: 50}]
"""
TYPES = (
    "hello", "language", "read", "consent", "decline", "reconsider", "answer", "tick", "pause", "stop", "keep",
    "finish_practice", "discard", "redo", "undo", "rate", "rest", "skip", "pause_study", "add", "look", "agreement",
)  # fmt: skip
FIELDS = (
    "protocol", "language", "step", "ticked", "values", "run", "number", "events", "round_trip", "dropped", "label",
    "shown", "seconds", "whole", "count", "participant", "scene", "value", "__class__", "constructor",
)  # fmt: skip
PATHS = (
    "/../../etc/passwd", "/static/../../links.json", "/static/..%2f..%2fserver.py", "/static/%00", "/study/links.json",
    "/s/", "/j/", "/r/", "/s/../../x", "/r/x/export.zip?personal=1", "/s/{token}/../../links", "/r/{token}",
    "/r/{token}/export.zip?personal=1", "/j/{token}", "/s/{token}/socket", "/.git/config", "//evil.example/", "/%ff",
)  # fmt: skip


def value(rng: random.Random, depth: int = 0) -> Any:
    """A JSON value that some field might not expect."""
    kinds = [
        lambda: rng.choice([True, False, None, "", 0, -1, 1e308, -1e308, 2**70, 1.5, "__proto__", "../../x", "\u0000"]),
        lambda: "".join(rng.choices(string.printable, k=rng.randrange(200))),
        lambda: rng.choice(["page-1", "demographics", "run-1", "en", "p001", "'; DROP TABLE runs; --", "=1+1"]),
        lambda: rng.randrange(-3, 30),
    ]
    if depth < 3:
        kinds += [
            lambda: [value(rng, depth + 1) for _ in range(rng.randrange(5))],
            lambda: {rng.choice(FIELDS): value(rng, depth + 1) for _ in range(rng.randrange(5))},
            lambda: [{"device": "keyboard", "control": "w", "value": rng.uniform(-2, 2)}] * rng.randrange(70),
        ]
    return rng.choice(kinds)()


def out_of_turn(rng: random.Random, run: int) -> str:
    """A message that could be right at another moment; most are about the present run."""
    run, number = rng.choice([run, run, run, run - 1, 1]), rng.choice([0, 1, 2, 3, 50, 10**9])
    event = {"device": rng.choice(["keyboard", "touch", "label"]), "control": rng.choice(["w", "value"]), "value": 1.0}
    return json.dumps(
        rng.choice(
            [
                {"type": "hello", "protocol": 2},
                {"type": "language", "language": rng.choice(["en", "xx"])},
                {"type": "read", "step": rng.choice(["page-1", "run-1"])},
                {"type": "answer", "step": "demographics", "values": {"age": value(rng), "remark": value(rng)}},
                {"type": "tick", "run": run, "number": number, "events": [event] * rng.randrange(5)},
                {"type": "tick", "run": run, "number": number, "round_trip": 3599.0, "dropped": 10**6},
                {"type": "keep", "run": run, "label": value(rng)},
                {"type": "rate", "shown": run, "label": True, "seconds": 1e6, "whole": True},
                *({"type": kind, "run": run} for kind in ("pause", "stop", "discard", "redo", "finish_practice")),
                *({"type": kind} for kind in ("undo", "rest", "reconsider")),
            ]
        )
    )


def message(rng: random.Random, run: int) -> str | bytes:
    """A message of a web socket."""
    kind = rng.random()
    if kind > 0.5:
        return out_of_turn(rng, run)
    if kind < 0.2:
        return rng.randbytes(rng.randrange(300))
    if kind < 0.23:
        return '{"type":"answer","step":"demographics","values":' + '{"a":' * 9000 + "1" + "}" * 9000 + "}"
    if kind < 0.25:
        return "x" * rng.choice([65_000, 70_000, 1_000_000])
    fields = {rng.choice(FIELDS): value(rng) for _ in range(rng.randrange(6))}
    text = json.dumps({"type": rng.choice(TYPES)} | fields)
    return text[: rng.randrange(len(text))] if rng.random() < 0.1 else text


def request(rng: random.Random, tokens: list[str]) -> tuple[str, str, dict[str, str], bytes]:
    """Method, path, headers and body of a request."""
    path = rng.choice(PATHS).replace("{token}", rng.choice([*tokens, "x" * 22]))
    if rng.random() < 0.3:
        path = "/" + "".join(rng.choices("./%\\x0aA0" + string.ascii_letters, k=rng.randrange(1, 300)))
    if rng.random() < 0.05:
        path = "/s/" + "A" * 20_000
    headers = {}
    if rng.random() < 0.3:
        name = rng.choice(["Origin", "Host", "X-Forwarded-For", "Range", "Content-Length", "Upgrade", "Cookie"])
        headers[name] = quote(str(value(rng)))[: rng.choice([100, 70_000])]
    method = rng.choice(["GET", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "TRACE", "PROPFIND"])
    return method, quote(path, safe="/%?=&.:\\"), headers, rng.randbytes(rng.choice([0, 10, 100_000]))


async def attack_socket(url: str, rng: random.Random, count: int, seen: Counter[str]) -> None:
    """Messages with a participant's token."""
    done, run = 0, 1
    while done < count:
        try:
            async with websockets.connect(url, max_size=None) as link:
                for _ in range(rng.randrange(1, 40)):
                    data = message(rng, run)
                    is_text = isinstance(data, str) or rng.random() < 0.1  # bytes that are no text, sent as text
                    await link.send(data, text=is_text)
                    done += 1
                    if rng.random() < 0.5:
                        answer = json.loads(await asyncio.wait_for(link.recv(), 5))
                        run = (answer.get("drive") or answer).get("run", run)
                        seen[f"answer: {answer['type']}"] += 1
        except (websockets.ConnectionClosed, TimeoutError) as error:
            code = error.rcvd.code if isinstance(error, websockets.ConnectionClosed) and error.rcvd else "-"
            seen[f"socket closed: {code}"] += 1


def attack_http(address: tuple[str, int], rng: random.Random, count: int, tokens: list[str]) -> Counter[str]:
    """Requests with wrong paths, tokens, methods and headers."""
    seen: Counter[str] = Counter()
    for _ in range(count):
        method, path, headers, body = request(rng, tokens)
        connection = http.client.HTTPConnection(*address, timeout=10)
        try:
            connection.request(method, path, body or None, headers)
            seen[f"HTTP {connection.getresponse().status}"] += 1
        except (OSError, http.client.HTTPException, ValueError) as error:
            seen[f"HTTP {type(error).__name__}"] += 1
        finally:
            connection.close()
    return seen


def attack_tcp(address: tuple[str, int], rng: random.Random, count: int, token: str) -> Counter[str]:
    """Bytes that are no HTTP, half requests, and broken frames of web sockets."""
    seen: Counter[str] = Counter()
    shake = f"GET /s/{token}/socket HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    shake += "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    idle: list[socket.socket] = []  # half requests that stay open
    for _ in range(count):
        data = rng.choice(
            [
                rng.randbytes(rng.randrange(1, 500)),
                b"GET / HTTP/1.1\r\nHost: x\r\n" + b"A: b\r\n" * rng.randrange(3000),
                b"GET /s/x HTTP/9.9\r\n\r\n",
                shake.encode() + rng.randbytes(rng.randrange(1, 200)),
                b"POST /j/x HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nffffffffffffffff\r\n",
            ]
        )
        with suppress(OSError):
            link = socket.create_connection(address, timeout=5)
            link.sendall(data)
            if rng.random() < 0.02 and len(idle) < 40:
                idle.append(link)
                continue
            link.close()
        seen["TCP"] += 1
    for link in idle:
        link.close()
    return seen


async def drive(url: str, stop: asyncio.Event) -> dict[str, Any]:
    """A participant who drives meanwhile; returns the answers' times."""
    trips: list[float] = []
    async with websockets.connect(url, max_size=None) as link:

        async def ask(**words: Any) -> dict[str, Any]:
            await link.send(json.dumps(words))
            while True:
                answer: dict[str, Any] = json.loads(await link.recv())
                if answer["type"] != "error":
                    return answer

        await ask(type="hello", protocol=2)
        await ask(type="read", step="page-1")
        view = await ask(type="answer", step="demographics", values={"age": 30})
        runs = 0
        while not stop.is_set():
            run, number, status = view["drive"]["run"], 0, "driving"
            while status == "driving" and number < 100 and not stop.is_set():
                begin = time.perf_counter()
                answer = await ask(type="tick", run=run, number=number, events=[], round_trip=0.01)
                trips.append(time.perf_counter() - begin)
                number, status = answer["ticks"], answer["status"]
                await asyncio.sleep(max(0.1 - trips[-1], 0.0))
            await ask(type="stop", run=run)
            view = await ask(type="keep", run=run)
            runs += 1
    trips.sort()
    share = {name: round(1000 * trips[int(q * (len(trips) - 1))], 1) for name, q in (("50", 0.5), ("99", 0.99))}
    return {"ticks": len(trips), "runs": runs, "round_trip_ms": share | {"max": round(1000 * trips[-1], 1)}}


async def attack(links: dict[str, str], count: int, seed: int) -> dict[str, Any]:
    address = urlsplit(links["p001"])
    place = (str(address.hostname), int(address.port or 0))
    sockets = {name: link.replace("http", "ws", 1) + "/socket" for name, link in links.items()}
    tokens = [link.rpartition("/")[2] for name, link in links.items() if name not in ("p001", "researcher")]
    stop, seen = asyncio.Event(), Counter[str]()
    driving = asyncio.create_task(drive(sockets["p001"], stop))
    await asyncio.sleep(2.0)
    share = count // 3
    await asyncio.gather(
        attack_socket(sockets["p002"], random.Random(seed), share // 2, seen),
        attack_socket(sockets["p003"], random.Random(seed + 1), share - share // 2, seen),
    )
    http_seen = await asyncio.to_thread(attack_http, place, random.Random(seed + 2), share, tokens)
    tcp_seen = await asyncio.to_thread(attack_tcp, place, random.Random(seed + 3), count - 2 * share, tokens[-1])
    stop.set()
    return {"seen": dict(sorted((seen + http_seen + tcp_seen).items())), "other participant": await driving}


def status_of(url: str) -> int:
    """Status of a page."""
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(str(parts.hostname), parts.port, timeout=10)
    connection.request("GET", parts.path)
    status = connection.getresponse().status
    connection.close()
    return status


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "study.yaml").write_text(STUDY)
        log = folder / "server.log"
        with (
            log.open("w") as errors,
            served_study(folder, 3, log=errors, env=os.environ | {"HOME": name}) as (server, links),
        ):
            result = asyncio.run(attack(links, options.count, options.seed))
            result["is_alive"] = server.poll() is None
            result["answers afterwards"] = [status_of(links["p003"]) for _ in range(50)].count(200)
            result["open files afterwards"] = len(os.listdir(f"/proc/{server.pid}/fd"))
        words = log.read_text()
        result["log_lines"] = len(words.splitlines())
        result["tracebacks"] = words.count("Traceback")
        result["log"] = Counter(line[:60] for line in words.splitlines()).most_common(5)
        result["outside"] = sorted(str(path.relative_to(folder)) for path in folder.iterdir() if path.name != "out")
        result["check_problems"] = verify(folder / "out", replay=True, rerun=True)
        print(json.dumps(result, indent=2, default=str))


if __name__ == "__main__":
    main()
