"""Tables beside the episodes of a data set: what they hold, when they are written, and when they are stale."""

from __future__ import annotations

import shutil
import sys
from hashlib import sha256
from pathlib import Path

import pytest
import yaml

import sonata2d as s2
from sonata2d.datasets import (
    generate_dataset,
    merge_datasets,
    mirror_dataset,
    split_dataset,
    tables as module,
    verify,
    write_card,
    write_tables,
)  # fmt: skip
from sonata2d.datasets.card.text import card_text
from sonata2d.datasets.manifest import read_manifest
from sonata2d.errors import DatasetWarning, RecordError

pa = pytest.importorskip("pyarrow", reason="pyarrow comes with the parquet extra")
pq = pytest.importorskip("pyarrow.parquet")
VISITED = s2.ScenarioConfig(
    standing=(1, 2), wandering=2, tables=1, at_laptop=1, plants=0, doors=[{"inflow": 12}],
    social={"exits": 0.3, "meets": 0.5}, rules={"time_limit": 15.0},
)  # fmt: skip


def hashes(folder: Path) -> dict[str, str]:
    return {path.name: sha256(path.read_bytes()).hexdigest() for path in folder.glob("*.parquet")}


def rows_of(folder: Path, pattern: str = "frames-*.parquet") -> list[dict[str, object]]:
    return [row for path in sorted(folder.glob(pattern)) for row in pq.read_table(path).to_pylist()]


