"""`npz` and `parquet`: formats that keep the whole episode."""

from __future__ import annotations

import io
import json
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from sonata2d import Episode, ScenarioConfig, SocialPlanner, generate
from sonata2d.datasets import generate_dataset, verify
from sonata2d.datasets.check.replay import check_replay
from sonata2d.errors import RecordError
from sonata2d.formats import api, npz, parquet
from sonata2d.formats.api import export_to, import_from
from sonata2d.formats.format import Format, Options
from sonata2d.record.files import read_bytes
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.record.recorder import JsonRecorder

from ..record import samples as by_hand
from ..record.conftest import episode  # noqa: F401

NEEDS_PYARROW = "pyarrow comes with the parquet extra"


@pytest.fixture
def with_gaps(tmp_path: Path) -> Path:
    """An episode with labels, contacts and events, in which a pedestrian is sometimes absent."""
    path = tmp_path / "in" / "gaps.json"
    with JsonRecorder(path) as recorder:
        by_hand.run(recorder, labels=lambda tick: {"near": tick % 2 == 0})
    document = json.loads(path.read_bytes())
    for frame in (document["frames"][2], document["final"]):
        frame["humans"][1], frame["activity"][1] = None, -1
    path.write_text(json.dumps(document))
    return path


def same_json(first: Path, second: Path) -> bool:
    return bool(json.loads(read_bytes(first)) == json.loads(read_bytes(second)))


@pytest.mark.parametrize("format", ["npz", "parquet"])
def test_folder_reads_back_to_the_byte(folder: Path, tmp_path: Path, format: str) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow", reason=NEEDS_PYARROW)
    assert export_to(folder, format, tmp_path / "out").refused == []
    result = import_from(tmp_path / "out", format, tmp_path / "back")
    assert (len(result.files), result.refused) == (20, [])
    for path in result.files:
        assert path.read_bytes() == (folder / path.name).read_bytes()
    assert check_replay(read_episode(result.files[3])) == []


@pytest.mark.parametrize("format", ["npz", "parquet"])
def test_doors_read_back_to_the_byte(tmp_path: Path, format: str) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow", reason=NEEDS_PYARROW)
    config = ScenarioConfig(room={"kinds": ["doorway"]}, humans=2, relations=0, drop=True, interior_doors=[{}])
    with JsonRecorder(tmp_path / "door.json") as recorder:
        Episode(generate(config, seed=2), SocialPlanner(), observers=[recorder]).run()
    assert read_episode(tmp_path / "door.json").states.doors.any()
    assert export_to(tmp_path / "door.json", format, tmp_path / "out").refused == []
    (back,) = import_from(tmp_path / "out", format, tmp_path / "back").files
    assert back.read_bytes() == (tmp_path / "door.json").read_bytes()


@pytest.mark.parametrize("format", ["npz", "parquet"])
def test_gaps_labels_contacts_and_events_read_back(with_gaps: Path, tmp_path: Path, format: str) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow", reason=NEEDS_PYARROW)
    assert export_to(with_gaps, format, tmp_path / "out").refused == []
    (back,) = import_from(tmp_path / "out", format, tmp_path / "back").files
    assert same_json(with_gaps, back)


@pytest.mark.parametrize("format", ["npz", "socnav3"])
def test_all_fields_of_pedestrians_and_labels_read_back(episode: Path, tmp_path: Path, format: str) -> None:  # noqa: F811
    assert export_to(episode, format, tmp_path / "out").refused == []
    (back,) = import_from(tmp_path / "out", format, tmp_path / "back").files
    assert same_json(episode, back)


def test_numpy_alone_reads_npz(records: list[EpisodeRecord], tmp_path: Path) -> None:
    record, path = records[0], tmp_path / "one.npz"
    path.write_bytes(npz.export(record, Options()))
    assert npz.export(record, Options()) == path.read_bytes(), "the same bytes each time"
    with np.load(path) as arrays:
        assert (arrays["humans"] == record.states.humans).all()
        assert arrays["command"].shape == (len(record), 3)
        assert json.loads(str(arrays["header"]))["seed"] == record.seed


def test_array_that_declares_more_than_it_holds_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "large.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for name in (*npz._ARRAYS, "human_id", "header", "texts"):
            header = io.BytesIO()
            np.lib.format.write_array_header_1_0(
                header, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 10**6)}
            )
            archive.writestr(f"{name}.npy", header.getvalue())
    with pytest.raises(RecordError, match="but its data differ"):
        list(npz.import_(path, Options()))


