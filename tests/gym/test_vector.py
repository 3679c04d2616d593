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
from sonata2d.errors import ControllerError, RecordError, SceneError
from tests.gym.samples import SHORT, equal

STILL = np.zeros((2, 3), dtype=np.float32)
COUNT, STEPS = 3, 80  # episodes of 60 steps end within


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("reward", ["distance", "crowdnav"])
def test_results_equal_those_of_single_environments(mode: AutoresetMode, flat: bool, reward: str) -> None:
    wrap: Any = s2g.Flat if flat else lambda env: env
    envs = s2g.SocialNavVectorEnv(COUNT, "lively", settings=SHORT, flat=flat, reward=reward, autoreset_mode=mode)
    singles = [wrap(s2g.SocialNavEnv("lively", settings=SHORT, reward=reward)) for _ in range(COUNT)]
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
    for state, other in zip(own.get_states(), others.call("get_state"), strict=True):
        assert state | {"np_random": ""} == other | {"np_random": ""}
    own.close()
    others.close()


def test_environments_can_be_pickled_and_copied() -> None:
    envs = s2g.SocialNavVectorEnv(2, flat=True, scenario="lively", settings=SHORT)
    assert equal(pickle.loads(pickle.dumps(envs)).reset(seed=5)[0], envs.reset(seed=5)[0])
    for _ in range(10):
        envs.step(np.ones((2, 3), dtype=np.float32))
    others = [pickle.loads(pickle.dumps(envs)), copy.deepcopy(envs)]
    for _ in range(60):  # the episodes end within
        expected = envs.step(STILL)
        for other in others:
            found = other.step(STILL)
            assert equal(found[0], expected[0])
            np.testing.assert_array_equal(found[3], expected[3])


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
    assert [len(state["commands"]) for state in envs.get_states()] == [0, 60]  # none was stepped


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


def test_episodes_that_are_not_over_are_recorded_as_stopped(tmp_path: Path) -> None:
    envs = s2g.SocialNavVectorEnv(2, "empty", record=tmp_path)
    envs.reset(seed=5)
    envs.step(STILL)
    envs.reset(seed=7, options={"reset_mask": np.array([False, True])})
    envs.step(STILL)
    envs.close()
    records = [s2.read_episode(path) for path in sorted(tmp_path.glob("*.json"))]
    found = [(record.seed, len(record), record.outcome.status, record.outcome.reason) for record in records]
    was_reset, was_closed = "the environment was reset", "the environment was closed"
    assert found == [
        (6, 1, "stopped", was_reset), (5, 2, "stopped", was_closed), (8, 1, "stopped", was_closed),
    ]  # fmt: skip


def test_episodes_of_a_number_come_again() -> None:
    settings = {"rules": {"time_limit": 0.5}}
    envs = s2g.SocialNavVectorEnv(2, "lively", settings=settings, episodes=2)
    _, infos = envs.reset(seed=5)
    numbers, firsts = [infos["episode_number"].tolist()], [envs.reset(seed=5)[0]]
    for _ in range(24):
        observations, *_, infos = envs.step(STILL)
        if "episode_number" in infos:
            numbers.append(infos["episode_number"].tolist())
            firsts.append(observations)
    assert numbers == [[0, 0], [1, 1], [0, 0], [1, 1], [0, 0]]
    assert equal(firsts[2], firsts[0])
    assert equal(firsts[3], firsts[1])
    assert not equal(firsts[1], firsts[0])


def test_the_number_of_an_episode_can_be_chosen() -> None:
    envs, single = s2g.SocialNavVectorEnv(2, "lively"), s2g.SocialNavEnv("lively")
    observations, infos = envs.reset(seed=[4, 9], options={"episode": 7})
    expected, info = single.reset(seed=9, options={"episode": 7})
    assert equal(row_of(observations, 1), expected)
    assert infos["episode_number"].tolist() == [7, 7]
    assert info["episode_number"] == 7
    assert envs.snapshot(1).scene == single.scene


def test_threads_give_the_same_bits() -> None:
    vectors = [s2g.SocialNavVectorEnv(5, "lively", settings=SHORT, threads=threads) for threads in (1, 3)]
    assert equal(*(envs.reset(seed=2)[0] for envs in vectors))
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, (70, 5, 3)).astype(np.float32):
        found, expected = (envs.step(action) for envs in vectors)
        assert equal(found[0], expected[0])
        np.testing.assert_array_equal(found[1], expected[1])


@pytest.mark.parametrize("name", ["wrappers", "parts", "metrics", "render_mode", "view"])
def test_arguments_of_single_environments_name_the_remedy(name: str) -> None:
    with pytest.raises(TypeError, match=rf"has no {name}; .*vectorization_mode='sync'"):
        s2g.SocialNavVectorEnv(2, "empty", **{name: "top"})
    with pytest.raises(TypeError, match="SocialNavEnv takes functions"):
        s2g.SocialNavVectorEnv(2, "empty", reward=lambda before, after, outcome: 0.0)


def test_an_action_that_is_not_finite_moves_nothing() -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty")
    first, _ = envs.reset(seed=5)
    with pytest.raises(ControllerError, match="finite"):
        envs.step(np.array([[np.nan] * 3, [0.0] * 3], dtype=np.float32))
    envs.step(STILL)  # no environment has moved
    assert equal(envs.reset(seed=5)[0], first)
    envs.close()


