"""Metrics of path and motion, by hand."""

from __future__ import annotations

import math

import pytest

from sonata2d.core.entities import Wall
from sonata2d.core.geometry import Pose

from ..conftest import room
from .samples import line, stay, value

STRAIGHT = line((-3.0, 0.0), (0.1, 0.0), 57)  # 5.6 m in 5.6 s, to the edge of the goal at (3, 0)


def test_path_length_and_speed_of_a_straight_path() -> None:
    assert value("path_length", room(), STRAIGHT) == pytest.approx(5.6)
    assert value("speed_mean", room(), STRAIGHT) == pytest.approx(1.0)
    assert value("speed_max", room(), STRAIGHT) == pytest.approx(1.0)
    assert value("speed_mean", room(), STRAIGHT[:1]) is None


def test_shortest_path_ends_at_the_edge_of_the_goal() -> None:
    assert value("shortest_length", room(), STRAIGHT) == pytest.approx(5.6)
    assert value("spl", room(), STRAIGHT) == pytest.approx(1.0)
    assert value("stl", room(), STRAIGHT) == pytest.approx(1.0)  # the speed limit ahead is 1 m/s


def test_spl_decreases_with_detours_and_stl_with_low_speed() -> None:
    """The detour goes up 1 m, ahead 5.6 m and down 1 m: 7.6 m instead of 5.6 m."""
    up = line((-3.0, 0.0), (0.0, 0.1), 11)
    detour = up + line((-3.0, 1.0), (0.1, 0.0), 57)[1:] + line((2.6, 1.0), (0.0, -0.1), 11)[1:]
    assert value("spl", room(), detour) == pytest.approx(5.6 / 7.6)
    slow = line((-3.0, 0.0), (0.05, 0.0), 113)
    assert value("stl", room(), slow) == pytest.approx(0.5)
    assert value("spl", room(), slow) == pytest.approx(1.0)


def test_spl_is_zero_without_success_and_undefined_without_a_path() -> None:
    assert value("spl", room(), STRAIGHT[:20]) == 0.0
    divided = room(inner=[Wall((0.0, -4.0), (0.0, 4.0))])
    assert value("shortest_length", divided, stay(-3.0, 0.0, 5)) is None
    assert value("spl", divided, stay(-3.0, 0.0, 5)) is None
    assert value("spl", room(robot=Pose(3.0, 0.0)), stay(3.0, 0.0, 1)) == 1.0
    twice = [(2.0, 0.0, 0.0), (1.9, 0.0, 0.0), *line((2.0, 0.0), (0.1, 0.0), 7)]  # 0.8 m; 0.6 m are the shortest
    assert value("spl", room(robot=Pose(2.0, 0.0)), [list(pose) for pose in twice]) == pytest.approx(0.75)


def test_heading_change_adds_both_directions_and_wraps() -> None:
    robot = [[0.0, 0.0, theta] for theta in (0.0, 0.5, 0.2, 3.1, -3.1)]
    assert value("cumulative_heading_change", room(), robot) == pytest.approx(0.5 + 0.3 + 2.9 + (2 * math.pi - 6.2))


def test_acceleration_and_jerk_of_steps_in_velocity() -> None:
    """Velocities 0, 0, 1, 3, 3 m/s along x: accelerations 0, 10, 20, 0 m/s², jerks 100, 100, -200 m/s³."""
    robot = [[x, 0.0, 0.0] for x in (0.0, 0.0, 0.1, 0.4, 0.7)]
    assert value("acceleration_mean", room(), robot) == pytest.approx(7.5)
    assert value("acceleration_max", room(), robot) == pytest.approx(20.0)
    assert value("jerk_mean", room(), robot) == pytest.approx(400.0 / 3.0)
    assert value("jerk_max", room(), robot) == pytest.approx(200.0)
    assert value("jerk_mean", room(), robot[:2]) is None


def test_turning_at_constant_speed_is_an_acceleration() -> None:
    """Velocity (1, 0) and then (0, 1) m/s: a change of √2 m/s in 0.1 s."""
    robot = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]
    assert value("acceleration_max", room(), robot) == pytest.approx(10.0 * math.sqrt(2.0), abs=1e-6)
