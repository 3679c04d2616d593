"""`graph-policy` reads the same graphs while it drives as a recording gives, and it drives in every scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.controllers.labelled import Labelled
from sonata2d.agents.controllers.loading import load_controller
from sonata2d.core.entities import Human, Limits, Robot
from sonata2d.core.geometry import Pose, Twist
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.datasets.transforms.mirror import mirrored
from sonata2d.errors import ControllerError
from sonata2d.learning.graph.features import INPUTS
from sonata2d.learning.graph.graph import Graph
from sonata2d.learning.graph.modern import inputs_of, modern_graph
from sonata2d.learning.graph.paper import kept_ticks, paper_graphs
from sonata2d.learning.policy import GraphPolicy
from sonata2d.learning.weights import Weights, write_weights
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.scenegen.scenario.load import load_scenario, scenario_names
from sonata2d.testing.controllers import check_controller, default_scenes

from ..conftest import room, walker
from .samples import random_weights, weights_file

TOLERANCE = 6e-4  # of numbers computed from recorded ones


class KeepsGraphs(GraphPolicy):
    """Keeps the graph of each tick in `graphs`."""

    def reset(self, scene: Scene) -> None:
        super().reset(scene)
        self.graphs: list[Graph] = []

    def act(self, snapshot: Snapshot) -> Twist:
        twist = super().act(snapshot)
        self.graphs.append(self.graph(snapshot.scene))
        return twist


def live_graphs(
    tmp_path: Path, scene: Scene, weights: Path | None, ticks: int = 45
) -> tuple[list[Graph], EpisodeRecord]:
    """Return the graphs that the policy read while the expert drove, and the record of the episode."""
    policy, path = KeepsGraphs(weights), tmp_path / "run.json"
    with s2.JsonRecorder(path) as recorder:
        scene = replace(scene, rules=replace(scene.rules, time_limit=ticks * scene.rules.dt), settings=None)
        s2.Episode(scene, Labelled(s2.SocialPlanner(), policy), observers=[recorder]).run()
    return policy.graphs, read_episode(path)


def assert_same(live: Graph, recorded: Graph) -> None:
    assert live.ticks == recorded.ticks
    for name in ("node_type", "entity", "instant", "edges", "relation"):
        assert np.array_equal(getattr(live, name), getattr(recorded, name)), name
    assert np.abs(live.features - recorded.features).max() < TOLERANCE
    assert np.abs(live.position - recorded.position).max() < TOLERANCE


def people_in(graph: Graph) -> int:
    """Number of pedestrians per instant."""
    return int((graph.node_type == 0).sum()) // len(graph.ticks)


@pytest.fixture(scope="module")
def paper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Weights of a network that reads graphs of the paper."""
    return weights_file(tmp_path_factory.mktemp("weights") / "paper.npz")


def lively(seed: int) -> Scene:
    """Return a scene with relations that begin and end during the episode."""
    return s2.generate(load_scenario("lively"), seed)


def test_live_modern_graphs_are_the_recorded_ones(tmp_path: Path) -> None:
    for seed in range(3):
        graphs, record = live_graphs(tmp_path, lively(seed), None)
        assert len(graphs) == len(record)
        for tick, live in enumerate(graphs):
            assert_same(live, modern_graph(record, tick, instants=1))


def test_live_graphs_of_the_paper_are_the_recorded_ones(tmp_path: Path, paper: Path) -> None:
    live, record = live_graphs(tmp_path, lively(3), paper)
    graphs = paper_graphs(record, skip_first=True)
    assert [len(graph.ticks) for graph in graphs] == [1, 2, 3, 3]
    for graph in graphs:
        assert_same(live[graph.ticks[0]], graph)


@pytest.mark.parametrize("dt", [0.05, 0.15, 0.2, 0.3])
def test_live_instants_have_the_recorded_spacing_at_any_tick_length(tmp_path: Path, paper: Path, dt: float) -> None:
    scene = s2.generate(s2.ScenarioConfig(rules={"dt": dt, "substeps": 10}), seed=4)
    live, record = live_graphs(tmp_path, scene, paper, ticks=round(4.0 / dt))
    graphs = paper_graphs(record, skip_first=True)
    assert [graph.ticks[0] for graph in graphs] == kept_ticks(record.time)[1:]
    for graph in graphs:
        assert_same(live[graph.ticks[0]], graph)


def test_pedestrians_who_enter_or_leave_are_read_while_present(tmp_path: Path, paper: Path) -> None:
    scene = default_scenes(60.0)[1]
    for weights in (None, paper):
        live, record = live_graphs(tmp_path, scene, weights, ticks=75)
        modern = [modern_graph(record, tick, instants=1) for tick in range(len(record))]
        recorded = paper_graphs(record, skip_first=True) if weights else modern
        for graph in recorded:
            assert_same(live[graph.ticks[0]], graph)
        assert len({people_in(graph) for graph in live}) > 1


