"""Cost of the window: CPU milliseconds per picture and tick, and the pictures per second that one core allows.

    python benchmarks/window.py [--people 10 20 50] [--seconds 10] [--size 1280 800] [--json]

SDL draws in software onto a surface: room, people, gaze, overlays, also between ticks, as the window does. The robot is
driven in curves, so that the follow view keeps moving. "Total" is the driving screen itself: events, widgets,
simulation, journal, drawing, and passing the picture to the display. Times are CPU times.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
import time
from itertools import pairwise

if not os.environ.get("DISPLAY"):
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

import pygame

import sonata2d as s2
from sonata2d.agents.controllers.teleoperation import Teleoperation
from sonata2d.collect.session import Session
from sonata2d.core.devices import DeviceEvent, View
from sonata2d.core.labels import LabelSpec
from sonata2d.core.snapshot import Snapshot
from sonata2d.view.interpolation import between
from sonata2d.view.painter import Painter
from sonata2d.window.answer import FrameQuestion
from sonata2d.window.collect_screen import CollectScreen
from sonata2d.window.hud import Hud, draw_hud
from sonata2d.window.input import InputDevices
from sonata2d.window.profiles import DEFAULT_PROFILES
from sonata2d.window.stage import Stage

TICKS = 10  # per second
FPS = 60
STEPS = 3  # pictures drawn per tick; the window draws more of the same kind
HUD = Hud(
    run=3, runs=20, kept=2, contributor="a contributor", light="recording",
    question=FrameQuestion(LabelSpec("classes", question="Is it polite?", classes=("no", "fairly", "yes")), 0.5),
    keys=(("W A S D", "drive"), ("Q E", "sideways"), ("Space", "brake"), ("Esc", "pause"), ("F1", "help")),
)  # fmt: skip


def scenario(people: int, seconds: float) -> s2.ScenarioConfig:
    """A square room of 10 m, or larger so that each person has 3 m2; half of the people wander."""
    side = max(10.0, round((3.0 * people) ** 0.5, 1))
    return s2.ScenarioConfig(
        name="window", humans=people, room={"kinds": ["square"], "side": side},
        tables=3, plants=3, chairs=2, shelves=2, tvs=1, relations=4, furniture_yaw=(-3.0, 3.0), drop=True,
        rules={"time_limit": seconds, "ends_on": ["time"]},
    )  # fmt: skip


def events(tick: int) -> list[DeviceEvent]:
    """Device events that drive ahead in curves to alternating sides."""
    turn = 1.0 if tick // 20 % 2 == 0 else 0.0
    pressed = [DeviceEvent("keyboard", "w", 1.0)] if tick == 0 else []
    curves = [DeviceEvent("keyboard", "a", turn), DeviceEvent("keyboard", "d", 1.0 - turn)]
    return pressed + (curves if tick % 20 == 0 else [])


def simulate(scene: s2.Scene, controller: s2.Controller) -> tuple[list[Snapshot], float]:
    """All snapshots of an episode, and the CPU milliseconds per tick."""
    episode, snapshots, times = s2.Episode(scene, controller), [], []
    while True:
        start = time.process_time()
        frame = episode.step(events(len(snapshots)))
        times.append(time.process_time() - start)
        if frame is None:
            return snapshots, 1e3 * statistics.mean(times)
        snapshots.append(frame.snapshot)


def picture_cost(snapshots: list[Snapshot], size: tuple[int, int], view: View) -> tuple[float, float]:
    """CPU milliseconds per picture: mean and 95th percentile."""
    surface, painter, times = pygame.display.set_mode(size), Painter(snapshots[0].scene), []
    painter.draw(surface, snapshots[0], view=view)
    for before, after in pairwise(snapshots):
        for step in range(STEPS):
            start = time.process_time()
            snapshot = between(before, after, step / STEPS)
            camera = painter.draw(surface, snapshot, view=view)
            draw_hud(surface, HUD, snapshot, camera)
            times.append(time.process_time() - start)
    return 1e3 * statistics.mean(times), 1e3 * statistics.quantiles(times, n=20)[-1]


def screen_cost(config: s2.ScenarioConfig, size: tuple[int, int], view: View, seconds: float) -> float:
    """CPU milliseconds per picture of the driving screen, everything included, at 60 pictures per 10 ticks."""
    with tempfile.TemporaryDirectory() as folder:
        stage, devices = Stage(size=size, clock=lambda fps: round(1000 / fps)), InputDevices(DEFAULT_PROFILES)
        screen = CollectScreen(Session(folder, "benchmark", config, mappings=devices.mappings), devices, view=view)
        screen.enter(stage)
        press(pygame.K_w)
        for _ in range(5):
            stage.show_frame(screen)
        start, pictures = time.process_time(), round(seconds * FPS)
        for picture in range(pictures):
            if picture % 120 in (0, 60):
                press(pygame.K_a, down=picture % 120 == 0)
            stage.show_frame(screen)
        times = time.process_time() - start
        screen.session.close()
    return 1e3 * times / pictures


def press(key: int, *, down: bool = True) -> None:
    """Post a key event."""
    kind = pygame.KEYDOWN if down else pygame.KEYUP
    pygame.event.post(pygame.event.Event(kind, key=key, mod=0, scancode=0, unicode=""))


def measure(people: int, seconds: float, size: tuple[int, int]) -> list[dict[str, str | float]]:
    """Two rows of the table, one per view."""
    config = scenario(people, seconds)
    scene = s2.generate(config, seed=0)
    _, planner = simulate(scene, s2.SocialPlanner())
    snapshots, teleoperation = simulate(scene, Teleoperation())
    rows: list[dict[str, str | float]] = []
    for view in ("follow", "top"):
        mean, percentile = picture_cost(snapshots, size, view)
        total = screen_cost(config, size, view, 0.9 * seconds)
        rows.append(
            {
                "people": len(scene.humans),
                "view": view,
                "picture (ms)": round(mean, 2),
                "95th percentile (ms)": round(percentile, 2),
                "teleoperation tick (ms)": round(teleoperation, 2),
                "planner tick (ms)": round(planner, 2),
                "total (ms)": round(total, 2),
                "fps, total": round(1e3 / total),
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
