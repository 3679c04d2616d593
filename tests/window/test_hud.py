from dataclasses import replace

import numpy as np
import pygame
import pytest

from sonata2d.core.geometry import Pose
from sonata2d.core.labels import LabelSpec
from sonata2d.core.snapshot import Contact
from sonata2d.view.palette import FLOOR, GOAL, shaded
from sonata2d.view.projection import Camera
from sonata2d.window import hud as hud_module, question_panel, widgets
from sonata2d.window.answer import FrameQuestion
from sonata2d.window.collect_screen import _draw_tint
from sonata2d.window.hud import Hud, draw_hud, free_area, zone_of

from ..view.conftest import pixels, scene as scene, snapshot_at

ARROW = shaded(GOAL, 0.35)
PLAIN = Hud()
ENDS = LabelSpec("slider", question="How?", ends=("rough " * 9, "smooth"))
FULL = Hud(
    run=12, runs=200, kept=11, contributor="Wilhelmina Featherstonehaugh-Cholmondeley", light="recording",
    question=FrameQuestion(
        LabelSpec("classes", question="How does it drive? " * 4, classes=("poorly", "fairly well", "机器人", "x" * 30))
    ),
    notice="The robot is near to a person who does not see it at all, please be careful",
    keys=(("W A S D", "drive"), ("Q E", "turn"), ("Space", "stop"), ("Esc", "pause"), ("Tab", "view"), ("F1", "help")),
)  # fmt: skip


def floor(size=(1280, 800)):
    surface = pygame.Surface(size, 0, 32)
    surface.fill(FLOOR)
    return surface


def shown(snapshot, hud=PLAIN, size=(1280, 800), scale=1.0):
    surface = floor(size)
    camera = Camera.behind(snapshot.robot.position, snapshot.robot.direction, size=size)
    draw_hud(surface, hud, snapshot, camera, scale=scale)
    return surface


def arrow_of(surface):
    hits = np.argwhere((pixels(surface) == ARROW).all(axis=2))
    return hits.mean(axis=0) if len(hits) > 100 else None


@pytest.mark.parametrize(
    ("ahead", "left", "side"),
    [(2, 0, None), (-0.5, 4, None), (-6, 0, "low"), (0, 9, "left"), (0, -9, "right"), (9, 1, "up")],
)
def test_an_arrow_points_to_the_goal_only_while_the_goal_is_out_of_view(scene, ahead, left, side):
    pose = Pose(2.0, 1.0, 0.8)
    x, y = pose.to_world((float(ahead), float(left)))
    place = arrow_of(shown(snapshot_at(replace(scene, goal=replace(scene.goal, x=x, y=y)), robot=pose)))
    if side is None:
        assert place is None
    else:
        assert {"low": place[1] > 600, "up": place[1] < 200, "left": place[0] < 200, "right": place[0] > 1080}[side]


@pytest.mark.parametrize("light", ["waiting", "recording", "paused", "frozen", "replay", "watching"])
def test_each_light_has_its_own_sign_even_in_greyscale(scene, light):
    grey = pixels(shown(snapshot_at(scene), Hud(light=light))).mean(axis=2)
    for other in {"waiting", "recording", "paused", "frozen", "replay", "watching"} - {light}:
        assert (np.abs(grey - pixels(shown(snapshot_at(scene), Hud(light=other))).mean(axis=2)) > 60).sum() > 20


def test_zones_change_sign_and_colour_at_halls_distances():
    intimate, near, far, clear = (zone_of(gap) for gap in (0.44, 0.46, 1.19, 1.21))
    assert near == far
    assert all(len({*values}) == 3 for values in zip(intimate, near, clear, strict=True))


@pytest.mark.parametrize(
    ("kinds", "words"),
    [
        ((), "nearest person at 0.6 m"),
        (("wall",), "touching a wall"),
        (("wall", "object"), "touching an object"),
        (("object", "human"), "touching a person"),
    ],
)
def test_readings_say_what_is_near_or_touched(scene, drawn, kinds, words):
    contacts = tuple(Contact(kind, 0, robot_at_fault=True, other_at_fault=False) for kind in kinds)
    shown(replace(snapshot_at(scene), contacts=contacts))
    assert words in [line.words for line in drawn]


