"""What `graph-policy` reads while it drives is what a recording of it tells, and it drives in every scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.controllers.labelled import Labelled
from sonata2d.core.entities import Human, Limits, Robot
from sonata2d.core.geometry import Pose, Twist
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.errors import ControllerError
from sonata2d.learning.graph.graph import Graph
from sonata2d.learning.graph.modern import modern_graph
from sonata2d.learning.graph.paper import kept_ticks, paper_graphs
from sonata2d.learning.inputs import INPUTS, inputs_of
from sonata2d.learning.policy import GraphPolicy
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.scenegen.scenario.load import load_scenario, scenario_names
from sonata2d.testing.controllers import check_controller, default_scenes

from ..conftest import room, walker
from .samples import weights_file

PRECISION = 6e-4  # of what is told from numbers at a file's precision


class Watching(GraphPolicy):
    """Keeps what it read at each tick."""

    def reset(self, scene: Scene) -> None:
        super().reset(scene)
        self.seen: list[Graph] = []

    def act(self, snapshot: Snapshot) -> Twist:
        answer = super().act(snapshot)
        self.seen.append(self.graph(snapshot.scene))
        return answer


def watched(tmp_path: Path, scene: Scene, weights: Path | None, ticks: int = 45) -> tuple[list[Graph], EpisodeRecord]:
    """The graphs of an episode that the expert drives, as they were while it ran, and its record."""
    policy, path = Watching(weights), tmp_path / "seen.json"
    with s2.JsonRecorder(path) as recorder:
        scene = replace(scene, rules=replace(scene.rules, time_limit=ticks * scene.rules.dt), settings=None)
        s2.Episode(scene, Labelled(s2.SocialPlanner(), policy), observers=[recorder]).run()
    return policy.seen, read_episode(path)


def same(live: Graph, told: Graph) -> None:
    assert live.ticks == told.ticks
    for name in ("node_type", "entity", "instant", "edges", "relation"):
        assert np.array_equal(getattr(live, name), getattr(told, name)), name
    assert np.abs(live.features - told.features).max() < PRECISION
    assert np.abs(live.position - told.position).max() < PRECISION


@pytest.fixture(scope="module")
def paper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return weights_file(tmp_path_factory.mktemp("weights") / "paper.npz")


def lively(seed: int) -> Scene:
    """People, things and relations, some of which begin and end in the run."""
    return s2.generate(load_scenario("lively"), seed)


def test_a_live_graph_of_today_is_the_recorded_one(tmp_path: Path) -> None:
    for seed in range(3):
        seen, record = watched(tmp_path, lively(seed), None)
        assert len(seen) == len(record)
        for tick, live in enumerate(seen):
            same(live, modern_graph(record, tick, instants=1))


def test_a_live_graph_of_the_papers_is_the_recorded_one(tmp_path: Path, paper: Path) -> None:
    seen, record = watched(tmp_path, lively(3), paper)
    graphs = paper_graphs(record)
    assert [len(graph.ticks) for graph in graphs] == [1, 2, 3, 3]
    for graph in graphs:
        same(seen[graph.ticks[0]], graph)


@pytest.mark.parametrize("dt", [0.05, 0.15, 0.2, 0.3])
def test_live_and_recorded_instants_are_as_far_apart_at_any_tick(tmp_path: Path, paper: Path, dt: float) -> None:
    scene = s2.generate(s2.ScenarioConfig(rules={"dt": dt}), seed=4)
    seen, record = watched(tmp_path, scene, paper, ticks=round(4.0 / dt))
    graphs = paper_graphs(record)
    assert [graph.ticks[0] for graph in graphs] == kept_ticks(record.time)[1:]
    for graph in graphs:
        same(seen[graph.ticks[0]], graph)


def test_whoever_comes_or_goes_is_read_while_they_are_there(tmp_path: Path, paper: Path) -> None:
    scene = default_scenes(60.0)[1]
    for weights in (None, paper):
        seen, record = watched(tmp_path, scene, weights, ticks=75)
        told = (
            paper_graphs(record) if weights else [modern_graph(record, tick, instants=1) for tick in range(len(record))]
        )
        for graph in told:
            same(seen[graph.ticks[0]], graph)
        assert len({int((graph.node_type == 0).sum()) // len(graph.ticks) for graph in seen}) > 1


def test_before_the_first_second_is_over_the_newest_look_counts_as_a_second_old(tmp_path: Path, paper: Path) -> None:
    seen, _ = watched(tmp_path, lively(3), paper, ticks=22)
    time_left, is_first = (seen[0].feature_names.index(name) for name in ("time_left", "is_first_frame"))
    for tick in (0, 5, 10):
        assert seen[tick].features[:, time_left] == pytest.approx(1 / 11)
    assert [len(graph.ticks) for graph in seen] == [1] * 20 + [2, 2]
    assert all(graph.features[-1, is_first] == 1.0 for graph in seen)


def test_one_that_is_first_asked_later_has_seen_nothing_before(paper: Path) -> None:
    episode = s2.Episode(room([walker(1, 0.0, 2.0)]), s2.StraightToGoal())
    for _ in range(30):
        episode.step()
    for weights in (None, paper):
        policy = Watching(weights)
        branch = episode.branch(30, policy)
        for _ in range(21):
            branch.step()
        first, last = policy.seen[0], policy.seen[-1]
        assert first.ticks == (30,)
        assert last.ticks == ((50, 40, 30) if weights else (50,))
        if weights:
            assert not first.features[:, first.feature_names.index("human_x_vel")].any()
        again = episode.branch(30, GraphPolicy(weights))
        for _ in range(21):
            again.step()
        assert again.past == branch.past


@pytest.mark.parametrize("name", sorted(scenario_names()))
def test_it_drives_in_every_stock_scenario(name: str, paper: Path) -> None:
    scene = s2.generate(load_scenario(name), seed=2)
    for weights in (None, paper):
        episode = s2.Episode(scene, GraphPolicy(weights))
        for _ in range(12):
            episode.step()
        commands = np.array([[m.command.vx, m.command.vy, m.command.omega] for m in episode.past])
        limits = scene.robot.limits
        assert (np.abs(commands) <= [limits.ahead + 1e-4, limits.sideways + 1e-4, limits.turn + 1e-4]).all()


def test_it_passes_what_every_controller_must(paper: Path) -> None:
    for weights in (None, paper):
        check_controller(GraphPolicy(weights), time_limit=3.0)


@pytest.mark.parametrize("people", [0, 1])
def test_an_empty_room_is_read_too(tmp_path: Path, paper: Path, people: int) -> None:
    scene = room([walker(1, 0.0, 1.0)][:people])
    for weights in (None, paper):
        seen, _ = watched(tmp_path, scene, weights, ticks=22)
        assert {int((graph.node_type == 0).sum()) // len(graph.ticks) for graph in seen} == {people}


def test_recorded_people_are_read_too(tmp_path: Path, paper: Path) -> None:
    track = tuple((0.1 * k - 2.0, 0.5) for k in range(15))
    person = Human(7, Pose(-2.0, 0.5), behaviour="recorded", track=track, enters=5, leaves=20)
    for weights in (None, paper):
        seen, record = watched(tmp_path, room([person]), weights, ticks=30)
        there = record.looks.present[:-1, 0].tolist()
        assert there == [5 <= tick < 20 for tick in range(30)]
        for tick, graph in enumerate(seen):
            looked_at = [tick, *graph.ticks[1:]]
            if weights:  # velocities are told from the tick before
                looked_at += [max(at - 1, 0) for at in looked_at]
            assert (graph.node_type == 0).any() == all(there[at] for at in looked_at), tick


def test_a_unicycle_is_asked_for_nothing_sideways(paper: Path) -> None:
    for kinematics in ("holonomic", "unicycle"):
        scene = replace(lively(3), robot=replace(lively(3).robot, kinematics=kinematics))
        for weights in (None, paper):
            episode = s2.Episode(scene, GraphPolicy(weights))
            for _ in range(5):
                episode.step()
            assert any(moment.command.vy for moment in episode.past) is (kinematics == "holonomic")


def test_answers_are_shares_of_the_robots_limits(paper: Path) -> None:
    scene = lively(3)
    faster = replace(scene, robot=replace(scene.robot, limits=Limits(2.0, 0.5, 1.0, 3.0)))
    asked = []
    for one in (scene, faster):
        episode = s2.Episode(one, GraphPolicy(paper))
        episode.step()
        asked.append(episode.past[0].command)
    slow, fast = asked
    assert (fast.vx, fast.vy, fast.omega) == pytest.approx((2 * slow.vx, 2 * slow.vy, 2 * slow.omega), abs=2e-4)


def test_the_papers_answers_are_told_to_the_right_and_clockwise(tmp_path: Path) -> None:
    from sonata2d.learning.weights import Weights, write_weights

    from .samples import drawn

    for graph, sign in (("paper", -1.0), ("modern", 1.0)):
        arrays = {name: np.zeros_like(array) for name, array in drawn(graph).arrays.items()}
        arrays["layer2.bias"] = np.array([0.5, 0.5, 0.5])
        write_weights(tmp_path / "half.npz", Weights(graph, "rgcn", arrays, {}))
        episode, limits = s2.Episode(lively(3), GraphPolicy(tmp_path / "half.npz")), Limits()
        episode.step()
        half, asked = np.tanh(0.5), episode.past[0].command
        wanted = (half * limits.ahead, sign * half * limits.sideways, sign * half * limits.turn)
        assert (asked.vx, asked.vy, asked.omega) == pytest.approx(wanted, abs=1e-4)


def test_it_is_had_again_as_a_file_tells_or_refused(tmp_path: Path) -> None:
    own, path = GraphPolicy(), weights_file(tmp_path / "mine.npz", seed=1)
    assert GraphPolicy.from_settings(own.settings()).settings() == own.settings()
    mine = GraphPolicy(path)
    assert mine.settings()["weights"] == str(path)
    assert GraphPolicy.from_settings(mine.settings()).settings() == mine.settings()
    weights_file(path, seed=2)
    with pytest.raises(ControllerError, match=r"mine.npz has other weights now than those that drove, of SHA-256"):
        GraphPolicy.from_settings(mine.settings())
    with pytest.raises(ControllerError, match="graph-policy has other weights now"):
        GraphPolicy.from_settings(own.settings() | {"sha256": "0" * 64})


def test_the_inputs_of_an_image_have_left_and_right_changed(tmp_path: Path) -> None:
    """Of walls and oblong things, whose images are turned round, all but the direction."""
    from sonata2d.datasets.mirror import mirrored

    sides = ("y", "sin", "vy", "omega", "head_sin", "near_y", "to_y", "goal_y", "own_vy", "own_omega")
    signs = np.array([-1.0 if name in sides else 1.0 for name in INPUTS])
    turned = [INPUTS.index(name) for name in ("cos", "sin", "head_cos", "head_sin")]
    for seed in range(3):
        _, record = watched(tmp_path, lively(seed), None, ticks=20)
        one, twin = (modern_graph(run, 15, instants=1) for run in (record, mirrored(record)))
        a, b = inputs_of(one) * signs, inputs_of(twin)
        for graph, rows in ((one, a), (twin, b)):
            rows[np.isin(graph.node_type, (1, 3))[:, None] & np.isin(np.arange(len(INPUTS)), turned)] = 0.0
        apart = np.abs(a[:, None] - b[None]).max(axis=2)
        assert apart.min(axis=0).max() < 1e-4  # 3.1416 is a half turn in a file
        assert apart.min(axis=1).max() < 1e-4


def test_inputs_are_what_their_names_say() -> None:
    chance = RandomStream(3, 0, "people")
    people = [walker(k, 3 * chance.uniform(-1, 1), 3 * chance.uniform(-1, 1), k) for k in range(1, 6)]
    scene = replace(room(people), robot=Robot(Pose(-2.0, 1.0, 0.7)))
    policy = Watching()
    s2.Episode(scene, policy).step()
    row = [dict(zip(INPUTS, told, strict=True)) for told in inputs_of(policy.seen[0]).tolist()]
    for k, person in enumerate(people, 1):
        ahead, left = scene.robot.pose.to_local(person.pose.position)
        distance = float(np.hypot(ahead, left))
        gap = distance - person.radius - scene.robot.radius
        assert (row[k]["x"], row[k]["y"]) == pytest.approx((ahead / 5, left / 5))
        assert (row[k]["to_x"], row[k]["to_y"]) == pytest.approx((ahead / distance, left / distance))
        assert (row[k]["near_x"], row[k]["near_y"]) == pytest.approx((ahead / distance, left / distance))
        assert (row[k]["distance"], row[k]["gap"]) == pytest.approx((distance / 5, gap / 2))
        assert (row[k]["close"], row[k]["near"]) == pytest.approx((np.exp(-gap / 0.5), np.exp(-gap / 2.0)), rel=1e-6)
    ahead, left = scene.robot.pose.to_local(scene.goal.position)
    for node in row:
        assert node["goal_distance"] == pytest.approx(np.hypot(ahead, left) / 5)
        assert np.arctan2(node["goal_y"], node["goal_x"]) == pytest.approx(np.arctan2(left, ahead))


def test_rules_of_a_long_tick_are_read(tmp_path: Path, paper: Path) -> None:
    scene = replace(room([walker(1, 0.0, 1.0)]), rules=Rules(dt=0.5))
    seen, record = watched(tmp_path, scene, paper, ticks=8)
    assert [graph.ticks for graph in paper_graphs(record)] == [(2,), (4, 2), (6, 4, 2)]
    assert seen[6].ticks == (6, 4, 2)
