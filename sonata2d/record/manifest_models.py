"""The manifest of a data set as pydantic models."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from ..frame import Status
from .models import Controller, Count, Part, Positive, Software


class ManifestFile(Part):
    """One file of a data set."""

    name: str
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    bytes: Count
    episode: Count
    family: str
    outcome: Status
    ticks: Count = Field(description="number of frames")


class Counts(Part):
    """Episodes by what they are."""

    outcome: dict[str, Count]
    family: dict[str, Count]


class Manifest(Part):
    """What a data set holds: `manifest.json`."""

    format: Literal["sonata2d-dataset"]
    version: Literal[1]
    name: str = Field(description="of the scenario")
    settings: dict[str, Any] | None = Field(description="resolved settings of the scenario")
    seed: int
    episodes: Count = Field(description="how many were asked for")
    controller: Controller
    precision: Positive
    physics: int
    complete: bool = Field(description="false while it is being made, or where that was interrupted")
    counts: Counts
    split: dict[str, list[str]] | None = Field(description="names of files by part: train, dev, test; null: not split")
    files: list[ManifestFile]
    software: Software
