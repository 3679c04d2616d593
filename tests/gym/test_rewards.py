"""Rewards: each formula at chosen distances and outcomes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import Human
from sonata2d.core.geometry import Pose
from sonata2d.core.snapshot import Contact, Outcome, Snapshot
from sonata2d.gym.rewards import REWARDS, goal_distance, human_clearance, reward_of
from tests.conftest import room

GOAL, TIMEOUT = (Outcome(status, "", 1, 0.1) for status in ("goal", "timeout"))  # type: ignore[arg-type]
TOUCH = (Contact("human", 1, True, False),)


def snapshots(gap: float, contacts: tuple[Contact, ...] = ()) -> tuple[Snapshot, Snapshot]:
    """Two snapshots, 0.1 m nearer to the goal in the second, in which the gap to the nearest pedestrian is given, m."""
    found = []
    for x in (0.0, 0.1):
        human = Human(1, Pose(x, 0.3 + gap + 0.14, 0.0), radius=0.14, breadth=0.28)
        scene = room([human], robot=Pose(x, 0.0, 0.0))
        found.append(s2.Episode(scene, s2.StraightToGoal()).snapshot())
    return found[0], replace_contacts(found[1], contacts)


def replace_contacts(snapshot: Snapshot, contacts: tuple[Contact, ...]) -> Snapshot:
    assert snapshot.robot is not None
    assert snapshot.humans is not None
    return replace(snapshot, contacts=contacts)


@pytest.mark.parametrize(
    ("name", "gap", "contacts", "outcome", "expected"),
    [
        ("sparse", 1.0, (), None, 0.0),
        ("sparse", 1.0, (), GOAL, 1.0),
        ("sparse", 0.0, TOUCH, None, -1.0),
        ("distance", 1.0, (), None, 0.1 - 0.01),
        ("distance", 1.0, (), GOAL, 0.1 - 0.01 + 5.0),
        ("distance", 0.15, (), None, 0.1 - 0.01 - 2.0 * (1.0 - 0.15 / 0.45) * 0.1),
        ("distance", 0.0, TOUCH, None, 0.1 - (0.1 + 1.0 + 2.0) * 0.1),
        ("crowdnav", 1.0, (), None, 0.0),
        ("crowdnav", 1.0, (), GOAL, 1.0),
        ("crowdnav", 0.1, (), None, -0.1 + 0.1 / 2.0),
        ("crowdnav", 0.0, TOUCH, None, -0.25),
        ("dsrnn", 1.0, (), None, 0.2),
        ("dsrnn", 0.05, (), None, 2.5 * (0.05 - 0.25)),
        ("dsrnn", 0.0, TOUCH, None, -20.0),
        ("dsrnn", 1.0, (), GOAL, 10.0),
        ("socnavgym", 1.0, (), None, 0.01 - 1e-6),
        ("socnavgym", 0.4, (), None, 0.01 - 1e-6 - 0.5 * 0.2 * 0.1),
        ("socnavgym", 1.0, (), TIMEOUT, -5.0),
        ("socnavgym", 0.0, TOUCH, None, -10.0),
    ],
)
def test_formulas(
    name: str, gap: float, contacts: tuple[Contact, ...], outcome: Outcome | None, expected: float
) -> None:
    assert REWARDS[name]()(*snapshots(gap, contacts), outcome) == pytest.approx(expected, abs=1e-9)


def test_the_clearance_is_that_of_the_library() -> None:
    scene = s2.generate(s2.load_scenario("crowded-hall"), 1)
    episode = s2.Episode(scene, s2.StraightToGoal())
    for _ in range(20):
        frame = episode.step()
        assert frame is not None
        assert human_clearance(frame.snapshot) == pytest.approx(s2.clearance(frame.snapshot), abs=1e-12)
        x, y = frame.snapshot.robot.position
        assert goal_distance(frame.snapshot) == pytest.approx(math.hypot(scene.goal.x - x, scene.goal.y - y))
    empty = s2.Episode(s2.generate(s2.load_scenario("empty"), 1), s2.StraightToGoal()).snapshot()
    assert human_clearance(empty) == math.inf


def test_a_function_is_a_reward() -> None:
    import sonata2d.gym as s2g

    env = s2g.SocialNavEnv("empty", reward=lambda before, after, outcome: float(after.tick))
    env.reset(seed=0)
    assert [env.step(env.action_space.sample())[1] for _ in range(3)] == [1.0, 2.0, 3.0]
    assert reward_of(REWARDS["dsrnn"]()) == REWARDS["dsrnn"]()


def test_what_is_no_reward_is_named() -> None:
    import sonata2d.gym as s2g

    with pytest.raises(TypeError, match=r"pass Distance\(\)"):
        s2g.SocialNavEnv("empty", reward=s2g.Distance)
    with pytest.raises(TypeError, match=r"a function \(before, after, outcome\) -> float, got .*too many positional"):
        s2g.SocialNavEnv("empty", reward=lambda before, after: 0.0)  # type: ignore[arg-type, misc]
    for wrong in (None, np.zeros(2), math.nan, "one"):
        env = s2g.SocialNavEnv("empty", reward=lambda before, after, outcome, wrong=wrong: wrong)
        env.reset(seed=0)
        with pytest.raises(ValueError, match="must return a finite number, it returned"):
            env.step(env.action_space.sample())


def test_the_weights_of_a_reward_can_be_changed() -> None:
    import sonata2d.gym as s2g

    plain, strict = s2g.Distance(), s2g.Distance(contact=-5.0)
    scene = s2.generate(s2.load_scenario("empty"), 0)
    snapshot = s2.Episode(scene).observe()
    touching = replace(snapshot, contacts=TOUCH)
    difference = strict(snapshot, touching, None) - plain(snapshot, touching, None)
    assert difference == pytest.approx(-4.0 * scene.rules.dt)
