"""Suites: frozen scenes, seeds, tracks and limits, from a file of the package."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import orjson

from ..core.arguments import whole_number
from ..core.scene import Scene
from ..core.wording import shown
from ..errors import BenchmarkError, SceneError
from ..metrics.definition import DEFINITIONS_VERSION
from ..metrics.scene_difficulty import difficulty
from ..record.layout import scene_to_json
from ..registry import did_you_mean
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..version import PHYSICS_VERSION
from .recorded import Recording, checked_copy
from .shown import Sensing

SUITES = Path(__file__).with_name("suites")
Track = Literal["state", "sees", "lidar"]
TRACKS: dict[Track, str] = {
    "state": "the poses and velocities of all people, exact",
    "sees": "people in a field of view of 120 degrees and 10 m, hidden by walls and other people, with noise",
    "lidar": "180 ranges all around, up to 8 m, with noise of 1 cm, and odometry",
}
SEES = Sensing(angle=2.0944, distance=10.0, noise=0.05, velocity_noise=0.1)


def require_track(track: object) -> None:
    """Require the name of a track.

    Raises:
        BenchmarkError: it is none.
    """
    if track not in TRACKS:
        raise BenchmarkError(f"there is no track {shown(track)}; tracks are {', '.join(TRACKS)}")


_FIXED, _FACTOR, _LEAST = 5.0, 2.5, 15.0  # s; times the predicted time of the expert; s
_SECRET_BYTES = 32


@dataclass(frozen=True, slots=True)
class Entry:
    """Scenes of one scenario in a suite.

    Attributes:
        part: name of the part of the suite.
        name: of the entry, unique in the suite.
        config: the scenario, whose guard is off; with a recording, settings that replace the settings of its scenarios.
        scenes: number of scenes; scene k is episode k of the scenario.
        sensing: what the track `state` gets in these scenes; None: everything, exact.
        situation: that the scenes are to show, see `sonata2d.metrics.situations.SITUATIONS`; None: none.
        recording: from which the scenario of each scene is made; None: all have the same.
    """

    part: str
    name: str
    config: ScenarioConfig
    scenes: int
    sensing: Sensing | None = None
    situation: str | None = None
    recording: Recording | None = None

    def scene(self, seed: int, episode: int) -> Scene:
        """A scene, with its time limit: 5 s and 2.5 times the predicted time of the expert, at least 15 s.

        A scene whose difficulty is not defined, since its goal moves or no path leads to it, has the limit of its
        scenario.
        """
        config = self.config
        if self.recording is not None:
            config, _ = self.recording.scenario(seed, episode)
            limits, rules = self.config.robot.limits, self.config.rules
            config = config.changed(robot={"limits": limits}, rules={"guard": rules.guard})
        scene = generate(config, seed, episode)
        value = difficulty_of(scene)
        if value is None:
            return scene
        limit = round(max(_FIXED + _FACTOR * value, _LEAST), 1)
        return replace(scene, rules=replace(scene.rules, time_limit=limit))


def difficulty_of(scene: Scene) -> float | None:
    """Predicted time of the expert, s; None where it is not defined."""
    try:
        value = difficulty(scene).value
    except SceneError:  # the goal moves
        return None
    return None if value == float("inf") else round(float(value), 3)


def scene_sha256(scene: Scene) -> str:
    """Hash of all that is fixed before the first tick, including the seed of people's choices."""
    layout = scene_to_json(scene) | {"settings": None, "seed": scene.seed, "episode": scene.episode}
    return hashlib.sha256(orjson.dumps(layout, option=orjson.OPT_SORT_KEYS)).hexdigest()


