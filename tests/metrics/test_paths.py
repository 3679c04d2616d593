"""Lengths, turns, speeds, worked out by hand."""

from __future__ import annotations

import math

import pytest

from sonata2d.core.entities import Wall
from sonata2d.core.geometry import Pose

from ..conftest import room
from .samples import line, stay, value

STRAIGHT = line((-3.0, 0.0), (0.1, 0.0), 57)  # 5.6 m in 5.6 s, to the rim of the goal at (3, 0)


def test_path_length_and_speed_of_a_straight_way() -> None:
    assert value("path_length", room(), STRAIGHT) == pytest.approx(5.6)
    assert value("speed_mean", room(), STRAIGHT) == pytest.approx(1.0)
    assert value("speed_max", room(), STRAIGHT) == pytest.approx(1.0)
    assert value("speed_mean", room(), STRAIGHT[:1]) is None


def test_the_shortest_way_ends_at_the_rim_of_the_goal() -> None:
    assert value("shortest_length", room(), STRAIGHT) == pytest.approx(5.6)
    assert value("spl", room(), STRAIGHT) == pytest.approx(1.0)
    assert value("stl", room(), STRAIGHT) == pytest.approx(1.0)  # its limit ahead is 1 m/s


def test_spl_weighs_a_detour_and_stl_a_slow_way() -> None:
    """Up 1 m, 5.6 m ahead, down 1 m: 7.6 m for 5.6."""
    up = line((-3.0, 0.0), (0.0, 0.1), 11)
    detour = up + line((-3.0, 1.0), (0.1, 0.0), 57)[1:] + line((2.6, 1.0), (0.0, -0.1), 11)[1:]
    assert value("spl", room(), detour) == pytest.approx(5.6 / 7.6)
    slow = line((-3.0, 0.0), (0.05, 0.0), 113)
    assert value("stl", room(), slow) == pytest.approx(0.5)
    assert value("spl", room(), slow) == pytest.approx(1.0)


def test_spl_is_nothing_without_success_and_unknown_without_a_way() -> None:
    assert value("spl", room(), STRAIGHT[:20]) == 0.0
    shut = room(inner=[Wall((0.0, -4.0), (0.0, 4.0))])
    assert value("shortest_length", shut, stay(-3.0, 0.0, 5)) is None
    assert value("spl", shut, stay(-3.0, 0.0, 5)) is None
    assert value("spl", room(robot=Pose(3.0, 0.0)), stay(3.0, 0.0, 1)) == 1.0


def test_the_shortest_way_goes_round_walls_as_wide_as_the_robot() -> None:
    """A wall from y = -4 to 0 at x = 0: the way bends at its end, 0.3 m off. By arcs it is 2 √9 - … long; polygons
    are right to a few centimetres."""
    scene = room(inner=[Wall((0.0, -4.0), (0.0, 0.0))], robot=Pose(-3.0, 0.0), goal=(3.0, 0.0))
    tangent = math.sqrt(9.0 - 0.09)
    by_arc = 2.0 * tangent + 0.3 * 2.0 * math.asin(0.1)
    told = value("shortest_length", scene, stay(-3.0, 0.0, 3))
    assert told is not None
    assert by_arc - 0.4 <= told <= by_arc - 0.4 + 0.06


def test_heading_change_counts_both_ways_and_the_short_way_round() -> None:
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


def test_turning_at_constant_speed_accelerates() -> None:
    """Velocity (1, 0) then (0, 1) m/s: √2 m/s in 0.1 s."""
    robot = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]
    assert value("acceleration_max", room(), robot) == pytest.approx(10.0 * math.sqrt(2.0), abs=1e-6)
