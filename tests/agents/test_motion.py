"""Motion of pedestrians that an onlooker would notice: arrivals, gaps, robots in the way, turns."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.core.entities import Group, Human, Wall
from sonata2d.core.geometry import Pose, Twist, segment_distances, shoulder_lines
from sonata2d.core.portable_math import Array
from sonata2d.core.snapshot import Snapshot
from sonata2d.sim.world import World

from ..conftest import room
from .test_crowd import positions, simulate, two_rooms

CORNER = Pose(-3.7, -3.7)


def going(number: int, x: float, y: float, *goals: tuple[float, float], **fields: object) -> Human:
    """A pedestrian that walks to goals and does not react to the robot; it faces the first of them."""
    theta = math.atan2(goals[0][1] - y, goals[0][0] - x)
    return Human(number, Pose(x, y, theta), behaviour="walking", goals=goals, reacts_to_robot=0.0, **fields)  # type: ignore[arg-type]


def speeds(snapshots: list[Snapshot]) -> Array:
    """(T, N), m/s."""
    return np.linalg.norm([snapshot.humans.velocity for snapshot in snapshots], axis=2)


@pytest.mark.usefixtures("motionless")
def test_a_pedestrian_stops_at_its_goal_without_turning_back() -> None:
    snapshots = simulate(room([going(1, -3.0, 0.0, (2.0, 0.5))], robot=CORNER), 10.0)
    path, speed = positions(snapshots)[:, 0], speeds(snapshots)[:, 0]
    along = path @ np.array((5.0, 0.5)) / math.hypot(5.0, 0.5)
    assert np.linalg.norm(path[-1] - (2.0, 0.5)) < 0.3
    assert np.diff(along).min() > -0.002
    assert speed[-20:].max() < 0.01
    assert snapshots[-1].humans[0].activity == "standing"
    braking = np.diff(speed)[10:] / 0.1
    assert braking.min() > -2.0  # m/s^2


@pytest.mark.usefixtures("motionless")
@pytest.mark.parametrize("count", [2, 12])
def test_pedestrians_with_one_goal_come_to_rest_around_it(count: int) -> None:
    angles = 2.0 * math.pi * np.arange(count) / count + 0.1
    humans = [going(k + 1, 3.2 * math.cos(a), 3.2 * math.sin(a), (0.0, 0.0)) for k, a in enumerate(angles)]
    snapshots = simulate(room(humans, robot=CORNER), 25.0)
    path = positions(snapshots)
    assert speeds(snapshots)[-30:].max() < 0.05
    assert np.linalg.norm(path[-1], axis=1).max() < 1.7
    assert {human.activity for human in snapshots[-1].humans} == {"standing"}


def test_a_ring_of_people_who_change_sides_dissolves() -> None:
    angles = 2.0 * math.pi * np.arange(20) / 20
    ends = -3.4 * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    humans = [going(k + 1, -x, -y, (x, y)) for k, (x, y) in enumerate(ends.tolist())]
    path = positions(simulate(room(humans, robot=CORNER), 20.0))
    distances = np.linalg.norm(path[-1] - ends, axis=1)
    assert np.median(distances) < 0.6
    assert distances.max() < 1.5  # a pedestrian stops near its goal if somebody stands there


def test_a_person_passes_a_gap_of_half_a_metre_and_turns_its_shoulders() -> None:
    snapshots = simulate(two_rooms(0.5, [going(1, -2.0, 0.0, (2.5, 0.0))], robot=CORNER), 8.0)
    path, body = positions(snapshots)[:, 0], np.array([snapshot.humans.theta[0] for snapshot in snapshots])
    assert np.linalg.norm(path[-1] - (2.5, 0.0)) < 0.3
    assert np.abs(body[np.abs(path[:, 0]) < 0.5]).max() > math.radians(20.0)
    assert np.abs(body[(path[:, 0] < -1.0) | (path[:, 0] > 1.5)]).max() < math.radians(10.0)


def test_a_person_between_a_wall_and_a_robot_turns_about() -> None:
    human = replace(going(1, 3.85, 0.0, (3.0, 3.0)), pose=Pose(3.85, 0.0, 0.0))  # its chest is at the wall
    path = positions(simulate(room([human], robot=Pose(2.9, 0.0)), 10.0))[:, 0]
    assert np.linalg.norm(path[-1] - (3.0, 3.0)) < 0.5


@pytest.mark.parametrize("change", [{"leaves": 5}, {"enters": 1000}])
def test_members_of_a_group_come_abreast_while_the_first_one_is_absent(change: dict[str, int]) -> None:
    first = replace(going(1, -1.0, -1.0, (3.0, -1.0), group=1), **change)
    others = [going(k + 2, -1.0, 0.5 * k, (3.0, 0.5 * k), group=1) for k in range(2)]
    scene = room([first, *others], robot=CORNER, groups=(Group(1, "walking", (1, 2, 3)),))
    world, crowd = World(scene), Crowd(scene)
    for _ in range(12):
        world.step(Twist(), crowd.act(world.snapshot()))
    assert crowd.state.walkers.is_abreast[1:].all()


def test_feet_keep_their_direction_while_shoulders_turn() -> None:
    scene = two_rooms(0.5, [going(1, -2.0, 0.0, (2.5, 0.0))], robot=CORNER)
    world, crowd, seen = World(scene), Crowd(scene), []
    for _ in range(80):
        snapshot = world.snapshot()
        commands = crowd.act(snapshot)
        feet, body = crowd.state.walkers.body_direction[0], snapshot.humans.direction[0]
        seen.append((snapshot.humans.position[0, 0], math.atan2(feet[1], feet[0]), math.atan2(body[1], body[0])))
        world.step(Twist(), commands)
    x, feet_angle, body_angle = np.array(seen).T
    walking = x < 1.5
    assert np.abs(body_angle[walking]).max() > math.radians(20.0)
    assert np.abs(feet_angle[walking]).max() < math.radians(5.0)


@pytest.mark.usefixtures("motionless")
def test_people_who_stop_at_a_full_goal_face_it() -> None:
    humans = [going(k + 1, -3.5 + 0.1 * k, -0.5 + 0.5 * (k % 3), (2.0, 0.0)) for k in range(9)]
    snapshots = simulate(room(humans, robot=CORNER), 25.0)
    assert {human.activity for human in snapshots[-1].humans} == {"standing"}
    last = snapshots[-1].humans
    offset = np.array((2.0, 0.0)) - last.position
    is_before = offset[:, 0] > 0.6
    cosine = (last.direction * offset).sum(axis=1) / np.linalg.norm(offset, axis=1)
    assert is_before.sum() >= 2
    assert cosine[is_before].min() > math.cos(math.radians(10.0))


@pytest.mark.parametrize(("width", "is_abreast"), [(0.9, False), (3.6, True)])
def test_members_with_goals_of_their_own_come_abreast_only_where_there_is_room(width: float, is_abreast: bool) -> None:
    """The second member walks beside the first one towards a door."""
    pair = [going(k + 1, -1.2, 0.9 * k, (3.0, 0.0), group=1) for k in range(2)]
    scene = two_rooms(width, pair, robot=CORNER, groups=(Group(1, "walking", (1, 2)),))
    world, crowd = World(scene), Crowd(scene)
    for _ in range(8):
        world.step(Twist(), crowd.act(world.snapshot()))
    assert crowd.state.walkers.is_abreast.tolist() == [True, is_abreast]


def test_a_crowd_in_a_door_is_not_pressed_into_its_jambs() -> None:
    ends = [(side * (2.0 + 0.9 * (k // 2)), (0.5 + 0.1 * (k % 3)) * (-1) ** k) for side in (-1, 1) for k in range(8)]
    humans = [going(k + 1, x, y, (-math.copysign(3.4, x), y)) for k, (x, y) in enumerate(ends)]
    polygon = ((-7.0, -3.5), (7.0, -3.5), (7.0, 3.5), (-7.0, 3.5))
    inner = [Wall((0.0, -3.5), (0.0, -0.4)), Wall((0.0, 0.4), (0.0, 3.5))]
    scene = room(humans, inner=inner, polygon=polygon, robot=Pose(-6.4, -3.0), goal=(-6.4, 3.0))
    for snapshot in simulate(scene, 20.0):
        people = snapshot.humans
        lines = shoulder_lines(people.position, people.direction, people.shoulder)
        gaps = segment_distances(*lines, scene.barriers).min(axis=0) - people.radius
        assert gaps.min() > -0.012  # the motion in a substep


def test_people_in_a_stream_pass_a_corner_side_by_side() -> None:
    """They leave a corridor 2.4 m wide and turn to the left; a person alone passes near the corner."""
    polygon = ((-9.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-9.0, 8.0))
    inner = [Wall((-9.0, y), (0.0, y)) for y in (-1.2, 1.2)]
    places = [(-2.0 - 0.8 * (k // 3), 0.6 * (k % 3 - 1)) for k in range(24)]

    def at_the_end(count: int) -> list[float]:
        humans = [going(k + 1, x, y, (1.5, 7.0), velocity=(1.2, 0.0)) for k, (x, y) in enumerate(places[:count])]
        path = positions(simulate(room(humans, inner=inner, polygon=polygon, robot=Pose(7.0, -7.0)), 14.0))
        return [float(np.interp(-0.2, path[:, k, 0], path[:, k, 1])) for k in range(count)]

    (alone,), stream = at_the_end(1), at_the_end(24)
    assert alone > 0.5
    assert np.percentile(stream, 90) - np.percentile(stream, 10) > 0.9


def test_people_beside_an_opening_enter_the_stream_that_passes() -> None:
    """A stream enters a corridor 1.8 m wide; two people start beside its entrance, and nobody stays there."""
    polygon = ((-14.0, -4.0), (10.0, -4.0), (10.0, 4.0), (-14.0, 4.0))
    ends = [((0.0, side * 0.9), (0.0, side * 4.0)) for side in (-1.0, 1.0)]
    inner = [Wall(*end) for end in ends] + [Wall((0.0, y), (9.0, y)) for y in (-0.9, 0.9)]
    places = [(-1.0 - 0.7 * (k // 3), 0.6 * (k % 3 - 1)) for k in range(48)] + [(-0.3, 1.3), (-0.3, -1.3)]
    humans = [going(k + 1, x, y, (8.0, 0.5 * y), exits=True, velocity=(1.0, 0.0)) for k, (x, y) in enumerate(places)]
    snapshots = simulate(room(humans, inner=inner, polygon=polygon, robot=Pose(-13.0, 3.0)), 20.0)
    beside = np.zeros(len(places))
    for snapshot in snapshots:
        x, y = snapshot.humans.position.T
        beside[snapshot.humans.id[(np.abs(x + 0.2) < 0.3) & (np.abs(y) > 0.8)] - 1] += 0.1
    assert beside.max() < 4.0, beside


def test_people_leave_at_a_place_that_is_taken_once_they_have_walked_past_it() -> None:
    taken = Human(1, Pose(3.0, 0.0))
    humans = [taken, going(2, -3.0, 0.0, (3.0, 0.0), exits=True), going(3, 3.0, -3.0, (3.0, 0.0), exits=True)]
    snapshots = simulate(room(humans, robot=CORNER), 12.0)
    assert snapshots[-1].humans.id.tolist() == [1]


@pytest.mark.usefixtures("no_deviations")
def test_people_walk_into_a_standing_robot_that_they_ignore_and_then_round_it() -> None:
    snapshots = simulate(room([going(1, -3.5, 0.0, (3.5, 0.0))], robot=Pose(0.5, 0.0)), 12.0)
    clearance = [s2.clearance(snapshot) for snapshot in snapshots]
    assert -0.02 < min(clearance) < 0.01
    before = positions(snapshots)[: int(np.argmin(clearance)), 0]
    assert np.abs(before[:, 1]).max() < 0.1
    assert positions(snapshots)[-1, 0, 0] > 3.0


def courses(preset: str, seed: int) -> tuple[Array, Array]:
    """Velocities, m/s, and unit vectors of the bodies, (T, N, 2), in 40 s of a preset; NaN for absent people."""
    scene = s2.generate(s2.load_scenario(preset), seed=seed)
    row = {human.id: k for k, human in enumerate(scene.humans)}
    velocity, body = np.full((2, 400, len(row), 2), np.nan)
    for tick, snapshot in enumerate(simulate(scene, 40.0)):
        present = [row[k] for k in snapshot.humans.id.tolist()]
        velocity[tick, present], body[tick, present] = snapshot.humans.velocity, snapshot.humans.direction
    return velocity, body


@pytest.fixture(scope="module")
def hall() -> list[tuple[Array, Array]]:
    return [courses("crowded-hall", seed) for seed in range(3)]


def test_walking_people_hardly_ever_turn_about(hall: list[tuple[Array, Array]]) -> None:
    """By more than 120 degrees within 1.6 s, at 0.6 m/s before and after; some do where the crowd shuts them in."""
    about, walked = 0, 0.0
    for velocity, _ in hall:
        speed = np.linalg.norm(velocity, axis=2)
        before, after = velocity[:-16], velocity[16:]
        both = speed[:-16] * speed[16:]
        turns = (speed[:-16] > 0.6) & (speed[16:] > 0.6) & ((before * after).sum(axis=2) < -0.5 * both)
        about += int((np.diff(turns.astype(int), axis=0, prepend=0) == 1).sum())
        walked += float((speed > 0.6).sum()) / 10.0
    assert walked > 1000.0
    assert about < walked / 100.0


def test_walking_people_face_where_they_walk(hall: list[tuple[Array, Array]]) -> None:
    slip = np.concatenate([slips(velocity, body) for velocity, body in hall])
    assert slip.mean() <= 0.02


def slips(velocity: Array, body: Array) -> Array:
    """Whether the body is more than 45 degrees off the course, for every person and tick at 0.6 m/s or more."""
    speed = np.linalg.norm(velocity, axis=2)
    is_off = (velocity * body).sum(axis=2) < math.sqrt(0.5) * speed
    return is_off[speed > 0.6]
