"""Controllers by name: learned ones by their weights, and two as driver and labeller."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sonata2d.agents.controllers.human_like import HumanLike
from sonata2d.agents.controllers.labelled import Labelled
from sonata2d.agents.controllers.loading import load_controller, named_controllers
from sonata2d.agents.controllers.planner import SocialPlanner
from sonata2d.agents.controllers.reactive import StraightToGoal
from sonata2d.errors import ControllerError
from sonata2d.learning.policy import GraphPolicy

from ..learning.samples import weights_file

MINE = """\
from sonata2d import Controller, Twist


class Mine(Controller):
    def act(self, snapshot):
        return Twist(0.5)
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    weights_file(tmp_path / "policy.npz")
    weights_file(tmp_path / "a+b.npz", seed=1)
    (tmp_path / "x+y").mkdir()
    for path in ("x+y/mine+1.py", "mine.py"):
        (tmp_path / path).write_text(MINE)
    return tmp_path


def parts(controller: object) -> list[str]:
    """The names of the classes, driver first."""
    if isinstance(controller, Labelled):
        return [*parts(controller._driver), *parts(controller._labeller)]
    return [type(controller).__name__]


def test_the_learned_controller_is_a_stock_one() -> None:
    assert named_controllers()["graph-policy"] is GraphPolicy
    assert isinstance(load_controller("graph-policy"), GraphPolicy)


def test_weights_are_named_by_their_file(here: Path) -> None:
    for name in ("policy.npz", "./policy.npz", str(here / "policy.npz"), "./a+b.npz"):
        controller = load_controller(name)
        assert isinstance(controller, GraphPolicy)
        assert controller.settings()["weights"] == name
        assert load_controller(name, controller.settings()).settings() == controller.settings()


@pytest.mark.parametrize(
    ("name", "classes"),
    [
        ("straight-to-goal+social-planner", "StraightToGoal SocialPlanner"),
        ("graph-policy+social-planner", "GraphPolicy SocialPlanner"),
        ("./policy.npz+social-planner", "GraphPolicy SocialPlanner"),
        ("./a+b.npz+social-planner", "GraphPolicy SocialPlanner"),
        ("social-planner+./a+b.npz", "SocialPlanner GraphPolicy"),
        ("./a+b.npz+./a+b.npz", "GraphPolicy GraphPolicy"),
        ("./mine.py:Mine+social-planner", "Mine SocialPlanner"),
        ("./x+y/mine+1.py:Mine", "Mine"),
        ("./x+y/mine+1.py:Mine+social-planner", "Mine SocialPlanner"),
        ("social-planner+./x+y/mine+1.py:Mine", "SocialPlanner Mine"),
        ("human-like+sonata2d.agents:SocialPlanner", "HumanLike SocialPlanner"),
    ],
)
def test_a_plus_parts_driver_and_labeller_but_not_a_files_path(here: Path, name: str, classes: str) -> None:
    controller = load_controller(name)
    assert " ".join(parts(controller)) == classes
    again = load_controller(name, dict(controller.settings()))
    assert parts(again) == parts(controller)
    assert dict(again.settings()) == dict(controller.settings())


def test_there_is_no_third_beside_driver_and_labeller() -> None:
    with pytest.raises(ControllerError, match="there is no third"):
        load_controller("graph-policy+straight-to-goal+social-planner")


def test_halves_are_set_as_a_file_tells() -> None:
    told = Labelled(HumanLike(delay=0.4), SocialPlanner()).settings()
    pair = load_controller("human-like+social-planner", dict(told))
    assert pair.settings()["driver"]["delay"] == 0.4


@pytest.mark.parametrize(
    ("name", "message", "note"),
    [
        (
            "graph-policy+nobody",
            "no controller is named 'nobody'",
            "in 'graph-policy+nobody', which is driver+labeller",
        ),
        ("nobody+social-planner", "no controller is named 'nobody'", "in 'nobody+social-planner'"),
        ("graph-policy+./none.npz", "none.npz cannot be read: No such file", "in 'graph-policy+./none.npz'"),
        ("graph-policy+./none.py:X", "controller file ./none.py does not exist", "in 'graph-policy+./none.py:X'"),
        ("graph-polcy", "did you mean 'graph-policy'?", None),
        ("graph-policy+", "no controller is named 'graph-policy+'", None),
        ("+social-planner", "no controller is named '+social-planner'", None),
        ("./none.npz", "none.npz cannot be read", None),
    ],
)
def test_an_unknown_part_is_named(here: Path, name: str, message: str, note: str | None) -> None:
    with pytest.raises(ControllerError, match=re.escape(message)) as caught:
        load_controller(name)
    notes = getattr(caught.value, "__notes__", [])
    assert notes == [] if note is None else note in notes[0]


def test_other_weights_than_those_that_drove_are_told_as_that(here: Path) -> None:
    settings = load_controller("./policy.npz").settings()
    weights_file(here / "policy.npz", seed=2)
    for name, told in (("./policy.npz", settings), ("graph-policy", GraphPolicy().settings() | {"sha256": "0" * 64})):
        with pytest.raises(ControllerError, match=r"^(./policy.npz|graph-policy) has other weights now"):
            load_controller(name, told)


def test_names_without_a_plus_are_what_they_were() -> None:
    assert isinstance(load_controller("straight-to-goal"), StraightToGoal)
    assert isinstance(load_controller("sonata2d.agents:SocialPlanner"), SocialPlanner)
