"""Replaying the commands of an episode file gives its bytes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import sonata2d as s2
from sonata2d.core.devices import DeviceEvent
from sonata2d.core.geometry import Twist
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.datasets import verify
from sonata2d.datasets.check.replay import branch, check_replay, check_rerun
from sonata2d.errors import RecordError
from sonata2d.record.reader import read_episode
from sonata2d.sim.driver import controller_info_of
from sonata2d.version import PHYSICS_VERSION


class Labelling(s2.StraightToGoal):
    """Labels every frame and stops after two seconds."""

    labels = {"tick": "number of the tick", "near": "a person is within 2 m"}  # noqa: RUF012

    def act(self, snapshot: Snapshot) -> s2.Twist | s2.Stop:  # type: ignore[override]
        return s2.Stop("two seconds are enough") if snapshot.tick == 20 else super().act(snapshot)

    def label(self, snapshot: Snapshot, twist: Twist) -> dict[str, object]:
        return {"tick": snapshot.tick, "near": s2.clearance(snapshot) < 2.0}


class Stick(s2.Controller):
    """Drives forward at the value of the last device event."""

    def reset(self, scene: Scene) -> None:
        self._value = 0.0

    def act(self, snapshot: Snapshot) -> Twist:
        self._value = snapshot.events[-1].value if snapshot.events else self._value
        return Twist(self._value)


class Failing(s2.Controller):
    """Divides by zero in tick 9."""

    def act(self, snapshot: Snapshot) -> Twist:
        return Twist(0.1 / (9 - snapshot.tick))


def recorded(path: Path, scene: Scene, controller: s2.Controller) -> Path:
    with s2.JsonRecorder(path, contributor="Ada", context="a test") as recorder:
        s2.Episode(scene, controller, observers=[recorder]).run()
    return path


@pytest.mark.parametrize("suffix", [".json", ".json.gz", ".json.zst"])
def test_a_generated_episode_replays_to_its_bytes(tmp_path: Path, suffix: str) -> None:
    scene = s2.generate(s2.ScenarioConfig(rules={"time_limit": 5.0}), seed=2, episode=3)
    path = recorded(tmp_path / f"one{suffix}", scene, s2.SocialPlanner())
    assert check_replay(read_episode(path)) == []
    assert check_rerun(read_episode(path)) == []


def test_a_stopped_episode_with_labels_in_a_hand_made_scene_replays(tmp_path: Path, busy: Scene) -> None:
    path = recorded(tmp_path / "one.json", busy, Labelling())
    assert read_episode(path).outcome.status == "stopped"
    assert check_replay(read_episode(path)) == []
    assert check_rerun(read_episode(path), f"{__name__}:Labelling") == []
    assert check_rerun(read_episode(path), "straight-to-goal") != []


def test_an_episode_that_an_error_ended_replays(tmp_path: Path, busy: Scene) -> None:
    with pytest.raises(ZeroDivisionError):
        recorded(tmp_path / "one.json", busy, Failing())
    record = read_episode(tmp_path / "one.json")
    assert (record.outcome.status, len(record)) == ("error", 9)
    assert check_replay(record) == []
    assert check_rerun(record, f"{__name__}:Failing") == []


def test_an_error_of_a_controller_that_runs_again_is_raised(tmp_path: Path, busy: Scene) -> None:
    """It is the recorded error only in an episode that an error ended."""
    path = recorded(tmp_path / "one.json", busy, Labelling())
    with pytest.raises(ZeroDivisionError):
        check_rerun(read_episode(path), f"{__name__}:Failing")


def test_device_events_are_recorded_and_replayed(tmp_path: Path, busy: Scene) -> None:
    with s2.JsonRecorder(tmp_path / "one.json") as recorder:
        episode = s2.Episode(replace(busy, rules=Rules(time_limit=1.0)), Stick(), observers=[recorder])
        episode.step()
        episode.step([DeviceEvent("pad", "left_y", 0.7)])
        episode.run()
    record = read_episode(tmp_path / "one.json")
    assert record.snapshot(1).events == (DeviceEvent("pad", "left_y", 0.7),)
    assert record.command[2, 0] == 0.7
    assert check_replay(read_episode(tmp_path / "one.json")) == []


def test_a_rerun_uses_the_device_events_and_the_past_of_a_branch(tmp_path: Path, busy: Scene) -> None:
    scene = replace(busy, rules=Rules(time_limit=2.0))
    with s2.JsonRecorder(tmp_path / "stick.json") as recorder:
        episode = s2.Episode(scene, Stick(), observers=[recorder])
        episode.step()
        episode.step([DeviceEvent("pad", "left_y", 0.7)])
        episode.run()
    assert check_rerun(read_episode(tmp_path / "stick.json"), f"{__name__}:Stick") == []
    with s2.JsonRecorder(tmp_path / "two.json", branched_from=("stick", 9)) as recorder:
        branch(tmp_path / "stick.json", 9, s2.SocialForce(), observers=[recorder]).run()
    assert check_rerun(read_episode(tmp_path / "two.json")) == []


def test_an_unknown_relation_is_reported_and_not_replayed(tmp_path: Path, busy: Scene) -> None:
    path = recorded(tmp_path / "one.json", busy, Labelling())
    path.write_text(path.read_text().replace('"interactions":[]', '"interactions":[[1,"nonsense",99]]', 1))
    problems = [str(problem) for problem in verify(path, replay=True)]
    assert any("nonsense of 1 and 99" in line for line in problems)
    assert not any("replay" in line for line in problems)


def test_a_changed_number_is_reported_with_its_line(tmp_path: Path, busy: Scene) -> None:
    path = recorded(tmp_path / "one.json", busy, Labelling())
    text = path.read_text()
    tenth = next(line for line in text.splitlines() if line.startswith('{"tick":10,'))
    x = json.loads(tenth.rstrip(","))["robot"][0]
    path.write_text(text.replace(f'"robot":[{x}', f'"robot":[{x + 0.0001:.4f}', 1))
    (problem,) = check_replay(read_episode(path))
    line = text.splitlines().index(tenth) + 1
    assert problem.message.startswith(f"line {line} differs: recorded …")
    assert f"[{x}" in problem.message.split("again")[1]


def test_an_edited_file_that_is_formatted_otherwise_is_compared_by_its_content(tmp_path: Path, busy: Scene) -> None:
    path = recorded(tmp_path / "a.json", busy, Labelling())
    document = json.loads(path.read_bytes())
    path.write_text(json.dumps(document, indent=1))
    assert [problem.message for problem in check_replay(read_episode(path))] == [
        "the content is the same, but the file is not formatted as sonata2d writes it"
    ]
    document["frames"][3]["robot"][0] += 0.5
    path.write_text(json.dumps(document, indent=1))
    (problem,) = check_replay(read_episode(path))
    assert f"{document['frames'][3]['robot'][0]:.4f}".rstrip("0") in problem.message


def test_a_scene_that_differs_from_seed_and_settings_is_reported(tmp_path: Path) -> None:
    scene = s2.generate(s2.ScenarioConfig(standing=2, rules={"time_limit": 1.0}), seed=2)
    path = recorded(tmp_path / "one.json", replace(scene, seed=3), s2.StraightToGoal())
    assert [problem.place for problem in check_replay(read_episode(path))] == ["scene"]


def test_a_file_of_another_physics_version_is_not_replayed(tmp_path: Path, busy: Scene) -> None:
    path = recorded(tmp_path / "one.json", busy, Labelling())
    path.write_text(path.read_text().replace(f'"physics":{PHYSICS_VERSION}', '"physics":99'))
    (problem,) = check_replay(read_episode(path))
    assert "physics version 99" in problem.message
    assert check_rerun(read_episode(path)) == [problem]
    with pytest.raises(RecordError, match="physics version 99"):
        branch(path, 0, s2.StraightToGoal())
    path.write_text(path.read_text().replace('"physics":99', '"physics":3'))
    (problem,) = check_replay(read_episode(path))
    assert problem.message.endswith("; sonata2d 0.3.0 is the last release that can")


def test_a_branch_from_a_file_equals_a_branch_from_the_episode(tmp_path: Path, busy: Scene) -> None:
    scene = replace(busy, rules=Rules(time_limit=3.0))
    with s2.JsonRecorder(tmp_path / "one.json") as recorder:
        episode = s2.Episode(scene, s2.StraightToGoal(), observers=[recorder])
        episode.run()
    from_file = branch(tmp_path / "one.json", 12, s2.SocialForce())
    from_memory = episode.branch(12, s2.SocialForce())
    from_file.run()
    from_memory.run()
    assert from_file.past == from_memory.past
    with pytest.raises(ValueError, match="the ticks in"):
        branch(tmp_path / "one.json", 99, s2.SocialForce())


def test_a_recorded_branch_replays_and_names_its_origin(tmp_path: Path, busy: Scene) -> None:
    scene = replace(busy, rules=Rules(time_limit=3.0))
    recorded(tmp_path / "one.json", scene, s2.StraightToGoal())
    with s2.JsonRecorder(tmp_path / "two.json", branched_from=("one", 12)) as recorder:
        branch(tmp_path / "one.json", 12, s2.SocialForce(), observers=[recorder]).run()
    assert read_episode(tmp_path / "two.json").document["branched_from"] == {"id": "one", "tick": 12}
    assert check_replay(read_episode(tmp_path / "two.json")) == []


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("./evil.py:Evil", {}),
        ("evil:Evil", {}),
        ("straight-to-goal+./evil.py:Evil", {}),
        ("evil:Evil+straight-to-goal", {}),
        ("./evil.npz", {}),
        ("graph-policy", {"weights": "/dev/zero", "sha256": "0"}),
        ("graph-policy+straight-to-goal", {"driver": {"weights": "/dev/zero"}, "labeller": {}}),
    ],
)
def test_code_and_weights_that_a_file_names_are_not_loaded(
    tmp_path: Path, busy: Scene, monkeypatch: pytest.MonkeyPatch, name: str, settings: dict[str, object]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "evil.py").write_text("open('was-run', 'w').close()")
    path = recorded(tmp_path / "run.json", busy, s2.StraightToGoal())
    document = json.loads(path.read_bytes())
    document["controller"] |= {"path": name, "settings": settings}
    path.write_text(json.dumps(document))
    (problem,) = check_rerun(read_episode(path))
    inner = "./evil.py:Evil' is" if "inner" in settings else f"the controller {name!r} is"
    assert f"{inner} neither built in nor a plug-in, and code that a file names is not run" in problem.message
    assert f"if you trust it, give --controller {name}" in problem.message
    assert not Path("was-run").exists()


def test_a_plug_in_that_is_not_installed_is_named(tmp_path: Path, busy: Scene) -> None:
    path = recorded(tmp_path / "run.json", busy, s2.StraightToGoal())
    document = json.loads(path.read_bytes())
    document["controller"]["path"] = "of-a-package"
    path.write_text(json.dumps(document))
    (problem,) = check_rerun(read_episode(path))
    assert problem.message == (
        "the controller 'of-a-package' is neither built in nor a plug-in of an installed package; install the package "
        "that provides it"
    )


@pytest.mark.parametrize("name", ["straight-to-goal", "sonata2d.agents.controllers.reactive:StraightToGoal"])
def test_built_in_controllers_are_run_again_by_all_their_names(tmp_path: Path, busy: Scene, name: str) -> None:
    path, controller = tmp_path / "run.json", s2.StraightToGoal()
    with s2.JsonRecorder(path) as recorder:
        info = controller_info_of(controller, name)
        s2.Episode(busy, controller, observers=[recorder], controller_info=info).run()
    assert check_rerun(read_episode(path)) == []
