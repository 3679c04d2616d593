import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pygame
import pytest

from sonata2d.core.entities import Door, Furniture, Human, Place, Queue, Wall
from sonata2d.core.geometry import Pose, Rectangle
from sonata2d.core.relations import ACTIVITIES, ACTIVITY
from sonata2d.errors import RenderError
from sonata2d.view.annotations import Label, draw_labels, value_text
from sonata2d.view.canvas import PixelCanvas
from sonata2d.view.draw import camera_for
from sonata2d.view.fonts import width_of
from sonata2d.view.graph_picture import Panel, network_picture
from sonata2d.view.layers import Layers
from sonata2d.view.legend import Legend
from sonata2d.view.palette import FLOOR, GOAL, PAPER, ROBOT, WALL, time_colour
from sonata2d.view.projection import Camera
from sonata2d.view.sheets import scene_picture
from sonata2d.view.stills import picture, snapshot_of
from sonata2d.view.trails import Trails

from .conftest import BARE, colour_at, pixels, snapshot_at


def centre_of(surface, colour):
    return np.argwhere((np.abs(pixels(surface) - colour) <= 2).all(axis=2)).mean(axis=0)


@pytest.fixture
def camera(scene):
    return Camera.fit(scene.polygon, scale=100.0)


def test_camera_points_y_up_and_inverts_its_transform():
    camera = Camera.fit([(0.0, 0.0), (4.0, 2.0)], size=(400, 300))
    (_, lower), (_, upper) = camera.to_pixels((1.0, 0.5)), camera.to_pixels((1.0, 1.5))
    assert upper < lower
    assert camera.to_world(camera.to_pixels((1.25, -0.75))) == pytest.approx((1.25, -0.75))
    assert camera.to_pixels((2.0, 1.0)) == pytest.approx((200, 150))
    assert camera.supersampled(3).to_pixels((2.0, 1.0)) == pytest.approx((600, 450))


@pytest.mark.parametrize("settings", [{"scale": 1e6}, {"scale": -3.0}, {"size": (5, 5)}, {"size": (99999, 500)}])
def test_camera_rejects_sizes_and_scales_out_of_range(settings):
    with pytest.raises(RenderError, match="choose another size, scale or view range"):
        Camera.fit([(0.0, 0.0), (4.0, 2.0)], **settings)


def test_every_entity_has_its_colour_at_its_position(scene, camera):
    drawn = picture(snapshot_at(scene), scale=100.0, layers=BARE)
    assert colour_at(drawn, camera, (0.9, 0.68)) == ROBOT
    assert colour_at(drawn, camera, scene.goal.position) == GOAL
    assert colour_at(drawn, camera, (2.5, 3.0)) == FLOOR
    assert colour_at(drawn, camera, (4.5, 4.0)) == PAPER
    assert colour_at(drawn, camera, (3.06, 3.5)) == WALL
    for human in scene.humans:
        activity = snapshot_at(scene).humans[human.id - 20].activity
        assert (
            colour_at(drawn, camera, Pose(*human.pose.position, human.pose.theta).to_world((0.0, 0.14)))
            == ACTIVITY[activity].colour
        )


def test_outer_walls_extend_outward_only(scene, camera):
    drawn = picture(snapshot_at(scene), scale=100.0, layers=BARE)
    assert colour_at(drawn, camera, (2.0, 0.03)) == FLOOR
    assert colour_at(drawn, camera, (2.0, -0.03)) == WALL


def test_a_partition_is_drawn_inside_the_room(scene, camera):
    partitioned = replace(scene, walls=(*scene.walls, Wall((2.4, 2.8), (2.4, 4.0))))
    assert colour_at(picture(snapshot_at(partitioned), scale=100.0, layers=BARE), camera, (2.4, 3.4)) == WALL


