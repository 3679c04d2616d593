"""Writes the suite s2b-1. It was run once: the suite is frozen, and its file is what counts.

python benchmarks/make_suite.py OUT.json
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import orjson

import sonata2d as s2
from sonata2d.benchmark.recorded import Recording
from sonata2d.benchmark.suite import Entry, Sensing, difficulty_of, joint_sha256, merged, scene_sha256
from sonata2d.metrics.definition import DEFINITIONS_VERSION
from sonata2d.metrics.situations import SITUATIONS
from sonata2d.version import PHYSICS_VERSION

TEST_SEED = 271828
EXAMPLES = Path(__file__).parents[1] / "examples" / "scenarios"
QUESTIONS = {
    "encounters": "does the robot show manners in the 26 situations of Francis et al.?",
    "rooms": "does it do the task of the SONATA papers, in rooms with people, furniture and interactions?",
    "lively": "does it cope with people who react, are curious, stop, sit down and talk?",
    "unyielding": "does it give way to people who never give way to a robot?",
    "shift": "does it depend on our pedestrians, on exact perception or on a round holonomic robot?",
    "maps": "does it find its way in floor plans with several rooms?",
}
ENCOUNTERS, SHIFT = 40, 80
UNICYCLE = {"robot": {"kinematics": "unicycle", "body": {"shape": "rectangle", "length": 0.9, "width": 0.6}}}
SHIFTS: dict[str, tuple[dict[str, Any], Sensing | None]] = {
    "orca-people": ({"person": {"model": "orca2011"}}, None),
    "fast-people": (
        {"person": {"desired_speed": {"mean": 1.69, "sd": 0.26, "min": 1.04, "max": 2.34}}, "wandering": [3, 8]},
        None,
    ),
    "tracking-noise": ({}, Sensing(occlusion=False, noise=0.1, velocity_noise=0.2)),
    "narrow-view": ({}, Sensing(angle=2.0944, distance=10.0)),
    "unicycle": (UNICYCLE, None),
}


RECORDED_QUESTIONS = {
    "replayed": "does the robot find its way among recorded people, who do not give way to it?",
    "simulated": "does it do as well where the same people are simulated from their recorded start to their goal?",
}
RECORDINGS = {
    "hotel": ("ETH/seq_hotel/obsmat.txt", "OpenTraj, datasets/ETH/seq_hotel (Pellegrini et al., ICCV 2009)"),
    "zara02": (
        "UCY/zara02/obsmat.txt",
        "OpenTraj, datasets/UCY/zara02 (Lerner et al., CGF 26, 2007)",
    ),
}
WINDOW, RECORDED = 40.0, 50  # s, and scenes of an entry


def main(out: Path, recordings: Path | None) -> None:
    """Write a suite."""
    defaults = _without_guard(s2.ScenarioConfig()).settings()
    rows, thirds = _rows(_all() if recordings is None else _recorded(recordings), defaults)
    copies = {
        name: {"file": file, "sha256": hashlib.sha256((recordings / file).read_bytes()).hexdigest(), "source": source}
        for name, (file, source) in (RECORDINGS.items() if recordings is not None else ())
    }
    document = {
        "suite": out.stem,
        "physics": PHYSICS_VERSION,
        "metrics": DEFINITIONS_VERSION,
        "ends": "2028-12-31",
        "test_seed": TEST_SEED,
        "questions": QUESTIONS if recordings is None else RECORDED_QUESTIONS,
        "thirds": thirds,
        **({"recordings": copies} if copies else {}),
        "defaults": defaults,
        "entries": rows,
    }
    out.write_bytes(orjson.dumps(document, option=orjson.OPT_INDENT_2) + b"\n")


def _rows(entries: list[Entry], defaults: dict[str, Any]) -> tuple[list[dict[str, Any]], dict[str, list[float]]]:
    """The entries as files hold them, and the thirds of difficulty of each part."""
    difficulties: dict[str, list[float]] = {entry.part: [] for entry in entries}
    rows = []
    for entry in entries:
        hashes = []
        for episode in range(entry.scenes):
            scene = entry.scene(TEST_SEED, episode)
            hashes.append(scene_sha256(scene))
            if (value := difficulty_of(scene)) is not None:
                difficulties[entry.part].append(value)
        row: dict[str, Any] = {"part": entry.part, "name": entry.name, "scenes": entry.scenes}
        row["scenes_sha256"] = joint_sha256(hashes)
        if entry.sensing is not None:
            row["sensing"] = {key: getattr(entry.sensing, key) for key in Sensing.__dataclass_fields__}
        if entry.situation is not None:
            row["situation"] = entry.situation
        if (source := entry.recording) is not None:
            row["recording"] = {
                "name": entry.name.split("-")[0], "people": source.people, "seconds": source.seconds
            }  # fmt: skip
        settings = entry.config.settings()
        row["settings"] = changes(defaults, settings)
        again = merged(defaults, row["settings"])
        assert all(orjson.dumps(again[key]) == orjson.dumps(value) for key, value in settings.items()), entry.name
        rows.append(row)
        print(entry.name, entry.scenes)
    thirds = {
        part: [round(float(np.quantile(values, q)), 1) for q in (1 / 3, 2 / 3)] for part, values in difficulties.items()
    }
    return rows, thirds


def _recorded(folder: Path) -> list[Entry]:
    """The entries of the suite of recordings: a robot as fast as people."""
    limits = {"ahead": 2.0, "sideways": 1.0, "acceleration": 2.5}
    config = _without_guard(_changed(s2.ScenarioConfig(), {"robot": {"limits": limits}}))
    return [
        Entry(people, f"{name}-{people}", config, RECORDED, recording=Recording(folder / file, people, WINDOW))
        for people in RECORDED_QUESTIONS
        for name, (file, _) in RECORDINGS.items()
    ]


def _all() -> list[Entry]:
    """The entries of s2b-1."""
    found: list[Any] = [
        ("encounters", name, s2.load_scenario(name), ENCOUNTERS, None, name) for name in sorted(SITUATIONS)
    ]
    for name, scenes in (("sonata-2020", 300), ("sonata-2020-crowded", 200), ("waiting-room", 100)):
        found.append(("rooms", name, s2.load_scenario(name), scenes, None, None))
    found.append(("lively", "lively", s2.load_scenario("lively"), 400, None, None))
    for name in ("lively", "crossing-flows", "parallel-traffic"):
        config = _changed(s2.load_scenario(name), {"person": {"ignores_robot": 1.0}})
        config = _changed(
            config, {"people": [dict(person, reacts_to_robot=0.0) for person in config.settings()["people"]]}
        )
        found.append(("unyielding", f"unyielding-{name}", config, 60, None, None))
    for name, (settings, sensing) in SHIFTS.items():
        base = _changed(s2.load_scenario("sonata-2020"), {"wandering": [2, 8]})
        found.append(("shift", name, _changed(base, settings), SHIFT, sensing, None))
    for name in ("clinic_corridor", "home", "office"):
        found.append(("maps", name, s2.load_scenario(str(EXAMPLES / f"{name}.yaml")), 60, None, None))
    return [Entry(part, name, _without_guard(config), *rest) for part, name, config, *rest in found]


def _without_guard(config: s2.ScenarioConfig) -> s2.ScenarioConfig:
    return _changed(config, {"rules": {"guard": False}})


def _changed(config: s2.ScenarioConfig, settings: Mapping[str, Any]) -> s2.ScenarioConfig:
    return s2.ScenarioConfig(**merged(config.settings(), settings))


def changes(defaults: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings that differ from defaults, as `merged` reads them."""
    found: dict[str, Any] = {}
    for key, value in settings.items():
        default = defaults.get(key)
        if orjson.dumps(value) == orjson.dumps(default):
            continue
        if not isinstance(value, Mapping):
            found[key] = value
            continue
        section = changes(default, value) if isinstance(default, Mapping) else {}
        # the order of weights matters to what is drawn, and a merged section has the order of its defaults
        if isinstance(default, Mapping) and orjson.dumps(merged(default, section)) == orjson.dumps(value):
            found[key] = section
        else:
            found[f"{key}="] = value
    return found


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
