"""`check` finds problems of files and data sets, and states their place."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from sonata2d_cli import main

import sonata2d as s2
from sonata2d.datasets import Problem, verify, write_card
from sonata2d.errors import DatasetWarning, RecordError

from ..record.test_reader import rewrite, set_value
from .test_manifest import dataset_in, spec


def test_a_recorded_episode_has_no_problems(episode: Path) -> None:
    assert verify(episode) == []


def _move(frames: slice, human: int, x: float, y: float) -> Callable[[Any], None]:
    """A change of a document: the human at (x, y) in some frames."""

    def change(document: Any) -> None:
        for frame in [*document["frames"], document["final"]][frames]:
            frame["humans"][human][0:2] = x, y

    return change


@pytest.mark.parametrize(
    ("change", "place", "message"),
    [
        (set_value("goal", "distance", "near"), "goal.distance", "valid number"),
        (set_value("seed", 1.5), "seed", "integer"),
        (set_value("outcome", "status", "won"), "outcome.status", "'goal'"),
        (set_value("frames", 2, "contacts", [{"kind": "doors"}]), "frames.2.contacts.0.kind", "'human'"),
        (set_value("frames", 2, "robot", 0, -0.90001), "frames.2.robot", "not rounded"),
        (set_value("frames", 2, "robot", 1, -0.0), "frames.2.robot", "-0.0"),
        (set_value("frames", 2, "humans", 0, 2, 3.2), "frames.2.humans", "angle is out of range"),
        (set_value("objects", 0, "id", 1), "ids", "id 1 is used 2 times"),
        (set_value("humans", 0, "id", 0), "ids", "id 0 is used 2 times"),
        (set_value("groups", 0, "members", [2, 3, 9]), "groups", "member 9 of group 5 is not a human"),
        (set_value("humans", 0, "group", 5), "humans", "human 1 names group 5 but is not a member"),
        (set_value("objects", 1, "on", 77), "objects", "object 11 lies on 77"),
        (set_value("frames", 3, "tick", 4), "frames.3", "tick should be 3, is 4"),
        (set_value("frames", 3, "time", 0.4), "frames.3", "time should be 0.3000 s, is 0.4 s"),
        (set_value("frames", 3, "activity", 0, 8), "frames.3.activity.0", "8 is not in the list"),
        (set_value("frames", 3, "interactions", [[9, "a", 1]]), "frames.3.interactions", "a of 9 and 1"),
        (set_value("frames", 3, "executed", [2.0, 0.0, 0.0]), "frames.3.executed", "1.007 m/s faster"),
        (set_value("frames", 3, "executed", [0.5, 0.0, 3.0]), "frames.3.executed", "rad/s of turning"),
        (set_value("frames", 3, "humans", 0, 3, 5.0), "frames.3.humans", "human 1 is 2.310 m/s faster"),
        (_move(slice(3, 4), 1, -2.5, -2.0), "frames.2.humans", "human 2 is 2.685 m/s of motion"),
        (set_value("frames", 3, "robot", 0, -0.6), "frames.2.robot", "the robot is 1.528 m/s of motion"),
        (set_value("frames", 3, "robot", 2, 0.5), "frames.2.robot", "rad turned"),
        (_move(slice(0, 7), 1, 9.0, 0.0), "frames.0", "human 2 is outside the room (7 cases"),
        (set_value("frames", 3, "robot", 1, 9.0), "frames.3", "the robot is outside"),
        (_move(slice(0, 7), 0, 3.9, 0.0), "frames.0.walls", "human 1 is 0.065 m too deep in a wall (the worst of 7"),
        (_move(slice(0, 7), 0, 3.85, 0.0), "frames.0.walls", "human 1 is 0.015 m too deep in a wall"),  # a shoulder is
        (_move(slice(0, 7), 0, 2.0, 3.0), "frames.0.objects", "human 1 is 0.540 m too deep in table 10"),
        (_move(slice(0, 7), 0, -3.5, 3.2), "frames.0.objects", "human 1 is 0.040 m too deep in plant 12"),
        (_move(slice(0, 7), 0, -1.0, 0.3), "frames.0.humans", "human 1 is 0.140 m too deep in the robot"),
        (set_value("outcome", "tick", 5), "outcome", "is of tick 5 at 0.6 s, but there are 6 frames"),
        (set_value("outcome", "status", "goal"), "outcome", "3.300 m or rad were missing"),
        (set_value("goal", "x", -1.0), "outcome", "the goal was reached at tick 0"),
        (set_value("outcome", "status", "timeout"), "outcome", "the limit is 20.0 s"),
        (set_value("outcome", "status", "contact"), "outcome", "the final state has none"),
    ],
)
def test_an_edited_episode_is_found(episode: Path, change: Callable[[Any], None], place: str, message: str) -> None:
    problems = verify(rewrite(episode, change))
    assert any(place in problem.place and message in problem.message for problem in problems), problems


@pytest.fixture
def unicycle_file(tmp_path: Path) -> Path:
    """A unicycle drives in a bend and then against a wall."""
    config = s2.ScenarioConfig(
        humans=0,
        tables=0,
        plants=0,
        robot={"kinematics": "unicycle"},
        rules={"ends_on": ["time"], "time_limit": 8.0},
    )
    path = tmp_path / "unicycle.json"
    with s2.JsonRecorder(path) as recorder:
        s2.Episode(s2.generate(config, seed=2), Bend(), observers=[recorder]).run()
    return path


class Bend(s2.Controller):
    """Drives a bend for 2 s and then straight on."""

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist(vx=1.0, omega=1.5 if snapshot.tick < 20 else 0.0)


def _sideways(frame: int, distance: float, speed: float) -> Callable[[Any], None]:
    """A change of a document: the robot to the left of where it was, or with a velocity to its left, in a frame."""

    def change(document: Any) -> None:
        robot = document["frames"][frame]["robot"]
        c, s = math.cos(robot[2]), math.sin(robot[2])
        for column, value in ((0, -s * distance), (1, c * distance), (3, -s * speed), (4, c * speed)):
            robot[column] = round(robot[column] + value, 4) + 0.0

    return change


def test_a_unicycle_that_slips_is_found(unicycle_file: Path) -> None:
    recorded = unicycle_file.read_bytes()
    assert any(contact["kind"] == "wall" for contact in json.loads(recorded)["final"]["contacts"])
    assert verify(unicycle_file) == []

    def problems_after(change: Callable[[Any], None]) -> str:
        unicycle_file.write_bytes(recorded)
        return _text(verify(rewrite(unicycle_file, change)))

    for frame in (10, 30, 50):  # in the bend, straight on, at the wall
        text = problems_after(_sideways(frame, 0.002, 0.0))
        found = re.findall(r"frames\.(\d+)\.robot: the robot, a unicycle, is 0\.002 m off its heading", text)
        assert found in ([str(frame - 1)], [str(frame)])  # the tick before the frame, or the one after it
        assert re.search(r"is 0\.00[12] m from where its drive led", text)
        text = problems_after(_sideways(frame, 0.0, 0.02))
        assert f"frames.{frame}.robot: the robot, a unicycle, is 0.020 m/s fast sideways" in text
    text = problems_after(set_value("frames", 30, "executed", [0.0, 0.1, 0.0]))
    assert "frames.30.executed: the robot, a unicycle, is 0.100 m/s fast sideways" in text

    def imported(document: Any) -> None:
        _sideways(30, 0.002, 0.02)(document)
        document["physics"] = 0

    assert "unicycle" not in problems_after(imported)


class Dash(s2.Controller):
    """Drives at full speed towards the nearest person, turns, and reverses every four ticks."""

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        pose, limits = snapshot.robot.pose, snapshot.scene.robot.limits
        places = [pose.to_local(human.pose.position) for human in snapshot.humans]
        x, y = min(places, key=lambda place: math.hypot(*place))
        scale = (-1.0 if snapshot.tick % 8 >= 4 else 1.0) / math.hypot(x, y)
        return s2.Twist(vx=limits.ahead * x * scale, vy=limits.sideways * y * scale, omega=limits.turn)


_STRONG = {"ahead": 8.0, "back": 8.0, "sideways": 8.0, "acceleration": 100.0, "turn": 1.0, "turn_acceleration": 100.0}
_FAST = {"mean": 6.0, "min": 4.0, "max": 8.0}


@pytest.mark.parametrize("guard", [True, False])
@pytest.mark.parametrize(
    ("limits", "rules", "settings"),
    [
        ({}, {}, {}),
        ({"turn": 50.0}, {}, {}),
        ({"ahead": 0.8, "back": 0.8, "sideways": 0.8}, {"substeps": 3}, {}),
        ({}, {"dt": 0.5, "substeps": 125, "time_limit": 50.0}, {}),
        ({}, {"dt": 1e-4, "time_limit": 0.02}, {}),
        ({}, {}, {"person": {"desired_speed": _FAST}}),
        ({}, {}, {"people": [{"x": -4, "y": 0, "velocity": [12, 0], "goals": [[4, 0]]}]}),
    ],
)
def test_an_episode_of_extreme_settings_has_no_problems(
    tmp_path: Path, limits: dict[str, float], rules: dict[str, float], settings: dict[str, Any], guard: bool
) -> None:
    assert verify(_dashed(tmp_path, _STRONG | limits, {"guard": guard} | rules, settings)) == []


def _dashed(folder: Path, limits: dict[str, float], rules: dict[str, Any], settings: dict[str, Any]) -> Path:
    """An episode in which `Dash` drives among 30 people for 6 s."""
    # without guard the robot may move 0.05 m in a physics step
    substeps = 10 if rules.get("guard", True) else 25
    rules = {"time_limit": 6.0, "ends_on": ["time"], "substeps": substeps} | rules
    config = s2.load_scenario("crowded-hall").changed(robot={"limits": limits}, rules=rules, **settings)
    path = folder / "episode.json"
    with s2.JsonRecorder(path) as recorder:
        s2.Episode(s2.generate(config, seed=0), Dash(), observers=[recorder]).run()
    return path


def test_edits_of_an_episode_with_a_strong_drive_are_found(tmp_path: Path) -> None:
    path = _dashed(tmp_path, _STRONG, {}, {})
    record, recorded = s2.read_episode(path), path.read_bytes()
    for frame in (int(record.guarded.argmin()) + 1, int(record.guarded.argmax()) + 1):
        x, vx = (float(record.states.robot[frame, column]) for column in (0, 3))
        path.write_bytes(recorded)
        moved = verify(rewrite(path, set_value("frames", frame, "robot", 0, round(x + 0.2, 4))))
        assert re.search(rf"frames\.({frame - 1}|{frame})\.robot: .* m from where its drive led", _text(moved))
        path.write_bytes(recorded)
        fast = verify(rewrite(path, set_value("frames", frame, "robot", 3, round(vx + 30.0, 4))))
        assert re.search(rf"frames\.{frame}\.robot: the robot is \d+\.\d+ m/s too fast", _text(fast))


def test_steps_that_are_too_long_are_refused() -> None:
    """At 1.3 times 1.8 m/s people move 0.234 m in 0.1 s, more than 0.13 m, half the depth of the smallest body."""
    hall = s2.load_scenario("crowded-hall")
    with pytest.raises(s2.errors.ConfigError, match=r"up to 2\.34 m/s they move 0\.23 m, .* rules\.substeps to 9,"):
        hall.changed(rules={"dt": 0.5, "substeps": 5})
    hall.changed(rules={"dt": 0.5, "substeps": 9})
    runs = {"people": [{"x": -4, "y": 0, "velocity": [20, 0], "goals": [[4, 0]]}]}
    with pytest.raises(s2.errors.ConfigError, match=r"up to 20 m/s they move 0\.2 m, .* rules\.substeps to 16,"):
        hall.changed(**runs, rules={"substeps": 10})
    hall.changed(**runs, rules={"substeps": 16})
    hall.changed(**runs, rules={"substeps": 10}, person={"radius": 0.2})
    with pytest.raises(s2.errors.ConfigError, match=r"rules\.dt: .* lower rules\.dt to 0\.5 or less"):
        hall.changed(rules={"dt": 0.51, "substeps": 100})
    empty = s2.load_scenario("empty")
    empty.changed(rules={"dt": 1.0})  # nobody walks
    with pytest.raises(s2.errors.ConfigError, match=r"it turns 1\.02 rad: raise rules\.substeps to 11, or"):
        empty.changed(robot={"limits": {"turn": 10.2}}, rules={"dt": 1.0, "substeps": 10})
    empty.changed(robot={"limits": {"turn": 10.0}}, rules={"dt": 1.0, "substeps": 10})


def test_an_unreadable_file_is_one_problem(tmp_path: Path) -> None:
    (tmp_path / "odd.json").write_text("{")
    (problem,) = verify(tmp_path / "odd.json")
    assert (problem.file, problem.place) == ("odd.json", "file")
    assert str(problem).startswith("odd.json: file: ")


@pytest.mark.parametrize("missing", [19, 20, 21, 25])
def test_of_many_problems_of_one_file_twenty_are_listed(episode: Path, missing: int) -> None:
    problems = verify(rewrite(episode, set_value("groups", 0, "members", [2, 3, *range(100, 100 + missing)])))
    assert len(problems) == min(missing, 21)
    for number, problem in zip(range(100, 120), problems, strict=False):
        assert str(problem) == f"by-hand.json: groups: member {number} of group 5 is not a human"
    if missing > 20:
        assert str(problems[20]) == f"by-hand.json: schema: {missing - 20} more problems"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A data set of three episodes."""
    dataset_in(tmp_path / "set", spec())
    return tmp_path / "set"


