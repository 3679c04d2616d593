"""Frames of reference, subsampling and noise change only what they should, up to rounding."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from sonata2d.datasets.transforms.mirror import mirrored
from sonata2d.record.motion import Motion, motion_of, subsampled, with_pose_noise
from sonata2d.record.record import EpisodeRecord
from sonata2d.record.reference_frames import goal_frame, robot_frame, seen_from, world_frame

COORDINATE = st.floats(-20.0, 20.0)


def assert_close(one: Motion, other: Motion, tolerance: float = 1e-9) -> None:
    """Compare all numbers; angles modulo a full turn."""
    for key, angles in (("robot", [2]), ("humans", [2, 6]), ("goal", [2]), ("walls", []), ("objects", [2])):
        difference = getattr(one, key) - getattr(other, key)
        difference[..., angles] = (difference[..., angles] + np.pi) % (2 * np.pi) - np.pi
        assert np.nanmax(np.abs(difference), initial=0.0) < tolerance, key


@given(x=COORDINATE, y=COORDINATE, theta=st.floats(-10.0, 10.0))
def test_world_frame_inverts_seen_from(odd: EpisodeRecord, x: float, y: float, theta: float) -> None:
    motion = motion_of(odd)
    moved = seen_from(motion, (x, y, theta), "goal")
    assert_close(world_frame(moved, (x, y, theta)), motion)
    speed = np.hypot(moved.humans[..., 3], moved.humans[..., 4])
    assert speed == pytest.approx(np.hypot(motion.humans[..., 3], motion.humans[..., 4]))
    angles = np.concatenate((moved.humans[..., 2].ravel(), moved.humans[..., 6].ravel(), moved.robot[:, 2]))
    assert ((angles > -np.pi) & (angles <= np.pi)).all()


def test_the_robot_frame_agrees_with_the_robots_pose(odd: EpisodeRecord) -> None:
    motion = motion_of(odd)
    seen = robot_frame(motion)
    assert np.abs(seen.robot[:, :3]).max() < 1e-12
    for snapshot, humans, goal in zip(odd.snapshots(), seen.humans, seen.goal, strict=True):
        pose = snapshot.robot.pose
        assert humans[:, :2] == pytest.approx(np.array([pose.to_local(h.pose.position) for h in snapshot.humans]))
        assert goal[:2] == pytest.approx(pose.to_local(snapshot.goal))
    assert_close(world_frame(seen, motion.robot[:, :3]), motion)


def test_the_goal_frame_is_independent_of_the_world_frame(odd: EpisodeRecord) -> None:
    motion = motion_of(odd)
    moved = seen_from(motion, (3.0, -4.0, 2.0), "world")
    for centre in ("goal", "robot"):
        assert_close(goal_frame(motion, centre), goal_frame(moved, centre))
    fixed, moving = goal_frame(motion), goal_frame(motion, "robot")
    assert np.abs(fixed.goal[:, :2]).max() < 1e-12
    assert fixed.robot[0, 0] < 0.0
    assert abs(fixed.robot[0, 1]) < 1e-9
    assert np.ptp(fixed.walls, axis=0).max() == 0.0
    assert np.abs(moving.goal[:, 1]).max() < 1e-9
    assert (moving.goal[:, 0] > 0.0).all()


def test_the_goal_frame_of_an_image_is_the_image_of_the_goal_frame(odd: EpisodeRecord) -> None:
    one, twin = goal_frame(motion_of(odd)), goal_frame(motion_of(mirrored(odd)))
    for key in ("robot", "humans"):
        assert getattr(twin, key)[..., [0, 3]] == pytest.approx(getattr(one, key)[..., [0, 3]])
        assert getattr(twin, key)[..., [1, 4, 5]] == pytest.approx(-getattr(one, key)[..., [1, 4, 5]])


def test_an_invalid_origin_is_refused(odd: EpisodeRecord) -> None:
    for bad in ((1.0, 2.0), (0.0, 0.0, np.nan), np.zeros((3, 3))):
        with pytest.raises(ValueError, match="origin must be finite"):
            seen_from(motion_of(odd), bad, "world")


@given(every=st.integers(1, 40))
def test_subsampling_keeps_every_kth_state(odd: EpisodeRecord, every: int) -> None:
    motion = motion_of(odd)
    sparse = subsampled(motion, every)
    assert len(sparse) == len(motion) // every == len(sparse.labels)
    assert len(sparse.robot) == len(sparse.interactions) == len(sparse) + 1
    assert np.array_equal(sparse.time, motion.time[::every][: len(sparse) + 1])
    assert np.array_equal(sparse.command, motion.command[::every][: len(sparse)])
    assert sparse.dt * len(sparse) == pytest.approx(sparse.time[-1])
    executed = motion.executed[: len(sparse) * every]
    assert sparse.executed.sum(axis=0) * every == pytest.approx(executed.sum(axis=0))


def test_subsampling_by_2_and_3_is_subsampling_by_6(odd: EpisodeRecord) -> None:
    motion = motion_of(odd)
    assert_close(subsampled(subsampled(motion, 2), 3), subsampled(motion, 6))
    assert_close(subsampled(motion, 1), motion)
    for bad in (0, -1, len(motion) + 1):
        with pytest.raises(ValueError, match="every must be 1 to 40"):
            subsampled(motion, bad)


def test_noise_is_seeded_and_has_the_requested_deviation(odd: EpisodeRecord) -> None:
    motion = motion_of(odd)
    one, same, other = (with_pose_noise(motion, seed, position=0.1, angle=0.02) for seed in (1, 1, 2))
    assert np.array_equal(one.humans, same.humans)
    assert not np.array_equal(one.humans, other.humans)
    many = np.stack(
        [with_pose_noise(motion, [7, k], position=0.1, angle=0.02).humans - motion.humans for k in range(100)]
    )
    many[..., [2, 6]] = (many[..., [2, 6]] + np.pi) % (2 * np.pi) - np.pi
    deviation = many.std(axis=(0, 1, 2))
    assert deviation[[0, 1]] == pytest.approx(0.1, rel=0.03)
    assert deviation[[2, 6]] == pytest.approx(0.02, rel=0.03)
    assert np.abs(many.mean(axis=(0, 1, 2))).max() < 0.005
    assert np.abs(deviation[[3, 4, 5]]).max() == 0.0
    assert np.array_equal(one.robot, motion.robot)
    assert np.array_equal(with_pose_noise(motion, 5, position=0.0, angle=0.0).humans[..., :2], motion.humans[..., :2])
    with pytest.raises(ValueError, match="position must be"):
        with_pose_noise(motion, 1, position=-1.0)
