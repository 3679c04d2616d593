"""CPU time of a tick in large rooms: tables, inner walls, and maps traced from bitmaps, by their number.

python benchmarks/rooms.py [--side 40] [--people 20] [--ticks 600] [--repeats 3] [--only tables,walls,traced]

People walk to random places in a square room. The row with 8 tables comes first in every round, and the last column is
the ratio to it, so that rounds on a machine with other work can be compared. Kernels are compiled, or loaded, before.
"""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import sonata2d as s2
from sonata2d.core.scene import Scene
from sonata2d.errors import SceneError

TABLES, WALLS = (8, 100, 300, 400, 1000), (100, 1000, 2300)
TABLE = (0.8, 0.6)  # m
SPACING = 1.25  # m, between the centres of tables
CELL = 0.25  # m, of a bitmap
# By the corners of a cell that are solid (1, 2, 4, 8 counter-clockwise from the lower left): the sides (lower, right,
# upper, left) between which the contour runs.
SIDES: dict[int, tuple[tuple[int, int], ...]] = {
    1: ((3, 0),), 2: ((0, 1),), 3: ((3, 1),), 4: ((1, 2),), 5: ((3, 0), (1, 2)), 6: ((0, 2),), 7: ((3, 2),),
    8: ((2, 3),), 9: ((2, 0),), 10: ((0, 1), (2, 3)), 11: ((2, 1),), 12: ((1, 3),), 13: ((1, 0),), 14: ((0, 3),),
}  # fmt: skip
MIDDLES = ((0.5, 0.0), (1.0, 0.5), (0.5, 1.0), (0.0, 0.5))  # of the sides


def furnished(side: float, people: int, count: int, seed: int) -> Scene:
    """A room with tables at random places and angles; as dense as 1000 in 40 m, they stand in rows."""
    draw, places = np.random.default_rng(seed), []
    if count * SPACING * SPACING > 0.5 * side * side:
        columns = math.ceil(math.sqrt(count))
        pitch = (side - 3.2) / (columns - 1)
        grid = [(1.6 + pitch * (k % columns), 1.6 + pitch * (k // columns)) for k in range(columns**2)]
        places = [grid[k] for k in draw.permutation(len(grid))[:count].tolist()]
    while len(places) < count:
        x, y = draw.uniform(1.0, side - 1.0, 2).tolist()
        if all(math.dist((x, y), place) > SPACING for place in places):
            places.append((x, y))
    furniture = [
        {"type": "table", "x": x, "y": y, "theta": round(draw.uniform(-3.0, 3.0), 4), "size": TABLE}
        for x, y in np.round(places, 4).tolist()
    ]
    return _scene(side, people, seed, furniture=furniture)


def walled(side: float, people: int, count: int, seed: int) -> Scene:
    """A room with inner walls of 0.5 to 2 m at random places and angles, which may cross."""
    draw, walls = np.random.default_rng(seed), []
    while len(walls) < count:
        x, y, size, angle = (*draw.uniform(1.0, side - 1.0, 2), draw.uniform(0.5, 2.0), draw.uniform(0.0, 2 * math.pi))
        end = x + size * math.cos(angle), y + size * math.sin(angle)
        if min(end) > 1.0 and max(end) < side - 1.0:
            walls.append([round(float(value), 4) for value in (x, y, *end)])
    return _scene(side, people, seed, walls)


def traced(side: float, people: int, _: int, seed: int) -> Scene:
    """A room with the contours of pillars of irregular shape on a bitmap, by marching squares."""
    draw = np.random.default_rng(seed)
    cells = int(side / CELL)
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
            ends = [(i + MIDDLES[at][0], j + MIDDLES[at][1]) for at in (a, b)]
            walls.append([round(CELL * value, 4) for end in ends for value in end])
    return _scene(side, people, seed, walls)


def _scene(side: float, people: int, seed: int, walls: Any = (), furniture: Any = ()) -> Scene:
    config = s2.ScenarioConfig.model_validate({
        "name": "large-room", "standing": 0, "wandering": people, "relations": 0, "tables": 0, "plants": 0,
        "room": {"polygon": [[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]], "walls": walls},
        "furniture": furniture, "robot": {"pose": [0.4, 0.4, 0.8]}, "goal": {"position": [side - 0.4, side - 0.4]},
        "rules": {"time_limit": 600.0, "ends_on": ["time"]},
    })  # fmt: skip
    return s2.generate(config, seed=seed)


def measure(scene: Scene, ticks: int) -> tuple[float, list[float]]:
    """CPU time to make an episode, and of each of its ticks, s."""
    start = time.process_time()
    episode = s2.Episode(scene, s2.StraightToGoal())
    made, times = time.process_time() - start, []
    for _ in range(ticks):
        start = time.process_time()
        episode.step()
        times.append(time.process_time() - start)
    return made, times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=float, default=40.0, help="m")
    parser.add_argument("--people", type=int, default=20)
    parser.add_argument("--ticks", type=int, default=600)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", default="tables,walls,traced")
    arguments = parser.parse_args()
    kinds: dict[str, tuple[Callable[[float, int, int, int], Scene], tuple[int, ...]]] = {
        "tables": (furnished, TABLES), "walls": (walled, WALLS), "traced": (traced, (0,)),
    }  # fmt: skip
    measure(furnished(10.0, 3, 8, 0), 100)
    print("room             solids  episode, ms  mean, us  median, us  first, us  worst later, us  mean / 8 tables")
    for name in arguments.only.split(","):
        build, counts = kinds[name]
        for count in counts:
            rows = []
            for seed in itertools.count():
                if len(rows) == arguments.repeats:
                    break
                try:
                    scene = build(arguments.side, arguments.people, count, seed)
                except SceneError:  # the solids close all ways of the robot
                    continue
                _, base = measure(furnished(arguments.side, arguments.people, 8, seed), arguments.ticks)
                made, times = measure(scene, arguments.ticks)
                mean = statistics.fmean(times)
                rows.append((made * 1e3, mean * 1e6, statistics.median(times) * 1e6, times[0] * 1e6,
                             max(times[1:]) * 1e6, mean / statistics.fmean(base)))  # fmt: skip
            made, mean, median, first, worst, ratio = map(statistics.median, zip(*rows, strict=True))
            print(
                f"{name:8}{count or len(scene.walls):8}{len(scene.barriers):8}{made:13.1f}{mean:10.0f}{median:12.0f}"
                f"{first:11.0f}{worst:17.0f}{ratio:17.2f}", flush=True,
            )  # fmt: skip


if __name__ == "__main__":
    main()
