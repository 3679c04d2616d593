"""Moments of an episode for a page."""

from __future__ import annotations

import base64
import io

import numpy as np
import pytest
from PIL import Image

from sonata2d.errors import RenderError
from sonata2d.view.strips import SIDE, filmstrip


def pixels(url: str) -> np.ndarray:
    kind, data = url.split(",")
    assert kind == "data:image/png;base64"
    with Image.open(io.BytesIO(base64.b64decode(data))) as picture:
        return np.asarray(picture.convert("RGBA")).astype(int)


def test_moments_are_squares_of_the_same_place_in_which_only_what_moves_differs(episode):
    first, again, last = (pixels(url) for url in filmstrip(episode, [0, 0, 11]))
    assert first.shape == (SIDE, SIDE, 4)
    assert (first == again).all()
    changed = (first != last).any(axis=2)
    assert 0.002 < changed.mean() < 0.1  # the robot, its way and nothing else


def test_outside_the_room_the_page_shines_through(episode):
    (only,) = (pixels(url) for url in filmstrip(episode, [3]))
    assert only[5, -5, 3] == 0  # beyond the corner of the L
    assert (only[SIDE // 2 + 10 : SIDE // 2 + 70, 40:-40, 3] == 255).all()  # the foot of the L


@pytest.mark.parametrize("looks", [[], [12], [0, -1]])
def test_moments_that_are_not_there_are_refused(episode, looks):
    with pytest.raises(RenderError, match=r"ask for some of 0\.\.11"):
        filmstrip(episode, looks)
