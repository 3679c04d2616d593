"""The command `sonata2d push`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .command import Command
from .options import PATH, examples, json_option
from .output import show_result


@click.command(cls=Command, epilog=examples("push demo lab/demo", "push demo lab/demo --private --message 'More runs'"))
@click.argument("folder", type=PATH, metavar="DIR")
@click.argument("name", metavar="OWNER/NAME")
@click.option("--private", is_flag=True, help="Only the owner sees the repository.")
@click.option("--revision", metavar="BRANCH", help="Branch that receives the files.  [default: main]")
@click.option("--message", metavar="TEXT", help="Message of the commit.")
@click.option("--personal", is_flag=True, help="Also upload drivers' names, and paths of controllers on this machine.")
@json_option
def command(folder: Path, name: str, **options: Any) -> None:
    """Upload a data set to the Hugging Face Hub.

    Episodes or shards, manifest, card, metadata, settings, picture and tables are uploaded; run log, failed episodes,
    ratings and answers are not. Files of the repository that the data set does not have are deleted. Log in with 'hf
    auth login', or set HF_TOKEN.
    """
    from sonata2d.datasets import push_dataset

    page = push_dataset(folder, name, **options)
    show_result({"page": page}, page)
