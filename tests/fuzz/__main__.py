"""`python -m tests.fuzz --count 1000`: run random cases, and print what became of them by kind of input."""

from __future__ import annotations

import importlib
import logging
import os
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import click

from .runner import ALL, Result, repeat, run_cases
from .samples import make_samples
from .targets import few_ticks, weights

# loaded once, before workers are forked
LOADED = [
    "sonata2d.formats.api", "sonata2d.metrics.measurement", "sonata2d.view.stills", "sonata2d.view.episode_page",
    "yaml", "pyarrow.parquet", "cli.main", "cli.check", "cli.describe", "cli.evaluate", "cli.export", "cli.import_",
    "cli.mirror", "cli.render", "cli.split",
]  # fmt: skip


@click.command()
@click.option("--count", type=click.IntRange(1), default=1000, show_default=True, help="Number of cases.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the cases.")
@click.option(
    "--kind", "kinds", type=click.Choice(ALL), multiple=True, help="Only this kind of input; may be repeated."
)
@click.option("--case", type=int, help="Only the case with this number, of one kind.")
@click.option("--workers", type=click.IntRange(1), default=os.cpu_count(), show_default=True)
@click.option("--failures", type=click.Path(path_type=Path), default=Path("fuzz-failures"), show_default=True)
def main(count: int, seed: int, kinds: tuple[str, ...], case: int | None, workers: int, failures: Path) -> None:
    """Damage files of every kind, and give them to every reader and command.

    The exit code is 1 if a case fails. Its input is then copied to the folder of failures.
    """
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    logging.disable(logging.CRITICAL)
    chosen = kinds or ALL
    cases = [(chosen[k % len(chosen)], k // len(chosen)) for k in range(count)]
    if case is not None:
        cases = [(kind, case) for kind in chosen]
    results: list[Result] = []
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="sonata2d-fuzz-samples-") as samples:
        make_samples(Path(samples))
        for name in LOADED:
            importlib.import_module(name)
        few_ticks(Path(samples) / "scenario" / "drawn.yaml")  # compiles kernels, which may take longer than a case
        weights(Path(samples) / "weights" / "policy.npz")
        with suppress(KeyboardInterrupt):  # the table shows what was done so far
            for result in run_cases(cases, seed, Path(samples), failures, workers):
                results.append(result)
                if result.status == "failed" or case is not None:
                    click.echo(f"{result.status}: {result.detail}\n  {repeat(result, seed)}")
    _show_table(results)
    rate = len(results) / (time.monotonic() - start)
    click.echo(f"seed {seed}, {rate:.0f} cases a second; the input of failures is in {failures}")
    raise SystemExit(any(result.status == "failed" for result in results))


def _show_table(results: list[Result]) -> None:
    click.echo(f"{'kind':10} {'cases':>7} {'accepted':>9} {'refused':>8} {'failures':>9} {'slowest':>9} {'memory':>8}")
    for kind in (*ALL, "all"):
        own = [result for result in results if kind in (result.kind, "all")]
        if own:
            accepted, refused, failed = (sum(r.status == s for r in own) for s in ("accepted", "refused", "failed"))
            slowest, memory = max(result.seconds for result in own), max(result.megabytes for result in own)
            counts = f"{len(own):7} {accepted:9} {refused:8} {failed:9}"
            click.echo(f"{kind:10} {counts} {slowest:7.2f} s {memory:5.0f} MB")


if __name__ == "__main__":
    main()
