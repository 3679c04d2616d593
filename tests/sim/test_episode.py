"""One episode: order of events, endings, answers of controllers, branches."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import Goal, Human
from sonata2d.core.geometry import Pose, Twist
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import ControllerInfo, Frame, Outcome, Snapshot
from sonata2d.errors import ControllerError
from sonata2d.record.recorder import EpisodeRecorder

from ..conftest import room


class Answers(s2.Controller):
    """Gives one answer per tick, then stands."""

    def __init__(self, *answers: Any) -> None:
        self.answers = answers

    def act(self, snapshot: Snapshot) -> Any:
        return self.answers[snapshot.tick] if snapshot.tick < len(self.answers) else Twist()


class CallLog:
    """An observer that logs its calls."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.frames: list[Frame] = []
        self.last: Snapshot | None = None

    def open(self, scene: Scene, controller_info: ControllerInfo) -> None:
        self.calls.append(f"open {controller_info.path}")

    def on_frame(self, frame: Frame) -> None:
        self.calls.append(f"note {frame.snapshot.tick}")
        self.frames.append(frame)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        self.calls.append(f"close {last.tick} {outcome.status}")
        self.last = last


def run(scene: Scene, controller: s2.Controller) -> tuple[s2.Episode, CallLog]:
    log = CallLog()
    episode = s2.Episode(scene, controller, observers=[log])
    episode.run()
    return episode, log


def short_scene(**rules: Any) -> Scene:
    """A scene with a time limit of five ticks."""
    return room([Human(1, Pose(0.0, 2.0))], rules=Rules(time_limit=0.5, **rules))


def test_observers_are_opened_then_get_every_frame_then_are_closed() -> None:
    _, log = run(short_scene(), Answers())
    assert log.calls == [f"open {__name__}:Answers", *(f"note {k}" for k in range(5)), "close 5 timeout"]
    assert [frame.snapshot.time for frame in log.frames] == [0.0, 0.1, 0.2, 0.3, 0.4]


def test_a_name_in_place_of_a_scene_is_refused() -> None:
    with pytest.raises(TypeError, match=r"an episode needs a scene, such as generate\(\) returns; got 'lively'"):
        s2.Episode("lively", s2.StraightToGoal())  # type: ignore[arg-type]


def test_the_goal_ends_the_episode_and_its_heading_counts_if_it_has_a_tolerance() -> None:
    near_goal = room(robot=Pose(2.8, 0.0, 0.0))
    assert run(near_goal, Answers())[0].outcome == Outcome("goal", "within 0.4 m of the goal", 0, 0.0)
    with_heading = replace(near_goal, goal=Goal(3.0, 0.0, theta=2.0, angle=0.3), rules=Rules(time_limit=0.3))
    assert run(with_heading, Answers())[1].calls[-1] == "close 3 timeout"
    at_heading = replace(with_heading, robot=replace(with_heading.robot, pose=Pose(2.8, 0.0, 1.9)))
    assert run(at_heading, Answers())[1].calls[-1] == "close 0 goal"


@pytest.mark.usefixtures("motionless")
def test_a_contact_ends_the_episode_only_if_the_rules_say_so() -> None:
    human = Human(1, Pose(-2.3, 0.0), reacts_to_robot=0.0)  # others turn to the robot, and so touch it, too
    for ends_on, status in ((("goal", "time"), "timeout"), (("goal", "contact"), "contact")):
        scene = room([human], rules=Rules(time_limit=3.0, ends_on=ends_on))  # type: ignore[arg-type]
        episode, _ = run(scene, s2.StraightToGoal())
        assert episode.outcome is not None
        assert episode.outcome.status == status
    assert episode.outcome.reason == "contact with human 1, at fault: the robot"


@pytest.mark.parametrize(
    ("request_", "status"), [(s2.Stop("enough"), "stopped"), (s2.Regenerate("too easy"), "regenerate")]
)
def test_a_stop_or_regenerate_request_ends_the_episode(request_: object, status: str) -> None:
    episode, log = run(short_scene(), Answers(Twist(), request_))
    assert episode.outcome == Outcome(status, request_.reason, 1, 0.1)  # type: ignore[arg-type,attr-defined]
    assert log.calls[-1] == f"close 1 {status}"


@pytest.mark.parametrize("answer", [[1, 0, 0], None, (0.1, 0.2, 0.3), Twist(float("inf")), Twist("fast")])  # type: ignore[arg-type]
def test_an_answer_that_is_not_a_finite_twist_is_rejected_with_its_tick(answer: object) -> None:
    with pytest.raises(ControllerError, match=r"Answers\.act must return") as caught:
        run(short_scene(), Answers(Twist(), answer))
    assert caught.value.__notes__ == ["at tick 1 of episode 0, seed 0"]