def joint_sha256(hashes: Sequence[str]) -> str:
    """Hash of hashes, in their order."""
    return hashlib.sha256("".join(hashes).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Suite:
    """A benchmark suite.

    Attributes:
        name: with its version, such as `s2b-1`.
        sha256: of its file.
        physics, metrics: versions with which rows are made.
        ends: date after which no rows are taken.
        test_seed: of the scenes for papers.
        questions: the question of each part.
        thirds: of each part, the two difficulties that separate its thirds, s.
        scenes_sha256: of each entry, the hash of all its scenes with the test seed.
        entries: scenarios with their numbers of scenes.

    >>> load_suite("s2b-1").count
    2800
    """

    name: str
    sha256: str
    physics: int
    metrics: int
    ends: str
    test_seed: int
    questions: Mapping[str, str]
    thirds: Mapping[str, tuple[float, float]]
    scenes_sha256: Mapping[str, str]
    entries: tuple[Entry, ...]

    @property
    def count(self) -> int:
        """Number of scenes."""
        return sum(entry.scenes for entry in self.entries)

    def entry(self, name: str) -> Entry:
        """The entry of a name.

        Raises:
            BenchmarkError: there is none.
        """
        for entry in self.entries:
            if entry.name == name:
                return entry
        hint = did_you_mean(name, [entry.name for entry in self.entries])
        raise BenchmarkError(f"{self.name} has no entry {name!r}{hint}")

    def chosen(self, parts: Sequence[str] = (), scenes: int | None = None) -> Suite:
        """The suite without the other parts, and with fewer scenes of each entry; for trials, not for rows.

        Args:
            parts: names of parts or entries; empty: all.
            scenes: largest number of scenes of each entry; None: all.

        Raises:
            BenchmarkError: a name is unknown.
        """
        known = {*self.questions, *(entry.name for entry in self.entries)}
        for part in parts:
            if part not in known:
                hint = did_you_mean(part, known) or f"; parts are {', '.join(self.questions)}"
                raise BenchmarkError(f"{self.name} has no part or entry {part!r}{hint}")
        kept = [each for each in self.entries if not parts or {each.part, each.name} & set(parts)]
        if scenes is not None:
            kept = [replace(each, scenes=min(each.scenes, scenes)) for each in kept]
        return replace(self, entries=tuple(kept))

    def require_versions(self) -> None:
        """Require the physics and the metrics of the suite.

        Raises:
            BenchmarkError: this sonata2d has others.
        """
        for name, wanted, present in (
            ("physics", self.physics, PHYSICS_VERSION),
            ("definitions of metrics", self.metrics, DEFINITIONS_VERSION),
        ):
            if wanted != present:
                raise BenchmarkError(
                    f"{self.name} has version {wanted} of the {name}, and this sonata2d has version {present}; "
                    "install the release of sonata2d that the suite's page names"
                )

    def seed_of(self, seeds: str, secret: bytes | None = None, seed: int = 1) -> int:
        """The seed of the scenes.

        Args:
            seeds: `dev`, `test`, `hidden`, or the name of a quarter that has been revealed, such as `2026q3`.
            secret: of the quarter; of `hidden` only.
            seed: of `dev`, 1 or more.

        Raises:
            BenchmarkError: the seeds are unknown, the secret is missing, or the quarter is not revealed.
            ValueError: the seed of `dev` is the test seed, or below 1.
        """
        if seeds == "dev":
            if whole_number("seed", seed, 1) == self.test_seed:
                raise ValueError(f"{seed} is the test seed of {self.name}; choose another seed for dev")
            return seed
        if seeds == "test":
            return self.test_seed
        if seeds == "hidden":
            if secret is None:
                raise BenchmarkError("hidden seeds need the secret of the quarter, which its keeper has")
            return self.hidden_seed(secret)
        quarters = quarters_of(self.name)
        if seeds not in quarters:
            known = ["dev", "test", "hidden", *quarters]
            hint = did_you_mean(seeds, known)
            raise BenchmarkError(f"{self.name} has no seeds {seeds!r}; seeds are {', '.join(known)}{hint}")
        revealed = quarters[seeds].get("secret")
        if revealed is None:
            raise BenchmarkError(f"the secret of {seeds} is not revealed yet; the keeper runs hidden seeds")
        return self.hidden_seed(bytes.fromhex(revealed))

    def hidden_seed(self, secret: bytes) -> int:
        """The seed that belongs to a secret: the first 63 bits of HMAC-SHA256 of the suite's name and hash."""
        digest = hmac.new(secret, f"{self.name} {self.sha256}".encode(), hashlib.sha256).digest()
        return int.from_bytes(digest[:8], "big") >> 1

    def scenes(self, seed: int) -> Iterator[tuple[Entry, int, Scene]]:
        """Entry, number and scene of all scenes."""
        for entry in self.entries:
            for episode in range(entry.scenes):
                yield entry, episode, entry.scene(seed, episode)


def suite_names() -> list[str]:
    """Names of the suites of this package."""
    return sorted(path.stem for path in SUITES.glob("*.json") if not path.stem.endswith("-quarters"))


@cache
def load_suite(name: str = "s2b-1", recordings: str | Path | None = None) -> Suite:
    """Load a suite of this package.

    Args:
        name: of the suite.
        recordings: folder with the recordings that a suite needs; None: its scenes cannot be made.

    Raises:
        BenchmarkError: there is no such suite, or a recording is missing or another file.
    """
    if name not in suite_names():
        hint = did_you_mean(name, suite_names()) or f"; suites are {', '.join(suite_names())}"
        raise BenchmarkError(f"there is no suite {name!r}{hint}")
    content = (SUITES / f"{name}.json").read_bytes()
    document = orjson.loads(content)
    copies: dict[str, Path] = {}
    if recordings is not None:
        folder, files = Path(recordings).absolute(), document.get("recordings", {})
        copies = {name: checked_copy(folder, **each) for name, each in files.items()}
    entries = tuple(
        Entry(
            part=entry["part"],
            name=entry["name"],
            config=ScenarioConfig(**merged(document["defaults"], entry["settings"])),
            scenes=entry["scenes"],
            sensing=Sensing(**entry["sensing"]) if entry.get("sensing") else None,
            situation=entry.get("situation"),
            recording=_recording(entry.get("recording"), copies),
        )
        for entry in document["entries"]
    )
    return Suite(
        name=name,
        sha256=hashlib.sha256(content).hexdigest(),
        physics=document["physics"],
        metrics=document["metrics"],
        ends=document["ends"],
        test_seed=document["test_seed"],
        questions=document["questions"],
        thirds={part: (low, high) for part, (low, high) in document["thirds"].items()},
        scenes_sha256={entry["name"]: entry["scenes_sha256"] for entry in document["entries"]},
        entries=entries,
    )


def _recording(row: Mapping[str, Any] | None, copies: Mapping[str, Path]) -> Recording | None:
    return None if row is None else Recording(copies.get(row["name"]), row["people"], row["seconds"])


def merged(defaults: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Settings with changes; sections are merged, except mappings that are marked by `=`, which are replaced.

    >>> merged({"a": {"b": 1, "c": 2}}, {"a": {"b": 3}})
    {'a': {'b': 3, 'c': 2}}
    """
    result = dict(defaults)
    for key, value in changes.items():
        if key.endswith("="):
            result[key[:-1]] = value
        elif isinstance(value, Mapping) and isinstance(result.get(key), Mapping):
            result[key] = merged(result[key], value)
        else:
            result[key] = value
    return result


def quarters_of(suite: str) -> dict[str, dict[str, str | None]]:
    """Commitments, and secrets that have been revealed, by the name of the quarter."""
    path = SUITES / f"{suite}-quarters.json"
    quarters: dict[str, dict[str, str | None]] = orjson.loads(path.read_bytes()) if path.exists() else {}
    return quarters


def new_secret() -> bytes:
    """A secret for a quarter."""
    return secrets.token_bytes(_SECRET_BYTES)


def commitment(secret: bytes) -> str:
    """The commitment to a secret, SHA-256 in hexadecimal digits: published before the quarter."""
    return hashlib.sha256(secret).hexdigest()


def read_secret(text: str) -> bytes:
    """A secret from its hexadecimal digits.

    Raises:
        BenchmarkError: the text is no such secret.
    """
    try:
        secret = bytes.fromhex(text.strip())
    except ValueError:
        secret = b""
    if len(secret) != _SECRET_BYTES:
        raise BenchmarkError(f"a secret has {2 * _SECRET_BYTES} hexadecimal digits, got {shown(text.strip(), 20)}")
    return secret
