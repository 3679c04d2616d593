"""`generate_dataset` with classes and objects as controllers, also those of a notebook, in one process and in two."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

import sonata2d as s2
from sonata2d.datasets.check.replay import check_replay
from sonata2d.datasets.manifest import read_stored_manifest
from sonata2d.errors import ControllerError
from sonata2d.record.reader import read_episode

from .test_generate import contents

SHORT = s2.ScenarioConfig(name="short", humans=2, rules={"time_limit": 2.0})
EPISODES = 8


class Ahead(s2.Controller):
    """Drives ahead; counts the frames of an episode in its labels."""

    version = "1"
    labels = {"count": "frames so far"}  # noqa: RUF012

    def __init__(self, speed: float = 0.5) -> None:
        self.speed, self.count = speed, 0

    def settings(self) -> dict[str, Any]:
        return {"speed": self.speed}

    def reset(self, scene: s2.Scene) -> None:
        self.count = 0

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        self.count += 1
        return s2.Twist(vx=self.speed)

    def label(self, snapshot: s2.Snapshot, twist: s2.Twist) -> Any:
        return {"count": self.count}


class Locked(Ahead):
    """Cannot be sent to other processes."""

    def __init__(self) -> None:
        super().__init__()
        self.lock = threading.Lock()


@pytest.mark.usefixtures("kept_processes")
@pytest.mark.parametrize(("controller", "speed"), [(Ahead, 0.5), (Ahead(0.3), 0.3)])
def test_classes_and_objects_give_the_same_bytes_in_one_process_and_in_two(
    controller: Any, speed: float, tmp_path: Path
) -> None:
    for workers in (1, 2):
        out = tmp_path / str(workers)
        dataset = s2.generate_dataset(out, SHORT, controller, episodes=EPISODES, workers=workers)
        assert len(dataset) == EPISODES
        assert dataset.manifest == read_stored_manifest(out)
    assert contents(tmp_path / "1") == contents(tmp_path / "2")
    record = dataset[3]
    assert record.controller_info.path == "tests.datasets.test_given_controllers:Ahead"
    assert record.controller_info.settings == {"speed": speed}
    assert [label["count"] for label in record.labels] == list(range(1, len(record) + 1))
    assert record.command[:, 0].max() == speed
    assert check_replay(read_episode(record.path)) == []


NOTEBOOK = """
import sonata2d as s2

class Shy(s2.Controller):
    version = "1"
    def act(self, snapshot):
        return s2.Twist(vx=0.2 * helper(snapshot))

def helper(snapshot):
    return 2.0

if __name__ == "__main__":
    with s2.Workers(2) as workers:
        for name, controller in (("class", Shy), ("object", Shy())):
            dataset = s2.generate_dataset(name, "empty", controller, episodes=6, workers=workers)
            print(dataset, dataset[0].controller_info.path, dataset[0].command[0, 0])
"""


@pytest.mark.parametrize("kind", ["script", "notebook"])
def test_classes_of_scripts_and_notebooks_are_sent_with_their_code(kind: str, tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(NOTEBOOK)
    words = ["script.py"] if kind == "script" else ["-c", NOTEBOOK]
    result = subprocess.run(
        [sys.executable, *words], cwd=tmp_path, capture_output=True, text=True, timeout=200, check=False
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines() == [
        f"<Dataset {name}: 6 episodes> __main__:Shy 0.4" for name in ("class", "object")
    ]
    assert contents(tmp_path / "class") == contents(tmp_path / "object")


def test_an_object_that_cannot_be_sent_works_in_one_process(tmp_path: Path) -> None:
    assert len(s2.generate_dataset(tmp_path / "one", SHORT, Locked(), episodes=2)) == 2
    with pytest.raises(ControllerError, match=r"Locked cannot be sent to other processes: .*lock.*; use one worker"):
        s2.generate_dataset(tmp_path / "two", SHORT, Locked(), episodes=6, workers=2)


def test_other_things_are_no_controllers(tmp_path: Path) -> None:
    for wrong, message in ((3, "got 3"), (dict, "dict is not a Controller class"), (s2.Controller, "method act")):
        with pytest.raises(TypeError, match=message):
            s2.generate_dataset(tmp_path / "out", SHORT, wrong)  # type: ignore[arg-type]
    assert not (tmp_path / "out").exists()


def test_a_script_without_guard_is_told_so_in_one_error(tmp_path: Path) -> None:
    script = "import sonata2d as s2\ns2.generate_dataset('out', 'empty', episodes=6, workers=2)\n"
    (tmp_path / "script.py").write_text(script)
    result = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=200, check=False
    )
    assert result.returncode == 1
    assert result.stderr.count("Traceback") == 1
    assert "put the lines that start it below if __name__ == '__main__':" in result.stderr
