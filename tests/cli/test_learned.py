"""Data sets of learned controllers, made, labelled, mirrored and proven as a person would."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ..learning.samples import weights_file
from .conftest import Run

MAKE = "generate out --scenario quick.yaml --episodes 2 --workers 1 --no-picture --controller "


@pytest.mark.parametrize(
    "name", ["graph-policy", "./my+net.npz", "graph-policy+social-planner", "./my+net.npz+straight-to-goal"]
)
def test_a_learned_controllers_data_set_proves_itself(sonata2d: Run, here: Path, name: str) -> None:
    weights_file(here / "my+net.npz", "modern", "gatv2", seed=3)
    sonata2d(MAKE + name)
    assert "2 files checked, replayed, rerun, no problems" in sonata2d("check out --replay --rerun --workers 1").output
    told = json.loads((here / "out/000000.json").read_text())
    assert told["controller"]["path"] == name
    assert ("label" in told["frames"][0]) is ("social-planner" in name or "straight" in name)


def test_the_same_weights_give_the_same_bytes_from_two_processes(sonata2d: Run, here: Path) -> None:
    sonata2d(MAKE + "graph-policy")
    sonata2d(MAKE.replace("out", "two").replace("--workers 1", "--workers 2") + "graph-policy")
    for name in ("000000.json", "000001.json"):
        assert (here / "out" / name).read_bytes() == (here / "two" / name).read_bytes()


def test_other_weights_than_those_that_drove_are_refused(sonata2d: Run, here: Path) -> None:
    weights_file(here / "net.npz", seed=1)
    sonata2d(MAKE + "./net.npz")
    weights_file(here / "net.npz", seed=2)
    assert "no problems" in sonata2d("check out --replay --workers 1").output
    assert (
        "./net.npz has other weights now than those that drove" in sonata2d("check out --rerun --workers 1", 1).output
    )


@pytest.mark.parametrize("labeller", ["", "+straight-to-goal"])
def test_weights_that_were_moved_are_named_anew(sonata2d: Run, here: Path, labeller: str) -> None:
    weights_file(here / "net.npz", seed=1).with_name("elsewhere").mkdir()
    sonata2d(MAKE + "./net.npz" + labeller)
    (here / "net.npz").rename(here / "elsewhere/same.npz")
    assert "net.npz cannot be read" in sonata2d("check out --rerun --workers 1", 1).output
    assert "no problems" in sonata2d(f"check out --controller elsewhere/same.npz{labeller} --workers 1").output


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("./none.npz", "ControllerError: the weights"),
        ("./bad.npz", "bad.npz holds no weights of a graph policy: layer0.bias holds 33; weights are within ±32"),
        ("graph-policy+nobody", "named 'nobody'"),
    ],
)
def test_what_cannot_drive_is_told_in_one_line(sonata2d: Run, here: Path, name: str, message: str) -> None:
    import numpy as np

    from ..learning.samples import drawn

    arrays = dict(drawn().arrays) | {"layer0.bias": np.full(12, 33.0)}
    np.savez(here / "bad.npz", about=np.array(json.dumps({"graph": "paper", "kind": "rgcn", "note": {}})), **arrays)
    output = sonata2d(MAKE + name, 1).output
    assert message in output
    assert output.count("\n") == 1
    assert not (here / "out").exists()


def test_twist_labels_are_mirrored_and_back(sonata2d: Run, here: Path) -> None:
    sonata2d(MAKE + "straight-to-goal+social-planner")
    sonata2d("mirror out -o twin --labels twist")
    one, twin = (
        json.loads((here / name).read_text())["frames"] for name in ("out/000001.json", "twin/000001-mirror.json")
    )
    assert [[x, -y, -w] for x, y, w in (frame["label"] for frame in one)] == [frame["label"] for frame in twin]
    assert any(frame["label"][2] for frame in one)
    assert "no problems" in sonata2d("check twin --replay --workers 1").output
    sonata2d("mirror twin -o back --labels twist")
    assert (here / "back/000001.json").read_bytes() == (here / "out/000001.json").read_bytes()
    assert "labels were mirrored: mirror them too" in sonata2d("mirror twin -o lost", 1).output
    sonata2d("mirror out -o plain")
    assert "labels stayed: let them stay again" in sonata2d("mirror plain -o lost --labels twist", 1).output
    assert not (here / "lost").exists()


def test_the_help_says_how_a_controller_is_named(sonata2d: Run) -> None:
    for word in ("generate", "evaluate", "view", "scenarios check"):
        told = " ".join(sonata2d(f"{word} --help").output.split())
        assert "module:Class, ./file.py:Class, weights ./policy.npz, or two: driver+labeller" in told


def test_the_list_of_controllers_has_the_learned_one(sonata2d: Run) -> None:
    assert "graph-policy" in {row["name"] for row in json.loads(sonata2d("controllers list --json").output)}