def test_tables_join_in_pandas_and_polars(folder: Path, records: list[EpisodeRecord], tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason=NEEDS_PYARROW)
    pd = pytest.importorskip("pandas", reason="pandas is not installed")
    pl = pytest.importorskip("polars", reason="polars is not installed")
    export_to(folder, "parquet", tmp_path)
    rows = sum(int(record.states.present.sum()) for record in records)
    episodes, frames = (pd.read_parquet(tmp_path / f"{name}.parquet") for name in parquet.TABLES)
    joined = frames.merge(episodes, on="episode_id", suffixes=("", "_of_episode"))
    assert len(joined) == sum(len(record) + 1 for record in records)
    people = pl.read_parquet(tmp_path / "frames.parquet").explode("humans").unnest("humans")
    assert people.drop_nulls("id").height == rows
    interactions = pl.read_parquet(tmp_path / "frames.parquet").explode("interactions").unnest("interactions")
    interactions = interactions.drop_nulls("src").select("episode_id", "tick", "src", "relation")
    both = interactions.join(people, left_on=["episode_id", "tick", "src"], right_on=["episode_id", "tick", "id"])
    assert both.height == interactions.height > 0
    frame = people.filter((pl.col("episode_id") == "000004") & (pl.col("tick") == 7))
    assert frame.select("x", "y", "head").to_numpy().tolist() == records[4].states.humans[7][:, [0, 1, 6]].tolist()
    robot = frame.select("robot_x", "goal_x", "goal_theta").row(0)
    assert robot == (records[4].robot[7, 0], *records[4].goals[7, [0, 2]])


def test_tables_load_as_a_hugging_face_data_set(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyarrow", reason=NEEDS_PYARROW)
    monkeypatch.setenv("HF_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets", reason="datasets is not installed")
    export_to(folder, "parquet", tmp_path / "out")
    loaded = datasets.load_dataset(str(tmp_path / "out"), "episodes", cache_dir=str(tmp_path / "cache"))
    assert loaded["train"].num_rows == 20


def test_frames_without_people_have_empty_lists(tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    generate_dataset(tmp_path / "runs", "empty", "straight-to-goal", episodes=2, seed=1)
    export_to(tmp_path / "runs", "parquet", tmp_path / "tables")
    frames = pq.ParquetFile(tmp_path / "tables/frames.parquet")
    assert frames.num_row_groups == 1
    rows = frames.read(columns=["humans", "interactions"]).to_pylist()
    assert rows == [{"humans": [], "interactions": []}] * len(rows)
    configs = re.findall("config_name: (.*)", (tmp_path / "tables/README.md").read_text())
    assert configs == ["frames", "episodes"]


def test_tables_replace_those_of_older_versions(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason=NEEDS_PYARROW)
    older = Path(__file__).parent.parent / "archive" / "0.3.0" / "exports" / "parquet"
    shutil.copytree(older, tmp_path / "tables")
    export_to(folder, "parquet", tmp_path / "tables")
    assert sorted(path.name for path in (tmp_path / "tables").iterdir()) == [
        "README.md", "episodes.parquet", "frames.parquet"
    ]  # fmt: skip


def test_missing_pyarrow_names_the_package_to_install(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(RecordError, match="this needs pyarrow, which is not installed; pip install pyarrow"):
        export_to(folder, "parquet", tmp_path)


def test_format_without_import_or_export_is_refused(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    formats = {
        "write-only": Format("a format that is only written", ".txt", export=lambda record, options: b""),
        "read-only": Format("a format that is only read", ".txt", import_=npz.import_),
    }
    monkeypatch.setattr(api, "format_named", formats.__getitem__)
    with pytest.raises(RecordError, match="write-only files can only be exported"):
        import_from(folder, "write-only", tmp_path)
    with pytest.raises(RecordError, match="read-only files can only be imported"):
        export_to(folder, "read-only", tmp_path)


def test_files_do_not_overwrite_each_other_or_their_source(folder: Path, tmp_path: Path) -> None:
    for suffix in (".json", ".json.gz"):
        shutil.copy(folder / "000000.json", tmp_path / f"one{suffix}")
    result = export_to(tmp_path, "npz", tmp_path / "out")
    assert [path.name for path in result.files] == ["one.npz"]
    assert "already holds another episode" in str(result.refused[0])
    result = export_to(tmp_path / "one.json", "socnav3", tmp_path)
    assert "is the source" in str(result.refused[0])
    assert verify(tmp_path / "one.json") == []
    assert read_episode(tmp_path / "one.json").id == "000000"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit on the size of files")
def test_tables_that_do_not_fit_are_one_error_and_leave_nothing(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    line = ["export", str(folder), "--to", "parquet", "-o", str(tmp_path / "tables")]
    code = (
        "import resource, sys; from cli.main import main; resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000));"
        f"sys.argv[1:] = {line!r}; main()"
    )
    found = subprocess.run([sys.executable, "-B", "-c", code], capture_output=True, text=True, timeout=300)
    assert found.returncode == 1
    assert found.stderr.count("\n") == 1, found.stderr
    assert "cannot be written" in found.stderr
    assert "File too large" in found.stderr
    assert list((tmp_path / "tables").iterdir()) == []
