"""Graphs of recorded episodes as samples of a stream."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from ..core.arguments import positive_number, whole_number
from ..core.floats import make_floats
from ..record.record import EpisodeRecord
from .graph.attributes import with_attributes
from .graph.graph import INTERVAL, Graph
from .graph.modern import FRAMES, modern_graph
from .graph.paper import kept_ticks, paper_graphs


@dataclass(frozen=True, slots=True)
class GraphSamples:
    """Makes graphs of an episode, for `Dataset.stream`; `learning.graph.to_data` makes PyTorch data of each.

    Attributes:
        kind: `modern`, see `learning.graph.modern_graph`, or `paper`, see `learning.graph.paper_graphs`.
        every: time between the newest instants of two modern graphs, s.
        frame: frame of reference of modern graphs: `world`, `robot` or `goal`.
        instants: number of instants of modern graphs, 1 or more; graphs at the start of an episode have fewer.
        interval: time between the instants of a modern graph, s; a multiple of the tick length.
        attributes: whether attributes of people, objects and areas are features; see `learning.graph.with_attributes`.

    Raises:
        ValueError: there is no such kind or frame, or a number is not positive.

    Example:
        >>> import sonata2d as s2
        >>> from sonata2d.learning import GraphSamples
        >>> stream = s2.Dataset("demo").stream(GraphSamples(), shuffle=500, seed=1)
        >>> next(iter(stream)).features.shape[1]
        20
    """

    kind: Literal["modern", "paper"] = "modern"
    every: float = INTERVAL
    frame: Literal["world", "robot", "goal"] = "robot"
    instants: int = 3
    interval: float = INTERVAL
    attributes: bool = False

    def __post_init__(self) -> None:
        if self.kind not in ("modern", "paper"):
            raise ValueError(f"kind must be modern or paper, got {self.kind!r}")
        if self.frame not in FRAMES:
            raise ValueError(f"frame must be one of {', '.join(FRAMES)}, got {self.frame!r}")
        make_floats(self)
        positive_number("every", self.every)
        positive_number("interval", self.interval)
        whole_number("instants", self.instants, 1)

    def __call__(self, record: EpisodeRecord) -> Iterator[Graph]:
        """The graphs of an episode, in order.

        Raises:
            RecordError: the source of an imported episode has no robot or no goal.
        """
        record = record.until_arrival()
        for graph in paper_graphs(record) if self.kind == "paper" else self._modern_graphs(record):
            yield with_attributes(graph, record) if self.attributes else graph

    def _modern_graphs(self, record: EpisodeRecord) -> Iterator[Graph]:
        for tick in kept_ticks(record.time[: len(record)], self.every):
            yield modern_graph(record, tick, frame=self.frame, instants=self.instants, interval=self.interval)
