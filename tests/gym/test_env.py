"""`SocialNavEnv`: Gymnasium's rules, seeds, ends, recording, saved states."""

from __future__ import annotations

import json
import pickle
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import orjson
import pygame
import pytest
from gymnasium.utils.env_checker import check_env

import sonata2d as s2
import sonata2d.gym as s2g
from sonata2d.datasets import verify
from sonata2d.datasets.check.replay import check_replay
from sonata2d.errors import ConfigError, ControllerError, MetricError, RecordError, WindowError
from sonata2d.record.reader import read_episode
from tests.gym.samples import CHAINS, SHORT, actions, equal

FORWARD = np.array([1.0, 0.0, 0.0], dtype=np.float32)


def drive_to_end(env: Any, action: Any = FORWARD) -> tuple[int, bool, bool, dict[str, Any]]:
    """Number of steps, and how the episode ended."""
    for count in range(1, 10_000):
        *_, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return count, terminated, truncated, info
    raise AssertionError("the episode did not end")


@pytest.mark.parametrize("name", s2g.ENVIRONMENT_IDS)
def test_every_id_passes_the_checker(name: str) -> None:
    env = gymnasium.make(name, render_mode="rgb_array", render_size=(64, 64))
    check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("chain", CHAINS)
def test_every_wrapper_passes_the_checker_and_stays_in_its_space(chain: str) -> None:
    env = CHAINS[chain](s2g.SocialNavEnv("lively"))
    with pytest.warns(UserWarning, match="different from the unwrapped version") if chain != "none" else _nothing():
        check_env(env, skip_render_check=True)
    observation, _ = env.reset(seed=4)
    for action in actions(env, 40):
        assert env.observation_space.contains(observation)
        observation, *_ = env.step(action)


class _nothing:
    def __enter__(self) -> None: ...

    def __exit__(self, *args: object) -> None: ...


def test_the_scenes_are_those_of_a_data_set_with_the_seed() -> None:
    env = s2g.SocialNavEnv("lively")
    config = s2.load_scenario("lively")
    for k in range(3):
        _, info = env.reset(seed=11 if k == 0 else None)
        assert env.scene == s2.generate(config, 11, k)
        assert info == {"seed": 11, "episode_number": k}
    assert env.reset(options={"episode": 7})[1] == {"seed": 11, "episode_number": 7}
    assert env.scene == s2.generate(config, 11, 7)


def test_a_seed_is_drawn_where_none_is_given() -> None:
    first, second = (s2g.SocialNavEnv("empty").reset()[1]["seed"] for _ in range(2))
    assert first != second


def test_the_same_seed_and_actions_give_the_same_bits() -> None:
    runs = []
    for _ in range(2):
        env = s2g.SocialNavEnv("crowded-hall")
        runs.append([env.reset(seed=3)[0]] + [env.step(action)[0] for action in actions(env, 50)])
    assert all(equal(a, b) for a, b in zip(*runs, strict=True))


def test_an_episode_terminates_at_the_goal_and_is_truncated_at_the_time_limit() -> None:
    ahead = {"robot": {"pose": [0, 0, 0]}, "goal": {"position": [3, 0]}, "room": {"kinds": "square", "side": 10}}
    env = s2g.SocialNavEnv("empty", settings=ahead, reward="sparse")
    env.reset(seed=0)
    rewards = []
    while not (result := env.step(FORWARD))[2]:
        rewards.append(result[1])
    assert result[1:4] == (1.0, True, False)
    assert not any(rewards)
    assert result[4]["outcome"] == "goal"
    assert result[4]["is_success"] is True
    env = s2g.SocialNavEnv("empty", settings=SHORT)
    env.reset(seed=0)
    assert drive_to_end(env, 0 * FORWARD)[:3] == (60, False, True)


def test_a_contact_terminates_where_the_rules_say_so() -> None:
    wall = {
        "robot": {"pose": [0, 0, 0]}, "goal": {"position": [-3, 0]}, "room": {"kinds": "square", "side": 8},
        "rules": {"ends_on": ["goal", "contact"], "guard": False},
    }  # fmt: skip
    env = s2g.SocialNavEnv("empty", settings=wall, reward="sparse")
    env.reset(seed=0)
    _, terminated, truncated, info = drive_to_end(env)
    assert (terminated, truncated, info["outcome"], info["is_success"]) == (True, False, "contact", False)


