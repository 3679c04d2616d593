"""Pictures in sequence equal single pictures, although only parts of them are drawn anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pygame
import pytest
from hypothesis import given, strategies as st

from sonata2d.core.geometry import Pose
from sonata2d.core.snapshot import Contact
from sonata2d.view.canvas import PixelCanvas, TrackingCanvas
from sonata2d.view.draw import QUICK, backdrop, camera_for, picture
from sonata2d.view.film import paced
from sonata2d.view.layers import Layers
from sonata2d.view.legend import Legend
from sonata2d.view.sequence import PictureSequence, boxes_of, tiles_of
from sonata2d.view.trails import Trails

from .conftest import pixels, snapshot_at

SCALE = 61.3  # px/m, at which no corner of a shape is on the border of two pixels


def shown(scene):
    """Snapshots in which all pedestrians move, one leaves, and the robot makes contact and jumps."""
    episode = [snapshot_at(scene, tick, Pose(1.0 + 0.2 * tick, 0.5 + 0.1 * tick, 0.4 * tick)) for tick in range(6)]
    for tick, snapshot in enumerate(episode):
        snapshot.humans.state[:, :2] += 0.05 * tick
    episode[2] = replace(episode[2], contacts=(Contact("wall", 0, True, False),))
    episode[3] = replace(episode[3], humans=episode[3].humans.select(np.array([0, 1, 3])))
    return [*paced(episode, 0.05), snapshot_at(scene, 7, Pose(5.0, 2.0))]


@pytest.mark.parametrize(
    "layers",
    [
        Layers(),
        Layers(zones=True, velocities=True, ids=True, legend=True),
        Layers(gaze=False, links=False, goal=False, grid=False, caption=False),
    ],
)
def test_a_picture_does_not_depend_on_the_pictures_before_it(scene, layers):
    snapshots = shown(scene)
    legend = Legend.of(snapshots[:1], layers)
    sequence = PictureSequence(scene, scale=SCALE, layers=layers, legend=legend)
    camera = camera_for(scene, scale=SCALE)
    room = backdrop(scene, camera, layers, fine=QUICK)
    legends = []
    for k, snapshot in enumerate(snapshots):
        trails = Trails.of(snapshots[: k + 1]) if k % 2 else None
        drawn = sequence.draw(snapshot, trails=trails, outcome="goal" if k == 3 else None)
        without_legend = replace(layers, legend=False)
        again = picture(
            snapshot, camera=camera, layers=without_legend, room=room, trails=trails, outcome="goal" if k == 3 else None
        )
        above = again.get_height()
        assert (pixels(drawn)[:, :above] == pixels(again)).all()
        assert drawn.get_height() - above == legend.height(camera.size[0])
        legends.append(pixels(drawn)[:, above:])
    assert all((below == legends[0]).all() for below in legends)


@given(
    st.tuples(st.integers(16, 300), st.integers(16, 300)),
    st.lists(st.tuples(*[st.integers(0, 599)] * 2, *[st.integers(0, 200)] * 2), max_size=12),
    st.sampled_from([1, 2]),
)
def test_tiles_cover_all_boxes_once(size, places, scale):
    area = pygame.Rect(0, 0, scale * size[0], scale * size[1])
    boxes = [box for place in places if (box := pygame.Rect(place).clip(area)).size != (0, 0)]
    count = np.zeros(size, dtype=int)
    for box in boxes_of(tiles_of(boxes, size, scale), size):
        count[box.left : box.right, box.top : box.bottom] += 1
    assert count.max() <= 1
    for box in boxes:
        if box.width and box.height:
            low, high = (box.left // scale, box.top // scale), ((box.right - 1) // scale, (box.bottom - 1) // scale)
            assert (count[low[0] : high[0] + 1, low[1] : high[1] + 1] == 1).all()
    if not any(box.width and box.height for box in boxes):
        assert not count.any()


@pytest.mark.parametrize("fine", [1, 2])
def test_a_tracking_canvas_records_all_changed_pixels(fine):
    surface = pygame.Surface((120, 100), 0, 32)
    canvas = TrackingCanvas(surface, fine)
    shapes = [
        lambda: canvas.circle((255, 0, 0), (20.3, 30.7), 9.6),
        lambda: canvas.circle((255, 0, 0), (20.3, 30.7), 5.5),
        lambda: canvas.ring((255, 0, 0), (60.0, 50.0), 20.0, 3.0),
        lambda: canvas.polygon((255, 0, 0), [(10.5, 10.5), (60.2, 20.9), (30.0, 70.1)], (0, 255, 0), 3.0),
        lambda: canvas.stroke((255, 0, 0), [(10.5, 10.5), (60.2, 20.9), (30.0, 70.1)], 1.0),
        lambda: canvas.stroke((255, 0, 0), [(10.5, 10.5), (60.2, 20.9), (30.0, 70.1)], 6.0),
        lambda: canvas.steps([(255, 0, 0)], np.array([[[10.5, 10.5], [60.2, 20.9]]]), 6.0),
        lambda: canvas.wash((255, 0, 0), 100, [(-10.5, 10.5), (60.2, 20.9), (130.0, 70.1)]),
        lambda: canvas.rectangle((255, 0, 0), pygame.Rect(5, 6, 20, 30), (0, 255, 0)),
        lambda: canvas.text((255, 255, 255), "words", (60.0, 50.0), 20),
        lambda: canvas.circle((255, 0, 0), (-50.0, 30.7), 9.6),
    ]
    for draw in shapes:
        surface.fill((0, 0, 0))
        canvas.boxes.clear()
        draw()
        changed = pixels(surface).any(axis=2)
        for box in canvas.boxes:
            changed[max(box.left, 0) : box.right, max(box.top, 0) : box.bottom] = False
        assert not changed.any()


@pytest.mark.parametrize("fine", [1, 2])
@pytest.mark.parametrize("width", [1.0, 9.0])
def test_steps_equal_single_strokes(fine, width):
    path = [(10.4, 10.2), (50.1, 20.9), (30.0, 70.1), (30.0, 70.1), (90.2, 60.7)]
    steps = np.array([path[0:2], path[1:3], path[3:5], [(100.0, 10.0), (80.0, 5.0)]])
    colours = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0)]
    at_once, one_by_one = (PixelCanvas(pygame.Surface((120, 100), 0, 32), fine) for _ in range(2))
    at_once.steps(colours, steps, width)
    for colour, step in zip(colours, steps.tolist(), strict=True):
        one_by_one.stroke(colour, [tuple(point) for point in step], width)
    assert (pixels(at_once.surface) == pixels(one_by_one.surface)).all()
