"""`npz` and `parquet`: nothing is lost."""

from __future__ import annotations

import builtins
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonata2d.datasets.check import check_episode
from sonata2d.datasets.replay import check_replay
from sonata2d.errors import RecordError
from sonata2d.formats import npz
from sonata2d.formats import parquet as tables
from sonata2d.formats.api import export_to, import_from
from sonata2d.formats.base import Options
from sonata2d.record.files import read_bytes
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.record.recorder import JsonRecorder

from ..record import samples as by_hand
from ..record.conftest import episode  # noqa: F401


@pytest.fixture
def with_gaps(tmp_path: Path) -> Path:
    """An episode with labels, contacts, events, and somebody who is not always there."""
    path = tmp_path / "in" / "gaps.json"
    with JsonRecorder(path) as recorder:
        by_hand.run(recorder, labels=lambda tick: {"near": tick % 2 == 0})
    document = json.loads(path.read_bytes())
    for look in (document["frames"][2], document["final"]):
        look["humans"][1], look["activity"][1] = None, -1
    path.write_text(json.dumps(document))
    return path


def same(first: Path, second: Path) -> bool:
    return bool(json.loads(read_bytes(first)) == json.loads(read_bytes(second)))


@pytest.mark.parametrize("format", ["npz", "parquet"])
def test_a_folder_reads_back_to_the_byte(folder: Path, tmp_path: Path, format: str) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow", reason="pyarrow comes with the parquet extra")
    assert export_to(folder, format, tmp_path / "out").refused == []
    done = import_from(tmp_path / "out", format, tmp_path / "back")
    assert (len(done.files), done.refused) == (20, [])
    for path in done.files:
        assert path.read_bytes() == (folder / path.name).read_bytes()
    assert check_replay(done.files[3]) == []


@pytest.mark.parametrize("format", ["npz", "parquet"])
def test_gaps_labels_contacts_and_events_survive(with_gaps: Path, tmp_path: Path, format: str) -> None:
    if format == "parquet":
        pytest.importorskip("pyarrow", reason="pyarrow comes with the parquet extra")
    assert export_to(with_gaps, format, tmp_path / "out").refused == []
    (back,) = import_from(tmp_path / "out", format, tmp_path / "back").files
    assert same(with_gaps, back)


def test_numpy_alone_reads_npz(records: list[EpisodeRecord], tmp_path: Path) -> None:
    record, path = records[0], tmp_path / "one.npz"
    path.write_bytes(npz.export(record, Options()))
    assert npz.export(record, Options()) == path.read_bytes(), "the same bytes each time"
    with np.load(path) as arrays:
        assert (arrays["humans"] == record.looks.humans).all()
        assert arrays["command"].shape == (len(record), 3)
        assert json.loads(str(arrays["header"]))["seed"] == record.seed


def test_an_array_that_claims_more_than_there_is_is_refused(tmp_path: Path) -> None:
    import io
    import zipfile

    path = tmp_path / "large.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for name in (*npz._ARRAYS, "human_id", "header", "told"):
            head = io.BytesIO()
            np.lib.format.write_array_header_1_0(
                head, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 10**6)}
            )
            archive.writestr(f"{name}.npy", head.getvalue())
    with pytest.raises(RecordError, match="which is not what follows"):
        list(npz.import_(path, Options()))


def test_tables_join_in_pandas_and_polars(folder: Path, records: list[EpisodeRecord], tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow comes with the parquet extra")
    pd = pytest.importorskip("pandas", reason="pandas is not installed")
    pl = pytest.importorskip("polars", reason="polars is not installed")
    export_to(folder, "parquet", tmp_path)
    people = sum(int(record.looks.present.sum()) for record in records)
    read = {name: pd.read_parquet(tmp_path / f"{name}.parquet") for name in tables.TABLES}
    joined = read["agents"].merge(read["frames"], on=["episode_id", "tick"], suffixes=("", "_frame"))
    assert len(joined.merge(read["episodes"], on="episode_id")) == people
    ties = read["interactions"].merge(
        read["agents"], left_on=["episode_id", "tick", "src"], right_on=["episode_id", "tick", "human_id"]
    )
    assert len(ties) == len(read["interactions"]) > 0
    frames = pl.read_parquet(tmp_path / "frames.parquet")
    agents = pl.read_parquet(tmp_path / "agents.parquet")
    assert agents.join(frames, on=["episode_id", "tick"]).height == people
    one = joined[(joined.episode_id == "000004") & (joined.tick == 7)]
    assert one[["x", "y", "head"]].to_numpy().tolist() == records[4].looks.humans[7][:, [0, 1, 6]].tolist()


def test_the_tables_load_as_a_data_set(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow comes with the parquet extra")
    monkeypatch.setenv("HF_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets", reason="datasets is not installed")
    export_to(folder, "parquet", tmp_path / "out")
    loaded = datasets.load_dataset(str(tmp_path / "out"), "episodes", cache_dir=str(tmp_path / "cache"))
    assert loaded["train"].num_rows == 20


def test_without_pyarrow_one_line_says_what_to_install(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    load = builtins.__import__

    def refuse(name: str, *given: Any, **more: Any) -> Any:
        if name.startswith("pyarrow"):
            raise ImportError(name)
        return load(name, *given, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(RecordError, match=r"parquet needs pyarrow: pip install 'sonata2d\[parquet\]'"):
        export_to(folder, "parquet", tmp_path)


def test_episodes_that_share_a_name_do_not_overwrite_each_other(folder: Path, tmp_path: Path) -> None:
    import shutil

    for kind in (".json", ".json.gz"):
        shutil.copy(folder / "000000.json", tmp_path / f"one{kind}")
    done = export_to(tmp_path, "npz", tmp_path / "out")
    assert [path.name for path in done.files] == ["one.npz"]
    assert "holds another episode already" in done.refused[0]
    done = export_to(tmp_path / "one.json", "socnav3", tmp_path)
    assert "is what is read" in done.refused[0]
    assert check_episode(tmp_path / "one.json") == []
    assert read_episode(tmp_path / "one.json").id == "000000"


def test_nothing_of_a_person_or_a_label_is_lost(episode: Path, tmp_path: Path) -> None:  # noqa: F811
    for format in ("npz", "socnav3"):
        out = tmp_path / format
        assert export_to(episode, format, out).refused == []
        (back,) = import_from(out, format, tmp_path / f"{format}-back").files
        assert same(episode, back)
