"""`Labelled`: the driver drives as it would alone, and each label is the labeller's command."""

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


class Scripted(s2.Controller):
    """Answers with a function of the tick; keeps the commands that were executed instead."""

    def __init__(self, answer: Callable[[int], Answer]) -> None:
        self._answer = answer
        self._executed: list[Twist] = []

    def act(self, snapshot: Snapshot) -> Answer:
        return self._answer(snapshot.tick)

    def command_overridden(self, twist: Twist) -> None:
        self._executed.append(twist)


class CameraDriven(s2.Controller):
    """Drives by the brightness of its camera image."""

    image = ImageRequest(32, 24)
    deterministic = False

    def act(self, snapshot: Snapshot) -> Twist:
        return Twist(float(snapshot.image.mean()) / 1000)


def ahead(tick: int) -> Twist:
    return Twist(0.5)


def labels(driver: s2.Controller, labeller: s2.Controller, ticks: int = 12) -> list[object]:
    """The labels of the first ticks of an episode."""
    episode = s2.Episode(room([walker(1, 0.0, 1.0)]), Labelled(driver, labeller))
    for _ in range(ticks):
        episode.step()
    return [frame.label for frame in episode.past]


def test_driver_drives_as_it_would_alone_and_labels_are_the_labellers_commands() -> None:
    scene = room([walker(1, 0.0, 0.3), walker(2, 1.0, -1.0)])
    alone = s2.Episode(scene, s2.StraightToGoal())
    together = s2.Episode(scene, Labelled(s2.StraightToGoal(), s2.SocialPlanner()))
    assert together.run() == alone.run()
    assert [frame.command for frame in together.past] == [frame.command for frame in alone.past]
    first = s2.Episode(scene, s2.SocialPlanner()).step()
    assert first is not None
    assert together.past[0].label == [first.command.vx, first.command.vy, first.command.omega]
    assert any(frame.label[0] != frame.command.vx for frame in together.past)


def test_equal_driver_and_labeller_give_labels_equal_to_the_commands() -> None:
    episode = s2.Episode(room([walker(1, 0.0, 0.3)]), Labelled(s2.SocialPlanner(), s2.SocialPlanner()))
    episode.run()
    assert all(f.label == [f.command.vx, f.command.vy, f.command.omega] for f in episode.past)