def test_steps_without_an_episode_are_refused() -> None:
    env = s2g.SocialNavEnv("empty", settings=SHORT)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(FORWARD)
    env.reset(seed=0)
    drive_to_end(env, 0 * FORWARD)
    with pytest.raises(gymnasium.error.ResetNeeded, match="over"):
        env.step(FORWARD)


def test_bad_arguments_are_named() -> None:
    with pytest.raises(ConfigError, match="livly"):
        s2g.SocialNavEnv("livly")
    with pytest.raises(ConfigError, match="wanderin"):
        s2g.SocialNavEnv("empty", settings={"wanderin": 3})
    with pytest.raises(ValueError, match="spares"):
        s2g.SocialNavEnv("empty", reward="spares")
    with pytest.raises(TypeError, match="reward"):
        s2g.SocialNavEnv("empty", reward=3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="people"):
        s2g.SocialNavEnv("empty", sizes={"people": 3})
    with pytest.raises(ValueError, match="the number of rows of walls must be 1 or more, got 0"):
        s2g.SocialNavEnv("empty", sizes={"walls": 0})
    with pytest.raises(ValueError, match="the number of rows of humans must be 200000 or less, got 1000000000"):
        s2g.SocialNavEnv("empty", sizes={"humans": 10**9})
    assert s2g.SocialNavEnv("empty", sizes={"walls": np.int64(3)}).observation_space["walls"].shape[0] == 3
    with pytest.raises(ValueError, match="order"):
        s2g.SocialNavEnv("empty", order="random")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="render_mode"):
        s2g.SocialNavEnv("empty", render_mode="ascii")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="view"):
        s2g.SocialNavEnv("empty", view="side")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="render_size"):
        s2g.SocialNavEnv("empty", render_size=(0, 5))
    with pytest.raises(ValueError, match="second run"):
        s2g.SocialNavEnv("empty", metrics="human_slowing")
    with pytest.raises(MetricError, match="sucess"):
        s2g.SocialNavEnv("empty", metrics=["sucess"])
    for name, wrong in (("metrics", 5), ("record", 5), ("settings", "wandering=3"), ("sizes", 3), ("scenario", {})):
        with pytest.raises(TypeError, match=name):
            s2g.SocialNavEnv(**{name: wrong})  # type: ignore[arg-type]
    for size in (640, (64, 64, 3), "ab"):
        with pytest.raises(ValueError, match="render_size"):
            s2g.SocialNavEnv("empty", render_size=size)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"robot.kinematics: .* \(got 'legs'\)"):
        s2g.SocialNavEnv("empty", settings={"robot": {"kinematics": "legs"}})
    env = s2g.SocialNavEnv("empty")
    with pytest.raises(ValueError, match="sseed"):
        env.reset(options={"sseed": 1})
    for wrong in (-1, 1.7, "x"):
        with pytest.raises(ValueError, match="option 'episode'"):
            env.reset(options={"episode": wrong})
    with pytest.raises(ValueError, match="2\\^63"):
        env.reset(seed=2**64)
    env.reset(seed=0)
    for wrong in (np.nan, np.inf, -np.inf):
        with pytest.raises(ControllerError, match="finite"):
            env.step(np.array([wrong, 0.0, 0.0]))
    for other in (np.array([1.0 + 1.0j, 0.0, 0.0]), np.array([True, False, False]), ["1", "0", "0"]):
        with pytest.raises(TypeError, match="real numbers"):
            env.step(other)  # type: ignore[arg-type]
    assert env.snapshot.tick == 0
    with pytest.raises(ValueError, match=r"shape \(3,\)"):
        env.step(np.zeros(2))
    with pytest.raises(ValueError, match="got 'forward' of"):
        env.step("forward")  # type: ignore[arg-type]


def test_settings_change_single_values_of_a_section() -> None:
    env = s2g.SocialNavEnv("crowded-hall", settings={"rules": {"time_limit": 7.0}})
    preset = s2.load_scenario("crowded-hall")
    assert env.config.rules == replace(preset.rules, time_limit=7.0)
    assert env.config.person == preset.person


def test_a_unicycle_has_two_actions() -> None:
    env = s2g.SocialNavEnv("empty", settings={"robot": {"kinematics": "unicycle"}})
    assert env.action_space.shape == (2,)
    env.reset(seed=0)
    for _ in range(20):
        env.step(np.array([1.0, 0.5]))
    executed = env.snapshot.robot.executed
    assert executed.vx > 0.9 * env.config.robot.limits.ahead
    assert executed.vy == 0.0
    assert executed.omega == pytest.approx(0.5 * env.config.robot.limits.turn)


