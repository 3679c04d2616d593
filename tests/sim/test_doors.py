"""Interior doors: who opens them, what their leaves do, and what observers see of them."""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.sensors.lidar import Lidar
from sonata2d.core.doors import InteriorDoor, leaf_lines
from sonata2d.core.geometry import Barriers, Pose
from sonata2d.core.leaves import door_frames, move_leaves
from sonata2d.core.scene import Scene
from sonata2d.core.separation import outline_gaps
from sonata2d.datasets import mirrored
from sonata2d.datasets.check.plausibility import implausible_values
from sonata2d.errors import ConfigError, RecordError, SceneError
from sonata2d.formats.socnav3 import Options, export
from sonata2d.learning.graph import modern_graph, paper_graphs
from sonata2d.learning.graph.graph import NODE_TYPES
from tests.running import record_of

ROOM = {"polygon": [[-4, -2], [4, -2], [4, 2], [-4, 2]], "walls": [[0, -2, 0, -0.5], [0, 0.5, 0, 2]]}


def scene(door: dict[str, Any] | None = None, start: tuple[float, float, float] = (-3, 0, 0), **settings: Any) -> Scene:
    """Two rooms with a door between them, and the robot's goal in the right one."""
    config: dict[str, Any] = {
        "room": ROOM, "standing": 0, "wandering": 0, "tables": 0, "plants": 0, "laptops_on_tables": 0, "relations": 0,
        "robot": {"pose": start}, "goal": {"position": (3, 0)}, "rules": {"time_limit": 30},
        "interior_doors": [{"x": 0, "y": 0, "theta": math.pi / 2, **(door or {})}],
    }  # fmt: skip
    return s2.generate(s2.ScenarioConfig(**config | settings), seed=1)


class Stand(s2.Controller):
    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist()


class Ahead(s2.Controller):
    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist(vx=0.5)


IN_THE_WAY = "meets a wall, furniture or another door; move it, or make it sliding"
WALKER = {"x": -3, "y": 0.3, "goals": [[3, 0.3]]}


@pytest.mark.parametrize("kind", ["hinged", "sliding"])
def test_a_door_opens_for_a_robot_that_comes_near_and_closes_behind_it(kind: str) -> None:
    record = record_of(scene({"kind": kind, "hold": 0.5}), Ahead())
    openings = record.states.doors[:, 0]
    x = record.states.robot[:, 0]
    assert openings[x < -1.9].tolist() == [0.0] * int((x < -1.9).sum())  # its edge is 1.5 m away at -1.8
    assert abs(openings[x > -0.3][0]) == 1.0
    assert record.outcome.status == "goal"
    assert abs(openings[-1]) < 1.0  # it closes when the robot has passed


def test_a_hinged_door_turns_away_from_whoever_opens_it() -> None:
    from_left, from_right = scene(), scene(start=(3, 0, math.pi), goal={"position": (-3, 0)})
    assert record_of(from_left, Ahead()).states.doors.min() == -1.0  # the hinge is at y = -0.5: right is to +x
    assert record_of(from_right, Ahead()).states.doors.max() == 1.0


def test_only_people_open_a_door_by_hand() -> None:
    closed = record_of(scene({"opened_by": "people"}), Ahead())
    assert not closed.states.doors.any()
    assert closed.states.robot[:, 0].max() == pytest.approx(-0.02 - 0.3, abs=0.011)
    assert {c.kind for c in closed.snapshot(-1).contacts} == {"door"}
    passed = record_of(scene({"opened_by": "people"}, (-3, -1, 0), people=[WALKER]), Stand())
    assert abs(passed.states.doors).max() == 1.0
    assert passed.states.humans[-1, 0, 0] == pytest.approx(3, abs=0.3)


def test_a_robot_asks_for_a_door_by_standing_before_it() -> None:
    record = record_of(scene({"opened_by": "request"}, (-0.9, 0, 0)), Stand())
    first = int(np.flatnonzero(record.states.doors[:, 0])[0])
    assert record.time[first] == pytest.approx(1.1)
    assert record_of(scene({"opened_by": "request"}), s2.SocialPlanner()).outcome.status == "goal"


