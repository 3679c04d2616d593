"""The data card of a data set: README.md with Hugging Face front matter, figures on request, and Croissant metadata.

Generation writes a card from the manifest alone. `write_card` (`sonata2d card`) reads the episodes too.
"""

from __future__ import annotations

import hashlib
import importlib.util
import re
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...core.files.locations import location
from ...core.notebook import Advance
from ...errors import DatasetWarning, RecordError
from ...record.files import read_bytes, read_stored, read_text, write_atomically
from ...record.layout import JsonDict
from ...record.models import Settings
from ...record.reader import read_episode
from ...record.record import EpisodeRecord
from ...record.shard_file import is_shard
from ..manifest.read import (
    CARD,
    CROISSANT,
    FIGURES,
    MANIFEST,
    SCENARIO,
    json_bytes,
    read_manifest,
    warn_if_incomplete,
    write_json,
)
from .croissant import Publication, croissant_metadata, stored_publication
from .figure import collect_statistics, draw_statistics, require_matplotlib
from .text import card_text, default_licence, description_of, figures_section, recorded_count, title_of

_SEAL = re.compile(r"<!-- written by sonata2d, SHA-256 of the text above: ([0-9a-f]{64}) -->\n")


def write_manifest_and_card(folder: Path, manifest: JsonDict, *, licence: str | None = None) -> None:
    """Write the data card, Croissant metadata if the folder has any, and last the manifest: they always agree.

    What the author stated about the data set (licence, date, …) stays. The figures of the card stay if its counts do,
    else they are removed, as they show other episodes. A card that the author edited is not replaced.

    Args:
        folder: folder of the data set.
        manifest: the new manifest.
        licence: of a data set that is derived from others; None: the one chosen for the folder, or the default.

    Raises:
        RecordError: a file cannot be written, or the file of the settings is damaged.

    Warns:
        DatasetWarning: the card was edited, or `croissant.json` states a value that is not kept.
    """
    _require_no_shard(folder)
    data, described = json_bytes(manifest), _with_settings(folder, manifest)
    publication = stored_publication(folder)
    licence = licence or _chosen_licence(folder, publication) or default_licence(described)
    publication = replace(publication, licence=licence)
    is_edited = has_edited_card(folder)
    if not is_edited:
        _write_text(folder, card_text(described, licence, _kept_figures(folder, manifest)))
    if (folder / CROISSANT).is_file():
        write_json(folder / CROISSANT, _metadata(described, data, publication))
    write_atomically(folder / MANIFEST, data)
    if is_edited:
        message = f"{folder / CARD} was edited, so it stays as it is; write it again with `sonata2d card`"
        warnings.warn(message, DatasetWarning, stacklevel=2)


def _require_no_shard(folder: Path) -> None:
    if is_shard(folder):
        raise RecordError(f"{folder} is a shard, whose manifest and card stay; name the folder of its data set")


