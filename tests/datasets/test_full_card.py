"""A card tells how a data set looks, and machines can read it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from sonata2d_cli import main

from sonata2d.core.proxemics import clearance
from sonata2d.datasets.card_figure import clearances, surveyed
from sonata2d.datasets.full_card import write_card
from sonata2d.datasets.generate import generate_dataset
from sonata2d.datasets.verification import verify
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.config import ScenarioConfig

pytest.importorskip("matplotlib", reason="the card's figures need sonata2d[plots]")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sets") / "set"
    config = ScenarioConfig(humans=(0, 5), rules={"time_limit": 4.0})
    generate_dataset(folder, config, "straight-to-goal", episodes=4, seed=2)
    return folder


def test_every_frame_is_counted_once(made: Path) -> None:
    records = [read_episode(path) for path in sorted(made.glob("0*.json"))]
    survey = surveyed(records)
    frames = sum(len(record) for record in records)
    people = sum(int(record.present.sum()) for record in records)
    assert (survey.robot.sum(), survey.robot_speed.sum(), survey.frames) == (frames, frames, frames)
    assert (survey.people.sum(), survey.people_speed.sum()) == (people, people)
    assert survey.clearance.sum() == frames - survey.alone
    assert sum(survey.outcomes.values()) == 4


def test_the_map_has_x_to_the_right(made: Path) -> None:
    record = read_episode(made / "000000.json")
    survey = surveyed([record])
    (x, y), counts = record.robot[0, :2], survey.robot
    assert counts[int((x + 12.0) / 0.2), int((y + 12.0) / 0.2)] > 0


def test_gaps_are_those_that_controllers_see(made: Path) -> None:
    for path in sorted(made.glob("0*.json")):
        record = read_episode(path)
        seen = [max(clearance(record.snapshot(t)), 0.0) for t in range(len(record))]
        assert clearances(record) == pytest.approx(np.array(seen), abs=1e-9)


def test_the_card_has_figures_and_the_set_stays_sound(made: Path) -> None:
    path = write_card(made)
    text = path.read_text()
    assert "![" in text
    assert text.index("## Figures") < text.index("## Known limits")
    assert (made / "card.png").read_bytes().startswith(b"\x89PNG")
    assert verify(made) == []


def test_metadata_names_the_manifest_by_its_hash(made: Path) -> None:
    write_card(made, figures=False)
    tree = json.loads((made / "croissant.json").read_text())
    assert tree["@type"] == "sc:Dataset"
    assert tree["conformsTo"] == "http://mlcommons.org/croissant/1.0"
    manifest, episodes = tree["distribution"]
    assert manifest["sha256"] == hashlib.sha256((made / "manifest.json").read_bytes()).hexdigest()
    assert episodes["includes"] == ["*.json"]
    listed = json.loads((made / "manifest.json").read_text())["files"][0]
    fields = [
        field["source"]["extract"]["jsonPath"].removeprefix("$.files[*].") for field in tree["recordSet"][0]["field"]
    ]
    assert set(fields) <= set(listed)


def test_recorded_people_leave_the_licence_to_whoever_knows_it(tmp_path: Path) -> None:
    person = {"track": [[0.0, 0.0, 1.0], [2.0, 2.0, 1.0]]}
    config = ScenarioConfig(humans=0, relations=0, tables=0, people=[person], rules={"time_limit": 1.0})
    generate_dataset(tmp_path / "set", config, "straight-to-goal", episodes=1, seed=2)

    def told(*options: str) -> tuple[str, str]:
        done = CliRunner().invoke(main, ["card", str(tmp_path / "set"), "--no-figures", *options])
        assert done.exit_code == 0, done.output
        tree = json.loads((tmp_path / "set" / "croissant.json").read_text())
        return tree["license"], tree["description"]

    assert told() == ("other", "1 episodes of a robot among recorded people, made with sonata2d.")
    assert told("--licence", "cc-by-4.0")[0] == "https://creativecommons.org/licenses/by/4.0/"
    assert "license: cc-by-4.0" in (tmp_path / "set" / "README.md").read_text()
    assert CliRunner().invoke(main, ["card", str(tmp_path / "set"), "--licence", "My terms"]).exit_code == 1


def test_the_same_data_give_the_same_card(made: Path) -> None:
    write_card(made)
    first = {name: (made / name).read_bytes() for name in ("README.md", "croissant.json", "card.png")}
    write_card(made)
    assert first == {name: (made / name).read_bytes() for name in first}


def test_the_command_tells_what_it_wrote(made: Path) -> None:
    told = json.loads(CliRunner().invoke(main, ["card", str(made), "--json"]).output)
    assert all(Path(path).is_file() for path in told.values())
    assert CliRunner().invoke(main, ["card", "nowhere"]).exit_code == 1
