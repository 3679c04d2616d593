"""Measured walking speeds and passing distances of the kinds of persons, beside the speeds of their sources.

    python benchmarks/person_kinds.py [--persons 60]

Each person walks 12 m alone, and meets an adult head-on, and a robot of 0.3 m that stands in its way. The speed is the
median of the middle 8 m, the passing distance the smallest gap between the outlines. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from set_pieces import simulate, states

import sonata2d as s2
from sonata2d.core.geometry import shoulder_line_distances
from sonata2d.core.person_kinds import BUILT_IN

_SECONDS = 40.0
_STOP = s2.Twist(0.0, 0.0, 0.0)


def run(people: list[dict[str, Any]], seed: int, robot: tuple[float, float] = (-7.5, -7.5)) -> list[s2.Snapshot]:
    """The snapshots of people in a hall with a robot that stands."""
    return simulate(people, [*robot, 0.0], lambda tick, snapshot: _STOP, _SECONDS, seed)


def measure(kind: str, seed: int) -> tuple[float, float, float, float]:
    """Desired and walking speed, m/s, and the least gaps to an adult and to the robot, m."""
    person = {"kind": kind, "x": -6.0, "y": 0.0, "goals": [[6.0, 0.0]]}
    snapshots = run([person], seed)
    rows = states(snapshots)
    middle = rows[np.abs(rows[:, 0]) < 4.0]
    speed = float(np.median(np.hypot(middle[:, 2], middle[:, 3])))
    meeting = run([person, {"kind": "adult", "x": 6.0, "y": 0.0, "goals": [[-6.0, 0.0]]}], seed)
    first, second, humans = states(meeting), states(meeting, 1), meeting[0].humans
    offset, (shoulder, other) = second[:, :2] - first[:, :2], humans.shoulder
    gaps = shoulder_line_distances(offset, first[:, 4:6], shoulder, second[:, 4:6], other) - humans.radius.sum()
    to_robot = [s2.clearance(snapshot) for snapshot in run([person], seed, (0.0, 0.0))]
    return snapshots[0].scene.humans[0].desired_speed, speed, float(gaps.min()), float(np.min(to_robot))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--persons", type=int, default=60, help="of each kind (default: 60)")
    persons = parser.parse_args().persons
    print("| kind | speed in the source, m/s | desired speed | walking speed | gap to an adult, m | to a robot |")
    print("| --- | --- | --- | --- | --- | --- |")
    for kind in BUILT_IN:
        values = np.array([measure(kind.name, seed) for seed in range(persons)])
        source = f"{kind.desired_speed[0]:.2f} ± {kind.desired_speed[1]:.2f}" if kind.desired_speed else "as of adults"
        desired, walking = (f"{column.mean():.2f} ± {column.std():.2f}" for column in values[:, :2].T)
        adult, robot = (f"{np.median(column):.2f} ({column.min():.2f})" for column in values[:, 2:].T)
        print(f"| {kind.name} | {source} | {desired} | {walking} | {adult} | {robot} |", flush=True)


if __name__ == "__main__":
    main()
