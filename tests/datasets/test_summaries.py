"""A data set states its contacts, and commands beyond the robot's limits, wherever it states its outcomes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import Limits, Robot
from sonata2d.core.geometry import Pose
from sonata2d.core.snapshot import Contact
from sonata2d.datasets import generate_dataset, merge_datasets, mirror_dataset, verify
from sonata2d.datasets.card.text import card_text
from sonata2d.datasets.manifest import read_manifest, write_json
from sonata2d.datasets.summaries import totals_of
from sonata2d.errors import ControllerWarning
from sonata2d.metrics.trajectory import Trajectory
from sonata2d.record.counts import commands_beyond_limits, count_contacts
from sonata2d.record.reader import read_episode
from sonata2d.testing.controllers import check_controller

pytestmark = pytest.mark.usefixtures("kept_processes")

CROWDED = s2.ScenarioConfig(
    name="crowded",
    humans=10,
    tables=3,
    person={"ignores_robot": 1.0},
    rules={"time_limit": 6.0, "ends_on": ["time"]},
)
SIDEWAYS = s2.ScenarioConfig(name="slow", humans=0, robot={"kinematics": "unicycle"}, rules={"time_limit": 1.0})


class Careless(s2.Controller):
    """Drives in a circle without looking, with commands within the limits."""

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist(vx=0.9, omega=0.4)


class Racer(s2.Controller):
    """Commands 50 m/s, and sideways motion."""

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist(vx=50.0, vy=0.3)


@pytest.fixture(scope="module")
def careless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sets") / "careless"
    generate_dataset(folder, CROWDED, f"{__name__}:Careless", episodes=4, seed=1)
    return folder


def rows(folder: Path) -> list[dict[str, Any]]:
    files: list[dict[str, Any]] = read_manifest(folder)["files"]
    return files


def test_a_frame_counts_once_for_each_kind_and_fault() -> None:
    wall, human = Contact("wall", 0, True, False), Contact("human", 1, False, True)
    states = [[], [wall, Contact("wall", 3, True, False)], [wall, human], [Contact("human", 1, True, False), human]]
    assert count_contacts(states) == {
        "any": {"frames": 3, "robot_at_fault": 3, "other_at_fault": 2},
        "human": {"frames": 2, "robot_at_fault": 1, "other_at_fault": 2},
        "wall": {"frames": 2, "robot_at_fault": 2, "other_at_fault": 0},
    }
    assert count_contacts([[], []]) == {}


def test_the_manifest_counts_the_contacts_that_the_metrics_see(careless: Path) -> None:
    kinds = set()
    for row in rows(careless):
        collisions = Trajectory(read_episode(careless / row["name"])).collisions
        seen = {(one.kind, k) for one in collisions for k in range(one.first, one.last + 1)}
        counted = {kind: count["frames"] for kind, count in row["contacts"].items() if kind != "any"}
        assert counted == {kind: sum(of == kind for of, _ in seen) for kind in {of for of, _ in seen}}
        kinds |= counted.keys()
    assert kinds == {"human", "object", "wall"}


def test_mirrored_merged_and_resumed_data_sets_carry_the_counts(careless: Path, tmp_path: Path) -> None:
    mirror_dataset(careless, tmp_path / "image")
    merge_datasets([careless, tmp_path / "image"], tmp_path / "both")
    assert verify(tmp_path / "both") == []
    counts = [row["contacts"] for row in rows(careless)]
    assert [row["contacts"] for row in rows(tmp_path / "both")] == counts + counts
    generate_dataset(tmp_path / "grown", CROWDED, f"{__name__}:Careless", episodes=2, seed=1)
    generate_dataset(tmp_path / "grown", CROWDED, f"{__name__}:Careless", episodes=4, seed=1, resume=True)
    assert rows(tmp_path / "grown") == rows(careless)


def test_the_card_shows_contacts_beside_the_outcomes(careless: Path) -> None:
    text, summary = (careless / "README.md").read_text("utf-8"), totals_of(rows(careless)).contacts
    walls, frames = summary.by_kind["wall"], sum(row["ticks"] for row in rows(careless))
    assert walls.frames > 0
    share, fault = (f"{count / frames:.1%}".replace("%", " %") for count in (walls.frames, walls.robot_at_fault))
    assert f"| wall | {walls.episodes} | {share} | {fault} | 0.0 % |" in text
    untouched = {**read_manifest(careless), "files": [row | {"contacts": {}} for row in rows(careless)]}
    assert "touched nothing" in card_text(untouched)


def test_manifests_without_counts_are_read_and_say_so(careless: Path, tmp_path: Path) -> None:
    generate_dataset(tmp_path / "old", CROWDED, "straight-to-goal", episodes=2)
    manifest = json.loads((tmp_path / "old/manifest.json").read_text())
    for row in manifest["files"]:
        del row["contacts"], row["commands_beyond_limits"]
    write_json(tmp_path / "old/manifest.json", manifest)
    assert verify(tmp_path / "old") == []
    assert totals_of(rows(tmp_path / "old")).contacts.rows() == [("contacts", "not counted in 2 episodes")]
    assert "whose contacts were not counted: 2." in card_text(read_manifest(tmp_path / "old"))


def test_a_changed_count_is_found_by_the_check(careless: Path, tmp_path: Path) -> None:
    mirror_dataset(careless, tmp_path / "image")
    manifest = json.loads((tmp_path / "image/manifest.json").read_text())
    manifest["files"][0]["contacts"]["any"]["frames"] += 1
    write_json(tmp_path / "image/manifest.json", manifest)
    assert [problem.place for problem in verify(tmp_path / "image")] == ["contacts"]


def test_commands_beyond_the_limits_are_counted_by_component() -> None:
    command = np.array([[1.0, 0.0, 0.0], [1.0001, 0.0, -3.0], [-0.75, 0.1, 1.5], [-2.0, 0.0, 1.5]])
    robot = Robot(Pose(0.0, 0.0), limits=Limits(ahead=1.0, back=0.5, sideways=0.5, turn=1.5))
    excess = commands_beyond_limits([robot], command[None])
    assert excess["vx"] == {"frames": 2, "command": 2.0, "limit": 0.5}
    assert excess["omega"] == {"frames": 1, "command": 3.0, "limit": 1.5}
    assert "vy" not in excess
    unicycle = Robot(Pose(0.0, 0.0), kinematics="unicycle")
    assert commands_beyond_limits([unicycle], command[None])["vy"] == {"frames": 1, "command": 0.1, "limit": 0.0}


@pytest.mark.parametrize("workers", [1, 2])
def test_commands_far_beyond_the_limits_give_one_warning_for_the_batch(tmp_path: Path, workers: int) -> None:
    with pytest.warns(ControllerWarning) as warned:
        generate_dataset(tmp_path / "out", SIDEWAYS, f"{__name__}:Racer", episodes=9, workers=workers)
    (warning,) = warned
    assert "vx up to 50 m/s (limit 1 m/s) in 100.0 % of the frames" in str(warning.message)
    assert "the drive does not move sideways" in str(warning.message)
    assert [one.component for one in totals_of(rows(tmp_path / "out")).excess] == ["vx", "vy"]
    assert "Commands exceed the limits of the robot's drive" in (tmp_path / "out/README.md").read_text()


def test_check_controller_warns_of_commands_far_beyond_the_limits() -> None:
    with pytest.warns(ControllerWarning, match=r"Racer: commands exceed the limits .* vx up to 50 m/s") as warned:
        check_controller(Racer(), time_limit=1.0)
    assert len(warned) == 1
