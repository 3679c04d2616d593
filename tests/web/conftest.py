"""A study that is served on this machine, and a headless Chromium."""

from __future__ import annotations

import asyncio
import functools
import hashlib
import json
import os
import shutil
import threading
import time
from collections.abc import Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

import sonata2d as s2
from sonata2d.study.folder import STUDY, StudyFolder
from sonata2d.study.links import Links
from sonata2d.study.load import load_study
from sonata2d.web.in_page import PageSimulator
from sonata2d.web.messages import parse_message
from sonata2d.web.page_folder import write_page
from sonata2d.web.participant_session import ParticipantSession
from sonata2d.web.serve import server_config
from sonata2d.web.server import StudyServer
from sonata2d.web.settings import ServerSettings

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
STUDY_TEXT = """\
title: {en: Passing people, de: An Menschen vorbei, zh: 经过行人}
languages: [en, de, zh]
pages:
  - title: {en: Welcome, de: Willkommen, zh: 欢迎}
    text:
      en: "You **drive** a robot. <script>alert(1)</script> ![](https://example.org/a.png) [site](https://example.org)"
      de: "Sie **fahren** einen Roboter."
      zh: "您**驾驶**机器人。"
consent:
  title: {en: Consent, de: Einwilligung, zh: 同意书}
  text: {en: Runs are stored., de: Fahrten werden gespeichert., zh: 驾驶将被保存。}
  statements: [{en: I am 18 or older., de: Ich bin 18 oder älter., zh: 我已年满18岁。}]
demographics:
  - {name: age, kind: number, question: {en: Your age, de: Ihr Alter, zh: 您的年龄}, minimum: 18}
practice: {scenario: room.yaml, runs: 1}
runs:
  - scenario: room.yaml
    runs: 3
    label:
      question: {en: How polite were you, de: Wie höflich waren Sie, zh: 您有多礼貌}
      classes: {en: [rude, fair, kind], de: [grob, gut, nett], zh: [粗鲁, 一般, 友好]}
after_run:
  - {name: effort, kind: classes, classes: 5, question: {en: Effort, de: Mühe, zh: 难度}}
ratings:
  - name: polite
    folder: recorded
    count: 5
    repeats: 0
    question: {name: polite, kind: yes_no, question: {en: Polite, de: Höflich, zh: 礼貌吗}}
end:
  - {scale: rosas, subscales: [warmth]}
minimum_length: 0.3
changes: [view, zoom, zones]
"""
ROOM = """\
extends: sonata-2020
label: {kind: classes, classes: [rude, fair, kind], question: How polite were you}
"""


class Served:
    """A study and its server, which runs in a thread of the tests."""

    def __init__(self, folder: Path, **settings: Any) -> None:
        self.folder, self._settings = folder, settings
        self.start()

    def start(self) -> None:
        """Start the server, again if it was stopped."""
        import uvicorn

        study = load_study(self.folder / "study.yaml")
        study.check_scenes()
        self.out = self.folder / "out"
        study_folder = StudyFolder(self.out, study)
        self.links = Links(self.out / STUDY)
        connections = int(self._settings.get("connections", 200))
        self.server = StudyServer(study_folder, self.links, ServerSettings(**self._settings))
        self._uvicorn = uvicorn.Server(server_config(self.server.app, connections, port=0, timeout_graceful_shutdown=2))
        self._loop = asyncio.new_event_loop()
        serving = self._uvicorn.serve()
        self._thread = threading.Thread(target=lambda: self._loop.run_until_complete(serving), daemon=True)
        self._thread.start()
        while not self._uvicorn.started:
            time.sleep(0.01)
        self.port = self._uvicorn.servers[0].sockets[0].getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"

    def stop(self) -> None:
        """Stop the server as Ctrl+C does."""
        self._uvicorn.should_exit = True
        self._thread.join(20)
        assert not self._thread.is_alive()
        self._loop.close()

    def call(self, coroutine: Coroutine[Any, Any, None]) -> None:
        """Run a coroutine in the server's event loop."""
        asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(10)

    def link(self) -> str:
        """The link of a new participant."""
        return f"{self.url}/s/{self.server.new_participant()}"


def answered(session: ParticipantSession, message: dict[str, Any]) -> Any:
    """The answer of a session to a message of its page; in a thread, since a browser may occupy this one's loop."""
    answer = session.answer(parse_message(json.dumps(message)))
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, answer).result()  # type: ignore[arg-type]