@pytest.mark.parametrize("size", [(640, 480), (1280, 800), (900, 1400), (2560, 1600)])
@pytest.mark.parametrize("scale", [0.75, 1.0, 2.0, 3.0])
def test_texts_do_not_overlap_and_stay_inside_the_picture(scene, size, scale, monkeypatch):
    boxes = []
    write = widgets.write

    def record(*arguments, **settings):
        boxes.append(write(*arguments, **settings))
        return boxes[-1]

    for module in (hud_module, question_panel, widgets):
        monkeypatch.setattr(module, "write", record)
    for pose in (Pose(5.0, 1.0, 3.0), Pose(1.0, 0.5, 0.0), Pose(4.6, 0.6, 1.0)):
        boxes.clear()
        snapshot = snapshot_at(scene, robot=pose)
        surface = shown(snapshot, FULL, size, scale)
        assert len(boxes) > 8
        for k, box in enumerate(boxes):
            assert surface.get_rect().contains(box)
            assert box.collidelist(boxes[k + 1 :]) == -1


def test_characters_that_the_font_lacks_are_accepted(scene):
    nasty = Hud(
        contributor="\0\ud800\u202e😀\n" * 30,
        label="\0",
        notice="\x1b[31m\u200b" * 3000,
        keys=(("\0", ""),),
        question=FrameQuestion(LabelSpec("slider", question="\0")),
    )
    shown(snapshot_at(scene), nasty)


def test_the_hud_shows_that_no_pedestrians_are_present(scene):
    snapshot = snapshot_at(scene)
    snapshot.humans.state[:] = np.nan
    with_humans, without = pixels(shown(snapshot_at(scene))), pixels(shown(snapshot))
    assert (with_humans != without).any()


def test_every_reading_changes_the_picture(scene):
    plain = pixels(shown(snapshot_at(scene)))
    for hud in (Hud(run=2), Hud(runs=3), Hud(contributor="Ann"), Hud(kept=1), Hud(label="fair"), Hud(notice="Look")):
        assert (pixels(shown(snapshot_at(scene), hud)) != plain).any()


def test_a_tint_ranges_from_no_effect_to_its_colour():
    for alpha, expected in ((0, FLOOR), (255, (200, 30, 30))):
        surface = floor((64, 48))
        _draw_tint(surface, (200, 30, 30), alpha)
        assert np.abs(pixels(surface) - expected).max() <= 1


@pytest.mark.parametrize("question", [None, FULL.question, FrameQuestion(ENDS)])
@pytest.mark.parametrize("size", [(1024, 640), (1280, 800), (2560, 1600)])
def test_the_free_area_is_free_of_readings(scene, size, question):
    hud, scale = replace(FULL, question=question, notice=""), size[0] / 1280
    snapshot = snapshot_at(replace(scene, goal=replace(scene.goal, x=4.6, y=0.6)), robot=Pose(4.6, 0.6, 1.0))
    area = free_area(floor(size), hud, scale=scale)
    assert area.height > 0.5 * size[1]
    changed = (pixels(shown(snapshot, hud, size, scale)) != pixels(floor(size))).any(axis=2)
    assert changed.any()
    assert changed[:, area.top : area.bottom].mean() < 0.02, "only the distance to the goal is drawn there"


def test_in_a_tiny_window_readings_lie_over_the_scene():
    assert free_area(floor((40, 30)), FULL, scale=1.0) == pygame.Rect(0, 0, 40, 30)


def test_a_question_shows_its_answers_and_both_ends_in_full(scene, drawn):
    ends = ("I would not want to meet this robot again in a narrow corridor", "very pleasant")
    shown(
        snapshot_at(scene),
        Hud(question=FrameQuestion(LabelSpec("slider", question="How pleasant is it?", ends=ends), 0.23)),
    )
    words = [line.words for line in drawn]
    assert "How pleasant is it?" in words
    assert ends[1] in words
    assert set(ends[0].split()) <= set(" ".join(words).split())
    assert not any("…" in line or "0.23" in line for line in words)
