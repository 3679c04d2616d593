"""Signals at random moments, and workers that are killed."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from .commands import COMMANDS, GENERATE, TIME_LIMIT, Command, Result, contents, run, unexpected_files
from .table import Row

EXIT_CODES = {signal.SIGKILL: -signal.SIGKILL, signal.SIGTERM: 143, signal.SIGINT: 130}


def stops(material: Path, work: Path, moments: int, seed: int) -> Iterator[Row]:
    """Stop `generate` at random moments by each signal and resume it; then stop the other commands, and repeat them."""
    random_source = random.Random(seed)
    for command in COMMANDS:
        whole, seconds = _complete_run(command, material, work / "whole")
        count = moments if command is GENERATE else max(1, moments // 10)
        for number in EXIT_CODES:
            row = Row(number.name, command.name)
            for _ in range(count):
                shutil.rmtree(work / "out", ignore_errors=True)
                (work / "out").mkdir()
                moment, to_group = random_source.uniform(0, 1.05 * seconds), random_source.random() < 0.5
                row.add(*_stopped(command, material, work / "out", number, moment, to_group, whole))
            yield row


def killed_workers(material: Path, work: Path, moments: int, seed: int) -> Iterator[Row]:
    """Kill one worker process at random moments, and resume or repeat the command."""
    random_source = random.Random(seed)
    for command in (c for c in COMMANDS if c.name in ("generate", "evaluate")):
        whole, seconds = _complete_run(command, material, work / "whole")
        row = Row("a worker killed", command.name)
        for _ in range(max(1, moments // 5)):
            shutil.rmtree(work / "out", ignore_errors=True)
            (work / "out").mkdir()
            row.add(*_with_killed_worker(command, material, work / "out", random_source.uniform(0, seconds), whole))
        yield row


def _complete_run(command: Command, material: Path, output: Path) -> tuple[dict[str, str], float]:
    """Contents of the output folder after a run without a fault, and how long the run takes, s."""
    shutil.rmtree(output, ignore_errors=True)
    output.mkdir(parents=True)
    command.prepare(material, output)
    start = time.perf_counter()
    result = run(command.line(material, output))
    assert result.code == 0, result
    return contents(output), time.perf_counter() - start


def _stopped(
    command: Command,
    material: Path,
    output: Path,
    number: signal.Signals,
    moment: float,
    to_group: bool,
    whole: dict[str, str],
) -> tuple[str, str]:
    """The outcome of a run that is stopped after `moment` seconds, and what is wrong."""
    command.prepare(material, output)
    before = contents(output)
    process = _started(command, material, output)
    time.sleep(moment)
    with suppress(ProcessLookupError):
        (os.killpg if to_group else os.kill)(process.pid, number)
    result = _ended(process)
    if "Fatal Python error: init_import_site" in result.errors:
        return "Python had not started", ""
    if result.code not in (0, EXIT_CODES[number], -number):  # -number: before Python could handle the signal
        return "", f"exit code {result.code}: {result.errors[-300:]!r}"
    left = unexpected_files(output, before, whole, partial_allowed=number == signal.SIGKILL)
    outcome = "finished before" if result.code == 0 else f"exit code {_shell_code(result.code)}"
    return outcome, (result.fault if number != signal.SIGKILL else "") or left or _repeated(
        command, material, output, whole
    )


def _with_killed_worker(
    command: Command, material: Path, output: Path, moment: float, whole: dict[str, str]
) -> tuple[str, str]:
    command.prepare(material, output)
    before = contents(output)
    process = _started(command, material, output)
    time.sleep(moment)
    while not (workers := _workers_of(process.pid)) and process.poll() is None:
        time.sleep(0.01)
    if workers:
        with suppress(ProcessLookupError):
            os.kill(workers[0], signal.SIGKILL)
    result = _ended(process)
    if result.code not in (0, 1):
        return "", f"exit code {result.code}: {result.errors[-300:]!r}"
    fault = result.fault or unexpected_files(output, before, whole, partial_allowed=True)
    outcome = "finished before" if result.code == 0 else "error, exit code 1"
    return outcome, fault or _repeated(command, material, output, whole)


def _repeated(command: Command, material: Path, output: Path, whole: dict[str, str]) -> str:
    """Run the command again, or resume it: the files must be those of a run without a fault. Returns what is wrong."""
    line = command.line(material, output)
    if command.resumed and (output / "out" / "manifest.json").exists():
        line.append("--resume")
    else:
        shutil.rmtree(output)
        output.mkdir()
        command.prepare(material, output)
    result = run(line)
    if result.code != 0:
        return f"cannot go on: {result.errors[-300:]!r}"
    return "" if contents(output) == whole else "other files after going on"


def _started(command: Command, material: Path, output: Path) -> subprocess.Popen[str]:
    line = command.line(material, output)
    return subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True)


def _ended(process: subprocess.Popen[str]) -> Result:
    _, errors = process.communicate(timeout=TIME_LIMIT)
    return Result(process.returncode, errors)


def _shell_code(code: int) -> int:
    """The exit code as a shell shows it: 128 plus the signal that ended the process."""
    return code if code >= 0 else 128 - code


def _workers_of(parent: int) -> list[int]:
    """Ids of the worker processes of a command (Linux)."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            is_child = int(stat.read_text().rpartition(")")[2].split()[1]) == parent
            is_worker = is_child and b"spawn_main" in (stat.parent / "cmdline").read_bytes()
        except OSError:
            continue  # it has ended
        if is_worker:
            found.append(int(stat.parent.name))
    return found