@pytest.fixture(scope="session")
def short_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five recorded runs of half a second."""
    folder = tmp_path_factory.mktemp("recorded") / "runs"
    config = s2.load_scenario("empty").changed(rules={"time_limit": 0.5})
    s2.generate_dataset(folder, config, "straight-to-goal", episodes=5, workers=1)
    return folder


@pytest.fixture
def study_folder(tmp_path: Path, short_runs: Path) -> Path:
    (tmp_path / "study.yaml").write_text(STUDY_TEXT, encoding="utf-8")
    (tmp_path / "room.yaml").write_text(ROOM)
    (tmp_path / "recorded").symlink_to(short_runs)
    return tmp_path


@pytest.fixture
def served(study_folder: Path) -> Iterator[Served]:
    served = Served(study_folder)
    yield served
    served.stop()


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A headless Chromium of the system."""
    sync_api = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("no Chromium is installed: apt-get install chromium")
    sandbox = ["--no-sandbox"] if os.name == "posix" and os.geteuid() == 0 else []
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=sandbox)
        yield browser
        browser.close()


WHEEL_TAG = "cp314-cp314-pyemscripten_2026_0_wasm32"
# Instead of Pyodide, the worker asks the Python of the test, which `answering` connects.
_WORKER = """
let last = Promise.resolve();
onmessage = event => { last = last.then(async () => {
  const answer = await fetch("./answer", {method: "POST", body: event.data});
  postMessage(await answer.text());
}); };
postMessage(JSON.stringify({type: "ready"}));
"""


def wheel_of(name: str) -> bytes:
    return f"the wheel of {name}".encode()


@pytest.fixture
def distribution(tmp_path: Path) -> Path:
    """A distribution of Pyodide whose files have no content, and a package index, both as folders."""
    folder, index = tmp_path / "pyodide", tmp_path / "simple" / "pymunk"
    folder.mkdir()
    index.mkdir(parents=True)
    for name in ("pyodide.mjs", "pyodide.asm.mjs", "pyodide.asm.wasm", "python_stdlib.zip"):
        (folder / name).write_text(name)
    needs = {"pydantic": ["pydantic_core", "typing-extensions"], "cffi": ["pycparser"]}
    packages = {}
    for name in ("numpy", "cffi", "orjson", "pyyaml", "pydantic", "pydantic-core", "lazy-loader", "cloudpickle",
                 "annotated-types", "typing-extensions", "pycparser", "scipy"):  # fmt: skip
        file = f"{name.replace('-', '_')}-1.0-{WHEEL_TAG}.whl"
        (folder / file).write_bytes(wheel_of(name))
        packages[name] = {"name": name, "version": "1.0", "file_name": file, "depends": needs.get(name, []),
                          "sha256": hashlib.sha256(wheel_of(name)).hexdigest(), "install_dir": "site"}  # fmt: skip
    info = {"abi_version": "2026_0", "arch": "wasm32", "platform": "emscripten_5_0_3", "python": "3.14.2"}
    (folder / "pyodide-lock.json").write_text(json.dumps({"info": info, "packages": packages}))
    list_engine(tmp_path, version("pymunk"))
    return folder


def list_engine(root: Path, number: str) -> None:
    """List a wheel of the physics engine on the index."""
    file = f"pymunk-{number}-{WHEEL_TAG}.whl"
    (root / file).write_bytes(wheel_of("pymunk"))
    row = {
        "filename": file,
        "url": f"../../{file}",
        "hashes": {"sha256": hashlib.sha256(wheel_of("pymunk")).hexdigest()},
    }
    other = row | {"filename": f"pymunk-{number}-cp314-cp314-win_amd64.whl", "url": "missing"}
    (root / "simple" / "pymunk" / "index.html").write_text(json.dumps({"files": [other, row]}))


class _Files(SimpleHTTPRequestHandler):
    def log_message(self, *args: Any) -> None: ...


@pytest.fixture
def site(tmp_path: Path) -> Iterator[str]:
    """The address at which the temporary folder is served."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Files, directory=str(tmp_path)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


@pytest.fixture
def page(tmp_path: Path, distribution: Path, site: str) -> Path:
    """A folder of the page, whose worker asks this Python."""
    out = tmp_path / "page"
    write_page(out, str(distribution), index=f"{site}simple/")
    (out / "worker.js").write_text(_WORKER)
    return out


def answering(context: Any, folder: Path, change: Any = lambda answer: answer) -> None:
    """Let the workers of a browser ask a simulator of this Python; `change` gets each answer."""
    simulator = PageSimulator(folder)

    def answer(route: Any) -> None:
        route.fulfill(body=json.dumps(change(json.loads(simulator.answer(route.request.post_data)))))

    context.route("**/answer", answer)