@pytest.mark.parametrize("opening", [0.0, 1.0])
def test_a_door_that_nobody_opens_is_a_wall(opening: float) -> None:
    door = {"opened_by": "nobody", "opening": opening}
    if opening:
        record = record_of(scene(door))
        assert record.outcome.status == "goal"
        assert record.snapshot(5).doors[0].is_open
        assert record.states.doors.shape == (len(record) + 1, 0)
    else:
        with pytest.raises(SceneError, match="there is no path for the robot"):
            scene(door)


def test_leaves_never_overlap_with_bodies() -> None:
    config = s2.ScenarioConfig(
        room={"kinds": ["doorway"], "chamber": [4, 5]}, humans=6, wandering_share=1.0, relations=0, drop=True,
        rules={"time_limit": 30, "ends_on": ["time"]}, interior_doors=[{"kind": "hinged"}],
    )  # fmt: skip
    for seed in range(3):
        record = record_of(s2.generate(config, seed=seed))
        leaves = leaf_lines(record.scene().moving_doors, record.states.doors)
        robot = record.states.robot
        heading = np.stack((np.cos(robot[:, 2]), np.sin(robot[:, 2])), axis=1)
        assert outline_gaps(record.scene().robot.outline, robot[:, :2], heading, leaves).min() > -1e-3
        assert abs(record.states.doors).max() == 1.0
        assert [*implausible_values(record)] == []


def test_kernels_and_interior_door_place_a_leaf_alike() -> None:
    doors = [InteriorDoor(1, Pose(0.3, -1.2, 0.7), 0.9, kind) for kind in ("hinged", "sliding")]
    for opening in (0.0, 0.123, 0.5, 1.0):
        openings = np.array([-opening, opening])
        table = np.zeros((len(doors), 8))
        move_leaves(table, door_frames(doors, 0.1), openings)
        expected = Barriers.of([door.leaf(value) for door, value in zip(doors, openings, strict=True)])
        np.testing.assert_array_equal(table, expected.table)


def test_a_leaf_stops_before_somebody_in_its_way_and_tries_the_other_side() -> None:
    standing = [{"x": 0.85, "y": -0.6, "theta": 0.0, "behaviour": "standing", "reacts_to_robot": 0}]
    record = record_of(scene({"opened_by": "request"}, (-1.1, 0, 0), people=standing), Stand())
    openings = record.states.doors[:, 0]
    blocked = openings.min()
    assert -1.0 < blocked < 0.0  # to the right, away from the robot, until it is before the person
    assert 0.2 < openings.max() < 1.0  # then to the left, until it is before the robot


def test_episodes_with_doors_are_replayed_and_read(tmp_path: Path) -> None:
    config = s2.ScenarioConfig(
        room={"kinds": ["doorway"]}, humans=3, relations=0, drop=True, interior_doors=[{"opened_by": "request"}]
    )
    scene = s2.generate(config, seed=3)
    with s2.JsonRecorder(tmp_path / "door.json") as recorder:
        s2.Episode(scene, s2.SocialPlanner(), observers=[recorder]).run()
    record = s2.read_episode(tmp_path / "door.json")
    assert record.scene() == scene
    assert record.document["version"] == 2
    assert record.states.doors.any()
    commands = [s2.Twist(*command) for command in record.command.tolist()]
    again, recorder = s2.Episode(scene), s2.EpisodeRecorder(id="door")
    again = s2.Episode(scene, s2.SocialPlanner(), observers=[recorder])
    for command in commands:
        again.apply(command)
    assert again.observe().state.row.tolist() == pytest.approx(again.snapshot().state.row.tolist())
    assert [s.doors for s in record.snapshots()][-1] == again.snapshot().doors
    image = mirrored(record)
    assert mirrored(image).document == record.document
    assert image.states.doors.tolist() == (0.0 - record.states.doors).tolist()


