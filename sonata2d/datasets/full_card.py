"""Writes the card of a data set: README.md with figures, and metadata for machines."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import orjson

from ..errors import ConfigError, RecordError
from ..record.files import read_bytes, write_atomically
from ..record.layout import Tree
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from .card import card, licence_of, others_of, title_of
from .card_figure import Survey, draw_survey, refuse_without_plots, surveyed
from .croissant import croissant
from .manifest import CARD, CROISSANT, MANIFEST, SCENARIO, read_manifest

FIGURES = "card.png"
_LICENCE = re.compile(r"[a-z0-9][a-z0-9.+-]*")  # as Hugging Face writes them
_LIMITS = "## Known limits"
_SECTION = """\
## Figures
![Where robot and people were, how fast they were, how near they came, how episodes ended]({picture})

{frames} frames, {alone} of them without people. Robot's speed {robot_speed:.2f} m/s, people's {people_speed:.2f} m/s in
the mean; the gap from the robot to the nearest person is below 0.45 m in {intimate:.1f} % and below 1.2 m in
{personal:.1f} % of the frames with people.

"""


def write_card(
    folder: str | Path,
    *,
    figures: bool = True,
    licence: str | None = None,
    advance: Callable[[int], None] = lambda step: None,
) -> Path:
    """Write the card of a data set, with figures of its episodes, and Croissant metadata beside it.

    Args:
        folder: of the data set.
        figures: whether to read all episodes and draw how they look; needs matplotlib.
        licence: as Hugging Face names it; unless given, cc-by-4.0, or `other` where people are recorded.
        advance: is told how many episodes were read.

    Returns:
        The card's path.

    Raises:
        ConfigError: the licence is no such name.
        RecordError: the folder holds no data set, or an episode cannot be read.
        RenderError: figures are asked for, and matplotlib is not installed.
    """
    folder = Path(folder)
    manifest = _with_settings(folder, read_manifest(folder))
    if licence is not None and not _LICENCE.fullmatch(licence):
        raise ConfigError(f"{licence!r} is no licence's name; give one like cc-by-4.0, or other")
    licence = licence or licence_of(manifest)
    text = card(manifest, licence)
    if figures:
        refuse_without_plots()
        survey = surveyed(_records(folder, [file["name"] for file in manifest["files"]], advance))
        draw_survey(folder / FIGURES, survey, title_of(manifest))
        text = text.replace(_LIMITS, _SECTION.format(picture=FIGURES, **_figures_of(survey)) + _LIMITS)
    digest = hashlib.sha256((folder / MANIFEST).read_bytes()).hexdigest()
    about = f"{len(manifest['files'])} episodes of a robot among {others_of(manifest)}, made with sonata2d."
    kept = sorted(
        {status for source in (manifest, *(manifest.get("sources") or ())) for status in source.get("keep", ())}
    )
    about += f" Kept are only those that ended so: {', '.join(kept)}." if kept else ""
    tree = croissant(manifest, digest, title=title_of(manifest), description=about, licence=licence)
    write_atomically(folder / CROISSANT, orjson.dumps(tree, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE))
    write_atomically(folder / CARD, text.encode())
    return folder / CARD


def _with_settings(folder: Path, manifest: Tree) -> Tree:
    """The manifest; that of collected runs with the settings that they began with, which tell who is recorded."""
    path = folder / SCENARIO
    if not manifest["collected"] or not path.exists():
        return manifest
    try:
        return manifest | {"settings": orjson.loads(read_bytes(path))}
    except orjson.JSONDecodeError as error:
        raise RecordError(f"{path} is not whole JSON: {error}") from error


def _records(folder: Path, names: list[str], advance: Callable[[int], None]) -> Iterator[EpisodeRecord]:
    for name in names:
        yield read_episode(folder / name)
        advance(1)


def _figures_of(survey: Survey) -> dict[str, float]:
    """The numbers of the section's text."""
    met = max(survey.frames - survey.alone, 1)
    return {
        "frames": survey.frames,
        "alone": survey.alone,
        "robot_speed": survey.robot_sum / max(int(survey.robot_speed.sum()), 1),
        "people_speed": survey.people_sum / max(int(survey.people_speed.sum()), 1),
        "intimate": 100.0 * survey.intimate / met,
        "personal": 100.0 * survey.personal / met,
    }
