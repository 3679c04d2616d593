"""Random points of random episodes: saved states and recordings, over all presets.

`SONATA2D_TEST_STATES=1000` sets the number of points, and a tenth of it is the number of recorded episodes.
"""

from __future__ import annotations

import copy
import json
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import sonata2d.gym as s2g
from sonata2d.datasets import verify
from sonata2d.datasets.check.replay import check_replay
from sonata2d.record.reader import read_episode
from tests.gym.samples import CHAINS, SHORT, equal

COUNT = int(os.environ.get("SONATA2D_TEST_STATES", "32"))
PRESETS = sorted(set(s2g.ENVIRONMENT_IDS.values()))


@pytest.mark.parametrize("preset", PRESETS)
def test_stepping_after_a_restore_equals_never_having_left(preset: str) -> None:
    """The point lies in the first 10 s; the 2 s that follow are compared."""
    rng = np.random.default_rng(PRESETS.index(preset))
    for point in range(-(-COUNT // len(PRESETS))):
        chain = list(CHAINS.values())[int(rng.integers(len(CHAINS)))]
        env, other = (chain(s2g.SocialNavEnv(preset)) for _ in range(2))
        env.action_space.seed(point)
        at = int(rng.integers(0, 100))
        env.reset(seed=int(rng.integers(2**31)), options={"episode": int(rng.integers(1000))})
        for _ in range(at):
            if any(env.step(env.action_space.sample())[2:4]):
                env.reset()
        state = json.dumps(env.unwrapped.get_state())  # type: ignore[attr-defined]
        moves = [env.action_space.sample() for _ in range(20)]
        expected = []
        for move in moves:
            expected.append(env.step(move))
            if any(expected[-1][2:4]):
                break
        s2g.restore(other, json.loads(state))
        for move, result in zip(moves, expected, strict=False):
            found = other.step(move)
            assert equal(found[0], result[0])
            assert found[1:] == result[1:]


def by_pickle(env: Any) -> Any:
    return pickle.loads(pickle.dumps(env))


@pytest.mark.parametrize("duplicate", [copy.deepcopy, by_pickle])
@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
def test_a_copy_goes_on_as_the_original_does(chain: Callable[[Any], Any], duplicate: Callable[[Any], Any]) -> None:
    env = chain(s2g.SocialNavEnv("lively", settings={"rules": {"time_limit": 3.0}}))
    env.action_space.seed(5)
    env.reset(seed=2)
    for _ in range(12):
        env.step(env.action_space.sample())
    other = duplicate(env)
    for _ in range(40):
        action = env.action_space.sample()
        np.testing.assert_array_equal(action, other.action_space.sample())
        result, found = env.step(action), other.step(action)
        assert equal(found[0], result[0])
        assert found[1:] == result[1:]
        if any(result[2:4]):
            break
    assert result[3], "the time limit"
    with pytest.raises(gymnasium.error.ResetNeeded, match="the episode is over"):
        by_pickle(env).step(action)
    (expected, info), (found, found_info) = env.reset(), other.reset()
    assert equal(found, expected)
    assert found_info == info == {"seed": 2, "episode_number": 1}


def test_a_copy_does_not_record_the_present_episode(tmp_path: Path) -> None:
    env = s2g.SocialNavEnv("empty", record=tmp_path)
    env.reset(seed=1)
    env.step(np.ones(3))
    other = copy.deepcopy(env)
    for one in (other, env):
        one.step(np.ones(3))
        one.reset()
    (path,) = tmp_path.glob("*.json*")
    assert len(read_episode(path)) == 2


def test_a_copy_before_the_first_reset_has_the_seed_of_the_original() -> None:
    env = s2g.SocialNavEnv("empty")
    env.reset(seed=4)
    env.close()
    assert copy.deepcopy(env).reset()[1] == {"seed": 4, "episode_number": 1}
    assert copy.deepcopy(s2g.SocialNavEnv("empty")).reset(seed=4)[1] == {"seed": 4, "episode_number": 0}


@pytest.mark.parametrize("preset", PRESETS)
def test_recorded_episodes_pass_check_and_replay(preset: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(PRESETS.index(preset))
    env = s2g.SocialNavEnv(preset, settings=SHORT, record=tmp_path)
    number = -(-COUNT // 10 // len(PRESETS))
    for k in range(number):
        env.reset(seed=3 if k == 0 else None)
        drift = rng.uniform(-1.0, 1.0, env.action_space.shape)  # type: ignore[arg-type]
        while not any(env.step(np.clip(drift + rng.normal(0.0, 0.3, drift.shape), -1.0, 1.0))[2:4]):
            pass
    files = sorted(tmp_path.glob("*.json"))
    assert len(files) == number
    for file in files:
        assert verify(file) == []
        assert check_replay(read_episode(file)) == []
