"""The command `sonata2d serve`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from .command import Command
from .common import PATH, compress_option, episode_suffix, examples, json_option, note, progress, show_links


@click.command(
    cls=Command,
    epilog=examples("serve study.yaml OUT", "serve study.yaml OUT --port 8080 --participants 20"),
)
@click.argument("study", type=PATH)
@click.argument("out", type=PATH)
@click.option("--host", default="127.0.0.1", help="Address to listen at; 0.0.0.0 for all networks of this machine.")
@click.option("--port", type=click.IntRange(0, 65535), default=8765, help="0: a free one.")
@click.option("--url", metavar="URL", help="Address of the server for participants.  [default: http://HOST:PORT]")
@click.option(
    "--participants",
    type=click.IntRange(0),
    default=0,
    help="Number of participants for whom links are made at the start.",
)
@click.option(
    "--takeover",
    type=click.Choice(["newest", "first"]),
    default="newest",
    help="Which of two tabs with the same link drives.",
)
@click.option("--connections", type=click.IntRange(1), default=200, help="Largest number of open pages.")
@compress_option
@json_option
def command(
    study: Path,
    out: Path,
    host: str,
    port: int,
    url: str | None,
    participants: int,
    takeover: Literal["newest", "first"],
    connections: int,
    compress: str,
    as_json: bool,
) -> None:
    """Serve a study: participants read, drive, answer and rate in a browser.

    Prints the links, and runs until Ctrl+C. Runs, ratings and answers are stored in the folder OUT; the same command
    continues a study.
    """
    from sonata2d.study.folder import opened_folder
    from sonata2d.study.load import load_study
    from sonata2d.web.serve import Settings, serve

    loaded = load_study(study)
    with progress(loaded.number_of_scenes, "scene") as advance:
        loaded.check_scenes(advance)
    for warning in loaded.config.untranslated():
        note(f"warning: {warning}", err=True)
    settings = Settings(
        host=host,
        port=port,
        url=url,
        participants=participants,
        takeover=takeover,
        connections=connections,
        suffix=episode_suffix(compress),
    )

    with opened_folder(out, loaded) as folder:
        serve(folder, settings, lambda links: show_links(links, as_json))
    note("stopped; the same command continues the study", err=True)
