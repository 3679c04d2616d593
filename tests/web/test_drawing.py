"""The page draws what the window draws."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest

import sonata2d as s2
from sonata2d.record.reader import read_episode
from sonata2d.view.layers import Layers
from sonata2d.view.painter import Painter

from .conftest import Served
from .test_browser import opened

STUDY = """\
title: Drawing
ratings:
  - {{name: one, folder: one.json, view: {view}, question: {{name: polite, kind: yes_no, question: Polite}}}}
"""


@pytest.mark.parametrize("view", ["top", "follow"])
def test_the_page_draws_as_the_window(browser: Any, tmp_path: Path, view: Any) -> None:
    """Pictures of a lively room differ only along edges, which the two smooth differently."""
    scene = s2.generate(s2.load_scenario("sonata-2020-crowded").changed(rules={"time_limit": 2.0}), seed=4)
    with s2.JsonRecorder(tmp_path / "one.json") as recorder:
        s2.Episode(scene, s2.SocialPlanner(), observers=[recorder]).run()
    (tmp_path / "study.yaml").write_text(STUDY.format(view=view))
    served = Served(tmp_path)
    try:
        page = opened(browser, served.link())
        page.wait_for_selector("#rating input:enabled")  # the run has been watched to its end
        page.wait_for_timeout(200)
        shot = page.locator("#film").screenshot()
        assert page.problems == []
        page.context.close()
    finally:
        served.stop()
    drawn = pygame.surfarray.array3d(pygame.image.load(io.BytesIO(shot))).astype(int)
    surface = pygame.Surface(drawn.shape[:2])
    snapshot = read_episode(tmp_path / "one.json").snapshot(-1)
    Painter(snapshot.scene).draw(surface, snapshot, view=view, layers=Layers(caption=False))
    painted = pygame.surfarray.array3d(surface).astype(int)
    difference = np.abs(drawn - painted).max(axis=2)[12:-12, 12:-12]  # the corners of the page's picture are round
    assert np.ptp(painted, axis=(0, 1)).min() > 150  # it is not an empty picture
    assert difference.mean() < 2.5
    assert (difference > 60).mean() < 0.015