@pytest.fixture(scope="module")
def visited(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Episodes with people who come and go."""
    folder = tmp_path_factory.mktemp("visited") / "runs"
    generate_dataset(folder, VISITED, episodes=6, seed=3, progress=False)
    return folder


def test_a_row_for_each_frame_with_the_people_that_are_there(visited: Path) -> None:
    rows, dataset = rows_of(visited), s2.Dataset(visited)
    assert len(rows) == sum(len(record) + 1 for record in dataset)
    seen = {len(row["humans"]) for row in rows}  # type: ignore[arg-type]
    assert len(seen) > 2, "people come and go"
    record = dataset[2]
    own = [row for row in rows if row["episode_id"] == "000002"]
    for tick, row in enumerate(own):
        present = record.states.present[tick]
        ids = [human.id for human, is_there in zip(record.scene().humans, present, strict=True) if is_there]
        assert [human["id"] for human in row["humans"]] == ids  # type: ignore[attr-defined]
        assert [row["goal_x"], row["goal_y"]] == record.goals[tick, :2].tolist()
        found = [[each["src"], each["relation"], each["dst"]] for each in row["interactions"]]  # type: ignore[attr-defined]
        frames = [*record.document["frames"], record.document["final"]]
        assert found == frames[tick]["interactions"]
    assert own[-1]["executed_vx"] is None
    assert [row["episode_id"] for row in rows_of(visited, "episodes-*.parquet")] == [f"{k:06d}" for k in range(6)]


def test_workers_shards_and_resumption_give_the_same_rows(visited: Path, tmp_path: Path) -> None:
    generate_dataset(tmp_path / "two", VISITED, episodes=6, seed=3, workers=2, progress=False)
    assert hashes(tmp_path / "two") == hashes(visited)
    generate_dataset(tmp_path / "cut", VISITED, episodes=4, seed=3, progress=False)
    generate_dataset(tmp_path / "cut", VISITED, episodes=6, seed=3, resume=True, progress=False)
    assert hashes(tmp_path / "cut") == hashes(visited)
    generate_dataset(tmp_path / "shards", VISITED, episodes=6, seed=3, shard_size=4, progress=False)
    assert rows_of(tmp_path / "shards") == rows_of(visited)


def test_a_file_has_the_rows_of_some_episodes_and_stays_if_they_have_not_changed(
    visited: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_PART", 4)
    shutil.copytree(visited, tmp_path / "runs")
    files = write_tables(tmp_path / "runs")
    names = [f"{name}-0000{k}.parquet" for name in ("episodes", "frames") for k in (0, 1)]
    assert [file.name for file in files] == names
    assert rows_of(tmp_path / "runs") == rows_of(visited)
    before = {file: file.stat().st_mtime_ns for file in files}
    files[1].unlink()
    write_tables(tmp_path / "runs")
    after = {file: file.stat().st_mtime_ns for file in files}
    assert [file.name for file in files if after[file] == before[file]] == [names[0], names[2]]


def test_a_split_is_one_of_the_tables(visited: Path, tmp_path: Path) -> None:
    shutil.copytree(visited, tmp_path / "runs")
    split = split_dataset(tmp_path / "runs", {"train": 0.7, "held-out": 0.3})
    assert {path.name for path in (tmp_path / "runs").glob("*.parquet")} == {
        f"{name}-{part}-00000.parquet" for name in ("episodes", "frames") for part in ("train", "held_out")
    }
    rows = rows_of(tmp_path / "runs", "episodes-held_out-*.parquet")
    assert [f"{row['episode_id']}.json" for row in rows] == split["held-out"]
    card = (tmp_path / "runs" / "README.md").read_text()
    assert '  - split: "held_out"\n    path: "frames-held_out-*.parquet"\n' in card
    assert verify(tmp_path / "runs") == []


def test_data_sets_made_from_others_have_tables_as_these(visited: Path, tmp_path: Path) -> None:
    mirror_dataset(visited, tmp_path / "mirrored")
    assert len(rows_of(tmp_path / "mirrored")) == len(rows_of(visited))
    merge_datasets([visited, tmp_path / "mirrored"], tmp_path / "both")
    assert len(rows_of(tmp_path / "both")) == 2 * len(rows_of(visited))
    generate_dataset(tmp_path / "without", VISITED, episodes=1, seed=4, tables=False, progress=False)
    assert not list((tmp_path / "without").glob("*.parquet"))
    merge_datasets([visited, tmp_path / "without"], tmp_path / "some")
    assert not list((tmp_path / "some").glob("*.parquet"))
    write_card(tmp_path / "some")
    assert len(rows_of(tmp_path / "some", "episodes-*.parquet")) == 7


def test_stale_tables_are_found_and_replaced(visited: Path, tmp_path: Path) -> None:
    shutil.copytree(visited, tmp_path / "runs")
    generate_dataset(tmp_path / "runs", VISITED, episodes=7, seed=3, resume=True, tables=False, progress=False)
    (problem,) = verify(tmp_path / "runs")
    assert "do not hold the present episodes; write them again with `sonata2d card`" in str(problem)
    write_tables(tmp_path / "runs")
    assert verify(tmp_path / "runs") == []
    generate_dataset(tmp_path / "runs", VISITED, episodes=1, seed=9, overwrite=True, tables=False, progress=False)
    assert not list((tmp_path / "runs").glob("*.parquet"))


def test_without_pyarrow_nothing_is_written_and_a_wish_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(RecordError, match="this needs pyarrow"):
        generate_dataset(tmp_path / "wished", VISITED, episodes=1, tables=True, progress=False)
    assert not (tmp_path / "wished").exists()
    generate_dataset(tmp_path / "runs", VISITED, episodes=1, progress=False)
    write_card(tmp_path / "runs")
    assert not list((tmp_path / "runs").glob("*.parquet"))
    assert verify(tmp_path / "runs") == []


def test_names_of_parts_do_not_collide_and_are_texts_in_the_card(visited: Path, tmp_path: Path) -> None:
    shutil.copytree(visited, tmp_path / "runs")
    with pytest.raises(ValueError, match="the parts a-b, a_b would have tables of the same names; rename one"):
        split_dataset(tmp_path / "runs", {"a-b": 1, "a_b": 1})
    split_dataset(tmp_path / "runs", {"0": 1, "no": 1})
    header = yaml.safe_load((tmp_path / "runs" / "README.md").read_text().split("---\n")[1])
    assert [each["split"] for each in header["configs"][0]["data_files"]] == ["0", "no"]
    assert verify(tmp_path / "runs") == []


def test_an_edited_card_names_the_present_tables(visited: Path, tmp_path: Path) -> None:
    shutil.copytree(visited, tmp_path / "runs")
    card = tmp_path / "runs" / "README.md"
    card.write_text(card.read_text() + "My notes.\n")
    with pytest.warns(DatasetWarning, match="was edited"):
        split_dataset(tmp_path / "runs", {"train": 1, "test": 1})
    header = yaml.safe_load(card.read_text().split("---\n")[1])
    assert [each["split"] for each in header["configs"][0]["data_files"]] == ["train", "test"]
    assert card.read_text().endswith("My notes.\n")
    assert verify(tmp_path / "runs") == []
    card.write_text(card.read_text().replace('"frames-test-*', '"frames-*'))
    (problem,) = verify(tmp_path / "runs")
    assert 'names other tables under `configs` than the data set has: "frames-train-*.parquet"' in str(problem)
    assert problem.place == "tables"


def test_a_damaged_table_is_found(visited: Path, tmp_path: Path) -> None:
    shutil.copytree(visited, tmp_path / "runs")
    table = tmp_path / "runs" / "frames-00000.parquet"
    data = bytearray(table.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 300] = bytes(byte ^ 255 for byte in data[middle : middle + 300])
    table.write_bytes(data)
    (problem,) = verify(tmp_path / "runs")
    assert "do not hold the present episodes" in str(problem)


def test_tables_of_other_programs_stay(visited: Path, tmp_path: Path) -> None:
    shutil.copytree(visited, tmp_path / "runs")
    other = tmp_path / "runs" / "frames-mine-00000.parquet"
    pq.write_table(pa.table({"x": [1]}), other)
    write_tables(tmp_path / "runs")
    assert other.exists()
    assert verify(tmp_path / "runs") == []


def test_a_card_names_tables_only_where_there_are_some(visited: Path, tmp_path: Path) -> None:
    assert "configs:" in (visited / "README.md").read_text()
    generate_dataset(tmp_path / "without", VISITED, episodes=1, tables=False, progress=False)
    assert "configs:" not in (tmp_path / "without" / "README.md").read_text()
    # else Hugging Face would take the manifests of shards for the data
    generate_dataset(tmp_path / "shards", VISITED, episodes=1, shard_size=1, tables=False, progress=False)
    assert "configs:" in (tmp_path / "shards" / "README.md").read_text()
    manifest = read_manifest(tmp_path / "shards")
    assert "configs:" in card_text(manifest | {"complete": False}), "also of an interrupted data set"


def test_a_failed_write_of_tables_says_that_the_episodes_are_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "_write_all", fail)
    with pytest.raises(RecordError, match=r"No space left.*the episodes are complete, and `sonata2d card .*runs`"):
        generate_dataset(tmp_path / "runs", VISITED, episodes=1, progress=False)
    assert len(s2.Dataset(tmp_path / "runs")) == 1
    assert verify(tmp_path / "runs") == []


def test_hugging_face_tells_data_sets_of_one_name_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its cache is found by the name of the folder and the version in the card, not by the content."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets", reason="datasets is not installed")

    def count(folder: Path, part: str = "train") -> int:
        loaded = datasets.load_dataset(str(folder), "episodes", cache_dir=str(tmp_path / "cache"))
        return int(loaded[part].num_rows)

    for number in (2, 3):
        generate_dataset(tmp_path / str(number) / "demo", VISITED, episodes=number, progress=False)
        assert count(tmp_path / str(number) / "demo") == number
    folder = tmp_path / "3" / "demo"
    generate_dataset(folder, VISITED, episodes=6, overwrite=True, progress=False)
    assert count(folder) == 6
    for fraction, expected in ((1, 3), (2, 4)):
        split_dataset(folder, {"train": fraction, "test": 1})
        assert (count(folder), count(folder, "test")) == (expected, 6 - expected)


def test_hugging_face_reads_the_folder_with_no_option(
    visited: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets", reason="datasets is not installed")
    loaded = datasets.load_dataset(str(visited), cache_dir=str(tmp_path / "cache"))
    assert loaded["train"].num_rows == len(rows_of(visited))
    streamed = datasets.load_dataset(str(visited), "episodes", streaming=True)["train"]
    assert [row["episode_id"] for row in streamed] == [f"{k:06d}" for k in range(6)]