def test_an_answer_beyond_the_range_of_files_is_rejected() -> None:
    with pytest.raises(ControllerError, match=r"Answers\.act answered .* is beyond what a file holds, 1e\+11"):
        run(short_scene(), Answers(Twist(1e12)))


def test_commands_are_recorded_at_the_precision_of_files() -> None:
    command = Twist(np.float32(0.123456789), -0.00004, 1)  # type: ignore[arg-type]
    _, log = run(short_scene(), Answers(command))
    assert log.frames[0].command == Twist(0.1235, 0.0, 1.0)


def test_an_exception_of_a_controller_passes_through_with_its_tick_and_closes_the_episode() -> None:
    class Failing(s2.Controller):
        def act(self, snapshot: Snapshot) -> Twist:
            return Twist(1 / (2 - snapshot.tick))

    log = CallLog()
    with pytest.raises(ZeroDivisionError) as caught:
        s2.Episode(short_scene(), Failing(), observers=[log]).run()
    assert caught.value.__notes__ == ["at tick 2 of episode 0, seed 0"]
    assert log.calls[-1] == "close 2 error"


def test_a_controller_cannot_write_into_a_snapshot(busy: Scene) -> None:
    class Writing(s2.Controller):
        def act(self, snapshot: Snapshot) -> Twist:
            snapshot.humans.state[:] = 0.0
            return Twist()

    with pytest.raises(ValueError, match="read-only"):
        s2.Episode(busy, Writing()).run()


def document(scene: Scene, controller: s2.Controller, ticks: int) -> bytes:
    """The episode file of a run that is stopped after some ticks."""
    recorder = EpisodeRecorder()
    episode = s2.Episode(scene, controller, observers=[recorder])
    for _ in range(ticks):
        episode.step()
    episode.end("stopped", "seen enough")
    return recorder.document()


def test_same_scene_gives_same_bytes_whatever_ran_before_or_in_between(busy: Scene) -> None:
    alone = document(busy, s2.SocialPlanner(), 60)
    recorder = EpisodeRecorder()
    first, second = (s2.Episode(busy, s2.SocialPlanner(), observers=[r]) for r in (recorder, EpisodeRecorder()))
    for _ in range(60):
        first.step()
        second.step()
    first.end("stopped", "seen enough")
    assert recorder.document() == alone
    assert document(busy, s2.SocialPlanner(), 60) == alone


def test_pedestrians_that_ignore_the_robot_do_not_depend_on_it(busy: Scene) -> None:
    humans = tuple(replace(human, reacts_to_robot=0.0) for human in busy.humans)
    scene = replace(busy, humans=humans, rules=Rules(time_limit=2.0))
    states = []
    for command in (Twist(), Twist(omega=1.0)):
        _, log = run(scene, Answers(*[command] * 20))
        states.append([frame.snapshot.humans.state for frame in log.frames])
    assert np.array_equal(states[0], states[1])


def test_a_label_object_that_the_controller_reuses_is_recorded_by_value() -> None:
    class Reusing(s2.Controller):
        def __init__(self) -> None:
            self._label = {"tick": -1}

        def act(self, snapshot: Snapshot) -> Twist:
            return Twist()

        def label(self, snapshot: Snapshot, twist: Twist) -> dict[str, int]:
            self._label["tick"] = snapshot.tick
            return self._label

    episode, _ = run(short_scene(), Reusing())
    assert [tick_input.label["tick"] for tick_input in episode.past] == [0, 1, 2, 3, 4]


def test_a_label_has_only_the_keys_that_the_controller_declares() -> None:
    class Mistyping(s2.Controller):
        labels = {"near": "a person is near"}  # noqa: RUF012

        def act(self, snapshot: Snapshot) -> Twist:
            return Twist()

        def label(self, snapshot: Snapshot, twist: Twist) -> dict[str, bool]:
            return {"naer": True}

    with pytest.raises(ControllerError, match=r"the key 'naer', .* do not explain; did you mean 'near'"):
        s2.Episode(short_scene(), Mistyping()).run()


def test_a_branch_equals_its_episode_up_to_its_tick_and_differs_afterwards(busy: Scene) -> None:
    scene, ticks = replace(busy, rules=Rules(time_limit=4.0)), 15
    episode, log = run(scene, s2.StraightToGoal())
    branch_log = CallLog()
    branch = episode.branch(ticks, s2.SocialPlanner(), observers=[branch_log])
    assert len(branch.past) == ticks
    branch.run()
    for expected, frame in zip(log.frames[: ticks + 1], branch_log.frames[: ticks + 1], strict=True):
        assert np.array_equal(expected.snapshot.humans.state, frame.snapshot.humans.state)
        assert expected.snapshot.robot == frame.snapshot.robot
    commands, branch_commands = ([frame.command for frame in frames] for frames in (log.frames, branch_log.frames))
    assert commands[:ticks] == branch_commands[:ticks]
    assert commands[ticks:] != branch_commands[ticks:]


