"""Steps per CPU second of the Gymnasium environment, beside the bare episode loop and other packages.

    python benchmarks/gym.py [--people 5 10 20] [--steps 4000] [--repeats 3] [--json]

Rooms of 10 m x 10 m with 4 walls and 4 pieces of furniture, pedestrians that wander, a robot that drives in curves;
episodes of 200 steps, resets included. In every repeat all candidates run one after another, and the fastest repeat
of each is shown. `navground-learning` (pedestrians with ORCA in C++, the robot sees all discs within 5 m) and
`highway-env` (other cars instead of pedestrians) are measured if they are installed.
"""

from __future__ import annotations

import argparse
import json
import logging
import time
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

import sonata2d as s2
import sonata2d.gym as s2g

LENGTH, HALF = 200, 5.0  # steps of an episode; half the side of the room, m
WORLDS, MANY = 8, 64  # of vectors
BATCHES, POOL = (64, 1024), 256  # numbers of worlds of `sonata2d.Worlds`, and of the scenes that they take in turn
PEOPLE = (5, 10, 20)
Stepper = Callable[[int], int | None]  # runs a number of steps; returns it if it is another one


def settings(people: int) -> dict[str, Any]:
    """Settings of the scenario, beside those of `empty`."""
    furniture = [{"type": "table", "x": x, "y": y} for x in (-3.0, 3.0) for y in (-3.0, 3.0)]
    return {
        "room": {"kinds": "square", "side": 2.0 * HALF}, "wandering": people, "furniture": furniture,
        "rules": {"time_limit": LENGTH / 10, "ends_on": ["time"]},
    }  # fmt: skip


def command(k: int) -> np.ndarray:
    """The action of a step."""
    return np.array([0.6, 0.0, np.sin(0.05 * k)], dtype=np.float32)


def bare_episode(people: int) -> Stepper:
    """`Episode.apply` without recorder, observation and reward."""
    config, number = s2.load_scenario("empty").changed(**settings(people)), 0

    def run(steps: int) -> None:
        nonlocal number
        episode = None
        for k in range(steps):
            if episode is None or episode.is_over:
                episode, number = s2.Episode(s2.generate(config, 0, number)), number + 1
            vx, vy, omega = command(k).tolist()
            episode.apply(s2.Twist(vx, vy, 1.5 * omega))
            episode.observe()

    return run


def single(make: Callable[[], Any], act: Callable[[int], Any] = command) -> Stepper:
    """One environment."""
    env = make()
    env.reset(seed=0)

    def run(steps: int) -> None:
        for k in range(steps):
            *_, terminated, truncated, _ = env.step(act(k))
            if terminated or truncated:
                env.reset()

    return run


