"""Data sets of learned controllers: generated, labelled, mirrored and verified."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ..learning.samples import weights_file
from .conftest import Run

GENERATE = "generate out --scenario quick.yaml --episodes 2 --workers 1 --no-picture --controller "


@pytest.mark.parametrize(
    "name", ["graph-policy", "./my+net.npz", "graph-policy+social-planner", "./my+net.npz+straight-to-goal"]
)
def test_data_set_of_a_learned_controller_is_reproducible(sonata2d: Run, here: Path, name: str) -> None:
    weights_file(here / "my+net.npz", "modern", "gatv2", seed=3)
    sonata2d(GENERATE + name)
    line = "check out --replay --rerun --workers 1"
    if "net.npz" in name:  # weights that a file names are not loaded
        assert "is neither built in nor a plug-in" in sonata2d(line, 1).output
        line += f" --controller {name}"
    assert "2 files checked, replayed, rerun, no problems" in sonata2d(line).output
    episode = json.loads((here / "out/000000.json").read_text())
    assert episode["controller"]["path"] == name
    assert ("label" in episode["frames"][0]) is ("social-planner" in name or "straight" in name)


def test_number_of_workers_does_not_change_the_bytes(sonata2d: Run, here: Path) -> None:
    sonata2d(GENERATE + "graph-policy")
    sonata2d(GENERATE.replace("out", "two").replace("--workers 1", "--workers 2") + "graph-policy")
    for name in ("000000.json", "000001.json"):
        assert (here / "out" / name).read_bytes() == (here / "two" / name).read_bytes()


def test_rerun_refuses_other_weights(sonata2d: Run, here: Path) -> None:
    weights_file(here / "net.npz", seed=1)
    sonata2d(GENERATE + "./net.npz")
    weights_file(here / "net.npz", seed=2)
    assert "no problems" in sonata2d("check out --replay --workers 1").output
    assert (
        "./net.npz has other weights now than when the episode was recorded"
        in sonata2d("check out --rerun --controller ./net.npz --workers 1", 1).output
    )


@pytest.mark.parametrize("labeller", ["", "+straight-to-goal"])
def test_moved_weights_can_be_given_to_check(sonata2d: Run, here: Path, labeller: str) -> None:
    weights_file(here / "net.npz", seed=1).with_name("elsewhere").mkdir()
    sonata2d(GENERATE + "./net.npz" + labeller)
    (here / "net.npz").rename(here / "elsewhere/same.npz")
    assert "net.npz cannot be read" in sonata2d(f"check out --controller ./net.npz{labeller} --workers 1", 1).output
    assert "no problems" in sonata2d(f"check out --controller elsewhere/same.npz{labeller} --workers 1").output


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("./none.npz", "ControllerError: the weights"),
        (
            "./bad.npz",
            "bad.npz does not hold weights of a graph policy: layer0.bias holds 33; weights must be within ±32",
        ),
        ("graph-policy+nobody", "named 'nobody'"),
    ],
)
def test_invalid_weights_give_a_one_line_message(sonata2d: Run, here: Path, name: str, message: str) -> None:
    import numpy as np

    from ..learning.samples import random_weights

    arrays = dict(random_weights().arrays) | {"layer0.bias": np.full(12, 33.0)}
    np.savez(here / "bad.npz", about=np.array(json.dumps({"graph": "paper", "kind": "rgcn", "note": {}})), **arrays)
    output = sonata2d(GENERATE + name, 1).output
    assert message in output
    assert output.count("\n") == 1
    assert not (here / "out").exists()


def test_twist_labels_are_mirrored_twice_to_the_same_bytes(sonata2d: Run, here: Path) -> None:
    sonata2d(GENERATE + "straight-to-goal+social-planner")
    sonata2d("mirror out -o twin --labels twist")
    one, twin = (
        json.loads((here / name).read_text())["frames"] for name in ("out/000001.json", "twin/000001-mirror.json")
    )
    assert [[x, -y, -w] for x, y, w in (frame["label"] for frame in one)] == [frame["label"] for frame in twin]
    assert any(frame["label"][2] for frame in one)
    assert "no problems" in sonata2d("check twin --replay --workers 1").output
    sonata2d("mirror twin -o back --labels twist")
    assert (here / "back/000001.json").read_bytes() == (here / "out/000001.json").read_bytes()
    assert "labels were mirrored: mirror them again" in sonata2d("mirror twin -o lost", 1).output
    sonata2d("mirror out -o plain")
    assert (
        "labels were not mirrored: do not mirror them now" in sonata2d("mirror plain -o lost --labels twist", 1).output
    )
    assert not (here / "lost").exists()


def test_help_says_how_controllers_are_named(sonata2d: Run) -> None:
    for word in ("generate", "evaluate", "view", "scenarios check"):
        output = " ".join(sonata2d(f"{word} --help").output.split())
        assert "package.module:Class, ./file.py:Class, ./weights.npz, or driver+labeller" in output


def test_controllers_list_contains_the_learned_one(sonata2d: Run) -> None:
    assert "graph-policy" in {row["name"] for row in json.loads(sonata2d("controllers --json").output)}