def test_a_robot_with_larger_y_is_higher_in_the_picture(scene, camera):
    lower, upper = (picture(snapshot_at(scene, robot=Pose(2.3, y)), scale=100.0, layers=BARE) for y in (2.6, 3.4))
    (x, y), (x_up, y_up) = centre_of(lower, ROBOT), centre_of(upper, ROBOT)
    assert x_up == pytest.approx(x, abs=0.5)
    assert y - y_up == pytest.approx(80.0, abs=0.5)


def test_the_robots_arrow_points_ahead(scene, camera):
    for theta in (0.0, 1.0, -2.5):
        pose = Pose(2.3, 3.4, theta)
        drawn = picture(snapshot_at(scene, robot=pose), scale=100.0, layers=BARE)
        assert colour_at(drawn, camera, pose.to_world((0.1, 0.0))) == PAPER
        assert colour_at(drawn, camera, pose.to_world((-0.18, 0.0))) == ROBOT


def test_a_mirrored_scene_gives_the_mirrored_picture(scene):
    room = replace(scene, polygon=((-2, -2), (2, -2), (2, 2), (-2, 2)), walls=(), furniture=(), interactions=())
    humans = tuple(Human(k, Pose(-1.2 + k, 0.7 * k - 0.5, 0.6 * k), 0.2) for k in range(3))
    mirrored = tuple(replace(h, pose=Pose(h.pose.x, -h.pose.y, -h.pose.theta)) for h in humans)
    original = snapshot_of(replace(room, humans=humans, robot=replace(room.robot, pose=Pose(-1, 1, 0.5))))
    reflected = snapshot_of(replace(room, humans=mirrored, robot=replace(room.robot, pose=Pose(-1, -1, -0.5))))
    layers = replace(BARE, gaze=True, goal=False)
    a, b = (pixels(picture(snapshot, size=(401, 401), layers=layers)) for snapshot in (original, reflected))
    assert np.abs(a - b[:, ::-1]).mean() < 0.6
    assert np.abs(a - b).mean() > 3.0


@pytest.mark.parametrize("radius", [0.15, 0.25])
def test_a_pedestrian_is_as_large_as_its_radius(scene, radius):
    alone = replace(scene, furniture=(), interactions=(), humans=(Human(5, Pose(2.0, 3.4), radius=radius),))
    present, absent = (
        pixels(picture(snapshot_of(s), scale=100.0, layers=BARE)) for s in (alone, replace(alone, humans=()))
    )
    width = np.ptp(np.flatnonzero((present != absent).any(axis=(1, 2)))) + 1
    assert width == pytest.approx(200 * radius, abs=2.5)


def test_a_pedestrian_that_ignores_the_robot_is_drawn_differently(scene):
    human = Human(5, Pose(2.0, 3.4), 0.2)
    drawn = [
        pixels(picture(snapshot_of(replace(scene, interactions=(), humans=(h,))), scale=100.0, layers=BARE))
        for h in (human, replace(human, reacts_to_robot=0.5), replace(human, reacts_to_robot=0.0))
    ]
    assert (drawn[0] == drawn[1]).all()
    assert (drawn[0] != drawn[2]).any()


def test_an_absent_pedestrian_is_not_drawn(scene, camera):
    snapshot = snapshot_at(scene)
    snapshot = replace(snapshot, humans=snapshot.humans.select(np.delete(np.arange(len(scene.humans)), 2)))
    before, after = (picture(s, scale=100.0, layers=BARE) for s in (snapshot_at(scene), snapshot))
    place = scene.humans[2].pose.to_world((0.0, 0.14))
    assert colour_at(after, camera, place) == FLOOR != colour_at(before, camera, place)


def test_trails_darken_with_time(scene, camera, episode):
    drawn = picture(episode[-1], scale=100.0, layers=BARE, trails=Trails.of(episode))
    assert colour_at(drawn, camera, (1.02, 0.5)) == time_colour(1 / 11)
    assert sum(time_colour(0.0)) > sum(time_colour(0.5)) > sum(time_colour(1.0))


