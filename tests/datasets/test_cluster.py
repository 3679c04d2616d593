"""Work on a Dask cluster, and in other executors: the same bytes as one process writes, whatever happens meanwhile."""

from __future__ import annotations

import pickle
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest

import sonata2d as s2
from sonata2d.agents.controllers.loading import ControllerSource
from sonata2d.datasets import verify
from sonata2d.errors import WorkerError
from sonata2d.workers.dask_executor import DaskExecutor
from sonata2d.workers.executors import Workers, parallel_map
from sonata2d.workers.tasks import MARK

from .cluster import Accidents, Cluster, wait_until
from .test_generate import QUICK, contents

EPISODES = 120
SETTINGS: dict[str, Any] = {"episodes": EPISODES, "seed": 5}
CODE = """
import sonata2d as s2

class Mine(s2.StraightToGoal):
    pass
"""


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data set as one process generates it."""
    out = tmp_path_factory.mktemp("sets") / "reference"
    s2.generate_dataset(out, QUICK, "straight-to-goal", **SETTINGS)
    return out


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A cluster that stays as it is."""
    with Cluster(tmp_path_factory.mktemp("cluster"), workers=2) as cluster:
        yield cluster


@pytest.fixture
def dask(cluster: Cluster) -> Iterator[DaskExecutor]:
    with DaskExecutor(cluster.address, patience=60.0) as executor:
        yield executor


def test_checks_survive_killed_late_and_restarted_parts_of_a_cluster(reference: Path, tmp_path: Path) -> None:
    """The results of a check are in the order of its files, so a lost task holds up those after it."""
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    for name, data in contents(reference).items():
        (damaged / name).write_bytes(data.replace(b'"radius":0.3', b'"radius":0.4') if name[:5] == "00001" else data)
    expected = verify(damaged, replay=True)
    assert len(expected) >= 10
    with Cluster(tmp_path, workers=3) as cluster, DaskExecutor(cluster.address, patience=60.0) as executor:
        accidents = Accidents(cluster, EPISODES)
        workers = Workers(executor, task_size=2)
        assert verify(damaged, replay=True, workers=workers, advance=accidents.advance) == expected
        assert accidents.are_over
        assert accidents.done == EPISODES


