"""Worker processes that several calls share."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing
from functools import partial
from itertools import count
from pathlib import Path

import pytest

from sonata2d.errors import WorkerError
from sonata2d.workers.executors import Workers, parallel_map
from sonata2d.workers.tasks import Call


def tagged(factor: int, item: int) -> tuple[int, int]:
    """The process, and the product."""
    time.sleep(0.005)
    return os.getpid(), factor * item


def multiplier(factor: int) -> Callable[[int], tuple[int, int]]:
    return partial(tagged, factor)


def is_large(result: tuple[int, int]) -> bool:
    return result[1] >= 20


def test_calls_share_processes_and_each_call_has_its_own_function() -> None:
    with Workers(2) as workers:
        found = [
            list(workers.results(Call(partial(multiplier, factor)), range(40), 40, in_order=False))
            for factor in (1, 10)
        ]
        found.append(list(parallel_map(partial(tagged, 100), range(40), workers=workers)))
    processes = {process for results in found for process, _ in results}
    assert len(processes) <= 2
    assert os.getpid() not in processes
    for factor, results in zip((1, 10, 100), found, strict=True):
        assert sorted(value for _, value in results) == [factor * item for item in range(40)]
    assert [value for _, value in found[2]] == [100 * item for item in range(40)]  # in order


def test_a_call_that_is_closed_early_leaves_the_processes_to_the_next_one() -> None:
    with Workers(2, task_size=4) as workers:
        endless = workers.results(Call(partial(multiplier, 1)), count(), None, in_order=False)
        with closing(endless) as results:
            assert next(results)[1] < 2 * 2 * 4  # two tasks for each process
        found = list(workers.results(Call(partial(multiplier, 2)), range(9), 9, in_order=False))
    assert sorted(value for _, value in found) == [2 * item for item in range(9)]


@pytest.mark.usefixtures("kept_processes")
def test_a_worker_skips_the_rest_of_its_chunk_after_a_last_result() -> None:
    with Workers(2, task_size=4) as workers:
        found = list(workers.results(Call(partial(multiplier, 20), is_large), range(4), None, in_order=False))
    assert [value for _, value in found] == [0, 20]


def test_no_process_is_started_for_one_worker_or_without_a_call() -> None:
    with Workers(1) as workers:
        assert list(parallel_map(partial(tagged, 2), range(2), workers=workers)) == [(os.getpid(), 0), (os.getpid(), 2)]
    with Workers(4) as workers:
        pass
    assert "_pool" not in vars(workers._backend)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of file handles")
def test_too_few_file_handles_for_a_worker_are_one_error_and_no_process_waits(tmp_path: Path) -> None:
    line = f"generate {tmp_path}/out --scenario empty --episodes 8 --workers 4 --no-picture"
    code = (
        "import resource, sys; from cli.main import main; resource.setrlimit(resource.RLIMIT_NOFILE, (16, 16));"
        f"sys.argv[1:] = {line.split()!r}; main()"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert found.returncode == 1
    assert "a worker process cannot be started" in found.stderr
    assert "Traceback" not in found.stderr


@pytest.mark.usefixtures("kept_processes")
def test_a_call_that_ends_does_not_stop_another_one() -> None:
    with Workers(2) as workers:
        first = parallel_map(partial(tagged, 1), range(60), workers=workers)
        second = parallel_map(partial(tagged, 2), range(60), workers=workers)
        with closing(first):
            next(first)
            values = [next(second)[1]]  # after all of `first`, which was submitted before
        values += [value for _, value in second]
    assert values == [2 * item for item in range(60)]


def test_a_call_whose_processes_are_ended_says_that_results_are_missing() -> None:
    with Workers(2) as workers:
        results = parallel_map(partial(tagged, 1), range(400), workers=workers)
        next(results)
    with pytest.raises(WorkerError, match="were ended before their work was done"):
        list(results)


def working_folder(_: int) -> str:
    return os.getcwd()


@pytest.mark.usefixtures("kept_processes")
def test_processes_follow_the_working_folder_of_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Workers(2) as workers:
        for name in ("first", "second"):
            (tmp_path / name).mkdir()
            monkeypatch.chdir(tmp_path / name)
            found = set(parallel_map(working_folder, range(9), workers=workers))
            assert found == {str(tmp_path / name)}
