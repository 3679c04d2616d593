"""Writes the card of a data set: README.md with figures, and metadata for machines."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path

import orjson

from ..record import MANIFEST, EpisodeRecord, read_episode, read_manifest, write_atomically
from ..record.card import card, title_of
from ..record.dataset import CARD, CROISSANT
from .croissant import croissant
from .picture import draw_survey, refuse_without_plots
from .survey import Survey, surveyed

FIGURES = "card.png"
_LIMITS = "## Known limits"
_SECTION = """\
## Figures
![Where robot and people were, how fast they were, how near they came, how episodes ended]({picture})

{frames} frames, {alone} of them without people. Robot's speed {robot_speed:.2f} m/s, people's {people_speed:.2f} m/s in
the mean; the gap from the robot to the nearest person is below 0.45 m in {intimate:.1f} % and below 1.2 m in
{personal:.1f} % of the frames with people.

"""


def write_card(folder: str | Path, *, figures: bool = True, advance: Callable[[int], None] = lambda step: None) -> Path:
    """Write the card of a data set, with figures of its episodes, and Croissant metadata beside it.

    Args:
        folder: of the data set.
        figures: whether to read all episodes and draw how they look; needs matplotlib.
        advance: is told how many episodes were read.

    Returns:
        The card's path.

    Raises:
        RecordError: the folder holds no data set, or an episode cannot be read.
        RenderError: figures are asked for, and matplotlib is not installed.
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    text = card(manifest)
    if figures:
        refuse_without_plots()
        survey = surveyed(_records(folder, [file["name"] for file in manifest["files"]], advance))
        draw_survey(folder / FIGURES, survey, title_of(manifest))
        text = text.replace(_LIMITS, _SECTION.format(picture=FIGURES, **_figures_of(survey)) + _LIMITS)
    digest = hashlib.sha256((folder / MANIFEST).read_bytes()).hexdigest()
    about = f"{len(manifest['files'])} episodes of a robot among simulated people, made with sonata2d."
    tree = croissant(manifest, digest, title=title_of(manifest), description=about)
    write_atomically(folder / CROISSANT, orjson.dumps(tree, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE))
    write_atomically(folder / CARD, text.encode())
    return folder / CARD


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
