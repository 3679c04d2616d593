from .augmentation import subsampled as subsampled
from .augmentation import with_pose_noise as with_pose_noise
from .check import (
    Listed as Listed,
)
from .check import (
    Problem as Problem,
)
from .check import (
    check_dataset as check_dataset,
)
from .check import (
    check_episode as check_episode,
)
from .check import (
    check_listed as check_listed,
)
from .check import (
    check_manifest as check_manifest,
)
from .check import (
    listed_files as listed_files,
)
from .full_card import write_card as write_card
from .generate import generate_dataset as generate_dataset
from .manifest import CROISSANT as CROISSANT
from .manifest import MANIFEST as MANIFEST
from .manifest import METRICS as METRICS
from .manifest import read_manifest as read_manifest
from .merge import merge_datasets as merge_datasets
from .mirror import mirror_dataset as mirror_dataset
from .mirror import mirror_file as mirror_file
from .mirror import mirrored as mirrored
from .mirror_image import twist_image as twist_image
from .motion import Motion as Motion
from .motion import motion_of as motion_of
from .reference_frames import (
    goal_frame as goal_frame,
)
from .reference_frames import (
    robot_frame as robot_frame,
)
from .reference_frames import (
    seen_from as seen_from,
)
from .reference_frames import (
    world_frame as world_frame,
)
from .replay import branch as branch
from .split import split_dataset as split_dataset
from .verification import files_of as files_of
from .verification import verify as verify
