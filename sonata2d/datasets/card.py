"""The data card of a data set: README.md with Hugging Face front matter, figures on request, and Croissant metadata.

Generation writes a card from the manifest alone. `write_card` (`sonata2d card`) reads the episodes too.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import re
import shlex
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..core.locations import location
from ..core.notebook import Advance
from ..errors import DatasetWarning, RecordError
from ..record.counts import ANY_KIND
from ..record.files import read_bytes, read_stored, read_text, write_atomically
from ..record.layout import JsonDict
from ..record.models import Settings
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from ..record.shard_file import is_shard
from .card_figure import EpisodeStatistics, collect_statistics, draw_statistics, require_matplotlib
from .croissant import Publication, croissant_metadata, licence_lines, stored_publication
from .manifest import (
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
from .markdown import cell, code, code_block, inline
from .summaries import ContactSummary, ExcessiveCommands, totals_of

_SEAL = re.compile(r"<!-- written by sonata2d, SHA-256 of the text above: ([0-9a-f]{64}) -->\n")
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))

_CARD = """\
---
pretty_name: {quoted_title}
{licence}
task_categories:
- robotics
tags:
- social-navigation
- pedestrians
- simulation
{synthetic_tag}- sonata2d
size_categories:
- {size}
---
# {heading}

{origin}{mirrored}{recorded}{kept}
## Contents
| outcome | episodes |
| --- | ---: |
{outcomes}

{contacts}

| family | episodes |
| --- | ---: |
{families}

{frames} frames in total. `manifest.json` lists each file with its SHA-256. `run.jsonl` is a log of the generation runs
and not part of the data.

## Units and frames
SI units: metres, seconds, radians. World frame: x right, y up, theta counter-clockwise in (-3.1416, 3.1416]. Commands
are twists in the body frame: forward, left, counter-clockwise. Each file names the columns of its rows; numbers in
frames are rounded to {precision}.

{figures}## Known limits
{simulated} simulated: social forces, oblong bodies, no gestures, faces or intentions beyond those in the file.
Use the data for training and comparison, not as evidence of how people feel about a robot.
"""

_GENERATED = """\
{count} of {requested} episodes of a robot among pedestrians in the scenario {name}, simulated by
sonata2d {sonata2d} with the controller {controller}.

## Reproduction
{command}
`scenario.json` beside this card and every episode contain the full settings. The same settings, seed, controller and
physics version ({physics}) give the same bytes; `sonata2d check --replay` verifies this.{code}
"""

_COLLECTED = """\
{count} runs of a robot among {others}, driven by {drivers} in the window of sonata2d {sonata2d}.
The drivers decided which runs were kept.

## Collection
```
sonata2d collect AGAIN --contributor NAME --scenario scenario.json
```
`scenario.json` beside this card contains the settings of the first run. Every run contains its own settings, the
driver's commands and the device events, so that `sonata2d check --replay` verifies it (physics version {physics}).
"""

_MERGED = """\
{count} episodes of a robot among pedestrians, merged from {source_count} data sets by sonata2d {sonata2d}.

## Sources
{source_table}

`manifest.json` contains the settings of each source under `sources`, as does every episode.
"""

_MIRRORED = """
Every episode is the left-right mirror image of an original; the command above gives the originals.
`sonata2d mirror` converts these files back to the originals, byte for byte.
"""

_RECORDED = """
## Recorded pedestrians
{count} of the {given} pedestrians listed in the {scenario} follow recorded tracks and do not react to others. The
terms of the recordings apply to them, and therefore to these files.
"""

_KEPT = """
## Selection by outcome
Only episodes with these outcomes are kept: {keep}. Left out: {left_out}. The data do not show how the omitted
outcomes come about, and frequencies of outcomes are not those of the controller.
"""

_FIGURES = """\
## Figures
![Positions of robot and pedestrians, speeds, clearances, and outcomes]({picture})

{frames} frames, {empty_frames} of them without pedestrians. Mean speed: robot {robot_speed:.2f} m/s, pedestrians
{pedestrian_speed:.2f} m/s. In frames with pedestrians, the clearance between the robot and the nearest one is below
0.45 m in {intimate:.1f} % and below 1.2 m in {personal:.1f} % of the frames.