@pytest.mark.parametrize("layer", ["gaze", "links", "goal", "grid", "zones", "velocities", "ids"])
def test_each_layer_changes_the_picture(scene, layer):
    with_layer, without = (replace(BARE, **{"goal": False, layer: visible}) for visible in (True, False))
    a, b = (pixels(picture(snapshot_at(scene), size=(400, 300), layers=layers)) for layers in (with_layer, without))
    assert (a != b).any()


def test_size_is_exact(scene):
    assert picture(snapshot_at(scene), size=(320, 240)).get_size() == (320, 240)


def test_a_long_caption_does_not_cover_the_scale_bar(scene):
    long, short = (pixels(picture(snapshot_at(scene), size=(400, 300), caption=text)) for text in ("x" * 300, ""))
    assert (long[-100:] == short[-100:]).all()
    assert (long[:-140] != short[:-140]).any()


def test_a_sheet_holds_scenes_of_different_shapes(scene):
    wide = replace(scene, polygon=((0, 0), (9, 0), (9, 2), (0, 2)), walls=(), furniture=())
    sheet = scene_picture(scene, wide, scene, scale=20.0)
    assert sheet.get_width() == 2 * round(9.6 * 20) + 10
    assert centre_of(sheet, ROBOT).min() > 0
    with pytest.raises(RenderError, match="at least one scene"):
        scene_picture()


def test_initial_activities_follow_from_the_interactions(scene):
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


def test_each_pedestrian_has_its_own_path_colour_in_every_picture(scene, camera):
    positions = np.tile([human.pose.position for human in scene.humans], (6, 1, 1)).astype(float)
    positions[..., 0] += 0.1 * np.arange(6)[:, None]
    robot = np.tile((5.0, 1.0), (6, 1))
    trails = [Trails(0.1 * np.arange(n), robot[:n], positions[:n]) for n in (4, 6)]
    empty = replace(scene, humans=(), interactions=())
    ends = []
    for each in trails:
        drawn = picture(snapshot_of(empty), scale=100.0, layers=BARE, trails=each)
        ends.append([colour_at(drawn, camera, (x - 0.02, y)) for x, y in each.humans[-1].tolist()])
    assert ends[0] == ends[1]
    assert len({*ends[0]}) == len(scene.humans)


def test_zones_are_drawn_inside_the_room_only(scene):
    human = Human(5, Pose(0.5, 0.5), 0.2)
    near_corner = replace(scene, furniture=(), interactions=(), humans=(human,))
    layers = replace(BARE, zones=True, goal=False)
    with_zones, without = (
        picture(snapshot_of(near_corner), size=(700, 600), layers=replace(layers, zones=visible))
        for visible in (True, False)
    )
    camera = camera_for(near_corner, size=(700, 600))
    for place, is_tinted in (((1.2, 1.2), True), ((1.0, 0.05), True), ((0.5, -0.2), False), ((3.4, 2.8), False)):
        assert (colour_at(with_zones, camera, place) != colour_at(without, camera, place)) == is_tinted


def test_labels_do_not_hide_each_other(scene):
    boxes = []

    class Canvas(PixelCanvas):
        def rectangle(self, colour, box, edge=None):
            boxes.append(box.copy())

    surface = pygame.Surface((300, 300), 0, 32)
    labels = [Label(str(k), (150.0, 150.0 + k), 8.0) for k in range(4)]
    unlabelled = pygame.Rect(130, 160, 60, 60)  # below the labels' entities
    draw_labels(Canvas(surface), labels, 14, [unlabelled])
    assert len(boxes) == 4
    assert all(box.collidelist(boxes[k + 1 :]) < 0 for k, box in enumerate(boxes))
    assert unlabelled.collidelist(boxes) < 0


@pytest.mark.parametrize("centre", [(4.0, 150.0), (296.0, 150.0), (150.0, 4.0), (150.0, 296.0), (4.0, 4.0)])
def test_labels_of_objects_at_an_edge_lie_in_the_picture(centre):
    surface = pygame.Surface((300, 300), 0, 32)
    surface.fill((1, 2, 3))
    words = "person with many attributes"
    draw_labels(PixelCanvas(surface), [Label(words, centre, 8.0), Label(words, (-40.0, 150.0), 8.0)], 14)
    plate = pygame.mask.from_threshold(surface, (255, 255, 255), (90, 90, 90, 255)).get_bounding_rects()
    box = plate[0].unionall(plate)
    assert box.width >= width_of(words, 14)  # the whole label
    assert box.height < 20  # and only one: the other object is outside the picture


