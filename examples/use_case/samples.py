"""Recorded runs as training samples: one loader for what the expert drove, what people drove, and what learners met."""

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

from sonata2d.learning.graph.modern import modern_graph
from sonata2d.learning.graph.paper import FEATURES, TURNED, kept_ticks, paper_graphs, share_of_limits
from sonata2d.learning.inputs import INPUTS, inputs_of
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord

PARTS = ("train", "dev", "test")


@dataclass(frozen=True, eq=False)
class Samples:
    """S graphs in a row, of V nodes and E edges in all.

    Attributes:
        x: (V, F) of float32, inputs.
        edges: (2, E) of int32, from and to, counted within each graph.
        relation: (E,) of int8.
        y: (S, 3) of float32, shares of the robot's limits.
        nodes, ties: (S,) of int64, how many nodes and edges each graph has.
        part: (S,) of int8, into `PARTS`.
    """

    x: Any
    edges: Any
    relation: Any
    y: Any
    nodes: Any
    ties: Any
    part: Any

    def __len__(self) -> int:
        return len(self.y)


def samples_of(folder: Path, graph: str, *, workers: int = 2) -> Samples:
    """The samples of a data set, from its cache if they and what is read of them are as they were.

    Args:
        folder: a data set; what is in no part of its split is for training.
        graph: `paper` or `modern`.
        workers: processes.

    Raises:
        ValueError: it is split into other parts than `PARTS`.
    """
    text = (folder / "manifest.json").read_bytes()
    told = hashlib.sha256(text + repr((FEATURES, INPUTS)).encode()).hexdigest()
    cache = folder.parent / "cache" / f"{folder.name}-{graph}-{told[:12]}.npz"
    if not cache.exists():
        manifest = json.loads(text)
        split = manifest["split"] or {}
        if strange := sorted(set(split) - set(PARTS)):
            raise ValueError(f"{folder} has a part {strange[0]!r}; split it again, into {', '.join(PARTS)}")
        parts = {name: PARTS.index(part) for part, names in split.items() for name in names}
        jobs = [(folder / row["name"], graph, parts.get(row["name"], 0)) for row in manifest["files"]]
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            found = tqdm(pool.map(_of_file, jobs, chunksize=16), f"graphs of {folder.name}", len(jobs), disable=None)
            whole = joined([samples for samples in found if samples is not None])
        cache.parent.mkdir(exist_ok=True)
        part = cache.with_suffix(".part.npz")  # so that an interrupted one is not taken for whole
        np.savez(part, **{field.name: getattr(whole, field.name) for field in fields(Samples)})
        part.replace(cache)
    with np.load(cache) as held:
        return Samples(**{field.name: held[field.name] for field in fields(Samples)})


def joined(many: Sequence[Samples]) -> Samples:
    """Several one after the other."""
    return Samples(*(np.concatenate([getattr(one, f.name) for one in many], axis=-1 if f.name == "edges" else 0)
                     for f in fields(Samples)))  # fmt: skip


def _of_file(job: tuple[Path, str, int]) -> Samples | None:
    path, kind, part = job
    rows = list(_rows(read_episode(path), kind))
    if not rows:
        return None
    return Samples(
        x=np.concatenate([x for x, *_ in rows]).astype(np.float32),
        edges=np.concatenate([edges for _, edges, *_ in rows], axis=1).astype(np.int32),
        relation=np.concatenate([relation for *_, relation, _ in rows]).astype(np.int8),
        y=np.array([y for *_, y in rows], dtype=np.float32),
        nodes=np.array([len(x) for x, *_ in rows]),
        ties=np.array([len(relation) for *_, relation, _ in rows]),
        part=np.full(len(rows), part, dtype=np.int8),
    )


def _rows(record: EpisodeRecord, kind: str) -> Iterator[tuple[Any, Any, Any, Any]]:
    """Inputs, edges, relations and label, a second apart; of the modern kind from the very first look on."""
    if kind == "paper":
        for graph in paper_graphs(record):
            yield inputs_of(graph), graph.edges, graph.relation, graph.label
        return
    scene, labels = record.scene(), record.labels
    for tick in kept_ticks(record.time):
        graph = modern_graph(record, tick, instants=1)
        label = share_of_limits(scene, labels[tick], record.command[tick]) * TURNED
        yield inputs_of(graph), graph.edges, graph.relation, label