def test_a_task_that_a_closed_client_never_finishes_is_submitted_again(
    dask: DaskExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dask does not make all calls of its tasks if the scheduler ends meanwhile."""
    monkeypatch.setattr("distributed.Future.add_done_callback", lambda *_: None)
    future = dask.submit(time.sleep, 2.0)
    assert Workers(dask, count=1).count == 1
    assert not future.done()
    dask._reconnect()  # as if another task had said that the scheduler has ended
    assert Workers(dask, count=1).count == 1
    assert future.cancelled()
    assert dask.recover(future, CancelledError())


@pytest.mark.parametrize(("lost", "count"), [({0, 1, 2, 3, 4, 5}, 3), ({0}, 1)])
def test_lost_tasks_of_an_ordered_map_are_submitted_again(lost: set[int], count: int) -> None:
    executor = Losing(lost, count)
    assert list(parallel_map(abs, range(50), workers=executor)) == list(range(50))
    assert executor.submitted > len(lost)


class Losing(Executor):
    """An executor that loses some tasks, and then has no worker for a while."""

    def __init__(self, lost: set[int], count: int) -> None:
        self.submitted, self.count = 0, count
        self._lost = lost

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if self.submitted in self._lost:
            future.set_exception(OSError("lost"))
        else:
            future.set_result(fn(*args, **kwargs))
        self.submitted += 1
        return future

    def recover(self, future: Future[Any], error: BaseException) -> bool:
        self.count = 0
        return True


def test_a_batch_survives_the_same_and_changes_no_byte(reference: Path, tmp_path: Path) -> None:
    scenario = tmp_path / "quick.json"
    scenario.write_text(QUICK.model_dump_json())
    out = tmp_path / "out"
    with Cluster(tmp_path, workers=3) as cluster:
        line = f"generate {out} --scenario {scenario} --controller straight-to-goal --episodes {EPISODES} --seed 5"
        options = f"--engine dask --address {cluster.address} --task-size 2 --no-picture"
        words = [sys.executable, "-m", "cli", *line.split(), *options.split()]
        accidents = Accidents(cluster, EPISODES)
        with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as command:

            def goes_on() -> bool:
                accidents.at(len(list(out.glob("0*.json"))))
                return command.poll() is not None

            wait_until(goes_on)
            assert command.stderr is not None
            messages = command.stderr.read()
        assert command.returncode == 0, messages
        assert accidents.are_over
        assert "is lost; waiting up to 600 s for it to start again" in messages
        checked = [sys.executable, "-m", "cli", "check", str(out), "--replay", *options.split()[:4]]
        done = subprocess.run(checked, capture_output=True, text=True, timeout=120)
        assert (done.returncode, "120 files checked, replayed, no problems" in done.stdout) == (0, True)
    assert contents(out) == contents(reference)


def test_check_and_evaluate_give_the_same_on_a_cluster(reference: Path, dask: DaskExecutor, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    for name in (f"{number:06d}.json" for number in range(20)):
        data = (reference / name).read_bytes()
        (damaged / name).write_bytes(data.replace(b'"radius":0.3', b'"radius":0.4') if name == "000007.json" else data)
    expected_problems = verify(damaged, replay=True)
    assert expected_problems
    assert verify(damaged, replay=True, workers=dask) == expected_problems
    part = s2.Dataset(reference)[:8]
    expected = s2.evaluate(part, resamples=100).to_json()
    assert s2.evaluate(part, resamples=100, workers=dask).to_json() == expected


def test_files_of_controllers_are_sent_to_the_workers(
    dask: DaskExecutor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # the workers have another folder
    Path("own.py").write_text(CODE)
    found = [
        s2.generate_dataset(f"out{number}", QUICK, "./own.py:Mine", episodes=6, workers=workers)
        for number, workers in enumerate((dask, 1))
    ]
    assert contents(found[0].path) == contents(found[1].path)


def test_a_worker_uses_the_controller_that_was_sent_and_not_its_own_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = "import sonata2d as s2\nclass Mine(s2.StraightToGoal):\n    version = '{}'\n"
    for version in ("old", "new"):
        (tmp_path / version).mkdir()
        (tmp_path / version / "own.py").write_text(code.format(version))
    monkeypatch.chdir(tmp_path / "new")
    sent = pickle.dumps(ControllerSource("./own.py:Mine"))
    monkeypatch.chdir(tmp_path / "old")
    assert pickle.loads(sent).create().version == "new"


def test_a_controller_of_this_program_is_sent_to_the_workers(dask: DaskExecutor, tmp_path: Path) -> None:
    class Slow(s2.Controller):
        def act(self, snapshot: s2.Snapshot) -> s2.Twist:
            return s2.Twist(0.25)

    one = s2.generate_dataset(tmp_path / "one", QUICK, Slow(), episodes=6, workers=dask)
    two = s2.generate_dataset(tmp_path / "two", QUICK, Slow(), episodes=6)
    assert contents(one.path) == contents(two.path)


@pytest.mark.parametrize("kind", ["threads", "forked processes", "polled"])
def test_any_executor_gives_the_same_bytes(reference: Path, tmp_path: Path, kind: str) -> None:
    executors: dict[str, Any] = {
        "threads": lambda: ThreadPoolExecutor(2),
        "forked processes": lambda: ProcessPoolExecutor(2, mp_context=get_context("forkserver")),
        "polled": Polled,
    }
    with executors[kind]() as executor:
        s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", workers=executor, **SETTINGS)
    assert contents(tmp_path / "out") == contents(reference)


def test_an_executor_may_run_tasks_in_the_thread_of_the_caller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thread that ran tasks of a finished call is not asked to stop when it does other work."""
    monkeypatch.setattr("sonata2d.workers.tasks._LOOK_INTERVAL", 0.0)
    settings: dict[str, Any] = {"episodes": 4, "shard_size": 2}
    s2.generate_dataset(tmp_path / "one", QUICK, "straight-to-goal", workers=Failing(), **settings)
    s2.generate_dataset(tmp_path / "two", QUICK, "straight-to-goal", **settings)
    assert contents(tmp_path / "one") == contents(tmp_path / "two")


@pytest.mark.parametrize("kind", ["threads", "dask"])
def test_no_worker_writes_after_the_end_of_a_run(kind: str, dask: DaskExecutor, tmp_path: Path) -> None:
    """With `keep`, workers run episodes that turn out not to be needed."""

    class Slow(s2.StraightToGoal):
        def act(self, snapshot: s2.Snapshot) -> s2.Twist:
            import time

            time.sleep(0.01)
            return s2.Twist()

    settings: dict[str, Any] = {"episodes": 3, "keep": ["timeout"]}
    s2.generate_dataset(tmp_path / "one", QUICK, Slow(), **settings)
    with ThreadPoolExecutor(3) as threads:
        executor = {"threads": threads, "dask": dask}[kind]
        workers = Workers(executor, count=6, task_size=1)
        s2.generate_dataset(tmp_path / "out", QUICK, Slow(), workers=workers, **settings)
        time.sleep(1.5)  # longer than two episodes
    assert contents(tmp_path / "out") == contents(tmp_path / "one")


class Job:
    """A future that is not one of the standard library, such as the job of a batch system."""

    def __init__(self, future: Future[Any]) -> None:
        self._future = future

    def done(self) -> bool:
        return self._future.done()

    def result(self) -> Any:
        return self._future.result()

    def cancel(self) -> None:
        self._future.cancel()


class Polled(ThreadPoolExecutor):
    """An executor with such futures."""

    def __init__(self) -> None:
        super().__init__(2)

    def submit(self, *arguments: Any, **settings: Any) -> Any:  # type: ignore[override]
        return Job(super().submit(*arguments, **settings))


def test_workers_of_another_version_are_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import sonata2d.version as v; v.__version__ = '0.2.9'")
    with (
        Cluster(tmp_path, workers=1, environment={"PYTHONPATH": str(tmp_path)}) as cluster,
        DaskExecutor(cluster.address, patience=60.0) as executor,
        pytest.raises(
            WorkerError, match=r"worker process \d+ of .* has sonata2d 0\.2\.9, and this program 0\."
        ) as raised,
    ):
        s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=4, workers=executor)
    assert "run the same command again" in "".join(raised.value.__notes__)


