"""Many worlds in one call: the bits of single environments, of several threads, and of files; errors."""

from __future__ import annotations

import multiprocessing
import os
import re
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.scene import Scene
from sonata2d.errors import ControllerError
from sonata2d.gym import SocialNavEnv
from sonata2d.gym.parts import STANDARD
from sonata2d.gym.worlds import STATUSES, Worlds
from sonata2d.scenegen.scenario.load import scenario_of

DOORS = s2.ScenarioConfig(room={"kinds": ["doorway"]}, humans=3, relations=0, drop=True, interior_doors=[{}])
MIXED = ("lively", "waiting-room", DOORS, "intersection", "narrow-doorway", "empty", "blind-corner")


def action(tick: int, world: int, size: int) -> list[float]:
    """A drive in curves that differs from world to world."""
    turn = float(np.sin(0.1 * tick + world))
    return [0.8, turn] if size == 2 else [0.8, 0.2 * turn, turn]


def scenes(count: int) -> list[Scene]:
    """Scenes of different presets, with short episodes."""
    settings = {"rules": {"time_limit": 5}}
    return [s2.generate(scenario_of(MIXED[k % len(MIXED)]).changed(**settings), k) for k in range(count)]


class Alone:
    """One environment for each world, with the same scenes one after the other."""

    def __init__(self, worlds: Worlds, scenes: list[Scene], **settings: Any) -> None:
        sizes = {
            name: len(worlds.reset()[f"{name}_mask"][0]) for name in ("humans", "objects", "walls", "interactions")
        }
        self.scenes, self.number = scenes, 0
        self.envs = [SocialNavEnv("empty", sizes=sizes, **settings) for _ in range(worlds.num_worlds)]
        for env in self.envs:
            self.begin(env)

    def begin(self, env: SocialNavEnv) -> dict[str, Any]:
        env._start(self.scenes[self.number % len(self.scenes)])
        self.number += 1
        return env.encoder.encode(env.snapshot)


@pytest.mark.parametrize("reward", ["distance", "crowdnav", "dsrnn", "socnavgym", "sparse"])
def test_each_world_equals_an_environment_of_its_own(reward: str) -> None:
    made = scenes(6)
    worlds = Worlds([*made, *made[:3]], 4, reward=reward)
    alone = Alone(worlds, [*made, *made[:3]], reward=reward)
    observations = worlds.reset()
    over = [False] * 4
    for tick in range(110):
        actions = [action(tick, w, worlds.action_size) for w in range(4)]
        result = worlds.step(actions)
        assert result.observations is observations
        assert result.is_first.tolist() == over
        for w, env in enumerate(alone.envs):
            if over[w]:
                expected, number, status, contacts = alone.begin(env), 0.0, None, ()
            else:
                expected, number, _, _, info = env.step(np.array(actions[w]))
                status, contacts = info.get("outcome"), env.snapshot.contacts
            assert result.rewards[w] == number
            assert STATUSES[int(result.outcomes[w])] == status
            kinds = {"wall" if contact.kind == "door" else contact.kind for contact in contacts}
            assert result.contacts[w].tolist() == [kind in kinds for kind in ("human", "object", "wall")]
            for name, array in observations.items():
                assert array[w].tobytes() == expected[name].tobytes(), (tick, w, name)
            over[w] = status is not None
    assert alone.number > 6


def test_threads_do_not_change_a_bit() -> None:
    made, results = scenes(12), []
    for threads in (1, 4):
        worlds, rows = Worlds(made, threads=threads), []
        worlds.reset()
        for tick in range(60):
            result = worlds.step([action(tick, w, worlds.action_size) for w in range(12)])
            rows.append(b"".join(array.tobytes() for array in (*result.observations.values(), result.rewards)))
        worlds.close()
        results.append(rows)
    assert results[0] == results[1]


def without_number(path: Path) -> bytes:
    """The content of a file, without the number that it has in its folder."""
    return re.sub(rb'"id":"[^"]*"', b"", path.read_bytes(), count=1)


def test_recorded_episodes_equal_those_that_run_alone(tmp_path: Path) -> None:
    made = scenes(3)
    worlds, env = Worlds(made, record=tmp_path / "together"), SocialNavEnv("empty")
    worlds.reset()
    for tick in range(51):
        worlds.step([action(tick, w, worlds.action_size) for w in range(3)])
    together = sorted(without_number(path) for path in (tmp_path / "together").glob("*.json"))
    alone = []
    for w, scene in enumerate(made):
        path = tmp_path / f"{w}.json"
        episode = s2.Episode(scene, observers=[s2.JsonRecorder(path)])
        for tick in range(51):
            if not episode.is_over:
                episode.apply(env.twist_of(np.array(action(tick, w, worlds.action_size))))
                episode.observe()
        assert episode.is_over
        alone.append(without_number(path))
    assert together == sorted(alone)


