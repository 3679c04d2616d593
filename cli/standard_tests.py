"""The command `sonata2d standard-tests`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Literal

import click

from sonata2d.registry import PEDESTRIAN_MODELS

from .command import Command
from .options import PATH, examples, json_option, registry_option
from .output import show_json, wants_json

_HEAD = """# Standard tests

The findings of `sonata2d standard-tests --model {model} --size {size}`: the tests of RiMEA (Guideline for Microscopic
Evacuation Analysis 3.0, appendix 1) and of NIST TN 1822, which ISO 20414 has taken over, as far as they apply to a
plane. Not applicable are stairs (RiMEA 2, 3, 13, 14; NIST 2.2), smoke and incapacitated people (NIST 2.5, 2.6), lifts
(NIST 2.7), people with movement disabilities (NIST 2.10), exits that close (NIST 4.1), and the sensitivity of a whole
building to its parameters (RiMEA 8).

| test | in the guidelines | found | required | |
| --- | --- | --- | --- | --- |
"""


@click.command(
    cls=Command,
    epilog=examples(
        "standard-tests", "standard-tests --size full -o page.md", "standard-tests --model helbing1995 --only corner"
    ),
)
@click.option("--model", default="sonata2026", **registry_option(PEDESTRIAN_MODELS), help="Pedestrian model to test.")
@click.option(
    "--size",
    type=click.Choice(["small", "full"]),
    default="small",
    show_default=True,
    help="full: the numbers of people of the guidelines; takes minutes.",
)
@click.option("--only", multiple=True, metavar="TEST", help="Name of a test to run; can be repeated.  [default: all]")
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Of positions, speeds and decisions."
)
@click.option("-o", "--output", "out", type=PATH, help="Also write the findings as a page in Markdown.")
@json_option
def command(model: str, size: Literal["small", "full"], only: tuple[str, ...], seed: int, out: Path | None) -> None:
    """Run the standard tests of pedestrian models: RiMEA, NIST TN 1822, ISO 20414.

    The exit code is 1 if a test fails.
    """
    from sonata2d.record.files import write_atomically
    from sonata2d.testing.standard_tests import STANDARD_TESTS, run_standard_tests

    for name in only:
        if name not in STANDARD_TESTS:
            raise click.BadParameter(f"{name!r} is no test; there are {', '.join(STANDARD_TESTS)}", param_hint="--only")
    findings = []
    for finding in run_standard_tests(model, size=size, only=only, seed=seed):
        findings.append(finding)
        if not wants_json():
            click.echo(f"{'pass' if finding.passed else 'FAIL'}  {finding.name} ({finding.sources}): {finding.found}")
            if not finding.passed:
                click.echo(f"      required: {finding.required}")
    if wants_json():
        show_json([asdict(finding) for finding in findings])
    if out is not None:
        rows = (
            f"| {each.name} | {each.sources} | {each.found} | {each.required} | {'pass' if each.passed else 'FAIL'} |\n"
            for each in findings
        )
        write_atomically(out, (_HEAD.format(model=model, size=size) + "".join(rows)).encode())
    if not all(finding.passed for finding in findings):
        raise click.exceptions.Exit(1)
