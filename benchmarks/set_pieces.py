"""Reactions of people to a robot in scenes that each test one behaviour; prints a row for each scene.

    python benchmarks/set_pieces.py [--seeds 10] [--only NAME]

- blocked door: the robot stands in a door of 0.8 m for 15 s. Path and turning of the person who waits.
- door from both sides: robot and person meet at a door of 0.8 m; the robot waits until the person is through.
- talking group: the robot drives through four people who talk. Share of those in its way who move, or turn their body,
  within 2 s of its arrival. Heads do not count, since people who talk look from face to face.
- overtaking: the robot overtakes a person on the same line. Swerve of the person from this line.
- following: the robot follows a person at 1 m for 10 s. Time for which the person looks back.
- crossing: the person reaches the crossing before or after the robot. Share of persons who cross first.
- reactions: 99th percentile of the acceleration of people with each of the reactions.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Any

import numpy as np

import sonata2d as s2
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.sim.world import World

HALL = [[-8, -8], [8, -8], [8, 8], [-8, 8]]
# Two rooms with a door of 0.8 m between them.
DOOR = {"polygon": HALL, "walls": [[0, -8, 0, -0.4], [0, 0.4, 0, 8]]}
DT = 0.1  # s, tick
Drive = Callable[[int, s2.Snapshot], s2.Twist]


def simulate(
    people: list[dict[str, Any]], robot: list[float], drive: Drive, seconds: float, seed: int, **config: Any
) -> list[s2.Snapshot]:
    """The snapshots of a scene of given people; `drive` gives the robot's velocity at each tick."""
    empty = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}
    config = {"room": {"polygon": HALL}} | config
    settings = {**empty, "people": people, "robot": {"pose": robot}, "goal": {"position": [7, 7]}, **config}
    scene = s2.generate(s2.ScenarioConfig.model_validate(settings), seed=seed)
    world, crowd, snapshots = World(scene), Crowd(scene), []
    for tick in range(round(seconds / DT)):
        snapshots.append(world.snapshot())
        world.step(drive(tick, snapshots[-1]), crowd.act(snapshots[-1]))
    return snapshots


def states(snapshots: list[s2.Snapshot], person: int = 0) -> np.ndarray[Any, Any]:
    """(T, 9), columns of `core.humans`, of one person."""
    return np.array([snapshot.humans.state[person] for snapshot in snapshots])


def path(track: np.ndarray[Any, Any]) -> float:
    """Length, m."""
    return float(np.hypot(*np.diff(track[:, :2], axis=0).T).sum())


def turning(track: np.ndarray[Any, Any]) -> float:
    """Degrees by which the body turns, to both sides together."""
    angle = np.unwrap(np.arctan2(track[:, 5], track[:, 4]))
    return float(np.degrees(np.abs(np.diff(angle)).sum()))


def straight(speed: float, until: int = 10_000) -> Drive:
    return lambda tick, _: s2.Twist(speed if tick < until else 0.0)


def blocked_door(seed: int) -> dict[str, float]:
    person = {"id": 1, "x": -4.0, "y": 0.3 * math.sin(seed), "goals": [[5.0, 0.0]]}

    def drive(tick: int, _: s2.Snapshot) -> s2.Twist:  # out of the door after 15 s, then to the left
        return s2.Twist(0.8 if 150 < tick <= 180 else 0.0, 0.8 if 180 < tick < 190 else 0.0)

    own = states(simulate([person], [0.0, 0.0, 0.0], drive, 30.0, seed, room=DOOR))
    waits = own[50:150]  # it has arrived at the door
    return {"path": path(waits), "turning": turning(waits), "through": float(own[-1, 0] > 1.0)}


def both_sides(seed: int) -> dict[str, float]:
    person = {"id": 1, "x": -3.0 - 0.2 * (seed % 5), "y": 0.3 * math.sin(seed), "goals": [[5.0, 0.0]]}

    def drive(tick: int, snapshot: s2.Snapshot) -> s2.Twist:
        x, near = snapshot.robot.position[0], snapshot.humans.position[0, 0]
        return s2.Twist(0.0 if x < 1.0 and near < 1.2 else 0.6)

    own = states(simulate([person], [3.0, 0.0, math.pi], drive, 25.0, seed, room=DOOR))
    return {"path": path(own), "turning": turning(own), "through": float(own[-1, 0] > 1.0)}