def test_actions_and_commands_are_inverse() -> None:
    env = s2g.SocialNavEnv("empty")
    for action in actions(env, 20):
        np.testing.assert_allclose(env.action_of(env.twist_of(action)), action, atol=1e-6)


def test_the_environment_can_be_pickled_and_made_again_from_its_specification() -> None:
    env = s2g.Flat(gymnasium.make("sonata2d/Lively-v0", settings=SHORT))
    assert env.spec is not None
    again = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    for other in (pickle.loads(pickle.dumps(env)), again):
        assert equal(other.reset(seed=5)[0], env.reset(seed=5)[0])
        assert other.observation_space == env.observation_space


def test_metrics_are_those_of_the_recorded_file(tmp_path: Path) -> None:
    from sonata2d.metrics import measure, select_metrics

    names = ["success", "path_length", "human_clearance_min"]
    env = s2g.SocialNavEnv("lively", settings=SHORT, metrics=names, record=tmp_path)
    env.reset(seed=1)
    info = drive_to_end(env)[3]
    record = s2.read_episode(tmp_path / "000000.json")
    assert info["metrics"] == measure(record, select_metrics(names), rerun=False)
    env = s2g.SocialNavEnv("lively", settings=SHORT, metrics=["all"])
    env.reset(seed=1)
    found = drive_to_end(env)[3]["metrics"]
    assert set(names) < set(found)
    assert "human_slowing" not in found  # it needs a second run


def test_recorded_episodes_pass_check_and_replay(tmp_path: Path) -> None:
    env = s2g.SocialNavEnv("lively", settings=SHORT, record=tmp_path)
    rng = np.random.default_rng(0)
    for k in range(3):
        env.reset(seed=2 if k == 0 else None)
        for _ in range(60 if k < 2 else 20):  # the last one is left before its end
            env.step(rng.uniform(-1.2, 1.2, 3))
    env.close()
    files = sorted(tmp_path.glob("*.json"))
    assert [file.name for file in files] == ["000000.json", "000001.json", "000002.json"]
    for file in files:
        assert verify(file) == []
        assert check_replay(read_episode(file)) == []
    last = s2.read_episode(files[-1])
    assert (last.outcome.status, len(last)) == ("stopped", 20)
    s2g.SocialNavEnv("lively", settings=SHORT, record=tmp_path).reset(seed=2)
    assert sorted(tmp_path.glob("*.json")) == files  # an episode without a step leaves no file


def test_a_data_set_is_no_folder_for_recordings(tmp_path: Path) -> None:
    s2.generate_dataset(tmp_path / "set", s2.load_scenario("empty").changed(**SHORT), episodes=1)
    with pytest.raises(RecordError, match=r"set is a data set, .* record in another folder"):
        s2g.SocialNavEnv("empty", record=tmp_path / "set")


def test_a_search_leaves_one_recording(tmp_path: Path) -> None:
    env = s2g.Flat(s2g.SocialNavEnv("lively", settings=SHORT, record=tmp_path))
    env.reset(seed=2)
    for k in range(3):
        env.step(FORWARD)
        state = env.unwrapped.get_state()  # type: ignore[attr-defined]
        env.step(-FORWARD)
        s2g.restore(env, state)
        if k == 1:
            env.unwrapped.set_state(state)  # type: ignore[attr-defined]
    env.close()
    (file,) = tmp_path.glob("*.json")
    assert len(s2.read_episode(file)) == 3
    assert check_replay(read_episode(file)) == []


@pytest.mark.parametrize("chain", CHAINS)
def test_after_a_restore_all_is_as_if_the_state_had_never_been_left(chain: str) -> None:
    env, other = (CHAINS[chain](s2g.SocialNavEnv("lively")) for _ in range(2))
    rng = np.random.default_rng(7)
    other.reset(seed=99)
    for seed in range(3):
        env.reset(seed=seed)
        moves = actions(env, 60, seed)
        at = int(rng.integers(0, 40))
        results = [env.step(move) for move in moves[:at]]
        state = json.loads(json.dumps(env.unwrapped.get_state()))  # type: ignore[attr-defined]
        after = [env.step(move) for move in moves[at:]]
        observation = s2g.restore(other, state)
        assert at == 0 or equal(observation, results[-1][0])
        for move, expected in zip(moves[at:], after, strict=True):
            found = other.step(move)
            assert equal(found[0], expected[0])
            assert found[1:] == expected[1:]
        assert equal(env.reset()[0], other.reset()[0])  # the next episode is the same one


