"""Do simulated people pass a robot as recorded ones did?

    python benchmarks/encounters.py ENCOUNTERS.csv [--seeds 2]

Replays each recorded encounter: the robot on its recorded track, each person from the recorded start to the recorded
end at the recorded speed. ENCOUNTERS.csv has the columns `encounter, who, t, x, y`, with the robot or a number in
`who`, s and m. The Zucker data set has such encounters (Day & Karamouzas, IEEE RA-L 2024, arXiv 2307.08668). Prints,
for recorded and simulated people, the least distance of the centres, the swerve from the straight line and the hardest
braking; Wasserstein-1 distances between both, and between two halves of the recorded ones; and the share of encounters,
nearer than 1.5 m, that are passed on the side of the recorded person.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.core.geometry import Twist
from sonata2d.formats.from_tracks import scenario_from_tracks
from sonata2d.scenegen.generator import generate
from sonata2d.sim.world import World

RADIUS, DT = 0.2, 0.1  # m, of the robot in the Zucker data set; s, tick
NEAR, SLOWEST, SHORTEST = 1.5, 0.4, 2.5  # m, m/s of a walking person, and m between start and end
Track = np.ndarray[Any, Any]


class Passage(NamedTuple):
    """Measures of one passage: m, m, m/s^2, and on which side of the person the robot is, 1 is left."""

    closest: float
    swerve: float
    braking: float
    side: float


def at(track: Track, times: Track) -> Track:
    """(T, 2), positions at times, of a track with the columns t, x, y."""
    return np.stack([np.interp(times, track[:, 0], track[:, column]) for column in (1, 2)], axis=-1)


def smooth(positions: Track) -> Track:
    """The mean of seven frames."""
    padded = [np.pad(positions[:, k], 3, "edge") for k in range(2)]
    return np.stack([np.convolve(column, np.ones(7) / 7, "valid") for column in padded], axis=-1)


def passage(person: Track, robot: Track) -> Passage | None:
    """The measures of a person that passes a robot; None if the tracks do not show it."""
    start, end = max(person[0, 0], robot[0, 0]), min(person[-1, 0], robot[-1, 0])
    if end - start < 1.5:
        return None
    times = np.arange(start, end, DT)
    own, other = smooth(at(person, times)), smooth(at(robot, times))
    distance = np.hypot(*(own - other).T)
    k, way = int(distance.argmin()), own[-1] - own[0]
    if np.hypot(*way) < 2.0 or not 3 < k < len(times) - 4:
        return None
    ux, uy = way / np.hypot(*way)
    speed = np.hypot(*np.gradient(own, DT, axis=0).T)
    braking = -np.gradient(speed, DT)[5:-5]
    across = (own - own[0]) @ np.array([-uy, ux])
    dx, dy = other[k] - own[k]
    return Passage(
        float(distance[k]),
        float(np.abs(across).max()),
        float(braking.max(initial=0.0)),
        float(np.sign(ux * dy - uy * dx)),
    )


def walking_part(track: Track) -> Track | None:
    """The part of a track in which the person walks, at the tick; None if it is short."""
    times = np.arange(track[0, 0], track[-1, 0], DT)
    positions = smooth(at(track, times))
    walks = np.flatnonzero(np.hypot(*np.gradient(positions, DT, axis=0).T) > SLOWEST)
    if len(walks) < 20:
        return None
    part = np.column_stack([times, positions])[walks[0] : walks[-1] + 1]
    return part if np.hypot(*(part[-1, 1:] - part[0, 1:])) > SHORTEST else None


def simulate(people: dict[int, Track], robot: Track, seed: int) -> tuple[dict[int, Track], Track]:
    """Tracks of simulated people in place of the recorded ones, and of the robot."""
    start, end = min(track[0, 0] for track in people.values()), max(track[-1, 0] for track in people.values())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tracks.csv"
        with path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["frame", "ped", "x", "y"])
            for person, track in people.items():
                first = round((track[0, 0] - start) / DT)
                writer.writerows([first + k, person + 1, round(x, 4), round(y, 4)] for k, (_, x, y) in enumerate(track))
        (x, y), (goal_x, goal_y) = at(robot, np.array([start, end + 3.0])).tolist()
        config = scenario_from_tracks(
            path, people="simulated", seconds=60, frame_time=DT, robot=(x, y, 0.0), goal=(goal_x + 0.01, goal_y)
        )
    scene = generate(config.model_copy(update={"robot": config.robot.model_copy(update={"radius": RADIUS})}), seed=seed)
    world, crowd = World(scene), Crowd(scene)
    tracks, own = defaultdict(list), []
    for tick in range(int((end - start) / DT) + 25):
        snapshot, time = world.snapshot(), start + tick * DT
        for person, (x, y) in zip(snapshot.humans.id.tolist(), snapshot.humans.position.tolist(), strict=True):
            tracks[person - 1].append((time, x, y))
        here = np.array(snapshot.robot.position)
        own.append((time, *here))
        vx, vy = ((at(robot, np.array([time + DT]))[0] - here) / DT).tolist()
        world.step(Twist(vx, vy, 0.0), crowd.act(snapshot))
    return {person: np.array(track) for person, track in tracks.items()}, np.array(own)


def wasserstein(first: Track, second: Track) -> float:
    share = np.linspace(0.5, 99.5, 200)
    return float(np.abs(np.percentile(first, share) - np.percentile(second, share)).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--seeds", type=int, default=2)
    arguments = parser.parse_args()
    encounters: dict[str, dict[str, list[tuple[float, float, float]]]] = defaultdict(lambda: defaultdict(list))
    with arguments.file.open(newline="") as file:
        for row in csv.DictReader(file):
            encounters[row["encounter"]][row["who"]].append((float(row["t"]), float(row["x"]), float(row["y"])))
    recorded, simulated, is_same = [], [], []
    for _, tracks in sorted(encounters.items()):
        robot = np.array(tracks["robot"])
        parts = {int(who): walking_part(np.array(track)) for who, track in tracks.items() if who != "robot"}
        people = {who: part for who, part in parts.items() if part is not None}
        real = {who: passage(track, robot) for who, track in people.items()}
        recorded += [found for found in real.values() if found]
        for seed in range(arguments.seeds if people else 0):
            made, own = simulate(people, robot, seed)
            for who, track in made.items():
                found = passage(track, own) if len(track) > 20 else None
                if found is None:
                    continue
                simulated.append(found)
                known = real[who]
                if known and known.closest < NEAR:
                    is_same.append(found.side == known.side)
    for k, name in enumerate(("closest, m", "swerve, m", "braking, m/s2")):
        first, second = np.array([row[k] for row in recorded]), np.array([row[k] for row in simulated])
        for label, values in (("recorded", first), ("simulated", second)):
            p10, p50, p90 = np.percentile(values, [10, 50, 90])
            print(f"{name:14} {label:10} 10, 50, 90 %: {p10:.2f} {p50:.2f} {p90:.2f}   of {len(values)}")
        halves = wasserstein(first[::2], first[1::2])
        print(f"{name:14} distance {wasserstein(first, second):.3f}, between halves of the recorded ones {halves:.3f}")
    print(f"same side {np.mean(is_same):.2f} of {len(is_same)}")


if __name__ == "__main__":
    main()
