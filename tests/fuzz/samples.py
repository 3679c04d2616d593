"""Valid files of every kind, made once; cases damage copies of them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from random import Random
from typing import Any

import sonata2d as s2
from sonata2d.collect.journal import Journal
from sonata2d.collect.rating import Rating, append_rating, path_for
from sonata2d.core.labels import LabelSpec
from sonata2d.datasets import generate_dataset, write_card
from sonata2d.datasets.transforms.mirror import mirror_file
from sonata2d.formats.api import export_to
from sonata2d.learning.weights import STOCK
from sonata2d.record.files import compress, sha256_of
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.load import load_scenario
from sonata2d.window.profiles import write_default_controls

from ..formats.layouts import LAYOUTS
from ..formats.test_socnav3 import foreign
from ..scenegen.test_maps import FLAT, TWO_ROOMS, grid, write_dxf, write_ros

SCENARIO: dict[str, Any] = {
    "name": "fuzz",
    "extends": "sonata-2020",
    "context": "a ward",
    "room": {"kinds": ["rectangle", "l"], "breadth": [6, 7], "length": [7, 8], "side": 7, "unit": 3},
    "standing": [0, 2],
    "wandering": 2,
    "talking_pairs": 1,
    "tables": 1,
    "plants": 1,
    "at_laptop": 1,
    "person": {"model": "moussaid2009", "desired_speed": {"mean": 1.2, "sd": 0.2, "min": 0.8, "max": 1.6}},
    "rules": {"time_limit": 2.5, "ends_on": ["time"]},
    "robot": {"kinematics": "unicycle"},
}  # fmt: skip
PLACED: dict[str, Any] = {
    "name": "placed",
    "room": {"polygon": [[-4, -4], [4, -4], [4, 4], [-4, 4]], "walls": [[0, 1, 0, 3]]},
    "robot": {"pose": [-3, 0, 0]},
    "goal": {"position": [3, 0]},
    "people": [
        {"id": 1, "x": 1, "y": 1, "goals": [[-2, 2], [2, 2]], "exits": True},
        {"id": 2, "track": [[0, -1, -1], [1, 0, -1], [2, 1, -1]]},
    ],
    "furniture": [{"type": "plant", "x": 2, "y": -2}],
}
TOML = """\
name = "fuzz"
standing = 2
[rules]
time_limit = 2.0
[room]
kinds = "square"
side = [6, 8]
"""
STUDY = Path(__file__).parents[2] / "examples" / "studies" / "passing.yaml"
SPEC = LabelSpec("classes", "run", "comfort", "How comfortable?", ("poor", "fair", "good"))


def make_samples(folder: Path) -> None:
    """Write a folder for each kind of `targets.KINDS`."""
    rng = Random(1)
    config = s2.ScenarioConfig(**{key: value for key, value in SCENARIO.items() if key != "extends"})
    data = folder / "dataset" / "set"
    generate_dataset(data, config, "social-planner", episodes=3, seed=3, workers=1)
    write_card(data)
    generate_dataset(folder / "dataset" / "other", config, "straight-to-goal", episodes=2, seed=4, workers=1)
    generate_dataset(folder / "shard" / "set", config, "straight-to-goal", episodes=3, seed=4, shard_size=2, workers=1)
    maps = folder / "map"
    maps.mkdir()
    write_ros(maps, grid(*TWO_ROOMS))
    (maps / "flat.svg").write_text(FLAT)
    write_dxf(maps / "office.dxf")
    (folder / "tar").mkdir()
    shutil.copy(folder / "shard" / "set" / "shard-000000.tar", folder / "tar" / "bare.tar")
    rate(data, rng)
    (data / "metrics.json").write_text(json.dumps({"metrics": [], "episodes": {}}))
    first = data / "000000.json"

    episodes = folder / "episode"
    episodes.mkdir()
    (episodes / "plain.json").write_bytes(first.read_bytes())
    for suffix in (".json.gz", ".json.zst"):
        (episodes / f"plain{suffix}").write_bytes(compress(first.read_bytes(), episodes / f"plain{suffix}"))
    mirror_file(first, episodes / "mirrored.json")
    document = json.loads(first.read_bytes())
    recorder = s2.EpisodeRecorder(id="labelled", label_spec=SPEC)
    recorder.label = 2
    s2.Episode(s2.generate(config, seed=5), s2.SocialForce(), observers=[recorder]).run()
    (episodes / "labelled.json").write_bytes(recorder.document())

    for name in ("csv", "npz", "parquet", "socnav3", "sonata"):
        export_to(first, name, folder / name)
    (folder / "csv" / "000000.obstacles.csv").write_text("x1,y1,x2,y2\n-4,-4,4,-4\n4,-4,4,4\n")
    (folder / "csv" / "000000.json").write_text('{"desired_speed": 1.2}')
    (folder / "socnav3" / "foreign.json").write_text(json.dumps(foreign()))
    (folder / "trajnet").mkdir()
    scene = {"scene": {"id": 0, "p": 1, "s": 0, "e": 4, "fps": 2.5}}
    tracks = [{"track": {"f": f, "p": p, "x": 0.1 * f, "y": 1.0 * p}} for f in range(9) for p in (1, 2)]
    (folder / "trajnet" / "0.ndjson").write_text("\n".join(json.dumps(line) for line in (scene, *tracks)))

    (folder / "tracks").mkdir()
    for layout in LAYOUTS:
        layout.write(folder / "tracks" / layout.name)

    (folder / "scenario").mkdir()
    for name, settings in (("drawn", SCENARIO), ("placed", PLACED)):
        (folder / "scenario" / f"{name}.json").write_text(json.dumps(settings))
        lines = [f"{key}: {json.dumps(value)}" for key, value in settings.items()]
        (folder / "scenario" / f"{name}.yaml").write_text("\n".join(lines) + "\n")
        load_scenario(str(folder / "scenario" / f"{name}.yaml"))
    (folder / "scenario" / "flat.toml").write_text(TOML)

    (folder / "weights").mkdir()
    (folder / "weights" / "policy.npz").write_bytes(STOCK.read_bytes())

    (folder / "study").mkdir()
    shutil.copy(STUDY, folder / "study" / "passing.yaml")
    (folder / "message").mkdir()
    for number, message in enumerate(MESSAGES):
        (folder / "message" / f"{number}.json").write_text(json.dumps(message))

    (folder / "collected").mkdir()
    journal = Journal(folder / "collected" / "journal.jsonl")
    header = {key: document[key] for key in ("settings", "seed", "episode", "physics", "controller", "contributor")}
    journal.begin(header)
    for frame in read_episode(first).frames():
        journal.on_frame(frame)
    journal.shut()
    write_default_controls(folder / "collected" / "controls.toml")


MESSAGES: list[dict[str, Any]] = [
    {"type": "hello", "protocol": 2, "languages": ["de", "en-GB"]},
    {"type": "language", "language": "de"},
    {"type": "undo"},
    {"type": "answer", "step": "1", "values": {"age": 30, "felt": {"easy": 3}}},
    {
        "type": "tick", "run": 1, "number": 4, "round_trip": 0.02, "dropped": 1,
        "events": [{"device": "keyboard", "control": "w", "value": 1.0}],
    },
    {"type": "keep", "run": 2, "label": 0.5},
    {"type": "rate", "shown": 1, "label": "good", "seconds": 3.5, "whole": True},
    {"type": "look", "participant": "p01", "scene": "a"},
]  # fmt: skip


def rate(data: Path, rng: Random) -> None:
    """Rate the episodes of a data set."""
    for rater in ("ann", "bob"):
        for path in sorted(data.glob("00*.json")):
            for showing in (1, 2):
                rating = Rating(
                    rater, path.name, path.stem, sha256_of(path), rng.randint(1, 3), showing,
                    "2026-01-01T00:00:00Z", 3.0, True, SPEC,
                )  # fmt: skip
                append_rating(path_for(data, rater), rating)
