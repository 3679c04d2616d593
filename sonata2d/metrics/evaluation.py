"""The measured episodes of one controller or data set: summaries, shares and differences of each metric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from statistics import fmean
from typing import Any

import numpy as np

from ..core.wording import counted
from ..version import PHYSICS_VERSION, __version__
from .catalogue import ALL, metric_named
from .definition import DEFINITIONS_VERSION, NEEDS
from .summary import LEVEL, RESAMPLES, Interval, Share, Summary, differences, summarise

EVENTS = ("0/1", "count")  # units of metrics that are shown as shares of episodes
_METRICS_FORMAT = "sonata2d-metrics"
VERSIONS = {"sonata2d": __version__, "physics": PHYSICS_VERSION}  # that measured
MARK = "*"  # of values that differ significantly from the first evaluation


@dataclass(frozen=True, slots=True)
class Measured:
    """The metrics of one episode.

    Attributes:
        file, sha256: the episode file and its hash.
        name, family: of the scenario.
        seed, episode: as in the file.
        scene: hash of the scene, equal for episodes that start alike, whatever the controller; see `scene_hash`.
        outcome: status with which the episode ended.
        values: value of each metric; None where it is not defined, or was not measured. Of several robots together: the
            sum of counts, the worst of 0/1, and the mean of others.
        lacks: the data that the source of an imported episode lacks, names in `definition.NEEDS`.
        robots: of several robots, the values of each one until it reaches its goal, by id.
    """

    file: str
    sha256: str
    name: str
    family: str
    seed: int
    episode: int
    scene: str
    outcome: str
    values: dict[str, float | None]
    lacks: tuple[str, ...] = ()
    robots: dict[int, dict[str, float | None]] = field(default_factory=dict)


@dataclass(frozen=True)
class Evaluation:
    """The measured episodes of one controller or one data set.

    Args:
        label: name in tables.
        episodes: the measured episodes.
        resamples: of the bootstrap.

    >>> from sonata2d.metrics import episode_files, measure_files
    >>> files = episode_files(Path("demo"))
    >>> Evaluation("demo", measure_files(files, rerun=False)).summary("path_length").mean
    3.54...
    """

    label: str
    episodes: Sequence[Measured]
    resamples: int = RESAMPLES
    _cache: dict[str, Summary] = field(default_factory=dict, repr=False, compare=False)

    def __repr__(self) -> str:
        return f"<Evaluation {self.label}: {counted(len(self.episodes), 'episode')}>"

    @property
    def scenes(self) -> set[str]:
        """The hashes of the scenes."""
        return {episode.scene for episode in self.episodes}

    def values(self, name: str) -> list[float]:
        """Values of a metric in the episodes in which it is defined.

        Raises:
            MetricError: no metric has this name.
        """
        metric_named(name)
        return [value for episode in self.episodes if (value := episode.values.get(name)) is not None]

    def summary(self, name: str) -> Summary:
        """Summary of a metric over all episodes.

        Raises:
            MetricError: no metric has this name.
        """
        metric_named(name)
        if name not in self._cache:
            self._cache[name] = self._summarise(name, self.episodes)
        return self._cache[name]

    def quartiles(self, name: str) -> Interval | None:
        """First and third quartile of a metric over the episodes; None if it is not defined."""
        values = self.values(name)
        return Interval(*np.quantile(values, (0.25, 0.75)).tolist()) if values else None

    def share(self, name: str) -> Share | None:
        """Share of the episodes in which a metric of events is not 0; None if it is not defined."""
        values = self.values(name)
        return Share(sum(value > 0.0 for value in values), len(values)) if values else None

    def text(self, name: str) -> str:
        """The summary of a metric in a table: `0.95 [0.85, 1.00]`, or the reason why it is missing."""
        lacking = self.lacking(name)
        return f"not measured: lacks {', '.join(lacking)}" if lacking else self.summary(name).text(len(self.episodes))

    def lacking(self, name: str) -> list[str]:
        """The data that a metric needs and that all episodes lack, because their source did not record them."""
        needs = metric_named(name).needs if self.episodes else ()
        return [need for need in NEEDS if need in needs and all(need in episode.lacks for episode in self.episodes)]

    def difference(self, baseline: Evaluation, name: str) -> Summary:
        """Summary of this evaluation's metric minus the baseline's, over the scenes common to both.

        Of several episodes in one scene, the mean counts.
        """
        return differences(baseline._by_scene(name), self._by_scene(name), name, resamples=self.resamples)

    def differs(self, baseline: Evaluation, name: str) -> bool:
        """Whether a metric differs significantly from another evaluation in the common scenes.

        False if the difference of the means over all episodes has the other sign: they are over other episodes, and a
        mark beside them would be read the wrong way round.
        """
        mean, base = self.summary(name).mean, baseline.summary(name).mean
        if baseline is self or mean is None or base is None:
            return False
        difference = self.difference(baseline, name)
        return difference.excludes_zero and difference.mean is not None and difference.mean * (mean - base) > 0.0

    def to_json(self) -> dict[str, Any]:
        """Versions of definitions, sonata2d and physics, summaries, and the metrics of every episode, as a JSON object.

        Summaries cover all episodes, the successful episodes and the episodes of each scenario family.
        """
        names = self.episodes[0].values if self.episodes else {}
        families = sorted({episode.family for episode in self.episodes})
        return {
            "format": _METRICS_FORMAT,
            "version": DEFINITIONS_VERSION,
            **VERSIONS,
            "metrics": {name: {"unit": ALL[name].unit, "better": ALL[name].better} for name in names},
            "bootstrap": {"level": LEVEL, "resamples": self.resamples, "seed": 0},
            "rerun": any(episode.values.get("human_slowing") is not None for episode in self.episodes),
            "summary": {
                "all": self._summaries(self.episodes),
                "successful": self._summaries([e for e in self.episodes if e.values.get("success")]),
                "by_family": {name: self._summaries([e for e in self.episodes if e.family == name])
                              for name in families},
            },
            "episodes": [_row(episode) for episode in self.episodes],
        }  # fmt: skip

    def _by_scene(self, name: str) -> dict[str, dict[str, float]]:
        """The mean of a metric in each scene in which it is defined."""
        values: dict[str, list[float]] = {}
        for episode in self.episodes:
            if (value := episode.values.get(name)) is not None:
                values.setdefault(episode.scene, []).append(value)
        return {scene: {name: fmean(found)} for scene, found in values.items()}

    def _summarise(self, name: str, episodes: Sequence[Measured]) -> Summary:
        return summarise([episode.values.get(name) for episode in episodes], resamples=self.resamples)

    def _summaries(self, episodes: Sequence[Measured]) -> dict[str, Any]:
        names = self.episodes[0].values if self.episodes else ()  # also for an empty selection
        return {name: self._summarise(name, episodes).to_json() for name in names}


def _row(episode: Measured) -> dict[str, Any]:
    row = asdict(episode)
    robots = row.pop("robots")
    return row | ({"robots": {str(id): values for id, values in robots.items()}} if robots else {})
