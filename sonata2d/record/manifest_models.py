"""The manifest of a data set as pydantic models."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from ..frame import Status
from .models import Controller, Software
from .scene_models import Count, Part, Positive


class ManifestFile(Part):
    """One file of a data set."""

    name: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    bytes: Count
    episode: Count
    family: str
    outcome: Status
    ticks: Count = Field(description="number of frames")
    contributor: str | None = Field(default=None, description="who drove; of collected runs")
    seed: int | None = Field(default=None, description="of the scenes; of collected runs")


class Source(Part):
    """A data set that was merged into this one; its files tell the same of themselves."""

    name: str = Field(description="begins the names of its files")
    mirrored: bool = Field(default=False, description="its episodes are mirror images")
    scenario: str | None = Field(description="its name; null: collected")
    settings: dict[str, Any] | None
    seed: int | None
    episodes: Count
    keep: list[Status] | None = Field(default=None, description="as of a data set")
    left_out: dict[str, Count] | None = Field(default=None, description="as of a data set")
    controller: Controller | None
    files: list[str]


class Counts(Part):
    """Episodes by what they are."""

    outcome: dict[str, Count]
    family: dict[str, Count]
    contributor: dict[str, Count] | None = Field(default=None, description="of collected runs")


class Manifest(Part):
    """What a data set holds: `manifest.json`."""

    format: Literal["sonata2d-dataset"]
    version: Literal[1]
    mirrored: bool = Field(default=False, description="mirror images of the episodes that settings and seed give")
    collected: bool = Field(default=False, description="driven by people, kept run by run: each file tells its own")
    name: str | None = Field(description="of the scenario; null: collected")
    settings: dict[str, Any] | None = Field(description="resolved settings of the scenario")
    seed: int | None
    episodes: Count = Field(description="how many were asked for; where some are kept, how many of these")
    keep: list[Status] | None = Field(
        default=None, description="outcomes that were kept: the first ones by number that ended so; absent: all"
    )
    controller: Controller | None
    precision: Positive
    physics: int
    complete: bool = Field(description="false while it is being made, or where that was interrupted")
    counts: Counts
    left_out: dict[str, Count] | None = Field(
        default=None, description="by outcome, how many before the last one listed were not kept; only with `keep`"
    )
    split: dict[str, list[str]] | None = Field(description="names of files by part: train, dev, test; null: not split")
    sources: list[Source] | None = Field(default=None, description="what it was merged from; each has its own seed")
    files: list[ManifestFile]
    software: Software
