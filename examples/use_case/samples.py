"""Loads recorded runs as training samples, whether the expert, a person or a learner drove."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from sonata2d import Array, EpisodeRecord, read_episode
from sonata2d.core.portable_math import IntArray
from sonata2d.learning import INPUTS, inputs_of
from sonata2d.learning.graph import FEATURES, kept_ticks, modern_graph, paper_graphs
from sonata2d.learning.graph.paper import LABEL_SIGNS, command_fractions

PARTS = ("train", "dev", "test")
CACHE_NAMES = ("x", "edges", "relation", "y", "nodes", "ties", "part")  # of the fields of `Samples` in a cache file


@dataclass(frozen=True, eq=False)
class Samples:
    """S graphs one after the other, with V nodes and E edges in all.

    Attributes:
        x: (V, F), float32, inputs of the nodes.
        edges: (2, E), int32, source and destination; nodes are counted within each graph.
        relation: (E,), int8.
        y: (S, 3), float32, wanted output, as fractions of the robot's limits: ahead, right, clockwise for `paper`;
            ahead, left, counter-clockwise for `modern`.
        node_count, edge_count: (S,), int64, nodes and edges of each graph.
        part: (S,), int8, index into `PARTS`.
    """

    x: Any
    edges: Any
    relation: Any
    y: Any
    node_count: Any
    edge_count: Any
    part: Any

    def __len__(self) -> int:
        return len(self.y)


def load_samples(folder: Path, graph: str, *, workers: int = 2) -> Samples:
    """Load the samples of a data set.

    They are computed once and cached in the folder `cache` beside the data set. The name of a cache file contains a
    hash of the manifest and of the names of the inputs, so a changed data set is computed anew.

    Args:
        folder: of a data set; files that its split does not name belong to the training part.
        graph: `paper` or `modern`.
        workers: number of processes; with 1, this process does the work.

    Raises:
        ValueError: the split has a part that is not in `PARTS`.
    """
    text = (folder / "manifest.json").read_bytes()
    digest = hashlib.sha256(text + repr((FEATURES, INPUTS)).encode()).hexdigest()
    cache = folder.parent / "cache" / f"{folder.name}-{graph}-{digest[:12]}.npz"
    if not cache.exists():
        _write_cache(cache, _compute_samples(folder, graph, json.loads(text), workers))
    with np.load(cache) as arrays:
        return Samples(*(arrays[name] for name in CACHE_NAMES))


def concatenate(samples: Sequence[Samples]) -> Samples:
    """Concatenate the graphs of several `Samples`."""
    return Samples(
        *(
            np.concatenate([getattr(one, field.name) for one in samples], axis=-1 if field.name == "edges" else 0)
            for field in fields(Samples)
        )
    )


def _compute_samples(folder: Path, graph: str, manifest: dict[str, Any], workers: int) -> Samples:
    split = manifest["split"] or {}
    if unknown := sorted(set(split) - set(PARTS)):
        raise ValueError(f"{folder} has a part {unknown[0]!r}; split it again, into {', '.join(PARTS)}")
    parts = {name: PARTS.index(part) for part, names in split.items() for name in names}
    jobs = [(folder / row["name"], graph, parts.get(row["name"], 0)) for row in manifest["files"]]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        results = pool.map(_samples_of_file, jobs, chunksize=16) if workers > 1 else map(_samples_of_file, jobs)
        bar = tqdm(results, f"graphs of {folder.name}", len(jobs), disable=None)
        return concatenate([samples for samples in bar if samples is not None])


def _write_cache(cache: Path, samples: Samples) -> None:
    cache.parent.mkdir(exist_ok=True)
    partial = cache.with_suffix(".part.npz")  # renamed at the end, so that an interrupted file is not read
    arrays = (getattr(samples, field.name) for field in fields(Samples))
    np.savez(partial, **dict(zip(CACHE_NAMES, arrays, strict=True)))
    partial.replace(cache)


def _samples_of_file(job: tuple[Path, str, int]) -> Samples | None:
    """Return the samples of an episode file; None if the episode is too short to have any."""
    path, kind, part = job
    rows = list(_labelled_graphs(read_episode(path), kind))
    if not rows:
        return None
    return Samples(
        x=np.concatenate([x for x, *_ in rows]).astype(np.float32),
        edges=np.concatenate([edges for _, edges, *_ in rows], axis=1).astype(np.int32),
        relation=np.concatenate([relation for *_, relation, _ in rows]).astype(np.int8),
        y=np.array([y for *_, y in rows], dtype=np.float32),
        node_count=np.array([len(x) for x, *_ in rows]),
        edge_count=np.array([len(relation) for *_, relation, _ in rows]),
        part=np.full(len(rows), part, dtype=np.int8),
    )


def _labelled_graphs(record: EpisodeRecord, kind: str) -> Iterator[tuple[Array, IntArray, IntArray, Array]]:
    """Yield inputs, edges, relations and wanted output of one graph per second."""
    if kind == "paper":  # needs a second of history, so the first instant gives no graph
        for graph in paper_graphs(record, skip_first=True):  # as `GraphPolicy` reads them when it drives
            yield inputs_of(graph), graph.edges, graph.relation, graph.label
        return
    scene, labels = record.scene(), record.labels
    for tick in kept_ticks(record.time):
        graph = modern_graph(record, tick, instants=1)
        label = command_fractions(scene, labels[tick], record.command[tick]) * LABEL_SIGNS  # to left, counter-clockwise
        yield inputs_of(graph), graph.edges, graph.relation, label
