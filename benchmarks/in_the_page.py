"""The simulator in a page of headless Chromium: `python benchmarks/in_the_page.py FOLDER [--drive] [--delay 0.15]`.

FOLDER is written by `sonata2d page`. The program needs playwright and Chromium (`pip install -e '.[test]'`).

- Without `--drive`: size of the download, time to the first picture, time of a tick in each preset, and whether twenty
  episode files that are written in the page equal those that this Python writes, apart from the versions of packages.
- With `--drive`: a program drives by keys in a study, in one scene of each preset, and sees what the page shows: on
  this machine, over a connection that delays each direction, and over the same one with the simulator in the page.
"""

from __future__ import annotations

import argparse
import functools
import gzip
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import sonata2d as s2
from benchmarks.study_server import served_study
from sonata2d.core.navigation import FreeSpace
from sonata2d.record.recorder import EpisodeRecorder
from sonata2d.scenegen.scenario.load import scenario_names
from sonata2d.sim.driver import controller_info_of
from tests.web.proxy import Proxy

CHROMIUM = ["--no-sandbox", "--disable-gpu", "--disable-quic"]
TICKS, EPISODES, SEED = 60, 20, 7
JITTER, STALLS = 0.03, 0.02  # s, and share of packets that wait for 0.4 s, in `--drive`
# Holds the keys that turn and move the robot along a path, and round people; it sees the picture on show.
DRIVER = """path => { let k = 0; const held = new Set(), canvas = document.getElementById("canvas");
  const hold = (key, down) => { if (held.has(key) === down) return; down ? held.add(key) : held.delete(key);
    canvas.dispatchEvent(new KeyboardEvent(down ? "keydown" : "keyup", {key, bubbles: true})); };
  const turned = angle => Math.atan2(Math.sin(angle), Math.cos(angle));
  canvas.focus();
  const driving = setInterval(() => {
    const now = window.drive.now, {x, y, theta} = now.robot;
    if (window.drive.status === "ended") { clearInterval(driving); return; }
    while (k < path.length - 1 && Math.hypot(path[k][0] - x, path[k][1] - y) < .6) k++;
    let wanted = Math.atan2(path[k][1] - y, path[k][0] - x), blocked = false;
    for (const person of now.people) {
      const dx = person.x - x, dy = person.y - y, distance = Math.hypot(dx, dy);
      const bearing = turned(Math.atan2(dy, dx) - wanted);
      if (distance < 1.5 && Math.abs(bearing) < .8) wanted += (bearing > 0 ? -1 : 1) * (1.5 - distance);
      if (distance < .75 && Math.abs(turned(Math.atan2(dy, dx) - theta)) < .6) blocked = true;
    }
    const error = turned(wanted - theta);
    hold("ArrowLeft", error > .2); hold("ArrowRight", error < -.2); hold("ArrowUp", Math.abs(error) < .7 && !blocked);
  }, 150); }"""


class Files(SimpleHTTPRequestHandler):
    extensions_map = SimpleHTTPRequestHandler.extensions_map | {".mjs": "text/javascript", ".wasm": "application/wasm"}

    def log_message(self, *args: Any) -> None: ...


@contextmanager
def served(folder: Path) -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Files, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()


@contextmanager
def chromium() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path="/usr/bin/chromium", args=CHROMIUM)


def measure(folder: Path) -> None:
    sizes = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    packed = sum(len(data if path.suffix in (".whl", ".zip") else gzip.compress(data)) for path, data in sizes.items())
    print(f"download: {sum(map(len, sizes.values())) / 1e6:.1f} MB, {packed / 1e6:.1f} MB compressed")
    with served(folder) as url, chromium() as browser:
        times = []
        for _ in range(5):
            page = browser.new_page()
            start = time.perf_counter()
            page.goto(url)
            page.wait_for_selector("#status.waiting")
            times.append(time.perf_counter() - start)
            page.close()
        print(f"first picture: {min(times):.1f} to {max(times):.1f} s, {len(times)} new pages, files on this machine")
        page = browser.new_page()
        page.goto(url)
        page.wait_for_selector("#status.waiting")
        page.evaluate(
            """async () => { const {Simulator} = await import("./simulator.js"); let done;
            window.ask = message => new Promise(resolve => { done = resolve; simulator.send(message); });
            const simulator = new Simulator("./", answer => { if (done && answer.type !== "loading") done(answer); });
            await new Promise(resolve => { done = answer => answer.type === "ready" && resolve(); }); }"""
        )
        slowest = 0.0
        print(f"{'preset':24} people  open ms  tick ms: median  95 %")
        for name in scenario_names():
            people, opened, ticks = page.evaluate(
                """async ([scenario, seed, count]) => { const clock = () => performance.now(), ticks = [];
                let start = clock(), status = "";
                const {drive} = await ask({type: "open", scenario, seed, changes: {}, controller: "social-planner"});
                const opened = clock() - start;
                for (let number = 0; number < count && status !== "ended"; number++) { start = clock();
                  ({status} = await ask({type: "tick", run: drive.run, number, events: []}));
                  ticks.push(clock() - start); }
                return [drive.people, opened, ticks]; }""",
                [name, SEED, TICKS],
            )
            ticks.sort()
            middle = median(ticks)
            slowest = max(slowest, middle)
            print(f"{name:24} {people:6} {opened:8.0f} {middle:16.1f} {ticks[int(0.95 * len(ticks))]:5.1f}", flush=True)
        print(f"slowest median: {slowest:.1f} ms")
        equal = sum(_is_equal(page, name, seed) for seed, name in enumerate(list(scenario_names())[:EPISODES]))
        print(f"episode files equal to those of this Python: {equal} of {EPISODES}")


