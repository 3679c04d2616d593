"""Robots that are no discs: overlaps judged by separate code, walls, doors, people, files and pictures."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.devices import ImageRequest
from sonata2d.core.entities import Furniture, Robot, Wall
from sonata2d.core.geometry import Disc, Outline, Polygon, Pose, Rectangle, Shape, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.proxemics import clearances, obstacle_clearance
from sonata2d.core.scene import Rules, Scene
from sonata2d.datasets import mirrored, verify
from sonata2d.errors import ConfigError, SceneError
from sonata2d.gym.rewards import CrowdNav
from sonata2d.metrics.trajectory import Trajectory

from ..agents.test_drives import Wild
from ..conftest import room, walker

CART, WEDGE = Rectangle(0.9, 0.6), Polygon(((0.6, 0.0), (0.3, 0.3), (-0.4, 0.3), (-0.4, -0.3), (0.3, -0.3)))
BODIES = {
    "cart": {"shape": "rectangle", "length": 0.9, "width": 0.6},
    "wedge": {"shape": "polygon", "points": WEDGE.points},
}


def corners_of(shape: Outline, robot: Any) -> Array:
    """Corners of a polygon at the pose of a robot, or of a piece of furniture, (K, 2), m; of a disc, many points."""
    (c, s), place = robot.direction, np.array(robot.position)
    core = np.array(shape.core)
    if len(core) == 1:
        angle = np.linspace(0.0, 2.0 * math.pi, 257)[:-1]
        core = shape.rounding * np.stack((np.cos(angle), np.sin(angle)), axis=1)
    return place + core @ np.array([[c, s], [-s, c]])


def depth(first: Array, second: Array) -> float:
    """Least translation that parts two convex polygons or lines, m; negative where they are apart.

    Separating axis theorem, over the normals of all sides.
    """
    sides = [np.roll(points, -1, axis=0) - points for points in (first, second)]
    normals = np.concatenate(sides)[:, ::-1] * (1.0, -1.0)
    normals = normals[np.linalg.norm(normals, axis=1) > 1e-9]
    normals = np.concatenate((normals, -normals))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return float(np.min((first @ normals.T).max(axis=0) - (second @ normals.T).min(axis=0)))


def deepest(snapshot: s2.Snapshot) -> float:
    """Deepest overlap of the robot with walls, furniture and people, m."""
    scene, robot = snapshot.scene, snapshot.robot
    body = corners_of(robot.body.outline, robot)
    found = [depth(body, np.array([wall.start, wall.end])) for wall in scene.walls]
    found += [depth(body, corners_of(thing.shape, thing.pose)) for thing in scene.furniture if thing.on is None]
    for human in snapshot.humans:
        line = np.array(s2.core.geometry.Stadium(human.radius, human.shoulder).corners(human.pose))
        ends = [np.linalg.norm(line[0] + t * (line[1] - line[0]) - nearest_point(body, line)) for t in (0.0, 0.5, 1.0)]
        overlap = depth(body, line)
        found.append(human.radius + overlap if overlap > 0.0 else human.radius - min(gap_of(body, line), *ends))
    return max(found)


def nearest_point(body: Array, line: Array) -> Array:
    """The point of a polygon's sides that is nearest to the middle of a line."""
    points = samples(body)
    return points[np.argmin(np.linalg.norm(points - line.mean(axis=0), axis=1))]


def samples(body: Array) -> Array:
    """Points on the sides of a polygon, (n, 2)."""
    t = np.linspace(0.0, 1.0, 60)[:, None]
    return np.concatenate([a + t * (b - a) for a, b in zip(body, np.roll(body, -1, axis=0), strict=True)])


def gap_of(body: Array, line: Array) -> float:
    """Distance of a polygon's sides and a line, from points on both, m."""
    points = line[0] + np.linspace(0.0, 1.0, 20)[:, None] * (line[1] - line[0])
    return float(np.linalg.norm(samples(body)[:, None] - points[None], axis=2).min())


