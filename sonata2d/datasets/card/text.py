"""The text of a data card: computes what the template README.md.jinja shows."""

from __future__ import annotations

import hashlib
import json
import shlex
from functools import cache, partial
from typing import Any

from ...record.layout import JsonDict
from ..manifest.names import SCENARIO
from ..manifest.rows import listing
from ..summaries import totals_of
from ..tables import table_name
from .markdown import cell, code, code_block, inline

_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))


@cache
def template(name: str) -> Any:
    """A template of this package; its filters make text of any origin safe in Markdown and JSON."""
    from jinja2 import Environment, PackageLoader

    loader = PackageLoader(__package__, ".")
    environment = Environment(loader=loader, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True)
    environment.filters |= {"inline": inline, "code": code, "cell": cell, "code_block": code_block}
    environment.filters["json"] = partial(json.dumps, ensure_ascii=False)
    return environment.get_template(name)


def card_text(manifest: JsonDict, licence: str | None = None, *, has_tables: bool = False) -> str:
    """The text of a card, from the manifest.

    Args:
        manifest: manifest of the data set.
        licence: as of `write_card`; by default `cc-by-4.0`, or `other` for recorded pedestrians.
        has_tables: whether there are tables beside the episodes.
    """
    totals = totals_of(manifest["files"])
    sources = manifest.get("sources") or []
    # A mirrored source repeats the selection of its original, so it gets a section only where no original is merged.
    originals = [source for source in sources or [manifest] if not source.get("mirrored")] or sources or [manifest]
    recorded, listed = recorded_count(manifest)
    text: str = template("README.md.jinja").render(
        manifest=manifest,
        title=title_of(manifest),
        licence=licence or default_licence(manifest),
        size=next((name for limit, name in _SIZES if totals.episodes < limit), "n>1M"),
        sources=sources,
        originals=originals,
        recorded=recorded,
        listed=listed,
        pedestrians=pedestrian_kinds(manifest),
        drivers=len(manifest["counts"].get("contributor") or ()),
        controller=(manifest["controller"] or {}).get("path", ""),
        others=_other_robots(manifest),
        command=_generating_command(manifest),
        episodes=totals.episodes,
        frames=totals.frames,
        contacts=totals.contacts,
        excess=totals.excess,
        configs=configs_of(manifest, has_tables),
    )
    return text


def configs_of(manifest: JsonDict, has_tables: bool) -> str:
    """The lines of the front matter that name the tables, for Hugging Face; empty without tables.

    A data set in shards always has them: without, Hugging Face would take the manifests for the data.

    Args:
        manifest: of the data set.
        has_tables: whether there are tables beside the episodes.
    """
    if manifest.get("shard") or not (has_tables or "shards" in manifest):
        return ""
    names = {table_name(part): f"{table_name(part)}-" for part in manifest["split"] or ()} or {"train": ""}
    lines = ["configs:"]
    for table in ("frames", "episodes"):
        lines += [f"- config_name: {table}", f"  version: {_version_of(manifest)}"]
        lines += [*(["  default: true"] if table == "frames" else ()), "  data_files:"]
        for part, prefix in names.items():  # in quotes, since YAML takes some words and numbers for other types
            lines += [f"  - split: {json.dumps(part)}", f"    path: {json.dumps(f'{table}-{prefix}*.parquet')}"]
    return "".join(f"{line}\n" for line in lines)


def _version_of(manifest: JsonDict) -> str:
    """A version that follows from the content: by it, the cache of `datasets` tells data sets of one name apart."""
    digest = hashlib.sha256("".join(row["sha256"] for row in listing(manifest)).encode())
    for part, names in (manifest["split"] or {}).items():
        digest.update("\0".join((part, *names)).encode())
    return version_of(digest.digest())


def version_of(digest: bytes) -> str:
    """A version number for a hash."""
    return f"0.0.{int.from_bytes(digest[:6], 'big')}"


def _other_robots(manifest: JsonDict) -> str:
    """The controllers of the robots besides the first one with their numbers; empty without any."""
    robots = (manifest.get("settings") or {}).get("robots") or ()
    return ", ".join(f"{robot['count']} with `{robot['controller']}`" for robot in robots)


def _generating_command(manifest: JsonDict) -> str:
    """The command that generates a data set again, quoted for a shell."""
    arguments = ["--scenario", SCENARIO, "--seed", manifest["seed"], "--episodes", manifest["episodes"]]
    arguments += ["--controller", (manifest["controller"] or {}).get("path", "")]
    arguments += [argument for status in manifest.get("keep") or () for argument in ("--keep", status)]
    return shlex.join(["sonata2d", "generate", "AGAIN", *map(str, arguments)])


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


def pedestrian_kinds(manifest: JsonDict) -> str:
    """The kinds of pedestrians in a data set: simulated, recorded, or both."""
    recorded, listed = recorded_count(manifest)
    if not recorded:
        return "simulated pedestrians"
    return "recorded pedestrians" if recorded == listed else "recorded and simulated pedestrians"