def test_after_an_interrupted_step_a_reset_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="empty")
    first, _ = envs.reset(seed=5)

    def interrupt(*_: Any) -> Any:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(envs._worlds, "_advance", interrupt)
        with pytest.raises(KeyboardInterrupt):
            envs.step(STILL)
    with pytest.raises(gymnasium.error.ResetNeeded, match="interrupted"):
        envs.step(STILL)
    assert equal(envs.reset(seed=5)[0], first)
    envs.close()


def test_all_environments_return_to_states() -> None:
    envs = s2g.SocialNavVectorEnv(2, scenario="lively", settings=SHORT)
    envs.reset(seed=5)
    moves = np.random.default_rng(0).uniform(-1.0, 1.0, (60, 2, 3)).astype(np.float32)
    results = [envs.step(move) for move in moves[:20]]
    states = envs.get_states()
    results += [envs.step(move) for move in moves[20:]]
    assert results[-1][3].all()
    assert equal(envs.restore(states), results[19][0])
    for move, expected in zip(moves[20:], results[20:], strict=True):
        found = envs.step(move)
        assert equal(found[0], expected[0])
        np.testing.assert_array_equal(found[3], expected[3])
    over = envs.get_states()
    envs.reset(seed=6)
    last = envs.restore(over)  # the next step begins the next episodes
    assert equal(last, results[-1][0])
    assert envs.step(STILL)[1].tolist() == [0.0, 0.0]
    assert [len(state["commands"]) for state in envs.get_states()] == [0, 0]
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
    with pytest.raises(gymnasium.error.ResetNeeded, match="are closed"):
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
    with pytest.raises(ValueError, match="got 3 seeds"):
        envs.reset(seed=[1, 2, 3])
    envs.reset(seed=1)
    with pytest.raises(ValueError, match=r"shape \(2, 3\)"):
        envs.step(np.zeros((1, 3)))
    with pytest.raises(ValueError, match="reset_mask"):
        envs.reset(options={"reset_mask": np.array([True])})


def test_a_reset_that_failed_needs_another_one(monkeypatch: pytest.MonkeyPatch) -> None:
    envs = s2g.SocialNavVectorEnv(2, "lively", settings=SHORT)
    envs.reset(seed=5)

    def fail(key: Any) -> Any:
        raise SceneError("no free spot")

    with monkeypatch.context() as patch:
        patch.setattr(envs._worlds, "_scene_of", fail)
        with pytest.raises(SceneError):
            envs.reset(seed=50)
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step(STILL)
    assert envs.reset(seed=50)[1]["episode_number"].tolist() == [0, 0]


def test_an_interrupted_reset_leaves_each_world_its_own_state(monkeypatch: pytest.MonkeyPatch) -> None:
    envs = s2g.SocialNavVectorEnv(2, "lively", settings={"rules": {"time_limit": 0.5}}, episodes=2)
    envs.reset(seed=5)

    def interrupt(key: Any) -> Any:
        raise KeyboardInterrupt

    for _ in range(5):
        envs.step(STILL)  # up to the end of the episodes
    with monkeypatch.context() as patch:
        patch.setattr(envs._worlds, "_new", interrupt)
        with pytest.raises(KeyboardInterrupt):
            envs.step(STILL)
    envs.reset()
    for _ in range(30):
        envs.step(STILL)
        first, second = envs._worlds._running
        assert first is not second


def test_a_copy_continues_without_recording(tmp_path: Path) -> None:
    envs = s2g.SocialNavVectorEnv(2, "empty", settings=SHORT, record=tmp_path)
    envs.reset(seed=5)
    envs.step(STILL)
    copied = copy.deepcopy(envs)
    copied.step(STILL)
    copied.close()
    assert not list(tmp_path.glob("*.json"))
    envs.close()
    assert len(list(tmp_path.glob("*.json"))) == 2


def test_worlds_of_earlier_seeds_are_not_kept() -> None:
    envs = s2g.SocialNavVectorEnv(2, "empty", settings={"rules": {"time_limit": 0.3}}, episodes=1)
    for seed in (5, 50, 500):
        envs.reset(seed=seed)
        for _ in range(9):
            envs.step(STILL)
        assert {key[0] for key in envs._worlds._idle} <= {seed, seed + 1}
    assert envs._worlds._idle_count == sum(map(len, envs._worlds._idle.values())) > 0


def test_an_action_that_is_ignored_may_hold_anything() -> None:
    envs = s2g.SocialNavVectorEnv(2, "empty", settings={"rules": {"time_limit": 0.1}})
    envs.reset(seed=5)
    assert envs.step(STILL)[3].all()
    assert envs.step(np.full((2, 3), np.nan))[1].tolist() == [0.0, 0.0]
    with pytest.raises(ControllerError, match="finite"):
        envs.step(np.full((2, 3), np.nan))


def test_a_number_beyond_the_episodes_is_refused() -> None:
    envs = s2g.SocialNavVectorEnv(2, "empty", episodes=4)
    with pytest.raises(ValueError, match="is below 4"):
        envs.reset(seed=5, options={"episode": 4})


def test_an_unknown_argument_is_named_with_the_nearest_one() -> None:
    with pytest.raises(TypeError, match=r"no argument 'thread'; did you mean 'threads'"):
        s2g.SocialNavVectorEnv(2, "empty", thread=2)
    with pytest.raises(ValueError, match="must be one of NEXT_STEP, SAME_STEP, DISABLED, got 'never'"):
        s2g.SocialNavVectorEnv(2, "empty", autoreset_mode="never")
    envs = s2g.SocialNavVectorEnv(2, "empty")
    with pytest.raises(TypeError, match="a list of those of get_states"):
        envs.restore(None)  # type: ignore[arg-type]
