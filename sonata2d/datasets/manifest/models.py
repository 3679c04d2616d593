"""The schema of the manifest of a data set."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from ...core.bounds import Count, Positive
from ...core.snapshot import Status
from ...record.models import Controller, Part, Settings, Software
from .names import is_file_name


def _in_folder(name: str) -> str:
    """Require the name of a file in the folder of the data set: a manifest must not lead out of it."""
    if not is_file_name(name):
        raise ValueError(f"{name!r} is not a file name")
    return name


_FileName = Annotated[str, AfterValidator(_in_folder)]


_CODE_DESCRIPTION = (
    "SHA-256 of the source file that defines the controller, by its name; of driver+labeller both; of a class without "
    "a file, as in a notebook, the SHA-256 of its code. Likewise of pedestrian models and room kinds that a program "
    "has registered. Modules that the file imports are not included. Absent: all of these are part of sonata2d, or "
    "plug-ins"
)


class ContactCount(Part):
    """Frames of an episode in which the robot is in contact with one kind of outline, or with any."""

    frames: Count = Field(description="number of frames in contact")
    robot_at_fault: Count = Field(description="number of these frames in which the robot's own velocity closes the gap")
    other_at_fault: Count = Field(
        description="number of these frames in which the other's velocity closes the gap; both can, or neither"
    )


class CommandExcess(Part):
    """Commands of an episode in which one component exceeds its limit; the drive executes less."""

    frames: Count = Field(description="number of frames with such a command")
    command: float = Field(description="m/s or rad/s, size of the command that exceeds the limit most")
    limit: float = Field(description="m/s or rad/s, the limit that it exceeds")


class ManifestFile(Part):
    """One file of a data set."""

    name: _FileName
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    bytes: Count
    episode: Count
    family: str
    outcome: Status
    ticks: Count = Field(description="number of frames")
    contacts: dict[Literal["any", "human", "object", "wall", "door", "robot"], ContactCount] | None = Field(
        default=None,
        description="by kind of contact, kinds without a contact left out; absent: not counted (imported episodes)",
    )
    commands_beyond_limits: dict[Literal["vx", "vy", "omega"], CommandExcess] | None = Field(
        default=None,
        description="by component of the command, components within their limits left out; absent: not counted",
    )
    contributor: str | None = Field(default=None, description="name of the driver; collected runs only")
    seed: int | None = Field(default=None, description="seed of the scene; collected runs only")
    offset: Count | None = Field(default=None, description="where the file begins in its shard, bytes; shards only")


class Source(Part):
    """A data set that was merged into this one."""

    name: str = Field(description="prefix of the names of its files")
    mirrored: bool = Field(default=False, description="whether its episodes are mirror images")
    scenario: str | None = Field(description="name of the scenario; null: collected runs")
    settings: Settings | None
    seed: int | None
    episodes: Count
    keep: list[Status] | None = Field(default=None, description="as in a manifest")
    left_out: dict[str, Count] | None = Field(default=None, description="as in a manifest")
    controller: Controller | None
    controller_sha256: dict[str, str] | None = Field(default=None, description="as in a manifest")
    files: list[_FileName] = Field(default_factory=list, description="absent if there are `shards`")
    shards: list[_FileName] | None = Field(default=None, description="names of the shards with its episodes")


class Counts(Part):
    """Number of episodes by property."""

    outcome: dict[str, Count]
    family: dict[str, Count]
    contributor: dict[str, Count] | None = Field(default=None, description="collected runs only")


class ShardContent(Part):
    """The shard that a manifest describes, a tar file."""

    first: Count = Field(description="number of the first episode that can be in the shard")
    stop: Count = Field(description="number after the last episode that can be in the shard")
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of the tar file")
    bytes: Count = Field(description="size of the tar file")
    left_out: list[tuple[Count, str]] | None = Field(
        default=None, description="number and outcome of each episode that is not kept; only with `keep`"
    )


class Shard(Part):
    """A shard of a data set."""

    name: _FileName = Field(description="name of the tar file; the manifest beside it ends in `.manifest.json`")
    sha256: str = Field(pattern="^[0-9a-f]{64}$", description="of the tar file")
    bytes: Count = Field(description="size of the tar file")
    episodes: Count = Field(description="number of episodes in it")
    ticks: Count = Field(description="number of their frames")


class DataSet(Part):
    """The keys that manifests of files and manifests of shards share."""

    format: Literal["sonata2d-dataset"]
    mirrored: bool = Field(
        default=False,
        description="whether the episodes are mirror images of what settings and seed produce",
    )
    collected: bool = Field(
        default=False, description="whether people drove; each file then holds its own settings, seed and controller"
    )
    name: str | None = Field(description="name of the scenario; null: collected runs")
    settings: Settings | None = Field(description="resolved settings of the scenario")
    seed: int | None
    episodes: Count = Field(description="number of episodes requested; with `keep`, number of kept episodes requested")
    keep: list[Status] | None = Field(
        default=None, description="outcomes of kept episodes, which are the first ones by number; absent: all"
    )
    controller: Controller | None
    controller_sha256: dict[str, str] | None = Field(default=None, description=_CODE_DESCRIPTION)
    precision: Positive
    physics: int
    complete: bool = Field(description="false during generation and after an interruption")
    counts: Counts
    left_out: dict[str, Count] | None = Field(
        default=None, description="number of episodes not kept before the last listed one, by outcome; only with `keep`"
    )
    sources: list[Source] | None = Field(default=None, description="the data sets that were merged")
    software: Software


class Manifest(DataSet):
    """Contents of a data set, `manifest.json`; or of a shard, in the file beside it."""

    version: Literal[1]
    shard: ShardContent | None = Field(
        default=None, description="only in the manifest of a shard: the episodes that it covers, and its file"
    )
    split: dict[str, list[_FileName]] | None = Field(
        description="file names by part: train, dev, test; null: the data set is not split"
    )
    files: list[ManifestFile]


class ShardedManifest(DataSet):
    """Contents of a data set in shards, `manifest.json`: tar files, beside each of which lies its own manifest."""

    version: Literal[2]
    shard_size: int = Field(gt=0, description="N: shard k has the kept ones of the episodes k·N to (k + 1)·N - 1")
    split: dict[str, Count] | None = Field(
        description="number of episodes by part; the manifests of the shards list them. null: the data set is not split"
    )
    shards: list[Shard]
