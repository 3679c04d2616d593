import subprocess
import sys
from dataclasses import replace

import numpy as np
import pygame
import pytest

from sonata2d.core.devices import ImageRequest
from sonata2d.core.entities import Furniture, Human, Interaction
from sonata2d.core.geometry import Disc, Pose, Rectangle
from sonata2d.core.humans import BODY_X, BODY_Y, X, Y
from sonata2d.core.portable_math import unit_vector
from sonata2d.core.relations import ACTIVITY, AT_OBJECT
from sonata2d.errors import RenderError
from sonata2d.view.interpolation import between
from sonata2d.view.layers import Layers
from sonata2d.view.painter import Painter, image_of
from sonata2d.view.palette import FLOOR, GOAL, OUTSIDE, PAPER, ROBOT, WALL
from sonata2d.view.projection import Camera
from sonata2d.view.stills import picture, snapshot_of
from sonata2d.view.trails import Trails

from .conftest import BARE, colour_at, pixels, snapshot_at


def drawn(snapshot, size=(640, 480), **settings):
    surface = pygame.Surface(size, 0, 32)
    camera = Painter(snapshot.scene).draw(surface, snapshot, **{"layers": BARE} | settings)
    return surface, camera


@pytest.mark.parametrize("theta", [0.0, 0.7, 2.0, -2.9])
def test_a_rotated_camera_inverts_its_transform(theta):
    camera = Camera.behind((1.0, -2.0), unit_vector(theta), size=(640, 480), view_range=4.0)
    for point in ((0.0, 0.0), (3.5, -1.0), (1.0, -2.0)):
        assert camera.to_world(camera.to_pixels(point)) == pytest.approx(point)
        x, y = camera.to_pixels(point)
        assert camera.supersampled(2).to_pixels(point) == pytest.approx((2 * x, 2 * y))


@pytest.mark.parametrize("theta", [0.0, 1.2, -2.5])
def test_the_robots_direction_points_up_in_the_follow_view(theta):
    pose = Pose(1.0, -2.0, theta)
    camera = Camera.behind(pose.position, unit_vector(theta), size=(800, 600), view_range=5.0)
    x, y = camera.to_pixels(pose.position)
    assert (x, y) == pytest.approx((400.0, 0.72 * 600))
    assert camera.to_pixels(pose.to_world((5.0, 0.0))) == pytest.approx((400.0, 0.0))
    assert camera.to_pixels(pose.to_world((0.0, 1.0)))[0] < x
    assert camera.rotated(unit_vector(theta)) == pytest.approx((0.0, -1.0))


@pytest.mark.parametrize("settings", [{"view_range": 0.0}, {"view_range": -1.0}, {"size": (4, 600)}])
def test_a_camera_behind_the_robot_rejects_settings_out_of_range(settings):
    with pytest.raises(RenderError, match="choose another size, scale or view range"):
        Camera.behind((0.0, 0.0), (1.0, 0.0), **{"size": (800, 600)} | settings)


def test_zooming_in_stays_inside_the_visible_area():
    whole = Camera.fit([(0.0, 0.0), (4.0, 3.0)], size=(400, 300), margin=0.0)
    near = whole.zoomed(2.0, (0.0, 0.0))
    assert near.to_world((0.0, 300.0)) == pytest.approx((0.0, 0.0))
    assert near.to_world((400.0, 0.0)) == pytest.approx((2.0, 1.5))
    far = whole.zoomed(0.5, (0.0, 0.0))
    assert far.to_pixels((2.0, 1.5)) == pytest.approx((200.0, 150.0))


@pytest.mark.parametrize("view", ["follow", "top"])
def test_every_entity_has_its_colour_at_its_position(scene, view):
    snapshot = snapshot_at(scene, robot=Pose(2.3, 0.6, 0.5))
    surface, camera = drawn(snapshot, view=view)
    pose = snapshot.robot.pose
    assert colour_at(surface, camera, pose.to_world((-0.2, 0.0))) == ROBOT
    assert colour_at(surface, camera, pose.to_world((0.1, 0.0))) == PAPER
    assert colour_at(surface, camera, scene.goal.position) == GOAL
    assert colour_at(surface, camera, (2.0, 2.5)) == FLOOR
    assert colour_at(surface, camera, (3.06, 3.5)) == WALL
    assert colour_at(surface, camera, (4.5, 4.0)) == OUTSIDE
    for human in snapshot.humans:
        assert colour_at(surface, camera, human.pose.to_world((0.0, 0.14))) == ACTIVITY[human.activity].colour


