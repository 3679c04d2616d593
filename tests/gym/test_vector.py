"""`SocialNavVectorEnv`: the same bits as single environments, autoreset, processes."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import sonata2d as s2
import sonata2d.gym as s2g
from sonata2d.errors import ControllerError, RecordError
from sonata2d.gym.vector import _Remote
from tests.gym.samples import CHAINS, SHORT, equal

STILL = np.zeros((2, 3), dtype=np.float32)
COUNT, STEPS = 3, 80  # episodes of 60 steps end within


def run(envs: Any, seed: int = 4) -> list[Any]:
    """All results of some steps."""
    rng = np.random.default_rng(0)
    results = [envs.reset(seed=seed)]
    for _ in range(STEPS):
        actions = rng.uniform(-1.0, 1.0, (COUNT, 3)).astype(np.float32)
        results.append(envs.step(actions))
    envs.close()
    return results


@pytest.mark.parametrize("processes", [1, 2])
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("chain", ["none", "history of flat"])
def test_results_equal_those_of_gymnasiums_own_vector(processes: int, mode: AutoresetMode, chain: str) -> None:
    wrap = CHAINS[chain]
    own = s2g.SocialNavVectorEnv(
        COUNT, scenario="lively", settings=SHORT, wrappers=[wrap], processes=processes, autoreset_mode=mode
    )
    others = SyncVectorEnv([lambda: wrap(s2g.SocialNavEnv("lively", settings=SHORT))] * COUNT, autoreset_mode=mode)
    assert own.observation_space == others.observation_space
    assert own.action_space == others.action_space
    assert own.metadata["autoreset_mode"] == mode
    for found, expected in zip(run(own), run(others), strict=True):
        assert own.observation_space.contains(found[0])
        assert equal(found[0], expected[0])
        for a, b in zip(found[1:-1], expected[1:-1], strict=True):
            np.testing.assert_array_equal(a, b)
        assert found[-1].keys() == expected[-1].keys()
        for key in ("seed", "episode_number", "is_success", "outcome"):
            if key in found[-1]:
                np.testing.assert_array_equal(found[-1][key], expected[-1][key])
        if "final_obs" in found[-1]:
            pairs = zip(found[-1]["final_obs"], expected[-1]["final_obs"], strict=True)
            assert all(equal(a, b) for a, b in pairs if b is not None)


def test_make_vec() -> None:
    envs = gymnasium.make_vec("sonata2d/Empty-v0", num_envs=2, vectorization_mode="vector_entry_point")
    assert isinstance(envs, s2g.SocialNavVectorEnv)
    assert envs.reset(seed=1)[0]["goal"].shape == (2, 6)


def test_without_autoreset_a_mask_selects_what_is_reset() -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty", settings=SHORT, autoreset_mode=AutoresetMode.DISABLED)
    first, _ = envs.reset(seed=[5, 6])
    still = np.zeros((2, 3), dtype=np.float32)
    for _ in range(60):
        last, _, _, truncated, _ = envs.step(still)
    assert truncated.all()
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"environments \[0, 1\] are over"):
        envs.step(still)
    observation, infos = envs.reset(options={"reset_mask": np.array([True, False])})
    np.testing.assert_array_equal(observation["goal"][1], last["goal"][1])
    assert infos["episode_number"][0] == 1
    assert not np.array_equal(observation["goal"][0], first["goal"][0])
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"environments \[1\] are over"):
        envs.step(still)
    assert [len(state["commands"]) for state in envs.call("get_state")] == [0, 60]  # none was stepped


@pytest.mark.parametrize("processes", [1, 2])
def test_every_episode_of_every_world_is_recorded(processes: int, tmp_path: Path) -> None:
    settings = {"rules": {"time_limit": 1.0}}
    envs = s2g.SocialNavVectorEnv(3, scenario="empty", settings=settings, record=tmp_path, processes=processes)
    envs.reset(seed=5)
    for _ in range(21):
        envs.step(np.zeros((3, 3), dtype=np.float32))
    envs.close()
    records = [s2.read_episode(path) for path in sorted(tmp_path.glob("*.json"))]
    found = sorted((record.seed, record.episode) for record in records)
    assert found == [(seed, episode) for seed in (5, 6, 7) for episode in (0, 1)]
    assert [record.id for record in records] == [f"{k:06}" for k in range(6)]


@pytest.mark.parametrize("processes", [1, 2])
def test_methods_of_all_environments_can_be_called(processes: int) -> None:
    envs = s2g.SocialNavVectorEnv(3, scenario="empty", processes=processes, reward=lambda before, after, outcome: 0.0)
    envs.reset(seed=5)
    envs.step(np.ones((3, 3), dtype=np.float32))
    states = envs.call("get_state")
    assert [(state["seed"], len(state["commands"])) for state in states] == [(5, 1), (6, 1), (7, 1)]
    assert envs.call("render_mode") == envs.get_attr("render_mode") == (None, None, None)
    assert envs.call("twist_of", action=np.zeros(3)) == (s2.Twist(),) * 3
    envs.set_attr("added", lambda: 5)
    assert envs.call("added") == (5, 5, 5)
    envs.set_attr("note", ["a", "b", "c"])
    assert envs.get_attr("note") == ("a", "b", "c")
    envs.set_attr("note", 7)
    assert envs.get_attr("note") == (7, 7, 7)
    with pytest.raises(ValueError, match="3 environments, got 2 values"):
        envs.set_attr("note", [1, 2])
    with pytest.raises(AttributeError, match="nothing"):
        envs.get_attr("nothing")
    envs.close()


@pytest.mark.parametrize("processes", [1, 2])
def test_an_error_of_one_environment_is_raised_and_all_are_reset(processes: int) -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty", processes=processes)
    first, _ = envs.reset(seed=5)
    with pytest.raises(ControllerError, match="finite") as caught:
        envs.step(np.array([[np.nan] * 3, [0.0] * 3], dtype=np.float32))
    assert processes == 1 or "in step" in caught.value.__notes__[0]  # the traceback of the other process
    with pytest.raises(gymnasium.error.ResetNeeded, match="failed or was interrupted"):
        envs.step(STILL)  # the second environment may be a tick ahead
    with pytest.raises(ValueError, match="must reset all environments"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    assert equal(envs.reset(seed=5)[0], first)
    envs.step(STILL)
    envs.close()


class LockedError(Exception):
    """An error that cannot be sent between processes, because it holds a lock."""

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.lock = threading.Lock()


def test_an_error_that_cannot_be_sent_is_raised_as_another() -> None:
    def refuse(before: Any, after: Any, outcome: Any) -> float:
        raise LockedError("locked")

    envs = s2g.SocialNavVectorEnv(2, scenario="empty", processes=2, reward=refuse)
    envs.reset(seed=5)
    with pytest.raises(RuntimeError, match="LockedError: locked"):
        envs.step(STILL)
    envs.close()


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="Windows has no timer signals")
@pytest.mark.parametrize("error", [KeyboardInterrupt, TimeoutError])
def test_after_an_interrupt_all_is_as_new(error: type[BaseException], tmp_path: Path) -> None:
    """Signals arrive at random moments of steps; the recordings of the episodes that they end are kept."""
    envs = s2g.SocialNavVectorEnv(2, scenario="empty", processes=2, record=tmp_path)
    first, _ = envs.reset(seed=5)
    second = envs.step(STILL)[0]

    def interrupt(number: int, frame: Any) -> None:
        raise error

    before, rng = signal.signal(signal.SIGALRM, interrupt), np.random.default_rng(0)
    try:
        for k in range(8):
            signal.setitimer(signal.ITIMER_REAL, rng.uniform(0.001, 0.02))
            with pytest.raises(error):
                step_for_ever(envs)
            assert equal(envs.reset(seed=5)[0], first)
            assert equal(envs.step(STILL)[0], second)
            assert len(list(tmp_path.glob("*.json"))) == 2 * (k + 1)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    envs.close()
    for path in tmp_path.glob("*.json"):
        assert s2.read_episode(path).outcome.status == "stopped"


def step_for_ever(envs: s2g.SocialNavVectorEnv) -> None:
    while True:
        envs.step(STILL)


def test_after_an_interrupted_step_a_reset_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty", processes=2)
    envs.reset(seed=5)

    def interrupt() -> Any:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(envs._worlds[1], "result", interrupt)
        with pytest.raises(KeyboardInterrupt):
            envs.step(STILL)
    with pytest.raises(gymnasium.error.ResetNeeded, match="interrupted"):
        envs.step(STILL)
    envs.reset()
    envs.close()


def test_a_vector_that_is_dropped_ends_its_processes() -> None:
    dropped, other = (s2g.SocialNavVectorEnv(2, scenario="empty", processes=2) for _ in range(2))
    pids = [worlds._process.pid for worlds in dropped._worlds if isinstance(worlds, _Remote)]
    del dropped
    gc.collect()
    assert len(pids) == 2
    assert not any(is_running(pid) for pid in pids if pid is not None)
    other.reset(seed=1)
    other.close()


@pytest.mark.parametrize("processes", [1, 2])
def test_all_environments_return_to_states(processes: int) -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="lively", settings=SHORT, processes=processes, wrappers=[s2g.History])
    envs.reset(seed=5)
    moves = np.random.default_rng(0).uniform(-1.0, 1.0, (60, 2, 3)).astype(np.float32)
    results = [envs.step(move) for move in moves[:20]]
    states = envs.call("get_state")
    results += [envs.step(move) for move in moves[20:]]
    assert results[-1][3].all()
    assert equal(envs.restore(states), results[19][0])
    for move, expected in zip(moves[20:], results[20:], strict=True):
        found = envs.step(move)
        assert equal(found[0], expected[0])
        np.testing.assert_array_equal(found[3], expected[3])
    for name in ("set_state", "reset", "step"):
        with pytest.raises(ValueError, match=f"{name} of single environments would not be noticed"):
            envs.call(name)
    with pytest.raises(ValueError, match="got 1 states"):
        envs.restore(states[:1])
    envs.close()


def test_processes_end_with_their_caller() -> None:
    code = (
        "import os, sonata2d.gym as g\n"
        "envs = [g.SocialNavVectorEnv(2, scenario='empty', processes=2) for _ in range(2)]\n"
        "print(*(worlds._process.pid for one in envs for worlds in one._worlds), flush=True)\n"
        "os.kill(os.getpid(), 9)\n"
    )
    program = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, check=False)
    pids = [int(pid) for pid in program.stdout.split()]
    assert len(pids) == 4
    deadline = time.monotonic() + 60.0
    while any(is_running(pid) for pid in pids):
        assert time.monotonic() < deadline
        time.sleep(0.1)


def is_running(pid: int) -> bool:
    """Whether a process is running; a zombie is not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("processes", [1, 2])
