"""Files of earlier releases are read, pass check, and mean what they meant."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from sonata2d.datasets import verify
from sonata2d.datasets.dataset import Dataset
from sonata2d.formats.api import import_from
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.load import load_scenario

RELEASES = sorted(path for path in Path(__file__).parent.iterdir() if (path / "set").is_dir())
each_release = pytest.mark.parametrize("release", RELEASES, ids=lambda path: path.name)


@each_release
@pytest.mark.parametrize("name", ["set", "shards"])
def test_data_sets_of_earlier_releases_are_read_and_pass_check(release: Path, name: str, tmp_path: Path) -> None:
    folder = tmp_path / name  # readers may keep an index beside the files
    shutil.copytree(release / name, folder)
    assert verify(folder) == []
    data = Dataset(folder)
    assert len(data) == 2
    for record in data:
        assert len(record) == 15, "1.5 s in steps of 0.1 s"
        assert record.document["software"]["sonata2d"] == release.name


@each_release
def test_a_recorded_state_has_the_values_that_the_release_wrote(release: Path) -> None:
    record = read_episode(release / "set" / "000000.json")
    first = record.document["frames"][3]
    assert record.states.robot[3].tolist() == first["robot"]
    assert [row.tolist() for row in record.states.humans[3]] == first["humans"]


@each_release
@pytest.mark.parametrize("format", ["npz", "parquet"])
def test_lossless_exports_of_earlier_releases_give_the_same_bytes(release: Path, format: str, tmp_path: Path) -> None:
    shutil.copytree(release / "exports" / format, tmp_path / format)
    source = tmp_path / format if format == "parquet" else tmp_path / format / "000000.npz"
    (path,) = import_from(source, format, tmp_path / "back").files
    assert path.read_bytes() == (release / "set" / "000000.json").read_bytes()


@each_release
def test_exported_tracks_and_scenarios_of_earlier_releases_are_read(release: Path, tmp_path: Path) -> None:
    (path,) = import_from(release / "exports" / "csv", "csv", tmp_path / "tracks").files
    tracks, source = read_episode(path), read_episode(release / "set" / "000000.json")
    assert tracks.states.humans[..., :2].tolist() == source.states.humans[..., :2].tolist()
    assert load_scenario(str(release / "scenario.yaml")).name == "archived"
