"""Pictures of a film look like single pictures, and do not depend on each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pygame
import pytest

from sonata2d.core.geometry import Pose
from sonata2d.core.snapshot import Contact
from sonata2d.view.canvas import PixelCanvas
from sonata2d.view.draw import camera_for
from sonata2d.view.film import FilmPainter, _sampled
from sonata2d.view.layers import Layers
from sonata2d.view.legend import Legend
from sonata2d.view.stills import picture
from sonata2d.view.trails import Trails

from .conftest import pixels, snapshot_at

LAYERS = [
    Layers(),
    Layers(zones=True, velocities=True, ids=True, legend=True),
    Layers(gaze=False, links=False, goal=False, grid=False, caption=False),
]


def shown(scene):
    """Snapshots in which all pedestrians move, one leaves, and the robot makes contact and jumps."""
    episode = [snapshot_at(scene, tick, Pose(1.0 + 0.2 * tick, 0.5 + 0.1 * tick, 0.4 * tick)) for tick in range(6)]
    for tick, snapshot in enumerate(episode):
        snapshot.humans.state[:, :2] += 0.05 * tick
    episode[2] = replace(episode[2], contacts=(Contact("wall", 0, True, False),))
    episode[3] = replace(episode[3], humans=episode[3].humans.select(np.array([0, 1, 3])))
    samples = _sampled(episode, 0.05, interpolate=True)
    return [*(sample for sample, _ in samples), snapshot_at(scene, 7, Pose(5.0, 2.0))]


@pytest.mark.parametrize("layers", LAYERS)
def test_a_picture_does_not_depend_on_the_pictures_before_it(scene, layers):
    snapshots = shown(scene)
    camera, legend = camera_for(scene, scale=60.0), Legend.of(snapshots[:1], layers)
    film = FilmPainter(scene, camera, layers, legend)
    for k, snapshot in enumerate(snapshots):
        trails, outcome = Trails.of(snapshots[: k + 1]) if k % 2 else None, "goal" if k == 3 else None
        drawn, alone = (
            painter.draw(snapshot, trails, outcome=outcome)
            for painter in (film, FilmPainter(scene, camera, layers, legend))
        )
        assert (pixels(drawn.surface) == pixels(alone.surface)).all()


@pytest.mark.parametrize("layers", LAYERS)
def test_a_picture_is_nearly_equal_to_a_single_one(scene, layers):
    snapshots = shown(scene)
    film = FilmPainter(scene, camera_for(scene, scale=60.0), layers, Legend.of(snapshots[:1], layers, paths=True))
    drawn, alone = (
        pixels(surface)
        for surface in (
            film.draw(snapshots[0], Trails.of(snapshots[:1]), outcome="goal").surface,
            picture(snapshots[0], layers=layers, trails=Trails.of(snapshots[:1]), outcome="goal", scale=60.0),
        )
    )
    assert drawn.shape == alone.shape
    assert np.abs(drawn - alone).mean() < 0.8
    below = camera_for(scene, scale=60.0).size[1]
    assert (drawn[:, below:] == alone[:, below:]).all()  # caption and legend


@pytest.mark.parametrize("fine", [1, 2, 4])
@pytest.mark.parametrize("width", [1.0, 9.0])
def test_steps_look_like_strokes_in_every_direction(fine, width):
    angles = np.arange(16) * np.pi / 8
    rays = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    steps = 100.3 + np.stack((20.0 * rays, 80.0 * rays), axis=1)
    colours = [(255, 255, 255)] * len(steps)
    at_once, one_by_one = (PixelCanvas(pygame.Surface((200, 200), 0, 32), fine) for _ in range(2))
    at_once.steps(colours, steps, width * fine)
    for colour, step in zip(colours, steps.tolist(), strict=True):
        one_by_one.stroke(colour, [tuple(point) for point in step], width * fine)
    a, b = (pixels(canvas.surface).mean() for canvas in (at_once, one_by_one))
    assert a == pytest.approx(b, rel=0.2)
    assert np.abs(pixels(at_once.surface) - pixels(one_by_one.surface)).mean() < 0.25 * b