def write_card(
    folder: str | Path,
    *,
    figures: bool | None = True,
    licence: str | None = None,
    date: str | None = None,
    version: str | None = None,
    creator: str | None = None,
    organisation: bool | None = None,
    url: str | None = None,
    advance: Advance = lambda step: None,
) -> Path:
    """Write the card of a data set with figures of its episodes, and Croissant metadata beside it.

    A card that was edited is replaced as well.

    Args:
        folder: folder of the data set.
        figures: whether to read all episodes and draw their statistics, which needs matplotlib. False: a card without
            figures; those of the former card are removed. None: draw them if matplotlib is installed, else keep those
            of the former card if they show the same episodes.
        licence: identifier as on Hugging Face, or an https address; by default the one that was chosen before, else
            `cc-by-4.0`, or `other` for recorded pedestrians.
        date: date of publication, YYYY-MM-DD; by default, as for the following, what was stated before, else nothing.
        version: MAJOR.MINOR.PATCH; at first 1.0.0.
        creator: name of the person or organisation that made the data set.
        organisation: whether the creator is an organisation; by default, a stated creator is a person.
        url: page of the data set.
        advance: progress callback; its argument is the number of episodes read.

    Returns:
        The path of the card.

    Raises:
        ConfigError: the licence, the date, the version or the address does not have its form.
        RecordError: the folder is not a data set, or an episode cannot be read.
        RenderError: `figures` is set and matplotlib is not installed.
    """
    folder = location(folder)
    _require_no_shard(folder)
    manifest = _with_settings(folder, read_manifest(folder))
    warn_if_incomplete(folder, manifest)
    if creator is not None:
        organisation = bool(organisation)  # what was stated of another creator does not hold for this one
    stored = stored_publication(folder)
    given: dict[str, Any] = {
        "licence": licence or _chosen_licence(folder, stored) or default_licence(manifest),
        "date": date,
        "version": version,
        "creator": creator,
        "organisation": organisation,
        "url": url,
    }
    publication = replace(stored, **{name: value for name, value in given.items() if value is not None})
    if figures or (figures is None and importlib.util.find_spec("matplotlib") is not None):
        require_matplotlib()
        statistics = collect_statistics(_records(folder, [file["name"] for file in manifest["files"]], advance))
        draw_statistics(folder / FIGURES, statistics, title_of(manifest))
        section = figures_section(statistics)
    elif figures is None:
        section = _kept_figures(folder, manifest)
    else:
        section = ""
        (folder / FIGURES).unlink(missing_ok=True)
    write_json(folder / CROISSANT, _metadata(manifest, read_stored(folder / MANIFEST), publication))
    _write_text(folder, card_text(manifest, publication.licence, section))
    return folder / CARD


def _write_text(folder: Path, text: str) -> None:
    """Write the card; its last line is a hash of the others, by which `has_edited_card` recognises it."""
    digest = hashlib.sha256(text.encode()).hexdigest()
    write_atomically(
        folder / CARD, f"{text}\n<!-- written by sonata2d, SHA-256 of the text above: {digest} -->\n".encode()
    )


def has_edited_card(folder: Path) -> bool:
    """Whether the card is not as sonata2d wrote it: it is edited, or was written by hand or by version 0.1."""
    path = folder / CARD
    if not path.is_file():
        return False
    text, _, last = read_text(path).rpartition("\n<!--")
    found = _SEAL.fullmatch(f"<!--{last}")
    return found is None or hashlib.sha256(text.encode()).hexdigest() != found[1]


def _chosen_licence(folder: Path, publication: Publication) -> str | None:
    """The licence that an author chose for a data set; None if it has the default one, or has no manifest yet."""
    stored = publication.licence
    if stored is None or not (folder / MANIFEST).is_file():
        return None
    return stored if stored != default_licence(_with_settings(folder, read_manifest(folder))) else None


def licence_of(folder: Path) -> str:
    """The licence of a data set."""
    chosen = _chosen_licence(folder, stored_publication(folder))
    return chosen or default_licence(_with_settings(folder, read_manifest(folder)))


def _metadata(manifest: JsonDict, manifest_data: bytes, publication: Publication) -> JsonDict:
    """Croissant metadata.

    Args:
        manifest: with the settings.
        manifest_data: bytes of the manifest file.
        publication: with a licence.
    """
    return croissant_metadata(
        manifest,
        hashlib.sha256(manifest_data).hexdigest(),
        title=title_of(manifest),
        description=description_of(manifest),
        publication=publication,
        responsible_ai=_responsible_ai(manifest),
    )