def test_a_generated_data_set_has_no_problems(folder: Path) -> None:
    (folder / "failed").mkdir()
    (folder / "run.jsonl").write_text("{}\n")
    assert verify(folder) == []


def _text(problems: list[Problem]) -> str:
    return "\n".join(map(str, problems))


def test_an_edited_file_is_found_by_its_hash(folder: Path) -> None:
    path = folder / "000001.json"
    path.write_bytes(path.read_bytes().replace(b"by hand", b"by mind"))
    (problem,) = verify(folder)
    assert (problem.file, problem.place) == ("000001.json", "sha256")


@pytest.mark.parametrize("digit", ["0", "f"])
def test_the_hash_of_a_file_that_cannot_be_read_is_compared_too(folder: Path, digit: str) -> None:
    rewrite(folder / "000001.json", set_value("seed", 1.5))
    _rewrite(folder / "manifest.json", set_value("files", 1, "sha256", digit * 64))
    problems = verify(folder)
    assert [(problem.file, problem.place) for problem in problems] == [
        ("000001.json", "sha256"),
        ("000001.json", "seed"),
    ]


def test_missing_and_extra_files_are_found(folder: Path) -> None:
    (folder / "000001.json").rename(folder / "000009.json")
    text = _text(verify(folder))
    assert "000001.json is listed but not in the folder" in text
    assert "000009.json is in the folder but not listed" in text