def test_workers_that_do_not_see_a_folder_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    elsewhere = Path("/nowhere/data")
    monkeypatch.setattr("sonata2d.workers.tasks._VISIBLE_WITHIN", 0.5)
    with (
        ThreadPoolExecutor(1) as executor,
        pytest.raises(WorkerError, match="does not see /nowhere/data; give a folder that all machines share"),
    ):
        list(parallel_map(len, ["a", "b"], workers=executor, reads=elsewhere))


def test_a_scheduler_that_does_not_answer_is_one_error() -> None:
    with pytest.raises(WorkerError, match=r"the Dask scheduler tcp://127\.0\.0\.1:1 does not answer"):
        DaskExecutor("tcp://127.0.0.1:1", patience=0.5)


def test_an_executor_that_fails_leaves_the_finished_episodes(tmp_path: Path, reference: Path) -> None:
    with pytest.raises(WorkerError, match="Failing cannot run a task: OSError: no space"):
        s2.generate_dataset(
            tmp_path / "out", QUICK, "straight-to-goal", workers=Workers(Failing(), task_size=3), **SETTINGS
        )
    assert not list((tmp_path / "out").glob(f"{MARK}*"))
    assert list((tmp_path / "out").glob("0*.json"))
    s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", resume=True, **SETTINGS)
    assert contents(tmp_path / "out") == contents(reference)


class Failing(Executor):
    """Runs ten tasks, and none after them."""

    def __init__(self) -> None:
        self._left = 10

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self._left -= 1
        if self._left < 0:
            future.set_exception(OSError("no space"))
        else:
            future.set_result(fn(*args, **kwargs))
        return future


@pytest.mark.parametrize(
    ("executor", "settings", "error", "message"),
    [
        ("dask", {}, TypeError, "workers are a number of processes, or a concurrent.futures.Executor, got 'dask'"),
        (2.0, {}, TypeError, "got 2.0"),
        (0, {}, ValueError, "workers must be 1 or more, got 0"),
        (2, {"count": 3}, ValueError, "count is the number of tasks of an executor"),
        (2, {"task_size": 0}, ValueError, "task_size must be 1 or more, got 0"),
    ],
)
def test_wrong_workers_are_one_error(executor: Any, settings: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Workers(executor, **settings)


def test_tasks_take_about_the_same_time_whatever_an_item_takes() -> None:
    with Counting() as executor:
        list(parallel_map(_nap, [0.001] * 900 + [0.1] * 5, workers=Workers(executor, count=1)))
        sizes = executor.sizes
    assert sizes[:2] == [1, 1]  # it begins with few, because the first items also compile the simulation
    assert max(sizes) > 100  # 2 s are many items of 1 ms
    assert sum(sizes) == 905


class Counting(ThreadPoolExecutor):
    """Counts the items of tasks."""

    def __init__(self) -> None:
        super().__init__(1)
        self.sizes: list[int] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
        self.sizes.append(len(args[2]))
        return super().submit(fn, *args, **kwargs)


def _nap(seconds: float) -> None:
    import time

    time.sleep(seconds)
