"""Digests of generated scenes and of episodes, and counts of runs: a change of what a seed means is seen here.

`python -m tests.test_pinned_bytes` writes them anew; CONTRIBUTING.md says when that is allowed.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import orjson
import pytest

from sonata2d.agents.controllers.planner import SocialPlanner
from sonata2d.agents.controllers.reactive import Orca, StraightToGoal
from sonata2d.record.layout import scene_to_json
from sonata2d.record.recorder import EpisodeRecorder
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.load import load_scenario, scenario_names
from sonata2d.sim.episode import Episode
from sonata2d.version import PHYSICS_VERSION

DIGESTS = Path(__file__).with_name("pinned_bytes.json")

SCENES = [(name, 1) for name in scenario_names()] + [
    ("sonata-2020", 2), ("sonata-2020", 3), ("sonata-2020-crowded", 2), ("lively", 2), ("waiting-room", 2),
]  # fmt: skip

EPISODES: dict[str, tuple[str, dict[str, Any]]] = {  # changes of a preset
    "sonata2026": ("sonata-2020-crowded", {}),
    "moussaid2009": ("sonata-2020", {"person": {"model": "moussaid2009"}}),
    "helbing1995": ("sonata-2020", {"person": {"model": "helbing1995"}}),
    "helbing2000": ("sonata-2020", {"person": {"model": "helbing2000"}}),
    "farina2017": ("sonata-2020", {"person": {"model": "farina2017"}}),
    "orca2011": ("lively", {"person": {"model": "orca2011"}}),
    "doors, queues, unicycle": ("waiting-room", {"robot": {"kinematics": "unicycle"}}),
    "groups": ("crowded-hall", {}),
}


def scene_digest(name: str, seed: int) -> str:
    """SHA-256 of a generated scene as a file holds it, without its settings, which may get new keys."""
    document = scene_to_json(generate(name, seed))
    del document["settings"]
    return hashlib.sha256(orjson.dumps(document)).hexdigest()


def episode_digest(name: str) -> str:
    """SHA-256 of the frames of an episode of 10 s or less with the controller `social-planner`."""
    preset, changes = EPISODES[name]
    values = load_scenario(preset).settings()
    for section, keys in [*changes.items(), ("rules", {"time_limit": 10.0})]:
        values[section] = values[section] | keys
    recorder = EpisodeRecorder()
    Episode(generate(ScenarioConfig.model_validate(values), 1), SocialPlanner(), observers=[recorder]).run()
    return hashlib.sha256(orjson.dumps(orjson.loads(recorder.document())["frames"])).hexdigest()


COUNTED = {"contacts": ("lively", 20, StraightToGoal), "commands_beyond_limits": ("waiting-room", 2, Orca)}


def counts() -> dict[str, Any]:
    """Counts of runs in their manifest rows."""
    found = {}
    for key, (name, seed, controller) in COUNTED.items():
        recorder = EpisodeRecorder()
        Episode(generate(name, seed), controller(), observers=[recorder]).run()
        found[key] = recorder.record().counts()[key]
    return found


def digests() -> dict[str, Any]:
    """All digests, as the file holds them."""
    return {
        "physics": PHYSICS_VERSION,
        "scenes": {f"{name}, seed {seed}": scene_digest(name, seed) for name, seed in SCENES},
        "episodes": {name: episode_digest(name) for name in EPISODES},
        "counts": counts(),
    }


def pinned() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(DIGESTS.read_text())
    return found


def test_digests_are_those_of_this_physics_version_and_of_all_presets() -> None:
    assert pinned()["physics"] == PHYSICS_VERSION
    assert {name for name, _ in SCENES} == set(scenario_names())


@pytest.mark.parametrize(("name", "seed"), SCENES)
def test_a_seed_gives_the_pinned_scene(name: str, seed: int) -> None:
    assert scene_digest(name, seed) == pinned()["scenes"][f"{name}, seed {seed}"]


@pytest.mark.parametrize("name", EPISODES)
def test_an_episode_has_the_pinned_frames(name: str) -> None:
    assert episode_digest(name) == pinned()["episodes"][name]


def test_a_manifest_row_has_the_pinned_counts() -> None:
    """`check` compares them with those of data sets that were made before."""
    found = counts()
    assert found == pinned()["counts"]
    assert [set(found[key]) for key in COUNTED] == [{"any", "human", "object"}, {"vx", "vy", "omega"}]


if __name__ == "__main__":
    DIGESTS.write_text(json.dumps(digests(), indent=1) + "\n")
