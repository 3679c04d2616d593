"""Reactions to the robot and social behaviour as set in a scenario."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.scene import Social
from sonata2d.errors import ConfigError
from sonata2d.record.layout import scene_from_json, scene_to_json


def test_reactions_have_the_weights_of_the_settings() -> None:
    person = {"reactions": {"avoids": 3, "curious": 1}, "ignores_robot": 0.25}
    config = s2.ScenarioConfig(standing=5, wandering=5, tables=0, plants=0, relations=0, person=person, drop=True)
    humans = [human for seed in range(60) for human in s2.generate(config, seed).humans]
    fractions = {kind: n / len(humans) for kind, n in Counter(human.reaction for human in humans).items()}
    assert fractions == pytest.approx({"ignores": 0.25, "avoids": 0.5625, "curious": 0.1875}, abs=0.07)
    assert all((human.reacts_to_robot == 0.0) == (human.reaction == "ignores") for human in humans)
    clearance = np.array([human.robot_clearance for human in humans])
    assert clearance.mean() == pytest.approx(0.125, abs=0.01)  # of normal(0.1, 0.1) within 0..0.3
    assert clearance.std() == pytest.approx(0.077, abs=0.01)


def test_reactions_change_nothing_else_in_a_scene() -> None:
    plain, other = (
        s2.generate(s2.ScenarioConfig(name="one", person=person), 4) for person in ({}, {"reactions": ["stops"]})
    )
    assert {human.reaction for human in other.humans} == {"stops"}
    same = tuple(replace(human, reaction="avoids") for human in other.humans)
    assert same == plain.humans
    assert other.furniture == plain.furniture


def test_social_behaviour_is_off_by_default_and_recorded() -> None:
    assert not s2.generate(s2.ScenarioConfig(), 1).social.is_lively
    config = s2.ScenarioConfig(social={"visits": 0.5, "meets": 0.1, "talk_time": [5, 8]})
    scene = s2.generate(config, 1)
    assert scene.social == Social(visits=0.5, meets=0.1, talk_time=(5.0, 8.0), pause=(1.0, 6.0))
    document = scene_to_json(scene) | {"name": scene.name, "family": scene.family, "seed": scene.seed, "episode": 0}
    assert scene_from_json(document) == scene


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"social": {"visits": 0.7, "joins": 0.6}}, "joins \\+ .* is 1.3"),
        ({"social": {"visit_time": 0}}, "above 0"),
        ({"social": {"pause": -1}}, "social.pause: a time must not be negative"),
        ({"social": {"exits": 0.5}}, "social.exits: social.exits needs doors; add some"),
        ({"social": {"queues": 0.5}}, "social.queues: social.queues needs queues; add some"),
        ({"doors": [{"share": 0}], "social": {"exits": 0.5}}, "doors: at least one door needs a share above 0"),
        ({"doors": [{"inflow": 1e6}]}, "doors: 1000000 people would enter .* lower the inflow"),
        ({"doors": [{"x": 1}]}, "doors.0.y: give x and y, or neither"),
        ({"queues": [{"waiting": 9}]}, "queues.0.waiting: 9 people do not fit into a queue of 8"),
        ({"places": [{"x": 0, "y": 0, "stay": -1}]}, "places.0.stay: a time must not be negative"),
        ({"people": [{"x": 0, "y": 0, "goals": [[1, 1]], "stay": 2}]}, "people.0.stay: stay needs two goals"),
        ({"social": {"vists": 0.7}}, "did you mean 'visits'"),
        ({"person": {"reactions": {"avoids": 0}}}, "at least one reaction"),
        ({"person": {"robot_clearance": {"mean": 2.0}}}, "mean 2.0 is not within"),
        ({"person": {"robot_clearance": {"sd": 1e9}}}, "of the distribution lies within .* use a smaller sd"),
    ],
)
def test_invalid_settings_are_refused(settings: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        s2.ScenarioConfig().changed(**settings)