def scenario(name: str, kinematics: str, **rules: Any) -> s2.ScenarioConfig:
    robot = {"kinematics": kinematics, "body": BODIES[name]}
    return s2.load_scenario("sonata-2020-crowded").changed(robot=robot, rules={"ends_on": ["time"]} | rules)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("kinematics", ["holonomic", "unicycle", "differential", "omni", "bicycle"])
def test_a_wild_robot_overlaps_with_nothing(name: str, kinematics: str) -> None:
    """There is no overlap with walls and furniture, and less than 2 cm with people who walk into the robot."""
    for seed in range(2):
        episode = s2.Episode(s2.generate(scenario(name, kinematics), seed), Wild())
        touched, worst = False, -1.0
        for _ in range(120):
            episode.step()
            snapshot = episode.snapshot()
            worst, touched = max(worst, deepest(snapshot)), touched or bool(snapshot.contacts)
        assert worst < 0.02


@pytest.mark.parametrize("kinematics", ["holonomic", "unicycle", "bicycle"])
def test_without_the_guard_walls_stop_a_robot_all_the_same(kinematics: str) -> None:
    episode = s2.Episode(s2.generate(scenario("cart", kinematics, guard=False), 4), Wild())
    for _ in range(150):
        episode.step()
        snapshot = replace_people(episode.snapshot())
        assert deepest(snapshot) < 1e-6


def replace_people(snapshot: s2.Snapshot) -> s2.Snapshot:
    """The snapshot without people."""
    return replace(snapshot, humans=snapshot.humans.select(np.array([], dtype=np.int64)))


def alone(shape: Shape, pose: Pose, kinematics: str = "holonomic", **fields: Any) -> s2.Episode:
    scene = room(robot=pose, rules=Rules(ends_on=("time",)), **fields)
    return s2.Episode(replace(scene, robot=Robot(pose, kinematics=kinematics, shape=shape)))


def test_a_rectangle_turns_on_the_spot_only_where_its_corners_have_room() -> None:
    free, beside = alone(CART, Pose(0.0, 0.0)), alone(CART, Pose(0.0, 3.68))
    for episode in (free, beside):
        for _ in range(30):
            episode.apply(Twist(omega=1.0))
    assert free.snapshot().robot.pose.theta > 2.0
    robot = beside.snapshot().robot
    assert 0.0 < robot.pose.theta < 0.1  # the wall at y = 4 stops the corner
    assert robot.guarded
    assert obstacle_clearance(beside.snapshot()) == pytest.approx(0.0, abs=1e-6)
    contact = beside.snapshot().contacts[0]
    assert (contact.kind, contact.robot_at_fault) == ("wall", True)


def test_a_rectangle_at_a_wall_can_drive_and_turn_away() -> None:
    episode = alone(CART, Pose(0.0, 3.5, 0.2), "unicycle")
    for _ in range(20):
        episode.apply(Twist(0.3, 0.0, 0.5))
    assert obstacle_clearance(episode.snapshot()) == pytest.approx(0.0, abs=1e-6)
    for _ in range(30):
        episode.apply(Twist(-0.3, 0.0, -1.0))
    for _ in range(20):
        episode.apply(Twist(0.4))
    end = episode.snapshot().robot
    assert end.pose.theta < -0.4
    assert obstacle_clearance(episode.snapshot()) > 0.1


def test_a_holonomic_rectangle_slides_along_a_wall() -> None:
    episode = alone(CART, Pose(-2.0, 3.5))
    for _ in range(30):
        episode.apply(Twist(0.6, 0.5, 0.0))
    x, y = episode.snapshot().robot.position
    assert y == pytest.approx(3.7, abs=1e-5)
    assert x > -0.8


