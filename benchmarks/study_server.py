"""Starts and stops the server of a study, for the benchmarks of studies."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO


@contextmanager
def served_study(
    folder: Path,
    participants: int,
    *,
    out: str = "out",
    more: str = "",
    log: IO[str] | None = None,
    env: dict[str, str] | None = None,
) -> Iterator[tuple[subprocess.Popen[str], dict[str, str]]]:
    """`sonata2d serve` in a process of its own, and its links by name.

    Args:
        folder: holds `study.yaml`.
        participants: number of participants who have a link.
        out: name of the folder in `folder` in which the study is stored.
        more: further options of the command.
        log: file for the standard error of the server; None: that of this program.
        env: environment of the server; None: that of this program.
    """
    words = f"-m sonata2d_cli serve study.yaml {out} --port 0 --participants {participants} --json{more}"
    server: subprocess.Popen[str] = subprocess.Popen(
        [sys.executable, *words.split()], cwd=folder, env=env, stdout=subprocess.PIPE, stderr=log, text=True
    )
    try:
        assert server.stdout
        text = ""
        while not text.rstrip().endswith("}"):
            line = server.stdout.readline()
            if not line:
                raise SystemExit("the server did not start")
            text += line
        yield server, json.loads(text)
    finally:
        server.terminate()
        server.communicate()
