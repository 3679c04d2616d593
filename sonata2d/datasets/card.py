"""The data card: the README.md of a data set, with the front matter that Hugging Face reads."""

from __future__ import annotations

import json
from collections.abc import Iterable

from ..record.layout import Tree

_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))

_CARD = """\
---
pretty_name: {quoted}
license: {licence}
task_categories:
- robotics
tags:
- social-navigation
- pedestrians
- simulation
{synthetic}- sonata2d
size_categories:
- {size}
---
# {title}

{made}{recorded}{kept}
## Contents
| outcome | episodes |
| --- | ---: |
{outcomes}

| family | episodes |
| --- | ---: |
{families}

{frames} frames in all. `manifest.json` lists each file with its SHA-256. `run.jsonl` tells of the runs that made the
set and is no part of it.

## Units and frames
SI: metres, seconds, radians. World frame: x right, y up, theta counter-clockwise in (-3.1416, 3.1416]. Commands are
body-frame twists: ahead, left, counter-clockwise. Each file names the columns of its rows; numbers in frames are
rounded to {precision}.

## Known limits
{who} simulated: social forces, discs for bodies, no gestures, faces or intentions beyond what the file says.
Use it to train and to compare; do not take it as evidence of how people feel about a robot.
"""

_GENERATED = """\
{count} of {asked} episodes of a robot among people in the scenario `{name}`, simulated by
sonata2d {sonata2d} and driven by `{controller}`.

## Made by
```
sonata2d generate AGAIN --scenario scenario.json --seed {seed} --episodes {asked} --controller {controller}{keep}
```
`scenario.json` beside this card holds the settings in full, as does every episode. The same settings, seed and physics
version ({physics}) give the same bytes: `sonata2d check` with `--replay` proves it.
"""

_COLLECTED = """\
{count} runs of a robot among {others}, driven by {people} in the window of sonata2d {sonata2d}, and kept by
whoever drove.

## Made by
```
sonata2d collect AGAIN --contributor NAME --scenario scenario.json
```
`scenario.json` beside this card holds the settings it began with; every run holds its own, with the driver's commands
and what they did to the devices, so that `sonata2d check` with `--replay` proves it (physics version {physics}).
"""


_MIRRORED = """
Every episode here is the mirror image, left for right, of one of these: the commands above give the originals.
`sonata2d mirror` gives them too, from these files, to the byte.
"""

_RECORDED = """
## Recorded people
{count} of the {given} people that the {scenario} are recorded: they are carried along their tracks and heed nobody. The
recording's own terms apply to them, and so to these files.
"""

_KEPT = """
## Only some runs are kept
Kept are runs that ended so: {keep}. Left out were {left_out}. Whoever learns from these files has not seen how such
runs come about, and shares of outcomes among them say nothing of the driver.
"""

_MERGED = """\
{count} episodes of a robot among people, merged from {sources} data sets by sonata2d {sonata2d}.

## Made from
{table}

`manifest.json` holds the settings of each under `sources`, as does every episode.
"""


def title_of(manifest: Tree) -> str:
    """What a data set is called."""
    count = len(manifest["files"])
    title = f"sonata2d {manifest['name']}, seed {manifest['seed']}"
    if manifest.get("collected"):
        title = f"sonata2d, {count} runs driven by people"
    if manifest.get("sources"):
        title = f"sonata2d, {count} episodes of {len(manifest['sources'])} data sets"
    return f"{title}, mirrored" if manifest.get("mirrored") else title


def recorded_people(manifest: Tree) -> tuple[int, int]:
    """How many people the scenarios of a data set carry along a track, and how many they list in all."""
    told = manifest.get("sources") or [manifest]
    people = [person for one in told for person in (one["settings"] or {}).get("people", ())]
    return sum(bool(person.get("track")) for person in people), len(people)


def licence_of(manifest: Tree) -> str:
    """As Hugging Face names it, unless somebody chose one; recorded people come with terms of their own."""
    return "other" if recorded_people(manifest)[0] else "cc-by-4.0"


