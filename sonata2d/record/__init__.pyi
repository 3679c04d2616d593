from .files import read_bytes as read_bytes, safe_name as safe_name, write_atomically as write_atomically
from .reader import read_episode as read_episode
from .record import EpisodeRecord as EpisodeRecord
from .recorder import EpisodeRecorder as EpisodeRecorder, JsonRecorder as JsonRecorder
