"""What would corrupt a reader in silence is refused, in one line that says what to do instead."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..core.entities import RELATIONS
from ..errors import RecordError
from ..record.record import EpisodeRecord


def refuse_absences(record: EpisodeRecord, format: str) -> None:
    """Readers take the people of one frame for those of all.

    Raises:
        RecordError: somebody is not present throughout.
    """
    gone = np.argwhere(~record.looks.present)
    if len(gone):
        tick, k = gone[0].tolist()
        human = record.scene().humans[k].id
        raise RecordError(
            f"{record.path}: human {human} is not present at tick {tick}, and readers of {format} take people to be the"
            " same throughout; export to parquet, npz, csv or trajnet"
        )


def refuse_short(record: EpisodeRecord, format: str, span: float, least: float) -> None:
    """Readers make nothing of an episode that is too short.

    Args:
        record: of the episode.
        format: its name.
        span: s, from the first to the last frame to be written.
        least: s, that readers need.

    Raises:
        RecordError: it is shorter.
    """
    if span < least - 1e-9:
        raise RecordError(
            f"{record.path}: {span:.4g} s from first to last frame, and readers of {format} need {least:g} s;"
            " leave such episodes out"
        )


def refuse_without_robot(record: EpisodeRecord, format: str) -> None:
    """A robot that only stands in for one (see `imported`) is not to be taken for data.

    Raises:
        RecordError: the episode was imported from a source without a robot.
    """
    if "robot" in record.document.get("imported", {}).get("lacks", ()):
        raise RecordError(
            f"{record.path}: there is no robot in it, and {format} tells what a robot sees; export to csv, trajnet,"
            " npz or parquet"
        )


def refuse_ids(record: EpisodeRecord, format: str) -> None:
    """Ids are indices of nodes to those who read them.

    Raises:
        RecordError: people and objects together are not 1..P+O.
    """
    scene = record.scene()
    ids = [human.id for human in scene.humans] + [thing.id for thing in scene.furniture]
    if sorted(ids) != list(range(1, len(ids) + 1)):
        raise RecordError(
            f"{record.path}: ids are {sorted(ids)}, and readers of {format} need 1..{len(ids)}, since ids are indices"
            " to them; export to socnav3 or parquet, which take any"
        )


def refuse_relations(record: EpisodeRecord, format: str, known: Collection[str] = RELATIONS) -> None:
    """Relations that a reader has no name for.

    Raises:
        RecordError: there is one.
    """
    for look in (*record.document["frames"], record.document["final"]):
        for src, relation, dst in look["interactions"]:
            if relation not in known:
                raise RecordError(
                    f"{record.path}: {relation} of {src} and {dst} at tick {look['tick']} is no relation of {format},"
                    f" which has {', '.join(known)}"
                )


def refuse_uneven(record: EpisodeRecord, format: str) -> None:
    """Stamps of files that were imported may rise unevenly; new stamps would be untrue.

    Raises:
        RecordError: time is not tick * dt.
    """
    dt, looks = record.scene().rules.dt, record.looks
    off = np.flatnonzero(np.abs(looks.time - looks.tick * dt) > 2e-4)
    if len(off):
        t = int(off[0])
        raise RecordError(
            f"{record.path}: frame {t} is of {looks.time[t]:g} s, not of {t} * {dt:g} s, and {format} would need even"
            " stamps; resample the source first"
        )