def vector(make: Callable[[], Any]) -> Stepper:
    """Several environments; a step of all of them counts as many."""
    envs = make()
    envs.reset(seed=0)

    def run(steps: int) -> None:
        for k in range(max(steps // envs.num_envs, 1)):
            envs.step(np.stack([command(k)] * envs.num_envs))

    return run


def worlds(people: int, count: int, threads: int = 1) -> Stepper:
    """`sonata2d.Worlds`; each scene has had an episode before, as in long training."""
    config = s2.load_scenario("empty").changed(**settings(people))
    batch = s2.Worlds([s2.generate(config, 0, k) for k in range(POOL)], count, threads=threads)
    actions = np.tile(command(0), (count, 1))
    batch.reset()

    def run(steps: int) -> int:
        ticks = LENGTH * max(steps // (LENGTH * count), 1)  # whole episodes
        for k in range(ticks):
            actions[:] = command(k)
            batch.step(actions)
        return ticks * count

    for _ in range(POOL // count + 2):
        run(0)
    return run


def candidates(people: int) -> dict[str, Stepper]:
    """What is measured, by name."""

    def make() -> Any:
        return gymnasium.make("sonata2d/Empty-v0", settings=settings(people))

    arguments = {"scenario": "empty", "settings": settings(people)}

    def own_vector(count: int) -> Any:
        return s2g.SocialNavVectorEnv(count, flat=True, episodes=POOL // count, **arguments)

    found = {
        "bare episode": bare_episode(people),
        "dictionary": single(make),
        "flat": single(lambda: s2g.Flat(make())),
        "lidar, 72 rays": single(lambda: s2g.Lidar(make())),
        **{f"Worlds, {count}": worlds(people, count) for count in BATCHES},
        "Worlds, 64, two threads": worlds(people, 64, threads=2),
        f"vector of {WORLDS}, flat": vector(lambda: own_vector(WORLDS)),
        f"vector of {MANY}, flat": vector(lambda: own_vector(MANY)),
        f"AsyncVectorEnv of {WORLDS}, flat": vector(
            lambda: gymnasium.vector.AsyncVectorEnv([lambda: s2g.Flat(s2g.SocialNavEnv(**arguments))] * WORLDS)
        ),
    }
    if (other := navground(people)) is not None:
        found["navground-learning, flat"] = other
    if (other := highway(people)) is not None:
        found["highway-env"] = other
    return found


def navground(people: int) -> Stepper | None:
    """The same room in navground-learning."""
    try:
        import navground.learning.env  # noqa: F401  registers its environment
        from navground import sim
        from navground.learning import ControlActionConfig, DefaultObservationConfig
    except ModuleNotFoundError:
        return None
    corners, h = [(-HALF, -HALF), (HALF, -HALF), (HALF, HALF), (-HALF, HALF)], HALF - 0.6
    lines = [list(map(list, pair)) for pair in zip(corners, corners[1:] + corners[:1], strict=True)]
    lines += [
        [[x + 0.4 * a, y + 0.4 * b], [x + 0.4 * c, y + 0.4 * d]]
        for x in (-3.0, 3.0) for y in (-3.0, 3.0)
        for a, b, c, d in ((-1, -1, 1, -1), (1, -1, 1, 1), (1, 1, -1, 1), (-1, 1, -1, -1))
    ]  # fmt: skip
    group = {
        "radius": 0.3, "control_period": 0.1, "behavior": {"type": "ORCA", "optimal_speed": 1.2, "horizon": 5.0},
        "kinematics": {"type": "Omni", "max_speed": 1.5, "max_angular_speed": 2.0},
        "state_estimation": {"type": "Bounded", "range": 5.0},
        "position": {"sampler": "uniform", "from": [-h, -h], "to": [h, h]},
    }  # fmt: skip
    scenario = sim.load_scenario(
        json.dumps({
            "type": "Simple", "walls": [{"line": line} for line in lines],
            "groups": [{**group, "number": 1}, {**group, "number": people}],
        })
    )  # fmt: skip

    def wander(world: Any, seed: int | None = None) -> None:
        rng = np.random.default_rng(seed or 0)
        for agent in world.agents:
            agent.task = sim.tasks.WaypointsTask(rng.uniform(-h, h, (6, 2)).tolist(), loop=True, tolerance=0.4)

    scenario.add_init(wander)
    return single(
        lambda: gymnasium.make(
            "navground", scenario=scenario, agent_index=0, time_step=0.1, max_duration=LENGTH / 10,
            sensor={"type": "Discs", "number": people, "range": 5.0, "max_speed": 1.5, "max_radius": 0.5},
            action=ControlActionConfig(use_acceleration_action=False), terminate_if_idle=False,
            observation=DefaultObservationConfig(
                include_target_direction=True, include_target_distance=True, include_velocity=True, flat=True
            ),
        )
    )  # fmt: skip


def highway(people: int) -> Stepper | None:
    """highway-env with as many other cars."""
    try:
        import highway_env  # noqa: F401
    except ModuleNotFoundError:
        return None
    config = {"vehicles_count": people, "policy_frequency": 10, "simulation_frequency": 10, "duration": LENGTH / 10}
    return single(lambda: gymnasium.make("highway-v0", config=config), act=lambda k: 1)


def steps_per_second(run: Stepper, steps: int) -> tuple[float, float]:
    """Steps per CPU second of this process, and per second of wall time."""
    cpu, wall = time.process_time(), time.perf_counter()
    steps = run(steps) or steps
    return steps / (time.process_time() - cpu), steps / (time.perf_counter() - wall)


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--people", type=int, nargs="+", default=PEOPLE)
    parser.add_argument("--steps", type=int, default=4000)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    logging.disable(logging.WARNING)
    rows: dict[str, dict[int, tuple[float, float]]] = {}
    for people in arguments.people:
        runs = candidates(people)
        for run in runs.values():
            run(2 * LENGTH)  # compiles
        for _ in range(arguments.repeats):
            for name, run in runs.items():
                found = steps_per_second(run, arguments.steps // 8 if name == "highway-env" else arguments.steps)
                best = rows.setdefault(name, {}).get(people, (0.0, 0.0))
                rows[name][people] = max(best[0], found[0]), max(best[1], found[1])
    if arguments.json:
        print(json.dumps(rows))
        return
    print("| steps per CPU second (per second) | " + " | ".join(f"{n} people" for n in arguments.people) + " |")
    print("| --- |" + " ---: |" * len(arguments.people))
    for name, columns in rows.items():
        is_elsewhere = name.startswith("Async")  # the CPU time of others is not known
        cells = (f"({wall:.0f})" if is_elsewhere else f"{cpu:.0f} ({wall:.0f})" for cpu, wall in columns.values())
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
