"""Frames of reference, thinning and noise: what must stay stays, to rounding."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonata2d.datasets.augmentation import subsampled, with_pose_noise
from sonata2d.datasets.mirror import mirrored
from sonata2d.datasets.motion import Motion, motion_of
from sonata2d.datasets.reference_frames import goal_frame, robot_frame, seen_from, world_frame
from sonata2d.record.record import EpisodeRecord

COORDINATE = st.floats(-20.0, 20.0)


def near(one: Motion, other: Motion, tolerance: float = 1e-9) -> None:
    """All numbers alike; angles up to a full turn."""
    for key, angles in (("robot", [2]), ("humans", [2, 6]), ("goal", [2]), ("walls", []), ("objects", [2])):
        apart = getattr(one, key) - getattr(other, key)
        apart[..., angles] = (apart[..., angles] + np.pi) % (2 * np.pi) - np.pi
        assert np.nanmax(np.abs(apart), initial=0.0) < tolerance, key


@given(x=COORDINATE, y=COORDINATE, theta=st.floats(-10.0, 10.0))
def test_there_and_back_is_the_same(odd: EpisodeRecord, x: float, y: float, theta: float) -> None:
    motion = motion_of(odd)
    away = seen_from(motion, (x, y, theta), "goal")
    near(world_frame(away, (x, y, theta)), motion)
    speed = np.hypot(away.humans[..., 3], away.humans[..., 4])
    assert speed == pytest.approx(np.hypot(motion.humans[..., 3], motion.humans[..., 4]))
    angles = np.concatenate((away.humans[..., 2].ravel(), away.humans[..., 6].ravel(), away.robot[:, 2]))
    assert ((angles > -np.pi) & (angles <= np.pi)).all()


def test_the_robot_frame_is_what_the_robots_pose_says(odd: EpisodeRecord) -> None:
    motion = motion_of(odd)
    seen = robot_frame(motion)
    assert np.abs(seen.robot[:, :3]).max() < 1e-12
    for snapshot, humans, goal in zip(odd.snapshots(), seen.humans, seen.goal, strict=True):
        pose = snapshot.robot.pose
        assert humans[:, :2] == pytest.approx(np.array([pose.to_local(h.pose.position) for h in snapshot.humans]))
        assert goal[:2] == pytest.approx(pose.to_local(snapshot.goal))
    near(world_frame(seen, motion.robot[:, :3]), motion)


def test_the_goal_frame_does_not_know_where_the_room_stood(odd: EpisodeRecord) -> None:
    motion = motion_of(odd)
    moved = seen_from(motion, (3.0, -4.0, 2.0), "world")
    for centre in ("goal", "robot"):
        near(goal_frame(motion, centre), goal_frame(moved, centre))
    fixed, carried = goal_frame(motion), goal_frame(motion, "robot")
    assert np.abs(fixed.goal[:, :2]).max() < 1e-12
    assert fixed.robot[0, 0] < 0.0
    assert abs(fixed.robot[0, 1]) < 1e-9
    assert np.ptp(fixed.walls, axis=0).max() == 0.0
    assert np.abs(carried.goal[:, 1]).max() < 1e-9
    assert (carried.goal[:, 0] > 0.0).all()


def test_the_goal_frame_of_an_image_is_the_image_of_the_goal_frame(odd: EpisodeRecord) -> None:
    one, twin = goal_frame(motion_of(odd)), goal_frame(motion_of(mirrored(odd)))
    for key in ("robot", "humans"):
        assert getattr(twin, key)[..., [0, 3]] == pytest.approx(getattr(one, key)[..., [0, 3]])
        assert getattr(twin, key)[..., [1, 4, 5]] == pytest.approx(-getattr(one, key)[..., [1, 4, 5]])


def test_a_bad_origin_is_refused(odd: EpisodeRecord) -> None:
    for bad in ((1.0, 2.0), (0.0, 0.0, np.nan), np.zeros((3, 3))):
        with pytest.raises(ValueError, match="origin must be finite"):
            seen_from(motion_of(odd), bad, "world")


@given(every=st.integers(1, 40))
def test_every_so_many_looks_are_kept(odd: EpisodeRecord, every: int) -> None:
    motion = motion_of(odd)
    thin = subsampled(motion, every)
    assert len(thin) == len(motion) // every == len(thin.labels)
    assert len(thin.robot) == len(thin.interactions) == len(thin) + 1
    assert np.array_equal(thin.time, motion.time[::every][: len(thin) + 1])
    assert np.array_equal(thin.command, motion.command[::every][: len(thin)])
    assert thin.dt * len(thin) == pytest.approx(thin.time[-1])
    whole = motion.executed[: len(thin) * every]
    assert thin.executed.sum(axis=0) * every == pytest.approx(whole.sum(axis=0))


def test_thinning_twice_is_thinning_once(odd: EpisodeRecord) -> None:
    motion = motion_of(odd)
    near(subsampled(subsampled(motion, 2), 3), subsampled(motion, 6))
    near(subsampled(motion, 1), motion)
    for bad in (0, -1, len(motion) + 1):
        with pytest.raises(ValueError, match="every must be 1 to 40"):
            subsampled(motion, bad)


def test_noise_is_seeded_and_as_large_as_asked(odd: EpisodeRecord) -> None:
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
