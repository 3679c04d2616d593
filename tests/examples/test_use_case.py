"""Data set, loader and imports of the use case, as far as they need no PyTorch."""

from __future__ import annotations

import ast
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

from sonata2d import generate_dataset, load_scenario, read_episode
from sonata2d.collect.session import Session
from sonata2d.datasets import read_manifest, split_dataset, twist_image
from sonata2d.errors import RecordError
from sonata2d.learning import INPUTS
from sonata2d.learning.graph import FEATURES
from sonata2d.window.collect_screen import CollectScreen
from sonata2d.window.input import InputDevices
from tests.window.volunteer import Person

QUICK = load_scenario("sonata-2020").changed(rules={"time_limit": 4.0})
USE_CASE = Path(__file__).parent.parent.parent / "examples" / "use_case"


@pytest.fixture(scope="module")
def modules() -> Iterator[dict[str, ModuleType]]:
    """The modules of the use case that need no PyTorch."""
    sys.path.insert(0, str(USE_CASE))
    names = ("data", "samples")
    yield {name: importlib.import_module(name) for name in names}
    sys.path.remove(str(USE_CASE))
    for name in names:
        del sys.modules[name]


@pytest.fixture(scope="module")
def human_runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A data set of two runs that a simulated person drove with the keyboard and kept."""
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
def dataset(modules: dict[str, ModuleType], human_runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six runs of the expert, two of a person, and their mirror images."""
    out = tmp_path_factory.mktemp("runs")
    return modules["data"].make_dataset(out, "social-planner", 6, 11, 1, (human_runs,))  # type: ignore[no-any-return]


def test_added_human_runs_are_mirrored_and_split_by_scene(dataset: Path) -> None:
    manifest = read_manifest(dataset)
    names = [row["name"] for row in manifest["files"]]
    assert len(names) == 2 * (6 + 2)
    assert sum(name.startswith("kim") for name in names) == 2 * 2
    split = manifest["split"]
    part = {name: part for part, listed in split.items() for name in listed}
    assert sorted(part) == sorted(names)
    scenes: dict[tuple[int, int], set[str]] = {}
    for name in names:
        record = read_episode(dataset / name)
        assert record.outcome.status == "goal"
        scenes.setdefault((record.seed, record.episode), set()).add(part[name])
    assert all(len(parts) == 1 for parts in scenes.values())
    assert (dataset / "README.md").exists()


