"""Controllers by name: built-in ones, policies by their weights, and pairs of driver and labeller."""

from __future__ import annotations

import hashlib
import os
import py_compile
import re
import sys
from pathlib import Path

import pytest

from sonata2d.agents.controllers.human_like import HumanLike
from sonata2d.agents.controllers.labelled import Labelled
from sonata2d.agents.controllers.loading import load_controller, named_controllers, source_hashes
from sonata2d.agents.controllers.planner import SocialPlanner
from sonata2d.agents.controllers.reactive import StraightToGoal
from sonata2d.errors import ControllerError
from sonata2d.learning.policy import GraphPolicy

from ..learning.samples import weights_file

CONTROLLER_FILE = """\
from sonata2d import Controller, Twist


class Mine(Controller):
    def act(self, snapshot):
        return Twist(0.5)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with weights and controller files."""
    monkeypatch.chdir(tmp_path)
    weights_file(tmp_path / "policy.npz")
    weights_file(tmp_path / "a+b.npz", seed=1)
    (tmp_path / "x+y").mkdir()
    for path in ("x+y/mine+1.py", "mine.py"):
        (tmp_path / path).write_text(CONTROLLER_FILE)
    return tmp_path


def class_names(controller: object) -> list[str]:
    """The names of the classes, driver first."""
    if isinstance(controller, Labelled):
        return [*class_names(controller.driver), *class_names(controller.labeller)]
    return [type(controller).__name__]


def test_names_without_a_plus_load_single_controllers() -> None:
    assert named_controllers()["graph-policy"] is GraphPolicy
    assert isinstance(load_controller("graph-policy"), GraphPolicy)
    assert isinstance(load_controller("straight-to-goal"), StraightToGoal)
    assert isinstance(load_controller("sonata2d.agents:SocialPlanner"), SocialPlanner)


def test_a_policy_is_named_by_the_file_of_its_weights(folder: Path) -> None:
    for name in ("policy.npz", "./policy.npz", str(folder / "policy.npz"), "./a+b.npz"):
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
def test_a_plus_separates_driver_and_labeller_except_in_paths(folder: Path, name: str, classes: str) -> None:
    controller = load_controller(name)
    assert " ".join(class_names(controller)) == classes
    again = load_controller(name, dict(controller.settings()))
    assert class_names(again) == class_names(controller)
    assert dict(again.settings()) == dict(controller.settings())


def test_more_than_two_controllers_are_rejected() -> None:
    with pytest.raises(ControllerError, match="names more than two controllers"):
        load_controller("graph-policy+straight-to-goal+social-planner")


def test_recorded_settings_apply_to_both_controllers_of_a_pair() -> None:
    recorded = Labelled(HumanLike(delay=0.4), SocialPlanner()).settings()
    pair = load_controller("human-like+social-planner", dict(recorded))
    assert pair.settings()["driver"]["delay"] == 0.4


@pytest.mark.parametrize(
    ("name", "message", "note"),
    [
        (
            "graph-policy+unknown",
            "no controller is named 'unknown'",
            "in 'graph-policy+unknown', which is driver+labeller",
        ),
        ("unknown+social-planner", "no controller is named 'unknown'", "in 'unknown+social-planner'"),
        ("graph-policy+./none.npz", "none.npz cannot be read: No such file", "in 'graph-policy+./none.npz'"),
        ("graph-policy+./none.py:X", "controller file ./none.py does not exist", "in 'graph-policy+./none.py:X'"),
        ("graph-polcy", "did you mean 'graph-policy'?", None),
        ("graph-policy+", "no controller is named 'graph-policy+'", None),
        ("+social-planner", "no controller is named '+social-planner'", None),
        ("./none.npz", "none.npz cannot be read", None),
    ],
)
def test_errors_name_the_part_that_is_unknown(folder: Path, name: str, message: str, note: str | None) -> None:
    with pytest.raises(ControllerError, match=re.escape(message)) as caught:
        load_controller(name)
    notes = getattr(caught.value, "__notes__", [])
    assert notes == [] if note is None else note in notes[0]


def test_weights_that_changed_since_the_recording_are_rejected(folder: Path) -> None:
    recorded = load_controller("./policy.npz").settings()
    weights_file(folder / "policy.npz", seed=2)
    other = GraphPolicy().settings() | {"sha256": "0" * 64}
    for name, settings in (("./policy.npz", recorded), ("graph-policy", other)):
        with pytest.raises(ControllerError, match=r"^(./policy.npz|graph-policy) has other weights now"):
            load_controller(name, settings)


@pytest.mark.parametrize(
    ("classes", "found"),
    [
        (["First"], None),
        (["First", "Second"], "one.py defines First, Second; name one Controller class, as in ./one.py:Name"),
        ([], "one.py defines no Controller class; name one Controller class"),
    ],
)
def test_the_only_controller_class_of_a_file_needs_no_name(folder: Path, classes: list[str], found: str | None) -> None:
    body = "(s2.Controller):\n    def act(self, snapshot):\n        return s2.Twist()\n"
    text = "import sonata2d as s2\nfrom sonata2d import StraightToGoal\n" + "".join(f"class {n}{body}" for n in classes)
    (folder / "one.py").write_text(text)
    if found is None:
        assert type(load_controller("./one.py")).__name__ == "First"
        assert type(load_controller("straight-to-goal+./one.py")).__name__ == "Labelled"
        return
    with pytest.raises(ControllerError, match=re.escape(found)):
        load_controller("./one.py")


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (
            "class One(Controller):\n    def step(self, snapshot): ...\n",
            "One is a Controller class without the method act",
        ),
        ("class One:\n    def act(self, snapshot): ...\n", "One is not a Controller class; write"),
    ],
)
@pytest.mark.parametrize("name", ["./one.py", "./one.py:One"])
def test_a_class_that_is_no_controller_is_explained(folder: Path, name: str, code: str, message: str) -> None:
    (folder / "one.py").write_text(f"from sonata2d import Controller\n{code}")
    with pytest.raises(ControllerError, match=message):
        load_controller(name)


def test_the_source_of_a_controller_is_hashed_and_that_of_sonata2d_is_not(folder: Path) -> None:
    def hashes(name: str) -> dict[str, str]:
        return source_hashes(name, load_controller(name))

    sha256 = hashlib.sha256((folder / "mine.py").read_bytes()).hexdigest()
    assert hashes("./mine.py:Mine") == {"./mine.py:Mine": sha256}
    assert hashes("./mine.py") == {"./mine.py": sha256}
    assert hashes("social-planner") == hashes("policy.npz") == {}
    assert hashes("orca+./mine.py:Mine") == {"./mine.py:Mine": sha256}
    (folder / "front.py").write_text("from tests.agents.test_loading import Elsewhere\n")
    assert hashes("./front.py:Elsewhere") == {
        "./front.py:Elsewhere": hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
    }


class Elsewhere(StraightToGoal):
    """A controller that another file imports."""


def test_a_file_that_is_changed_within_a_second_is_the_one_that_is_hashed(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Byte code that Python stores is taken for up to date if the time in seconds and the size are equal."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    py_compile.compile("mine.py")
    time, changed = (folder / "mine.py").stat().st_mtime, CONTROLLER_FILE.replace("0.5", "0.4")
    (folder / "mine.py").write_text(changed)
    os.utime(folder / "mine.py", (time, time))
    controller = load_controller("./mine.py:Mine")
    assert controller.act(None).vx == 0.4  # type: ignore[arg-type]
    assert source_hashes("./mine.py:Mine", controller) == {
        "./mine.py:Mine": hashlib.sha256(changed.encode()).hexdigest()
    }
