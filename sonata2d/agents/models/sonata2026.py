"""`sonata2026`: the default, calibrated on recorded pedestrians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...entities import Scene
from ...exact import Array
from ..forces.anticipation import anticipation_acceleration
from ..forces.company import company_acceleration
from ..forces.drive import desired_acceleration
from ..forces.nearness import nearness_acceleration
from ..forces.steering import steered
from ..forces.walls import wall_acceleration
from .walkers import Walkers


@dataclass(frozen=True, slots=True)
class Sonata2026:
    """Its parameters, as `benchmarks/calibrate.py` found them."""

    relaxation_time: float = 0.6  # s
    breadth: float = 0.37  # m
    standstill: float = -0.05  # m
    headway: float = 0.75  # s
    decision: float = 0.25  # m/s
    queueing: float = 0.73
    bias: float = 0.06  # m/s
    foresight: float = 0.5  # m/s2
    foresight_reach: float = 0.55  # m
    horizon: float = 0.9  # s
    side: float = 0.05  # m
    nearness: float = 0.2  # m/s2
    nearness_reach: float = 0.3  # m
    anisotropy: float = 0.7
    wall_strength: float = 0.8  # m/s2
    wall_reach: float = 0.08  # m
    abreast: float = 0.03  # 1/s2
    cohesion: float = 0.06  # 1/s2
    spacing: float = 1.1  # m
    among_group: float = 0.3  # how much members mind each other


class Sonata2026Model:
    """Walk at the speed that the gap ahead allows, keep off where others will be, and a little off who is near."""

    evaluations = 1

    def __init__(self, scene: Scene, law: Sonata2026 | None = None) -> None:
        self._barriers, self._side, self._law = scene.barriers, scene.rules.side, law or PARAMETERS
        radius = np.array([*(human.radius for human in scene.humans), scene.robot.radius], dtype=float)
        self._touching = radius[:, None] + radius[None, :]

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, velocity, touching = self._law, walkers.position, walkers.velocity, self._touching
        dx, dy = (position[:, None, k] - position[None, :, k] for k in (0, 1))  # from i (column) to j (row)
        weight = walkers.weight
        if walkers.member is not None:
            weight = weight * (1.0 - (1.0 - law.among_group) * walkers.member)
        way, speed = steered(
            dx, dy, walkers.direction, walkers.desired_speed, touching, weight, side=self._side * law.bias,
            decision=law.decision, queueing=law.queueing, breadth=law.breadth, distance=law.standstill,
            time=law.headway,
        )  # fmt: skip
        total = desired_acceleration(velocity, way, speed, relaxation_time=law.relaxation_time)
        if walkers.member is not None:
            total += company_acceleration(
                dx, dy, walkers.direction, walkers.member, cohesion=law.cohesion, spacing=law.spacing,
                abreast=law.abreast,
            )  # fmt: skip
        total += anticipation_acceleration(
            dx, dy, velocity, weight, touching, strength=law.foresight, reach=law.foresight_reach,
            horizon=law.horizon, side=self._side * law.side,
        )  # fmt: skip
        total += nearness_acceleration(
            dx, dy, walkers.direction, weight, touching, strength=law.nearness, reach=law.nearness_reach,
            anisotropy=law.anisotropy,
        )  # fmt: skip
        total += wall_acceleration(
            position, walkers.radius, self._barriers, strength=law.wall_strength, reach=law.wall_reach
        )
        return total


PARAMETERS = Sonata2026()