def test_a_recording_that_cannot_be_written_at_the_end_is_reported(processes: int, tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    envs = s2g.SocialNavVectorEnv(2, scenario="empty", processes=processes, record=folder)
    envs.reset(seed=5)
    envs.step(STILL)
    folder.write_text("a file, no folder")
    with pytest.raises(RecordError, match="cannot record in"):
        envs.close()


def test_a_closed_vector_says_so() -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty", processes=2)
    envs.reset(seed=5)
    envs.close()
    envs.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="was closed"):
        envs.step(STILL)


def test_a_result_that_cannot_be_sent_is_reported() -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty", processes=2, reward=lambda before, after, outcome: 0.0)
    envs.reset(seed=5)
    with pytest.raises(TypeError, match="cannot be sent between processes"):
        envs.call("_episode")
    assert envs.call("render_mode") == (None, None)
    envs.close()


def test_a_process_that_dies_is_reported() -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty", processes=2, reward=lambda before, after, outcome: os._exit(7))
    envs.reset(seed=5)
    for _ in range(2):
        with pytest.raises(RuntimeError, match="exit code 7"):
            envs.step(STILL)
        with pytest.raises(RuntimeError, match=r"ended by an error .* call reset"):
            envs.call("get_state")
        envs.reset(seed=5)  # starts it again
    envs.close()


def test_statistics_of_gymnasium_can_be_added() -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty", settings=SHORT, autoreset_mode="SAME_STEP")
    counted = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
    counted.reset(seed=0)
    for _ in range(61):
        *_, infos = counted.step(np.zeros((2, 3), dtype=np.float32))
        if "final_info" in infos:
            break
    assert infos["episode"]["l"].tolist() == [60, 60]


def test_bad_arguments_are_named() -> None:
    for name, wrong in (("num_envs", 0), ("processes", 0), ("processes", 1.5)):
        with pytest.raises(ValueError, match=f"{name} .* got {wrong}"):
            s2g.SocialNavVectorEnv(**{name: wrong})  # type: ignore[arg-type]
    envs = s2g.SocialNavVectorEnv(2, scenario="empty")
    with pytest.raises(ValueError, match=r"the first reset, .* must reset all"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ValueError, match="3 seeds"):
        envs.reset(seed=[1, 2, 3])
    envs.reset(seed=1)
    with pytest.raises(ValueError, match="got 1 actions"):
        envs.step(np.zeros((1, 3)))
    with pytest.raises(ValueError, match="reset_mask"):
        envs.reset(options={"reset_mask": np.array([True])})
