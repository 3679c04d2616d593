import subprocess
import sys
from dataclasses import replace

import numpy as np
import pygame
import pytest

from sonata2d.core.entities import Human, Wall
from sonata2d.core.geometry import Pose
from sonata2d.errors import RenderError
from sonata2d.view.camera import Camera
from sonata2d.view.draw import Layers, backdrop, picture
from sonata2d.view.palette import ACTIVITY, FLOOR, GOAL, PAPER, ROBOT, WALL, time_colour
from sonata2d.view.sheet import scene_picture, snapshot_of
from sonata2d.view.trails import Trails

from .conftest import look

BARE = Layers(gaze=False, links=False, grid=False, caption=False)


def colour_at(surface, camera, point):
    x, y = camera.to_pixels(point)
    return tuple(surface.get_at((int(x), int(y))))[:3]


def pixels(surface):
    return pygame.surfarray.array3d(surface).astype(int)


def centre_of(surface, colour):
    return np.argwhere((np.abs(pixels(surface) - colour) <= 2).all(axis=2)).mean(axis=0)


@pytest.fixture
def camera(scene):
    return Camera.fit(scene.polygon, scale=100.0)


def test_camera_puts_up_at_the_top_and_goes_back():
    camera = Camera.fit([(0.0, 0.0), (4.0, 2.0)], size=(400, 300))
    (_, low), (_, high) = camera.to_pixels((1.0, 0.5)), camera.to_pixels((1.0, 1.5))
    assert high < low
    assert camera.to_world(camera.to_pixels((1.25, -0.75))) == pytest.approx((1.25, -0.75))
    assert camera.to_pixels((2.0, 1.0)) == pytest.approx((200, 150))
    assert camera.finer(3).to_pixels((2.0, 1.0)) == pytest.approx((600, 450))


@pytest.mark.parametrize("asked", [{"scale": 1e6}, {"scale": -3.0}, {"size": (5, 5)}, {"size": (99999, 500)}])
def test_camera_refuses_what_is_no_picture(asked):
    with pytest.raises(RenderError, match="choose another size or scale"):
        Camera.fit([(0.0, 0.0), (4.0, 2.0)], **asked)


def test_everything_has_its_colour_at_its_place(scene, camera):
    drawn = picture(look(scene), camera=camera, layers=BARE)
    assert colour_at(drawn, camera, (0.9, 0.68)) == ROBOT
    assert colour_at(drawn, camera, scene.goal.position) == GOAL
    assert colour_at(drawn, camera, (2.5, 3.0)) == FLOOR
    assert colour_at(drawn, camera, (4.5, 4.0)) == PAPER
    assert colour_at(drawn, camera, (3.06, 3.5)) == WALL
    for human in scene.humans:
        activity = look(scene).humans[human.id - 20].activity
        assert (
            colour_at(drawn, camera, Pose(*human.pose.position, human.pose.theta).to_world((0.0, 0.14)))
            == ACTIVITY[activity]
        )


def test_walls_grow_outward_only(scene, camera):
    drawn = picture(look(scene), camera=camera, layers=BARE)
    assert colour_at(drawn, camera, (2.0, 0.03)) == FLOOR
    assert colour_at(drawn, camera, (2.0, -0.03)) == WALL


def test_a_partition_stands_within_the_room(scene, camera):
    parted = replace(scene, walls=(*scene.walls, Wall((2.4, 2.8), (2.4, 4.0))))
    assert colour_at(picture(look(parted), camera=camera, layers=BARE), camera, (2.4, 3.4)) == WALL


def test_up_in_the_world_is_up_in_the_picture(scene, camera):
    low, high = (picture(look(scene, robot=Pose(2.3, y)), camera=camera, layers=BARE) for y in (2.6, 3.4))
    (x, y), (x_up, y_up) = centre_of(low, ROBOT), centre_of(high, ROBOT)
    assert x_up == pytest.approx(x, abs=0.5)
    assert y - y_up == pytest.approx(80.0, abs=0.5)


def test_the_robots_arrow_points_ahead(scene, camera):
    for theta in (0.0, 1.0, -2.5):
        pose = Pose(2.3, 3.4, theta)
        drawn = picture(look(scene, robot=pose), camera=camera, layers=BARE)
        assert colour_at(drawn, camera, pose.to_world((0.1, 0.0))) == PAPER
        assert colour_at(drawn, camera, pose.to_world((-0.18, 0.0))) == ROBOT


