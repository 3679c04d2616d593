import subprocess
import sys
from dataclasses import replace

import numpy as np
import pygame
import pytest

from sonata2d.core.devices import ImageRequest
from sonata2d.core.entities import AT_OBJECT, Furniture, Human, Interaction
from sonata2d.core.geometry import Disc, Pose, Rectangle
from sonata2d.core.portable_math import unit_vector
from sonata2d.errors import RenderError
from sonata2d.view.camera import Camera
from sonata2d.view.draw import Layers, picture
from sonata2d.view.eye import image_of
from sonata2d.view.interpolation import between
from sonata2d.view.live import Painter
from sonata2d.view.palette import ACTIVITY, FLOOR, GOAL, OUTSIDE, PAPER, ROBOT, WALL
from sonata2d.view.sheet import snapshot_of
from sonata2d.view.trails import Trails

from .conftest import look

BARE = Layers(gaze=False, links=False, grid=False, caption=False)


def pixels(surface):
    return pygame.surfarray.array3d(surface).astype(int)


def drawn(snapshot, size=(640, 480), **how):
    surface = pygame.Surface(size, 0, 32)
    camera = Painter(snapshot.scene).draw(surface, snapshot, **{"layers": BARE} | how)
    return surface, camera


def colour_at(surface, camera, point):
    x, y = camera.to_pixels(point)
    return tuple(surface.get_at((int(x), int(y))))[:3]


@pytest.mark.parametrize("theta", [0.0, 0.7, 2.0, -2.9])
def test_a_turned_camera_goes_back_to_the_world(theta):
    camera = Camera.behind((1.0, -2.0), unit_vector(theta), size=(640, 480), reach=4.0)
    for point in ((0.0, 0.0), (3.5, -1.0), (1.0, -2.0)):
        assert camera.to_world(camera.to_pixels(point)) == pytest.approx(point)
        x, y = camera.to_pixels(point)
        assert camera.finer(2).to_pixels(point) == pytest.approx((2 * x, 2 * y))


@pytest.mark.parametrize("theta", [0.0, 1.2, -2.5])
def test_the_follow_view_looks_up_along_the_robots_heading(theta):
    pose = Pose(1.0, -2.0, theta)
    camera = Camera.behind(pose.position, unit_vector(theta), size=(800, 600), reach=5.0)
    x, y = camera.to_pixels(pose.position)
    assert (x, y) == pytest.approx((400.0, 0.72 * 600))
    assert camera.to_pixels(pose.to_world((5.0, 0.0))) == pytest.approx((400.0, 0.0))
    assert camera.to_pixels(pose.to_world((0.0, 1.0)))[0] < x
    assert camera.turned(unit_vector(theta)) == pytest.approx((0.0, -1.0))


@pytest.mark.parametrize("asked", [{"reach": 0.0}, {"reach": -1.0}, {"size": (4, 600)}])
def test_a_camera_behind_the_robot_refuses_what_is_no_picture(asked):
    with pytest.raises(RenderError, match="choose another size or reach"):
        Camera.behind((0.0, 0.0), (1.0, 0.0), **{"size": (800, 600)} | asked)


def test_zooming_in_keeps_to_what_the_whole_picture_saw():
    whole = Camera.fit([(0.0, 0.0), (4.0, 3.0)], size=(400, 300), margin=0.0)
    near = whole.nearer(2.0, (0.0, 0.0))
    assert near.to_world((0.0, 300.0)) == pytest.approx((0.0, 0.0))
    assert near.to_world((400.0, 0.0)) == pytest.approx((2.0, 1.5))
    far = whole.nearer(0.5, (0.0, 0.0))
    assert far.to_pixels((2.0, 1.5)) == pytest.approx((200.0, 150.0))


@pytest.mark.parametrize("view", ["follow", "top"])
def test_everything_has_its_colour_at_its_place(scene, view):
    snapshot = look(scene, robot=Pose(2.3, 0.6, 0.5))
    surface, camera = drawn(snapshot, view=view)
    pose = snapshot.robot.pose
    assert colour_at(surface, camera, pose.to_world((-0.2, 0.0))) == ROBOT
    assert colour_at(surface, camera, pose.to_world((0.1, 0.0))) == PAPER
    assert colour_at(surface, camera, scene.goal.position) == GOAL
    assert colour_at(surface, camera, (2.0, 2.5)) == FLOOR
    assert colour_at(surface, camera, (3.06, 3.5)) == WALL
    assert colour_at(surface, camera, (4.5, 4.0)) == OUTSIDE
    for human in snapshot.humans:
        assert colour_at(surface, camera, human.pose.to_world((0.0, 0.14))) == ACTIVITY[human.activity]


