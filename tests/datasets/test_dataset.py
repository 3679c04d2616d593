"""`Dataset`: the episodes of a folder as a sequence."""

from __future__ import annotations

import math
import shutil
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

import sonata2d as s2
from sonata2d.core.furniture_types import OBJECT_TYPES
from sonata2d.core.geometry import Disc
from sonata2d.core.relations import RELATIONS
from sonata2d.errors import RecordError, RenderError

COUNT = 6


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A compressed data set in which some episodes end at the goal and others at the time limit."""
    out = tmp_path_factory.mktemp("dataset") / "runs"
    config = s2.load_scenario("lively").changed(rules={"time_limit": 5.0})
    s2.generate_dataset(out, config, "straight-to-goal", episodes=COUNT, suffix=".json.zst")
    return out


@pytest.fixture
def dataset(folder: Path) -> s2.Dataset:
    return s2.Dataset(folder)


def test_it_is_the_sequence_of_the_episodes(folder: Path, dataset: s2.Dataset) -> None:
    assert len(dataset) == COUNT
    assert [record.episode for record in dataset] == list(range(COUNT))
    assert (dataset[2].id, dataset[-1].id, dataset[np.int64(1)].id) == ("000002", "000005", "000001")
    assert dataset["000003"].episode == dataset["000003.json.zst"].episode == 3
    part = dataset[1:4]
    assert isinstance(part, s2.Dataset)
    assert [record.episode for record in part] == [1, 2, 3]
    assert part[0].episode == 1
    assert [record.episode for record in s2.Dataset(folder / "000004.json.zst")] == [4]
    assert repr(part) == f"<Dataset {folder}: 3 episodes>"


def test_nothing_is_read_before_it_is_accessed(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    (copy / "000002.json.zst").write_bytes(b"damaged")
    dataset = s2.Dataset(copy)
    assert len(dataset.filter(outcome=["goal", "timeout"])) == COUNT
    assert dataset[1].episode == 1
    with pytest.raises(RecordError, match="000002"):
        dataset[2]


def test_filters_are_the_same_with_and_without_a_manifest(folder: Path, dataset: s2.Dataset, tmp_path: Path) -> None:
    bare = tmp_path / "bare"
    bare.mkdir()
    for file in folder.glob("*.zst"):
        shutil.copy(file, bare)
    other = s2.Dataset(bare)
    assert other.manifest is None
    outcomes = [record.outcome.status for record in dataset]
    assert len(set(outcomes)) == 2
    for outcome in ("goal", "timeout"):
        expected = [k for k, found in enumerate(outcomes) if found == outcome]
        for one in (dataset, other):
            assert [record.episode for record in one.filter(outcome=outcome)] == expected
    family = dataset[0].family
    expected = [record.episode for record in dataset if record.family == family and len(record) > 20]
    for one in (dataset, other):
        assert [r.episode for r in one.filter(lambda record: len(record) > 20, family=family)] == expected
    assert len(dataset.filter(outcome="goal").filter(outcome="timeout")) == 0


def test_parts_are_those_of_the_manifest(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    dataset = s2.Dataset(copy)
    with pytest.raises(RecordError, match=r"is not split; call split\(\)"):
        _ = dataset.parts
    parts = dataset.split({"train": 2, "test": 1}, seed=3)
    assert sorted(record.episode for part in parts.values() for record in part) == list(range(COUNT))
    again = s2.Dataset(copy).parts
    assert {name: part.files for name, part in again.items()} == {name: part.files for name, part in parts.items()}
    assert len(again["test"]) == 2
    assert all(file in again["train"].files for file in dataset[:3].parts["train"].files)


def test_tables_hold_the_arrays_of_the_records(dataset: s2.Dataset) -> None:
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    frames = dataset.to_pandas()
    assert isinstance(frames, pandas.DataFrame)
    assert len(frames) == sum(len(record) + 1 for record in dataset)
    own = frames[frames["episode_id"] == "000002"]
    np.testing.assert_array_equal(own["robot_x"], dataset[2].states.robot[:, 0])
    np.testing.assert_array_equal(own["command_vx"][:-1], dataset[2].command[:, 0])
    for name in ("episodes", "frames", "agents", "interactions"):
        table = dataset.to_polars(name)
        assert isinstance(table, polars.DataFrame)
        assert table.shape == dataset.to_pandas(name).shape
    assert dataset.to_polars("episodes")["outcome"].to_list() == [record.outcome.status for record in dataset]
    people = dataset.to_pandas("agents")
    assert len(people) == sum(int(record.states.present.sum()) for record in dataset)
    assert dataset[:0].to_pandas().empty
    with pytest.raises(ValueError, match="no table 'walls'; the tables are episodes"):
        dataset.to_pandas("walls")


def test_a_package_that_is_missing_is_named(dataset: s2.Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(RecordError, match="needs polars, which is not installed; pip install polars"):
        dataset.to_polars()


def test_tensors_are_those_of_the_records(dataset: s2.Dataset) -> None:
    torch = pytest.importorskip("torch")
    loader = torch.utils.data.DataLoader(dataset.to_torch(), batch_size=None, shuffle=True)
    found = {item["index"]: item for item in loader}
    assert sorted(found) == list(range(COUNT))
    np.testing.assert_array_equal(found[2]["humans"].numpy(), dataset[2].humans)
    np.testing.assert_array_equal(found[2]["command"].numpy(), dataset[2].command)


def test_tensors_hold_all_that_behaviour_cloning_needs(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    config = s2.load_scenario("lively").changed(rules={"time_limit": 3.0})
    runs = s2.generate_dataset(tmp_path, config, Labelling(), episodes=3, seed=5)
    data = runs.to_torch()
    for k, record in enumerate(runs):
        item, scene = data[k], record.scene()
        assert item["goal"].tolist() == [scene.goal.x, scene.goal.y, scene.goal.theta]
        assert item["walls"].tolist() == [[*wall.start, *wall.end] for wall in scene.walls]
        assert item["sizes"].tolist() == [[human.radius, human.breadth] for human in scene.humans]
        for row, number, piece in zip(item["objects"].tolist(), item["object_types"], scene.furniture, strict=True):
            assert row[:3] == [piece.pose.x, piece.pose.y, piece.pose.theta]
            assert OBJECT_TYPES[number] == piece.type
            shape = piece.shape
            is_disc = isinstance(shape, Disc)
            assert row[3:] == ([2 * shape.radius] * 2 + [1.0] if is_disc else [shape.length, shape.width, 0.0])  # type: ignore[union-attr]
        ids = [*(human.id for human in scene.humans), *(piece.id for piece in scene.furniture)]
        links = [(t, ids[a], RELATIONS[r], ids[b]) for t, a, r, b in item["interactions"].tolist()]
        frames = record.document["frames"]
        assert links == [(t, *row) for t, frame in enumerate(frames) for row in frame["interactions"]]
        assert links
        np.testing.assert_array_equal(item["executed"].numpy(), record.executed)
        np.testing.assert_array_equal(item["label.near"].numpy(), [frame["label"]["near"] for frame in frames])
        assert item["label.twist"].tolist() == [frame["label"]["twist"] for frame in frames]
        assert item.keys().isdisjoint({"label.word", "label.uneven", "label.longer"})
        np.testing.assert_array_equal(
            item["label.even.t"].numpy(), [(math.nan, 1.0)[k % 2] for k in range(len(frames))]
        )
    batch = next(iter(torch.utils.data.DataLoader(data, batch_size=3, collate_fn=data.collate)))
    assert batch["frames"].tolist() == [len(record) for record in runs]
    for k, record in enumerate(runs):
        count, people = record.humans.shape[:2]
        np.testing.assert_array_equal(batch["humans"][k, :count, :people].numpy(), record.humans)
        assert batch["humans"][k, count:].isnan().all()
        assert not batch["present"][k, :, people:].any()
        assert (batch["activity"][k, :, people:] == -1).all()
    assert batch["index"].tolist() == [0, 1, 2]


class Labelling(s2.StraightToGoal):
    def label(self, snapshot: s2.Snapshot, twist: s2.Twist) -> dict[str, Any]:
        label = {"near": s2.clearance(snapshot) < 1.0, "twist": [twist.vx, twist.vy, twist.omega], "word": "x"}
        return {
            **label,
            "uneven": [[1], [1, 2]],
            "longer": [1] * (1 + snapshot.tick),
            "even": {"t": snapshot.tick % 2} if snapshot.tick % 2 else {},
        }


def test_pictures(dataset: s2.Dataset, tmp_path: Path) -> None:
    dataset.save(tmp_path / "all.png")
    dataset.save(tmp_path / "two.png", count=2)
    with Image.open(tmp_path / "all.png") as sheet, Image.open(tmp_path / "two.png") as two:
        assert sheet.height > two.height  # two rows instead of one
    with pytest.raises(RenderError, match=r"end the name in one of \.png, \.gif, \.mp4, \.html, \.svg"):
        dataset.save(tmp_path / "all.jpg")
    with pytest.raises(RenderError, match="fps and speed have an effect on films only"):
        dataset.save(tmp_path / "all.png", fps=5)
    with pytest.raises(RenderError, match="at least one scene or episode"):
        dataset[:0].save(tmp_path / "none.png")
    text = dataset._repr_html_()
    assert text.count("<img") == 4
    goals = sum(record.outcome.status == "goal" for record in dataset)
    assert f"{goals} goal" in text
    assert dataset[:0]._repr_html_().count("<img") == 0


@pytest.mark.parametrize(
    ("index", "error", "message"),
    [
        (COUNT, IndexError, "the numbers are 0 to 5"),
        ("00002", KeyError, "did you mean '000002'"),
        (1.5, TypeError, "a number, the name of a file, or a slice, got 1.5"),
    ],
)
def test_wrong_indices_are_named(dataset: s2.Dataset, index: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        dataset[index]
    with pytest.raises(IndexError, match="it is empty"):
        dataset[:0][0]


def test_a_folder_without_episodes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="holds no episode files"):
        s2.Dataset(tmp_path)
    with pytest.raises(RecordError, match="does not exist"):
        s2.Dataset(tmp_path / "none")


def test_a_film_ends_with_the_longest_episode(dataset: s2.Dataset, tmp_path: Path) -> None:
    seen = {}

    @contextmanager
    def bar(total: int, unit: str) -> Any:
        yield lambda steps: seen.update({total: seen.get(total, 0) + steps})

    dataset.save(tmp_path / "all.gif", count=3, fps=5, speed=2.0, progress=bar)
    longest = max(record.outcome.time for record in dataset[:3])
    states = sum(len(record) + 1 for record in dataset[:3])
    assert seen == {states: states}
    with Image.open(tmp_path / "all.gif") as film:
        duration = sum(film.seek(k) or film.info["duration"] for k in range(film.n_frames)) / 1000
        assert duration == pytest.approx(longest / 2.0 + 1.5, abs=0.6)
        film.seek(film.n_frames - 1)
        last = np.asarray(film.convert("RGB"))
    assert len(np.unique(last.reshape(-1, 3), axis=0)) > 50


def test_vectors_and_pages_hold_each_episode(dataset: s2.Dataset, tmp_path: Path) -> None:
    dataset.save(tmp_path / "all.svg", count=3)
    root = ElementTree.parse(tmp_path / "all.svg").getroot()
    parts = [part for part in root if part.tag.endswith("}svg")]
    assert len(parts) == 3
    assert all(len(list(part.iter())) > 20 for part in parts)
    dataset.save(tmp_path / "all.html", count=3)
    text = (tmp_path / "all.html").read_text()
    assert text.count("<img") == 3  # one in each button
    assert text.count('<script type="application/json">') == 3  # the data of the episodes
    assert "000002" in text


def test_a_page_opens_in_the_browser(dataset: s2.Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda url: bool(opened.append(url)) or True)
    dataset.animate(count=2)
    assert opened[0].endswith(".html")


def test_episodes_are_filtered_by_contact(tmp_path: Path) -> None:
    class Ahead(s2.Controller):
        def act(self, snapshot: s2.Snapshot) -> s2.Twist:
            return s2.Twist(vx=1.0)

    config = s2.ScenarioConfig(name="full", humans=8, rules={"time_limit": 6.0})
    dataset = s2.generate_dataset(tmp_path / "full", config, Ahead, episodes=6)
    touching, others = dataset.filter(contact=True), dataset.filter(contact=False)
    assert len(touching) + len(others) == 6
    assert len(touching) > 0
    assert all(record.counts()["contacts"] for record in touching)
    assert not any(record.counts()["contacts"] for record in others)
    (dataset.path / "manifest.json").unlink()  # the files are read instead
    assert s2.Dataset(dataset.path).filter(contact=True).files == touching.files
    assert f"in {len(touching)} of 6 episodes" in dataset._repr_html_()
    assert "<th" in touching[0]._repr_html_()
    assert "contacts</th><td" in touching[0]._repr_html_()


def test_pictures_of_a_table_have_captions(dataset: s2.Dataset) -> None:
    assert f"<small>000000: {dataset[0].outcome.status}</small>" in dataset._repr_html_()


def test_a_condition_is_a_function(dataset: s2.Dataset) -> None:
    with pytest.raises(TypeError, match=r"got 'goal'; write outcome=\.\.\. or family=\.\.\."):
        dataset.filter("goal")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no episode has the outcome 'gaol'; outcomes are goal, "):
        dataset.filter(outcome="gaol")
    with pytest.raises(ValueError, match="count must be 1 or more, got 0"):
        dataset.show(count=0)
