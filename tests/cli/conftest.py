"""Runs the command line in an empty folder."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from sonata2d_cli import main

Run = Callable[..., Result]

QUICK = """\
extends: sonata-2020
name: quick
standing: 2
wandering: 2
tables: 1
plants: 1
rules: {time_limit: 4}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with a scenario of short episodes in quick.yaml."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quick.yaml").write_text(QUICK)
    return tmp_path


@pytest.fixture
def sonata2d(here: Path, kept_processes: None) -> Run:
    """Runs the words of a command line, checks the exit code and returns the result.

    Commands use one worker unless the line says otherwise, and two are those that all tests share.
    """
    one_worker = {name: {"workers": 1} for name in ("generate", "check", "evaluate", "export", "mirror")}

    def run(line: str, code: int = 0) -> Result:
        result = CliRunner().invoke(main, line.split(), prog_name="sonata2d", default_map=one_worker)
        assert result.exit_code == code, result.output
        return result

    return run


def one_line(output: str) -> str:
    """The only line of an output."""
    lines = output.strip().splitlines()
    assert len(lines) == 1, output
    return lines[0]


@contextmanager
def started(line: str, *, preparation: str = "") -> Iterator[subprocess.Popen[str]]:
    """A process of its own group that runs the words of a command line; killed at the end if it still runs.

    Args:
        line: the words.
        preparation: Python statements that the process executes first.
    """
    program = f"{preparation}\nfrom sonata2d_cli import main\nmain(prog_name='sonata2d')"
    words = [sys.executable, "-c", program, *line.split()]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        try:
            yield process
        finally:
            process.kill()  # its workers end with it


def wait_until(is_reached: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    """Wait for a state that a running command reaches."""
    while not is_reached():
        assert process.poll() is None, "the command has ended"
        time.sleep(0.01)