def test_a_mirrored_scene_gives_the_mirrored_picture(scene):
    room = replace(scene, polygon=((-2, -2), (2, -2), (2, 2), (-2, 2)), walls=(), furniture=(), interactions=())
    humans = tuple(Human(k, Pose(-1.2 + k, 0.7 * k - 0.5, 0.6 * k), 0.2) for k in range(3))
    mirrored = tuple(replace(h, pose=Pose(h.pose.x, -h.pose.y, -h.pose.theta)) for h in humans)
    one = snapshot_of(replace(room, humans=humans, robot=replace(room.robot, pose=Pose(-1, 1, 0.5))))
    two = snapshot_of(replace(room, humans=mirrored, robot=replace(room.robot, pose=Pose(-1, -1, -0.5))))
    layers = replace(BARE, gaze=True, goal=False)
    a, b = (pixels(picture(snapshot, size=(401, 401), layers=layers)) for snapshot in (one, two))
    assert np.abs(a - b[:, ::-1]).mean() < 0.6
    assert np.abs(a - b).mean() > 3.0


@pytest.mark.parametrize("radius", [0.15, 0.25])
def test_a_person_looks_as_large_as_their_radius(scene, camera, radius):
    alone = replace(scene, furniture=(), interactions=(), humans=(Human(5, Pose(2.0, 3.4), radius=radius),))
    here, gone = (
        pixels(picture(snapshot_of(one), camera=camera, layers=BARE)) for one in (alone, replace(alone, humans=()))
    )
    width = np.ptp(np.flatnonzero((here != gone).any(axis=(1, 2)))) + 1
    assert width == pytest.approx(200 * radius, abs=2.5)


def test_who_ignores_the_robot_looks_different(scene, camera):
    person = Human(5, Pose(2.0, 3.4), 0.2)
    alike = [
        pixels(picture(snapshot_of(replace(scene, interactions=(), humans=(h,))), camera=camera, layers=BARE))
        for h in (person, replace(person, reacts_to_robot=0.5), replace(person, reacts_to_robot=0.0))
    ]
    assert (alike[0] == alike[1]).all()
    assert (alike[0] != alike[2]).any()


def test_who_is_absent_is_not_drawn(scene, camera):
    snapshot = look(scene)
    snapshot = replace(snapshot, humans=snapshot.humans.only(np.delete(np.arange(len(scene.humans)), 2)))
    here, there = (picture(s, camera=camera, layers=BARE) for s in (look(scene), snapshot))
    place = scene.humans[2].pose.to_world((0.0, 0.14))
    assert colour_at(there, camera, place) == FLOOR != colour_at(here, camera, place)


def test_trails_lead_from_pale_to_dark(scene, camera, episode):
    drawn = picture(episode[-1], camera=camera, layers=BARE, trails=Trails.of(episode))
    assert colour_at(drawn, camera, (1.02, 0.5)) == time_colour(1 / 11)
    assert sum(time_colour(0.0)) > sum(time_colour(0.5)) > sum(time_colour(1.0))


@pytest.mark.parametrize("layer", ["gaze", "links", "goal", "grid", "zones", "velocities", "ids"])
def test_each_layer_shows(scene, layer):
    with_it, without = (replace(BARE, **{"goal": False, layer: shown}) for shown in (True, False))
    a, b = (pixels(picture(look(scene), size=(400, 300), layers=layers)) for layers in (with_it, without))
    assert (a != b).any()


def test_size_is_kept_and_the_room_may_be_drawn_before(scene, camera):
    assert picture(look(scene), size=(320, 240)).get_size() == (320, 240)
    layers = Layers()
    room = backdrop(scene, camera, layers)
    for _ in range(2):
        again = picture(look(scene, 3), camera=camera, layers=layers, room=room)
        assert (pixels(again) == pixels(picture(look(scene, 3), camera=camera, layers=layers))).all()


def test_a_long_caption_leaves_the_scale_bar_free(scene):
    long, short = (pixels(picture(look(scene), size=(400, 300), caption=text)) for text in ("x" * 300, ""))
    assert (long[-100:] == short[-100:]).all()
    assert (long[:-140] != short[:-140]).any()


def test_a_sheet_holds_scenes_of_different_shape(scene):
    wide = replace(scene, polygon=((0, 0), (9, 0), (9, 2), (0, 2)), walls=(), furniture=())
    sheet = scene_picture(scene, wide, scene, scale=20.0)
    assert sheet.get_width() == 2 * round(9.6 * 20) + 10
    assert centre_of(sheet, ROBOT).min() > 0
    with pytest.raises(RenderError, match="no scene"):
        scene_picture()


def test_a_scene_starts_with_what_its_relations_say(scene):
    snapshot = snapshot_of(scene)
    assert [human.activity for human in snapshot.humans] == [
        "talking", "talking", "walking", "standing", "using", "standing",
    ]  # fmt: skip
    assert snapshot.tick == 0
    assert not snapshot.humans.velocity.any()


def test_drawing_needs_no_display_and_prints_nothing(tmp_path):
    code = "import sonata2d.view, pygame; assert not pygame.display.get_init(); assert not pygame.font.get_init()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout == done.stderr == ""
