"""Episodes with all kinds of room and relation."""

from __future__ import annotations

from pathlib import Path

import pytest

import sonata2d as s2
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.record.recorder import JsonRecorder

KINDS = ("square", "rectangle", "l")


def config(k: int) -> s2.ScenarioConfig:
    """Return the k-th scenario.

    No wall is a multiple of 4 m long: for such a wall the last bit decides how many nodes the readers make of it.
    """
    room = {"kinds": [KINDS[k % 3]], "side": 7, "breadth": [5, 6], "length": [6, 7], "unit": 3}
    return s2.ScenarioConfig(
        name="formats",
        context="a robot among people" if k % 2 else None,
        room=room,
        standing=[0, 2],
        wandering=[0, 2],
        tables=1,
        plants=[0, 1],
        talking_pairs=k % 2,
        walking_pairs=(k + 1) % 2,
        at_laptop=1,
        at_plant=int(k % 3 == 0),
        at_object=int(k % 4 == 1),
        relations=[0, 2],
        furniture_yaw=(-3.0, 3.0),
        rules={"time_limit": 2.5 + 0.1 * (k % 7), "ends_on": ["time"]},
        robot={"kinematics": "holonomic" if k % 2 else "unicycle"},
        drop=True,
    )


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of twenty episode files."""
    out = tmp_path_factory.mktemp("episodes")
    for k in range(20):
        with JsonRecorder(out / f"{k:06d}.json") as recorder:
            s2.Episode(s2.generate(config(k), 11, k), s2.SocialForce(), observers=[recorder]).run()
    return out


@pytest.fixture(scope="session")
def records(folder: Path) -> list[EpisodeRecord]:
    """The records of the twenty episodes."""
    return [read_episode(path) for path in sorted(folder.iterdir())]
