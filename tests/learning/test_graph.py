"""Graphs have the nodes, edges and numbers that the paper's description gives, for every kind of room and relation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.entities import RELATIONS as TIES
from sonata2d.core.geometry import Disc
from sonata2d.core.vectors import wrap_angle
from sonata2d.datasets.mirror import mirrored
from sonata2d.datasets.motion import motion_of
from sonata2d.errors import Sonata2dError
from sonata2d.learning.graph.graph import NODE_TYPES, RELATIONS, Graph, wall_pieces
from sonata2d.learning.graph.modern import modern_graph
from sonata2d.learning.graph.paper import FEATURES, kept_ticks, paper_graphs
from sonata2d.learning.graph.picture import save_graph
from sonata2d.learning.graph.pyg import to_data, to_hetero, typed_edges
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord

KINDS = ("square", "rectangle", "l")
SEEDS = range(20)


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[EpisodeRecord]:
    """Twenty random episodes, in rooms of all kinds, with all relations; some shorter than a second."""
    folder, found = tmp_path_factory.mktemp("graphs"), []
    for seed in SEEDS:
        told = {"room": {"kinds": [KINDS[seed % 3]]}, "rules": {"time_limit": 0.5 + 0.7 * seed}, "drop": True}
        told |= {
            "talking_pairs": 1,
            "walking_pairs": 1,
            "at_laptop": [0, 2],
            "at_plant": 1,
            "at_object": 1,
            "chairs": 1,
        }
        path = folder / f"{seed}.json"
        with s2.JsonRecorder(path) as recorder:
            s2.Episode(s2.generate(s2.ScenarioConfig(**told), seed), s2.SocialPlanner(), observers=[recorder]).run()
        found.append(read_episode(path))
    return found


def column(graph: Graph, name: str) -> np.ndarray:  # type: ignore[type-arg]
    return graph.features[:, graph.feature_names.index(name)]


def matching(graph: Graph) -> list[int]:
    """For each node, its index in the graph of the mirror image, where walls run the other way."""
    same = list(range(len(graph.node_type)))
    walls = graph.node_type == NODE_TYPES.index("wall")
    for i in range(len(graph.ticks)):
        for wall in set(graph.entity[walls].tolist()):
            pieces = np.flatnonzero(walls & (graph.instant == i) & (graph.entity == wall)).tolist()
            for k, piece in enumerate(pieces):
                same[piece] = pieces[-1 - k]
    return same


def test_the_runs_have_all_rooms_and_relations(runs: list[EpisodeRecord]) -> None:
    assert {run.family.rpartition("/")[2] for run in runs} == set(KINDS)
    assert {tie.relation for run in runs for tie in run.scene().interactions} == set(TIES)


@pytest.mark.parametrize("seed", SEEDS)
def test_nodes_edges_and_graphs_are_as_many_as_the_formulas_say(runs: list[EpisodeRecord], seed: int) -> None:
    run = runs[seed]
    scene = run.scene()
    lengths = [np.hypot(w.end[0] - w.start[0], w.end[1] - w.start[1]) for w in scene.walls]
    walls = sum(int(100 * round(float(length), 6) / 400) + 1 for length in lengths)
    people, things = len(scene.humans), len(scene.furniture)
    nodes = 2 + people + things + walls
    graphs = paper_graphs(run)
    kept = 1 + int((len(run) - 1) // 10)
    assert len(graphs) == kept - 1
    for j, graph in enumerate(graphs):
        k = min(j + 1, 3)
        ties = [len(run.document["frames"][tick]["interactions"]) for tick in graph.ticks]
        assert graph.features.shape == (k * nodes, 42)
        within = sum(1 + 3 * (people + things + 1 + walls) + 2 * count for count in ties)
        assert graph.edges.shape == (2, within + 2 * (k - 1) * nodes)
        assert graph.relation.max() < 16 + 2 * (k - 1)
        assert len(graph.relation_names) == 16 + 2 * (k - 1)
        assert np.diff(graph.ticks[::-1]) == pytest.approx(10)
        count = np.bincount(graph.node_type, minlength=5) // k
        assert dict(zip(NODE_TYPES, count.tolist(), strict=True)) == {
            "human": people, "object": things, "room": 1, "wall": walls, "goal": 1,
        }  # fmt: skip


def test_edges_join_what_their_relation_says(runs: list[EpisodeRecord]) -> None:
    graph = next(graph for run in runs for graph in paper_graphs(run) if len(graph.ticks) == 3)
    letter = dict(zip(NODE_TYPES, "porwg", strict=True))
    count = len(graph.node_type) // 3
    for (a, b), relation in zip(graph.edges.T.tolist(), graph.relation.tolist(), strict=True):
        kinds = [letter[NODE_TYPES[graph.node_type[end]]] for end in (a, b)]
        if relation >= len(RELATIONS):
            i = 1 + (relation - 16) // 2
            there = (a, b) if relation % 2 == 0 else (b, a)
            assert there[0] - there[1] == i * count
            assert graph.instant[there[1]] == 0
        elif RELATIONS[relation].startswith("S"):
            assert a == b
            assert RELATIONS[relation][1].lower() == kinds[0]
        else:
            assert RELATIONS[relation] == "_".join(kinds)
            assert a // count == b // count


def test_the_42_features_are_what_the_robot_sees(runs: list[EpisodeRecord]) -> None:
    assert len(FEATURES) == len(set(FEATURES)) == 42
    for run in runs[5:]:
        graph = paper_graphs(run)[-1]
        snapshot, count = run.snapshot(graph.ticks[0]), len(graph.node_type) // len(graph.ticks)
        before = run.snapshot(graph.ticks[0] - 1)
        pose, people = snapshot.robot.pose, len(run.scene().humans)
        for k, human in enumerate(snapshot.humans, 1):
            ahead, left = pose.to_local(human.pose.position)
            last_ahead, last_left = before.robot.pose.to_local(before.humans[k - 1].pose.position)
            row = dict(zip(FEATURES, graph.features[k].tolist(), strict=True))
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
            row = dict(zip(FEATURES, graph.features[k].tolist(), strict=True))
            assert (row["obj_x_size"], row["obj_y_size"]) == pytest.approx(size)
        assert column(graph, "room_humans")[0] == pytest.approx(people / 15)
        assert column(graph, "room_humans2")[0] == pytest.approx(people**2 / 225)
        goal = pose.to_local(snapshot.goal)
        assert graph.features[graph.node_type == 4][0, -4:-2] == pytest.approx((-goal[1] / 10, goal[0] / 10))
        for i, name in enumerate(("is_t_0", "is_t_m1", "is_t_m2")):
            assert np.array_equal(column(graph, name), graph.instant == i)
        assert column(graph, "time_left")[::count].tolist() == [1 / (tick + 1) for tick in graph.ticks]
        limits = run.scene().robot.limits
        asked = run.command[graph.ticks[0]]
        assert graph.label == pytest.approx(asked / [limits.ahead, -limits.sideways, -limits.turn])


def test_a_node_has_no_numbers_of_other_types(runs: list[EpisodeRecord]) -> None:
    begins = {"human": "hum", "object": "obj", "room": "room_", "wall": "wall_", "goal": "goal_"}
    graph = paper_graphs(runs[-1])[-1]
    for kind, start in begins.items():
        rows = graph.features[graph.node_type == NODE_TYPES.index(kind)][:, 10:]
        for k, name in enumerate(FEATURES[10:]):
            assert name.startswith(start) or not rows[:, k].any()
        assert rows.any()


def test_an_image_gives_the_graph_with_left_and_right_changed(runs: list[EpisodeRecord]) -> None:
    for run in runs[6:10]:
        for one, twin in zip(paper_graphs(run), paper_graphs(mirrored(run)), strict=True):
            assert np.array_equal(one.edges, twin.edges)
            same = matching(one)
            assert twin.position[same] == pytest.approx(one.position * [-1, 1])
            assert twin.label == pytest.approx(one.label * [1, -1, -1])
            for name in ("hum_x_pos", "human_x_vel", "human_a_vel", "hum_orientation_cos", "goal_x_pos", "wall_x_pos"):
                assert column(twin, name)[same] == pytest.approx(-column(one, name), abs=1e-5)
            for name in ("hum_y_pos", "human_y_vel", "hum_orientation_sin", "goal_dist", "wall_dist"):
                assert column(twin, name)[same] == pytest.approx(column(one, name), abs=1e-5)


@pytest.mark.parametrize(
    ("length", "count"), [(3.999, 1), (4.0, 2), (3.9999999999, 2), (7.9, 2), (8.0, 3), (8.0000001, 3)]
)
def test_a_wall_is_cut_by_its_rounded_length(length: float, count: int) -> None:
    owner, ends = wall_pieces(np.array([[1.0, 1.0, 1.0 + length * 0.6, 1.0 + length * 0.8]]))
    assert owner == (0,) * count
    assert ends[0, :2].tolist() == [1.0, 1.0]
    assert np.hypot(*(ends[:, 2:] - ends[:, :2]).T) == pytest.approx(length / count)


def test_frames_are_kept_a_second_apart() -> None:
    assert kept_ticks(np.arange(31) * 0.1) == [0, 10, 20, 30]
    assert kept_ticks(np.round(np.arange(9) * 0.3, 4)) == [0, 4, 8]
    assert kept_ticks(np.arange(10) * 0.1) == [0]
    assert kept_ticks(np.zeros(0)) == []


def test_whoever_is_missing_at_an_instant_is_in_no_graph_of_it(runs: list[EpisodeRecord], tmp_path: Path) -> None:
    import copy

    from sonata2d.record.reader import record_of

    document = copy.deepcopy(runs[5].document)
    document["frames"][20]["humans"][0], document["frames"][20]["activity"][0] = None, -1
    record = record_of(document, tmp_path / "gap.json")
    gone, id = len(record.scene().humans), record.scene().humans[0].id
    for graph in (*paper_graphs(record), *(modern_graph(record, tick) for tick in (25, 30))):
        people = graph.entity[graph.node_type == NODE_TYPES.index("human")]
        sees_gap = 20 in {*graph.ticks, *(tick - 1 for tick in graph.ticks if "is_robot" not in graph.feature_names)}
        assert len(people) == (gone - sees_gap) * len(graph.ticks)
        assert (id in people) is not sees_gap
        assert np.isfinite(graph.features).all()
    assert len(paper_graphs(record)) == len(paper_graphs(runs[5]))


def test_the_modern_graph_tells_what_the_snapshot_shows(runs: list[EpisodeRecord]) -> None:
    run = runs[8]
    world, local = (modern_graph(run, 40, frame=frame, instants=4, interval=0.5) for frame in ("world", "robot"))  # type: ignore[arg-type]
    assert world.ticks == (40, 35, 30, 25)
    assert len(world.relation_names) == 16 + 6
    assert np.array_equal(world.edges, local.edges)
    origin, count = run.snapshot(40).robot.pose, len(world.node_type) // 4
    for i, tick in enumerate(world.ticks):
        snapshot = run.snapshot(tick)
        rows = [dict(zip(g.feature_names, g.features[i * count].tolist(), strict=True)) for g in (world, local)]
        assert (rows[0]["x"], rows[0]["y"]) == snapshot.robot.position
        assert (rows[1]["x"], rows[1]["y"]) == pytest.approx(origin.to_local(snapshot.robot.position))
        assert rows[0]["age"] == pytest.approx(0.5 * i)
        for k, human in enumerate(snapshot.humans, 1):
            row, seen = (
                dict(zip(g.feature_names, g.features[i * count + k].tolist(), strict=True)) for g in (world, local)
            )
            assert (row["vx"], row["vy"], row["omega"]) == (*human.velocity, human.omega)
            assert np.arctan2(row["head_sin"], row["head_cos"]) == pytest.approx(human.head, abs=1e-9)
            assert np.hypot(seen["vx"], seen["vy"]) == pytest.approx(np.hypot(*human.velocity))
            head = wrap_angle(human.head - origin.theta)
            assert (seen["head_cos"], seen["head_sin"]) == pytest.approx((np.cos(head), np.sin(head)), abs=1e-9)
    assert world.label == run.labels[40]
    assert modern_graph(run, len(run)).label is None
    assert modern_graph(run, 3, instants=9, interval=0.1).ticks == (3, 2, 1, 0)
    assert motion_of(run).dt == 0.1


@pytest.mark.parametrize(
    "bad", [{"tick": -1}, {"tick": 10_000}, {"instants": 0}, {"interval": 0.05}, {"frame": "moon"}]
)
def test_what_makes_no_modern_graph_is_refused(runs: list[EpisodeRecord], bad: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        modern_graph(runs[5], **{"tick": 20, **bad})  # type: ignore[arg-type]


def test_typed_edges_are_all_edges_counted_within_types(runs: list[EpisodeRecord]) -> None:
    graph = paper_graphs(runs[9])[-1]
    typed = typed_edges(graph)
    assert sum(edges.shape[1] for edges in typed.values()) == len(graph.relation)
    for (start, name, end), edges in typed.items():
        of_type = [np.flatnonzero(graph.node_type == NODE_TYPES.index(kind)) for kind in (start, end)]
        back = {(int(of_type[0][a]), int(of_type[1][b])) for a, b in edges.T.tolist()}
        chosen = graph.edges[:, graph.relation == graph.relation_names.index(name)].T.tolist()
        assert back <= {(a, b) for a, b in chosen}


@pytest.mark.filterwarnings("ignore")  # of PyTorch itself, when it is imported
def test_pytorch_geometric_takes_a_graph_or_its_absence_is_told(runs: list[EpisodeRecord]) -> None:
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


def test_the_picture_shows_every_type_in_its_colour(runs: list[EpisodeRecord], tmp_path: Path) -> None:
    import pygame

    from sonata2d.view.network import NODE_COLOUR

    graph = paper_graphs(runs[9])[-1]
    save_graph(tmp_path / "graph.png", graph, dt=0.1, title="nine")
    shown = pygame.image.load(tmp_path / "graph.png")
    panel = shown.get_width() // 3
    for k in range(3):
        part = pygame.surfarray.array3d(shown.subsurface((k * panel, 60, panel, shown.get_height() - 100)))
        colours = {tuple(colour) for colour in part.reshape(-1, 3).tolist()}
        assert {NODE_COLOUR[kind] for kind in NODE_TYPES} <= colours
