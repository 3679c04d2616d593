"""Short episodes whose bytes tests compare: python -m tests.sim.episodes prints a digest for each."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import orjson

import sonata2d as s2
from sonata2d.record.recorder import EpisodeRecorder

MODELS = ("sonata2026", "moussaid2009", "helbing1995", "helbing2000", "farina2017", "orca2011")
PRESETS = ("sonata-2020-crowded", "lively", "crossing-a-group", "narrow-doorway")
CONTROLLERS = (s2.StraightToGoal, s2.SocialForce, s2.Orca, s2.SocialPlanner, s2.HumanLike)


def recorded(preset: str, seed: int, controller: s2.Controller, seconds: float, model: str = "sonata2026") -> str:
    """Run an episode; a digest of its document, but for the versions of the software."""
    config = s2.load_scenario(preset)
    config = config.model_copy(
        update={
            "person": config.person.model_copy(update={"model": model}),
            "rules": replace(config.rules, time_limit=seconds),
        }
    )
    recorder = EpisodeRecorder()
    s2.Episode(s2.generate(config, seed=seed), controller, observers=[recorder]).run()
    document = orjson.loads(recorder.document())
    del document["software"]
    return hashlib.sha256(orjson.dumps(document)).hexdigest()[:16]


def fleet_digest() -> str:
    """A digest of the states of an episode with four robots of different bodies and drives among people."""
    carts = {"kinematics": "differential", "body": {"shape": "rectangle", "length": 0.9, "width": 0.6}}
    config = s2.load_scenario("sonata-2020-crowded").changed(robots=[carts, {"kinematics": "unicycle", "count": 2}])
    scene, digest = s2.generate(config, seed=5), hashlib.sha256()
    episode = s2.Episode(scene, s2.StraightToGoal(), others=[s2.StraightToGoal() for _ in scene.robots])
    for _ in range(15):
        digest.update(episode.observe().state.row.tobytes())
        episode.step()
    return digest.hexdigest()[:16]


def digests() -> list[str]:
    """The digests of all episodes."""
    return [
        *(recorded("sonata-2020", 2, s2.StraightToGoal(), 1.0, model) for model in MODELS),
        *(recorded(preset, 1, s2.StraightToGoal(), 1.5) for preset in PRESETS),
        *(recorded("sonata-2020", 3, controller(), 0.5) for controller in CONTROLLERS),
        fleet_digest(),
    ]


if __name__ == "__main__":
    print(*digests())  # noqa: T201
