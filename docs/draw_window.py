"""Draws the pictures of docs/window.md: opens the window, presses keys, and saves its content.

    python -m docs.draw_window [FOLDER]

Needs no display; with one, a real window opens.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pygame

from sonata2d import load_scenario
from sonata2d.collect.rating import RatingSession
from sonata2d.collect.session import Session
from sonata2d.datasets import generate_dataset
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.view.stills import save_surface
from sonata2d.window.collect_screen import CollectScreen
from sonata2d.window.input import InputDevices
from sonata2d.window.rate_screen import RateScreen
from sonata2d.window.view_screen import ViewScreen
from tests.window.volunteer import Person

ROOT = Path(__file__).parent.parent


def main(folder: Path) -> None:
    """Draw all pictures."""
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        os.environ["SONATA2D_CONFIG"] = str(Path(scratch) / "config")
        config = load_scenario(ROOT / "examples/scenarios/survey.yaml")
        collect(folder, Path(scratch) / "runs", config)
        runs = Path(scratch) / "made"
        generate_dataset(runs, config, "social-planner", episodes=4, seed=3)
        replay(folder, runs)
        rate(folder, runs, config)


def collect(folder: Path, runs: Path, config: ScenarioConfig) -> None:
    """Waiting, driving in both cameras, the end of a run, the panels."""
    made: list[Session] = []

    def screen() -> CollectScreen:
        devices = InputDevices()
        made.append(Session(runs, "volunteer-07", config, seed=3, mappings=devices.mappings))
        return CollectScreen(made[0], devices, runs=20, scene_changes=True)

    person = Person(screen)
    session, shoot = made[0], shooter(person, folder)
    person.wait(0.5)
    shoot("waiting")
    person.drive(session, seconds=3.0)
    shoot("driving")
    person.press(pygame.K_v, pygame.K_z)
    person.drive(session, seconds=1.5)
    shoot("driving_top")
    person.press(pygame.K_v, pygame.K_z)
    person.drive(session)
    person.press(pygame.K_4)
    person.wait(0.2)
    shoot("goal")
    person.press(pygame.K_g)
    person.wait(0.2)
    shoot("scene_panel")
    person.press(pygame.K_ESCAPE, pygame.K_F1)
    person.wait(0.2)
    shoot("help")
    session.close()
    pygame.quit()


def replay(folder: Path, runs: Path) -> None:
    """A recorded run during playback."""
    person = Person(lambda: ViewScreen(sorted(runs.glob("0*.json"))))
    person.press(pygame.K_t)
    person.wait(4.0)
    person.press(pygame.K_SPACE)
    shooter(person, folder)("replay")
    pygame.quit()


def rate(folder: Path, runs: Path, config: ScenarioConfig) -> None:
    """The question after a run was watched."""
    person = Person(lambda: RateScreen(RatingSession(runs, "rater-1", config.label)))
    person.press(pygame.K_RETURN)
    person.wait(40.0)
    person.press(pygame.K_3)
    shooter(person, folder)("rating")
    pygame.quit()


def shooter(person: Person, folder: Path) -> Callable[[str], None]:
    """A function that saves the content of the window."""

    def shoot(name: str) -> None:
        person.wait()
        save_surface(person.stage.surface, folder / f"window_{name}.png")

    return shoot


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images")
