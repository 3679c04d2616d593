"""The difficulty of scenes worked out by hand, and what the expert proves."""

from __future__ import annotations

import json
import math

import pytest
from click.testing import CliRunner
from sonata2d_cli import main

import sonata2d as s2
from sonata2d.core.entities import Human, Wall
from sonata2d.core.geometry import Pose, Twist
from sonata2d.metrics import certify, difficulty

from ..conftest import room

HALL = ((-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (-10.0, 10.0))
START, GOAL = Pose(-4.0, 0.0), (4.0, 0.0)


class Still(s2.Controller):
    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return Twist()


def test_an_empty_room_takes_the_time_of_the_straight_way() -> None:
    found = difficulty(room(polygon=HALL, robot=START, goal=GOAL))
    assert found.free_time == pytest.approx((8.0 - 0.4) / room().robot.top_speed)
    assert (found.straightness, found.turns, found.passage, found.narrowness) == (1.0, 0.0, 3.0, 0.0)
    assert (found.density, found.encounters, found.standing) == (0.0, 0.0, 0)


def test_a_gap_is_narrow_and_a_way_round_turns() -> None:
    gap = [Wall((0.0, -10.0), (0.0, -0.5)), Wall((0.0, 0.5), (0.0, 10.0))]
    found = difficulty(room(polygon=HALL, inner=gap, robot=START, goal=GOAL))
    assert found.passage == pytest.approx(1.0, abs=0.01)
    assert found.narrowness == pytest.approx(1.0 - 0.4 / 2.4, abs=0.01)
    around = difficulty(room(polygon=HALL, inner=[Wall((0.0, -10.0), (0.0, 4.0))], robot=START, goal=GOAL))
    assert around.straightness == pytest.approx(8.0 / (2.0 * math.hypot(4.0, 4.0)), abs=0.05)
    assert around.turns == pytest.approx(math.pi / 2, abs=0.3)
    assert around.passage == 3.0  # there is much room on the other side
    assert around.value > found.value > difficulty(room(polygon=HALL, robot=START, goal=GOAL)).value


def test_people_are_met_where_both_are_at_the_same_time() -> None:
    meets = Human(1, Pose(4.0, 0.0), behaviour="walking", goals=((-4.0, 0.0),))
    aside = Human(2, Pose(4.0, 6.0), behaviour="walking", goals=((-4.0, 6.0),))
    wanders = Human(3, Pose(0.0, 8.0), behaviour="wandering", desired_speed=1.0)
    stands = Human(4, Pose(0.0, 1.0))
    found = difficulty(room([meets, aside, stands], polygon=HALL, robot=START, goal=GOAL))
    assert (found.encounters, found.standing) == (1.0, 1)
    assert found.density == pytest.approx(2.0 / (2.0 * 3.0 * 8.0 + 9.0 * math.pi), rel=0.02)
    wandering = difficulty(room([wanders], polygon=HALL, robot=START, goal=GOAL))
    speed = room().robot.top_speed
    swept = 2.0 * (1.0 + 0.3 + wanders.radius) * math.hypot(1.0, speed) * 7.6 / speed
    assert wandering.encounters == pytest.approx(1.0 - math.exp(-swept / 400.0))


def test_without_a_path_the_difficulty_is_infinite() -> None:
    wall = [Wall((0.0, -10.0), (0.0, 10.0))]
    assert difficulty(room(polygon=HALL, inner=wall, robot=START, goal=GOAL)).value == math.inf


def test_certificates() -> None:
    easy = room(polygon=HALL, robot=START, goal=GOAL)
    assert certify(easy).solvable == "widely"
    assert certify(easy, Still()).solvable == "unknown"
    assert certify(easy, Still()).time is None
    narrow = [Wall((0.0, -10.0), (0.0, -0.36)), Wall((0.0, 0.36), (0.0, 10.0))]
    found = certify(room(polygon=HALL, inner=narrow, robot=START, goal=GOAL))
    assert found.solvable == "yes"
    assert found.time is not None
    assert 0.01 < found.clearance < 0.1


def test_harder_scenes_take_the_expert_longer() -> None:
    times = []
    for episode in range(12):
        scene = s2.generate("sonata-2020", 5, episode)
        outcome = s2.Episode(scene, s2.load_controller("social-planner")).run()
        times.append((difficulty(scene).value, outcome.time))
    hard = sorted(times)[6:]
    assert sum(time for _, time in hard) > 1.5 * sum(time for _, time in sorted(times)[:6])


def test_the_command_shows_scenes() -> None:
    done = CliRunner().invoke(main, ["scenarios", "difficulty", "sonata-2020", "--scenes", "2", "--certify"])
    assert done.exit_code == 0, done.output
    assert "solvable" in done.output.splitlines()[0]
    assert "sonata-2020: difficulty" in done.output
    done = CliRunner().invoke(main, ["scenarios", "difficulty", "sonata-2020", "--scenes", "2", "--json"])
    rows = json.loads(done.output)["scenes"]
    assert rows[0]["value"] == difficulty(s2.generate("sonata-2020", 0, 0)).value
