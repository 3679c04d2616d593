"""Graphs have the nodes, edges and features that the paper describes, for every kind of room and relation."""

from __future__ import annotations

import copy
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pygame
import pytest

import sonata2d as s2
from sonata2d.core.geometry import Disc
from sonata2d.core.portable_math import Array
from sonata2d.core.relations import RELATIONS as INTERACTIONS
from sonata2d.core.vectors import wrap_angle
from sonata2d.datasets.transforms.mirror import mirrored
from sonata2d.errors import Sonata2dError
from sonata2d.formats import sonata
from sonata2d.formats.format import Options
from sonata2d.learning.graph.convert import _typed_edges, save_graph, to_data, to_hetero
from sonata2d.learning.graph.features import FEATURES
from sonata2d.learning.graph.graph import NODE_TYPES, RELATIONS, Graph, wall_pieces
from sonata2d.learning.graph.modern import modern_graph
from sonata2d.learning.graph.paper import kept_ticks, paper_graphs
from sonata2d.record.motion import motion_of
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord, record_from_document
from sonata2d.view.graph_picture import NODE_COLOUR

KINDS = ("square", "rectangle", "l")
SEEDS = range(20)


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[EpisodeRecord]:
    """Twenty random episodes, in all kinds of room, with all relations; some shorter than a second."""
    folder, records = tmp_path_factory.mktemp("graphs"), []
    for seed in SEEDS:
        config = s2.ScenarioConfig(
            room={"kinds": [KINDS[seed % 3]]},
            rules={"time_limit": 0.5 + 0.7 * seed},
            drop=True,
            talking_pairs=1,
            walking_pairs=1,
            at_laptop=[0, 2],
            at_plant=1,
            at_object=1,
            chairs=1,
            arguing_pairs=[0, 1],
            handing_over_pairs=[0, 1],
            caring_pairs=[0, 1],
            watching_tv=[0, 1],
            leading_pairs=[0, 1],
            following_pairs=[0, 1],
        )
        path = folder / f"{seed}.json"
        with s2.JsonRecorder(path) as recorder:
            s2.Episode(s2.generate(config, seed), s2.SocialPlanner(), observers=[recorder]).run()
        records.append(read_episode(path))
    return records


def column(graph: Graph, name: str) -> Array:
    return graph.features[:, graph.feature_names.index(name)]


def node_features(graph: Graph, node: int) -> dict[str, float]:
    return dict(zip(graph.feature_names, graph.features[node].tolist(), strict=True))


def mirrored_nodes(graph: Graph) -> list[int]:
    """Return for each node its index in the graph of the mirror image, in which walls run in the other direction."""
    indices = list(range(len(graph.node_type)))
    walls = graph.node_type == NODE_TYPES.index("wall")
    for i in range(len(graph.ticks)):
        for wall in set(graph.entity[walls].tolist()):
            pieces = np.flatnonzero(walls & (graph.instant == i) & (graph.entity == wall)).tolist()
            for k, piece in enumerate(pieces):
                indices[piece] = pieces[-1 - k]
    return indices


def test_sample_runs_have_all_rooms_and_relations(runs: list[EpisodeRecord]) -> None:
    assert {run.family.rpartition("/")[2] for run in runs} == set(KINDS)
    assert {interaction.relation for run in runs for interaction in run.scene().interactions} == set(INTERACTIONS)


