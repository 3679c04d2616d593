"""One drives, another labels: the driver drives as it would alone, and each label is what the other wanted there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.controllers.base import Answer, Regenerate, Stop
from sonata2d.agents.controllers.labelled import Labelled
from sonata2d.core.devices import ImageRequest
from sonata2d.core.geometry import Twist
from sonata2d.core.scene import Rules
from sonata2d.core.snapshot import Snapshot
from sonata2d.errors import ControllerError
from sonata2d.record.reader import read_episode

from ..conftest import room, walker


class Says(s2.Controller):
    """Answers what a function of the tick gives."""

    def __init__(self, answer: Callable[[int], Answer]) -> None:
        self._answer = answer

    def act(self, snapshot: Snapshot) -> Answer:
        return self._answer(snapshot.tick)


class Looker(s2.Controller):
    """Drives by what it sees."""

    image = ImageRequest(32, 24)
    deterministic = False

    def act(self, snapshot: Snapshot) -> Twist:
        return Twist(float(snapshot.image.mean()) / 1000)


def ahead(tick: int) -> Twist:
    return Twist(0.5)


def labels(driver: s2.Controller, labeller: s2.Controller, ticks: int = 12) -> list[object]:
    episode = s2.Episode(room([walker(1, 0.0, 1.0)]), Labelled(driver, labeller))
    for _ in range(ticks):
        episode.step()
    return [moment.label for moment in episode.past]


def test_the_driver_drives_as_it_would_alone_and_the_label_is_what_the_other_wants() -> None:
    scene = room([walker(1, 0.0, 0.3), walker(2, 1.0, -1.0)])
    alone, together = (
        s2.Episode(scene, s2.StraightToGoal()),
        s2.Episode(scene, Labelled(s2.StraightToGoal(), s2.SocialPlanner())),
    )
    assert together.run() == alone.run()
    assert [moment.command for moment in together.past] == [moment.command for moment in alone.past]
    first = s2.Episode(scene, s2.SocialPlanner()).step()
    assert first is not None
    assert together.past[0].label == [first.command.vx, first.command.vy, first.command.omega]
    assert any(moment.label[0] != moment.command.vx for moment in together.past)


def test_one_that_is_shown_its_own_runs_labels_them_with_its_commands() -> None:
    episode = s2.Episode(room([walker(1, 0.0, 0.3)]), Labelled(s2.SocialPlanner(), s2.SocialPlanner()))
    episode.run()
    assert all(m.label == [m.command.vx, m.command.vy, m.command.omega] for m in episode.past)


@pytest.mark.parametrize("request_", [Stop("enough"), Regenerate("no use")])
def test_a_labeller_that_would_end_the_episode_labels_with_standing_still(
    tmp_path: Path, request_: Stop | Regenerate
) -> None:
    labeller = Says(lambda tick: request_ if tick >= 2 else Twist(0.1, 0.2, 0.3))
    assert labels(Says(ahead), labeller, 4) == [[0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    scene = room(rules=Rules(time_limit=0.5))
    with s2.JsonRecorder(tmp_path / "a.json") as recorder:
        s2.Episode(scene, Labelled(Says(ahead), labeller), observers=[recorder]).run()
    assert read_episode(tmp_path / "a.json").labels[2] == [0.0, 0.0, 0.0]  # not the driver's command


@pytest.mark.parametrize(("answer", "status"), [(Stop("enough"), "stopped"), (Regenerate("no use"), "regenerate")])
def test_a_driver_ends_the_episode_as_it_would_alone(answer: Answer, status: str) -> None:
    driver = Says(lambda tick: answer if tick >= 3 else Twist(0.5))
    episode = s2.Episode(room(), Labelled(driver, s2.SocialPlanner()))
    outcome = episode.run()
    assert (outcome.status, outcome.tick) == (status, 3)
    assert len(episode.past) == 3


@pytest.mark.parametrize("answer", [Twist(float("nan")), Twist(0.0, float("inf")), None, (0.1, 0.2, 0.3)])
def test_a_labeller_that_answers_no_twist_is_told_so(answer: object) -> None:
    with pytest.raises(ControllerError, match=r"Says.act must return a Twist of finite numbers, got") as caught:
        labels(Says(ahead), Says(lambda tick: answer))  # type: ignore[arg-type, return-value]
    assert caught.value.__notes__ == ["at tick 0 of the episode"]


def test_numbers_of_numpy_are_labels_of_python() -> None:
    told = labels(Says(ahead), Says(lambda tick: Twist(np.float64(0.12345), np.float32(0.5), np.int64(1))), 1)  # type: ignore[arg-type]
    assert told == [[0.1234, 0.5, 1.0]]
    assert [type(value) for value in told[0]] == [float] * 3  # type: ignore[attr-defined]


def test_a_driver_that_asks_for_an_image_gets_it_and_the_labeller_may_not() -> None:
    from sonata2d.view.eye import image_of

    pair = Labelled(Looker(), s2.SocialPlanner())
    assert pair.image == Looker.image
    assert not pair.deterministic
    episode = s2.Episode(room(), pair, renderer=image_of)
    episode.step()
    assert episode.past[0].command.vx > 0.0
    with pytest.raises(ControllerError, match="Looker asks for a camera image; as a labeller it gets none"):
        Labelled(s2.SocialPlanner(), Looker())


def test_both_forget_the_last_episode() -> None:
    class Counts(s2.Controller):
        def reset(self, scene: s2.Scene) -> None:
            self._count = 0

        def act(self, snapshot: Snapshot) -> Twist:
            self._count += 1
            return Twist(0.01 * self._count)

    pair = Labelled(Counts(), Counts())
    for _ in range(2):
        episode = s2.Episode(room(), pair)
        for _ in range(3):
            episode.step()
        assert [moment.command.vx for moment in episode.past] == [0.01, 0.02, 0.03]
        assert [moment.label[0] for moment in episode.past] == [0.01, 0.02, 0.03]


def test_a_file_says_what_the_label_is_and_how_both_are_set(tmp_path: Path) -> None:
    with s2.JsonRecorder(tmp_path / "a.json") as recorder:
        pair = Labelled(s2.StraightToGoal(), s2.SocialPlanner())
        s2.Episode(room(rules=Rules(time_limit=0.3)), pair, observers=[recorder]).run()
    author = read_episode(tmp_path / "a.json").author
    assert "that SocialPlanner would have asked for" in (author.labels or {})["twist"]
    assert (author.settings or {})["labeller"] == dict(s2.SocialPlanner().settings())


def test_what_was_not_made_by_name_is_not_made_again_in_silence() -> None:
    with pytest.raises(ControllerError, match=r"does not say who drove; name both as driver\+labeller"):
        Labelled.from_settings(Labelled(s2.StraightToGoal(), s2.SocialPlanner()).settings())


class Minds(s2.Controller):
    """Remembers what it is told was done."""

    def __init__(self) -> None:
        self.heard: list[Twist] = []

    def act(self, snapshot: Snapshot) -> Twist:
        return Twist(0.1)

    def command_overridden(self, twist: Twist) -> None:
        self.heard.append(twist)


def test_the_labeller_is_told_what_was_done() -> None:
    minds = Minds()
    labels(Says(lambda tick: Twist(0.1 * tick)), minds, ticks=4)
    assert minds.heard == [Twist(0.1 * tick) for tick in range(4)]


def test_an_expert_labels_what_it_would_do_there_whatever_it_would_have_done_before() -> None:
    """At each tick an expert that has driven just so, command by command, says the same."""
    scene = room([walker(1, 0.0, 0.3), walker(2, 1.0, -1.0)])
    episode = s2.Episode(scene, Labelled(s2.StraightToGoal(), s2.SocialPlanner()))
    expert = s2.SocialPlanner()
    expert.reset(scene)
    apart = 0
    for _ in range(30):
        snapshot = episode.look()
        wanted = expert.act(snapshot).rounded()
        frame = episode.step()
        assert frame is not None
        assert frame.label == [wanted.vx, wanted.vy, wanted.omega]
        apart += frame.command != wanted
        expert.command_overridden(frame.command)
    assert apart > 10
