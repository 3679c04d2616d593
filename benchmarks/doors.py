"""Time that people need to pass a doorway between two rooms: alone, in one direction, and in both.

python benchmarks/doors.py [--widths 0.9 1.0 1.2] [--model sonata2026] [--seeds 10] [--json]
"""

from __future__ import annotations

import argparse
import json
import math
from typing import Any

import numpy as np

from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.core.entities import Goal, Human, Robot, Wall
from sonata2d.core.geometry import Pose, Twist
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Scene
from sonata2d.sim.world import World

GROUPS = ((1, 0), (15, 0), (1, 1), (3, 3), (8, 8))  # people from the left, people from the right
SECONDS = 60.0
THROUGH = 0.3  # m beyond the door


def two_rooms(width: float, left: int, right: int, seed: int, model: str) -> Scene:
    """People on both sides of a door, each with a goal on the other side."""
    rng, humans = RandomStream(seed, 0, "scene"), []
    corners = ((-6.0, -3.0), (6.0, -3.0), (6.0, 3.0), (-6.0, 3.0))
    outline = [Wall(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    door = [Wall((0.0, -3.0), (0.0, -width / 2)), Wall((0.0, width / 2), (0.0, 3.0))]
    positions: list[tuple[float, float]] = []
    for side, count in ((-1, left), (1, right)):
        while count:
            x, y = side * rng.uniform(1.0, 5.0), rng.uniform(-2.3, 2.3)
            if all(math.dist((x, y), other) > 0.5 for other in positions):
                positions.append((x, y))
                goal = (-side * rng.uniform(3.0, 5.0), rng.uniform(-2.0, 2.0))
                speed = rng.normal(1.3, 0.2, 0.8, 1.8)
                pose = Pose(x, y, 0.0 if side < 0 else math.pi)
                human = Human(len(humans) + 1, pose, desired_speed=speed, behaviour="walking", model=model,
                              reacts_to_robot=0.0, goals=(goal,))  # fmt: skip
                humans.append(human)
                count -= 1
    return Scene("doors", "doors/arguments", corners, (*outline, *door), (), tuple(humans),
                 Robot(Pose(-5.6, -2.6)), Goal(5.6, 2.6))  # fmt: skip


def passed(scene: Scene) -> tuple[float, float]:
    """Fraction of the people who passed, and the time at which the last one did, s."""
    world, crowd = World(scene), Crowd(scene)
    side = np.array([1.0 if human.pose.x < 0.0 else -1.0 for human in scene.humans])
    for tick in range(int(SECONDS * 10)):
        snapshot = world.snapshot()
        through = snapshot.humans.position[:, 0] * side > THROUGH
        if through.all():
            return 1.0, tick / 10
        world.step(Twist(), crowd.act(snapshot))
    return float(through.mean()), math.inf


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--widths", nargs="+", type=float, default=[0.8, 0.9, 1.0, 1.2])
    parser.add_argument("--model", default="sonata2026")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for width in arguments.widths:
        for left, right in GROUPS:
            runs = [passed(two_rooms(width, left, right, seed, arguments.model)) for seed in range(arguments.seeds)]
            fraction, last = (np.array(column) for column in zip(*runs, strict=True))
            rows.append({"width (m)": width, "people": f"{left} + {right}", "passed (%)": 100 * fraction.mean(),
                         "all passed (% of runs)": 100 * np.isfinite(last).mean(),
                         "last person, median (s)": np.median(last)})  # fmt: skip
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return
    for row in rows:
        print(
            "  ".join(
                f"{name} {value:g}" if isinstance(value, float) else f"{name} {value:7}" for name, value in row.items()
            )
        )


if __name__ == "__main__":
    main()
