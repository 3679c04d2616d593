"""CPU time of a frame beside navground, JuPedSim and the bare physics engine, by the number of people.

    pip install navground jupedsim
    python benchmarks/peers.py [--people 1 5 10 ...] [--frames 300] [--repeats 5] [--only 1,2]

People walk to random places in a square room of 10 m, or of 1 m2 a person, with four solid squares; ticks of 0.1 s, and
the state of everybody is read in each. Frames of sonata2d include the file: "Python" with a controller in Python,
"run" with `StraightToGoal` and `Episode.run`. "engine" is `cpSpaceStep` alone, with the same substeps. Every
simulator has a warm-up of 50 frames, rounds are interleaved, and the row holds the medians.
"""

from __future__ import annotations

import argparse
import math
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from engine import engine_steps, shortest

import sonata2d as s2

PEOPLE = (1, 5, 10, 20, 50, 100, 200, 500, 1000)
RADIUS, SPEED, DT = 0.25, 1.2, 0.1
WARM_UP = 50  # frames
Step = Callable[[int], None]  # runs a number of frames


class Straight(s2.Controller):
    """Turns to the goal and drives: a controller in Python as users write it."""

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        x, y = snapshot.robot.pose.to_local(snapshot.goal.position)
        return s2.Twist(vx=0.5, omega=2.0 * math.atan2(y, x))


class Room:
    """A square room with four squares of 0.5 m, and places where people start and walk to.

    Args:
        people: their number.
    """

    def __init__(self, people: int) -> None:
        self.people, self.side = people, max(10.0, math.sqrt(people))
        quarter, half = self.side / 4, self.side / 2
        self.squares = [(half + i * quarter, half + j * quarter) for i in (-1, 1) for j in (-1, 1)]
        draw, count = np.random.default_rng(1), math.ceil(math.sqrt(2 * people + 8))
        pitch = (self.side - 1.0) / count
        grid = [(0.5 + pitch * (i + 0.5), 0.5 + pitch * (j + 0.5)) for i in range(count) for j in range(count)]
        free = [p for p in grid if all(max(abs(p[0] - x), abs(p[1] - y)) > 0.6 for x, y in self.squares)]
        order = draw.permutation(len(free)).tolist()
        self.starts = [free[k] for k in order[:people]]
        self.targets = [[free[k] for k in draw.integers(len(free), size=20)] for _ in range(people)]


def scene_of(room: Room, frames: int) -> s2.Scene:
    """The room as a scene of sonata2d."""
    config = {
        "name": "peers", "standing": 0, "wandering": room.people, "relations": 0, "tables": 0, "plants": 0,
        "room": {"polygon": [[0.0, 0.0], [room.side, 0.0], [room.side, room.side], [0.0, room.side]]},
        "furniture": [{"type": "table", "x": x, "y": y, "theta": 0.0, "size": (0.5, 0.5)} for x, y in room.squares],
        "rules": {"time_limit": frames * DT, "ends_on": ["time"]},
    }  # fmt: skip
    return s2.generate(s2.ScenarioConfig.model_validate(config), seed=1)


def sonata(room: Room, frames: int, controller: s2.Controller, path: Path) -> float:
    """CPU seconds a frame, from the first tick to the file."""
    with s2.JsonRecorder(path) as recorder:
        episode = s2.Episode(scene_of(room, frames), controller, observers=[recorder])
        start = time.process_time()
        episode.run()
    return (time.process_time() - start) / frames