@pytest.mark.parametrize("skip_first", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_numbers_of_graphs_nodes_and_edges_follow_the_formulas(
    runs: list[EpisodeRecord], seed: int, skip_first: bool
) -> None:
    run = runs[seed]
    scene = run.scene()
    lengths = [np.hypot(w.end[0] - w.start[0], w.end[1] - w.start[1]) for w in scene.walls]
    walls = sum(int(100 * round(float(length), 6) / 400) + 1 for length in lengths)
    people, objects = len(scene.humans), len(scene.furniture)
    nodes = 2 + people + objects + walls
    graphs = paper_graphs(run, skip_first=skip_first)
    kept = 1 + int((len(run) - 1) // 10)
    assert len(graphs) == kept - 1
    for j, graph in enumerate(graphs):
        k = min(j + 1 if skip_first else j + 2, 3)
        counts = [len(run.document["frames"][tick]["interactions"]) for tick in graph.ticks]
        assert graph.features.shape == (k * nodes, 42)
        within = sum(1 + 3 * (people + objects + 1 + walls) + 2 * count for count in counts)
        assert graph.edges.shape == (2, within + 2 * (k - 1) * nodes)
        assert graph.relation.max() < 16 + 2 * (k - 1)
        assert len(graph.relation_names) == 16 + 2 * (k - 1)
        assert np.diff(graph.ticks[::-1]) == pytest.approx(10)
        count = np.bincount(graph.node_type, minlength=5) // k
        assert dict(zip(NODE_TYPES, count.tolist(), strict=True)) == {
            "human": people, "object": objects, "room": 1, "wall": walls, "goal": 1,
        }  # fmt: skip


def test_edges_join_the_node_types_of_their_relation(runs: list[EpisodeRecord]) -> None:
    graph = next(graph for run in runs for graph in paper_graphs(run) if len(graph.ticks) == 3)
    letter = dict(zip(NODE_TYPES, "porwg", strict=True))
    count = len(graph.node_type) // 3
    for (a, b), relation in zip(graph.edges.T.tolist(), graph.relation.tolist(), strict=True):
        kinds = [letter[NODE_TYPES[graph.node_type[end]]] for end in (a, b)]
        if relation >= len(RELATIONS):
            i = 1 + (relation - 16) // 2
            older, newest = (a, b) if relation % 2 == 0 else (b, a)
            assert older - newest == i * count
            assert graph.instant[newest] == 0
        elif RELATIONS[relation].startswith("S"):
            assert a == b
            assert RELATIONS[relation][1].lower() == kinds[0]
        else:
            assert RELATIONS[relation] == "_".join(kinds)
            assert a // count == b // count


def test_graphs_are_those_that_the_original_makes_of_the_exported_frames(runs: list[EpisodeRecord]) -> None:
    """The instants, by the original's rule, and their features, from the frame list in its format."""
    checked = 0
    for run in runs[5:]:
        scene = run.scene()
        ids = [entity.id for entity in (*scene.humans, *scene.furniture)]
        if sorted(ids) != list(range(1, len(ids) + 1)) or run.time[-1] < 2.0:
            continue  # the original takes ids for indices
        frames = json.loads(sonata.export(run, Options()))[: len(run)]
        instants, graphs = [0], paper_graphs(run)
        for tick, frame in enumerate(frames):
            if frame["timestamp"] - frames[instants[0]]["timestamp"] < 1.0:
                continue
            instants.insert(0, tick)
            graph = graphs.pop(0)
            assert list(graph.ticks) == instants[:3]
            for i, t in enumerate(graph.ticks):
                of_instant = graph.instant == i
                assert set(column(graph, "is_first_frame")[of_instant]) == {float(t == 0)}
                assert column(graph, "time_left")[of_instant] == pytest.approx(1 / (t + 1))
                for person in frames[t]["people"]:
                    (node,) = np.flatnonzero(of_instant & (graph.node_type == 0) & (graph.entity == person["id"]))
                    row = node_features(graph, node)
                    assert row["hum_x_pos"] == pytest.approx(person["x"] / 10, abs=1e-9)
                    velocity = [row[f"human_{name}_vel"] for name in ("x", "y", "a")]
                    assert velocity == pytest.approx([person[k] / 10 for k in ("vx", "vy", "va")], abs=1e-9)
                    checked += t == 0
        assert not graphs
    assert checked > 10, "people in first frames, whose velocities are zero"


def test_the_42_features_agree_with_the_snapshots(runs: list[EpisodeRecord]) -> None:
    assert len(FEATURES) == len(set(FEATURES)) == 42
    for run in runs[5:]:
        graph = paper_graphs(run)[-1]
        snapshot, count = run.snapshot(graph.ticks[0]), len(graph.node_type) // len(graph.ticks)
        before = run.snapshot(graph.ticks[0] - 1)
        pose, people = snapshot.robot.pose, len(run.scene().humans)
        for k, human in enumerate(snapshot.humans, 1):
            ahead, left = pose.to_local(human.pose.position)
            last_ahead, last_left = before.robot.pose.to_local(before.humans[k - 1].pose.position)
            row = node_features(graph, k)
            assert (row["hum_x_pos"], row["hum_y_pos"]) == pytest.approx((-left / 10, ahead / 10))
            assert row["human_x_vel"] == pytest.approx((left - last_left) / 10, abs=1e-12)
            assert row["human_y_vel"] == pytest.approx((last_ahead - ahead) / 10, abs=1e-12)
            turn = wrap_angle(human.pose.theta - pose.theta)
            faces_right, faces_ahead = -np.sin(turn), np.cos(turn)
            assert (row["hum_orientation_cos"], row["hum_orientation_sin"]) == pytest.approx(
                (faces_right, -faces_ahead)
            )
            assert row["hum_inv_dist"] == pytest.approx(1.0 - np.hypot(ahead, left) / 10)
        for k, thing in enumerate(snapshot.objects, 1 + people):
            size = (
                (2 * thing.shape.radius,) * 2
                if isinstance(thing.shape, Disc)
                else (thing.shape.length, thing.shape.width)
            )
            row = node_features(graph, k)
            assert (row["obj_x_size"], row["obj_y_size"]) == pytest.approx(size)
        assert column(graph, "room_humans")[0] == pytest.approx(people / 15)
        assert column(graph, "room_humans2")[0] == pytest.approx(people**2 / 225)
        goal = pose.to_local(snapshot.goal)
        assert graph.features[graph.node_type == 4][0, -4:-2] == pytest.approx((-goal[1] / 10, goal[0] / 10))
        for i, name in enumerate(("is_t_0", "is_t_m1", "is_t_m2")):
            assert np.array_equal(column(graph, name), graph.instant == i)
        assert column(graph, "time_left")[::count].tolist() == [1 / (tick + 1) for tick in graph.ticks]
        limits = run.scene().robot.limits
        command = run.command[graph.ticks[0]]
        assert graph.label == pytest.approx(command / [limits.ahead, -limits.sideways, -limits.turn])


def test_features_of_other_node_types_are_zero(runs: list[EpisodeRecord]) -> None:
    prefixes = {"human": "hum", "object": "obj", "room": "room_", "wall": "wall_", "goal": "goal_"}
    graph = paper_graphs(runs[-1])[-1]
    for kind, prefix in prefixes.items():
        rows = graph.features[graph.node_type == NODE_TYPES.index(kind)][:, 10:]
        for k, name in enumerate(FEATURES[10:]):
            assert name.startswith(prefix) or not rows[:, k].any()
        assert rows.any()


def test_mirrored_episode_gives_the_mirrored_graph(runs: list[EpisodeRecord]) -> None:
    for run in runs[6:10]:
        for graph, twin in zip(paper_graphs(run), paper_graphs(mirrored(run)), strict=True):
            assert np.array_equal(graph.edges, twin.edges)
            indices = mirrored_nodes(graph)
            assert twin.position[indices] == pytest.approx(graph.position * [-1, 1])
            assert twin.label == pytest.approx(graph.label * [1, -1, -1])
            # a mirrored file keeps four decimals of the mirrored angles
            for name in ("hum_x_pos", "human_x_vel", "human_a_vel", "hum_orientation_cos", "goal_x_pos", "wall_x_pos"):
                assert column(twin, name)[indices] == pytest.approx(-column(graph, name), abs=5e-5)
            for name in ("hum_y_pos", "human_y_vel", "hum_orientation_sin", "goal_dist", "wall_dist"):
                assert column(twin, name)[indices] == pytest.approx(column(graph, name), abs=5e-5)


@pytest.mark.parametrize(
    ("length", "count"), [(3.999, 1), (4.0, 2), (3.9999999999, 2), (7.9, 2), (8.0, 3), (8.0000001, 3)]
)
def test_walls_are_divided_by_their_rounded_length(length: float, count: int) -> None:
    indices, ends = wall_pieces(np.array([[1.0, 1.0, 1.0 + length * 0.6, 1.0 + length * 0.8]]))
    assert indices == (0,) * count
    assert ends[0, :2].tolist() == [1.0, 1.0]
    assert np.hypot(*(ends[:, 2:] - ends[:, :2]).T) == pytest.approx(length / count)


def test_kept_ticks_are_a_second_apart() -> None:
    assert kept_ticks(np.arange(31) * 0.1) == [0, 10, 20, 30]
    assert kept_ticks(np.round(np.arange(9) * 0.3, 4)) == [0, 4, 8]
    assert kept_ticks(np.arange(10) * 0.1) == [0]
    assert kept_ticks(np.zeros(0)) == []


def test_pedestrian_absent_at_one_instant_is_not_in_the_graph(runs: list[EpisodeRecord], tmp_path: Path) -> None:
    document = copy.deepcopy(runs[5].document)
    document["frames"][20]["humans"][0], document["frames"][20]["activity"][0] = None, -1
    record = record_from_document(document, tmp_path / "gap.json")
    count, id = len(record.scene().humans), record.scene().humans[0].id
    for graph in (*paper_graphs(record), *(modern_graph(record, tick) for tick in (25, 30))):
        people = graph.entity[graph.node_type == NODE_TYPES.index("human")]
        # Graphs of the paper also use the tick before each instant, for velocities.
        uses_gap = 20 in {*graph.ticks, *(tick - 1 for tick in graph.ticks if "is_robot" not in graph.feature_names)}
        assert len(people) == (count - uses_gap) * len(graph.ticks)
        assert (id in people) is not uses_gap
        assert np.isfinite(graph.features).all()
    assert len(paper_graphs(record)) == len(paper_graphs(runs[5]))


def test_modern_features_agree_with_the_snapshots(runs: list[EpisodeRecord]) -> None:
    run = runs[8]
    world = modern_graph(run, 40, frame="world", instants=4, interval=0.5)
    local = modern_graph(run, 40, frame="robot", instants=4, interval=0.5)
    assert world.ticks == (40, 35, 30, 25)
    assert len(world.relation_names) == 16 + 6
    assert np.array_equal(world.edges, local.edges)
    origin, count = run.snapshot(40).robot.pose, len(world.node_type) // 4
    for i, tick in enumerate(world.ticks):
        snapshot = run.snapshot(tick)
        world_robot, local_robot = node_features(world, i * count), node_features(local, i * count)
        assert (world_robot["x"], world_robot["y"]) == snapshot.robot.position
        assert (local_robot["x"], local_robot["y"]) == pytest.approx(origin.to_local(snapshot.robot.position))
        assert world_robot["age"] == pytest.approx(0.5 * i)
        for k, human in enumerate(snapshot.humans, 1):
            row, local_row = node_features(world, i * count + k), node_features(local, i * count + k)
            assert (row["vx"], row["vy"], row["omega"]) == (*human.velocity, human.omega)
            assert np.arctan2(row["head_sin"], row["head_cos"]) == pytest.approx(human.head, abs=1e-9)
            assert np.hypot(local_row["vx"], local_row["vy"]) == pytest.approx(np.hypot(*human.velocity))
            head = wrap_angle(human.head - origin.theta)
            assert (local_row["head_cos"], local_row["head_sin"]) == pytest.approx(
                (np.cos(head), np.sin(head)), abs=1e-9
            )
    assert world.label == run.labels[40]
    assert modern_graph(run, len(run)).label is None
    assert modern_graph(run, 3, instants=9, interval=0.1).ticks == (3, 2, 1, 0)
    assert motion_of(run).dt == 0.1


@pytest.mark.parametrize(
    "invalid", [{"tick": -1}, {"tick": 10_000}, {"instants": 0}, {"interval": 0.05}, {"frame": "moon"}]
)
def test_invalid_arguments_of_modern_graph_are_refused(runs: list[EpisodeRecord], invalid: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=next(iter(invalid))):
        modern_graph(runs[5], **{"tick": 20, **invalid})  # type: ignore[arg-type]


def test_typed_edges_are_all_edges_numbered_within_types(runs: list[EpisodeRecord]) -> None:
    graph = paper_graphs(runs[9])[-1]
    typed = _typed_edges(graph)
    assert sum(edges.shape[1] for edges in typed.values()) == len(graph.relation)
    for (start, name, end), edges in typed.items():
        of_type = [np.flatnonzero(graph.node_type == NODE_TYPES.index(kind)) for kind in (start, end)]
        back = {(int(of_type[0][a]), int(of_type[1][b])) for a, b in edges.T.tolist()}
        expected = graph.edges[:, graph.relation == graph.relation_names.index(name)].T.tolist()
        assert back <= {(a, b) for a, b in expected}


@pytest.mark.filterwarnings("ignore")  # PyTorch itself warns when it is imported
def test_pytorch_geometric_accepts_a_graph_or_is_reported_missing(runs: list[EpisodeRecord]) -> None:
    graph = paper_graphs(runs[9])[-1]
    try:
        import torch_geometric  # noqa: F401
    except ImportError:
        with pytest.raises(Sonata2dError, match="pip install"):
            to_data(graph)
        with pytest.raises(Sonata2dError, match="pip install"):
            to_hetero(graph)
        return
    data, hetero = to_data(graph), to_hetero(graph)
    assert data.validate()
    assert hetero.validate()
    assert data.x.shape == graph.features.shape
    assert data.y.tolist()[0] == pytest.approx(graph.label.tolist())
    assert sum(store.x.shape[0] for store in hetero.node_stores) == len(graph.node_type)


def test_picture_shows_every_node_type_in_its_colour(runs: list[EpisodeRecord], tmp_path: Path) -> None:
    graph = paper_graphs(runs[9])[-1]
    save_graph(tmp_path / "graph.png", graph, dt=0.1, title="nine")
    picture = pygame.image.load(tmp_path / "graph.png")
    panel = picture.get_width() // 3
    for k in range(3):
        part = pygame.surfarray.array3d(picture.subsurface((k * panel, 60, panel, picture.get_height() - 100)))
        colours = {tuple(colour) for colour in part.reshape(-1, 3).tolist()}
        assert {NODE_COLOUR[kind] for kind in NODE_TYPES} <= colours


def test_importing_the_graphs_loads_no_compiler() -> None:
    code = "import sys; from sonata2d import read_episode; from sonata2d.learning.graph import *;"
    code += "from sonata2d.learning import inputs_of; print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