def test_first_second_of_an_episode_is_read_as_one_second_old(tmp_path: Path, paper: Path) -> None:
    graphs, _ = live_graphs(tmp_path, lively(3), paper, ticks=22)
    time_left, is_first = (graphs[0].feature_names.index(name) for name in ("time_left", "is_first_frame"))
    for tick in (0, 5, 10):
        assert graphs[tick].features[:, time_left] == pytest.approx(1 / 11)
    assert [len(graph.ticks) for graph in graphs] == [1] * 20 + [2, 2]
    assert all(graph.features[-1, is_first] == 1.0 for graph in graphs)


def test_policy_in_a_branched_episode_has_no_earlier_instants(paper: Path) -> None:
    episode = s2.Episode(room([walker(1, 0.0, 2.0)]), s2.StraightToGoal())
    for _ in range(30):
        episode.step()
    for weights in (None, paper):
        policy = KeepsGraphs(weights)
        branch = episode.branch(30, policy)
        for _ in range(21):
            branch.step()
        first, last = policy.graphs[0], policy.graphs[-1]
        assert first.ticks == (30,)
        assert last.ticks == ((50, 40, 30) if weights else (50,))
        if weights:
            assert not first.features[:, first.feature_names.index("human_x_vel")].any()
        again = episode.branch(30, GraphPolicy(weights))
        for _ in range(21):
            again.step()
        assert again.past == branch.past


@pytest.mark.parametrize("name", sorted(scenario_names()))
def test_policy_drives_within_the_limits_in_every_stock_scenario(name: str, paper: Path) -> None:
    scene = s2.generate(load_scenario(name), seed=2)
    for weights in (None, paper):
        episode = s2.Episode(scene, GraphPolicy(weights))
        for _ in range(12):
            episode.step()
        commands = np.array([[m.command.vx, m.command.vy, m.command.omega] for m in episode.past])
        limits = scene.robot.limits
        assert (np.abs(commands) <= [limits.ahead + 1e-4, limits.sideways + 1e-4, limits.turn + 1e-4]).all()


@pytest.mark.parametrize("name", ["sonata-2020", "narrow-doorway", "blind-corner", "joining-a-group"])
def test_stock_policy_reaches_the_goal(name: str) -> None:
    policy = load_controller("graph-policy")
    assert isinstance(policy, GraphPolicy)
    config = load_scenario(name)
    reached = [s2.Episode(s2.generate(config, 21, k), policy).run().status == "goal" for k in range(5)]
    assert sum(reached) >= 4, f"reached {sum(reached)} of 5 goals in {name}"


def test_policy_passes_the_checks_of_every_controller(paper: Path) -> None:
    for weights in (None, paper):
        check_controller(GraphPolicy(weights), time_limit=3.0)


@pytest.mark.parametrize("people", [0, 1])
def test_rooms_with_few_pedestrians_are_read(tmp_path: Path, paper: Path, people: int) -> None:
    scene = room([walker(1, 0.0, 1.0)][:people])
    for weights in (None, paper):
        graphs, _ = live_graphs(tmp_path, scene, weights, ticks=22)
        assert {people_in(graph) for graph in graphs} == {people}


def test_replayed_pedestrians_are_read_while_present(tmp_path: Path, paper: Path) -> None:
    track = tuple((0.1 * k - 2.0, 0.5) for k in range(15))
    person = Human(7, Pose(-2.0, 0.5), behaviour="recorded", track=track, enters=5, leaves=20)
    for weights in (None, paper):
        graphs, record = live_graphs(tmp_path, room([person]), weights, ticks=30)
        present = record.states.present[:-1, 0].tolist()
        assert present == [5 <= tick < 20 for tick in range(30)]
        for tick, graph in enumerate(graphs):
            used = [tick, *graph.ticks[1:]]
            if weights:  # velocities are computed from the tick before
                used += [max(at - 1, 0) for at in used]
            assert (graph.node_type == 0).any() == all(present[at] for at in used), tick


def test_unicycle_gets_no_sideways_command(paper: Path) -> None:
    for kinematics in ("holonomic", "unicycle"):
        scene = replace(lively(3), robot=replace(lively(3).robot, kinematics=kinematics))
        for weights in (None, paper):
            episode = s2.Episode(scene, GraphPolicy(weights))
            for _ in range(5):
                episode.step()
            assert any(moment.command.vy for moment in episode.past) is (kinematics == "holonomic")


def test_commands_scale_with_the_limits_of_the_robot(paper: Path) -> None:
    scene = lively(3)
    faster = replace(scene, robot=replace(scene.robot, limits=Limits(2.0, 0.5, 1.0, 3.0)))
    commands = []
    for variant in (scene, faster):
        episode = s2.Episode(variant, GraphPolicy(paper))
        episode.step()
        commands.append(episode.past[0].command)
    slow, fast = commands
    assert (fast.vx, fast.vy, fast.omega) == pytest.approx((2 * slow.vx, 2 * slow.vy, 2 * slow.omega), abs=2e-4)


