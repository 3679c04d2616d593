"""`sonata2026`: the default, calibrated on recorded pedestrians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...exact import Array
from ...scene import Scene
from ..forces.anticipation import anticipation_acceleration
from ..forces.company import company_acceleration
from ..forces.drive import Gait, paced_acceleration
from ..forces.headway import Strip
from ..forces.nearness import nearness_acceleration
from ..forces.steering import Choice, steered
from ..forces.walls import wall_acceleration
from .walkers import Walkers

BACKWARDS = 0.2  # of the speed ahead, that is gone backwards


@dataclass(frozen=True, slots=True)
class Sonata2026:
    """Its parameters, found by `benchmarks/calibrate.py` and by hand: docs/models.md says which."""

    relaxation_time: float = 0.61  # s
    following_time: float = 2.0  # s
    starting_time: float = 0.16  # s
    turning_time: float = 0.36  # s
    breadth: float = 0.3  # m
    standstill: float = -0.13  # m
    headway: float = 0.95  # s
    decision: float = 0.08  # m/s
    habit: float = 0.5  # m/s
    outlook: float = 1.18  # s
    queueing: float = 1.0
    bias: float = 0.08  # m/s
    foresight: float = 1.01  # m/s2
    foresight_reach: float = 0.47  # m
    horizon: float = 0.9  # s
    side: float = 0.1  # m
    nearness: float = 0.45  # m/s2
    nearness_reach: float = 0.22  # m
    anisotropy: float = 0.47
    wall_strength: float = 0.2  # m/s2
    wall_reach: float = 0.05  # m
    abreast: float = 0.25  # 1/s2
    cohesion: float = 0.4  # 1/s2
    spacing: float = 0.85  # m
    among_group: float = 0.42  # how much members mind each other who have goals of their own


class Sonata2026Model:
    """Walk at the speed that the gap ahead allows, keep off where others will be, and a little off who is near."""

    evaluations = 1

    def __init__(self, scene: Scene) -> None:
        law = PARAMETERS
        self._barriers, self._side, self._law = scene.barriers, scene.rules.side, law
        radius = np.array([*(human.radius for human in scene.humans), scene.robot.radius], dtype=float)
        self._gait = Gait(law.relaxation_time, law.following_time, law.starting_time, law.turning_time)
        self._strip = Strip(law.breadth, law.standstill, law.headway)
        self._choice = Choice(law.outlook, self._side * law.bias, law.habit, law.decision, law.queueing)
        self._touching = radius[:, None] + radius[None, :]

    def acceleration(self, walkers: Walkers) -> Array:
        law, position, velocity, touching = self._law, walkers.position, walkers.velocity, self._touching
        dx, dy = (position[:, None, k] - position[None, :, k] for k in (0, 1))  # from i (column) to j (row)
        weight = walkers.weight
        if walkers.member is not None and walkers.bond is not None:
            less = (1.0 - law.among_group) * (1.0 - walkers.bond)
            weight = weight * (1.0 - less * walkers.member)
        way, speed = steered(
            dx, dy, velocity, walkers.direction, walkers.desired_speed, touching, weight,
            choice=self._choice, strip=self._strip,
        )  # fmt: skip
        faces = walkers.heading[:, 0] * way[:, 0] + walkers.heading[:, 1] * way[:, 1]
        speed = speed * np.minimum(np.maximum(1.0 + faces, BACKWARDS), 1.0)  # who faces away turns before they walk
        total = paced_acceleration(velocity, way, speed, walkers.desired_speed, self._gait)
        if walkers.member is not None and walkers.bond is not None:
            total += company_acceleration(
                dx, dy, walkers.direction, walkers.member, walkers.bond, cohesion=law.cohesion, spacing=law.spacing,
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
