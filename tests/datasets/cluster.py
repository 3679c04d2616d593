"""A real Dask cluster on this machine: a scheduler and workers as processes of their own, which can be killed."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Self


class Cluster:
    """A scheduler with workers.

    Args:
        folder: for log files.
        workers: number of workers to start.
        environment: additional environment variables of the workers.
    """

    def __init__(self, folder: Path, workers: int = 3, environment: dict[str, str] | None = None) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self._port}"
        self._folder = folder
        self._environment = {**os.environ, **(environment or {})}
        self.workers: list[subprocess.Popen[bytes]] = []
        self.scheduler = self._start_scheduler()
        for _ in range(workers):
            self.add_worker()

    def add_worker(self) -> None:
        """Start a worker, which joins when it is ready."""
        words = [self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "60"]
        self.workers.append(self._start("dask_worker", *words, "--local-directory", str(self._folder)))

    def kill_worker(self) -> None:
        """End the first worker as a lack of memory does."""
        self.workers[0].send_signal(signal.SIGKILL)
        self.workers.pop(0).wait()

    def restart_scheduler(self) -> None:
        """Kill all, and start another scheduler at its address with new workers, as a cluster's manager does."""
        count = len(self.workers)
        for process in (self.scheduler, *self.workers):
            process.kill()
            process.wait()
        self.workers.clear()
        self.scheduler = self._start_scheduler()
        for _ in range(count):
            self.add_worker()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _start_scheduler(self) -> subprocess.Popen[bytes]:
        return self._start("dask_scheduler", "--host", "127.0.0.1", "--port", str(self._port), "--no-dashboard")

    def _start(self, program: str, *words: str) -> subprocess.Popen[bytes]:
        with (self._folder / f"{program}.log").open("ab") as log:
            line = [sys.executable, "-m", f"distributed.cli.{program}", *words]
            return subprocess.Popen(line, stdout=log, stderr=log, env=self._environment, cwd=self._folder)


class Accidents:
    """Kills a worker, adds one and restarts the scheduler when a run has made some progress.

    Args:
        cluster: on which they happen.
        total: number of episodes of the run.
    """

    def __init__(self, cluster: Cluster, total: int) -> None:
        self._total = total
        self._left: list[tuple[float, Callable[[], None]]] = [
            (0.15, cluster.kill_worker),
            (0.35, cluster.add_worker),
            (0.55, cluster.restart_scheduler),
        ]
        self.done = 0

    def advance(self, steps: int) -> None:
        """Note that episodes are finished."""
        self.done += steps
        self.at(self.done)

    def at(self, finished: int) -> None:
        """Let the accidents happen that are due; progress is counted in order, so that it may come in leaps."""
        while self._left and finished >= self._left[0][0] * self._total:
            self._left.pop(0)[1]()

    @property
    def are_over(self) -> bool:
        """Whether all have happened."""
        return not self._left


def wait_until(condition: Callable[[], bool], seconds: float = 120.0) -> None:
    """Wait for a condition."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)