def test_the_window_and_the_picture_show_the_same(scene):
    snapshot = look(scene, 3)
    surface, camera = drawn(snapshot, view="top")
    apart = np.abs(pixels(surface) - pixels(picture(snapshot, camera=camera, layers=BARE)))
    inside = np.abs(pixels(surface) - OUTSIDE).sum(axis=2) > 0
    assert apart[inside].mean() < 1.0


@pytest.mark.parametrize("theta", [0.0, 0.4, 1.3])
@pytest.mark.parametrize("size", [(640, 480), (900, 500)])
def test_no_part_of_a_picture_is_left_black_and_the_robot_stays_where_it_is(scene, theta, size):
    surface = pygame.Surface(size, 0, 32)
    camera = Painter(scene).draw(surface, look(scene, robot=Pose(1.5, 1.0, theta)))
    assert pixels(surface).sum(axis=2).min() > 60
    robot = np.argwhere((np.abs(pixels(surface) - ROBOT) <= 2).all(axis=2)).mean(axis=0)
    assert robot == pytest.approx(camera.to_pixels((1.5, 1.0)), abs=2.0)


def test_a_picture_drawn_again_is_the_same_and_anothers_look_leaves_no_trace(scene):
    painter, first, second = Painter(scene), pygame.Surface((400, 300), 0, 32), pygame.Surface((400, 300), 0, 32)
    painter.draw(first, look(scene, 4))
    painter.draw(second, look(scene, 9), view="top", layers=Layers(caption=False, zones=True, ids=True, legend=True))
    painter.draw(second, look(scene, 4))
    assert (pixels(first) == pixels(second)).all()


@pytest.mark.parametrize("layer", ["gaze", "links", "goal", "grid", "zones", "velocities", "ids", "legend"])
def test_each_layer_shows(scene, layer):
    with_it, without = (replace(BARE, **{"goal": False, layer: shown}) for shown in (True, False))
    a, b = (pixels(drawn(look(scene), view="top", layers=layers)[0]) for layers in (with_it, without))
    assert (a != b).any()


def test_ways_show_where_somebody_went(scene, episode):
    surface, camera = drawn(episode[-1], view="top", trails=Trails.of(episode))
    without, _ = drawn(episode[-1], view="top")
    assert colour_at(surface, camera, (1.3, 0.5)) != colour_at(without, camera, (1.3, 0.5)) == FLOOR
    assert colour_at(surface, camera, (1.3, 0.9)) == colour_at(without, camera, (1.3, 0.9))


@pytest.mark.parametrize("shape", [Rectangle(2.0, 1.4), Disc(0.6)])
def test_an_unknown_thing_bears_its_name(scene, shape):
    def room(kind):
        things = (Furniture(1, kind, Pose(1.5, 3.0), shape),)
        return snapshot_of(replace(scene, furniture=things, humans=(), interactions=()))

    (bed, camera), (desk, _) = (drawn(room(kind), (900, 700), view="top") for kind in ("bed", "counter"))
    differ = np.argwhere((pixels(bed) != pixels(desk)).any(axis=2))
    assert len(differ) > 20
    assert differ.mean(axis=0) == pytest.approx(camera.to_pixels((1.5, 3.0)), abs=20.0)


def test_nobody_looks_through_a_wall(scene):
    human = Human(5, Pose(3.0 - 0.3, 4.0, 0.0), 0.2)
    snapshot = snapshot_of(replace(scene, humans=(human,), interactions=(), furniture=()))
    for surface, camera in (
        drawn(snapshot, view="top", layers=replace(BARE, gaze=True)),
        drawn(snapshot, view="follow", layers=replace(BARE, gaze=True), zoom=0.5),
    ):
        assert colour_at(surface, camera, (3.4, 4.0)) == OUTSIDE
        assert colour_at(surface, camera, (2.95, 4.0)) != FLOOR