def test_findings_name_faulty_doors() -> None:
    record = record_of(scene())
    from sonata2d.record.validate import require_valid

    document = record.document | {"frames": [dict(frame) for frame in record.document["frames"]]}
    document["frames"][3]["doors"] = []
    with pytest.raises(RecordError, match=r"frames\.3\.doors: 0 of 1 interior doors that move"):
        require_valid(document, Path("a.json"))
    document["frames"][3]["doors"] = [0.5]
    with pytest.raises(RecordError, match=r"frames\.3\.doors: door 1 cannot be 0\.5 open after 0"):
        require_valid(document, Path("a.json"))
    with pytest.raises(RecordError, match="version: must be 2 for interior doors"):
        require_valid(record.document | {"version": 1}, Path("a.json"))
    document["frames"][3]["doors"] = [1.5]
    with pytest.raises(RecordError, match=r"frames\.3\.doors\.0: .*less than or equal to 1"):
        require_valid(document, Path("a.json"))


def test_lidar_people_and_barriers_see_leaves() -> None:
    lidar = Lidar(rays=4, distance=10.0)
    closed, opened = (scene({"opened_by": "people", "opening": at, "hold": 1e3}) for at in (0.0, 1.0))
    ranges = []
    for each in (closed, opened):
        controller = Stand()
        controller.sensors = (lidar,)
        episode = s2.Episode(each, controller)
        episode.step()
        ranges.append(lidar.start(each)(episode.snapshot(), None).ranges[2])  # type: ignore[arg-type]
        assert len(episode.snapshot().barriers) == len(each.barriers) + 1
    assert ranges[0] == pytest.approx(3.0 - 0.02)
    assert ranges[1] == pytest.approx(7.0)


def test_observations_have_leaves_as_walls() -> None:
    from sonata2d.gym import SocialNavEnv

    def wall_lengths(opening: float) -> list[float]:
        config = s2.ScenarioConfig(
            room=ROOM, standing=0, wandering=0, tables=0, plants=0, laptops_on_tables=0, relations=0,
            robot={"pose": (-3, 0, 0)}, goal={"position": (3, 0)},
            interior_doors=[{"x": 0, "y": 0, "theta": math.pi / 2, "kind": "sliding", "opening": opening}],
        )  # fmt: skip
        env = SocialNavEnv(config)
        observation, _ = env.reset(seed=1)
        walls = observation["walls"][observation["walls_mask"] > 0]
        return sorted(np.hypot(*(walls[:, 2:4] - walls[:, :2]).T).astype(float).round(3).tolist())

    assert wall_lengths(0.0).count(1.0) == 1
    assert wall_lengths(0.4).count(0.6) == 1


