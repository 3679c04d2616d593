"""CPU time of each tick in a map traced from a bitmap: thousands of short walls.

python benchmarks/traced_map.py [--size 40] [--people 10] [--ticks 300] [--seeds 3]

The bitmap has pillars of irregular shape on cells of 0.25 m; the walls are its contour by marching squares. Processes
compile, or load, the kernels in a small room before.
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np

import sonata2d as s2
from sonata2d.core.scene import Scene

CELL = 0.25  # m
# By the corners of a cell that are solid (1, 2, 4, 8 counter-clockwise from the lower left): the sides (lower, right,
# upper, left) between which the contour runs.
SIDES: dict[int, tuple[tuple[int, int], ...]] = {
    1: ((3, 0),), 2: ((0, 1),), 3: ((3, 1),), 4: ((1, 2),), 5: ((3, 0), (1, 2)), 6: ((0, 2),), 7: ((3, 2),),
    8: ((2, 3),), 9: ((2, 0),), 10: ((0, 1), (2, 3)), 11: ((2, 1),), 12: ((1, 3),), 13: ((1, 0),), 14: ((0, 3),),
}  # fmt: skip
MIDDLES = ((0.5, 0.0), (1.0, 0.5), (0.5, 1.0), (0.0, 0.5))  # of the sides


def traced_walls(size: float, seed: int) -> list[list[float]]:
    """The contours of pillars in a square room, x1, y1, x2, y2, m."""
    draw = np.random.default_rng(seed)
    cells = int(size / CELL)
    x, y = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1), indexing="ij")
    solid = np.zeros(x.shape, dtype=bool)
    pitch = 16  # cells, from pillar to pillar
    for i in range(pitch // 2, cells - pitch // 2 + 1, pitch):
        for j in range(pitch // 2, cells - pitch // 2 + 1, pitch):
            for _ in range(4):
                a, b, radius = i + draw.uniform(-2.0, 2.0), j + draw.uniform(-2.0, 2.0), draw.uniform(1.0, 3.0)
                solid |= (x - a) ** 2 + (y - b) ** 2 < radius**2
    walls = []
    corners = solid[:-1, :-1] + 2 * solid[1:, :-1] + 4 * solid[1:, 1:] + 8 * solid[:-1, 1:]
    for i, j in np.argwhere((corners > 0) & (corners < 15)).tolist():
        for a, b in SIDES[int(corners[i, j])]:
            ends = [(i + MIDDLES[side][0], j + MIDDLES[side][1]) for side in (a, b)]
            walls.append([round(CELL * value, 4) for end in ends for value in end])
    return walls


def traced_scene(size: float, people: int, seed: int) -> Scene:
    """A room with traced walls, people who wander, and a robot that crosses it."""
    polygon = [[0.0, 0.0], [size, 0.0], [size, size], [0.0, size]]
    config = s2.ScenarioConfig.model_validate({
        "name": "traced-map", "standing": 0, "wandering": people, "relations": 0, "tables": 0, "plants": 0,
        "room": {"polygon": polygon, "walls": traced_walls(size, seed)},
        "robot": {"pose": [0.6, 0.6, 0.8]}, "goal": {"position": [size - 0.6, size - 0.6]},
        "rules": {"time_limit": 600.0},
    })  # fmt: skip
    return s2.generate(config, seed=seed)


def tick_times(scene: Scene, controller: s2.Controller, ticks: int) -> tuple[float, list[float]]:
    """CPU time to make the episode, and of each of its ticks, s."""
    start = time.process_time()
    episode = s2.Episode(scene, controller)
    made, times = time.process_time() - start, []
    for _ in range(ticks):
        start = time.process_time()
        if episode.step() is None:
            break
        times.append(time.process_time() - start)
    return made, times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=float, default=40.0, help="side of the room, m")
    parser.add_argument("--people", type=int, default=10)
    parser.add_argument("--ticks", type=int, default=300)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--controller", default="straight-to-goal")
    arguments = parser.parse_args()
    tick_times(traced_scene(8.0, 3, 0), s2.load_controller(arguments.controller), 50)
    print("walls  scene, s  episode, s  first tick, s  largest, s  median, ms")
    for seed in range(arguments.seeds):
        start = time.process_time()
        scene = traced_scene(arguments.size, arguments.people, seed)
        generated = time.process_time() - start
        made, times = tick_times(scene, s2.load_controller(arguments.controller), arguments.ticks)
        print(
            f"{len(scene.walls):5}  {generated:8.3f}  {made:10.3f}  {times[0]:13.3f}  {max(times[1:]):10.3f}"
            f"  {1e3 * statistics.median(times):10.3f}"
        )


if __name__ == "__main__":
    main()