"""


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
    licence = licence or _chosen_licence(folder, publication) or _default_licence(described)
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
        "licence": licence or _chosen_licence(folder, stored) or _default_licence(manifest),
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
        section = _figures_section(statistics)
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
    return stored if stored != _default_licence(_with_settings(folder, read_manifest(folder))) else None


def licence_of(folder: Path) -> str:
    """The licence of a data set."""
    chosen = _chosen_licence(folder, stored_publication(folder))
    return chosen or _default_licence(_with_settings(folder, read_manifest(folder)))


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
        description=_description(manifest),
        publication=publication,
        responsible_ai=_responsible_ai(manifest),
    )


def _responsible_ai(manifest: JsonDict) -> JsonDict:
    """Properties of the Croissant RAI vocabulary."""
    recorded, listed = _recorded_count(manifest)
    sources = manifest.get("sources") or [manifest]
    driven = [source for source in sources if source.get("scenario", source.get("name")) is None]
    origin = []
    if len(driven) < len(sources):
        origin.append(
            "A controller drove a simulated robot among pedestrians in scenes that were drawn from the settings and the"
            " seed in manifest.json."
        )
    if driven:
        origin.append("People drove a simulated robot in the window of sonata2d, and decided which runs were kept.")
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


def card_text(manifest: JsonDict, licence: str | None = None, figures: str = "") -> str:
    """The text of a card, from the manifest alone.

    Args:
        manifest: manifest of the data set.
        licence: as of `write_card`; by default `cc-by-4.0`, or `other` for recorded pedestrians.
        figures: section about the figures, or an empty string.
    """
    counts, files, title = manifest["counts"], manifest["files"], title_of(manifest)
    totals = totals_of(files)
    sources = manifest.get("sources") or []
    template = _MERGED if sources else _COLLECTED if manifest.get("collected") else _GENERATED
    driver_count = len(counts.get("contributor") or ())
    origin = template.format(
        count=len(files),
        requested=manifest["episodes"],
        name=code(manifest["name"] or ""),
        sonata2d=inline(manifest["software"]["sonata2d"]),
        controller=code((manifest["controller"] or {}).get("path", "")),
        command=code_block(_generating_command(manifest)),
        code=_code_sentence(manifest),
        physics=manifest["physics"],
        others=_pedestrian_kinds(manifest),
        drivers="one person" if driver_count == 1 else f"{driver_count} people",
        source_count=len(sources),
        source_table=_source_table(sources),
    )
    # A mirrored source repeats the selection of its original, so it gets a section only where no original is merged.
    originals = [source for source in sources or [manifest] if not source.get("mirrored")] or sources or [manifest]
    has_recorded = _recorded_count(manifest)[0] > 0
    return _CARD.format(
        heading=inline(title),
        quoted_title=json.dumps(title, ensure_ascii=False),
        size=next((name for limit, name in _SIZES if len(files) < limit), "n>1M"),
        licence=licence_lines(licence or _default_licence(manifest)),
        synthetic_tag="" if has_recorded else "- synthetic\n",
        origin=origin,
        mirrored=_MIRRORED if manifest.get("mirrored") and not sources else "",
        recorded=_recorded_section(manifest) if has_recorded else "",
        kept="".join(_kept_section(source) for source in originals),
        outcomes=_count_rows(counts["outcome"]),
        contacts=_contact_section(totals.contacts) + _excess_sentence(totals.excess),
        families=_count_rows(counts["family"]),
        frames=totals.frames,
        precision=manifest["precision"],
        figures=figures,
        simulated="Pedestrians without recorded tracks are" if has_recorded else "Pedestrians are",
    )


def _generating_command(manifest: JsonDict) -> str:
    """The command that generates a data set again, quoted for a shell."""
    arguments = ["--scenario", SCENARIO, "--seed", manifest["seed"], "--episodes", manifest["episodes"]]
    arguments += ["--controller", (manifest["controller"] or {}).get("path", "")]
    arguments += [argument for status in manifest.get("keep") or () for argument in ("--keep", status)]
    return shlex.join(["sonata2d", "generate", "AGAIN", *map(str, arguments)])


def _code_sentence(manifest: JsonDict) -> str:
    """What the same controller means, if it is not part of sonata2d; else an empty string."""
    hashes = (manifest.get("controller_sha256") or {}).values()
    if not hashes:
        return ""
    return (
        f" The controller is the\nsame if its source file has the SHA-256 {' and '.join(hashes)},\nand the modules that"
        " it imports are the same."
    )


def title_of(manifest: JsonDict) -> str:
    """The title of a data set."""
    count = len(manifest["files"])
    title = f"sonata2d {manifest['name']}, seed {manifest['seed']}"
    if manifest.get("collected"):
        title = f"sonata2d, {count} runs driven by people"
    if manifest.get("sources"):
        title = f"sonata2d, {count} episodes of {len(manifest['sources'])} data sets"
    return f"{title}, mirrored" if manifest.get("mirrored") else title


def _recorded_count(manifest: JsonDict) -> tuple[int, int]:
    """Number of pedestrians with a recorded track, and of all pedestrians listed in the scenarios of a data set."""
    sources = manifest.get("sources") or [manifest]
    people = [person for source in sources for person in (source["settings"] or {}).get("people", ())]
    return sum(bool(person.get("track")) for person in people), len(people)


def _default_licence(manifest: JsonDict) -> str:
    """Licence identifier; recordings of people have terms of their own, so theirs is `other`."""
    return "other" if _recorded_count(manifest)[0] else "cc-by-4.0"


def _pedestrian_kinds(manifest: JsonDict) -> str:
    recorded, listed = _recorded_count(manifest)
    if not recorded:
        return "simulated pedestrians"
    return "recorded pedestrians" if recorded == listed else "recorded and simulated pedestrians"


def _description(manifest: JsonDict) -> str:
    """One or two sentences for the Croissant metadata."""
    text = f"{len(manifest['files'])} episodes of a robot among {_pedestrian_kinds(manifest)}, made with sonata2d."
    kept = {status for source in (manifest, *(manifest.get("sources") or ())) for status in source.get("keep", ())}
    return text + (f" Only episodes with these outcomes are kept: {', '.join(sorted(kept))}." if kept else "")


def _recorded_section(manifest: JsonDict) -> str:
    count, given = _recorded_count(manifest)
    return _RECORDED.format(count=count, given=given, scenario="scenarios" if manifest.get("sources") else "scenario")


def _kept_section(source: JsonDict) -> str:
    """The section on the selection by outcome of a data set or a merged source; empty if all episodes are kept."""
    if not source.get("keep"):
        return ""
    counts = ", ".join(f"{count} {outcome}" for outcome, count in (source.get("left_out") or {}).items()) or "none"
    files = (
        f" (files {code(source['name'] + '__…')})" if "scenario" in source else ""
    )  # only sources have the key `scenario`
    return _KEPT.format(keep=", ".join(source["keep"]) + files, left_out=counts)


def _source_table(sources: list[JsonDict]) -> str:
    rows = ["| files | scenario | seed | episodes | |", "| --- | --- | ---: | ---: | --- |"]
    for source in sources:
        scenario = "driven by people" if source["scenario"] is None else inline(source["scenario"])
        seed, mirrored = "" if source["seed"] is None else source["seed"], "mirrored" if source.get("mirrored") else ""
        rows.append(
            f"| {cell(code(source['name'] + '__…'))} | {scenario} | {seed} | {len(source['files'])} | {mirrored} |"
        )
    return "\n".join(rows)


def _count_rows(counts: dict[str, int]) -> str:
    return "\n".join(f"| {inline(key)} | {count} |" for key, count in counts.items())


def _excess_sentence(excess: list[ExcessiveCommands]) -> str:
    """The commands beyond the limits of the robot's drive; empty if there are none."""
    found = "; ".join(map(str, excess))
    return f"\n\nCommands exceed the limits of the robot's drive, which executes less: {found}." if found else ""


