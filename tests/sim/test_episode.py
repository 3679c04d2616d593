"""One run: the order of things, endings, answers, and any moment had again."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import Goal, Human
from sonata2d.core.geometry import Pose, Twist
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Author, Frame, Outcome, Snapshot
from sonata2d.errors import ControllerError
from sonata2d.record.recorder import EpisodeRecorder

from ..conftest import room


class Answers(s2.Controller):
    """Says what it was given, tick by tick, then stands."""

    def __init__(self, *answers: Any) -> None:
        self.answers = answers

    def act(self, snapshot: Snapshot) -> Any:
        return self.answers[snapshot.tick] if snapshot.tick < len(self.answers) else Twist()


class Diary:
    """Writes down what an observer is told."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.frames: list[Frame] = []
        self.last: Snapshot | None = None

    def open(self, scene: Scene, author: Author) -> None:
        self.told.append(f"open {author.path}")

    def note(self, frame: Frame) -> None:
        self.told.append(f"note {frame.snapshot.tick}")
        self.frames.append(frame)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        self.told.append(f"close {last.tick} {outcome.status}")
        self.last = last


def run(scene: Scene, controller: s2.Controller) -> tuple[s2.Episode, Diary]:
    diary = Diary()
    episode = s2.Episode(scene, controller, observers=[diary])
    episode.run()
    return episode, diary


def short(**rules: Any) -> Scene:
    return room([Human(1, Pose(0.0, 2.0))], rules=Rules(time_limit=0.5, **rules))


def test_look_think_note_move() -> None:
    _, diary = run(short(), Answers())
    expected = [f"open {__name__}:Answers", *(f"note {k}" for k in range(5)), "close 5 timeout"]
    assert diary.told == expected
    assert [frame.snapshot.time for frame in diary.frames] == [0.0, 0.1, 0.2, 0.3, 0.4]


def test_the_goal_ends_the_episode_and_its_heading_counts_if_asked_for() -> None:
    there = room(robot=Pose(2.8, 0.0, 0.0))
    assert run(there, Answers())[0].outcome == Outcome("goal", "within 0.4 m of the goal", 0, 0.0)
    turned = replace(there, goal=Goal(3.0, 0.0, theta=2.0, angle=0.3), rules=Rules(time_limit=0.3))
    assert run(turned, Answers())[1].told[-1] == "close 3 timeout"
    facing = replace(turned, robot=replace(turned.robot, pose=Pose(2.8, 0.0, 1.9)))
    assert run(facing, Answers())[1].told[-1] == "close 0 goal"


def test_contact_ends_the_episode_only_where_the_rules_say_so() -> None:
    person = Human(1, Pose(-2.3, 0.0))
    for ends_on, status in ((("goal", "time"), "timeout"), (("goal", "contact"), "contact")):
        scene = room([person], rules=Rules(time_limit=3.0, ends_on=ends_on))  # type: ignore[arg-type]
        episode, _ = run(scene, s2.StraightToGoal())
        assert episode.outcome is not None
        assert episode.outcome.status == status
    assert episode.outcome.reason == "contact with human 1, at fault: the robot"


@pytest.mark.parametrize(
    ("request_", "status"), [(s2.Stop("enough"), "stopped"), (s2.Regenerate("too easy"), "regenerate")]
)
def test_a_request_ends_the_episode(request_: object, status: str) -> None:
    episode, diary = run(short(), Answers(Twist(), request_))
    assert episode.outcome == Outcome(status, request_.reason, 1, 0.1)  # type: ignore[arg-type,attr-defined]
    assert diary.told[-1] == f"close 1 {status}"


@pytest.mark.parametrize("answer", [[1, 0, 0], None, (0.1, 0.2, 0.3), Twist(float("inf")), Twist("fast")])  # type: ignore[arg-type]
def test_an_answer_that_is_no_finite_twist_is_refused_with_its_tick(answer: object) -> None:
    with pytest.raises(ControllerError, match=r"Answers\.act must return") as caught:
        run(short(), Answers(Twist(), answer))
    assert caught.value.__notes__ == ["at tick 1 of the episode"]