def test_clearances_are_those_of_the_outline() -> None:
    humans = [walker(1, 2.0, 0.0, math.pi / 2), walker(2, 0.0, 2.0)]
    scene = room(humans, robot=Pose(0.0, 0.0))
    scene = replace(scene, robot=Robot(Pose(0.0, 0.0), shape=CART))
    snapshot = s2.Episode(scene).observe()
    shoulder, radius = humans[0].shoulder, humans[0].radius
    assert clearances(snapshot) == pytest.approx([2.0 - 0.45 - shoulder - radius, 2.0 - 0.3 - shoulder - radius])
    assert obstacle_clearance(snapshot) == pytest.approx(4.0 - 0.45)


def test_a_polygon_of_furniture_stops_robot_and_people() -> None:
    block = Furniture(9, "counter", Pose(0.0, 0.0, 0.3), Polygon(((0.8, 0.0), (0.0, 0.7), (-0.8, 0.0), (0.0, -0.7))))
    scene = room([walker(1, 2.0, 0.0), walker(2, 0.0, 2.5)], [block], robot=Pose(-2.5, 0.0), seed=2)
    episode = s2.Episode(replace(scene, robot=Robot(Pose(-2.5, 0.0), shape=CART)), s2.StraightToGoal())
    worst = -1.0
    for _ in range(300):
        if episode.step() is None:
            break
        worst = max(worst, deepest(episode.snapshot()))
        body = corners_of(block.shape, block.pose)
        assert all(gap_of(body, np.array([h.pose.position] * 2)) > h.radius - 0.02 for h in episode.snapshot().humans)
    assert -0.2 < worst < 0.02


@pytest.mark.parametrize("kinematics", ["holonomic", "unicycle", "differential", "omni"])
@pytest.mark.parametrize("seed", range(3))
def test_the_planner_takes_a_long_robot_through_a_narrow_door(kinematics: str, seed: int) -> None:
    """A door of 0.75 m, which the circle around the robot, 1.08 m, would not pass."""
    draw = np.random.default_rng(seed)
    y = float(draw.uniform(-2.5, 2.5))
    doorway = [Wall((0.0, -4.0), (0.0, y - 0.375)), Wall((0.0, y + 0.375), (0.0, 4.0))]
    pose = Pose(*draw.uniform((-3.0, -3.0, -3.1), (-1.2, 3.0, 3.1)).tolist())
    goal = tuple(draw.uniform((1.2, -3.0), (3.0, 3.0)).tolist())
    scene = room(robot=pose, inner=doorway, goal=goal)
    scene = replace(scene, robot=Robot(pose, kinematics=kinematics, shape=CART, drive=None))
    assert s2.Episode(scene, s2.SocialPlanner()).run().status == "goal"


@pytest.mark.parametrize(("name", "kinematics"), [("cart", "holonomic"), ("wedge", "bicycle"), ("cart", "omni")])
def test_files_hold_outline_and_drive_and_replay(name: str, kinematics: str, tmp_path: Path) -> None:
    settings = scenario(name, kinematics, time_limit=8.0)
    s2.generate_dataset(tmp_path / "o", settings, s2.StraightToGoal(), episodes=2, workers=1)
    record = s2.read_episode(tmp_path / "o" / "000000.json")
    assert record.document["version"] == 2
    robot = record.scene().robot
    assert robot.outline == (CART if name == "cart" else WEDGE)
    assert robot.radius == pytest.approx(robot.outline.circumradius, abs=1e-4)
    assert not list(verify(tmp_path / "o", replay=True))
    trajectory = Trajectory(record)
    snapshots = [frame.snapshot for frame in record.frames()]
    expected = [s2.clearance(snapshot) for snapshot in snapshots]
    assert trajectory.human_clearance.min(axis=1)[:-1] == pytest.approx(expected)