def navground(room: Room) -> Step:
    """ORCA of navground."""
    from navground import core, sim

    world = sim.World()
    for (x, y), targets in zip(room.starts, room.targets, strict=True):
        task = sim.tasks.WaypointsTask(waypoints=targets, loop=True, tolerance=0.3)
        kinematics = core.kinematics.OmnidirectionalKinematics(max_speed=SPEED, max_angular_speed=3.0)
        behavior = core.behaviors.ORCABehavior(kinematics, RADIUS)
        behavior.optimal_speed, behavior.horizon = SPEED, 5.0
        estimation = sim.state_estimations.BoundedStateEstimation(range=5.0)
        agent = sim.Agent(RADIUS, behavior, kinematics, task, [estimation])
        agent.position = (x, y)
        world.add_agent(agent)
    corners = [(0, 0), (room.side, 0), (room.side, room.side), (0, room.side)]
    outlines = [corners, *([(x + a, y + b) for a, b in _CORNERS] for x, y in room.squares)]
    for outline in outlines:
        for a, b in zip(outline, [*outline[1:], outline[0]], strict=True):
            world.add_wall(sim.Wall(a, b))

    def step(frames: int) -> None:
        for _ in range(frames):
            world.update(DT)
            [(*agent.position, agent.orientation, *agent.velocity) for agent in world.agents]

    return step


def jupedsim(room: Room, model: str) -> Step:
    """A model of JuPedSim."""
    import jupedsim
    import shapely

    floor = shapely.box(0, 0, room.side, room.side)
    for x, y in room.squares:
        floor = floor.difference(shapely.box(x - 0.25, y - 0.25, x + 0.25, y + 0.25))
    simulation = jupedsim.Simulation(model=getattr(jupedsim, model)(), geometry=floor, dt=DT)
    parameters = getattr(jupedsim, f"{model}AgentParameters")
    for start, targets in zip(room.starts, room.targets, strict=True):
        stages = [simulation.add_waypoint_stage(target, 0.3) for target in targets]
        journey = jupedsim.JourneyDescription(stages)
        for a, b in zip(stages, [*stages[1:], stages[0]], strict=True):
            journey.set_transition_for_stage(a, jupedsim.Transition.create_fixed_transition(b))
        identity = simulation.add_journey(journey)
        simulation.add_agent(
            parameters(position=start, journey_id=identity, stage_id=stages[0], radius=0.2, desired_speed=SPEED)
        )

    def step(frames: int) -> None:
        for _ in range(frames):
            simulation.iterate()
            [(agent.position, agent.orientation) for agent in simulation.agents()]

    return step


_CORNERS = ((-0.25, -0.25), (0.25, -0.25), (0.25, 0.25), (-0.25, 0.25))
PEERS: dict[str, Callable[[Room], Step]] = {
    "navground ORCA": navground,
    "CFSM v3": lambda room: jupedsim(room, "CollisionFreeSpeedModelV3"),
    "AVM": lambda room: jupedsim(room, "AnticipationVelocityModel"),
}


def measure(people: int, frames: int, repeats: int, folder: Path) -> dict[str, float]:
    """Median CPU time of a frame, us, by simulator."""
    room, path = Room(people), folder / "episode.json"
    peers = {name: make(room) for name, make in PEERS.items()}
    for step in peers.values():
        step(WARM_UP)
    controllers = {"Python": Straight, "run": s2.StraightToGoal}
    seconds: dict[str, list[float]] = {name: [] for name in (*controllers, *peers)}
    steps: list[list[float]] = []
    sonata(room, WARM_UP, s2.StraightToGoal(), path)
    for _ in range(repeats):
        for name, make in controllers.items():
            seconds[name].append(sonata(room, frames, make(), path))
        for name, step in peers.items():
            start = time.process_time()
            step(frames)
            seconds[name].append((time.process_time() - start) / frames)
        steps.append(engine_steps(lambda: sonata(room, frames, s2.StraightToGoal(), path)))
    row = {name: statistics.median(values) * 1e6 for name, values in seconds.items()}
    row["engine"] = shortest(steps) / frames * 1e6
    best = min(row[name] for name in PEERS)
    return {
        "people": people,
        **row,
        "Python/best": row["Python"] / best,
        "run/best": row["run"] / best,
        "run/engine": row["run"] / row["engine"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--people", type=int, nargs="+", default=PEOPLE)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for n, people in enumerate(arguments.people):
            row = measure(people, arguments.frames, arguments.repeats, Path(folder))
            if n == 0:
                print("".join(f"{name:>15}" for name in row))
            print("".join(f"{value:15.1f}" if value >= 100 or n else f"{value:15.2f}" for value in row.values()))


if __name__ == "__main__":
    main()
