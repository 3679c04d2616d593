"""A rating model: predicts how people rate an episode from its scores, learned from the ratings of studies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..collect.rating import Rating, questions, ratings_of
from ..core.floats import FloatFields
from ..core.labels import LabelSpec
from ..core.portable_math import Array
from ..core.wording import counted
from ..datasets.manifest import files_of
from ..errors import BenchmarkError
from ..record.files import read_bytes, sha256_of, write_atomically
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from .scoring import SCORES, Values, values_of

SUFFIX = ".json"
_FORMAT, _VERSION = "sonata2d-rating-model", 1
_FEWEST = 30  # rated episodes
_PENALTIES = (0.1, 1.0, 10.0, 100.0, 1000.0)  # of the ridge


@dataclass(frozen=True, slots=True)
class RatingModel(FloatFields):
    """Ridge regression of mean ratings on the scores of a scene.

    Attributes:
        question: that raters answered.
        episodes, raters: numbers of them.
        correlation: Spearman's rank correlation of ratings with predictions for episodes that were left out.
        features: names of scores.
        mean, scale: of the features; a score that is not defined counts as its mean.
        weights: of the standardised features.
        bias: rating at the mean.
    """

    question: str
    episodes: int
    raters: int
    correlation: float
    features: tuple[str, ...]
    mean: tuple[float, ...]
    scale: tuple[float, ...]
    weights: tuple[float, ...]
    bias: float

    def __call__(self, values: Values) -> float:
        """The predicted rating of a scene, 0 to 1.

        Args:
            values: of the scene, see `scoring.values_of`.
        """
        total = self.bias
        for name, mean, scale, weight in zip(self.features, self.mean, self.scale, self.weights, strict=True):
            value = values.get(name)
            total += 0.0 if value is None else weight * (value - mean) / scale
        return round(min(max(total, 0.0), 1.0), 6)

    def save(self, path: str | Path) -> None:
        """Write the model to a file (.json).

        Raises:
            BenchmarkError: the path ends otherwise.
        """
        if Path(path).suffix != SUFFIX:
            raise BenchmarkError(f"a rating model is written to a {SUFFIX} file, got {path}")
        document = {"format": _FORMAT, "version": _VERSION, **asdict(self)}
        write_atomically(Path(path), orjson.dumps(document, option=orjson.OPT_INDENT_2) + b"\n")

    @classmethod
    def load(cls, path: str | Path) -> RatingModel:
        """Read a model.

        Raises:
            BenchmarkError: the file is no rating model.
        """
        try:
            document = orjson.loads(read_bytes(Path(path)))
            if (document["format"], document["version"]) != (_FORMAT, _VERSION):
                raise ValueError(f"it is {document['format']} {document['version']}")
            names = ("features", "mean", "scale", "weights")
            columns: dict[str, Any] = {name: tuple(document[name]) for name in names}
            if len({len(column) for column in columns.values()}) != 1 or not set(columns["features"]) <= set(SCORES):
                raise ValueError("its features are not the scores of this version")
            if not all(isinstance(v, float | int) for name in names[1:] for v in columns[name]):
                raise ValueError("its weights are no numbers")
            single = ("question", "episodes", "raters", "correlation", "bias")
            given: dict[str, Any] = columns | {name: document[name] for name in single}
            return cls(**given)
        except (KeyError, TypeError, ValueError) as error:
            raise BenchmarkError(f"{path} is no rating model: {error}") from None


def fit_rating_model(folders: Sequence[str | Path]) -> RatingModel:
    """Learn a rating model from rated episodes.

    Ratings are numbers from 0 to 1: no and yes, the place of a class among the classes, or of a slider. Ratings of an
    episode by several people are averaged. The penalty of the ridge is the one with the least error for episodes
    that are left out, one at a time.

    Args:
        folders: data sets or collections, with ratings in their subfolders, or imported with `socnav3` with labels.

    Raises:
        BenchmarkError: there are fewer than 30 rated episodes, their ratings are all equal, or they answer different
            questions or are texts.
        RecordError: an episode or a file of ratings is damaged.
    """
    rated = rated_episodes(folders, fewest=_FEWEST, model="a rating model")
    values = [values_of(read_episode(file), None) for file in rated.files]
    return _fitted(values, np.array(rated.ratings), rated.question, rated.raters)


@dataclass(frozen=True, slots=True)
class Rated:
    """Rated episodes.

    Attributes:
        question: that raters answered.
        raters: number of them; 0 if the files hold the ratings.
        files: of the episodes.
        ratings: mean rating of each, 0 to 1.
    """

    question: str
    raters: int
    files: list[Path]
    ratings: list[float]


def rated_episodes(folders: Sequence[str | Path], *, fewest: int, model: str) -> Rated:
    """The episodes of folders that have ratings; of a folder without ratings those with a label from 0 to 1.

    Files of SocNav3 and SocNavData2026 have such labels, which `socnav3` imports.

    Args:
        folders: data sets or collections.
        fewest: least number of episodes.
        model: what needs them.

    Raises:
        BenchmarkError: there are fewer, their ratings are all equal, or they answer different questions or are texts.
        RecordError: an episode or a file of ratings is damaged.
    """
    files, ratings, raters, specs = list[Path](), list[float](), set[str](), list[LabelSpec]()
    for folder in map(Path, folders):
        given = ratings_of(folder)
        specs += [spec for spec in questions(given) if spec not in specs]
        by_hash: dict[str, list[float]] = {}
        for rating in given:
            by_hash.setdefault(rating.sha256, []).append(_position(rating))
            raters.add(rating.rater)
        files_here = files_of(folder)
        if not given and read_episode(files_here[0]).document.get("imported") is None:
            continue  # runs of sonata2d, which have no such labels
        for file in files_here:
            own = by_hash.get(sha256_of(file), []) if given else _label(read_episode(file))
            if own:
                files.append(file)
                ratings.append(sum(own) / len(own))
                if not given and _LABEL not in specs:
                    specs.append(_LABEL)
    if len(specs) > 1:
        raise BenchmarkError(f"the ratings answer {counted(len(specs), 'question')}; give folders with one")
    if len(ratings) < fewest:
        raise BenchmarkError(f"{model} needs {fewest} rated episodes or more, got {len(ratings)}")
    if min(ratings) == max(ratings):
        raise BenchmarkError("all episodes have the same rating; there is nothing to learn")
    return Rated(specs[0].question or specs[0].name, len(raters), files, ratings)


_LABEL = LabelSpec("slider", question="label of the imported episodes")


def _label(record: EpisodeRecord) -> list[float]:
    """The label of an imported episode, if it is a number from 0 to 1."""
    label = record.label
    is_number = isinstance(label, int | float) and not isinstance(label, bool)
    is_rating = is_number and record.document.get("imported") is not None
    return [float(label)] if is_rating and 0.0 <= label <= 1.0 else []


def _fitted(values: Sequence[Mapping[str, float | None]], target: Array, question: str, raters: int) -> RatingModel:
    names = [name for name in SCORES if any(each.get(name) is not None for each in values)]
    table = np.array([[np.nan if each[name] is None else each[name] for name in names] for each in values], dtype=float)
    mean = np.nanmean(table, axis=0)
    table = np.where(np.isnan(table), mean, table)
    deviation = table.std(axis=0)
    names = [name for name, size in zip(names, deviation, strict=True) if size > 0.0]
    table, mean = table[:, deviation > 0.0], mean[deviation > 0.0]
    scale = deviation[deviation > 0.0]
    features = (table - mean) / scale
    left_out = {penalty: _left_out(features, target, penalty) for penalty in _PENALTIES}
    best = min(_PENALTIES, key=lambda penalty: float(((left_out[penalty] - target) ** 2).sum()))
    weights: Array = _ridge(features, best) @ (target - target.mean())
    return RatingModel(
        question=question,
        episodes=len(target),
        raters=raters,
        correlation=round(rank_correlation(left_out[best], target), 3),
        features=tuple(names),
        mean=tuple(mean.round(9).tolist()),
        scale=tuple(scale.round(9).tolist()),
        weights=tuple(weights.round(9).tolist()),
        bias=round(float(target.mean()), 9),
    )


def _ridge(features: Array, penalty: float) -> Array:
    """(F, N), the matrix that maps centred ratings to weights."""
    square = features.T @ features + penalty * np.eye(features.shape[1])
    return np.asarray(np.linalg.solve(square, features.T))


def _left_out(features: Array, target: Array, penalty: float) -> Array:
    """Predictions for each episode from all others, by the hat matrix (Golub, Heath & Wahba, Technometrics 1979)."""
    count = len(target)
    hat = features @ _ridge(features, penalty) + 1.0 / count
    residual = target - target.mean() - (features @ (_ridge(features, penalty) @ (target - target.mean())))
    return np.asarray(target - residual / np.maximum(1.0 - np.diag(hat), 1e-9))


def rank_correlation(first: Array, second: Array) -> float:
    """Spearman's rank correlation; equal values have the mean of their ranks."""
    ranks = []
    for values in (first, second):
        _, index, counts = np.unique(values, return_inverse=True, return_counts=True)
        ranks.append((np.cumsum(counts) - (counts - 1) / 2)[index])
    if min(np.ptp(ranks[0]), np.ptp(ranks[1])) == 0.0:
        return 0.0
    return float(np.corrcoef(ranks[0], ranks[1])[0, 1])


def _position(rating: Rating) -> float:
    """A rating as a number from 0 to 1.

    Raises:
        BenchmarkError: it is a text.
    """
    if rating.spec.kind not in ("yes_no", "classes", "slider"):
        raise BenchmarkError(f"ratings of the kind {rating.spec.kind} are no numbers; use yes_no, classes or a slider")
    return rating.spec.position_of(rating.label)
