"""The specification of a generated data set, and the manifest that follows from it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ...core.geometry import PRECISION
from ...core.snapshot import ControllerInfo, Status
from ...errors import RecordError
from ...record.canonical import to_json_value
from ...record.files import file_stem
from ...record.layout import JsonDict, software_versions
from ...record.record import EpisodeRecord
from ...version import PHYSICS_VERSION
from ..manifest.names import episode_number, shard_name, shard_number
from ..manifest.read import DATASET_FORMAT, DATASET_VERSION, SHARDED_VERSION


@dataclass(frozen=True, slots=True)
class DatasetSpec:
    """Specification of a generated data set: everything that determines its bytes.

    Attributes:
        name: name of the scenario.
        settings: resolved settings of the scenario.
        seed: seed of the data set.
        episodes: number of episodes; with `keep`, number of kept episodes.
        controller_info: the controller as recorded in files.
        suffix: file suffix: `.json`, `.json.gz` or `.json.zst`.
        keep: outcomes that are kept; empty: all.
        controller_sha256: hashes of the controller's source, see `agents.controllers.loading.source_hashes`.
        shard_size: number of episode numbers that each shard covers; None: the data set is a folder of files.
    """

    name: str
    settings: dict[str, Any] | None
    seed: int
    episodes: int
    controller_info: ControllerInfo
    suffix: str = ".json"
    keep: tuple[Status, ...] = ()
    controller_sha256: Mapping[str, str] = field(default_factory=dict)
    shard_size: int | None = None

    def file_name(self, episode: int) -> str:
        """The name of an episode file: `{episode:06d}` and the suffix."""
        return f"{episode:06d}{self.suffix}"

    def covered(self, batch: int) -> tuple[int, int]:
        """The first episode number that a batch covers, and the one after the last.

        A batch is a shard, or a single file in a folder of files.
        """
        size = self.shard_size or 1
        stop = (batch + 1) * size
        return batch * size, stop if self.keep else min(stop, self.episodes)

    def batch_in(self, name: str) -> int | None:
        """The number of the batch that a file name belongs to; None: there is no such batch."""
        is_packed = self.shard_size is not None
        number = shard_number(name) if is_packed else episode_number(name)
        if number is None or name != (shard_name(number) if is_packed else self.file_name(number)):
            return None  # another file of a shard, or a file with another suffix
        # without `keep`, the folder may hold files beyond the requested episodes
        return number if self.keep or self.covered(number)[0] < self.episodes else None


def identity_of(spec: DatasetSpec) -> JsonDict:
    """The manifest keys that a specification determines."""
    info = spec.controller_info
    identity = {
        "name": spec.name,
        "settings": spec.settings,
        "seed": spec.seed,
        "episodes": spec.episodes,
        **({"keep": spec.keep} if spec.keep else {}),
        "controller": {"path": info.path, "version": info.version, "settings": info.settings},
    }
    return {key: to_json_value(value, f"{key} of the data set", exact=True) for key, value in identity.items()}


def manifest_of(
    spec: DatasetSpec,
    rows: Iterable[JsonDict],
    counts: JsonDict,
    left_out: JsonDict,
    *,
    complete: bool,
    split: JsonDict | None = None,
    shard: JsonDict | None = None,
) -> JsonDict:
    """The manifest of a generated data set, or of a shard of one, as it is stored.

    Args:
        spec: specification of the data set.
        rows: of its shards, or else of its episodes, in order.
        counts: number of episodes by outcome and by family.
        left_out: number of episodes not kept before the last listed one, by outcome; only with `keep`.
        complete: whether all requested episodes are present.
        split: file names by part; in a data set in shards, number of episodes by part.
        shard: of a shard, see `ShardContent`; the rows are its episodes.
    """
    rows = list(rows)
    lists_shards = spec.shard_size is not None and shard is None
    return {
        "format": DATASET_FORMAT,
        "version": SHARDED_VERSION if lists_shards else DATASET_VERSION,
        **identity_of(spec),
        **({} if shard is None else {"episodes": len(rows)}),
        **({"controller_sha256": dict(spec.controller_sha256)} if spec.controller_sha256 else {}),
        "precision": PRECISION,
        "physics": PHYSICS_VERSION,
        "complete": complete,
        "counts": counts,
        **({"left_out": left_out} if spec.keep else {}),
        **({} if shard is None else {"shard": shard}),
        "split": split,
        **({"shard_size": spec.shard_size, "shards": rows} if lists_shards else {"files": rows}),
        "software": software_versions(),
    }


def require_episode_of(record: EpisodeRecord, spec: DatasetSpec, episode: int) -> None:
    """Check that the specification produces an episode, and that the episode ran to its end.

    Raises:
        RecordError: the episode is another one, ended in an error, or has an outcome that is not kept.
    """
    expected = {**identity_of(spec), "episode": episode, "physics": PHYSICS_VERSION, "id": file_stem(record.path)}
    for key, value in expected.items():
        if key not in ("episodes", "keep") and record.document[key] != value:
            raise RecordError(f"{record.path} belongs to another data set: its {key} differs")
    status = record.outcome.status
    if status == "error":
        raise RecordError(f"{record.path} ended in an error: {record.outcome.reason}")
    if spec.keep and status not in spec.keep:
        raise RecordError(f"{record.path} ended in {status}, but only {', '.join(spec.keep)} is kept")