def test_a_killed_run_is_one_problem(folder: Path) -> None:
    """Episodes that it stored and that its manifest does not list yet; other files are named."""
    (folder / "scrap.json").write_text("{}")
    _rewrite(folder / "manifest.json", lambda manifest: manifest.update(files=manifest["files"][:1], complete=False))
    text = _text(verify(folder))
    assert "files: 2 episode files are not listed until `generate` with --resume has completed the data set" in text
    assert "scrap.json is in the folder but not listed" in text
    assert "000001.json is in the folder but not listed" not in text


def test_an_edited_manifest_is_found(folder: Path) -> None:
    path = folder / "manifest.json"
    manifest = json.loads(path.read_bytes())

    def problems_after(**changes: Any) -> str:
        path.write_text(json.dumps({**manifest, **changes}))
        try:
            return _text(verify(folder))
        except RecordError as error:
            return str(error)

    assert "2 of 3" not in problems_after()
    assert "counts.outcome: is {'goal': 3}" in problems_after(counts={**manifest["counts"], "outcome": {"goal": 3}})
    assert "3 of 3 episodes exist" in problems_after(complete=False)
    assert "must list the episodes 0 to 3" in problems_after(episodes=4)
    assert "seed: differs from the manifest" in problems_after(seed=8)
    assert "lists 000000.json more than once" in problems_after(files=[*manifest["files"], manifest["files"][0]])
    assert "files.0.sha256" in problems_after(files=[{**manifest["files"][0], "sha256": "?"}])
    for name in ("../000000.json", "/dev/zero", "..", "", "a\\b.json", "a\0.json"):
        assert "is not a file name" in problems_after(files=[{**manifest["files"][0], "name": name}])
    path.write_text("{")
    with pytest.raises(RecordError, match="not valid JSON"):
        verify(folder)