def test_a_snapshot_of_a_world_is_that_of_the_episode() -> None:
    scene = s2.generate("lively", 2)
    worlds, episode = Worlds([scene]), s2.Episode(scene)
    worlds.reset()
    for _ in range(30):
        worlds.step(np.zeros((1, worlds.action_size)))
        episode.apply(s2.Twist())
    one, other = worlds.snapshot(0), episode.snapshot()
    assert (one.tick, one.interactions) == (other.tick, other.interactions)
    assert one.state.row.tobytes() == other.state.row.tobytes()


def test_all_parts_are_there() -> None:
    observations = Worlds([s2.generate("empty", 1)]).reset()
    assert {part.name for part in STANDARD} <= set(observations)


def test_scenes_and_arguments_are_checked() -> None:
    scene = s2.generate("empty", 1)
    with pytest.raises(TypeError, match="Worlds needs scenes"):
        Worlds(["empty"])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="at least one scene"):
        Worlds([])
    with pytest.raises(ValueError, match="num_worlds"):
        Worlds([scene], 0)
    with pytest.raises(TypeError, match=r"derived from rewards\.BuiltIn"):
        Worlds([scene], reward=lambda before, after, outcome: 0.0)


@pytest.mark.parametrize(
    ("actions", "error", "message"),
    [
        (np.zeros((1, 5)), ValueError, "of the shape"),
        (np.array([["a", "b", "c"]]), ValueError, "actions are numbers"),
        (np.full((1, 3), np.nan), ControllerError, "for world 0"),
    ],
)
def test_actions_are_checked(actions: Any, error: type[Exception], message: str) -> None:
    worlds = Worlds([s2.generate("empty", 1)])
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"call reset\(\) first"):
        worlds.step(np.zeros((1, 3)))
    worlds.reset()
    with pytest.raises(error, match=message):
        worlds.step(actions)
    worlds.step(np.zeros((1, worlds.action_size)))


def test_a_world_that_begins_again_has_the_bits_of_a_new_one() -> None:
    """Three scenes in turn in three worlds, so that each world is used again for another place in the arrays."""
    made = scenes(4)
    worlds, rows = Worlds(made[:3], 2), []
    for _ in range(2):
        worlds.reset()
        rows.append([])
        for tick in range(170):
            result = worlds.step([action(tick, 0, worlds.action_size)] * 2)
            arrays = (*result.observations.values(), result.rewards, result.outcomes)
            rows[-1].append(b"".join(array.tobytes() for array in arrays))
    assert rows[0] == rows[1]
    fresh = Worlds(made[:3], 2)
    fresh.reset()
    for tick in range(170):
        result = fresh.step([action(tick, 0, fresh.action_size)] * 2)
        arrays = (*result.observations.values(), result.rewards, result.outcomes)
        assert rows[0][tick] == b"".join(array.tobytes() for array in arrays)


def test_all_parts_of_floats_are_one_array_that_shares_their_memory() -> None:
    worlds = Worlds(scenes(4))
    observations = worlds.reset()
    order = sorted(name for name in observations if observations[name].dtype == np.float32)
    for _ in range(3):
        joined = np.concatenate([observations[name].reshape(4, -1) for name in order], axis=1)
        np.testing.assert_array_equal(worlds.flat, joined)
        assert all(np.shares_memory(worlds.flat, observations[name]) for name in order)
        worlds.step(np.ones((4, worlds.action_size)))


def _step_in_a_process(worlds: Worlds) -> None:
    for _ in range(120):
        worlds.step(np.zeros((2, worlds.action_size)))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_forked_process_steps_with_threads_of_its_own() -> None:
    worlds = Worlds(scenes(8), 2, threads=2)
    worlds.reset()
    worlds.step(np.zeros((2, worlds.action_size)))
    process = multiprocessing.get_context("fork").Process(target=_step_in_a_process, args=(worlds,))
    process.start()
    process.join(60)
    is_over = process.exitcode is not None
    process.kill()
    assert is_over
    assert process.exitcode == 0
    worlds.close()
    worlds.step(np.zeros((2, worlds.action_size)))


@pytest.mark.parametrize("given", ["lively", s2.generate("empty", seed=1)])
def test_one_scene_or_name_in_place_of_scenes_is_refused(given: Any) -> None:
    with pytest.raises(TypeError, match="a list of scenes"):
        Worlds(given)