def test_ids_of_graph_nodes_at_the_same_place_do_not_hide_each_other(monkeypatch):
    boxes = {}
    write = PixelCanvas.text

    def noted(canvas, colour, words, place, *arguments):
        boxes[words] = write(canvas, colour, words, place, *arguments)
        return boxes[words]

    monkeypatch.setattr(PixelCanvas, "text", noted)
    nodes = [("object", "100", (0.0, 0.0)), ("object", "101", (0.0, 0.0)), ("human", "102", (0.0, 0.4)),
             ("wall", "", (5.0, 5.0))]  # fmt: skip
    network_picture([Panel("now", nodes, [], [])], "graph")
    ids = [boxes[words] for words in ("100", "101", "102")]
    assert all(box.collidelist(ids[k + 1 :]) < 0 for k, box in enumerate(ids))


def test_numbers_of_a_label_are_written_without_the_digits_of_rounding():
    assert value_text([0.1 + 0.2, -0.0, 2.760199999999378]) == "[0.3, 0, 2.7602]"
    assert value_text({"polite": True, "level": 3}) == "polite true, level 3"


def test_only_a_piece_that_is_longer_than_wide_is_drawn_with_a_front(scene):
    def drawn(size, theta):
        piece = Furniture(1, "crate", Pose(1.5, 1.5, theta), Rectangle(*size))
        return pixels(picture(snapshot_of(replace(scene, furniture=(piece,), humans=(), interactions=())), scale=100.0))

    for size, has_front in (((1.0, 0.6), True), ((0.8, 0.8), False), ((0.6, 1.0), False)):
        assert (np.abs(drawn(size, 0.0) - drawn(size, math.pi)).max() > 20) == has_front


def test_doors_queues_and_places_are_drawn_where_they_are_and_explained(scene, camera):
    doors = (Door(1, Pose(2.0, 0.0, math.pi / 2), 1.0),)
    there = replace(
        scene, doors=doors, queues=(Queue(1, Pose(2.7, 3.7, math.pi / 2), 0.7, capacity=2),),
        places=(Place(1, 2.0, 3.0, 0.5),),
    )  # fmt: skip
    before, drawn = (picture(snapshot_at(s), scale=100.0, layers=BARE) for s in (scene, there))
    assert colour_at(before, camera, (2.0, -0.05)) == WALL
    assert colour_at(drawn, camera, (2.0, -0.02)) == FLOOR
    assert colour_at(drawn, camera, (1.2, -0.05)) == WALL
    for place in ((2.7, 3.7 - 0.13), (2.7, 3.0 + 0.12), (2.0 + 0.49, 3.02)):
        assert colour_at(before, camera, place) == FLOOR
        assert colour_at(drawn, camera, place) != FLOOR
    texts = [{entry.text for entry in Legend.of([snapshot_at(s)], Layers(legend=True)).entries} for s in (scene, there)]
    assert texts[1] - texts[0] == {"door", "queue", "place of interest"}


def test_of_a_sitting_pedestrian_the_legs_reach_out_of_the_outline(scene, camera):
    snapshot = snapshot_at(scene)
    index = np.where(np.arange(len(snapshot.humans)) == 2, ACTIVITIES.index("sitting"), snapshot.humans.activity_index)
    sitting = replace(snapshot, humans=replace(snapshot.humans, activity_index=index))
    human = scene.humans[2]
    foot = human.pose.to_world((1.7 * human.radius, 0.4 * human.radius))
    assert colour_at(picture(snapshot, scale=100.0, layers=BARE), camera, foot) == FLOOR
    assert colour_at(picture(sitting, scale=100.0, layers=BARE), camera, foot) != FLOOR