def _rewrite(path: Path, change: Callable[[Any], None]) -> None:
    document = json.loads(path.read_bytes())
    change(document)
    path.write_text(json.dumps(document))


def test_files_that_repeat_the_manifest_are_compared_with_it(folder: Path) -> None:
    write_card(folder)
    assert verify(folder) == []
    _rewrite(folder / "scenario.json", set_value("tiny", 1.0))
    assert _text(verify(folder)) == "scenario.json: tiny: differs from the settings in manifest.json"
    _rewrite(folder / "scenario.json", set_value("tiny", 0.00001))
    card = folder / "README.md"
    card.write_text(card.read_text().replace("| stopped | 3 |", "| goal | 3 |").replace("12 frames in", "13 frames in"))
    text = _text(verify(folder))
    assert "README.md: counts: states the outcomes {'goal': 3}, the manifest {'stopped': 3}" in text
    assert "README.md: counts: states 13 frames, the manifest 12" in text
    card.write_text("# My own card\n")
    assert verify(folder) == [], "the text of a card is free"
    _rewrite(folder / "manifest.json", set_value("split", {"train": ["000000.json", "000001.json"]}))
    text = _text(verify(folder))
    assert "manifest.json: split: 000002.json is in no part (1 files in all)" in text
    assert "croissant.json: distribution: states another SHA-256 of manifest.json" in text
    with pytest.warns(DatasetWarning, match=r"were not written: .* no part of its split has 000002\.json; split it"):
        write_card(folder, licence="mit")
    card.write_text(card.read_text().replace("license: mit", "license: other"))
    assert "croissant.json: license: is 'mit', but README.md says other" in _text(verify(folder))
    (folder / "croissant.json").write_text("[]")
    assert "croissant.json: file: is not valid Croissant metadata" in _text(verify(folder))


