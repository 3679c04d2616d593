"""The data card: the README.md of a data set, with the front matter that Hugging Face reads."""

from __future__ import annotations

import json
from collections.abc import Iterable

from .layout import Tree

_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))

_CARD = """\
---
pretty_name: {quoted}
license: cc-by-4.0
task_categories:
- robotics
tags:
- social-navigation
- pedestrians
- simulation
- synthetic
- sonata2d
size_categories:
- {size}
---
# {title}

{made}
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
The people are simulated: social forces, discs for bodies, no gestures, faces or intentions beyond what the file says.
Use it to train and to compare; do not take it as evidence of how people feel about a robot.
"""

_GENERATED = """\
{count} of {asked} episodes of a robot among people in the scenario `{name}`, simulated by
sonata2d {sonata2d} and driven by `{controller}`.

## Made by
```
sonata2d generate AGAIN --scenario scenario.json --seed {seed} --episodes {asked} --controller {controller}
```
`scenario.json` beside this card holds the settings in full, as does every episode. The same settings, seed and physics
version ({physics}) give the same bytes: `sonata2d check` with `--replay` proves it.
"""

_COLLECTED = """\
{count} runs of a robot among simulated people, driven by {people} in the window of sonata2d {sonata2d}, and kept by
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


def card(manifest: Tree) -> str:
    """The card of a data set, from its manifest alone."""
    counts, files, title = manifest["counts"], manifest["files"], title_of(manifest)
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
        "people": _people(len(counts.get("contributor") or ())),
        "sources": len(manifest.get("sources") or ()),
        "table": _sources(manifest.get("sources") or ()),
    }
    return _CARD.format(
        title=title,
        quoted=json.dumps(title, ensure_ascii=False),
        size=next((name for most, name in _SIZES if len(files) < most), "n>1M"),
        made=made.format(**told),
        precision=manifest["precision"],
        outcomes=_lines(counts["outcome"]),
        families=_lines(counts["family"]),
        frames=sum(file["ticks"] for file in files),
    )


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