@pytest.mark.parametrize("request_", [Stop("enough"), Regenerate("no use")])
def test_a_labeller_that_would_end_the_episode_labels_with_zero(tmp_path: Path, request_: Stop | Regenerate) -> None:
    labeller = Scripted(lambda tick: request_ if tick >= 2 else Twist(0.1, 0.2, 0.3))
    expected = [[0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    assert labels(Scripted(ahead), labeller, 4) == expected
    scene = room(rules=Rules(time_limit=0.5))
    with s2.JsonRecorder(tmp_path / "a.json") as recorder:
        s2.Episode(scene, Labelled(Scripted(ahead), labeller), observers=[recorder]).run()
    assert read_episode(tmp_path / "a.json").labels[2] == [0.0, 0.0, 0.0]  # not the driver's command


@pytest.mark.parametrize(("answer", "status"), [(Stop("enough"), "stopped"), (Regenerate("no use"), "regenerate")])
def test_a_driver_ends_the_episode_as_it_would_alone(answer: Answer, status: str) -> None:
    driver = Scripted(lambda tick: answer if tick >= 3 else Twist(0.5))
    episode = s2.Episode(room(), Labelled(driver, s2.SocialPlanner()))
    outcome = episode.run()
    assert (outcome.status, outcome.tick) == (status, 3)
    assert len(episode.past) == 3


@pytest.mark.parametrize("answer", [Twist(float("nan")), Twist(0.0, float("inf")), None, (0.1, 0.2, 0.3)])
def test_a_labeller_must_return_a_finite_twist(answer: object) -> None:
    with pytest.raises(ControllerError, match=r"Scripted.act must return a Twist of finite numbers, got") as caught:
        labels(Scripted(ahead), Scripted(lambda tick: answer))  # type: ignore[arg-type, return-value]
    assert caught.value.__notes__ == ["at tick 0 of episode 0, seed 0"]


def test_numpy_numbers_become_python_numbers_in_labels() -> None:
    twist = Twist(np.float64(0.12345), np.float32(0.5), np.int64(1))  # type: ignore[arg-type]
    found = labels(Scripted(ahead), Scripted(lambda tick: twist), 1)
    assert found == [[0.1234, 0.5, 1.0]]
    assert [type(value) for value in found[0]] == [float] * 3  # type: ignore[attr-defined]


def test_a_driver_receives_its_image_and_a_labeller_with_an_image_is_rejected() -> None:
    from sonata2d.view.painter import image_of

    pair = Labelled(CameraDriven(), s2.SocialPlanner())
    assert pair.image == CameraDriven.image
    assert not pair.deterministic
    episode = s2.Episode(room(), pair, renderer=image_of)
    episode.step()
    assert episode.past[0].command.vx > 0.0
    with pytest.raises(ControllerError, match="CameraDriven requests a camera image, which a labeller does not"):
        Labelled(s2.SocialPlanner(), CameraDriven())


def test_reset_resets_both_controllers() -> None:
    class Counter(s2.Controller):
        def reset(self, scene: s2.Scene) -> None:
            self._count = 0

        def act(self, snapshot: Snapshot) -> Twist:
            self._count += 1
            return Twist(0.01 * self._count)

    pair = Labelled(Counter(), Counter())
    for _ in range(2):
        episode = s2.Episode(room(), pair)
        for _ in range(3):
            episode.step()
        assert [frame.command.vx for frame in episode.past] == [0.01, 0.02, 0.03]
        assert [frame.label[0] for frame in episode.past] == [0.01, 0.02, 0.03]


def test_file_records_the_meaning_of_the_label_and_the_settings_of_both(tmp_path: Path) -> None:
    with s2.JsonRecorder(tmp_path / "a.json") as recorder:
        pair = Labelled(s2.StraightToGoal(), s2.SocialPlanner())
        s2.Episode(room(rules=Rules(time_limit=0.3)), pair, observers=[recorder]).run()
    controller_info = read_episode(tmp_path / "a.json").controller_info
    assert "that SocialPlanner would have asked for" in (controller_info.labels or {})["twist"]
    assert (controller_info.settings or {})["labeller"] == dict(s2.SocialPlanner().settings())


def test_settings_alone_do_not_reconstruct_a_pair() -> None:
    with pytest.raises(ControllerError, match=r"do not contain the classes .* name both, as driver\+labeller"):
        Labelled.from_settings(Labelled(s2.StraightToGoal(), s2.SocialPlanner()).settings())


def test_the_labeller_is_given_the_executed_commands() -> None:
    labeller = Scripted(lambda tick: Twist(0.1))
    labels(Scripted(lambda tick: Twist(0.1 * tick)), labeller, ticks=4)
    assert labeller._executed == [Twist(0.1 * tick) for tick in range(4)]


def test_labels_do_not_depend_on_the_labellers_own_earlier_commands() -> None:
    """At each tick an expert that was given the same executed commands answers the same."""
    scene = room([walker(1, 0.0, 0.3), walker(2, 1.0, -1.0)])
    episode = s2.Episode(scene, Labelled(s2.StraightToGoal(), s2.SocialPlanner()))
    expert = s2.SocialPlanner()
    expert.reset(scene)
    differing = 0
    for _ in range(30):
        answer = expert.act(episode.snapshot()).rounded()
        frame = episode.step()
        assert frame is not None
        assert frame.label == [answer.vx, answer.vy, answer.omega]
        differing += frame.command != answer
        expert.command_overridden(frame.command)
    assert differing > 10