def test_commands_are_noted_as_a_file_can_hold_them() -> None:
    asked = Twist(np.float32(0.123456789), -0.00004, 1)  # type: ignore[arg-type]
    _, diary = run(short(), Answers(asked))
    assert diary.frames[0].command == Twist(0.1235, 0.0, 1.0)


def test_a_controllers_own_error_passes_through_with_its_tick_and_closes_the_record() -> None:
    class Falls(s2.Controller):
        def act(self, snapshot: Snapshot) -> Twist:
            return Twist(1 / (2 - snapshot.tick))

    diary = Diary()
    with pytest.raises(ZeroDivisionError) as caught:
        s2.Episode(short(), Falls(), observers=[diary]).run()
    assert caught.value.__notes__ == ["at tick 2 of the episode"]
    assert diary.told[-1] == "close 2 error"


def test_minds_see_one_snapshot_and_only_the_world_moves(busy: Scene) -> None:
    class Meddler(s2.Controller):
        def act(self, snapshot: Snapshot) -> Twist:
            snapshot.humans.state[:] = 0.0
            return Twist()

    with pytest.raises(ValueError, match="read-only"):
        s2.Episode(busy, Meddler()).run()


def document(scene: Scene, controller: s2.Controller, ticks: int | None = None) -> bytes:
    recorder = EpisodeRecorder()
    episode = s2.Episode(scene, controller, observers=[recorder])
    if ticks is None:
        episode.run()
    else:
        for _ in range(ticks):
            episode.step()
        episode.end("stopped", "seen enough")
    return recorder.document()


def test_the_same_scene_gives_the_same_bytes_whatever_ran_before_or_between(busy: Scene) -> None:
    alone = document(busy, s2.SocialPlanner(), 60)
    one, other = (s2.Episode(busy, s2.SocialPlanner(), observers=[EpisodeRecorder()]) for _ in "ab")
    for _ in range(60):
        one.step()
        other.step()
    one.end("stopped", "seen enough")
    assert one.observers[0].document() == alone  # type: ignore[attr-defined]
    assert document(busy, s2.SocialPlanner(), 60) == alone


def test_people_do_not_depend_on_what_the_robot_does_far_away(busy: Scene) -> None:
    """The people's chances are theirs alone: an ignored robot changes nothing they do."""
    blind = replace(
        busy, humans=tuple(replace(h, reacts_to_robot=0.0) for h in busy.humans), rules=Rules(time_limit=2.0)
    )
    states = []
    for command in (Twist(), Twist(omega=1.0)):
        _, diary = run(blind, Answers(*[command] * 20))
        states.append([frame.snapshot.humans.state for frame in diary.frames])
    assert np.array_equal(states[0], states[1])


def test_a_label_that_the_controller_uses_again_is_kept_as_it_was() -> None:
    class Reuses(s2.Controller):
        def __init__(self) -> None:
            self._label = {"tick": -1}

        def act(self, snapshot: Snapshot) -> Twist:
            return Twist()

        def label(self, snapshot: Snapshot, twist: Twist) -> dict[str, int]:
            self._label["tick"] = snapshot.tick
            return self._label

    episode, _ = run(short(), Reuses())
    assert [moment.label["tick"] for moment in episode.past] == [0, 1, 2, 3, 4]


def test_a_branch_is_the_same_up_to_its_tick_and_another_thereafter(busy: Scene) -> None:
    scene = replace(busy, rules=Rules(time_limit=4.0))
    episode, diary = run(scene, s2.StraightToGoal())
    watch = Diary()
    branch = episode.branch(15, s2.SocialPlanner(), observers=[watch])
    assert len(branch.past) == 15
    branch.run()
    for was, now in zip(diary.frames[:16], watch.frames[:16], strict=True):
        assert np.array_equal(was.snapshot.humans.state, now.snapshot.humans.state)
        assert was.snapshot.robot == now.snapshot.robot
    assert [f.command for f in diary.frames[:15]] == [f.command for f in watch.frames[:15]]
    assert [f.command for f in diary.frames[15:]] != [f.command for f in watch.frames[15:]]
    same = episode.branch(15, s2.StraightToGoal())
    same.run()
    assert [moment.command for moment in same.past] == [moment.command for moment in episode.past]
    with pytest.raises(ValueError, match="the ticks run so far"):
        episode.branch(999, s2.StraightToGoal())
