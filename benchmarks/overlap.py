"""Deepest overlaps of bodies, stuck walkers, and abrupt turns of walking bodies.

    python benchmarks/overlap.py [--frames 100000] [--scenario sonata-2020 ...] [--model sonata2026 ...] [--json]

By default two settings: default scenes with a robot that drives straight to its goal, and a crush of 60 people in
6 x 6 m with a robot that moves at 3.5 m/s. With --scenario or --model: each of them, with the robot that drives
straight. Overlaps are measured at every frame, in mm.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import sonata2d as s2
from sonata2d.core.geometry import inside_polygon, segment_distances, shoulder_line_distances, shoulder_lines
from sonata2d.core.proxemics import clearances, obstacle_clearance
from sonata2d.core.relations import ACTIVITIES
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import ControllerInfo, Frame, Outcome, Snapshot

WINDOW = 200  # ticks, 20 s, in which a walker should make progress
STUCK = 0.5  # m
JERK = 3.1416  # rad/s, of a walking person's body
WALKING = 0.3  # m/s
WALKING_ACTIVITIES = [ACTIVITIES.index("walking"), ACTIVITIES.index("walking together")]
SITTING = ACTIVITIES.index("sitting")
DEEP = 0.01  # m, depth from which an overlap is counted


class RandomDriver(s2.Controller):
    """Drives at full speed and changes its turning command at random every second."""

    def reset(self, scene: Scene) -> None:
        self._rng = RandomStream(scene.seed, scene.episode, "controller")

    def act(self, snapshot: Snapshot) -> s2.Twist:
        if snapshot.tick % 10 == 0:
            self._turn = self._rng.uniform(-3.0, 3.0)
        return s2.Twist(vx=3.5, omega=self._turn)


class Meter:
    """An observer that accumulates the deepest overlaps and counts."""

    def __init__(self) -> None:
        self.frames = self.guarded = self.not_finite = self.outside = self.windows = self.stuck = 0
        self.pairs = self.deep = self.walking = self.jerks = 0
        self.deepest = {"person-person": 0.0, "person-solid": 0.0, "robot-person": 0.0, "robot-solid": 0.0}
        self._positions: list[s2.Array] = []
        self._is_walking: list[s2.Array] = []

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None:
        self._positions, self._is_walking = [], []
        self._wandering = [h.behaviour == "wandering" for h in scene.humans]
        self._count, self._pairs = len(scene.humans), np.triu_indices(0, 1)

    def on_frame(self, frame: Frame) -> None:
        snapshot = frame.snapshot
        humans, robot = snapshot.humans, snapshot.robot
        position = np.concatenate((humans.position, [robot.position]))
        self.frames += 1
        self.guarded += robot.guarded
        self.not_finite += int((~np.isfinite(humans.state)).sum()) + int((~np.isfinite(position[-1])).sum())
        self.outside += int((~inside_polygon(position, snapshot.scene.outline)).sum())
        if len(self._pairs[0]) != len(humans) * (len(humans) - 1) // 2:  # somebody has come or gone
            self._pairs = np.triu_indices(len(humans), 1)
        solids = snapshot.scene.barriers
        lines = shoulder_lines(humans.position, humans.direction, humans.shoulder)
        i, j = self._pairs
        body, other = (humans.direction[i], humans.shoulder[i]), (humans.direction[j], humans.shoulder[j])
        distance = shoulder_line_distances(humans.position[j] - humans.position[i], *body, *other)
        depth = humans.radius[i] + humans.radius[j] - distance
        solid = (humans.radius - segment_distances(*lines, solids)).max(axis=0)
        self.pairs, self.deep = self.pairs + len(depth), self.deep + int((depth > DEEP).sum())
        walking = np.linalg.norm(humans.velocity, axis=1) > WALKING
        self.walking += int(walking.sum())
        self.jerks += int((np.abs(humans.omega[walking]) > JERK).sum())
        self._update("person-person", depth)
        self._update("robot-person", -clearances(snapshot))
        self._update("person-solid", solid[humans.activity_index != SITTING])  # who sits overlaps the seat
        self._update("robot-solid", np.array([-obstacle_clearance(snapshot)]))
        walking = np.isin(humans.activity_index, WALKING_ACTIVITIES)
        self._positions.append(humans.expand(humans.position, self._count, 0.0)[self._wandering])
        self._is_walking.append(humans.expand(walking, self._count, False)[self._wandering])

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        positions = np.array(self._positions)
        for start in range(0, len(positions) - WINDOW + 1, WINDOW):
            window = positions[start : start + WINDOW]
            walking = np.array(self._is_walking[start : start + WINDOW]).all(
                axis=0
            )  # a person who talks for a while is not stuck
            distance = np.linalg.norm(window - window[0], axis=2).max(axis=0)[walking]
            self.windows += len(distance)
            self.stuck += int((distance < STUCK).sum())

    def _update(self, kind: str, depth: s2.Array) -> None:
        if len(depth):
            self.deepest[kind] = max(self.deepest[kind], float(depth.max()))

    def result(self) -> dict[str, float]:
        return {
            "frames": self.frames,
            **{f"deepest {kind} (mm)": round(depth * 1000, 1) for kind, depth in self.deepest.items()},
            "non-finite values": self.not_finite,
            "outside the room": self.outside,
            "ticks limited by the guard (%)": round(100 * self.guarded / self.frames, 2),
            "stuck walkers (%)": round(100 * self.stuck / max(self.windows, 1), 2),
            "pairs deeper than 10 mm (%)": round(100 * self.deep / max(self.pairs, 1), 4),
            "jerks of walking bodies (%)": round(100 * self.jerks / max(self.walking, 1), 3),
        }


def scenes_of(name: str = "sonata-2020", model: str = "sonata2026") -> Iterator[Scene]:
    """Scenes of a scenario with episodes of a full minute."""
    config = s2.load_scenario(name)
    person = config.person.model_copy(update={"model": model})
    rules = replace(config.rules, ends_on=("time",), time_limit=60.0)
    config = config.model_copy(update={"person": person, "rules": rules})
    for seed in range(10**9):
        yield s2.generate(config, seed=seed)


def crush_scenes() -> Iterator[Scene]:
    """Scenes of 60 people in 6 x 6 m and a robot that only its guard slows down."""
    limits = {
        "ahead": 3.5,
        "back": 3.5,
        "sideways": 3.5,
        "turn": 3.0,
        "acceleration": 100.0,
        "turn_acceleration": 100.0,
    }
    config = s2.ScenarioConfig(
        name="crush",
        room={"polygon": [[-3, -3], [3, -3], [3, 3], [-3, 3]]},
        standing=0, wandering=60, tables=0, plants=0, relations=0, person={"wall_distance": 0.25},
        robot={"limits": limits, "pose": [0, 0, 0]}, goal={"position": [2.4, 2.4]},
        rules={"ends_on": ["time"]},
    )  # fmt: skip
    for seed in range(10**9):
        yield s2.generate(config, seed=seed)


def measure(scenes: Iterator[Scene], controller: s2.Controller, frames: int) -> dict[str, float]:
    """Run scenes until enough frames were measured."""
    meter = Meter()
    while meter.frames < frames:
        s2.Episode(next(scenes), controller, observers=[meter]).run()
    return meter.result()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--scenario", nargs="*", default=[])
    parser.add_argument("--model", nargs="*", default=[])
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    frames, straight = arguments.frames, s2.StraightToGoal(speed=1.0)
    table = {name: measure(scenes_of(name), straight, frames) for name in arguments.scenario}
    table |= {name: measure(scenes_of(model=name), straight, frames) for name in arguments.model}
    table = table or {
        "default": measure(scenes_of(), straight, frames),
        "crush": measure(crush_scenes(), RandomDriver(), frames),
    }
    if arguments.json:
        print(json.dumps(table, indent=2))
        return
    print(" " * 32 + "".join(f"{name:>22}" for name in table))
    for row in next(iter(table.values())):
        print(f"{row:32}" + "".join(f"{column[row]:>22}" for column in table.values()))


if __name__ == "__main__":
    main()
