"""The command `sonata2d serve`, and the server that `sonata2d collect --study` starts as well."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from .command import Command
from .options import PATH, compress_option, examples, json_option
from .output import echo, progress, show_links


@click.command(
    cls=Command, epilog=examples("serve study.yaml OUT", "serve study.yaml OUT --port 8080 --participants 20")
)
@click.argument("study", type=PATH)
@click.argument("out", type=PATH)
@click.option("--host", default="127.0.0.1", help="Address to listen at; 0.0.0.0 for all networks of this machine.")
@click.option("--port", type=click.IntRange(0, 65535), default=8765, help="0: a free one.")
@click.option("--url", metavar="URL", help="Address of the server for participants.  [default: http://HOST:PORT]")
@click.option("--participants", type=click.IntRange(0), default=0, help="Number of links that are made at the start.")
@click.option("--takeover", type=click.Choice(["newest", "first"]), default="newest", help="Tab of a link that drives.")
@click.option("--connections", type=click.IntRange(1), default=200, help="Largest number of open pages.")
@click.option(
    "--page", type=PATH, help="Folder of `sonata2d page`: pages simulate too, and show no delay of the connection."
)
@compress_option
@json_option
def command(study: Path, out: Path, **settings: Any) -> None:
    """Serve a study: participants read, drive, answer and rate in a browser.

    Prints the links, and runs until Ctrl+C. Runs, ratings and answers are stored in the folder OUT; the same command
    continues a study.
    """
    serve_study(study, out, show_links, **settings)


def serve_study(file: Path, out: Path, announce: Callable[[dict[str, str]], None], **settings: Any) -> None:
    """Check a study, and serve it until Ctrl+C.

    Args:
        file: the study file.
        out: folder of the study.
        announce: called with the links by name as soon as the server can be reached.
        settings: further ones of `sonata2d.web.settings.ServerSettings`.
    """
    from sonata2d.study.folder import opened_folder
    from sonata2d.study.load import load_study
    from sonata2d.web.serve import serve
    from sonata2d.web.settings import ServerSettings

    study = load_study(file)
    with progress(study.number_of_scenes, "scene") as advance:
        study.check_scenes(advance)
    for warning in study.config.untranslated():
        echo(f"warning: {warning}", err=True)
    with opened_folder(out, study) as folder:
        serve(folder, ServerSettings(**settings), announce)
    echo("stopped; the same command continues the study", err=True)
