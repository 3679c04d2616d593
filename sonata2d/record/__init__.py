"""Frames to JSON and back; the only place that knows the key names of the file."""

from .check import Listed, Problem, check_dataset, check_episode, check_listed, check_manifest, listed_files
from .dataset import CROISSANT, MANIFEST, METRICS, read_manifest
from .files import read_bytes, safe_name, write_atomically
from .reader import read_episode
from .record import EpisodeRecord
from .recorder import EpisodeRecorder, JsonRecorder

__all__ = [
    "CROISSANT",
    "MANIFEST",
    "METRICS",
    "EpisodeRecord",
    "EpisodeRecorder",
    "JsonRecorder",
    "Listed",
    "Problem",
    "check_dataset",
    "check_episode",
    "check_listed",
    "check_manifest",
    "listed_files",
    "read_bytes",
    "read_episode",
    "read_manifest",
    "safe_name",
    "write_atomically",
]
