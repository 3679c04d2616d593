"""Wrappers: what they change, against values computed another way."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

import sonata2d as s2
import sonata2d.gym as s2g
from sonata2d.agents import Lidar as Sensor
from sonata2d.core.entities import Furniture, Human, Wall
from sonata2d.core.geometry import Disc, Pose, Rectangle
from sonata2d.gym.parts import Humans, Observation
from sonata2d.gym.pipeline import Pipeline
from sonata2d.gym.wrappers import EDGE_TYPES, NODE_FEATURES
from tests.conftest import room

COLUMN = {column.name: k for k, column in enumerate(Humans.columns)}


def after(env: gymnasium.Env[Any, Any], steps: int = 30, seed: int = 1) -> Observation:
    observation, _ = env.reset(seed=seed)
    for _ in range(steps):
        observation, *_ = env.step(np.array([0.8, 0.0, 0.3]))
    return observation


def observed(
    wrap: Callable[[s2g.SocialNavEnv], Any],
    *entities: Human | Furniture,
    inner: tuple[Wall, ...] = (),
    robot: Pose = Pose(0.0, 0.0, 0.0),  # noqa: B008  frozen
    sizes: dict[str, int] | None = None,
) -> Observation:
    """The observation of a robot in a room of 8 m; unless given, in the middle, facing +x."""
    humans = [one for one in entities if isinstance(one, Human)]
    scene = room(humans, [one for one in entities if isinstance(one, Furniture)], robot=robot, inner=inner)
    env = s2g.SocialNavEnv(
        "empty", sizes={"humans": 4, "objects": 3, "walls": 8, "interactions": 4} | (sizes or {}), order="scene"
    )
    observation: Observation = Pipeline(wrap(env)).observe(s2.Episode(scene, s2.StraightToGoal()).snapshot())
    return observation


def test_flat_keeps_the_named_parts_in_their_order() -> None:
    env = s2g.SocialNavEnv("lively")
    parts = after(env)
    flat = after(s2g.Flat(s2g.SocialNavEnv("lively"), keys=("robot", "activities", "humans")))
    expected = np.concatenate((parts["robot"], parts["activities"], parts["humans"].ravel()))
    np.testing.assert_array_equal(flat, expected.astype(np.float32))
    everything = after(s2g.Flat(s2g.SocialNavEnv("lively")))
    assert everything.shape == (sum(part.size for part in parts.values() if part.dtype == np.float32),)
    with pytest.raises(ValueError, match="did you mean 'humans'"):
        s2g.Flat(env, keys=("human",))


def test_world_frame_has_the_coordinates_of_the_snapshot() -> None:
    env = s2g.WorldFrame(s2g.SocialNavEnv("lively", order="scene"))
    observation = after(env)
    base = env.unwrapped
    assert isinstance(base, s2g.SocialNavEnv)
    snapshot = base.snapshot
    count = len(snapshot.humans)
    columns = [COLUMN[name] for name in ("x", "y", "vx", "vy", "cos", "sin", "gaze_cos", "gaze_sin")]
    np.testing.assert_allclose(observation["humans"][:count][:, columns], snapshot.humans.state[:, :8], atol=1e-4)
    assert not observation["humans"][count:].any()
    np.testing.assert_allclose(
        observation["robot"][:4], [*snapshot.robot.position, *snapshot.robot.direction], atol=1e-5
    )
    np.testing.assert_allclose(observation["robot"][4:6], snapshot.robot.velocity, atol=1e-5)
    goal = snapshot.goal
    np.testing.assert_allclose(
        observation["goal"][:4], [goal.x, goal.y, math.cos(goal.theta), math.sin(goal.theta)], atol=1e-4
    )
    walls = [(*wall.start, *wall.end) for wall in snapshot.walls]
    np.testing.assert_allclose(observation["walls"][: len(walls)], walls, atol=1e-4)


def test_noise_has_the_given_deviation_and_depends_on_seed_episode_and_tick_only() -> None:
    plain, env = s2g.SocialNavEnv("crowded-hall"), s2g.Noise(s2g.SocialNavEnv("crowded-hall"), 0.1, 0.2, 0.3)
    differences: dict[str, list[float]] = {"x": [], "vy": [], "turn": []}
    for seed in range(20):
        a, b = plain.reset(seed=seed)[0]["humans"], env.reset(seed=seed)[0]["humans"]
        there = a[:, COLUMN["radius"]] > 0.0
        for name in ("x", "vy"):
            differences[name] += list((b - a)[there, COLUMN[name]])
        c, s = COLUMN["cos"], COLUMN["sin"]
        differences["turn"] += list(np.arcsin(np.clip(a[there, c] * b[there, s] - a[there, s] * b[there, c], -1, 1)))
        np.testing.assert_allclose(np.hypot(b[there, c], b[there, s]), 1.0, atol=1e-5)
        assert not b[~there].any()
    assert len(differences["x"]) > 300
    for name, deviation in (("x", 0.1), ("vy", 0.2), ("turn", 0.3)):
        assert np.std(differences[name]) == pytest.approx(deviation, rel=0.15), name
        assert abs(np.mean(differences[name])) < 0.2 * deviation
    first = env.reset(seed=3)[0]["humans"]
    env.step(np.zeros(3))
    np.testing.assert_array_equal(env.reset(seed=3)[0]["humans"], first)
    with pytest.raises(ValueError, match="angle"):
        s2g.Noise(plain, angle=-1.0)


def test_walls_and_people_hide_what_is_behind_them() -> None:
    behind_wall = Human(1, Pose(3.0, 1.5, 0.0))
    in_sight = Human(2, Pose(2.0, 0.0, math.pi), breadth=0.5)
    behind_person = Human(3, Pose(3.5, 0.0, 0.0), breadth=0.3)
    at_the_back = Human(4, Pose(-1.5, 0.0, 0.0))
    behind_too = Furniture(10, "plant", Pose(3.9, 0.0, 0.0), Disc(0.05))
    beside = Furniture(11, "table", Pose(1.5, -1.0, 0.0), Rectangle(0.5, 0.5))
    entities = (behind_wall, in_sight, behind_person, at_the_back, behind_too, beside)

    def seen(sizes: dict[str, int] | None = None, **options: Any) -> set[int]:
        """The ids of the entities that are seen: 1 to 4 people, 10 and 11 furniture."""
        wall = Wall((2.0, 0.6), (2.0, 2.0))
        view = observed(lambda env: s2g.FieldOfView(env, **options), *entities, inner=(wall,), sizes=sizes)
        masks = np.concatenate((view["humans_mask"], view["objects_mask"]))
        return {id for id, mask in zip((1, 2, 3, 4, 10, 11), masks, strict=False) if mask}

    assert seen(angle=2.0 * math.pi / 3.0) == {2, 11}
    assert seen(angle=2.0 * math.pi / 3.0, occlusion=False) == {1, 2, 3, 10, 11}
    assert seen(angle=2.0 * math.pi) == {2, 4, 11}
    assert seen(angle=2.0 * math.pi, distance=1.9) == {4, 11}
    assert seen({"walls": 1}, angle=2.0 * math.pi) == {2, 4, 11}, "walls without rows hide, too"


def test_people_without_a_row_hide_what_is_behind_them() -> None:
    plant, person = Furniture(10, "plant", Pose(3.0, 0.0, 0.0), Disc(0.2)), Human(1, Pose(2.0, 0.0, math.pi))
    beside = Human(2, Pose(0.0, 1.0, 0.0))  # the nearest pedestrian, which has the only row
    for entities, mask in (((plant, beside), 1.0), ((plant, beside, person), 0.0)):
        assert observed(s2g.FieldOfView, *entities, sizes={"humans": 1})["objects_mask"].tolist() == [mask, 0.0, 0.0]


def test_a_narrow_view_shows_fewer_entities_and_their_interactions() -> None:
    plain, env = after(s2g.SocialNavEnv("lively")), after(s2g.FieldOfView(s2g.SocialNavEnv("lively"), angle=1.0))
    assert (
        0
        < env["humans_mask"].sum() + env["objects_mask"].sum()
        < plain["humans_mask"].sum() + plain["objects_mask"].sum()
    )
    for name in ("humans", "objects"):
        shown = env[f"{name}_mask"] > 0.0
        np.testing.assert_array_equal(env[name][shown], plain[name][shown])
        assert not env[name][~shown].any()
    seen = np.concatenate((env["humans_mask"], env["objects_mask"])) > 0.0
    for k in range(len(plain["interactions"])):
        is_shown = plain["interactions_mask"][k] > 0.0 and seen[plain["interactions"][k, [0, 2]]].all()
        assert (env["interactions_mask"][k] > 0.0) == is_shown


def test_lidar_measures_outlines() -> None:
    ahead = Human(1, Pose(2.0, 0.0, 0.0), radius=0.15, breadth=0.5)
    table = Furniture(10, "table", Pose(0.0, 2.0, math.pi / 2), Rectangle(1.0, 0.5))
    plant = Furniture(11, "plant", Pose(-1.0, 0.0, 0.0), Disc(0.25))
    ranges = observed(lambda env: s2g.Lidar(env, rays=8), ahead, table, plant)["lidar"]
    diagonal = 4.0 * math.sqrt(2.0)
    np.testing.assert_allclose(ranges, [1.85, diagonal, 1.5, diagonal, 0.75, diagonal, 4.0, diagonal], atol=1e-6)
    cut = observed(lambda env: s2g.Lidar(env, rays=8, distance=3), ahead, table, plant)["lidar"]
    np.testing.assert_allclose(cut, np.minimum(ranges, 3.0))
    turned = observed(lambda env: s2g.Lidar(env, rays=4), ahead, table, plant, robot=Pose(0.0, 0.0, math.pi / 2))
    np.testing.assert_allclose(turned["lidar"], [1.5, 0.75, 4.0, 1.85], atol=1e-6)


def test_lidar_sees_entities_without_rows_and_neither_noise_nor_a_field_of_view_changes_it() -> None:
    people = Human(1, Pose(2.0, 0.0, 0.0), radius=0.15), Human(2, Pose(0.0, -1.0, 0.0))
    plants = (Furniture(10 + k, "plant", Pose(-1.0 - k, 1.5 * k, 0.0), Disc(0.25)) for k in range(2))
    entities = (*people, *plants)
    full = observed(lambda env: s2g.Lidar(env, rays=16), *entities)["lidar"]
    few = {"humans": 1, "objects": 1, "walls": 1}
    np.testing.assert_array_equal(observed(lambda env: s2g.Lidar(env, rays=16), *entities, sizes=few)["lidar"], full)
    wraps: list[Callable[[Any], Any]] = [lambda env: s2g.Noise(env, 0.5), lambda env: s2g.FieldOfView(env, 0.1)]
    for wrap in wraps:
        inside = observed(lambda env, wrap=wrap: s2g.Lidar(wrap(env), rays=16), *entities)["lidar"]  # type: ignore[misc]
        np.testing.assert_array_equal(inside, full)


def test_a_policy_with_lidar_sees_the_world_of_any_scenario() -> None:
    """An environment with rows for one room measures another, larger and fuller room completely."""
    scene = s2.generate(s2.load_scenario("crowded-hall"), seed=3)
    snapshot = s2.Episode(scene, s2.StraightToGoal()).snapshot()
    found, expected = (
        Pipeline(s2g.Lidar(s2g.SocialNavEnv(name), rays=360, distance=30)).observe(snapshot)["lidar"]
        for name in ("empty", "crowded-hall")
    )
    np.testing.assert_array_equal(found, expected)
    assert found.min() < 2.0 < found.max()


@pytest.mark.parametrize("angle", [2.0 * math.pi, math.pi])
def test_lidar_gives_the_readings_of_the_sensor_of_a_controller(angle: float) -> None:
    settings: dict[str, Any] = {"mount": (0.2, 0.1), "noise": 0.03, "dropout": 0.1, "sees": "legs"}
    middle = 0.4 + (math.pi if angle > 4.0 else 0.0)  # the wrapper counts rays all around from ahead, not from behind
    read = []

    class Watcher(s2.Controller):
        sensors = (Sensor(rays=36, angle=angle, distance=5.0, nearest=0.0, heading=middle, **settings),)

        def act(self, snapshot: s2.Snapshot) -> s2.Twist:
            read.append((snapshot, snapshot.sensors.lidar))
            return s2.Twist(0.2)

    episode = s2.Episode(s2.generate("sonata-2020", 3), Watcher())
    env = s2g.Lidar(s2g.SocialNavEnv("sonata-2020"), rays=36, distance=5.0, angle=angle, heading=0.4, **settings)
    for _ in range(3):
        episode.step()
        snapshot, reading = read[-1]
        expected = np.where(reading.ranges < 5.0, reading.ranges, 5.0).astype(np.float32)
        np.testing.assert_array_equal(Pipeline(env).observe(snapshot)["lidar"], expected)
        assert 5 < (expected < 5.0).sum() < 36


def test_lidar_agrees_with_the_gaps_of_the_library() -> None:
    """The smallest of many ranges is the distance to the nearest outline."""
    for seed in range(5):
        env = s2g.Lidar(s2g.SocialNavEnv("lively"), rays=2000, distance=20.0)
        observation = after(env, 10, seed)
        base = env.unwrapped
        assert isinstance(base, s2g.SocialNavEnv)
        snapshot = base.snapshot
        from sonata2d.core.proxemics import obstacle_clearance

        gap = min(s2.clearance(snapshot), obstacle_clearance(snapshot)) + snapshot.robot.radius
        assert observation["lidar"].min() == pytest.approx(gap, abs=5e-3)
        assert set(observation) == {"robot", "goal", "lidar"}


def test_the_graph_holds_the_rows_of_the_observation() -> None:
    parts, graph = (after(wrap(s2g.SocialNavEnv("lively")), seed=2) for wrap in (lambda env: env, s2g.Graph))
    at = {name: k for k, name in enumerate(NODE_FEATURES)}
    count = len(parts["humans"])
    nodes, people = graph["nodes"], parts["humans_mask"] > 0.0
    np.testing.assert_array_equal(nodes[2 : 2 + count, at["is_human"]], parts["humans_mask"])
    np.testing.assert_array_equal(nodes[2 : 2 + count, at["x"]], parts["humans"][:, 0])
    np.testing.assert_array_equal(nodes[1, [at["x"], at["y"]]], parts["goal"][:2])
    activity = nodes[2 : 2 + count, at["standing"] : at["standing"] + 8]
    np.testing.assert_array_equal(activity[people].argmax(axis=1), parts["activities"][people])
    assert not activity[~people].any()
    walls = nodes[2 + count + len(parts["objects"]) :]
    ends = parts["walls"]
    np.testing.assert_allclose(walls[:, at["length"]], np.hypot(*(ends[:, 2:] - ends[:, :2]).T), atol=1e-5)
    edges = graph["edges"][graph["edges_mask"] > 0.0]
    kinds = graph["edge_types"][graph["edges_mask"] > 0.0]
    there = np.flatnonzero(graph["nodes_mask"])
    to_robot = {(int(a), int(b)) for (a, b), kind in zip(edges, kinds, strict=True) if EDGE_TYPES[kind] == "robot"}
    assert to_robot == {(k, 0) for k in there if k} | {(0, k) for k in there if k}
    links = parts["interactions"][parts["interactions_mask"] > 0.0]
    related = [(int(a), int(b), int(kind)) for (a, b), kind in zip(edges, kinds, strict=True) if kind > 0]
    expected = [(int(a) + 2, int(b) + 2, int(kind) + 1) for a, kind, b in links]
    assert sorted(related) == sorted(expected + [(b, a, kind) for a, b, kind in expected])
    assert related


def test_history_holds_the_last_observations() -> None:
    plain, env = s2g.SocialNavEnv("lively"), s2g.History(s2g.SocialNavEnv("lively"), length=3)
    past = [plain.reset(seed=1)[0]["humans"]] * 3
    found = env.reset(seed=1)[0]["humans"]
    np.testing.assert_array_equal(found, np.stack(past))
    for _ in range(5):
        action = np.array([0.5, 0.1, 0.2])
        past.append(plain.step(action)[0]["humans"])
        found = env.step(action)[0]["humans"]
        np.testing.assert_array_equal(found, np.stack(past[-3:]))
    np.testing.assert_array_equal(env.reset(seed=1)[0]["humans"], np.stack(past[:3]))


def test_discrete_actions_are_moves() -> None:
    env = s2g.DiscreteActions(s2g.SocialNavEnv("empty"), moves=[(0.5, 0.0, 0.0), (0.0, -1.0, 0.0)])
    assert env.action_space == gymnasium.spaces.Discrete(2)
    env.reset(seed=0)
    base = env.unwrapped
    assert isinstance(base, s2g.SocialNavEnv)
    env.step(0)
    assert base.snapshot.robot.executed.vx > 0.0
    for _ in range(20):
        env.step(1)
    assert base.snapshot.robot.executed.vy == pytest.approx(-base.config.robot.limits.sideways)
    with pytest.raises(ValueError, match="three fractions"):
        s2g.DiscreteActions(s2g.SocialNavEnv("empty"), moves=[(2.0, 0.0, 0.0)])
    with pytest.raises(TypeError, match=r"needs the actions of SocialNavEnv, got Discrete\(8\)"):
        s2g.DiscreteActions(s2g.DiscreteActions(s2g.SocialNavEnv("empty")))
    with pytest.raises(ValueError, match=r"index of the 8 moves, got 1.5"):
        s2g.DiscreteActions(s2g.SocialNavEnv("empty")).action(1.5)


def test_the_world_frame_has_no_end_at_the_range_of_the_robot() -> None:
    long = {"room": {"polygon": [[0, 0], [500, 0], [500, 6], [0, 6]]}, "robot": {"pose": [450, 3, 0]},
            "goal": {"position": [480, 3]}}  # fmt: skip
    env = s2g.WorldFrame(s2g.SocialNavEnv("empty", settings=long))
    observation, _ = env.reset(seed=0)
    np.testing.assert_allclose(observation["robot"][:2], [450.0, 3.0])
    np.testing.assert_allclose(observation["goal"][:2], [480.0, 3.0], atol=1e-4)
    assert observation["walls"].max() == pytest.approx(500.0, abs=1e-3)
    assert env.observation_space.contains(observation)


def test_orders_that_would_give_wrong_values_are_refused() -> None:
    env = s2g.SocialNavEnv("empty")
    for inner in (s2g.WorldFrame, s2g.History):
        for outer in (s2g.Noise, s2g.FieldOfView, s2g.Lidar, s2g.Graph, s2g.WorldFrame):
            with pytest.raises(TypeError, match=f"put {outer.__name__} inside WorldFrame and History"):
                outer(inner(env))
    for inner in (s2g.Lidar, s2g.Graph):
        with pytest.raises(TypeError, match=r"got .*Box.* put FieldOfView inside it"):
            s2g.FieldOfView(inner(env))
    assert s2g.WorldFrame(s2g.FieldOfView(s2g.Lidar(env, keep=True))).reset(seed=0)[0]["lidar"].shape == (72,)


def test_the_error_of_an_order_names_one_that_works() -> None:
    env = s2g.SocialNavEnv("empty")
    with pytest.raises(TypeError, match=r"use Lidar\(keep=True\)"):
        s2g.WorldFrame(s2g.Lidar(env))
    with pytest.raises(ValueError, match="one or more parts"):
        s2g.Flat(env, keys=[])
    assert s2g.Flat(env, keys=(name for name in ("goal", "robot"))).reset(seed=0)[0].shape == (11,)
    assert s2g.History(s2g.Lidar(env, rays=np.int64(8)), length=np.int64(2)).reset(seed=0)[0]["lidar"].shape == (2, 8)  # type: ignore[arg-type]


def test_observations_of_any_size_are_refused() -> None:
    """A file of a policy names wrappers and their numbers."""
    env = s2g.SocialNavEnv("empty")
    with pytest.raises(ValueError, match="rays must be 200000 or less, got 100000000"):
        s2g.Lidar(env, rays=10**8)
    with pytest.raises(ValueError, match=r"100000000 observations hold .* numbers; the limit is 20000000"):
        s2g.History(env, length=10**8)
    with pytest.raises(ValueError, match=r"2000 observations hold .* numbers; the limit is 20000000"):
        s2g.History(s2g.History(s2g.Flat(env), length=2000), length=2000)
    with pytest.raises(TypeError, match=r"length must be a whole number, got 2\.5"):
        s2g.History(env, length=2.5)  # type: ignore[arg-type]


def test_two_noises_differ() -> None:
    plain, twice = (wrap(s2g.SocialNavEnv("crowded-hall")) for wrap in (lambda env: env, two_noises))
    differences = np.concatenate(
        [(twice.reset(seed=k)[0]["humans"] - plain.reset(seed=k)[0]["humans"])[:10, 0] for k in range(40)]
    )
    assert np.std(differences) == pytest.approx(0.1 * math.sqrt(2.0), rel=0.12)


def two_noises(env: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any]:
    return s2g.Noise(s2g.Noise(env, 0.1, 0.0, 0.0), 0.1, 0.0, 0.0)


def test_wrappers_of_the_dictionary_come_before_flat() -> None:
    flat = s2g.Flat(s2g.SocialNavEnv("empty"))
    for wrapper in (s2g.WorldFrame, s2g.Noise, s2g.FieldOfView, s2g.Lidar, s2g.Graph):
        with pytest.raises(TypeError, match=rf"Box\(62,\) .* put {wrapper.__name__} inside it"):
            wrapper(flat)
    with pytest.raises(TypeError, match="dictionary"):
        s2g.Flat(flat)