@pytest.mark.parametrize(("kind", "width", "missing"), [("paper", len(FEATURES), 1), ("modern", len(INPUTS), 0)])
def test_loader_gives_one_sample_per_second_and_caches_them(
    modules: dict[str, ModuleType], dataset: Path, kind: str, width: int, missing: int
) -> None:
    samples = modules["samples"].load_samples(dataset, kind, workers=1)
    records = [read_episode(dataset / row["name"]) for row in read_manifest(dataset)["files"]]
    assert len(samples) == sum((len(record) - 1) // 10 + 1 - missing for record in records)
    assert samples.x.shape == (samples.node_count.sum(), width)
    assert samples.edges.shape == (2, samples.edge_count.sum())
    assert (np.abs(samples.y) <= 1.0 + 1e-3).all()
    assert samples.y.any(axis=0).all()
    (cache,) = (dataset.parent / "cache").glob(f"data-{kind}-*.npz")
    cached = dict(np.load(cache))
    np.savez(cache, **cached | {"y": cached["y"] + 1})
    assert np.array_equal(modules["samples"].load_samples(dataset, kind, workers=1).y, samples.y + 1)
    cache.unlink()


def test_mirrored_samples_have_left_and_right_exchanged(modules: dict[str, ModuleType], dataset: Path) -> None:
    samples = modules["samples"].load_samples(dataset, "modern", workers=1)
    half = len(samples) // 2  # originals first, then their mirror images
    assert samples.y[half:] == pytest.approx(samples.y[:half] * [1, -1, -1], abs=1e-6)


@pytest.mark.parametrize("image", [twist_image, None])
def test_commands_of_the_labelling_expert_are_the_wanted_outputs_and_are_mirrored(
    modules: dict[str, ModuleType], tmp_path: Path, image: Any
) -> None:
    generate_dataset(tmp_path / "driven", QUICK, "straight-to-goal+social-planner", episodes=2, seed=5)
    modules["data"].add_mirror_images([tmp_path / "driven"], tmp_path / "met", image)
    samples = modules["samples"].load_samples(tmp_path / "met", "modern", workers=1)
    record = read_episode(tmp_path / "driven" / "000000.json")
    limits = record.scene().robot.limits
    frame = json.loads((tmp_path / "driven" / "000000.json").read_text())["frames"][10]
    assert frame["label"] != frame["command"]
    assert samples.y[1] == pytest.approx(
        np.array(frame["label"]) / [limits.ahead, limits.sideways, limits.turn], abs=1e-6
    )
    half = len(samples) // 2
    assert samples.y[half:] == pytest.approx(samples.y[:half] * [1, -1, -1], abs=1e-6)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cache", "driven", "met"]


def test_data_sets_of_the_same_name_are_merged(modules: dict[str, ModuleType], tmp_path: Path) -> None:
    for seed in (1, 2):
        generate_dataset(tmp_path / str(seed) / "kim", QUICK, "straight-to-goal", episodes=1, seed=seed)
    modules["data"].add_mirror_images([tmp_path / "1" / "kim", tmp_path / "2" / "kim"], tmp_path / "both")
    assert len(read_manifest(tmp_path / "both")["files"]) == 4


def test_foreign_output_folder_is_refused_and_kept(modules: dict[str, ModuleType], tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "precious.txt").write_text("mine")
    with pytest.raises(RecordError, match="is not a data set"):
        modules["data"].make_dataset(tmp_path, "straight-to-goal", 1, 1, 1)
    generate_dataset(tmp_path / "mine" / "data", QUICK, "straight-to-goal", episodes=1)
    with pytest.raises(RecordError, match="was not made by this script; choose another output folder with -o"):
        modules["data"].make_dataset(tmp_path / "mine", "straight-to-goal", 1, 1, 1)
    assert (tmp_path / "data" / "precious.txt").exists()
    assert read_manifest(tmp_path / "mine" / "data")["complete"]


def test_unknown_part_of_a_split_is_an_error(modules: dict[str, ModuleType], tmp_path: Path) -> None:
    generate_dataset(tmp_path / "runs", QUICK, "straight-to-goal", episodes=2)
    split_dataset(tmp_path / "runs", {"train": 0.5, "val": 0.5})
    with pytest.raises(ValueError, match="has a part 'val'; split it again, into train, dev, test"):
        modules["samples"].load_samples(tmp_path / "runs", "modern", workers=1)


@pytest.mark.parametrize("name", sorted(path.name for path in USE_CASE.iterdir() if path.suffix in (".py", ".ipynb")))
def test_imported_names_exist(name: str) -> None:
    """Holds for the notebook and for scripts that need PyTorch as well: they are parsed, not run."""
    for statement in ast.walk(parsed(USE_CASE / name)):
        if not isinstance(statement, ast.ImportFrom) or statement.module is None:
            continue
        imported = {alias.name for alias in statement.names}
        if statement.module.split(".")[0] == "sonata2d":
            module = importlib.import_module(statement.module)
            assert all(hasattr(module, name) for name in imported), ast.unparse(statement)
        elif (script := USE_CASE / f"{statement.module}.py").exists():
            assert imported <= defined_names(parsed(script)), ast.unparse(statement)


def parsed(path: Path) -> ast.Module:
    """The syntax tree of a script, or of the code cells of a notebook."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = json.loads(text)["cells"]
        text = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    return ast.parse(text)


def defined_names(module: ast.Module) -> set[str]:
    """The functions, classes and variables that are defined at the top of a module."""
    definitions = {node.name for node in module.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    targets = (node.target if isinstance(node, ast.AnnAssign) else node.targets[0] for node in module.body
               if isinstance(node, (ast.Assign, ast.AnnAssign)))  # fmt: skip
    return definitions | {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}