def test_time_limits_and_checks_of_gymnasium_are_restored() -> None:
    env, other = (gymnasium.make("sonata2d/Empty-v0", max_episode_steps=30) for _ in range(2))
    env.reset(seed=1)
    for _ in range(20):
        env.step(0 * FORWARD)
    s2g.restore(other, env.unwrapped.get_state())  # type: ignore[attr-defined]
    truncated = [other.step(0 * FORWARD)[3] for _ in range(10)]
    assert truncated == [False] * 9 + [True]


REPEATS = hasattr(gymnasium.wrappers, "RepeatAction")  # Gymnasium 1.3 and later


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("FrameStackObservation", [4]), ("DelayObservation", [2]), ("TimeAwareObservation", []),
        ("NormalizeObservation", []), ("MaxAndSkipObservation", [2]), ("StickyAction", [0.5]),
        *([("RepeatAction", [2])] if REPEATS else []),
    ],
)  # fmt: skip
def test_wrappers_with_a_memory_of_their_own_are_refused(name: str, arguments: list[Any]) -> None:
    flat = gymnasium.wrappers.TimeLimit(s2g.Flat(s2g.SocialNavEnv("empty")), 50)
    env = getattr(gymnasium.wrappers, name)(flat, *arguments)
    env.reset(seed=0)
    state = env.unwrapped.get_state()
    for refused in (lambda: s2g.restore(env, state), lambda: s2g.PolicyController(len, env)):
        with pytest.raises(TypeError, match=f"{name} cannot be repeated, because it is stateful"):
            refused()


def test_wrappers_of_gymnasium_without_a_memory_are_repeated() -> None:
    def make() -> Any:
        flat = s2g.Flat(s2g.SocialNavEnv("empty"))
        halved = gymnasium.wrappers.TransformObservation(flat, lambda values: values / 2.0, flat.observation_space)
        env = gymnasium.wrappers.NormalizeObservation(halved)
        env.update_running_mean = False
        return gymnasium.wrappers.ClipAction(env)

    env, other = make(), make()
    env.reset(seed=0)
    env.step(FORWARD)
    restored = s2g.restore(other, env.unwrapped.get_state())
    assert equal(other.step(FORWARD)[0], env.step(FORWARD)[0])
    assert restored.shape == env.observation_space.shape


def test_a_state_after_the_end_is_not_recorded_again(tmp_path: Path) -> None:
    env = s2g.SocialNavEnv("empty", settings=SHORT, record=tmp_path, metrics=["success"])
    env.reset(seed=2)
    drive_to_end(env, 0 * FORWARD)
    s2g.restore(env, env.get_state())
    with pytest.raises(gymnasium.error.ResetNeeded, match="over"):
        env.step(FORWARD)
    env.close()
    assert len(list(tmp_path.glob("*.json"))) == 1


def test_a_state_is_plain_data_for_any_json() -> None:
    env = s2g.SocialNavEnv("empty", settings=SHORT)
    env.reset()
    env.step(FORWARD)
    state = orjson.loads(orjson.dumps(env.get_state()))
    assert equal(s2g.restore(s2g.SocialNavEnv("empty", settings=SHORT), state), env.encoder.encode(env.snapshot))


def test_a_recording_that_cannot_be_written_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    env = s2g.SocialNavEnv("empty", settings={"rules": {"time_limit": 0.1}}, record=tmp_path)
    env.reset(seed=2)

    def full(path: Path, document: Any) -> None:
        raise RecordError(f"{path} cannot be written: no space left")

    with monkeypatch.context() as patch:
        patch.setattr("sonata2d.gym.recording.write_document", full)
        with pytest.raises(RecordError, match="no space left"):
            env.step(FORWARD)
    assert not list(tmp_path.iterdir())


def test_long_ticks_can_be_drawn() -> None:
    env = s2g.SocialNavEnv("empty", settings={"rules": {"dt": 2.5}}, render_mode="rgb_array", render_size=(64, 64))
    env.reset(seed=0)
    assert env.render().shape == (64, 64, 3)
    assert env.metadata["render_fps"] == 1


def test_a_time_limit_below_one_tick_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"rules.time_limit: .* at least one tick, dt = 0.1 s"):
        s2g.SocialNavEnv("empty", settings={"rules": {"time_limit": 0.05}})


def test_pictures_after_a_restore_show_the_restored_state() -> None:
    env = s2g.SocialNavEnv("lively", render_mode="rgb_array_list", render_size=(96, 96))
    env.reset(seed=0)
    for _ in range(20):
        env.step(FORWARD)
    pictures = env.render()
    s2g.restore(env, env.get_state())
    (picture,) = env.render()
    np.testing.assert_array_equal(picture, pictures[-1])
    assert not np.array_equal(picture, pictures[0])


