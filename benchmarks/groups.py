"""Distance of neighbours in walking groups, and their angle to the direction of motion.

    python benchmarks/groups.py [--model sonata2026] [--episodes 10] [--json]

Groups of 2 to 5 wander in a hall. Recorded groups (ETH, Zara) keep 0.7-1.1 m between neighbours, at 63-76 degrees to
the direction of motion: 90 is side by side, 0 is in file.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np

import sonata2d as s2

SETTLED = 50  # ticks
WALKING = 0.6  # m/s, mean of the two


def measure(size: int, model: str, episodes: int) -> dict[str, Any]:
    """Neighbours in groups of a arguments size."""
    config = s2.ScenarioConfig(
        name="groups", room={"kinds": "hall", "hall": 14}, standing=0, wandering=0, tables=0, plants=0, relations=0,
        walking_groups=3, groups={"walking_size": size}, person={"model": model, "ignores_robot": 1.0},
        rules={"time_limit": 60.0, "ends_on": ["time"]},
    )  # fmt: skip
    distance, angle, widest = [], [], []
    for seed in range(episodes):
        scene = s2.generate(config, seed)
        episode = s2.Episode(scene, s2.StraightToGoal(speed=0.01))
        row = {human.id: k for k, human in enumerate(scene.humans)}
        while (frame := episode.step()) is not None:
            if frame.snapshot.tick < SETTLED:
                continue
            humans = frame.snapshot.humans
            for group in scene.groups:
                rows = [row[member] for member in group.members]
                position, velocity = humans.position[rows], humans.velocity[rows]
                gaps = np.linalg.norm(position[:, None] - position[None], axis=2) + 9.0 * np.eye(size)
                widest.append(np.linalg.norm(position - position.mean(axis=0), axis=1).max())
                for k, other in enumerate(gaps.argmin(axis=0)):
                    motion = velocity[k] + velocity[other]
                    if np.linalg.norm(motion) < 2 * WALKING:
                        continue
                    distance.append(gaps[k, other])
                    side = abs((position[other] - position[k]) @ motion) / gaps[k, other] / np.linalg.norm(motion)
                    angle.append(np.degrees(np.arccos(min(side, 1.0))))
    return {
        "members": size,
        "neighbour, median (m)": round(float(np.median(distance)), 2),
        "5 to 95 % (m)": [round(float(x), 2) for x in np.percentile(distance, (5, 95))],
        "angle to the motion, median (deg)": round(float(np.median(angle))),
        "largest distance from the centre, 95th percentile (m)": round(float(np.percentile(widest, 95)), 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="sonata2026")
    parser.add_argument("--episodes", type=int, default=10)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    rows = [measure(size, arguments.model, arguments.episodes) for size in (2, 3, 4, 5)]
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return
    for row in rows:
        print("  ".join(f"{name}: {value}" for name, value in row.items()))


if __name__ == "__main__":
    main()
