"""Sensors of controllers: ranges against separate ray casting, errors, timing, and what a partial controller sees."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents import Camera, FieldOfView, Lidar, Odometry, PeopleDetector, Sensor, costmap
from sonata2d.agents.sensors.base import SensorNoise, SensorSuite
from sonata2d.core.entities import Furniture, Wall
from sonata2d.core.geometry import Disc, Polygon, Pose, Rectangle, Twist
from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.datasets import verify
from sonata2d.errors import ControllerError
from sonata2d.sim.driver import renderer_for

from ..conftest import room, walker


def furnished(seed: int, boxes: int = 0) -> Scene:
    """A room with people, walls, furniture of all outlines, and small boxes at random places."""
    draw = np.random.default_rng(seed)
    shapes = [Rectangle(0.8, 0.5), Disc(0.3), Polygon(((0.5, 0.0), (-0.3, 0.4), (-0.3, -0.4))), Rectangle(0.4, 1.2)]
    places = draw.uniform(-3.4, 3.4, (12, 3))
    furniture = [Furniture(20 + k, "box", Pose(*places[k].tolist()), shape) for k, shape in enumerate(shapes)]
    furniture += [
        Furniture(30 + k, "box", Pose(*draw.uniform(-3.9, 3.9, 3).tolist()), Rectangle(0.1, 0.1)) for k in range(boxes)
    ]
    humans = [walker(1 + k, *places[4 + k].tolist(), breadth=0.3 + 0.05 * k) for k in range(5)]
    inner = [Wall((2.0, -3.0), (2.5, 1.0)), Wall((-1.0, 2.0), (1.0, 2.0))]
    return room(humans, furniture, inner=inner, robot=Pose(*places[9].tolist()))


def noise_of(seed: int = 0) -> SensorNoise:
    return SensorNoise(room(seed=seed), "test", 0)


def cast(snapshot: Snapshot, origin: Array, angle: Array, maximum: float) -> Array:
    """Ranges of rays by steps of 1 mm: the first point inside an outline or across a wall, (R,), m."""
    steps = np.arange(0.0, maximum, 1e-3)
    directions = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    points = origin + steps[None, :, None] * directions[:, None]
    is_hit = np.zeros(points.shape[:2], dtype=bool)
    for human in snapshot.humans:
        c, s = math.cos(human.pose.theta), math.sin(human.pose.theta)
        offset = points - np.array(human.pose.position)
        ahead, left = offset @ (c, s), offset @ (-s, c)
        beyond = np.maximum(np.abs(left) - human.shoulder, 0.0)
        is_hit |= np.hypot(ahead, beyond) <= human.radius
    for thing in snapshot.objects:
        c, s = thing.pose.direction
        offset = points - np.array(thing.pose.position)
        ahead, left = offset @ (c, s), offset @ (-s, c)
        corners = np.array(thing.shape.core)
        if len(corners) == 1:
            is_hit |= np.hypot(ahead, left) <= thing.shape.circumradius
        else:
            sides = np.roll(corners, -1, axis=0) - corners
            inside = [u * (left - a[1]) - v * (ahead - a[0]) >= 0.0 for a, (u, v) in zip(corners, sides, strict=True)]
            is_hit |= np.logical_and.reduce(inside)
    ranges = np.where(is_hit.any(axis=1), steps[np.argmax(is_hit, axis=1)], maximum)
    for wall in snapshot.walls:
        a, b = np.array(wall.start), np.array(wall.end)
        along = b - a
        cross = directions[:, 0] * along[1] - directions[:, 1] * along[0]
        offset = a - origin
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (offset[0] * along[1] - offset[1] * along[0]) / cross
            part = (offset[0] * directions[:, 1] - offset[1] * directions[:, 0]) / cross
        meets = (t >= 0.0) & (part >= 0.0) & (part <= 1.0)
        ranges = np.where(meets, np.minimum(ranges, np.where(meets, t, np.inf)), ranges)
    return ranges


@pytest.mark.parametrize(("seed", "boxes"), [(0, 0), (1, 0), (2, 0), (3, 0), (4, 60)])
def test_ranges_equal_those_of_separate_ray_casting(seed: int, boxes: int) -> None:
    scene = furnished(seed, boxes)
    snapshot = s2.Episode(scene).observe()
    lidar = Lidar(rays=250, distance=6.0, mount=(0.2, -0.1), heading=0.3)
    reading = lidar.start(scene)(snapshot, noise_of())
    pose = snapshot.robot.pose
    expected = cast(snapshot, np.array(pose.to_world((0.2, -0.1))), pose.theta + reading.angles, 6.0)
    found = np.where(np.isfinite(reading.ranges), reading.ranges, 6.0)
    is_inside = expected < lidar.nearest  # the scanner may stand in a piece of furniture
    np.testing.assert_allclose(found[~is_inside], expected[~is_inside], atol=2e-3)
    hits = np.isfinite(reading.ranges)
    places = reading.points - (0.2, -0.1)
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), reading.ranges[hits], atol=1e-12)
    for rays in (1, 2, 5, 10):  # wide angles between rays
        few = Lidar(rays=rays, distance=6.0, mount=(0.2, -0.1), heading=0.3).start(scene)(snapshot, noise_of())
        same = reading.ranges[:: 250 // rays] if rays > 1 else reading.ranges[125:126]
        np.testing.assert_allclose(few.ranges, same, atol=1e-9)


def test_a_field_of_view_spreads_the_rays_from_right_to_left() -> None:
    scene = furnished(0)
    reading = Lidar(rays=5, angle=math.pi).start(scene)(s2.Episode(scene).observe(), noise_of())
    assert reading.angles == pytest.approx([-math.pi / 2, -math.pi / 4, 0.0, math.pi / 4, math.pi / 2])


def test_legs_are_narrower_than_bodies_and_swing() -> None:
    human = walker(1, 2.0, 0.0, math.pi, velocity=(-1.2, 0.0))
    scene = room([human], robot=Pose(0.0, 0.0))
    episode = s2.Episode(scene)
    counts: dict[str, list[int]] = {"bodies": [], "legs": []}
    for _ in range(6):
        for sees, found in counts.items():
            reading = Lidar(rays=720, sees=sees).start(scene)(episode.observe(), noise_of())  # type: ignore[arg-type]
            found.append(int((reading.ranges < 3.0).sum()))
        episode.apply(Twist())
    assert max(counts["legs"]) < min(counts["bodies"])
    assert len(set(counts["legs"])) > 1


def test_noise_and_dropouts_have_the_given_size_and_the_same_bits() -> None:
    scene = furnished(1)
    snapshot = s2.Episode(scene).observe()
    exact = Lidar(rays=2000).start(scene)(snapshot, noise_of()).ranges
    noisy = Lidar(rays=2000, noise=0.03, dropout=0.1)
    ranges, again = (noisy.start(scene)(snapshot, noise_of(seed)).ranges for seed in (5, 5))
    np.testing.assert_array_equal(ranges, again)
    lost = np.isnan(ranges)
    assert lost.mean() == pytest.approx(0.1, abs=0.02)
    errors = (ranges - exact)[np.isfinite(ranges) & (exact > 0.2)]
    short = Lidar(rays=2000, noise=0.1, distance=2.0).start(scene)(snapshot, noise_of())
    assert short.ranges[np.isfinite(short.ranges)].max() == 2.0
    assert Lidar(angle=float(np.float32(2.0 * math.pi))).start(scene)(snapshot, noise_of()).angles[1] > -math.pi
    assert errors.std() == pytest.approx(0.03, rel=0.1)
    assert abs(errors.mean()) < 0.004


def test_normals_are_normal() -> None:
    values = noise_of().normals(20_000)
    assert abs(values.mean()) < 0.03
    assert values.std() == pytest.approx(1.0, abs=0.02)
    assert np.mean(np.abs(values) < 1.0) == pytest.approx(0.6827, abs=0.015)


class Watcher(s2.Controller):
    """Keeps the readings of each tick."""

    def __init__(self, *sensors: Sensor, partial: bool = False) -> None:
        self.sensors, self.partial = sensors, partial
        self.seen: list[Any] = []

    def act(self, snapshot: Snapshot) -> Twist:
        self.seen.append(snapshot.sensors)
        return Twist(0.4, 0.0, 0.5 * math.sin(snapshot.tick / 5))


def watched(*sensors: Sensor, scene: Scene | None = None, ticks: int = 40) -> tuple[list[Any], s2.Episode]:
    controller = Watcher(*sensors)
    episode = s2.Episode(scene or s2.generate("sonata-2020", 4), controller)
    for _ in range(ticks):
        episode.step()
    return controller.seen, episode


def test_rate_and_latency_decide_which_measurement_is_read() -> None:
    seen, _ = watched(Lidar(rays=4, rate=2.5, latency=0.2), Odometry())
    ticks = [None if readings.lidar is None else readings.lidar.tick for readings in seen]
    assert ticks[:11] == [None, None, 0, 0, 0, 0, 4, 4, 4, 4, 8]
    assert [readings.odometry.tick for readings in seen] == list(range(40))


def test_odometry_without_errors_is_the_truth_and_with_errors_drifts() -> None:
    exact, drifting = Odometry("exact", translation=0.0, rotation=0.0, skid=0.0), Odometry(translation=0.1, skid=0.2)
    seen, episode = watched(exact, drifting, ticks=100)
    before = s2.Episode(episode.scene, past=episode.past)
    errors = []
    for readings in seen:
        true = before.snapshot().robot.pose
        assert readings.exact.pose.position == pytest.approx(true.position, abs=1e-9)
        errors.append(math.dist(readings.odometry.pose.position, true.position))
        before.step()
    assert errors[0] == 0.0
    assert errors[-1] > 0.02


def test_odometry_follows_ticks_that_are_replayed() -> None:
    """A branch reads the same as the episode itself."""
    sensor = Odometry(translation=0.1, rotation=0.1)
    seen, episode = watched(sensor, ticks=30)
    controller = Watcher(sensor)
    branch = episode.branch(20, controller)
    branch.step()
    assert controller.seen[0].odometry == seen[20].odometry


def test_the_detector_misses_and_invents_people_as_often_as_it_is_told() -> None:
    humans = [walker(1 + k, 2.0, -1.5 + k, behaviour="standing") for k in range(4)]
    scene = room(humans, robot=Pose(-2.0, 0.0))
    snapshot = s2.Episode(scene).observe()
    detector = PeopleDetector(angle=2.0, misses=0.2, false_alarms=0.3, noise=0.1)
    measure = detector.start(scene)
    readings = [measure(snapshot, noise_of(seed)) for seed in range(600)]
    expected = np.array([snapshot.robot.pose.to_local(human.pose.position) for human in snapshot.humans])
    counts, near = np.zeros(4), 0
    for reading in readings:
        assert (np.hypot(*reading.position.T) <= 8.0 + 0.6).all()
        distance = np.linalg.norm(reading.position[:, None] - expected[None], axis=2)
        counts += (distance < 0.45).any(axis=0)
        near += int((distance < 0.45).any(axis=1).sum())
    assert counts / 600 == pytest.approx(np.full(4, 0.8), abs=0.06)
    invented = sum(len(reading.position) for reading in readings) - near
    assert invented / 600 == pytest.approx(0.3, abs=0.08)


def test_walls_and_people_hide_people_and_furniture_does_not() -> None:
    humans = [walker(1, 0.0, 0.0), walker(2, 2.0, 0.0), walker(3, 0.0, 2.0), walker(4, 1.0, -2.0), walker(5, -3.4, 1.0)]
    table = Furniture(9, "table", Pose(-1.0, 1.0, 0.7), Rectangle(1.0, 0.4))
    scene = room(humans, [table], inner=[Wall((-0.5, -3.0), (-0.5, -0.6))], robot=Pose(-2.0, 0.0))
    snapshot = s2.Episode(scene).observe()

    def seen(**settings: Any) -> list[int]:
        reading = FieldOfView(**settings).start(scene)(snapshot, noise_of())
        return list(reading.humans.id.tolist())

    assert seen(angle=6.28) == [1, 3, 5]
    assert seen(angle=math.pi) == [1, 3]
    assert seen(angle=6.28, distance=1.9) == [5]
    assert seen(angle=6.28, occlusion=False) == [1, 2, 3, 4, 5]


def test_a_partial_controller_sees_its_sensors_only() -> None:
    class Curious(s2.Controller):
        partial, sensors = True, (Lidar(rays=8), Odometry())
        read: Callable[[Any], Any] = staticmethod(lambda snapshot: None)

        def reset(self, scene: Scene) -> None:
            assert (scene.humans, scene.furniture, scene.walls, scene.polygon) == ((), (), (), ())
            self.start = scene.robot.pose

        def act(self, snapshot: Any) -> Twist:
            assert snapshot.sensors.odometry.pose == self.start
            assert snapshot.goal.distance > 0.0
            assert snapshot.dt == 0.1
            assert snapshot.robot.body.radius == 0.3
            type(self).read(snapshot)
            return Twist()

        def label(self, snapshot: Snapshot, twist: Twist) -> Any:
            return {"people": len(snapshot.humans)}

    scene = s2.generate("sonata-2020", 2)
    frame = s2.Episode(scene, Curious()).step()
    assert frame is not None
    assert frame.label == {"people": len(scene.humans)}
    for name in ("humans", "walls", "objects", "scene", "contacts", "state", "interactions"):
        Curious.read = staticmethod(lambda snapshot, name=name: getattr(snapshot, name))
        with pytest.raises(ControllerError, match=f"snapshot.{name} is hidden"):
            s2.Episode(scene, Curious()).step()
    Curious.read = staticmethod(lambda snapshot: snapshot.robot.position)
    with pytest.raises(ControllerError, match=r"robot\.position is hidden"):
        s2.Episode(scene, Curious()).step()
    Curious.read = staticmethod(lambda snapshot: snapshot.sensors.lidr)
    with pytest.raises(AttributeError, match="no sensor named 'lidr'; did you mean 'lidar'"):
        s2.Episode(scene, Curious()).step()


class Cautious(s2.Controller):
    """Drives on unless the lidar sees something ahead, with noise."""

    sensors, partial = (Lidar(rays=31, angle=1.0, noise=0.02), Odometry()), True

    def act(self, snapshot: Any) -> Twist:
        free = float(np.nanmin(snapshot.sensors.lidar.ranges))
        goal = snapshot.sensors.odometry.pose.to_local(snapshot.goal.position)
        return Twist(min(max(free - 0.6, 0.0), 0.8), 0.0, math.atan2(goal[1], goal[0]))


def test_data_sets_of_controllers_with_sensors_rerun_to_the_bit(tmp_path: Path) -> None:
    for workers in (1, 2):
        s2.generate_dataset(tmp_path / f"{workers}", "sonata-2020", Cautious(), episodes=4, workers=workers)
    one, two = ((tmp_path / f"{workers}" / "000003.json").read_bytes() for workers in (1, 2))
    assert one.partition(b'"software"')[0] == two.partition(b'"software"')[0]
    assert not list(verify(tmp_path / "1", replay=True, rerun=True, controller="tests.agents.test_sensors:Cautious"))


def test_a_labeller_sees_the_whole_snapshot_of_a_partial_driver() -> None:
    pair = s2.agents.Labelled(Cautious(), s2.SocialPlanner())
    frame = s2.Episode(s2.generate("sonata-2020", 2), pair).step()
    assert frame is not None
    assert len(frame.label) == 3
    with pytest.raises(ControllerError, match="has sensors, which a labeller does not receive"):
        s2.agents.Labelled(s2.SocialPlanner(), Cautious())


def test_a_camera_takes_the_picture_that_image_requests() -> None:
    scene, controller = s2.generate("sonata-2020", 2), Watcher(Camera(width=64, height=48))
    with pytest.raises(ControllerError, match="a camera needs a renderer"):
        s2.Episode(scene, controller)
    s2.Episode(scene, controller, renderer=s2.view.image_of).step()
    assert controller.seen[0].camera.image.shape == (48, 64, 3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Lidar(rays=0), "rays"),
        (lambda: Lidar(angle=7.0), "angle must be at most 2 pi, in rad, got 7.0"),
        (lambda: Lidar(dropout=1.5), "dropout is a probability, got 1.5"),
        (lambda: Lidar(sees="shoes"), "sees must be bodies or legs, got 'shoes'"),  # type: ignore[arg-type]
        (lambda: Lidar(rate=0.0), "rate must be positive, and at least 1e-06 1/s, got 0.0"),
        (lambda: Lidar("front lidar"), "attribute of snapshot.sensors, got 'front lidar'"),
        (lambda: Odometry(skid=-1.0), "skid"),
        (lambda: PeopleDetector(misses=2.0), "misses is a probability, got 2.0"),
        (lambda: PeopleDetector(angle=120), "angle must be at most 2 pi, in rad, got 120"),
        (lambda: FieldOfView(angle=120), "angle must be at most 2 pi, in rad, got 120"),
        (lambda: PeopleDetector(false_alarms=1e9), "false_alarms must be at most 1000"),
        (lambda: Lidar(180), "attribute of snapshot.sensors, got 180"),  # type: ignore[arg-type]
        (lambda: Lidar(nearest=20.0), "nearest must be below distance, got 20.0 and 10.0"),
        (lambda: Camera(width=0), "width"),
        (lambda: Camera(height=64.5), "height"),  # type: ignore[arg-type]
        (lambda: Camera(view="front"), "view must be follow or top, got 'front'"),  # type: ignore[arg-type]
        (lambda: Camera(view_range=math.nan), "view_range"),
        (lambda: Lidar(latency=1e9), "latency must be at most 1e\\+06 s, got 1000000000.0"),
        (lambda: Lidar(heading=90), "heading must be within -2 pi and 2 pi, in rad, got 90"),
        (lambda: FieldOfView(occlusion="no"), "occlusion must be True or False, got 'no'"),  # type: ignore[arg-type]
    ],
)
def test_settings_of_sensors_are_checked(make: Callable[[], Sensor], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        make()


def test_sensors_need_different_names_and_their_own_class() -> None:
    scene = s2.generate("sonata-2020", 2)
    with pytest.raises(ControllerError, match="two sensors are named 'lidar'"):
        SensorSuite((Lidar(), Lidar(rays=8)), scene)
    with pytest.raises(ControllerError, match="sensors of a controller are objects such as Lidar"):
        SensorSuite((Lidar,), scene)  # type: ignore[arg-type]
    assert len(SensorSuite((Lidar(), Lidar("rear")), scene)) == 2


def test_a_costmap_marks_what_the_scan_meets_and_its_surroundings() -> None:
    scene = room(robot=Pose(2.0, 0.0))
    reading = Lidar(rays=720).start(scene)(s2.Episode(scene).observe(), noise_of())
    grid = costmap(reading, size=6.0, resolution=0.1, radius=0.3, inflation=0.8)
    ahead = np.stack((np.arange(0.05, 2.9, 0.1), np.full(29, 0.02)), axis=1)  # the wall is 2 m ahead
    cost = grid.at(ahead).tolist()
    assert 254 in cost
    at = cost.index(254)
    assert ahead[at, 0] == pytest.approx(2.0, abs=0.1)
    assert cost[at - 2] == 253
    assert 0 < cost[at - 5] < 253
    assert cost[at - 10] == 0
    assert cost[: at - 8] == sorted(cost[: at - 8])
    assert grid.at(np.array([[10.0, 0.0]])).tolist() == [0]
    small = costmap(reading, size=3.6, resolution=0.1, radius=0.3, inflation=0.8)  # ends 0.2 m before the wall
    wrong: Any
    for wrong in ([0.5, 0.0], [[0.5, 0.0, 0.0]], [[math.nan, 0.0]]):
        with pytest.raises(ValueError, match=r"points must be finite positions in rows, \(P, 2\)"):
            grid.at(wrong)
    for wrong in ({"radius": -0.3}, {"inflation": math.nan}, {"decay": -5.0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            costmap(reading, **wrong)
    assert small.at(np.array([[1.75, 0.02]]))[0] >= 250


def test_people_who_sit_are_seen() -> None:
    """Their own seat does not hide them, nor do tables: people are taller."""
    seen, sitting = 0, 0
    for seed in range(3):
        scene = s2.generate("lively", seed)
        episode = s2.Episode(scene)
        for _ in range(60):
            episode.apply(Twist())
        snapshot = episode.snapshot()
        reading = FieldOfView(angle=6.28, distance=30.0).start(scene)(snapshot, noise_of())
        everybody = FieldOfView(angle=6.28, distance=30.0, occlusion=False).start(scene)(snapshot, noise_of())
        seen += sum(human.activity == "sitting" for human in reading.humans)
        sitting += sum(human.activity == "sitting" for human in everybody.humans)
    assert sitting > 0
    assert seen > 0.5 * sitting


def test_human_like_and_its_inner_controller_share_sensors() -> None:
    controller = s2.HumanLike(Cautious())
    frame = s2.Episode(s2.generate("sonata-2020", 2), controller).step()
    assert frame is not None
    pytest.importorskip("gymnasium")
    from sonata2d.gym import SocialNavEnv, demonstrate

    with pytest.raises(ControllerError, match="has sensors, which demonstrations do not measure"):
        demonstrate(SocialNavEnv("sonata-2020"), Cautious(), seed=1, episodes=1)


def test_misuse_of_sensors_says_what_to_write() -> None:
    class One(Watcher):
        def __init__(self) -> None:
            super().__init__()
            self.sensors = Lidar()  # type: ignore[assignment]

    class PartialPlanner(s2.SocialPlanner):
        partial = True

    class Half(s2.StraightToGoal):
        partial = "yes"  # type: ignore[assignment]

    scene = s2.generate("sonata-2020", 2)
    with pytest.raises(ControllerError, match="partial of Half must be True or False, got 'yes'"):
        s2.Episode(scene, Half())
    with pytest.raises(ControllerError, match=r"write sensors = \(Lidar\(\),\)"):
        s2.Episode(scene, One(), renderer=renderer_for(One()))
    with pytest.raises(ControllerError, match="it cannot be partial"):
        s2.Episode(scene, PartialPlanner())
    with pytest.raises(ValueError, match=r"attribute of snapshot.sensors, got 'keys'"):
        Lidar("keys")
    with pytest.raises(ValueError, match=r"mount is a position \(x, y\)"):
        Lidar(mount=(1.0, 2.0, 3.0))  # type: ignore[arg-type]
