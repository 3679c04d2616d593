"""Random points of random episodes: saved states and recordings, over all presets.

`SONATA2D_TEST_STATES=1000` sets the number of points, and a tenth of it is the number of recorded episodes.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

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
