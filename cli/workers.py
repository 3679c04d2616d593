"""Options for the workers of a command: processes of this machine, or a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

if TYPE_CHECKING:
    from sonata2d.workers.executors import Workers

_OPTIONS = (
    click.option(
        "--workers", type=click.IntRange(1, 256), default=min(2, os.cpu_count() or 1), help="Number of processes."
    ),
    click.option(
        "--engine",
        type=click.Choice(["processes", "dask"]),
        default="processes",
        help="Processes of this machine, or Dask: a cluster with --address, else local processes.",
    ),
    click.option("--address", metavar="URL", help="Scheduler of a Dask cluster, such as tcp://10.0.0.5:8786."),
    click.option(
        "--task-size",
        type=click.IntRange(1),
        metavar="N",
        help="Episodes that are sent to a worker at a time.  [default: as many as take 0.25 s, with Dask 2 s]",
    ),
)


@dataclass(frozen=True, slots=True)
class WorkerOptions:
    """Workers that a command line asks for."""

    number: int
    engine: str
    address: str | None
    task_size: int | None

    @contextmanager
    def started(self) -> Iterator[Workers]:
        """The workers, which end with the context.

        Raises:
            WorkerError: the cluster does not answer, or Dask is not installed.
        """
        from sonata2d.workers.executors import Workers

        with ExitStack() as stack:
            executor: Any = self.number
            if self.engine == "dask":
                from sonata2d.workers.dask_executor import DaskExecutor

                number = None if self.address else self.number
                executor = stack.enter_context(DaskExecutor(self.address, workers=number))
            yield stack.enter_context(Workers(executor, task_size=self.task_size))


def workers_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options to a command; its function gets them as one argument, `workers`."""

    @wraps(command)
    def with_workers(
        *args: Any, workers: int, engine: str, address: str | None, task_size: int | None, **options: Any
    ) -> None:
        if address and engine != "dask":
            raise click.UsageError("--address names a Dask scheduler; give --engine dask as well")
        source = click.get_current_context().get_parameter_source("workers")
        if address and source is not ParameterSource.DEFAULT:
            raise click.UsageError("--workers is for processes of this machine; a cluster has its own workers")
        command(*args, workers=WorkerOptions(workers, engine, address, task_size), **options)

    decorated: Callable[..., None] = with_workers
    for option in reversed(_OPTIONS):
        decorated = option(decorated)
    return decorated