def test_the_window_and_the_picture_are_nearly_equal(scene):
    snapshot = snapshot_at(scene, 3)
    surface, _ = drawn(snapshot, view="top")
    difference = np.abs(pixels(surface) - pixels(picture(snapshot, size=surface.get_size(), layers=BARE)))
    inside = np.abs(pixels(surface) - OUTSIDE).sum(axis=2) > 0
    assert difference[inside].mean() < 1.0


@pytest.mark.parametrize("theta", [0.0, 0.4, 1.3])
@pytest.mark.parametrize("size", [(640, 480), (900, 500)])
def test_a_picture_has_no_undrawn_part_and_the_robot_is_at_its_position(scene, theta, size):
    surface = pygame.Surface(size, 0, 32)
    camera = Painter(scene).draw(surface, snapshot_at(scene, robot=Pose(1.5, 1.0, theta)))
    assert pixels(surface).sum(axis=2).min() > 60
    robot = np.argwhere((np.abs(pixels(surface) - ROBOT) <= 2).all(axis=2)).mean(axis=0)
    assert robot == pytest.approx(camera.to_pixels((1.5, 1.0)), abs=2.0)


def test_a_picture_does_not_depend_on_earlier_pictures(scene):
    painter, first, second = Painter(scene), pygame.Surface((400, 300), 0, 32), pygame.Surface((400, 300), 0, 32)
    painter.draw(first, snapshot_at(scene, 4))
    painter.draw(
        second, snapshot_at(scene, 9), view="top", layers=Layers(caption=False, zones=True, ids=True, legend=True)
    )
    painter.draw(second, snapshot_at(scene, 4))
    assert (pixels(first) == pixels(second)).all()


@pytest.mark.parametrize("layer", ["gaze", "links", "goal", "grid", "zones", "velocities", "ids"])
def test_each_layer_changes_the_picture(scene, layer):
    with_layer, without = (replace(BARE, **{"goal": False, layer: visible}) for visible in (True, False))
    a, b = (pixels(drawn(snapshot_at(scene), view="top", layers=layers)[0]) for layers in (with_layer, without))
    assert (a != b).any()


def test_trails_show_past_paths(scene, episode):
    surface, camera = drawn(episode[-1], view="top", trails=Trails.of(episode))
    without, _ = drawn(episode[-1], view="top")
    assert colour_at(surface, camera, (1.3, 0.5)) != colour_at(without, camera, (1.3, 0.5)) == FLOOR
    assert colour_at(surface, camera, (1.3, 0.9)) == colour_at(without, camera, (1.3, 0.9))


@pytest.mark.parametrize("shape", [Rectangle(2.0, 1.4), Disc(0.6)])
def test_furniture_of_an_unknown_type_shows_its_name(scene, shape):
    def room(kind):
        furniture = (Furniture(1, kind, Pose(1.5, 3.0), shape),)
        return snapshot_of(replace(scene, furniture=furniture, humans=(), interactions=()))

    (bed, camera), (desk, _) = (drawn(room(kind), (900, 700), view="top") for kind in ("bed", "counter"))
    differ = np.argwhere((pixels(bed) != pixels(desk)).any(axis=2))
    assert len(differ) > 20
    assert differ.mean(axis=0) == pytest.approx(camera.to_pixels((1.5, 3.0)), abs=20.0)


def test_walls_block_the_field_of_view(scene):
    human = Human(5, Pose(3.0 - 0.3, 4.0, 0.0), 0.2)
    snapshot = snapshot_of(replace(scene, humans=(human,), interactions=(), furniture=()))
    for surface, camera in (
        drawn(snapshot, view="top", layers=replace(BARE, gaze=True)),
        drawn(snapshot, view="follow", layers=replace(BARE, gaze=True), zoom=0.5),
    ):
        assert colour_at(surface, camera, (3.4, 4.0)) == OUTSIDE
        assert colour_at(surface, camera, (2.95, 4.0)) != FLOOR


def test_shared_space_lies_between_a_pedestrian_and_its_object(scene):
    humans = (Human(5, Pose(1.0, 1.5), 0.2),)
    furniture = (Furniture(2, "plant", Pose(2.6, 1.5), Disc(0.2)),)
    alone = replace(scene, humans=humans, furniture=furniture, interactions=())
    joined = replace(alone, interactions=(Interaction(5, AT_OBJECT, 2),))
    one, two = (drawn(snapshot_at(s), view="top", layers=replace(BARE, zones=True)) for s in (alone, joined))
    assert colour_at(*one, (1.8, 1.6)) != colour_at(*two, (1.8, 1.6))
    assert colour_at(*one, (1.8, 2.4)) == colour_at(*two, (1.8, 2.4))


