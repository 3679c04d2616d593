"""Properties of all pedestrian models, and the motion of the published ones."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sonata2d.agents.controllers.reactive import Orca, SocialForce
from sonata2d.agents.pedestrians.models.base import Walkers, pedestrian_model, physics_steps
from sonata2d.core.geometry import Pose
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Rules, Scene
from sonata2d.registry import PEDESTRIAN_MODELS
from sonata2d.sim.episode import Episode

from ..conftest import beside_walls, neighbour_lists, room, walker
from .test_crowd import head_on_scene, positions, simulate

MODELS = list(PEDESTRIAN_MODELS.built_in)
PUBLISHED = ["helbing1995", "helbing2000", "farina2017", "orca2011"]
COUNT = 12
VECTORS = ("position", "velocity", "desired_direction", "body_direction")


def random_walkers(seed: int = 0) -> Walkers:
    """Agents at random positions in a small area, two of them in a group; the last one stands."""
    rng = np.random.default_rng(seed)
    angle, turn = rng.uniform(-3.0, 3.0, (2, COUNT))
    direction = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    direction[-1] = 0.0
    return Walkers(
        position=rng.uniform(-2.0, 2.0, (COUNT, 2)),
        velocity=rng.uniform(-1.0, 1.0, (COUNT, 2)),
        desired_direction=direction,
        body_direction=np.stack((np.cos(turn), np.sin(turn)), axis=1),
        desired_speed=np.array([1.3] * (COUNT - 1) + [0.0]),
        radius=np.array([0.2] * (COUNT - 1) + [0.3]),
        walks=np.arange(COUNT) < COUNT - 1,
        **neighbour_lists(1.0 - np.eye(COUNT)),
        group=np.array([0, 0] + [-1] * (COUNT - 2)),
        is_abreast=np.arange(COUNT) % 2 == 0,
        shoulder=rng.uniform(0.0, 0.1, COUNT),
        headway=rng.uniform(0.7, 1.4, COUNT),
        politeness=rng.uniform(0.7, 1.4, COUNT),
        heed=np.zeros(COUNT),
        steering=np.zeros((COUNT, 2)),
    )


def with_attention(walkers: Walkers, attention: Array) -> Walkers:
    """The walkers with another attention, (M, M), to the same neighbours."""
    return walkers._replace(attention=attention[~np.eye(len(attention), dtype=bool)])


def accelerations(model: str, walkers: Walkers, *, side: int = 1, walls: bool = True) -> Array:
    """The accelerations of the agents that walk, in a square room or without walls."""
    scene = room(rules=Rules(side=side))  # type: ignore[arg-type]
    if not walls:
        scene = Scene(**{**vars(scene), "polygon": (), "walls": ()})
    return evaluated(model, walkers, scene)[walkers.walks]


def evaluated(model: str, walkers: Walkers, scene: Scene) -> Array:
    """The accelerations, (M, 2), at the second evaluation; at the first one, groups of the default model only meet."""
    walkers, one = beside_walls(walkers, scene.barriers), pedestrian_model(model)(scene)
    one.acceleration(walkers)
    return one.acceleration(walkers)


def transformed(walkers: Walkers, matrix: Array) -> Walkers:
    """The walkers after a rotation or reflection."""
    return walkers._replace(**{name: getattr(walkers, name) @ matrix.T for name in VECTORS})


def selected(walkers: Walkers, rows: list[int]) -> Walkers:
    """Some of the agents, without the others."""
    count = len(walkers.position)
    attention = np.zeros((count, count))
    attention[~np.eye(count, dtype=bool)] = walkers.attention
    lists = neighbour_lists(attention[np.ix_(rows, rows)])
    return Walkers(**{name: lists[name] if name in lists else array[rows] for name, array in walkers._asdict().items()})


@pytest.mark.parametrize("model", MODELS)
def test_forces_rotate_with_the_walkers(model: str) -> None:
    walkers, rotation = random_walkers(), np.array([[0.6, -0.8], [0.8, 0.6]])
    found = accelerations(model, transformed(walkers, rotation), walls=False)
    tolerance = 1e-6 if model in ("moussaid2009", "sonata2026") else 1e-5
    assert found == pytest.approx(accelerations(model, walkers, walls=False) @ rotation.T, abs=tolerance)


@pytest.mark.parametrize("model", MODELS)
def test_forces_mirror_with_the_walkers_and_the_side(model: str) -> None:
    walkers = random_walkers()
    for mirror in (np.diag([-1.0, 1.0]), np.diag([1.0, -1.0])):
        mirrored, expected = transformed(walkers, mirror), accelerations(model, walkers) @ mirror
        assert accelerations(model, mirrored, side=-1) == pytest.approx(expected, abs=1e-9)
        assert np.abs(accelerations(model, mirrored, side=1) - expected).max() > 1e-3


@pytest.mark.parametrize("model", MODELS)
def test_walkers_without_attention_for_another_one_are_not_affected_by_it(model: str) -> None:
    walkers = random_walkers()
    attention = np.ones((COUNT, COUNT))
    attention[:, 2] = 0.0
    moved = walkers.position.copy()
    moved[2] = walkers.position[0] + 0.1
    before, after = (
        accelerations(model, with_attention(walkers, attention)._replace(position=position))
        for position in (walkers.position, moved)
    )
    others = [k for k in range(COUNT - 1) if k != 2]
    assert np.array_equal(before[others], after[others])
    assert not np.allclose(before[others], accelerations(model, walkers._replace(position=moved))[others])


@pytest.mark.parametrize("model", MODELS)
def test_attention_is_ego_first(model: str) -> None:
    """Two pedestrians approach each other, and only the first attends to the second."""
    position, direction = np.array([[0.0, 0.0], [1.2, 0.1]]), np.array([[1.0, 0.0], [-1.0, 0.0]])
    pair = selected(random_walkers(), [0, 1])._replace(
        position=position, velocity=direction, desired_direction=direction, group=np.full(2, -1)
    )
    alone = accelerations(model, with_attention(pair, np.zeros((2, 2))))
    attending = accelerations(model, with_attention(pair, np.array([[0.0, 1.0], [0.0, 0.0]])))
    assert not np.allclose(attending[0], alone[0])
    assert np.array_equal(attending[1], alone[1])


@pytest.mark.usefixtures("no_deviations")
@pytest.mark.parametrize("model", MODELS)
def test_agents_that_do_not_walk_are_skipped(model: str) -> None:
    walkers = random_walkers()
    every = accelerations(model, walkers)
    walks = np.arange(COUNT) % 3 == 1
    found = evaluated(model, walkers._replace(walks=walks), room())
    assert np.array_equal(found[walks], every[walks[:-1]])
    assert not found[~walks].any()


@pytest.mark.usefixtures("no_deviations")
@pytest.mark.parametrize("model", MODELS)
def test_a_scene_may_have_one_agent_or_none(model: str) -> None:
    walkers = random_walkers()
    unaware = with_attention(walkers, np.zeros((COUNT, COUNT)))
    alone = accelerations(model, selected(walkers, [4]))
    assert np.array_equal(alone[0], accelerations(model, unaware)[4])
    assert accelerations(model, selected(walkers, [])).shape == (0, 2)


@pytest.mark.parametrize("model", MODELS)
def test_an_agent_to_which_no_other_attends_may_be_left_out(model: str) -> None:
    """So `Crowd` leaves the robot out."""
    walkers = random_walkers()
    attention = np.ones((COUNT, COUNT))
    attention[:, -1] = 0.0
    unseen = with_attention(walkers, attention)
    assert np.array_equal(accelerations(model, unseen), accelerations(model, selected(unseen, list(range(COUNT - 1)))))


@pytest.mark.usefixtures("no_deviations")
@pytest.mark.parametrize("model", MODELS)
def test_one_model_takes_any_number_of_agents(model: str) -> None:
    walkers = random_walkers()
    one = pedestrian_model(model)(room())
    one.acceleration(walkers)
    for count in (COUNT, 5, COUNT):
        some = selected(walkers, list(range(count)))
        some = beside_walls(some, room().barriers)
        assert np.array_equal(one.acceleration(some)[some.walks], accelerations(model, some))


def save_accelerations(file: str) -> None:
    """Write the accelerations of all models for many agents to a file."""
    seeds = range(5)
    np.savez(
        file, **{model: np.array([accelerations(model, random_walkers(seed)) for seed in seeds]) for model in MODELS}
    )


def test_the_interpreter_gives_the_bits_of_compiled_code(tmp_path: Path) -> None:
    save_accelerations(str(tmp_path / "compiled.npz"))
    code = "import sys; from tests.agents.test_models import save_accelerations; save_accelerations(sys.argv[1])"
    command = [sys.executable, "-W", "error", "-c", code, str(tmp_path / "interpreted.npz")]
    subprocess.run(command, cwd=Path(__file__).parents[2], env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, check=True)
    with np.load(tmp_path / "compiled.npz") as compiled, np.load(tmp_path / "interpreted.npz") as interpreted:
        for model in MODELS:
            assert np.array_equal(compiled[model], interpreted[model]), model


@pytest.mark.parametrize("model", MODELS)
def test_forces_are_finite_at_equal_positions_and_in_walls(model: str) -> None:
    walkers = random_walkers()
    position = np.zeros((COUNT, 2))
    position[COUNT // 2 :] = (4.0, 0.0)  # on the line of a wall
    for velocity in (walkers.velocity, np.zeros((COUNT, 2))):
        assert np.isfinite(accelerations(model, walkers._replace(position=position, velocity=velocity))).all()


def test_helbing1995_walls_by_hand() -> None:
    walkers = random_walkers()
    position = walkers.position.copy()
    position[0] = (0.0, -3.5)
    still = {"velocity": np.zeros((COUNT, 2)), "desired_direction": np.zeros((COUNT, 2))}
    walkers = with_attention(walkers, np.zeros((COUNT, COUNT)))._replace(position=position, **still)
    by_hand = 10.0 / 0.2 * (math.exp(-0.5 / 0.2) - math.exp(-7.5 / 0.2))
    assert accelerations("helbing1995", walkers)[0] == pytest.approx((0.0, by_hand), abs=1e-5)


def test_only_farina2017_is_headed() -> None:
    assert [name for name in PEDESTRIAN_MODELS if pedestrian_model(name).headed] == ["farina2017"]


@pytest.mark.parametrize("model", ["helbing2000", "farina2017"])
def test_stiff_models_are_evaluated_in_every_substep(model: str) -> None:
    assert pedestrian_model(model).evaluations == 10
    for substeps, steps in ((5, 10), (10, 10), (20, 20)):
        scene = room([walker(1, 0.0, 0.0, model=model)], rules=Rules(substeps=substeps))
        assert physics_steps(scene) == steps


@pytest.mark.parametrize("model", PUBLISHED)
def test_a_lone_walker_reaches_the_desired_speed(model: str) -> None:
    human = walker(1, -3.0, 0.0, model=model, behaviour="walking", goals=((3.5, 0.0),), desired_speed=1.2)
    last = simulate(room([human], robot=Pose(-3.5, 3.5)), 3.0)[-1]
    assert math.hypot(*last.humans[0].velocity) == pytest.approx(1.2, abs=0.05)


@pytest.mark.usefixtures("no_deviations")
@pytest.mark.parametrize("model", ["sonata2026", *PUBLISHED])
def test_pedestrians_that_meet_head_on_pass_on_the_side_of_the_rules(model: str) -> None:
    paths = {}
    for side in (1, -1):
        # They do not react to the robot, which is not mirrored.
        scene = head_on_scene(side=side, model=model, radius=0.2, reacts_to_robot=0.0)
        path = paths[side] = positions(simulate(scene, 11.0))
        assert path[-1, 0, 0] > 2.5
        assert path[-1, 1, 0] < -2.5
        offset = path[:, 1] - path[:, 0]
        closest = int(np.abs(offset[:, 0]).argmin())
        assert side * offset[closest, 1] > 0.35  # for a walker along +x, right is -y
        assert np.linalg.norm(offset, axis=1).min() > 0.39
    assert paths[-1] == pytest.approx(paths[1] * [1.0, -1.0], abs=1e-6)


@pytest.mark.parametrize("model", PUBLISHED)
def test_the_same_scene_gives_the_same_bits(model: str, busy: Scene) -> None:
    scene = replace(busy, humans=tuple(replace(human, model=model) for human in busy.humans))
    first, again = (np.array([s.humans.state for s in simulate(scene, 4.0)]) for _ in range(2))
    assert np.array_equal(first, again)
    assert np.isfinite(first).all()


def test_headed_pedestrians_walk_where_they_face() -> None:
    human = walker(1, -3.0, -3.0, 2.0, model="farina2017", behaviour="walking", goals=((3.0, -3.0), (3.0, 3.0)))
    snapshots = simulate(room([human], robot=Pose(-3.5, 3.5)), 12.0)
    slip = []
    for human_state in (snapshot.humans[0] for snapshot in snapshots):
        c, s = math.cos(human_state.pose.theta), math.sin(human_state.pose.theta)
        slip.append(abs(human_state.velocity[1] * c - human_state.velocity[0] * s))
    assert np.median(slip) < 0.02
    assert np.mean(np.array(slip) > 0.2) < 0.15  # while turning
    assert np.linalg.norm(snapshots[-1].humans.position[0] - (3.0, 3.0)) < 0.5


def test_orca2011_pedestrians_do_the_whole_evasion_of_a_robot_that_stands() -> None:
    """A pedestrian that did half of it would touch the robot."""
    human = walker(1, -3.0, 0.05, model="orca2011", behaviour="walking", goals=((3.0, 0.05),))
    path = positions(simulate(room([human], robot=Pose(0.0, 0.0)), 5.0))[:, 0]
    assert np.linalg.norm(path, axis=1).min() - 0.5 > -0.002
    assert path[-1, 0] > 1.9


@pytest.mark.parametrize("substeps", [1, 4, 10])
def test_speed_is_limited_however_often_a_model_is_evaluated(substeps: int) -> None:
    """Two pedestrians that overlap at the start, pushed apart by some 60 m/s^2."""
    pair = [walker(k, 0.2 * k, 0.0, model="helbing2000", desired_speed=1.0) for k in (1, 2)]
    snapshots = simulate(room(pair, robot=Pose(3.5, 3.5), rules=Rules(substeps=substeps)), 1.0)
    speed = np.array([np.linalg.norm(snapshot.humans.velocity, axis=1) for snapshot in snapshots])
    assert speed.max() < 1.3 + 0.3  # the engine separates overlapping bodies as well


@pytest.mark.parametrize("model", MODELS)
def test_the_robot_reaches_the_goal_with_every_model(model: str) -> None:
    humans = [walker(1, 0.5, 0.3, behaviour="standing", model=model), walker(2, 3.0, 1.0, math.pi, model=model)]
    assert Episode(room(humans), SocialForce(model=model)).run().status == "goal"
    assert Episode(room(), SocialForce(model=model)).run().status == "goal"


def test_social_force_rejects_unknown_models_and_records_its_own() -> None:
    with pytest.raises(ValueError, match=r"no pedestrian model is named 'orca'; did you mean 'orca2011'"):
        SocialForce(model="orca")
    settings = SocialForce(speed=0.7, model="helbing1995").settings()
    assert SocialForce.from_settings(settings).settings() == settings
    assert Orca.from_settings({}).settings()["model"] == "orca2011"