def _is_equal(page: Any, name: str, seed: int) -> bool:
    text = page.evaluate(
        """async ([name, seed]) => {
        const {drive} = await ask({type: "open", scenario: name, seed, changes: {}, controller: "social-planner"});
        for (let k = 0, answer; !answer || answer.status !== "ended"; k++)
          answer = await ask({type: "tick", run: drive.run, number: k, events: []});
        return (await ask({type: "file"})).text; }""",
        [name, seed],
    )
    controller, config = s2.SocialPlanner(), s2.load_scenario(name)
    recorder = EpisodeRecorder(context=config.context, label_spec=config.label)
    info = controller_info_of(controller, "social-planner")
    s2.Episode(s2.generate(config, seed), controller, observers=[recorder], controller_info=info).run()
    return _without_versions(recorder.document().decode()) == _without_versions(text)


def _without_versions(text: str) -> list[str]:
    """The lines of an episode file without those that name versions of packages and of Python."""
    return [line for line in text.splitlines() if not line.startswith('"software"')]


def drive_all(folder: Path, delay: float) -> None:
    ways = {"local": (0.0, False), f"{2 * delay:g} s": (delay, False), f"{2 * delay:g} s, simulated": (delay, True)}
    reached = dict.fromkeys(ways, 0)
    print(f"{'preset':24} " + "  ".join(f"{way:>24}" for way in ways))
    with chromium() as browser:
        for name in scenario_names():
            cells = []
            for way, (each, is_simulated) in ways.items():
                outcome, seconds, share = drive_once(browser, name, folder, each, is_simulated=is_simulated)
                reached[way] += outcome == "goal"
                cells.append(f"{outcome:>9} {seconds:5.1f} s {share:3.0f} %")
            print(f"{name:24} " + "  ".join(f"{cell:>24}" for cell in cells), flush=True)
    print("goals: " + ", ".join(f"{way} {count}" for way, count in reached.items()))


def drive_once(
    browser: Any, name: str, page_folder: Path, delay: float, *, is_simulated: bool
) -> tuple[str, float, float]:
    """Outcome, simulated time, and share of the ticks that the page showed before the server's answer, %."""
    with tempfile.TemporaryDirectory() as root:
        folder = Path(root)
        (folder / "study.yaml").write_text(f"title: Drive\nruns: [{{scenario: {name}, runs: 1}}]\nseed: {SEED}\n")
        with served_study(folder, 1, more=f" --page {page_folder.resolve()}") as (_, links):
            link = links["p001"]
            port = int(link.split(":")[2].split("/")[0])
            with Proxy(port, delay=delay, jitter=JITTER if delay else 0.0, loss=STALLS if delay else 0.0) as proxy:
                page = browser.new_page(viewport={"width": 1000, "height": 800})
                page.route("**/static/page.js", _with_drive)
                if not is_simulated:
                    page.route("**/simulator/**", lambda route: route.abort())
                page.goto(link.replace(f":{port}/", f":{proxy.port}/"))
                page.wait_for_selector("#status.waiting", timeout=90000)
                if is_simulated:  # the simulator is ready
                    while not page.evaluate("Boolean(drive.simulate) && !drive.isDifferent"):
                        page.wait_for_timeout(200)
                begun = page.evaluate("window.drive.begun")
                scene = s2.generate(s2.ScenarioConfig(**begun["settings"]), begun["seed"], begun["episode"])
                page.evaluate(DRIVER, _path(scene))
                page.wait_for_selector("#card:not([hidden])", timeout=200000)
                outcome, seconds = page.evaluate("[drive.outcome, drive.states.get(drive.latest).time]")
                share = page.evaluate("100 * drive.foreseenTicks / Math.max(drive.sent, 1)")
                page.close()
    return outcome, seconds, share


def _with_drive(route: Any) -> None:
    """Give the program access to the picture, as eyes have it."""
    response = route.fetch()
    hook = """
    window.drive = drive; drive.foreseenTicks = 0;
    const add = drive.add.bind(drive);
    drive.add = answer => {
      if (drive.isPredicted && !drive.states.has(answer.ticks)) drive.foreseenTicks++;
      add(answer); };
    const shown = drive.show.bind(drive);
    drive.show = content => { drive.begun = content.follow && content.follow.beginning; shown(content); };
    """
    route.fulfill(response=response, body=response.text() + hook)


def _path(scene: s2.Scene) -> list[list[float]]:
    """Points of the shortest way of the robot, with room to spare where there is some."""
    start, goal = scene.robot.pose.position, scene.goal.position
    for clearance in (scene.robot.radius + 0.25, scene.robot.radius + 0.05):
        path = FreeSpace(scene.outline, scene.barriers, clearance).path(start, goal)
        if path is not None:
            return [list(map(float, point)) for point in path[1:]]
    return [list(goal)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--drive", action="store_true")
    parser.add_argument("--delay", type=float, default=0.15, help="of each direction, s")
    options = parser.parse_args()
    if options.drive:
        drive_all(options.folder, options.delay)
    else:
        measure(options.folder)


if __name__ == "__main__":
    main()
