"""The data card describes a data set for readers, for Hugging Face and, by Croissant metadata, for programs."""

from __future__ import annotations

import hashlib
import json
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import CliRunner
from sonata2d_cli import main

from sonata2d.datasets import generate_dataset, write_card
from sonata2d.datasets.card.text import card_text
from sonata2d.datasets.manifest import read_manifest, write_json
from sonata2d.errors import ConfigError
from sonata2d.scenegen.scenario.config import ScenarioConfig

from .test_manifest import dataset_in, spec


def test_the_card_has_front_matter_and_the_command_that_reproduces_the_data_set(tmp_path: Path) -> None:
    dataset_in(tmp_path, spec())
    text = (tmp_path / "README.md").read_text("utf-8")
    _, front, body = text.split("---\n", 2)
    front_matter = yaml.safe_load(front)
    assert (front_matter["license"], front_matter["task_categories"]) == ("cc-by-4.0", ["robotics"])
    assert front_matter["size_categories"] == ["n<1K"]
    assert "social-navigation" in front_matter["tags"]
    assert "sonata2d generate" in body
    assert "| stopped | 3 |" in body


def test_the_card_counts_recorded_pedestrians_and_leaves_the_licence_open(tmp_path: Path) -> None:
    people = [{"track": [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]}, {"x": 1.0, "y": 2.0, "track": None}]
    dataset_in(tmp_path, spec())
    manifest = read_manifest(tmp_path) | {"settings": {"people": people}}
    _, front, body = card_text(manifest).split("---\n", 2)
    front_matter = yaml.safe_load(front)
    assert front_matter["license"] == "other"
    assert "synthetic" not in front_matter["tags"]
    assert "1 of the 2 pedestrians listed in the scenario follow recorded tracks" in body
    assert "Pedestrians are simulated" not in body
    simulated = card_text(manifest | {"settings": {"people": people[1:]}})
    assert "- synthetic" in simulated
    assert "recorded" not in simulated
    assert "among recorded and simulated pedestrians" in card_text(manifest | {"collected": True})
    assert "among simulated pedestrians" in card_text(manifest | {"collected": True, "settings": None})