def test_a_split_has_each_file_once(folder: Path) -> None:
    first, second, third = (f"00000{k}.json" for k in range(3))
    for parts, message in (
        ({"train": [first, second], "test": [third]}, ""),
        ({"train": [first, second], "test": [second, third]}, f"split: {second} is in two parts, or is not a listed"),
        ({"train": [first, second, third], "test": ["9.json"]}, "split: 9.json is in two parts, or is not a listed"),
        ({"train": [first], "test": [third]}, f"split: {second} is in no part (1 files in all); split the data set"),
    ):
        _rewrite(folder / "manifest.json", set_value("split", parts))
        problems = [str(problem) for problem in verify(folder) if problem.place == "split"]
        assert len(problems) == bool(message)
        assert message in "".join(problems)


def test_croissant_metadata_do_not_lead_out_of_the_folder(folder: Path, tmp_path: Path) -> None:
    write_card(folder)
    (tmp_path / "secret").write_text("x")
    _rewrite(folder / "croissant.json", set_value("distribution", 0, "contentUrl", "../secret"))
    assert verify(folder) == []


def test_missing_files_and_unknown_keys_are_warnings(folder: Path) -> None:
    (folder / "README.md").unlink()
    (folder / "scenario.json").unlink()
    _rewrite(folder / "manifest.json", set_value("sunshine", 1))
    _rewrite(folder / "manifest.json", set_value("files", 1, "colour", "red"))
    problems = verify(folder)
    assert all(problem.is_warning for problem in problems)
    assert [(problem.file, problem.place) for problem in problems] == [
        ("manifest.json", "sunshine"),
        ("manifest.json", "files.colour"),
        ("scenario.json", "file"),
        ("README.md", "file"),
    ]
    result = CliRunner().invoke(main, ["check", str(folder)])
    assert result.exit_code == 0
    assert "warning: is unknown to this version of sonata2d" in result.output
    assert "no problems, 4 warnings" in result.output


@pytest.mark.parametrize("frames", [3, None, [1], [{"tick": 0}]])
def test_a_key_of_episodes_in_a_manifest_is_unknown(folder: Path, frames: Any) -> None:
    _rewrite(folder / "manifest.json", set_value("frames", frames))
    (problem,) = verify(folder)
    assert (problem.file, problem.place, problem.is_warning) == ("manifest.json", "frames", True)


def test_an_id_that_differs_from_the_name_of_the_file_is_found(folder: Path) -> None:
    def change(manifest: Any) -> None:
        manifest["files"][1]["name"] = "000001x.json"

    (folder / "000001.json").rename(folder / "000001x.json")
    _rewrite(folder / "manifest.json", change)
    (problem,) = verify(folder)
    assert str(problem) == "000001x.json: id: is '000001', but the file's name says '000001x'"


@pytest.mark.parametrize("name", ["000000.json", "manifest.json"])
def test_a_key_that_is_given_twice_is_found(folder: Path, name: str) -> None:
    path = folder / name
    path.write_bytes(path.read_bytes().replace(b"{", b'{"seed":999,', 1))
    messages = [str(problem) for problem in verify(folder)]
    assert f"{name}: seed: is given twice; one of the values is ignored" in messages