def _contact_section(summary: ContactSummary) -> str:
    """Table of the robot's contacts by kind; a sentence if there are none, or they are not counted."""
    uncounted = f"Number of episodes whose contacts were not counted: {summary.uncounted_episodes}."
    if not summary.by_kind:
        return uncounted if summary.uncounted_episodes else "The robot touched nothing in any frame."
    rows = ["| robot in contact with | episodes | frames | robot at fault | other at fault |"]
    rows.append("| --- | ---: | ---: | ---: | ---: |")
    for kind, contacts in summary.by_kind.items():
        frames = (contacts.frames, contacts.robot_at_fault, contacts.other_at_fault)
        shares = " | ".join(summary.share(count) for count in frames)
        rows.append(f"| {'anything' if kind == ANY_KIND else kind} | {contacts.episodes} | {shares} |")
    note = "\nFault is with the side whose own velocity closes the gap: both, or neither, are possible."
    return "\n".join([*rows, note, *([uncounted] if summary.uncounted_episodes else [])])


def _figures_section(statistics: EpisodeStatistics) -> str:
    occupied = max(statistics.frames - statistics.empty_frames, 1)
    return _FIGURES.format(
        picture=FIGURES,
        frames=statistics.frames,
        empty_frames=statistics.empty_frames,
        robot_speed=statistics.robot_speed_sum / max(int(statistics.robot_speed.sum()), 1),
        pedestrian_speed=statistics.pedestrian_speed_sum / max(int(statistics.pedestrian_speed.sum()), 1),
        intimate=100.0 * statistics.intimate / occupied,
        personal=100.0 * statistics.personal / occupied,
    )


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
