"""Messages of ROS 2 as dataclasses and JSON."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents import Lidar, Odometry, PeopleDetector, ros_messages as ros
from sonata2d.core import geometry

from .test_sensors import watched


@pytest.fixture(scope="module")
def readings() -> Any:
    seen, _ = watched(
        Lidar(rays=30, dropout=0.2, distance=3.0), Odometry(), PeopleDetector(angle=6.2),
        scene=s2.generate("sonata-2020", 4), ticks=12,
    )  # fmt: skip
    return seen[-1]


def test_a_scan_has_the_angles_and_ranges_of_the_reading(readings: Any) -> None:
    scan = ros.LaserScan.of(readings.lidar, 0.1)
    assert (scan.header.stamp.sec, scan.header.stamp.nanosec) == (1, 100_000_000)
    angles = scan.angle_min + scan.angle_increment * np.arange(30)
    np.testing.assert_allclose(angles, readings.lidar.angles, atol=1e-12)
    np.testing.assert_array_equal(scan.ranges, readings.lidar.ranges)
    assert scan.range_max == 3.0
    assert scan.scan_time == 0.1
    assert ros.LaserScan.of(readings.lidar, 0.1, scan_time=0.2).scan_time == 0.2


def test_odometry_and_people_keep_their_numbers(readings: Any) -> None:
    odometry, people = ros.Odometry.of(readings.odometry, 0.1), ros.People.of(readings.people_detector, 0.1)
    pose = odometry.pose.pose.in_plane
    assert pose.position == readings.odometry.pose.position
    assert pose.theta == pytest.approx(readings.odometry.pose.theta, abs=1e-6)
    assert odometry.twist.twist.in_plane == readings.odometry.twist
    assert [(p.position.x, p.position.y) for p in people.people] == [
        tuple(row) for row in readings.people_detector.position.tolist()
    ]


@pytest.mark.parametrize("theta", [0.0, 1.0, -3.0, 3.1])
def test_quaternions_hold_headings(theta: float) -> None:
    quaternion = ros.Quaternion.of(theta)
    assert quaternion.theta == pytest.approx(theta, abs=1e-6)
    size = math.hypot(quaternion.x, quaternion.y, quaternion.z, quaternion.w)
    assert size == pytest.approx(1.0, abs=1e-6)


def test_twists_go_both_ways() -> None:
    twist = geometry.Twist(0.5, -0.1, 0.3)
    assert ros.Twist.of(twist).in_plane == twist
    assert ros.from_json(ros.Twist, ros.to_json(ros.Twist.of(twist))).in_plane == twist


def test_a_path_faces_along_its_points() -> None:
    path = ros.Path.of(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]]))
    headings = [pose.pose.orientation.theta for pose in path.poses]
    assert headings == pytest.approx([0.0, math.pi / 2, math.pi / 2], abs=1e-6)


def test_json_holds_what_was_written_and_has_no_infinities(readings: Any) -> None:
    scan = ros.LaserScan.of(readings.lidar, 0.1)
    text = ros.to_json(scan)
    assert "Infinity" not in text
    assert "NaN" not in text
    assert json.loads(text)["ranges"].count(None) == int((~np.isfinite(readings.lidar.ranges)).sum())
    again = ros.from_json(ros.LaserScan, text)
    finite = np.isfinite(scan.ranges)
    np.testing.assert_array_equal(np.array(again.ranges)[finite], np.array(scan.ranges)[finite])
    people = ros.People.of(readings.people_detector, 0.1)
    assert asdict(ros.from_json(ros.People, ros.to_json(people))) == asdict(people)


@pytest.mark.parametrize(
    ("kind", "text", "message"),
    [
        (ros.Twist, '{"linear": {"x": "fast"}}', "Twist.linear.x must be a number, got 'fast'"),
        (ros.Twist, '{"linear": {"x": [1, 2]}}', "Twist.linear.x must be a number, got"),
        (ros.LaserScan, '{"ranges": "abc"}', "LaserScan.ranges must be a JSON array, got 'abc'"),
        (ros.LaserScan, '{"ranges": [1, "b"]}', r"LaserScan.ranges\[1\] must be a number, got 'b'"),
        (ros.Odometry, '{"child_frame_id": null}', "Odometry.child_frame_id must be a string, got None"),
        (ros.Header, '{"stamp": {"sec": null}}', "Header.stamp.sec must be a whole number, got None"),
        (ros.Odometry, '{"pose": {"covariance": [1, 2]}}', "a covariance has 36 numbers, row by row, got 2"),
    ],
)
def test_json_with_values_of_other_types_is_refused(kind: type, text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ros.from_json(kind, text)


def test_numbers_of_numpy_are_written() -> None:
    message: Any = ros.Twist(ros.Vector3(x=np.float32(0.5)))  # type: ignore[arg-type]
    assert ros.from_json(ros.Twist, ros.to_json(message)).in_plane == geometry.Twist(0.5)
    scan: Any = ros.LaserScan(ranges=np.array([1.0, np.inf]))  # type: ignore[arg-type]
    assert json.loads(ros.to_json(scan))["ranges"] == [1.0, None]


def test_json_with_other_keys_is_refused() -> None:
    with pytest.raises(ValueError, match=r"Twist\.linear has no field 'w'; fields are x, y, z"):
        ros.from_json(ros.Twist, '{"linear": {"w": 1.0}}')
    with pytest.raises(ValueError, match="Twist must be a JSON object, got 3"):
        ros.from_json(ros.Twist, "3")
