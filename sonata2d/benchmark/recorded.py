"""Scenes among recorded people, from local copies of recordings that may not be distributed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..agents.controllers.base import Answer, Controller
from ..core.floats import FloatFields
from ..core.geometry import Twist, canonical_angle
from ..core.rng import RandomStream
from ..core.snapshot import Snapshot
from ..errors import BenchmarkError, ConfigError, SceneError
from ..formats.format import Options
from ..formats.from_tracks import scenario_from_tracks
from ..formats.tracks.observations import Track, Tracks
from ..formats.tracks.reading import read_tracks
from ..record.files import sha256_of
from ..scenegen.scenario.config import ScenarioConfig

_CATCHING_UP = 1.0  # 1/s, of the distance from the person's place: a robot starts from rest
_ATTEMPTS = 100
_LEAST_WAY, _LEAST_TIME = 4.0, 4.0  # m and s, of the person whose place the robot takes


@dataclass(frozen=True, slots=True)
class Recording(FloatFields):
    """A recording, in which the robot takes the place of a person who is drawn for each scene.

    Attributes:
        path: of the local copy; None: no folder of recordings was given.
        people: whether the others are replayed, and give way to nobody, or simulated.
        seconds: length of the time windows, which begin when the person appears, s.
    """

    path: Path | None
    people: Literal["replayed", "simulated"]
    seconds: float

    def scenario(self, seed: int, episode: int) -> tuple[ScenarioConfig, Track]:
        """The scenario of a scene, and the track of the person whose place the robot takes.

        Raises:
            BenchmarkError: there is no local copy, or no person in it can be replaced.
        """
        if self.path is None:
            raise BenchmarkError("the suite needs a folder with recordings: --recordings DIR, or recordings=...")
        candidates = [track for track in _tracks(self.path).people if _walks(track)]
        rng = RandomStream(seed, episode, "scene", f"{self.path.parent.name}/{self.path.name}/{self.people}")
        for _ in range(_ATTEMPTS if candidates else 0):
            track = candidates[min(int(rng.uniform() * len(candidates)), len(candidates) - 1)]
            try:
                config = _scenario(self.path, self.people, self.seconds, track.id, float(track.time[0]))
            except (ConfigError, SceneError):  # the place is taken, or there is no way
                continue
            return config, track
        raise BenchmarkError(f"no person of {self.path} walks {_LEAST_WAY:g} m with a free place at the start")


@lru_cache(maxsize=8)
def _tracks(path: Path) -> Tracks:
    return read_tracks(path, Options())[0]


@lru_cache(maxsize=256)
def _scenario(path: Path, people: Any, seconds: float, person: int, start: float) -> ScenarioConfig:
    return scenario_from_tracks(path, people=people, start=start, seconds=seconds, robot_as=person)


def _walks(track: Track) -> bool:
    """Whether a person walks so far that a robot in its place has a way to go."""
    way = math.dist(track.position[0].tolist(), track.position[-1].tolist())
    return way >= _LEAST_WAY and float(track.time[-1] - track.time[0]) >= _LEAST_TIME


def checked_copy(folder: Path, file: str, sha256: str, source: str) -> Path:
    """The path of a local copy of a recording.

    Args:
        folder: of recordings.
        file: its name in the folder.
        sha256: of the file.
        source: where to get it.

    Raises:
        BenchmarkError: it is missing, or another file.
    """
    path = folder / file
    if not path.is_file():
        raise BenchmarkError(f"{path} is missing; get it from {source}")
    if sha256_of(path) != sha256:
        raise BenchmarkError(f"{path} is another file than the one of the suite; get it from {source}")
    return path


class RecordedPerson(Controller):
    """Drives the robot where the recorded person walked, whose place it takes.

    Args:
        track: of the person.
    """

    def __init__(self, track: Track) -> None:
        self._time, self._position = track.time - track.time[0], track.position

    def act(self, snapshot: Snapshot) -> Answer:
        robot, dt = snapshot.robot, snapshot.dt
        (x, y), (next_x, next_y) = self._at(snapshot.time), self._at(snapshot.time + dt)
        dx = (next_x - x) / dt + _CATCHING_UP * (x - robot.position[0])
        dy = (next_y - y) / dt + _CATCHING_UP * (y - robot.position[1])
        c, s = robot.direction
        turn = canonical_angle(math.atan2(dy, dx) - robot.pose.theta) if math.hypot(dx, dy) > 0.1 else 0.0
        return Twist(dx * c + dy * s, dy * c - dx * s, turn)

    def _at(self, time: float) -> tuple[float, float]:
        x, y = (float(np.interp(time, self._time, column)) for column in self._position.T)
        return x, y
