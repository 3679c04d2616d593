"""`SocialNavVectorEnv`: the same bits as single environments, autoreset, states."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import sonata2d as s2
import sonata2d.gym as s2g
from sonata2d.errors import ControllerError, RecordError
from tests.gym.samples import CHAINS, SHORT, equal

STILL = np.zeros((2, 3), dtype=np.float32)
COUNT, STEPS = 3, 80  # episodes of 60 steps end within


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("chain", ["none", "history of flat"])
def test_results_equal_those_of_single_environments(mode: AutoresetMode, chain: str) -> None:
    wrap = CHAINS[chain]
    envs = s2g.SocialNavVectorEnv(COUNT, scenario="lively", settings=SHORT, wrappers=[wrap], autoreset_mode=mode)
    singles = [wrap(s2g.SocialNavEnv("lively", settings=SHORT)) for _ in range(COUNT)]
    assert envs.single_observation_space == singles[0].observation_space
    assert envs.metadata["autoreset_mode"] == mode
    expected = [env.reset(seed=4 + k)[0] for k, env in enumerate(singles)]
    is_over = [False] * COUNT
    rng = np.random.default_rng(0)
    observations = envs.reset(seed=4)[0]
    for _ in range(STEPS):
        assert envs.observation_space.contains(observations)
        assert all(equal(row_of(observations, k), expected[k]) for k in range(COUNT))
        actions = rng.uniform(-1.0, 1.0, (COUNT, 3)).astype(np.float32)
        observations, rewards, terminated, truncated, infos = envs.step(actions)
        for k, env in enumerate(singles):
            if is_over[k]:
                expected[k], is_over[k] = env.reset()[0], False
                assert rewards[k] == 0.0
                continue
            expected[k], reward, ends, stops, info = env.step(actions[k])
            assert (rewards[k], terminated[k], truncated[k]) == (reward, ends, stops)
            if (ends or stops) and mode == AutoresetMode.SAME_STEP:
                assert equal(infos["final_obs"][k], expected[k])
                assert infos["final_info"]["outcome"][k] == info["outcome"]
                expected[k] = env.reset()[0]
            elif ends or stops:
                assert infos["outcome"][k] == info["outcome"]
                is_over[k] = True
    envs.close()


def row_of(batch: Any, k: int) -> Any:
    """The observation of one environment of a vector."""
    return {name: part[k] for name, part in batch.items()} if isinstance(batch, dict) else batch[k]


def test_processes_of_gymnasium_give_the_same_bits() -> None:
    arguments: dict[str, Any] = {"settings": SHORT, "num_envs": 2}
    own = gymnasium.make_vec("sonata2d/Lively-v0", vectorization_mode="vector_entry_point", **arguments)
    others = gymnasium.make_vec("sonata2d/Lively-v0", vectorization_mode="async", **arguments)
    assert equal(own.reset(seed=4)[0], others.reset(seed=4)[0])
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2, 3)).astype(np.float32):
        found, expected = own.step(action), others.step(action)
        assert equal(found[0], expected[0])
        np.testing.assert_array_equal(found[1], expected[1])
    assert own.call("get_state") == others.call("get_state")
    own.close()
    others.close()


def test_environments_can_be_pickled_and_copied() -> None:
    envs = s2g.SocialNavVectorEnv(2, wrappers=[s2g.Flat], scenario="lively", settings=SHORT)
    first, _ = envs.reset(seed=5)
    for other in (pickle.loads(pickle.dumps(envs)), copy.deepcopy(envs)):
        assert equal(other.reset(seed=5)[0], first)


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


def test_every_episode_of_every_world_is_recorded(tmp_path: Path) -> None:
    settings = {"rules": {"time_limit": 1.0}}
    envs = s2g.SocialNavVectorEnv(3, scenario="empty", settings=settings, record=tmp_path)
    envs.reset(seed=5)
    for _ in range(21):
        envs.step(np.zeros((3, 3), dtype=np.float32))
    envs.close()
    records = [s2.read_episode(path) for path in sorted(tmp_path.glob("*.json"))]
    found = sorted((record.seed, record.episode) for record in records)
    assert found == [(seed, episode) for seed in (5, 6, 7) for episode in (0, 1)]
    assert [record.id for record in records] == [f"{k:06}" for k in range(6)]


def test_methods_of_all_environments_can_be_called() -> None:
    envs = s2g.SocialNavVectorEnv(3, scenario="empty", reward=lambda before, after, outcome: 0.0)
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
    with pytest.raises(ValueError, match=r"2. values"):
        envs.set_attr("note", [1, 2])
    with pytest.raises(AttributeError, match="nothing"):
        envs.get_attr("nothing")
    envs.close()


def test_an_error_of_one_environment_is_raised_and_all_are_reset() -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty")
    first, _ = envs.reset(seed=5)
    with pytest.raises(ControllerError, match="finite"):
        envs.step(np.array([[np.nan] * 3, [0.0] * 3], dtype=np.float32))
    with pytest.raises(gymnasium.error.ResetNeeded, match="failed or was interrupted"):
        envs.step(STILL)  # the second environment may be a tick ahead
    with pytest.raises(ValueError, match="must reset all environments"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    assert equal(envs.reset(seed=5)[0], first)
    envs.step(STILL)
    envs.close()


def test_after_an_interrupted_step_a_reset_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty")
    first, _ = envs.reset(seed=5)

    def interrupt(action: Any) -> Any:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(envs.envs[1], "step", interrupt)
        with pytest.raises(KeyboardInterrupt):
            envs.step(STILL)
    with pytest.raises(gymnasium.error.ResetNeeded, match="interrupted"):
        envs.step(STILL)
    assert equal(envs.reset(seed=5)[0], first)
    envs.close()


def test_all_environments_return_to_states() -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="lively", settings=SHORT, wrappers=[s2g.History])
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
    over = envs.call("get_state")
    envs.reset(seed=6)
    last = envs.restore(over)  # the next step begins the next episodes
    assert equal(last, results[-1][0])
    assert envs.step(STILL)[1].tolist() == [0.0, 0.0]
    assert [len(state["commands"]) for state in envs.call("get_state")] == [0, 0]
    with pytest.raises(ValueError, match="got 1 states"):
        envs.restore(states[:1])
    envs.close()


def test_a_recording_that_cannot_be_written_at_the_end_is_reported(tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    envs = s2g.SocialNavVectorEnv(2, scenario="empty", record=folder)
    envs.reset(seed=5)
    envs.step(STILL)
    folder.write_text("a file, no folder")
    with pytest.raises(RecordError, match="cannot record in"):
        envs.close()


def test_a_closed_vector_says_so() -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty")
    envs.reset(seed=5)
    envs.close()
    envs.close()
    with pytest.raises(gymnasium.error.ResetNeeded, match="after close"):
        envs.step(STILL)


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
    with pytest.raises(ValueError, match=r"num_envs .* got 0"):
        s2g.SocialNavVectorEnv(0)
    with pytest.raises(TypeError, match=r"num_envs .* got 1\.5"):
        s2g.SocialNavVectorEnv(1.5)  # type: ignore[arg-type]
    envs = s2g.SocialNavVectorEnv(2, scenario="empty")
    with pytest.raises(ValueError, match=r"the first reset, .* must reset all"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ValueError, match="length=3"):
        envs.reset(seed=[1, 2, 3])
    envs.reset(seed=1)
    with pytest.raises(ValueError, match="got 1 actions"):
        envs.step(np.zeros((1, 3)))
    with pytest.raises(ValueError, match="reset_mask"):
        envs.reset(options={"reset_mask": np.array([True])})
