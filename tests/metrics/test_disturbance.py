"""What the robot cost the people: by hand, and on runs that were made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import Human
from sonata2d.core.geometry import Pose
from sonata2d.core.scene import Rules, Scene
from sonata2d.datasets.mirror import mirrored
from sonata2d.metrics.disturbance import without_robot
from sonata2d.metrics.measurement import measure
from sonata2d.metrics.trajectory import Trajectory
from sonata2d.record.reader import record_of
from sonata2d.record.record import EpisodeRecord
from sonata2d.record.recorder import EpisodeRecorder

from ..conftest import room, walker
from .samples import line, stay, value

DISTURBANCE = ("human_deviation_mean", "human_deviation_max", "human_slowing")


class Stand(s2.Controller):
    """Is in the way."""

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist()


def played(scene: Scene) -> EpisodeRecord:
    import json
    from pathlib import Path

    recorder = EpisodeRecorder()
    s2.Episode(scene, Stand(), observers=[recorder]).run()
    return record_of(json.loads(recorder.document()), Path("played.json"))


def corridor(*people: Human, robot: Pose) -> Scene:
    """12 m long and 2 m wide: whoever walks meets the robot in the middle."""
    polygon = ((-6.0, -1.0), (6.0, -1.0), (6.0, 1.0), (-6.0, 1.0))
    rules = Rules(time_limit=6.0, ends_on=("time",))
    return room(people, polygon=polygon, robot=robot, goal=(5.0, 0.0), rules=rules, seed=3)


def test_deviation_and_slowing_by_hand() -> None:
    """One walks 0.5 m in 1 s and would have gone 1 m; the other, who stands, is not asked."""
    scene = room([walker(1, 0.0, 0.0), Human(2, Pose(3.0, 3.0))])
    here = [line((0.0, 0.0), (0.05, 0.0), 11), stay(3.0, 3.0, 11)]
    alone = np.zeros((11, 2, 2))
    alone[:, 0, 0] = np.linspace(0.0, 1.0, 11)
    told = (scene, stay(-3.0, 0.0, 11), here)
    assert value("human_deviation_mean", *told, alone=alone) == pytest.approx(0.25)
    assert value("human_deviation_max", *told, alone=alone) == pytest.approx(0.5)
    assert value("human_slowing", *told, alone=alone) == pytest.approx(0.5)
    assert value("human_deviation_mean", *told) is None


def test_speed_ratio_is_of_walkers_only() -> None:
    scene = room([walker(1, 0.0, 0.0, desired_speed=1.0), Human(2, Pose(3.0, 3.0))])
    here = [line((0.0, 0.0), (0.05, 0.0), 11), stay(3.0, 3.0, 11)]
    assert value("human_speed_ratio", scene, stay(-3.0, 0.0, 11), here) == pytest.approx(0.5)
    assert value("human_speed_ratio", room([Human(2, Pose(3.0, 3.0))]), stay(0, 0, 3), [stay(3, 3, 3)]) is None


def test_people_who_ignore_a_robot_out_of_their_way_walk_as_if_alone() -> None:
    aside = room(
        [walker(k, -2.0 + k, 1.0, reacts_to_robot=0.0) for k in (1, 2, 3)],
        rules=Rules(time_limit=4.0, ends_on=("time",)), polygon=((-40.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-40.0, 4.0)),
        robot=Pose(-39.0, 0.0),
    )  # fmt: skip
    record = played(aside)
    alone = without_robot(record)
    assert alone is not None
    assert np.array_equal(alone, record.looks.humans[:, :, :2])
    assert measure(record)["human_deviation_max"] == 0.0


def test_a_robot_in_the_way_disturbs() -> None:
    record = played(corridor(walker(1, -5.0, 0.0), walker(2, 5.0, 0.2, 3.1), robot=Pose(0.0, 0.0)))
    told = measure(record)
    assert told["human_deviation_max"] is not None
    assert told["human_deviation_max"] > 0.1
    assert without_robot(record)[0].tolist() == [[-5.0, 0.0], [5.0, 0.2]]  # type: ignore[index]


def test_of_a_mirror_image_it_is_that_of_the_original() -> None:
    record = played(corridor(walker(1, -5.0, 0.0), walker(2, 5.0, 0.2, 3.1), robot=Pose(0.0, 0.1)))
    told, image = measure(record), measure(mirrored(record))
    assert [image[name] for name in DISTURBANCE] == pytest.approx([told[name] for name in DISTURBANCE], abs=1e-6)


def test_it_is_unknown_where_nobody_walks_and_where_other_physics_made_the_run() -> None:
    standing = played(corridor(Human(1, Pose(-5.0, 0.0)), robot=Pose(0.0, 0.0)))
    assert without_robot(standing) is None
    walking = played(corridor(walker(1, -5.0, 0.0), robot=Pose(0.0, 0.0)))
    other = replace(walking, document={**walking.document, "physics": 0})
    assert without_robot(other) is None
    assert measure(walking, rerun=False)["human_slowing"] is None
    assert Trajectory(walking).alone is None
