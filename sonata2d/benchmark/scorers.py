"""Learned scores of episodes, whose columns are advisory: functions of plug-ins, and models in files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

from ..errors import BenchmarkError, ConfigError
from ..record.files import sha256_of
from ..record.record import EpisodeRecord
from ..registry import SCORERS
from . import alt, rating
from .scoring import Values

MODELS = (rating.SUFFIX, alt.SUFFIX)  # endings of the files of models
LEARNED = "learned."  # beginning of the names of learned scores among the values of a scene


def learned_score(name: str, record: EpisodeRecord, values: Values) -> float | None:
    """A learned score of an episode.

    Args:
        name: of a registered scorer, or the path of a model.
        record: the episode.
        values: of the scene.

    Raises:
        ConfigError: the name is unknown, or the plug-in is no function.
        BenchmarkError: the file is no model.
    """
    if name.endswith(rating.SUFFIX):
        return _rating_model(name)(values)
    return _alt_model(name)(record) if name.endswith(alt.SUFFIX) else _function(name)(record)


def column_of(name: str) -> str:
    """The name of the column of a learned score: its own, or the name of the file without its ending."""
    return Path(name).stem if name.endswith(MODELS) else name


def checked_scorers(names: Sequence[str]) -> dict[str, str]:
    """Check that learned scores exist; returns the hash of each file by its name.

    Raises:
        ConfigError: a name is unknown, or two columns have the same name.
        BenchmarkError: a file is missing, or no model.
    """
    files = {}
    for name in names:
        if name.endswith(MODELS):
            if not Path(name).is_file():
                raise BenchmarkError(f"there is no model {name}")
            _rating_model(name) if name.endswith(rating.SUFFIX) else _alt_model(name)
            files[Path(name).name] = sha256_of(Path(name))
        else:
            _function(name)
    columns = [column_of(name) for name in names]
    for column in columns:
        if columns.count(column) > 1:
            raise ConfigError(f"two columns would have the name {column!r}; rename the learned score")
    return files


@cache
def _rating_model(path: str) -> rating.RatingModel:
    return rating.RatingModel.load(path)


@cache
def _alt_model(path: str) -> alt.AltModel:
    return alt.AltModel.load(path)


def _function(name: str) -> Callable[[EpisodeRecord], float | None]:
    function: Callable[[EpisodeRecord], float | None] = SCORERS.load(
        name, lambda item: None if callable(item) else "is no function of an episode"
    )
    return function
