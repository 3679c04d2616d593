from .files import read_bytes as read_bytes, safe_name as safe_name, write_atomically as write_atomically
from .motion import (
    Motion as Motion,
    motion_of as motion_of,
    subsampled as subsampled,
    with_pose_noise as with_pose_noise,
)
from .reader import read_episode as read_episode
from .record import EpisodeRecord as EpisodeRecord
from .recorder import EpisodeRecorder as EpisodeRecorder, JsonRecorder as JsonRecorder
from .reference_frames import (
    goal_frame as goal_frame,
    robot_frame as robot_frame,
    seen_from as seen_from,
    world_frame as world_frame,
)
