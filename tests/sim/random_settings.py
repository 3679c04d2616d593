"""Random settings: `python -m tests.sim.random_settings --seconds 600 --seed 1`.

Draws limits of the robot, ticks, physics steps, numbers and speeds of people and pedestrian models, far beyond what is
usual, and a reckless controller. Settings are refused with one line, or the episode passes its own check. Prints each
episode that does not, with the case that repeats it (`--case`); the exit code is then 1.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import click

import sonata2d as s2
from sonata2d.datasets import verify
from sonata2d.errors import ConfigError, SceneError

PRESETS = (
    "lively", "crowded-hall", "sonata-2020-crowded", "crossing-flows", "narrow-doorway", "waiting-room", "intersection",
    "overtaking", "sonata-2020", "blind-corner", "crossing-a-group", "joining-a-group",
)  # fmt: skip
MODELS = ("moussaid2009", "helbing1995", "helbing2000", "farina2017")


class Reckless(s2.Controller):
    """Drives at full speed: at the nearest person, away from it and back, round in circles, or at random."""

    def __init__(self, seed: int) -> None:
        self._random = Random(seed)
        self._style = self._random.choice(["straight", "reversing", "spinning", "random"])

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        limits, pose = snapshot.scene.robot.limits, snapshot.robot.pose
        if self._style == "random":
            between = self._random.uniform
            return s2.Twist(
                between(-limits.back, limits.ahead), between(-limits.sideways, limits.sideways),
                between(-limits.turn, limits.turn),
            )  # fmt: skip
        places = [pose.to_local(human.pose.position) for human in snapshot.humans]
        x, y = min(places, key=lambda place: math.hypot(*place), default=(1.0, 0.0))
        distance = math.hypot(x, y)
        scale = -1.0 if self._style == "reversing" and snapshot.tick % 8 >= 4 else 1.0
        turn = limits.turn if self._style == "spinning" else max(-limits.turn, min(limits.turn, 4 * math.atan2(y, x)))
        ahead = limits.ahead if x * scale > 0.0 else limits.back
        return s2.Twist(ahead * x * scale / distance, limits.sideways * y * scale / distance, turn)


def draw(case: int) -> tuple[str, dict[str, Any]]:
    """The preset of a case, and what is changed in it."""
    random = Random(case)

    def log_uniform(low: float, high: float) -> float:
        return math.exp(random.uniform(math.log(low), math.log(high)))

    limits = {key: log_uniform(0.1, 20.0) for key in ("ahead", "back", "sideways", "turn")}
    limits |= {key: log_uniform(0.1, 1000.0) for key in ("acceleration", "turn_acceleration")}
    kinematics = random.choice(["unicycle", "holonomic"])
    changes: dict[str, Any] = {
        "robot": {"limits": limits, "kinematics": kinematics, "radius": random.uniform(0.15, 0.5)},
        "rules": {
            "dt": random.choice([0.02, 0.04, 0.05, 0.1, 0.1, 0.2, 0.5]),
            "substeps": random.choice([1, 2, 5, 10, 10, 20]),
            "iterations": random.choice([1, 5, 5, 10, 20]),
            "time_limit": 6.0,
            "guard": random.random() < 0.6,
            "ends_on": ["time"],
        },
        "person": {},
    }
    if random.random() < 0.5:
        mean = random.uniform(0.5, 4.0)
        speed = {"mean": mean, "sd": 0.1 * mean, "min": 0.8 * mean, "max": 1.2 * mean}
        model = random.choice(MODELS) if random.random() < 0.15 else "sonata2026"
        changes["person"] |= {"desired_speed": speed, "model": model}
    if random.random() < 0.3:
        reaction = random.choice(["avoids", "stops", "curious", "scared"])
        changes["person"] |= {"reactions": {reaction: 1.0}, "ignores_robot": random.random()}
    if random.random() < 0.6:
        changes |= {"wandering": random.randint(0, 14), "walking_groups": random.randint(0, 2)}
    return random.choice(PRESETS), changes


def run(case: int, folder: Path) -> tuple[str, str]:
    """Run a case: "passed", "failed" or "refused", and why."""
    preset, changes = draw(case)
    try:
        scene = s2.generate(s2.load_scenario(preset).changed(**changes), seed=case)
    except (ConfigError, SceneError) as error:
        return "refused", str(error)
    path = folder / "episode.json"
    with s2.JsonRecorder(path) as recorder:
        s2.Episode(scene, Reckless(case), observers=[recorder]).run()
    problems = verify(path)
    return ("failed" if problems else "passed"), "; ".join(map(str, problems))


@click.command()
@click.option("--seconds", type=float, default=600.0, show_default=True, help="Time after which no case is begun.")
@click.option(
    "--seed", type=int, default=0, show_default=True, help="Runs with different seeds have no case in common."
)
@click.option("--case", type=int, help="Only this case.")
def main(seconds: float, seed: int, case: int | None) -> None:
    """Check the episodes of random settings."""
    counts: Counter[str] = Counter()
    end, number = time.monotonic() + seconds, seed * 1_000_000 if case is None else case
    with TemporaryDirectory() as folder:
        while time.monotonic() < end:
            status, why = run(number, Path(folder))
            counts[status] += 1
            if status == "failed" or case is not None:
                click.echo(f"case {number} {status}: {why}\n  {draw(number)}")
            if case is not None:
                break
            number += 1
    click.echo(", ".join(f"{count} {status}" for status, count in counts.items()))
    raise SystemExit(counts["failed"] > 0)


if __name__ == "__main__":
    main()