def _responsible_ai(manifest: JsonDict) -> JsonDict:
    """Properties of the Croissant RAI vocabulary."""
    recorded, listed = recorded_count(manifest)
    sources = manifest.get("sources") or [manifest]
    driven = [source for source in sources if source.get("scenario", source.get("name")) is None]
    origin = []
    if len(driven) < len(sources):
        origin.append(
            "A controller drove a simulated robot among pedestrians in scenes that were drawn from the settings and the"
            " seed in manifest.json."
        )
    if driven:
        origin.append(
            "People drove a simulated robot in a window or a browser with sonata2d, and decided which runs were kept."
        )
    if recorded:
        origin.append(f"{recorded} of {listed} listed pedestrians follow recorded tracks and do not react to others.")
    biases = ["Simulated pedestrians move by a pedestrian model; real people move and react in more ways."]
    if len(driven) < len(sources):
        biases.append("The robot is driven by the controllers in manifest.json; states that they avoid are rare.")
    kept = sorted({status for source in (manifest, *sources) for status in source.get("keep") or ()})
    if kept:
        biases.append(f"Only episodes with these outcomes are kept: {', '.join(kept)}.")
    people = []
    if driven:
        people.append("Names that drivers gave themselves (`contributor`), and how they drove.")
    if recorded:
        people.append("Positions of recorded people; the terms of the recordings apply.")
    return {
        "dataCollection": " ".join(origin),
        "dataCollectionType": ["Experiments"] * bool(driven) + ["Software Collection"] * (len(driven) < len(sources)),
        "dataBiases": biases,
        "dataLimitations": [
            "Pedestrians are simulated by social forces, with oblong bodies, and without gestures, faces or"
            " intentions beyond those in the files."
        ],
        "dataUseCases": [
            "Training and comparison of social robot navigation. Not evidence of how people feel about a robot."
        ],
        "personalSensitiveInformation": people or ["None: all pedestrians are simulated, and no person drove."],
    }


def count_differences(folder: Path, manifest: JsonDict) -> list[str]:
    """Where the counts in a card differ from a manifest; cards without them, as of other programs, never differ."""
    path = folder / CARD
    text = read_text(path)
    table = re.search(r"^\| outcome \| episodes \|\n\| -.*\n((?:\|.*\n)*)", text, re.MULTILINE)
    frames = re.search(r"^(\d+) frames in (?:total|all)\.", text, re.MULTILINE)
    differences = []
    if table:
        stated = {name: int(count) for name, count in re.findall(r"^\| (.+?) \| (\d+) \|$", table[1], re.MULTILINE)}
        if stated != manifest["counts"]["outcome"]:
            differences.append(f"states the outcomes {stated}, the manifest {manifest['counts']['outcome']}")
    # the rows of shards have the sums of their episodes
    total = sum(file["ticks"] for file in manifest.get("shards") or manifest["files"])
    if frames and int(frames[1]) != total:
        differences.append(f"states {frames[1]} frames, the manifest {total}")
    return differences


def _kept_figures(folder: Path, manifest: JsonDict) -> str:
    """The section about the figures of the present card if its counts are those of a manifest, else an empty string.

    Figures of other episodes are removed.
    """
    figures = _stored_figures(folder)
    if figures and (count_differences(folder, manifest) or not (folder / FIGURES).is_file()):
        (folder / FIGURES).unlink(missing_ok=True)
        return ""
    return figures


def _stored_figures(folder: Path) -> str:
    """The section about the figures of the present card; empty without one."""
    path = folder / CARD
    text = read_text(path)
    found = re.search(r"^## Figures\n.*?(?=^## )", text, re.MULTILINE | re.DOTALL)
    return found[0] if found and f"]({FIGURES})" in found[0] else ""


def _with_settings(folder: Path, manifest: JsonDict) -> JsonDict:
    """The manifest; for collected runs with the initial settings, which tell whether pedestrians are recorded.

    Raises:
        RecordError: the file of the settings is damaged.
    """
    path = folder / SCENARIO
    if not manifest.get("collected") or not path.exists():
        return manifest
    from pydantic import TypeAdapter, ValidationError

    try:
        return manifest | {"settings": TypeAdapter(Settings | None).validate_json(read_bytes(path))}
    except ValidationError as error:
        raise RecordError(f"{path} does not hold the settings of a scenario: {error.errors()[0]['msg']}") from None


def _records(folder: Path, names: list[str], advance: Advance) -> Iterator[EpisodeRecord]:
    for name in names:
        yield read_episode(folder / name)
        advance(1)