def test_names_in_the_card_cannot_become_markup_or_commands(tmp_path: Path) -> None:
    dataset_in(tmp_path, spec())
    name, path = "x`\n\n# y <script>alert(1)</script> | *b* [a](u) $z$", "./a b;$(touch pwned)`id`.py:K"
    manifest = read_manifest(tmp_path)
    manifest |= {"name": name, "controller": {"path": path, "version": None, "settings": {}}}
    manifest["counts"] = {"outcome": {"goal": 1}, "family": {name: 1}}
    _, front, body = card_text(manifest).split("---\n", 2)
    assert yaml.safe_load(front)["pretty_name"].startswith(f"sonata2d {name}")
    command = next(line for line in body.splitlines() if line.startswith("sonata2d generate"))
    assert shlex.split(command)[-1] == path
    escaped = r"x\`  \# y &lt;script&gt;alert(1)&lt;/script&gt; \| \*b\* \[a\](u) \$z\$"
    assert f"# sonata2d {escaped}, seed" in body
    assert f"| {escaped} | 1 |" in body
    assert "in the scenario `` x`  # y <script>alert(1)</script> | *b* [a](u) $z$ ``, simulated" in body
    assert f"with the controller `` {path} ``." in body


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A generated data set of four episodes."""
    folder = tmp_path_factory.mktemp("sets") / "set"
    config = ScenarioConfig(humans=(0, 5), rules={"time_limit": 4.0})
    generate_dataset(folder, config, "straight-to-goal", episodes=4, seed=2)
    return folder


def test_metadata_names_the_manifest_by_its_hash(folder: Path) -> None:
    write_card(folder)
    metadata = json.loads((folder / "croissant.json").read_text())
    assert metadata["@type"] == "sc:Dataset"
    assert metadata["conformsTo"] == ["http://mlcommons.org/croissant/1.0", "http://mlcommons.org/croissant/RAI/1.0"]
    manifest, episodes = metadata["distribution"]
    assert manifest["sha256"] == hashlib.sha256((folder / "manifest.json").read_bytes()).hexdigest()
    assert episodes["includes"] == ["*.json"]
    listed = json.loads((folder / "manifest.json").read_text())["files"][0]
    paths = [field["source"]["extract"]["jsonPath"] for field in metadata["recordSet"][0]["field"]]
    assert {path.removeprefix("$.files[*].") for path in paths} <= set(listed)


def test_the_licence_of_recorded_pedestrians_is_other_unless_given(tmp_path: Path) -> None:
    person = {"track": [[0.0, 0.0, 1.0], [2.0, 2.0, 1.0]]}
    config = ScenarioConfig(humans=0, relations=0, tables=0, people=[person], rules={"time_limit": 1.0})
    generate_dataset(tmp_path / "set", config, "straight-to-goal", episodes=1, seed=2)

    def metadata(*options: str) -> tuple[str, str]:
        result = CliRunner().invoke(main, ["card", str(tmp_path / "set"), *options])
        assert result.exit_code == 0, result.output
        document = json.loads((tmp_path / "set" / "croissant.json").read_text())
        return document["license"], document["description"]

    assert metadata() == ("other", "1 episodes of a robot among recorded pedestrians, made with sonata2d.")
    assert metadata("--licence", "cc-by-4.0")[0] == "https://creativecommons.org/licenses/by/4.0/"
    assert "license: cc-by-4.0" in (tmp_path / "set" / "README.md").read_text()
    assert CliRunner().invoke(main, ["card", str(tmp_path / "set"), "--licence", "My terms"]).exit_code == 1


def test_statements_of_the_author_are_in_the_metadata(folder: Path) -> None:
    def metadata(**statements: str) -> dict[str, Any]:
        write_card(folder, **statements)
        document: dict[str, Any] = json.loads((folder / "croissant.json").read_text())
        return document

    plain = metadata()
    assert plain["version"] == "1.0.0"
    assert not {"datePublished", "creator", "url"} & set(plain), "nothing comes from the clock"
    assert plain["citeAs"].startswith("@misc{sonata2d-dataset, title = {sonata2d custom, seed 2}, version = {1.0.0}, ")
    values = {"date": "2026-05-01", "version": "1.2.0", "creator": "A {Lab}", "url": "https://example.org/set"}
    full = metadata(**values)
    assert (full["datePublished"], full["version"], full["url"]) == ("2026-05-01", "1.2.0", values["url"])
    assert "author = {A Lab}, year = {2026}, version = {1.2.0}, url = {https://example.org/set}" in full["citeAs"]
    assert metadata() == full, "statements stay"
    for wrong in ({"date": "1 May"}, {"date": "2026-02-30"}, {"version": "1"}, {"url": "my page"}, {"licence": "My"}):
        with pytest.raises(ConfigError, match=repr(next(iter(wrong.values())))):
            write_card(folder, **wrong)


def test_metadata_describe_collection_biases_and_personal_data(folder: Path, tmp_path: Path) -> None:
    write_card(folder)
    simulated = json.loads((folder / "croissant.json").read_text())
    assert simulated["rai:dataCollectionType"] == ["Software Collection"]
    assert simulated["rai:personalSensitiveInformation"][0].startswith("None")
    shutil.copytree(folder, tmp_path / "set")
    manifest = read_manifest(tmp_path / "set")
    people = [{"track": [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]}]
    write_json(tmp_path / "set/manifest.json", manifest | {"settings": {"people": people}, "keep": ["goal"]})
    write_card(tmp_path / "set")
    recorded = json.loads((tmp_path / "set/croissant.json").read_text())
    assert "1 of 1 listed pedestrians follow recorded tracks" in recorded["rai:dataCollection"]
    assert recorded["rai:personalSensitiveInformation"] == [
        "Positions of recorded people; the terms of the recordings apply."
    ]
    assert recorded["rai:dataBiases"][-1] == "Only episodes with these outcomes are kept: goal."


def test_metadata_pass_the_reference_validator(folder: Path) -> None:
    mlcroissant = pytest.importorskip("mlcroissant", reason="mlcroissant is not installed")
    write_card(folder, date="2026-05-01", creator="A Lab", url="https://example.org/set")
    dataset = mlcroissant.Dataset(jsonld=folder / "croissant.json")
    assert not dataset.metadata.issues.report()
    assert [row["episode/episode"] for row in dataset.records("episode")] == [0, 1, 2, 3]


def test_the_same_data_give_the_same_card(folder: Path) -> None:
    write_card(folder)
    first = {name: (folder / name).read_bytes() for name in ("README.md", "croissant.json")}
    write_card(folder)
    assert first == {name: (folder / name).read_bytes() for name in first}


def test_the_command_reports_the_written_files(folder: Path) -> None:
    written = json.loads(CliRunner().invoke(main, ["card", str(folder), "--json"]).output)
    assert all(Path(path).is_file() for path in written.values())
    assert CliRunner().invoke(main, ["card", "nowhere"]).exit_code == 1
