"""Scenes built by hand, for tests that rely on exact positions."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import hypothesis
import numpy as np
import pytest

from sonata2d.agents.pedestrians import crowd, idling
from sonata2d.agents.pedestrians.models import sonata2026
from sonata2d.core.compiled import kernel as compiled
from sonata2d.core.entities import Furniture, Goal, Human, Limits, Robot, Wall
from sonata2d.core.geometry import Barriers, Disc, Point, Pose, Rectangle, contact_times
from sonata2d.core.portable_math import Array, IntArray
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.workers.processes import Processes
from sonata2d.workers.tasks import Answer, Call

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
hypothesis.settings.register_profile("sonata2d", deadline=None)  # the first call of a kernel may compile it
hypothesis.settings.load_profile("sonata2d")
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell's background job; programs under test would inherit it
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    """Compile all kernels before a run with several processes, if none is compiled yet."""
    if compiled.IS_COMPILED and getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        from sonata2d.core.compiled import cache as kernel_cache

        folder = kernel_cache.writable_folder()
        if folder is not None and not any(folder.glob("*.kernel")):
            subprocess.run([sys.executable, "-m", "tests.compile_kernels"], cwd=config.rootpath, check=True)


@pytest.fixture(autouse=True)
def compilation_is_announced() -> None:
    """Processes that compile during a test say nothing, because tests compare what commands print."""
    if compiled.IS_COMPILED:
        from sonata2d.core.compiled import cache as kernel_cache

        folder = kernel_cache.writable_folder()
        if folder is not None:
            (folder / kernel_cache.STAMP).touch()


@pytest.fixture(scope="session")
def _two_processes() -> Iterator[Processes]:
    processes = Processes(2)
    yield processes
    processes.close()


@pytest.fixture
def kept_processes(_two_processes: Processes, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work for two processes is done by two that all tests with this fixture share, as starting two takes longer."""
    submitting = Processes.submitting

    def submitting_to_kept(self: Processes, call: Call) -> AbstractContextManager[Callable[..., Future[Answer]]]:
        return submitting(_two_processes if self.count == 2 else self, call)

    monkeypatch.setattr(Processes, "submitting", submitting_to_kept)


SQUARE: tuple[Point, ...] = ((-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0))
L_SHAPE: tuple[Point, ...] = ((-4.0, -4.0), (4.0, -4.0), (4.0, 0.0), (0.0, 0.0), (0.0, 4.0), (-4.0, 4.0))
LEFT = Pose(-3.0, 0.0)


def times_to_collision(snapshot: Snapshot) -> Array:
    """Times until the outlines of robot and pedestrians touch at constant velocities and headings, (N,), s."""
    humans, robot = snapshot.humans, snapshot.robot
    offset, velocity = humans.position - np.array(robot.position), np.array(robot.velocity) - humans.velocity
    return contact_times(offset, velocity, humans.radius + robot.radius, humans.direction, humans.shoulder)


def room(
    humans: Sequence[Human] = (),
    furniture: Sequence[Furniture] = (),
    *,
    robot: Pose = LEFT,
    goal: Point = (3.0, 0.0),
    polygon: tuple[Point, ...] = SQUARE,
    inner: Sequence[Wall] = (),
    rules: Rules | None = None,
    limits: Limits | None = None,
    **fields: object,
) -> Scene:
    """A scene in a room of 8 m by 8 m, with the robot on the left and the goal on the right.

    Args:
        inner: walls in addition to the edges of the polygon.
        fields: further fields of the scene.
    """
    edges = [Wall(a, b) for a, b in zip(polygon, (*polygon[1:], polygon[0]), strict=True)]
    return Scene(
        name="by-hand",
        family="by-hand/given",
        polygon=polygon,
        walls=(*edges, *inner),
        furniture=tuple(furniture),
        humans=tuple(humans),
        robot=Robot(robot, limits=limits or Limits()),
        goal=Goal(*goal),
        rules=rules or Rules(),
        **fields,  # type: ignore[arg-type]
    )


@pytest.fixture
def no_deviations(monkeypatch: pytest.MonkeyPatch) -> None:
    """Walkers of the default model keep direction and speed; otherwise they deviate at random, from tick to tick."""
    monkeypatch.setattr(sonata2026, "PARAMETERS", sonata2026.PARAMETERS._replace(wander=0.0, pace_deviation=0.0))


@pytest.fixture
def motionless(monkeypatch: pytest.MonkeyPatch) -> None:
    """People who stand keep still; otherwise they change their posture and look round at random."""

    def never(count: int) -> idling.Idling:
        return idling.initial_idling(count)._replace(
            posture_until=np.full(count, 1 << 40), look_until=np.full(count, 1 << 40)
        )

    monkeypatch.setattr(crowd, "initial_idling", never)


def walker(number: int, x: float, y: float, theta: float = 0.0, **fields: object) -> Human:
    """A wandering pedestrian with the id `number`; `fields` replace its other fields."""
    return replace(Human(number, Pose(x, y, theta), 0.2, behaviour="wandering"), **fields)  # type: ignore[arg-type]


def neighbour_lists(attention: Array) -> dict[str, Array | IntArray]:
    """Fields of `Walkers` for agents that are all neighbours of each other, with the given attention, (M, M)."""
    count = len(attention)
    others = ~np.eye(count, dtype=bool)
    return {
        "neighbour_start": np.arange(count + 1) * (count - 1),
        "neighbour": np.flatnonzero(others) % max(count, 1),
        "attention": attention[others],
        "wall_start": np.zeros(count + 1, dtype=np.int64),
        "wall": np.zeros(0, dtype=np.int64),
    }


def beside_walls(walkers: Any, barriers: Barriers) -> Any:
    """Walkers to which all barriers are near."""
    count, number = len(walkers.position), len(barriers)
    return walkers._replace(wall_start=np.arange(count + 1) * number, wall=np.tile(np.arange(number), count))


@pytest.fixture
def busy() -> Scene:
    """Ten wandering pedestrians and two pieces of furniture in an L-shaped room."""
    positions = [(x, y) for y in (-3.2, -1.0) for x in (-3.2, -1.7, 0.6, 2.2, 3.4)]
    humans = [walker(k + 1, x, y, desired_speed=1.0 + 0.05 * k) for k, (x, y) in enumerate(positions)]
    furniture = [
        Furniture(20, "table", Pose(-2.0, -2.1, 0.5), Rectangle(0.8, 0.8)),
        Furniture(21, "plant", Pose(1.5, -2.2), Disc(0.2)),
    ]
    return room(humans, furniture, polygon=L_SHAPE, robot=Pose(-2.0, 3.0, -1.5), goal=(3.0, -2.0), seed=5)