def test_interpolation_starts_and_ends_at_the_snapshots(episode):
    before, after = episode[0], episode[1]
    assert between(before, after, 0.0) is before
    assert between(before, after, 1.0) is after
    middle = between(before, after, 0.5)
    assert middle.time == pytest.approx(0.05)
    assert middle.robot.position == pytest.approx((1.05, 0.5))
    assert middle.tick == after.tick


@pytest.mark.parametrize(("start", "end", "middle"), [(3.0, -3.0, np.pi), (0.2, -0.4, -0.1), (1.0, 1.5, 1.25)])
def test_interpolated_directions_take_the_shorter_arc(scene, start, end, middle):
    before, after = (snapshot_at(scene, k, robot=Pose(1.0, 0.5, theta)) for k, theta in enumerate((start, end)))
    for snapshot, theta in ((before, start), (after, end)):
        snapshot.humans.state[:, BODY_X : BODY_Y + 1] = unit_vector(theta)
    half = between(before, after, 0.5)
    assert half.robot.direction == pytest.approx(unit_vector(middle), abs=1e-9)
    assert half.humans.direction == pytest.approx(np.tile(unit_vector(middle), (6, 1)), abs=1e-9)
    third = between(before, after, 1 / 3)
    assert np.hypot(*third.humans.direction.T) == pytest.approx(1.0)
    assert np.hypot(*third.humans.gaze.T) == pytest.approx(1.0)


def test_absent_pedestrians_stay_absent_and_reentering_ones_are_not_interpolated(scene):
    before, after = snapshot_at(scene, 0), snapshot_at(scene, 1)
    after.humans.state[2] = np.nan
    after.humans.state[3, X : Y + 1] += 4.0
    state = between(before, after, 0.4).humans.state
    assert np.isnan(state[2]).all()
    assert np.isfinite(state[[0, 1, 3]]).all()
    assert state[3, X : Y + 1] == pytest.approx(after.humans.state[3, X : Y + 1])


@pytest.mark.parametrize("view", ["follow", "top"])
def test_an_image_is_an_array_of_the_requested_size(scene, view):
    snapshot = snapshot_at(scene)
    image = image_of(snapshot, ImageRequest(200, 90, view=view))
    assert image.shape == (90, 200, 3)
    assert image.dtype == np.uint8
    assert image.flags.c_contiguous
    assert image.flags.writeable
    image[:] = 0
    assert image_of(snapshot, ImageRequest(200, 90, view=view)).any()


def test_an_image_is_rgb_with_the_robot_below_its_centre(scene):
    image = image_of(snapshot_at(scene), ImageRequest(400, 300)).astype(int)
    rows, columns = np.nonzero((np.abs(image - ROBOT) <= 2).all(axis=2))
    assert rows.mean() == pytest.approx(0.72 * 300, abs=3)
    assert columns.mean() == pytest.approx(200, abs=3)


def test_an_image_covers_the_requested_range(scene):
    snapshot = snapshot_at(scene, robot=Pose(1.0, 0.6, 0.0))
    images = [image_of(snapshot, ImageRequest(1200, 900, view_range=view_range)) for view_range in (3.0, 6.0)]
    areas = [(np.abs(image.astype(int) - ROBOT) <= 2).all(axis=2).sum() for image in images]
    assert areas[0] == pytest.approx(4 * areas[1], rel=0.15)


@pytest.mark.parametrize(
    "settings", [{"width": 3}, {"height": 10**5}, {"view_range": 0.0}, {"view_range": float("nan")}, {"view": "side"}]
)
def test_an_impossible_image_request_gives_a_message_of_one_line(scene, settings):
    with pytest.raises(RenderError) as error:
        image_of(snapshot_at(scene), ImageRequest(**settings))
    assert "\n" not in str(error.value)


def test_images_of_many_scenes_are_not_mixed_up(scene):
    scenes = [replace(scene, goal=replace(scene.goal, x=0.5 + 0.4 * k)) for k in range(8)]
    request = ImageRequest(200, 150, view="top")
    first = [image_of(snapshot_at(s), request) for s in scenes]
    again = [image_of(snapshot_at(s), request) for s in scenes]
    assert all((a == b).all() for a, b in zip(first, again, strict=True))
    assert all((a != first[0]).any() for a in first[1:])


def test_an_image_needs_no_display(tmp_path):
    code = (
        "import pygame, sonata2d as s2\n"
        "from sonata2d.core.devices import ImageRequest\n"
        "from sonata2d.view import image_of, snapshot_of\n"
        "snapshot = snapshot_of(s2.generate(s2.ScenarioConfig(), seed=1))\n"
        "assert image_of(snapshot, ImageRequest()).std() > 5\n"
        "assert not pygame.display.get_init()\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path, env={"SDL_VIDEODRIVER": "no such driver"})
