"""The text of a data card: README.md with Hugging Face front matter."""

from __future__ import annotations

import json
import shlex

from ...record.counts import ANY_KIND
from ...record.layout import JsonDict
from ..manifest.read import FIGURES, SCENARIO
from ..summaries import ContactSummary, ExcessiveCommands, totals_of
from .croissant import licence_lines
from .figure import EpisodeStatistics
from .markdown import cell, code, code_block, inline

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
{count} runs of a robot among {others}, driven by {drivers} with sonata2d {sonata2d}, in its window or in a browser.
The drivers decided which runs were kept.

## Collection
```
sonata2d collect AGAIN --contributor NAME --scenario scenario.json
```
`scenario.json` beside this card contains the settings of the first run. Runs of a study are collected with its file,
`--study FILE` in place of `--scenario`. Every run contains its own settings, the
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
    has_recorded = recorded_count(manifest)[0] > 0
    return _CARD.format(
        heading=inline(title),
        quoted_title=json.dumps(title, ensure_ascii=False),
        size=next((name for limit, name in _SIZES if len(files) < limit), "n>1M"),
        licence=licence_lines(licence or default_licence(manifest)),
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


def recorded_count(manifest: JsonDict) -> tuple[int, int]:
    """Number of pedestrians with a recorded track, and of all pedestrians listed in the scenarios of a data set."""
    sources = manifest.get("sources") or [manifest]
    people = [person for source in sources for person in (source["settings"] or {}).get("people", ())]
    return sum(bool(person.get("track")) for person in people), len(people)


def default_licence(manifest: JsonDict) -> str:
    """Licence identifier; recordings of people have terms of their own, so theirs is `other`."""
    return "other" if recorded_count(manifest)[0] else "cc-by-4.0"


def _pedestrian_kinds(manifest: JsonDict) -> str:
    recorded, listed = recorded_count(manifest)
    if not recorded:
        return "simulated pedestrians"
    return "recorded pedestrians" if recorded == listed else "recorded and simulated pedestrians"


def description_of(manifest: JsonDict) -> str:
    """One or two sentences for the Croissant metadata."""
    text = f"{len(manifest['files'])} episodes of a robot among {_pedestrian_kinds(manifest)}, made with sonata2d."
    kept = {status for source in (manifest, *(manifest.get("sources") or ())) for status in source.get("keep", ())}
    return text + (f" Only episodes with these outcomes are kept: {', '.join(sorted(kept))}." if kept else "")


def _recorded_section(manifest: JsonDict) -> str:
    count, given = recorded_count(manifest)
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


def figures_section(statistics: EpisodeStatistics) -> str:
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