def others_of(manifest: Tree) -> str:
    """Who the robot is among."""
    recorded, given = recorded_people(manifest)
    if not recorded:
        return "simulated people"
    return "recorded people" if recorded == given else "recorded and simulated people"


def card(manifest: Tree, licence: str | None = None) -> str:
    """The card of a data set, from its manifest alone.

    Args:
        manifest: of the data set.
        licence: as Hugging Face names it; unless given, CC BY 4.0, or `other` where people are recorded.
    """
    counts, files, title = manifest["counts"], manifest["files"], title_of(manifest)
    recorded = recorded_people(manifest)[0]
    made = _COLLECTED if manifest.get("collected") else _GENERATED
    if manifest.get("sources"):
        made = _MERGED
    elif manifest.get("mirrored"):
        made += _MIRRORED
    told = {
        "count": len(files),
        "asked": manifest["episodes"],
        "name": manifest["name"],
        "seed": manifest["seed"],
        "sonata2d": manifest["software"]["sonata2d"],
        "controller": (manifest["controller"] or {}).get("path"),
        "physics": manifest["physics"],
        "others": others_of(manifest),
        "people": _people(len(counts.get("contributor") or ())),
        "sources": len(manifest.get("sources") or ()),
        "table": _sources(manifest.get("sources") or ()),
        "keep": "".join(f" --keep {status}" for status in manifest.get("keep") or ()),
    }
    return _CARD.format(
        title=title,
        quoted=json.dumps(title, ensure_ascii=False),
        size=next((name for most, name in _SIZES if len(files) < most), "n>1M"),
        made=made.format(**told),
        licence=licence or licence_of(manifest),
        synthetic="" if recorded else "- synthetic\n",
        recorded=_recorded(manifest),
        kept="".join(_kept(told) for told in _originals(manifest.get("sources") or [manifest])),
        who="Who is not recorded is" if recorded else "The people are",
        precision=manifest["precision"],
        outcomes=_lines(counts["outcome"]),
        families=_lines(counts["family"]),
        frames=sum(file["ticks"] for file in files),
    )


def _recorded(manifest: Tree) -> str:
    """The section on recorded people, if there are any."""
    count, given = recorded_people(manifest)
    scenario = "scenarios list" if manifest.get("sources") else "scenario lists"
    return _RECORDED.format(count=count, given=given, scenario=scenario) if count else ""


def _originals(sources: list[Tree]) -> list[Tree]:
    """Without the mirror images, which say what these do; all, if there are only images."""
    return [source for source in sources if not source.get("mirrored")] or sources


def _kept(told: Tree) -> str:
    """The section on what was left out of a data set, or of one that was merged, if only some runs were kept."""
    if not told.get("keep"):
        return ""
    keep, left_out = ", ".join(told["keep"]), told.get("left_out") or {}
    counts = ", ".join(f"{count} {outcome}" for outcome, count in left_out.items()) or "none"
    files = f" (files `{told['name']}__…`)" if "scenario" in told else ""
    return _KEPT.format(keep=keep + files, left_out=counts)


def _sources(sources: Iterable[Tree]) -> str:
    """Where merged episodes come from."""
    rows = ["| files | scenario | seed | episodes | |", "| --- | --- | ---: | ---: | --- |"]
    for source in sources:
        scenario = "driven by people" if source["scenario"] is None else source["scenario"].replace("|", "/")
        seed, image = "" if source["seed"] is None else source["seed"], "mirrored" if source.get("mirrored") else ""
        rows.append(f"| `{source['name']}__…` | {scenario} | {seed} | {len(source['files'])} | {image} |")
    return "\n".join(rows)


def _lines(counts: dict[str, int]) -> str:
    return "\n".join(f"| {key.replace('|', '/')} | {count} |" for key, count in counts.items())


def _people(count: int) -> str:
    return "one person" if count == 1 else f"{count} people"
