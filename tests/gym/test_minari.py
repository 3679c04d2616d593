"""`save_minari`: demonstrations as data sets of Minari."""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import sonata2d as s2
import sonata2d.gym as s2g
from tests.gym.samples import SHORT, Env, equal

minari = pytest.importorskip("minari", reason="not installed; pip install 'sonata2d[rl]'")
pytest.importorskip("h5py")


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))


def make() -> Env:
    return gymnasium.make("sonata2d/SocialNav-v0", scenario="lively", settings=SHORT)


@pytest.mark.filterwarnings("ignore::UserWarning:minari")
@pytest.mark.parametrize("is_flat", [False, True])
def test_a_data_set_holds_the_demonstrations_and_makes_their_environment_again(is_flat: bool) -> None:
    env = s2g.Flat(make()) if is_flat else make()
    runs = s2g.demonstrate(env, s2.StraightToGoal(), seed=5, episodes=2)
    s2g.save_minari("sonata2d/lively-v0", runs, env)
    dataset = minari.load_dataset("sonata2d/lively-v0")
    assert len(dataset) == 2
    for run, episode in zip(runs, dataset, strict=True):
        np.testing.assert_array_equal(episode.actions, run.actions)
        np.testing.assert_array_equal(episode.rewards, run.rewards)
        for k in (0, -1):
            parts = episode.observations
            found = {name: part[k] for name, part in parts.items()} if isinstance(parts, dict) else parts[k]
            assert equal(found, run.observations[k])
        assert (episode.terminations[-1], episode.truncations[-1]) == (run.terminated, run.truncated)
    again = dataset.recover_environment()
    assert equal(again.reset(seed=5)[0], runs[0].observations[0])


@pytest.mark.filterwarnings("ignore::UserWarning:minari")
def test_an_environment_with_a_function_as_reward_is_not_stored() -> None:
    env = gymnasium.make("sonata2d/Empty-v0", reward=lambda before, after, outcome: 0.0, settings=SHORT)
    s2g.save_minari("sonata2d/own-v0", s2g.demonstrate(env, s2.StraightToGoal(), seed=1, episodes=1), env)
    assert minari.load_dataset("sonata2d/own-v0").spec.env_spec is None


def test_what_cannot_be_saved_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    env = make()
    with pytest.raises(ValueError, match="no step"):
        s2g.save_minari("sonata2d/none-v0", [], env)
    runs = s2g.demonstrate(s2g.Flat(make()), s2.StraightToGoal(), seed=1, episodes=1)
    with pytest.raises(ValueError, match="other observations than the environment"):
        s2g.save_minari("sonata2d/other-v0", runs, env)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'minari\[hdf5\]'"):
        s2g.save_minari("sonata2d/other-v0", runs, s2g.Flat(make()))
    assert not minari.list_local_datasets()