def test_files_of_discs_stay_as_they_were(tmp_path: Path) -> None:
    scenario = s2.ScenarioConfig(humans=1, robot={"body": {"shape": "disc", "radius": 0.25}})
    s2.generate_dataset(tmp_path / "o", scenario, s2.StraightToGoal(), episodes=1, workers=1)
    document = s2.read_episode(tmp_path / "o" / "000000.json").document
    assert document["version"] == 1
    assert document["robot"]["radius"] == 0.25
    assert not {"shape", "drive"} & set(document["robot"])


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ({"shape": "rectangle", "length": 1.0}, "a rectangle needs width"),
        ({"shape": "disc", "radius": 0.2, "width": 1.0}, "a disc has no width"),
        ({"shape": "polygon", "points": [[0.0, 0.0], [1.0, 0.0]]}, "has 2 corners"),
        ({"shape": "polygon", "points": [[1.0, 0.0], [0.0, 1.0], [0.1, 0.1], [0.0, -1.0]]}, "does not turn left"),
        ({"shape": "polygon", "points": [[0.0, 1.0], [1.0, 0.0], [-1.0, 0.0]]}, "does not turn left"),
    ],
)
def test_settings_of_bodies_are_checked(body: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        s2.ScenarioConfig(robot={"body": body})


def test_a_polygon_whose_sides_cross_is_refused() -> None:
    star = tuple((math.cos(k * 0.8 * math.pi), math.sin(k * 0.8 * math.pi)) for k in range(5))
    with pytest.raises(ValueError, match="sides of the polygon cross"):
        Polygon(star)


def test_a_body_that_starts_in_a_wall_is_refused() -> None:
    settings = {"body": BODIES["cart"], "pose": [0.0, 3.6, 0.7]}
    polygon = [[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]]
    with pytest.raises(SceneError, match="the robot's body overlaps something at its start"):
        s2.generate(s2.ScenarioConfig(humans=0, room={"polygon": polygon}, robot=settings), 1)


def test_a_shape_that_is_a_disc_is_the_radius() -> None:
    robot = Robot(Pose(0.0, 0.0), shape=Disc(0.4))
    assert (robot.radius, robot.shape, robot.outline) == (0.4, None, Disc(0.4))


def test_the_social_planner_says_that_it_cannot_drive_a_bicycle() -> None:
    scene = s2.generate(scenario("cart", "bicycle"), 1)
    with pytest.raises(s2.errors.ControllerError, match="cannot drive a bicycle"):
        s2.Episode(scene, s2.SocialPlanner())


def test_pictures_show_the_outline() -> None:
    scene = s2.generate(scenario("wedge", "unicycle"), 1)
    disc = replace(scene, robot=Robot(scene.robot.pose))
    pictures = [s2.view.image_of(s2.Episode(one).observe(), ImageRequest()) for one in (scene, disc)]
    assert (pictures[0] != pictures[1]).any()


def test_worlds_measure_the_clearance_of_the_outline() -> None:
    scene = s2.generate(scenario("cart", "holonomic"), 3)
    reward = CrowdNav()
    worlds, episode = s2.Worlds([scene], reward=reward), s2.Episode(scene)
    worlds.reset()
    for _ in range(100):
        before = episode.observe()
        given = worlds.step(np.array([[0.8, 0.0, 0.2]])).rewards[0]
        episode.apply(Twist(0.8, 0.0, 0.3))
        assert given == pytest.approx(reward(before, episode.observe(), episode.outcome))


def test_scenes_are_scenes_of_the_same_people(tmp_path: Path) -> None:
    """The outline changes nothing else in a scene but where robot and goal have room."""
    cart, disc = (s2.generate(s2.ScenarioConfig(robot={"body": body}), 5) for body in (BODIES["cart"], None))
    assert isinstance(cart, Scene)
    assert cart.humans == disc.humans
    assert cart.furniture == disc.furniture


def test_a_scenario_places_polygons_of_furniture(tmp_path: Path) -> None:
    counter = {"type": "counter", "x": 0.0, "y": 1.0, "theta": 0.5, "body": BODIES["wedge"]}
    settings = s2.ScenarioConfig(
        humans=3, tables=0, plants=0, furniture=[counter], room={"kinds": "square", "side": 8.0}
    )
    scene = s2.generate(settings, 2)
    assert scene.furniture[0].shape == WEDGE
    s2.generate_dataset(tmp_path / "o", settings, s2.StraightToGoal(), episodes=1, seed=2, workers=1)
    record = s2.read_episode(tmp_path / "o" / "000000.json")
    assert record.scene().furniture[0].shape == WEDGE
    assert record.document["version"] == 2
    assert not list(verify(tmp_path / "o", replay=True))
    with pytest.raises(ConfigError, match="give size or body, not both"):
        s2.ScenarioConfig(furniture=[counter | {"size": 0.5}])


LOPSIDED = ((0.8, -0.2), (0.3, 0.5), (-0.4, 0.1), (-0.4, -0.2))


def test_the_mirror_image_of_a_polygon_is_mirrored(tmp_path: Path) -> None:
    body = {"shape": "polygon", "points": LOPSIDED}
    counter = {"type": "counter", "x": 0.0, "y": 1.0, "theta": 0.5, "body": body}
    settings = s2.ScenarioConfig(humans=2, tables=0, furniture=[counter], robot={"body": body})
    s2.generate_dataset(tmp_path / "o", settings, s2.StraightToGoal(), episodes=1, seed=2, workers=1)
    record = s2.read_episode(tmp_path / "o" / "000000.json")
    image = mirrored(record)
    for shape in (image.scene().robot.outline, image.scene().furniture[-1].shape):
        assert {(x, -y) for x, y in shape.core} == set(LOPSIDED)
    assert mirrored(image).document == record.document
    one, other = (Trajectory(each) for each in (record, image))
    assert other.human_clearance == pytest.approx(one.human_clearance)
    assert other.barrier_clearance.min() == pytest.approx(one.barrier_clearance.min())


@pytest.mark.parametrize("kinematics", ["differential", "omni", "bicycle"])
@pytest.mark.parametrize("guard", [True, False])
def test_check_accepts_what_the_drives_do(kinematics: str, guard: bool, tmp_path: Path) -> None:
    drive = {"rear": 0.5} if kinematics == "bicycle" else None
    robot = {"kinematics": kinematics, "body": BODIES["cart"], "drive": drive}
    settings = s2.load_scenario("sonata-2020").changed(robot=robot, rules={"guard": guard})
    s2.generate_dataset(tmp_path / "o", settings, "dwa", episodes=3, workers=1)
    assert not list(verify(tmp_path / "o"))


def test_the_turn_rate_of_a_turn_that_the_guard_stops_is_the_real_one() -> None:
    episode = alone(Rectangle(1.2, 0.4), Pose(0.0, 3.7), "unicycle")
    for _ in range(40):
        before = episode.snapshot().robot.pose.theta
        episode.apply(Twist(0.0, 0.0, 0.5))
        robot = episode.snapshot().robot
        if robot.guarded and abs(robot.pose.theta - before) < 1e-9:
            assert robot.omega == 0.0
            return
    raise AssertionError("the wall never stopped the turn")


def test_a_robot_with_its_origin_at_its_edge_is_drawn_where_it_is() -> None:
    car = Polygon(((-0.01, -0.25), (0.9, -0.25), (0.9, 0.25), (-0.01, 0.25)))
    scene = replace(room(robot=Pose(0.0, 0.0)), robot=Robot(Pose(0.0, 0.0), shape=car))
    image = s2.view.image_of(s2.Episode(scene).observe(), ImageRequest(200, 200, "top"))
    orange = (image[..., 0] > 180) & (image[..., 1] < 130) & (image[..., 2] < 60)
    columns = np.flatnonzero(orange.any(axis=0))
    assert columns.min() >= 98  # the origin is in the middle of the picture
    assert columns.max() > 115