def test_a_branch_with_the_same_controller_equals_the_episode(busy: Scene) -> None:
    episode, _ = run(replace(busy, rules=Rules(time_limit=4.0)), s2.StraightToGoal())
    branch = episode.branch(15, s2.StraightToGoal())
    branch.run()
    assert [tick_input.command for tick_input in branch.past] == [tick_input.command for tick_input in episode.past]


def test_a_branch_at_a_tick_that_was_not_run_is_rejected() -> None:
    with pytest.raises(ValueError, match="the ticks run so far"):
        s2.Episode(short_scene(), Answers()).branch(999, s2.StraightToGoal())


class _Odd(s2.Controller):
    """A controller with an attribute or a method that files cannot hold."""

    def __init__(self, **odd: object) -> None:
        vars(self).update(odd)

    def settings(self) -> dict[str, object]:
        return {}

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist()


def _raises() -> dict[str, object]:
    raise OSError("no such device")


@pytest.mark.parametrize(
    ("odd", "message"),
    [
        ({"settings": _raises}, r"settings\(\) of .*_Odd raised OSError: no such device"),
        ({"settings": lambda: [1]}, "must return a dict"),
        ({"version": 7}, "version of .*_Odd must be text, got 7"),
        ({"labels": {"near": None}}, "must be a dict of names and their meanings"),
    ],
)
def test_what_files_cannot_hold_of_a_controller_is_refused_at_the_start(odd: dict[str, object], message: str) -> None:
    with pytest.raises(ControllerError, match=message):
        s2.Episode(s2.generate(s2.ScenarioConfig(humans=0), seed=1), _Odd(**odd))


def test_the_reason_of_a_stop_must_be_text() -> None:
    with pytest.raises(TypeError, match="the reason of Stop must be text, got 12345"):
        s2.Stop(12345)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("given", "remedy"),
    [(Answers, r"pass Answers\(\)"), ("orca", r"pass sonata2d.load_controller\('orca'\)"), (3, "got 3")],
)
def test_a_controller_is_an_object(given: Any, remedy: str) -> None:
    scene = s2.generate(s2.ScenarioConfig(humans=0), seed=1)
    for use in (partial(s2.Episode, scene), s2.check_controller):
        with pytest.raises(TypeError, match=remedy):
            use(given)


def test_a_copy_of_an_episode_names_what_continues_from_its_tick(busy: Scene) -> None:
    episode = s2.Episode(busy, s2.SocialPlanner())
    for _ in range(3):
        episode.step()
    for copied in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match=r"cannot be copied or pickled; Episode\(episode.scene, controller, past="):
            copied(episode)  # type: ignore[operator]
    other = s2.Episode(episode.scene, s2.SocialPlanner(), past=episode.past)
    assert other.observe().tick == 3


def test_observers_are_a_list() -> None:
    with pytest.raises(TypeError, match=r"observers are several; write observers=\[EpisodeRecorder\(\.\.\.\)\]"):
        s2.Episode(s2.generate("empty", 1), s2.StraightToGoal(), observers=s2.EpisodeRecorder())  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("limit", "dt", "last"),
    [
        (2.85, 0.1, 28), (2.8, 0.1, 28), (2.9, 0.1, 29), (2.89, 0.1, 28), (0.3, 0.1, 3), (0.7, 0.1, 7),
        (60.0, 0.1, 600), (1.0, 0.3, 3), (3600.0, 0.05, 72_000), (2.0, 1 / 30, 60), (60.0, 0.0667, 899), (0.1, 0.1, 1),
    ],
)  # fmt: skip
def test_the_last_state_is_the_last_within_the_time_limit(limit: float, dt: float, last: int) -> None:
    assert Rules(dt=dt, time_limit=limit).last_tick == last


@pytest.mark.parametrize(("limit", "status"), [(2.75, "timeout"), (2.8, "goal"), (2.85, "goal")])
def test_a_goal_at_2_8_seconds_counts_if_the_time_limit_is_not_below(limit: float, status: str) -> None:
    scene = room(rules=Rules(time_limit=limit))
    positions = [frame.snapshot.robot.position for frame in _frames(scene)]
    goal = Goal(positions[28][0] + 0.39999, positions[28][1])
    outcome = s2.Episode(replace(scene, goal=goal), s2.StraightToGoal()).run()
    assert (outcome.status, outcome.time) == (status, 2.8 if status == "goal" else 2.7)
    assert outcome.reason == ("within 0.4 m of the goal" if status == "goal" else "2.7 s are over")


def _frames(scene: Scene) -> list[Frame]:
    """The frames of a robot that drives straight ahead, for 4 s."""
    log = CallLog()
    s2.Episode(replace(scene, rules=Rules(time_limit=4.0)), s2.StraightToGoal(), observers=[log]).run()
    return log.frames