def talking_group(seed: int) -> dict[str, float]:
    groups = {"talking_size": 4, "formations": "circle", "places": [[0.0, 0.0]]}
    start = [-4.0, 0.5 * math.sin(seed), 0.0]
    found = simulate([], start, straight(0.6), 12.0, seed, talking_groups=1, groups=groups)
    reacted, met = 0, 0
    for k in range(4):
        own, robot = states(found, k), np.array([s.robot.position for s in found])
        distance = np.hypot(*(robot - own[0, :2]).T)
        if distance.min() > 0.6:
            continue  # the robot does not come to this person
        met += 1
        near = int((distance < 1.5).argmax())
        part = own[max(near - 20, 0) : near + 20]
        moved = np.hypot(*(part[:, :2] - own[0, :2]).T).max()
        turned = np.degrees(np.arccos(np.clip(part[:, 4:6] @ own[0, 4:6], -1, 1))).max()
        reacted += moved > 0.15 or turned > 20.0
    return {"react": reacted / max(met, 1)}


def overtaking(seed: int) -> dict[str, float]:
    person = {"id": 1, "x": -3.0, "y": 0.0, "theta": 0.0, "goals": [[7.0, 0.0]], "desired_speed": 1.0}
    aside = 0.3 * math.sin(seed)
    own = states(simulate([person], [-6.0, aside, 0.0], straight(1.6, 80), 9.0, seed))
    return {"swerve": float(np.abs(own[:, 1]).max())}


def following(seed: int) -> dict[str, float]:
    person = {"id": 1, "x": -5.0, "y": 0.0, "theta": 0.0, "goals": [[7.0, 0.0]], "desired_speed": 1.0}

    def drive(_: int, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist(max(min(snapshot.humans.position[0, 0] - snapshot.robot.position[0] - 1.2 + 0.9, 1.5), 0.0))

    found = simulate([person], [-6.5, 0.0, 0.0], drive, 10.0, seed)
    looks = sum(float(s.humans.state[0, 6]) < 0.7 for s in found)  # by more than 45 degrees
    return {"looks back, s": looks * DT}


def crossing(offset: float) -> Callable[[int], dict[str, float]]:
    def run(seed: int) -> dict[str, float]:
        person = {"id": 1, "x": 0.0, "y": -6.0 - offset + 0.1 * math.sin(seed), "theta": math.pi / 2,
                  "goals": [[0.0, 7.0]], "desired_speed": 1.2, "velocity": [0.0, 1.2]}  # fmt: skip
        found = simulate([person], [-5.0, 0.0, 0.0], straight(1.0, 110), 11.0, seed)
        own, robot = states(found), np.array([s.robot.position for s in found])
        return {"person first": float(np.argmax(own[:, 1] > 0.0) < np.argmax(robot[:, 0] > 0.0))}

    return run


def reaction(kind: str) -> Callable[[int], dict[str, float]]:
    def run(seed: int) -> dict[str, float]:
        people = [
            {
                "id": 1,
                "x": 0.0,
                "y": -5.0 - 0.2 * (seed % 5),
                "theta": math.pi / 2,
                "goals": [[0.0, 7.0]],
                "reaction": kind,
            },
            {"id": 2, "x": 5.0, "y": 0.3, "theta": math.pi, "goals": [[-7.0, 0.0]], "reaction": kind},
        ]
        found = simulate(people, [-5.0, 0.0, 0.0], straight(1.0, 110), 14.0, seed)
        velocity = np.array([snapshot.humans.state[:, 2:4] for snapshot in found])[10:]
        change = np.linalg.norm(np.diff(velocity, axis=0), axis=2) / DT
        return {"acceleration p99": float(np.percentile(change, 99))}

    return run


PIECES: dict[str, Callable[[int], dict[str, float]]] = {
    "blocked door": blocked_door,
    "door from both sides": both_sides,
    "talking group": talking_group,
    "overtaking": overtaking,
    "following": following,
    "crossing, person 0.8 m early": crossing(-0.8),
    "crossing, person 0.8 m late": crossing(0.8),
    **{f"reaction {kind}": reaction(kind) for kind in ("avoids", "stops", "curious", "scared")},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    for name, piece in PIECES.items():
        if arguments.only not in name:
            continue
        rows = [piece(seed) for seed in range(arguments.seeds)]
        for key in rows[0]:
            values = np.array([row[key] for row in rows])
            print(f"{name:30} {key:16} mean {values.mean():6.2f}  largest {values.max():6.2f}", flush=True)


if __name__ == "__main__":
    main()