def test_shared_space_lies_between_a_person_and_what_they_look_at(scene):
    humans = (Human(5, Pose(1.0, 1.5), 0.2),)
    things = (Furniture(2, "plant", Pose(2.6, 1.5), Disc(0.2)),)
    alone = replace(scene, humans=humans, furniture=things, interactions=())
    joined = replace(alone, interactions=(Interaction(5, AT_OBJECT, 2),))
    one, two = (drawn(look(s), view="top", layers=replace(BARE, zones=True)) for s in (alone, joined))
    assert colour_at(*one, (1.8, 1.6)) != colour_at(*two, (1.8, 1.6))
    assert colour_at(*one, (1.8, 2.4)) == colour_at(*two, (1.8, 2.4))


def test_between_ends_at_both_looks(episode):
    before, after = episode[0], episode[1]
    assert between(before, after, 0.0) is before
    assert between(before, after, 1.0) is after
    middle = between(before, after, 0.5)
    assert middle.time == pytest.approx(0.05)
    assert middle.robot.position == pytest.approx((1.05, 0.5))
    assert middle.tick == after.tick


@pytest.mark.parametrize(("start", "end", "middle"), [(3.0, -3.0, np.pi), (0.2, -0.4, -0.1), (1.0, 1.5, 1.25)])
def test_between_turns_the_short_way(scene, start, end, middle):
    before, after = (look(scene, k, robot=Pose(1.0, 0.5, theta)) for k, theta in enumerate((start, end)))
    for snapshot, theta in ((before, start), (after, end)):
        snapshot.humans.state[:, 4:6] = unit_vector(theta)
    half = between(before, after, 0.5)
    assert half.robot.direction == pytest.approx(unit_vector(middle), abs=1e-9)
    assert half.humans.direction == pytest.approx(np.tile(unit_vector(middle), (6, 1)), abs=1e-9)
    third = between(before, after, 1 / 3)
    assert np.hypot(*third.humans.direction.T) == pytest.approx(1.0)
    assert np.hypot(*third.humans.look.T) == pytest.approx(1.0)


def test_between_who_is_absent_stays_absent_and_who_leaps_arrives(scene):
    before, after = look(scene, 0), look(scene, 1)
    after.humans.state[2] = np.nan
    after.humans.state[3, :2] += 4.0
    state = between(before, after, 0.4).humans.state
    assert np.isnan(state[2]).all()
    assert np.isfinite(state[[0, 1, 3]]).all()
    assert state[3, :2] == pytest.approx(after.humans.state[3, :2])


@pytest.mark.parametrize("view", ["follow", "top"])
def test_an_image_is_an_array_of_the_asked_size(scene, view):
    snapshot = look(scene)
    image = image_of(snapshot, ImageRequest(200, 90, view=view))
    assert image.shape == (90, 200, 3)
    assert image.dtype == np.uint8
    assert image.flags.c_contiguous
    assert image.flags.writeable
    image[:] = 0
    assert image_of(snapshot, ImageRequest(200, 90, view=view)).any()


def test_an_image_shows_red_as_red_and_the_robot_below_the_middle(scene):
    image = image_of(look(scene), ImageRequest(400, 300)).astype(int)
    rows, columns = np.nonzero((np.abs(image - ROBOT) <= 2).all(axis=2))
    assert rows.mean() == pytest.approx(0.72 * 300, abs=3)
    assert columns.mean() == pytest.approx(200, abs=3)


def test_an_image_reaches_as_far_as_asked(scene):
    snapshot = look(scene, robot=Pose(1.0, 0.6, 0.0))
    seen = [
        (np.abs(image_of(snapshot, ImageRequest(1200, 900, reach=reach)).astype(int) - ROBOT) <= 2).all(axis=2).sum()
        for reach in (3.0, 6.0)
    ]
    assert seen[0] == pytest.approx(4 * seen[1], rel=0.15)


@pytest.mark.parametrize(
    "asked", [{"width": 3}, {"height": 10**5}, {"reach": 0.0}, {"reach": float("nan")}, {"view": "side"}]
)
def test_an_image_that_cannot_be_is_told_in_one_line(scene, asked):
    with pytest.raises(RenderError) as told:
        image_of(look(scene), ImageRequest(**asked))
    assert "\n" not in str(told.value)


def test_images_of_many_scenes_are_each_their_own(scene):
    scenes = [replace(scene, goal=replace(scene.goal, x=0.5 + 0.4 * k)) for k in range(8)]
    request = ImageRequest(200, 150, view="top")
    first = [image_of(look(one), request) for one in scenes]
    again = [image_of(look(one), request) for one in scenes]
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
