"""Data sets and episodes made of others: mirrored, seen from elsewhere, thinned, blurred, split, merged."""

from .frames import goal_frame, robot_frame, seen_from, world_frame
from .image import twist_image
from .merge import merge_datasets
from .mirror import mirror_dataset, mirror_file, mirrored
from .motion import Motion, motion_of
from .noise import with_pose_noise
from .split import split_dataset
from .subsample import subsampled

__all__ = [
    "Motion",
    "goal_frame",
    "merge_datasets",
    "mirror_dataset",
    "mirror_file",
    "mirrored",
    "motion_of",
    "robot_frame",
    "seen_from",
    "split_dataset",
    "subsampled",
    "twist_image",
    "with_pose_noise",
    "world_frame",
]