@pytest.mark.parametrize(
    ("door", "message"),
    [
        ({"x": 0, "y": 1}, r"the interior door \(0, 1\) needs walls 0.5 to 3 m apart"),
        ({"x": 9, "y": 0}, r"the interior door \(9, 0\) is outside the room; move it"),
        ({"x": -2, "y": 0}, "they are 4.00 m apart; move it into an opening"),
    ],
)
def test_a_door_needs_an_opening(door: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        scene(door)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"room": ROOM | {"walls": [*ROOM["walls"], [0.7, -0.3, 1.3, -0.3]]}},
            IN_THE_WAY,
        ),
        ({"furniture": [{"type": "table", "x": 0.9, "y": -0.4}]}, IN_THE_WAY),
        ({"interior_doors": [{"x": 0, "y": 0}, {"x": 0, "y": 0.1}]}, IN_THE_WAY),
        ({"robot": {"pose": (0, 0, 0)}}, "the robot would start in the leaf of interior door 1; move one of them"),
        (
            {"people": [{"x": 0.05, "y": 0.2, "behaviour": "wandering"}]},
            "person 1 would start in the leaf of interior door 1",
        ),
    ],
)
def test_leaves_need_room(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        scene(**settings)


def test_theta_chooses_the_opening() -> None:
    room = {"polygon": [[-1.5, -2], [1.5, -2], [1.5, 2], [-1.5, 2]], "walls": [[0, -2, 0, -1.4], [0, 1.4, 0, 2]]}
    door = {"kind": "sliding", "theta": math.pi / 2}
    (found,) = scene(door, (-1, 0, 0), room=room, goal={"position": (1, 0)}).interior_doors
    assert (found.pose.x, abs(found.pose.y), found.width) == (0.0, 1.4, 2.8)


def test_people_walk_round_leaves_that_stand_open() -> None:
    people = [{"x": -3, "y": -1.2, "goals": [[3, -1.2]]}, {"x": 3, "y": -1, "goals": [[-3, -1]]}]
    for k in range(2):
        record = record_of(scene({}, (-3, 1, 0), people=people[k:] + people[:k]), Stand())
        last = record.states.humans[-1, :, 0]
        assert sorted(last.round()) == [-3, 3], last


def test_a_copy_of_a_crowd_sees_doors_move() -> None:
    each = scene({}, (-3, 1, 0), people=[WALKER])
    episode = s2.Episode(each, Stand())
    for _ in range(12):
        episode.step()
    copy = deepcopy(episode._crowd)
    for _ in range(15):
        snapshot = episode.snapshot()
        commands = episode._crowd.act(snapshot)
        assert copy.act(snapshot).acceleration.tolist() == commands.acceleration.tolist()
        episode._world.step(s2.Twist(), commands)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"interior_doors": [{}]}, r"interior_doors\.0\.x: give x and y; only rooms of the kind doorway have one"),
        ({"interior_doors": [{"x": 0}]}, "give x and y, or neither"),
        ({"interior_doors": [{"x": 0, "y": 0, "kind": "sliding", "opening": -1}]}, "a sliding door opens to one side"),
        ({"interior_doors": [{"x": 0, "y": 0, "opened_by": "cats"}]}, "anyone"),
    ],
)
def test_settings_of_doors_are_checked(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        s2.ScenarioConfig(**settings)


@pytest.mark.parametrize("kind", ["hinged", "sliding"])
def test_graphs_have_the_leaves_of_doors_as_walls_that_move(kind: str) -> None:
    record = record_of(scene({"kind": kind}), Ahead())
    door, openings = record.scene().moving_doors[0], record.states.doors[:, 0]
    assert np.ptp(openings) > 0.5
    graph = modern_graph(record, int(np.argmax(np.abs(openings))), frame="world", instants=3, interval=0.5)
    leaf = (graph.node_type == NODE_TYPES.index("wall")) & (graph.entity == len(record.scene().walls))
    assert leaf.sum() == len(graph.ticks)
    x, y, length = (graph.features[leaf, graph.feature_names.index(name)] for name in ("x", "y", "length"))
    for n, tick in enumerate(graph.ticks):
        start, end, _ = door.leaf(openings[tick])
        assert (x[n], y[n]) == pytest.approx(((start[0] + end[0]) / 2, (start[1] + end[1]) / 2))
        assert length[n] == pytest.approx(np.hypot(end[0] - start[0], end[1] - start[1]))
    assert np.ptp(x) + np.ptp(y) > 0.1
    assert len(paper_graphs(record)) == int(record.time[-2])


def test_what_has_no_moving_walls_refuses_doors() -> None:
    record = record_of(scene())
    from sonata2d.errors import Sonata2dError

    with pytest.raises(Sonata2dError, match="it has doors that open and close"):
        export(record, Options())


def test_a_pedestrian_model_in_ordinary_python_refuses_doors() -> None:
    from sonata2d.agents.pedestrians.models.base import use_leaves

    with pytest.raises(ValueError, match="the pedestrian model plain does not see doors that open and close"):
        use_leaves(object(), "plain", np.zeros((0, 8)))  # type: ignore[arg-type]


def test_scenes_without_doors_have_no_keys_of_doors() -> None:
    record = record_of(replace(scene(), interior_doors=()))
    assert "interior_doors" not in record.document
    assert all("doors" not in frame for frame in record.document["frames"])
