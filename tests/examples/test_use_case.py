"""The use case's data and loader: what the expert drove and what people drove come out alike, with their images."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pygame
import pytest

from sonata2d.collect.session import Session
from sonata2d.datasets.generate import generate_dataset
from sonata2d.datasets.manifest import read_manifest
from sonata2d.datasets.mirror import twist_image
from sonata2d.datasets.split import split_dataset
from sonata2d.errors import RecordError
from sonata2d.learning.graph.modern import INPUTS
from sonata2d.learning.graph.paper import FEATURES
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.load import load_scenario
from sonata2d.window.collect_screen import CollectScreen
from sonata2d.window.input import InputDevices
from tests.window.volunteer import Person

QUICK = load_scenario("sonata-2020").changed(rules={"time_limit": 4.0})
USE_CASE = Path(__file__).parent.parent.parent / "examples" / "use_case"


@pytest.fixture(scope="module")
def modules() -> Iterator[dict[str, ModuleType]]:
    """What of the use case needs no PyTorch."""
    sys.path.insert(0, str(USE_CASE))
    names = ("data", "samples")
    yield {name: importlib.import_module(name) for name in names}
    sys.path.remove(str(USE_CASE))
    for name in names:
        del sys.modules[name]


@pytest.fixture(scope="module")
def by_hand(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Two runs that a person drove with keys and kept."""
    folder = tmp_path_factory.mktemp("by-hand") / "kim"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SONATA2D_CONFIG", str(folder.parent / "config"))

        def screen() -> CollectScreen:
            devices = InputDevices()
            nonlocal session
            session = Session(folder, "kim", load_scenario("sonata-2020"), mappings=devices.mappings)
            return CollectScreen(session, devices, runs=2)

        session: Any = None
        person = Person(screen, (900, 700))
        while session.kept < 2:
            person.drive(session)
            person.press(pygame.K_RETURN if session.outcome.status == "goal" else pygame.K_BACKSPACE)
        person.press(pygame.K_q, mod=pygame.KMOD_CTRL)
        pygame.quit()
        yield folder


@pytest.fixture(scope="module")
def made(modules: dict[str, ModuleType], by_hand: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six runs of the expert, two of a person, and their images."""
    out = tmp_path_factory.mktemp("runs")
    return modules["data"].make(out, "social-planner", 6, 11, 1, (by_hand,))  # type: ignore[no-any-return]


def test_a_persons_runs_join_the_experts_with_their_images(made: Path) -> None:
    manifest = read_manifest(made)
    names = [row["name"] for row in manifest["files"]]
    assert len(names) == 2 * (6 + 2)
    assert sum(name.startswith("kim") for name in names) == 2 * 2
    split = manifest["split"]
    part = {name: part for part, listed in split.items() for name in listed}
    assert sorted(part) == sorted(names)
    scenes: dict[tuple[int, int], set[str]] = {}
    for name in names:
        record = read_episode(made / name)
        assert record.outcome.status == "goal"
        scenes.setdefault((record.seed, record.episode), set()).add(part[name])
    assert all(len(parts) == 1 for parts in scenes.values())
    assert (made / "README.md").exists()


@pytest.mark.parametrize(("kind", "width", "fewer"), [("paper", len(FEATURES), 1), ("modern", len(INPUTS), 0)])
def test_the_loader_gives_a_sample_for_every_second(
    modules: dict[str, ModuleType], made: Path, kind: str, width: int, fewer: int
) -> None:
    samples = modules["samples"].samples_of(made, kind, workers=1)
    records = [read_episode(made / row["name"]) for row in read_manifest(made)["files"]]
    assert len(samples) == sum((len(record) - 1) // 10 + 1 - fewer for record in records)
    assert samples.x.shape == (samples.nodes.sum(), width)
    assert samples.edges.shape == (2, samples.ties.sum())
    assert (np.abs(samples.y) <= 1.0 + 1e-3).all()
    assert samples.y.any(axis=0).all()
    (cache,) = (made.parent / "cache").glob(f"data-{kind}-*.npz")
    held = dict(np.load(cache))
    np.savez(cache, **held | {"y": held["y"] + 1})
    assert np.array_equal(modules["samples"].samples_of(made, kind, workers=1).y, samples.y + 1)
    cache.unlink()


def test_images_are_samples_with_left_and_right_changed(modules: dict[str, ModuleType], made: Path) -> None:
    samples = modules["samples"].samples_of(made, "modern", workers=1)
    half = len(samples) // 2  # originals first, then their images
    assert samples.y[half:] == pytest.approx(samples.y[:half] * [1, -1, -1], abs=1e-6)


@pytest.mark.parametrize("image", [twist_image, None])
def test_what_an_expert_says_of_a_learner_is_the_label_and_mirrored_with_it(
    modules: dict[str, ModuleType], tmp_path: Path, image: Any
) -> None:
    generate_dataset(tmp_path / "driven", QUICK, "straight-to-goal+social-planner", episodes=2, seed=5)
    modules["data"].with_mirrors([tmp_path / "driven"], tmp_path / "met", image)
    samples = modules["samples"].samples_of(tmp_path / "met", "modern", workers=1)
    record = read_episode(tmp_path / "driven" / "000000.json")
    limits = record.scene().robot.limits
    told = json.loads((tmp_path / "driven" / "000000.json").read_text())["frames"][10]
    assert told["label"] != told["command"]
    assert samples.y[1] == pytest.approx(
        np.array(told["label"]) / [limits.ahead, limits.sideways, limits.turn], abs=1e-6
    )
    half = len(samples) // 2
    assert samples.y[half:] == pytest.approx(samples.y[:half] * [1, -1, -1], abs=1e-6)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cache", "driven", "met"]


def test_data_sets_of_one_name_join(modules: dict[str, ModuleType], tmp_path: Path) -> None:
    for seed in (1, 2):
        generate_dataset(tmp_path / str(seed) / "kim", QUICK, "straight-to-goal", episodes=1, seed=seed)
    modules["data"].with_mirrors([tmp_path / "1" / "kim", tmp_path / "2" / "kim"], tmp_path / "both")
    assert len(read_manifest(tmp_path / "both")["files"]) == 4


def test_a_folder_that_was_not_made_here_is_not_removed(modules: dict[str, ModuleType], tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "precious.txt").write_text("mine")
    with pytest.raises(RecordError, match="is not a data set"):
        modules["data"].make(tmp_path, "straight-to-goal", 1, 1, 1)
    generate_dataset(tmp_path / "mine" / "data", QUICK, "straight-to-goal", episodes=1)
    with pytest.raises(RecordError, match="was not made here; name another folder by -o"):
        modules["data"].make(tmp_path / "mine", "straight-to-goal", 1, 1, 1)
    assert (tmp_path / "data" / "precious.txt").exists()
    assert read_manifest(tmp_path / "mine" / "data")["complete"]


def test_another_split_is_told_so(modules: dict[str, ModuleType], tmp_path: Path) -> None:
    generate_dataset(tmp_path / "runs", QUICK, "straight-to-goal", episodes=2)
    split_dataset(tmp_path / "runs", {"train": 0.5, "val": 0.5})
    with pytest.raises(ValueError, match="has a part 'val'; split it again, into train, dev, test"):
        modules["samples"].samples_of(tmp_path / "runs", "modern", workers=1)
