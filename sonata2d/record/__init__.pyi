from .files import read_bytes as read_bytes
from .files import safe_name as safe_name
from .files import write_atomically as write_atomically
from .reader import read_episode as read_episode
from .record import EpisodeRecord as EpisodeRecord
from .recorder import EpisodeRecorder as EpisodeRecorder
from .recorder import JsonRecorder as JsonRecorder
