"""Parts of the commands `sonata2d export` and `sonata2d import`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from .output import echo, show_json, wants_json

if TYPE_CHECKING:
    from sonata2d.formats.api import TransferResult
    from sonata2d.formats.format import Options

_FLAGS = {"original": "--quirks", "frame_time": "--frame-time", "types": "--as"}  # else -- and the name of the option


def require_supported(format: str, options: Options) -> None:
    """Refuse the flag of an option that a format does not use."""
    from sonata2d.formats.api import unsupported_options

    if names := unsupported_options(format, options):
        flag = _FLAGS.get(names[0], f"--{names[0]}")
        raise click.ClickException(f"the format {format} does not use {flag}; leave it out")


def show_transfer(result: TransferResult, format: str, line: str) -> None:
    """Print the files, and on standard error the omissions; exit with 1 if files were refused or none was written."""
    from sonata2d.formats.api import summarised

    omitted = {"skipped": result.skipped, "refused": result.refused}
    if wants_json():
        reasons = {name: [str(omission) for omission in omissions] for name, omissions in omitted.items()}
        show_json({"format": format, "files": [str(file) for file in result.files], **reasons, "notes": result.notes})
    else:
        echo(line + "".join(f", {len(omissions)} {name}" for name, omissions in omitted.items() if omissions))
        for name, omissions in omitted.items():
            for reason in summarised(omissions):
                click.echo(f"{name}: {reason}", err=True)
        for remark in result.notes:
            echo(f"note: {remark}", err=True)
    if result.refused or not result.files:
        raise click.exceptions.Exit(1)
