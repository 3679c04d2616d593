"""Parts of observations: a part of another package beside the built-in ones, in every wrapper and in files."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
import sonata2d.gym as s2g
from sonata2d.core.humans import ACTIVITIES
from sonata2d.errors import ConfigError, ControllerError
from sonata2d.gym.description import describe, environment_of
from sonata2d.gym.mlp import write_mlp
from sonata2d.gym.parts import FARTHEST, OPTIONAL, STANDARD, point
from sonata2d.registry import OBSERVATION_PARTS
from tests.gym.samples import CHAINS, SHORT, Env, equal
from tests.gym.test_policy import perceptron

ROOT = Path(__file__).parents[2]


class Clearance(s2g.DerivedPart):
    """Gap between the outlines of the robot and the nearest pedestrian."""

    name, about = "plugin_gap", frozenset({"robot", "humans"})
    columns = (s2g.Column("gap", "m", FARTHEST, -FARTHEST),)

    def derive(self, tables: Mapping[str, s2g.Table]) -> Sequence[float]:
        humans, radius = tables["humans"], tables["robot"]["radius"]
        across = humans["x"] * humans["sin"] - humans["y"] * humans["cos"]  # along the shoulder line, from the robot
        beyond = np.maximum(np.abs(across) - humans["shoulder"], 0.0)
        ahead = humans["x"] * humans["cos"] + humans["y"] * humans["sin"]
        return [min(np.hypot(ahead, beyond) - humans["radius"] - radius, default=math.inf)]


class Nearest(s2g.DerivedPart):
    """Position of the nearest pedestrian."""

    name, about, columns = "nearest", frozenset({"humans"}), point()

    def derive(self, tables: Mapping[str, s2g.Table]) -> Sequence[float]:
        rows = tables["humans"].rows[:, :2]
        return min(rows.tolist(), key=lambda row: math.hypot(*row), default=[0.0, 0.0])


class Ids(s2g.SnapshotPart):
    """Identifier of each pedestrian."""

    name, about, rows_of = "ids", frozenset({"humans"}), "humans"
    columns = (s2g.Column("id", high=1e6),)

    def begin(self, scene: s2.Scene) -> None:
        self._ids = np.array([human.id for human in scene.humans])

    def fill(self, snapshot: s2.Snapshot, rows: s2g.Rows, out: Any) -> None:
        is_there = rows.humans >= 0
        out[is_there, 0] = self._ids[rows.humans[is_there]]


@pytest.fixture(autouse=True)
def _registered() -> Iterator[None]:
    for part in (Clearance, Nearest, Ids):
        OBSERVATION_PARTS.register(part.name, part)
    yield
    OBSERVATION_PARTS.registered.clear()


def make(scenario: str = "lively", **arguments: Any) -> s2g.SocialNavEnv:
    return s2g.SocialNavEnv(scenario, settings=SHORT, parts=("plugin_gap", "nearest", "ids"), **arguments)


def run(env: Env, seed: int = 2, steps: int = 20) -> Iterator[tuple[Any, s2.Snapshot]]:
    """Observations and snapshots of some steps."""
    base = env.unwrapped
    assert isinstance(base, s2g.SocialNavEnv)
    yield env.reset(seed=seed)[0], base.snapshot
    for _ in range(steps):
        yield env.step(np.array([0.8, 0.0, 0.3]))[0], base.snapshot


def test_a_part_of_another_package_is_observed() -> None:
    env = make()
    for observation, snapshot in run(env):
        assert env.observation_space.contains(observation)
        np.testing.assert_allclose(observation["plugin_gap"], [s2.clearance(snapshot)], atol=1e-5)
        there = observation["humans_mask"] > 0.0
        assert sorted(observation["ids"][there, 0]) == sorted(snapshot.humans.id)
        assert not observation["ids"][~there].any()


@pytest.mark.parametrize("occlusion", [True, False])
def test_a_view_that_hides_everybody_tells_nothing_of_them(occlusion: bool) -> None:
    """Every part has the values that it has in the same room without pedestrians."""
    blind = s2g.FieldOfView(make(), angle=1e-6, distance=1e-6, occlusion=occlusion)
    plain, told = make(), 0
    for (hidden, _), (seen, _) in zip(run(blind), run(plain), strict=True):
        assert not hidden["humans_mask"].any()
        assert seen["humans_mask"].any()
        told += int(seen["plugin_gap"][0] < 3.0)
        for part in blind.unwrapped.encoder.parts:  # type: ignore[attr-defined]
            if "humans" in part.about:
                empty = [FARTHEST] if part.name == "plugin_gap" else np.zeros_like(hidden[part.name])
                np.testing.assert_array_equal(hidden[part.name], empty, err_msg=part.name)
    assert told


def test_a_part_tells_of_the_observed_people_only() -> None:
    for observation, _ in run(s2g.FieldOfView(make("crowded-hall"), angle=1.0)):
        rows = observation["humans"][observation["humans_mask"] > 0.0]
        nearest = min(rows[:, :2].tolist(), key=lambda row: math.hypot(*row), default=[0.0, 0.0])
        np.testing.assert_array_equal(observation["nearest"], np.array(nearest, dtype=np.float32))


def test_a_part_has_all_tables_about_its_entities() -> None:
    class Talking(s2g.DerivedPart):
        """Number of observed pedestrians that talk."""

        name, about, columns = "talking", frozenset({"humans"}), (s2g.Column("count", high=100.0),)

        def derive(self, tables: Mapping[str, s2g.Table]) -> Sequence[float]:
            assert set(tables) == {"humans", "activities"}
            return [float(np.sum(tables["activities"]["activity"] == ACTIVITIES.index("talking")))]

    OBSERVATION_PARTS.register("talking", Talking)
    counts = set()
    env = s2g.SocialNavEnv("lively", settings={"talking_pairs": 2}, parts=["talking"])
    for observation, _ in run(s2g.FieldOfView(env, angle=6.0)):
        talks = observation["activities"][observation["humans_mask"] > 0.0] == ACTIVITIES.index("talking")
        assert observation["talking"] == [talks.sum()]
        counts.add(int(talks.sum()))
    assert max(counts) > 0


def test_a_part_is_derived_from_noisy_rows() -> None:
    for (noisy, _), (exact, _) in zip(run(s2g.Noise(make(), position=0.3)), run(make()), strict=True):
        assert noisy["plugin_gap"] != exact["plugin_gap"]
        distances = np.hypot(noisy["humans"][:, 0], noisy["humans"][:, 1])[noisy["humans_mask"] > 0.0]
        np.testing.assert_allclose(np.hypot(*noisy["nearest"]), distances.min(), rtol=1e-6)
        np.testing.assert_array_equal(noisy["ids"], exact["ids"])


def test_points_of_a_part_are_in_the_frame_of_the_world() -> None:
    for observation, snapshot in run(s2g.WorldFrame(make())):
        away = np.hypot(*(snapshot.humans.position - snapshot.robot.position).T)
        np.testing.assert_allclose(observation["nearest"], snapshot.humans.position[away.argmin()], atol=1e-4)


def test_ranges_replace_the_parts_about_entities() -> None:
    assert set(s2g.Lidar(make()).reset(seed=0)[0]) == {"robot", "goal", "lidar"}
    assert {"plugin_gap", "ids"} <= set(s2g.Lidar(make(), keep=True).reset(seed=0)[0])


@pytest.mark.parametrize("chain", CHAINS)
def test_every_wrapper_takes_a_part_of_another_package(chain: str) -> None:
    env = CHAINS[chain](make())
    env.action_space.seed(0)
    assert env.observation_space.contains(env.reset(seed=1)[0])
    for _ in range(5):
        assert env.observation_space.contains(env.step(env.action_space.sample())[0])
    again = environment_of(json.loads(json.dumps(describe(env))))
    assert again.observation_space == env.observation_space


def test_a_vector_from_a_snapshot_that_tells_of_people_is_refused() -> None:
    with pytest.raises(TypeError, match=r"Count tells of humans from a snapshot, .* derive it from their rows"):

        class Count(s2g.SnapshotPart):
            name, about, columns = "count", frozenset({"humans"}), (s2g.Column("count"),)


def test_bad_parts_are_named() -> None:
    with pytest.raises(ConfigError, match="did you mean 'plugin_gap'"):
        s2g.SocialNavEnv("empty", parts=["plugin_gab"])
    for value, message in (
        (3, "is not a class derived from SnapshotPart or DerivedPart"),
        (s2g.ObservationPart, "is not a class derived from"),
        (type("Nameless", (s2g.DerivedPart,), {"name": "bad"}), "lacks columns, about"),
        (type("Strange", (Nearest,), {"about": frozenset({"people"})}), "is about 'people'; the entities are goal"),
        (Nearest, "has the name 'nearest'"),
    ):
        OBSERVATION_PARTS.register("bad", value)
        with pytest.raises(ConfigError, match=message):
            s2g.SocialNavEnv("empty", parts=["bad"])
    with pytest.raises(ValueError, match="exists already"):
        OBSERVATION_PARTS.register("humans", Clearance)
    for wrong in ([1.0, 2.0], [math.nan], 1.0):
        changed = {"derive": lambda self, tables, wrong=wrong: wrong, "name": "wrong"}
        OBSERVATION_PARTS.register("wrong", type("Wrong", (Clearance,), changed))
        with pytest.raises(ValueError, match="'wrong' must return 1 numbers"):
            s2g.SocialNavEnv("empty", parts="wrong").reset(seed=0)


class Clearance2(Clearance):
    """The gap in centimetres."""

    version = 2
    columns = (s2g.Column("gap", "cm", FARTHEST, -FARTHEST),)


def test_a_policy_of_another_version_of_a_part_is_refused(tmp_path: Path) -> None:
    env, path = s2g.Flat(make()), tmp_path / "policy.npz"
    write_mlp(path, perceptron(env))
    controller = s2g.PolicyController(path)
    assert controller.act is not None
    OBSERVATION_PARTS.register("plugin_gap", Clearance2)
    message = r"'plugin_gap' of version 1 with the columns gap m, here it has version 2 with the columns gap cm; train"
    with pytest.raises(ControllerError, match=message) as caught:
        s2g.PolicyController(path)
    assert "\n" not in str(caught.value)
    with pytest.raises(ControllerError, match=message):
        s2g.PolicyController(path, s2g.Flat(make()))
    del OBSERVATION_PARTS.registered["plugin_gap"]
    with pytest.raises(ControllerError, match="no observation part is named 'plugin_gap'"):
        s2g.PolicyController(path)
    with pytest.raises(ControllerError, match="here it has no version"):
        s2g.PolicyController(path, s2g.Flat(s2g.SocialNavEnv("lively", settings=SHORT)))


def test_a_policy_records_the_parts_that_it_reads() -> None:
    flat = describe(s2g.Flat(make()))["parts"]
    assert set(flat) == {"robot", "goal", "humans", "objects", "walls", "plugin_gap", "nearest", "ids", "activities"}
    assert set(describe(s2g.Flat(make(), keys=["goal", "plugin_gap"]))["parts"]) == {
        "goal", "plugin_gap", "robot", "humans", "activities",
    }  # fmt: skip
    assert set(describe(s2g.Flat(s2g.Lidar(make())))["parts"]) == {"robot", "goal"}
    assert set(describe(s2g.Graph(make()))["parts"]) == {part.name for part in STANDARD}
    assert flat["humans"]["version"] == 1
    assert flat["humans"]["columns"][:3] == ["x m", "y m", "vx m/s"]


@pytest.mark.usefixtures("kept_processes")
def test_a_worker_process_knows_a_registered_part(tmp_path: Path) -> None:
    path, out = tmp_path / "policy.npz", tmp_path / "runs"
    write_mlp(path, perceptron(s2g.Flat(make())))
    s2.generate_dataset(out, s2.load_scenario("lively").changed(**SHORT), str(path), episodes=2, workers=2)
    assert len(list(out.glob("0*.json"))) == 2


def test_observations_with_a_part_return_to_states() -> None:
    env = s2g.History(s2g.FieldOfView(make()))
    observations = [observation for observation, _ in run(env)]
    assert equal(s2g.restore(env, env.unwrapped.get_state()), observations[-1])  # type: ignore[attr-defined]


def test_the_page_lists_the_parts() -> None:
    """The table of docs/gym.md is that of the classes; docs/generate_gym.py writes it."""
    done = subprocess.run([sys.executable, ROOT / "docs/generate_gym.py", "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    page = (ROOT / "docs/gym.md").read_text()
    assert all(f"| `{part.name}` |" in page for part in (*STANDARD, *OPTIONAL))