def test_a_state_of_another_scenario_or_version_is_refused() -> None:
    env = s2g.SocialNavEnv("empty")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.get_state()
    env.reset(seed=0)
    state = env.get_state()
    with pytest.raises(ValueError, match="another scenario"):
        s2g.SocialNavEnv("lively").set_state(state)
    with pytest.raises(ValueError, match="version 1"):
        env.set_state({**state, "version": 2})
    with pytest.raises(ValueError, match="physics version 2"):
        env.set_state({**state, "physics": 2})
    with pytest.raises(ValueError, match="got 'x'"):
        env.set_state("x")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="seed: Field required"):
        env.set_state({key: value for key, value in state.items() if key != "seed"})
    for key, value in (
        ("seed", "x"),
        ("seed", -1),
        ("commands", [[1.0, 0.0]]),
        ("np_random", {}),
        ("np_random", "[" * 100_000),
        ("surplus", 1),
    ):
        for go_back in (env.set_state, lambda state: s2g.restore(env, state)):
            with pytest.raises(ValueError, match=rf"the state is damaged: {key}.*get_state"):
                go_back({**state, key: value})
    with pytest.raises(ValueError, match="give reset either a state"):
        env.reset(seed=1, options={"state": state})
    env.step(FORWARD)  # the episode goes on


def test_pictures(tmp_path: Path) -> None:
    env = s2g.SocialNavEnv("lively", render_mode="rgb_array", render_size=(120, 90))
    env.reset(seed=0)
    picture = env.render()
    assert (picture.shape, picture.dtype) == ((90, 120, 3), np.uint8)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 10
    env = s2g.SocialNavEnv("lively", render_mode="rgb_array_list", render_size=(64, 64))
    env.reset(seed=0)
    for _ in range(3):
        env.step(FORWARD)
    assert len(env.render()) == 4
    assert env.render() == []
    env.close()


def windowed() -> s2g.SocialNavEnv:
    """An environment with a window, after a step."""
    env = s2g.SocialNavEnv("lively", render_mode="human", render_size=(96, 96), settings={"rules": {"dt": 0.02}})
    env.reset(seed=0)
    env.step(FORWARD)
    return env


def window_of(env: s2g.SocialNavEnv) -> Any:
    """The window of an environment; None: it is closed."""
    return env._renderer._window


def test_the_window_shows_the_scene() -> None:
    env = windowed()
    surface = window_of(env).get_surface()
    assert surface.get_size() == (96, 96)
    assert len(np.unique(pygame.surfarray.array3d(surface).reshape(-1, 3), axis=0)) > 10
    env.close()
    assert not pygame.display.get_init()
    env.close()


def test_each_environment_has_a_window_of_its_own() -> None:
    first, second = windowed(), windowed()
    assert window_of(first) is not window_of(second)
    first.close()
    second.step(FORWARD)
    assert window_of(second).get_surface().get_size() == (96, 96)
    second.close()
    assert not pygame.display.get_init()


def test_a_display_of_the_program_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame.display.init()
    windowed().close()
    assert pygame.display.get_init()
    pygame.display.quit()
    env = windowed()
    pygame.display.set_mode((64, 64))
    env.close()
    assert pygame.display.get_surface() is not None
    pygame.display.quit()


def test_an_environment_whose_window_was_closed_goes_on() -> None:
    env = windowed()
    pygame.event.post(pygame.Event(pygame.WINDOWCLOSE, window=window_of(env)))
    env.step(FORWARD)
    assert window_of(env) is None
    env.step(FORWARD)
    env.reset()
    assert window_of(env) is None
    env.close()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have no variable for the display")
def test_without_a_display_the_error_names_another_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(WindowError, match=r"neither DISPLAY .* use render_mode='rgb_array'"):
        windowed()


def test_stepping_does_not_import_pygame() -> None:
    import subprocess

    code = (
        "import sys, sonata2d.gym as g; e = g.SocialNavEnv('empty'); e.reset(seed=0); e.step([1.0, 0.0, 0.0]); "
        "sys.exit('pygame' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_examples_of_the_documentation_run() -> None:
    import re

    page = (Path(__file__).parents[2] / "docs" / "gym.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(blocks) > 4
    code = "\n".join(blocks).replace("range(1000)", "range(20)")
    exec(compile(code, "docs/gym.md", "exec"), {})
