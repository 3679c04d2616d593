"""Metrics of the robot's effect on people: by hand, and on simulated episodes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import Human
from sonata2d.core.geometry import Pose
from sonata2d.core.scene import Rules, Scene
from sonata2d.datasets.transforms.mirror import mirrored
from sonata2d.metrics.disturbance import without_robot
from sonata2d.metrics.measurement import measure
from sonata2d.metrics.trajectory import Trajectory
from sonata2d.record.record import EpisodeRecord, record_from_document
from sonata2d.record.recorder import EpisodeRecorder

from ..conftest import room, walker
from .samples import line, stay, value

DISTURBANCE = ("human_deviation_mean", "human_deviation_max", "human_slowing")


class Stand(s2.Controller):
    """Does not move."""

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist()


def simulated(scene: Scene) -> EpisodeRecord:
    """An episode of a scene with a robot that does not move."""
    recorder = EpisodeRecorder()
    s2.Episode(scene, Stand(), observers=[recorder]).run()
    return record_from_document(json.loads(recorder.document()), Path("simulated.json"))


def corridor(*people: Human, robot: Pose) -> Scene:
    """A corridor of 12 m x 2 m, so narrow that people who walk meet the robot in the middle."""
    polygon = ((-6.0, -1.0), (6.0, -1.0), (6.0, 1.0), (-6.0, 1.0))
    rules = Rules(time_limit=6.0, ends_on=("time",))
    return room(people, polygon=polygon, robot=robot, goal=(5.0, 0.0), rules=rules, seed=3)


def test_deviation_and_slowing_by_hand() -> None:
    """A person walks 0.5 m in 1 s instead of 1 m; a second person, who stands, does not count."""
    scene = room([walker(1, 0.0, 0.0), Human(2, Pose(3.0, 3.0))])
    people = [line((0.0, 0.0), (0.05, 0.0), 11), stay(3.0, 3.0, 11)]
    undisturbed = np.zeros((11, 2, 2))
    undisturbed[:, 0, 0] = np.linspace(0.0, 1.0, 11)
    episode = (scene, stay(-3.0, 0.0, 11), people)
    assert value("human_deviation_mean", *episode, undisturbed=undisturbed) == pytest.approx(0.25)
    assert value("human_deviation_max", *episode, undisturbed=undisturbed) == pytest.approx(0.5)
    assert value("human_slowing", *episode, undisturbed=undisturbed) == pytest.approx(0.5)
    assert value("human_deviation_mean", *episode) is None


def test_speed_ratio_counts_walking_people_only() -> None:
    scene = room([walker(1, 0.0, 0.0, desired_speed=1.0), Human(2, Pose(3.0, 3.0))])
    people = [line((0.0, 0.0), (0.05, 0.0), 11), stay(3.0, 3.0, 11)]
    assert value("human_speed_ratio", scene, stay(-3.0, 0.0, 11), people) == pytest.approx(0.5)
    assert value("human_speed_ratio", room([Human(2, Pose(3.0, 3.0))]), stay(0, 0, 3), [stay(3, 3, 3)]) is None


def test_people_who_ignore_a_distant_robot_are_not_disturbed() -> None:
    aside = room(
        [walker(k, -2.0 + k, 1.0, reacts_to_robot=0.0) for k in (1, 2, 3)],
        rules=Rules(time_limit=4.0, ends_on=("time",)), polygon=((-40.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-40.0, 4.0)),
        robot=Pose(-39.0, 0.0),
    )  # fmt: skip
    record = simulated(aside)
    undisturbed = without_robot(record)
    assert undisturbed is not None
    assert np.array_equal(undisturbed, record.states.humans[:, :, :2])
    assert measure(record)["human_deviation_max"] == 0.0


def test_robot_in_the_way_disturbs_people() -> None:
    record = simulated(corridor(walker(1, -5.0, 0.0), walker(2, 5.0, 0.2, 3.1), robot=Pose(0.0, 0.0)))
    values = measure(record)
    assert values["human_deviation_max"] is not None
    assert values["human_deviation_max"] > 0.1
    assert without_robot(record)[0].tolist() == [[-5.0, 0.0], [5.0, 0.2]]  # type: ignore[index]


def test_mirror_image_has_the_disturbance_of_its_original() -> None:
    record = simulated(corridor(walker(1, -5.0, 0.0), walker(2, 5.0, 0.2, 3.1), robot=Pose(0.0, 0.1)))
    values, image = measure(record), measure(mirrored(record))
    assert [image[name] for name in DISTURBANCE] == pytest.approx([values[name] for name in DISTURBANCE], abs=1e-6)


def test_disturbance_is_unknown_without_walking_people_and_for_other_physics() -> None:
    standing = simulated(corridor(Human(1, Pose(-5.0, 0.0)), robot=Pose(0.0, 0.0)))
    assert without_robot(standing) is None
    walking = simulated(corridor(walker(1, -5.0, 0.0), robot=Pose(0.0, 0.0)))
    other = replace(walking, document={**walking.document, "physics": 0})
    assert without_robot(other) is None
    assert measure(walking, rerun=False)["human_slowing"] is None
    assert Trajectory(walking).undisturbed is None
