"""Recorded episodes to transform: a generated one, and a hand-made one with unusual values and contacts."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

import sonata2d as s2
from sonata2d.core.entities import Furniture, Human, Interaction
from sonata2d.core.geometry import Disc, Pose, Rectangle, Twist
from sonata2d.core.relations import AT_LAPTOP
from sonata2d.core.scene import Rules, Scene
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord

from ..conftest import L_SHAPE, room, walker
from ..record.conftest import episode  # noqa: F401 (a fixture)

QUICK: dict[str, Any] = {"rules": {"time_limit": 2.0}, "furniture_yaw": (-3.0, 3.0), "at_laptop": 1}


class Swaying(s2.Controller):
    """Moves sideways and turns without avoiding obstacles; labels its turn rate and proximity."""

    def act(self, snapshot: s2.Snapshot) -> Twist:
        return Twist(0.5, 0.3 if snapshot.tick % 7 < 4 else -0.2, 0.9 if snapshot.tick % 5 else -1.1)

    def label(self, snapshot: s2.Snapshot, twist: Twist) -> dict[str, object]:
        return {"turns": twist.omega, "near": s2.clearance(snapshot) < 2.0}


def recorded(path: Path, scene: Scene, controller: s2.Controller | None = None) -> EpisodeRecord:
    with s2.JsonRecorder(path) as recorder:
        s2.Episode(scene, controller or s2.SocialPlanner(), observers=[recorder]).run()
    return read_episode(path)


def odd_scene(theta: float = 0.123456789) -> Scene:
    """A scene with digits beyond the precision of files, half turns, a laptop on a table, and a wall in the way."""
    furniture = [
        Furniture(20, "table", Pose(1.0, -2.5, math.pi), Rectangle(1.2, 0.6)),
        Furniture(21, "laptop", Pose(1.0, -2.5, theta), Rectangle(0.4, 0.3), on=20),
        Furniture(22, "plant", Pose(-1.5, -1.0, 3.1416), Disc(0.2)),
        Furniture(23, "chair", Pose(2.5, -1.0, -math.pi / 2), Rectangle(0.45, 0.45)),
    ]
    humans = [Human(1, Pose(1.0 / 3.0, -3.5, 3.1416)), walker(2, -3.0, 2.0, -1.0), walker(3, 3.0, -3.0, 2.0)]
    rules = Rules(time_limit=4.0, side=-1)
    interactions = (Interaction(1, AT_LAPTOP, 21),)
    return room(
        humans, furniture, polygon=L_SHAPE, robot=Pose(-2.0, 3.5, 1.5), rules=rules, interactions=interactions, seed=3
    )


@pytest.fixture(scope="session")
def odd(tmp_path_factory: pytest.TempPathFactory) -> EpisodeRecord:
    return recorded(tmp_path_factory.mktemp("odd") / "odd.json", odd_scene(), Swaying())


@pytest.fixture(scope="session")
def generated(tmp_path_factory: pytest.TempPathFactory) -> EpisodeRecord:
    scene = s2.generate(s2.ScenarioConfig(**QUICK, wandering=3), seed=4)
    return recorded(tmp_path_factory.mktemp("made") / "000000.json", scene)
