"""What a window costs: milliseconds a picture and a tick, and how many pictures a second that allows on one core.

    python benchmarks/window.py [--people 10 20 50] [--seconds 10] [--size 1280 800] [--json]

Pictures are drawn by SDL in software onto a plain surface, all of it: room, people, looks, the texts over it; between
two ticks as well, as the window does. The robot is driven in bends all the while, so that the follow view never stands
still. "All in" is the driving screen itself: events, widgets, simulation, journal, drawing, and handing the picture to
the display. CPU time, so that another program does not count.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
import time
from itertools import pairwise
from pathlib import Path

if not os.environ.get("DISPLAY"):
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

import pygame

import sonata2d as s2
from sonata2d.agents.controllers.teleoperation import Teleoperation
from sonata2d.collect.session import Session
from sonata2d.core.devices import DeviceEvent, View
from sonata2d.core.snapshot import Snapshot
from sonata2d.view.hud import Hud, draw_hud
from sonata2d.view.interpolation import between
from sonata2d.view.live import Painter
from sonata2d.window.collect_screen import CollectScreen
from sonata2d.window.hands import Hands
from sonata2d.window.profiles import Profiles
from sonata2d.window.stage import Stage

TICKS = 10  # a second
FPS = 60
STEPS = 3  # pictures drawn a tick: fewer than the window would, the same kind
HUD = Hud(
    run=3, runs=20, kept=2, contributor="a contributor", light="recording", label="fair (2 of 3)",
    keys=(("W A S D", "drive"), ("Q E", "sideways"), ("Space", "brake"), ("Esc", "pause"), ("F1", "help")),
)  # fmt: skip


def scenario(people: int, seconds: float) -> s2.ScenarioConfig:
    """A square room of 10 m a side, larger where people would have less than 3 m2 each; half of them wander."""
    side = max(10.0, round((3.0 * people) ** 0.5, 1))
    return s2.ScenarioConfig(
        name="window", humans=people, room={"kinds": ["square"], "side": side},
        tables=3, plants=3, chairs=2, shelves=2, tvs=1, relations=4, furniture_yaw=(-3.0, 3.0), drop=True,
        rules={"time_limit": seconds, "ends_on": ["time"]},
    )  # fmt: skip


def events(tick: int) -> list[DeviceEvent]:
    """Ahead all the time, in bends to either side."""
    turn = 1.0 if tick // 20 % 2 == 0 else 0.0
    pressed = [DeviceEvent("keyboard", "w", 1.0)] if tick == 0 else []
    bends = [DeviceEvent("keyboard", "a", turn), DeviceEvent("keyboard", "d", 1.0 - turn)]
    return pressed + (bends if tick % 20 == 0 else [])


def simulated(scene: s2.Scene, controller: s2.Controller) -> tuple[list[Snapshot], float]:
    """All looks of an episode, and the CPU milliseconds of a tick."""
    episode, looks, spent = s2.Episode(scene, controller), [], []
    while True:
        start = time.process_time()
        frame = episode.step(events(len(looks)))
        spent.append(time.process_time() - start)
        if frame is None:
            return looks, 1e3 * statistics.mean(spent)
        looks.append(frame.snapshot)


def drawn(looks: list[Snapshot], size: tuple[int, int], view: View) -> tuple[float, float]:
    """CPU milliseconds of a picture: the mean, and what 95 of 100 stay below."""
    surface, painter, spent = pygame.display.set_mode(size), Painter(looks[0].scene), []
    painter.draw(surface, looks[0], view=view)
    for before, after in pairwise(looks):
        for step in range(STEPS):
            start = time.process_time()
            snapshot = between(before, after, step / STEPS)
            camera = painter.draw(surface, snapshot, view=view)
            draw_hud(surface, HUD, snapshot, camera, title="a kitchen", question="How does the robot drive?")
            spent.append(time.process_time() - start)
    return 1e3 * statistics.mean(spent), 1e3 * statistics.quantiles(spent, n=20)[-1]


def all_in(config: s2.ScenarioConfig, size: tuple[int, int], view: View, seconds: float) -> float:
    """CPU milliseconds of a picture of the driving screen, everything counted, 60 pictures to 10 ticks."""
    with tempfile.TemporaryDirectory() as folder:
        stage, hands = Stage(size=size, clock=lambda fps: round(1000 / fps)), Hands(Profiles(Path(folder)))
        screen = CollectScreen(Session(folder, "benchmark", config, hands=hands.hands), hands, view=view)
        screen.enter(stage)
        press(pygame.K_w)
        for _ in range(5):
            stage.turn(screen)
        start, pictures = time.process_time(), round(seconds * FPS)
        for picture in range(pictures):
            if picture % 120 in (0, 60):
                press(pygame.K_a, down=picture % 120 == 0)
            stage.turn(screen)
        spent = time.process_time() - start
        screen.session.close()
    return 1e3 * spent / pictures


def press(key: int, *, down: bool = True) -> None:
    """A key goes down or up."""
    kind = pygame.KEYDOWN if down else pygame.KEYUP
    pygame.event.post(pygame.event.Event(kind, key=key, mod=0, scancode=0, unicode=""))


def measure(people: int, seconds: float, size: tuple[int, int]) -> list[dict[str, str | float]]:
    """Two rows of the table: both views."""
    config = scenario(people, seconds)
    scene = s2.generate(config, seed=0)
    _, planner = simulated(scene, s2.SocialPlanner())
    looks, teleoperation = simulated(scene, Teleoperation())
    rows: list[dict[str, str | float]] = []
    for view in ("follow", "top"):
        mean, most = drawn(looks, size, view)
        whole = all_in(config, size, view, 0.9 * seconds)
        rows.append(
            {
                "people": len(scene.humans),
                "view": view,
                "picture (ms)": round(mean, 2),
                "95 % below (ms)": round(most, 2),
                "teleoperation tick (ms)": round(teleoperation, 2),
                "planner tick (ms)": round(planner, 2),
                "all in (ms)": round(whole, 2),
                "fps, all in": round(1e3 / whole),
                f"drawing at {FPS} fps (%)": round(FPS * mean / 10),
                "simulating (%)": round(TICKS * teleoperation / 10, 1),
            }
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--people", type=int, nargs="+", default=[10, 20, 50])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--size", type=int, nargs=2, default=[1280, 800])
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    pygame.display.init()
    size = (arguments.size[0], arguments.size[1])
    rows = [row for people in arguments.people for row in measure(people, arguments.seconds, size)]
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return
    widths = [max(len(name) + 2, 8) for name in rows[0]]
    print("".join(f"{name:>{width}}" for name, width in zip(rows[0], widths, strict=True)))
    for row in rows:
        print("".join(f"{value:>{width}}" for value, width in zip(row.values(), widths, strict=True)))


if __name__ == "__main__":
    main()