@pytest.mark.parametrize(("graph", "sign"), [("paper", -1.0), ("modern", 1.0)])
def test_outputs_for_graphs_of_the_paper_point_right_and_clockwise(tmp_path: Path, graph: str, sign: float) -> None:
    arrays = {name: np.zeros_like(array) for name, array in random_weights(graph).arrays.items()}
    arrays["layer2.bias"] = np.array([0.5, 0.5, 0.5])
    write_weights(tmp_path / "half.npz", Weights(graph, "rgcn", arrays, {}))
    episode, limits = s2.Episode(lively(3), GraphPolicy(tmp_path / "half.npz")), Limits()
    episode.step()
    half, command = np.tanh(0.5), episode.past[0].command
    expected = (half * limits.ahead, sign * half * limits.sideways, sign * half * limits.turn)
    assert (command.vx, command.vy, command.omega) == pytest.approx(expected, abs=1e-4)


def test_policy_is_reconstructed_from_settings_or_refused(tmp_path: Path) -> None:
    stock, path = GraphPolicy(), weights_file(tmp_path / "mine.npz", seed=1)
    assert GraphPolicy.from_settings(stock.settings()).settings() == stock.settings()
    mine = GraphPolicy(path)
    assert mine.settings()["weights"] == str(path)
    assert GraphPolicy.from_settings(mine.settings()).settings() == mine.settings()
    weights_file(path, seed=2)
    with pytest.raises(ControllerError, match=r"mine.npz has other weights now than when .* the weights of SHA-256"):
        GraphPolicy.from_settings(mine.settings())
    with pytest.raises(ControllerError, match="graph-policy has other weights now"):
        GraphPolicy.from_settings(stock.settings() | {"sha256": "0" * 64})


def test_inputs_of_a_mirrored_episode_are_mirrored(tmp_path: Path) -> None:
    """The directions of walls and rectangles, which a mirror image reverses, are not compared."""
    lateral = ("y", "sin", "vy", "omega", "head_sin", "near_y", "to_y", "goal_y", "own_vy", "own_omega")
    signs = np.array([-1.0 if name in lateral else 1.0 for name in INPUTS])
    directions = [INPUTS.index(name) for name in ("cos", "sin", "head_cos", "head_sin")]
    for seed in range(3):
        _, record = live_graphs(tmp_path, lively(seed), None, ticks=20)
        graph, twin = (modern_graph(run, 15, instants=1) for run in (record, mirrored(record)))
        a, b = inputs_of(graph) * signs, inputs_of(twin)
        for source, rows in ((graph, a), (twin, b)):
            rows[np.isin(source.node_type, (1, 3))[:, None] & np.isin(np.arange(len(INPUTS)), directions)] = 0.0
        difference = np.abs(a[:, None] - b[None]).max(axis=2)
        assert difference.min(axis=0).max() < 1e-4  # half a turn is recorded as 3.1416
        assert difference.min(axis=1).max() < 1e-4


def test_inputs_agree_with_their_names() -> None:
    rng = RandomStream(3, 0, "people")
    people = [walker(k, 3 * rng.uniform(-1, 1), 3 * rng.uniform(-1, 1), k, breadth=0.4) for k in range(1, 6)]  # discs
    scene = replace(room(people), robot=Robot(Pose(-2.0, 1.0, 0.7)))
    policy = KeepsGraphs()
    s2.Episode(scene, policy).step()
    rows = [dict(zip(INPUTS, row, strict=True)) for row in inputs_of(policy.graphs[0]).tolist()]
    for k, person in enumerate(people, 1):
        ahead, left = scene.robot.pose.to_local(person.pose.position)
        distance = float(np.hypot(ahead, left))
        gap = distance - person.radius - scene.robot.radius
        assert (rows[k]["x"], rows[k]["y"]) == pytest.approx((ahead / 5, left / 5))
        assert (rows[k]["to_x"], rows[k]["to_y"]) == pytest.approx((ahead / distance, left / distance))
        assert (rows[k]["near_x"], rows[k]["near_y"]) == pytest.approx((ahead / distance, left / distance))
        assert (rows[k]["distance"], rows[k]["gap"]) == pytest.approx((distance / 5, gap / 2))
        assert (rows[k]["close"], rows[k]["near"]) == pytest.approx((np.exp(-gap / 0.5), np.exp(-gap / 2.0)), rel=1e-6)
    ahead, left = scene.robot.pose.to_local(scene.goal.position)
    for row in rows:
        assert row["goal_distance"] == pytest.approx(np.hypot(ahead, left) / 5)
        assert np.arctan2(row["goal_y"], row["goal_x"]) == pytest.approx(np.arctan2(left, ahead))


def test_long_ticks_are_read(tmp_path: Path, paper: Path) -> None:
    scene = replace(room([walker(1, 0.0, 1.0)]), rules=Rules(dt=0.5))
    graphs, record = live_graphs(tmp_path, scene, paper, ticks=8)
    assert [graph.ticks for graph in paper_graphs(record, skip_first=True)] == [(2,), (4, 2), (6, 4, 2)]
    assert graphs[6].ticks == (6, 4, 2)
