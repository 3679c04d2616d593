"""Several pictures on one sheet: moments of an episode side by side, or scenes of a scenario in rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pygame

from ..core.geometry import Twist
from ..core.humans import Humans, activities_among, activities_of, frozen, human_ids
from ..core.portable_math import unit_vector
from ..core.scene import Scene
from ..core.snapshot import RobotState, Snapshot
from ..errors import RenderError
from .canvas import Pixels
from .caption import STRIP, TEXT, draw_strip, origin, summary
from .draw import Layers, camera_for, picture
from .fonts import shortened
from .palette import FAINT, PAPER
from .trails import Trails

_GAP = 10  # pixels between pictures
_TITLE = 26  # pixels
_SHEET_WIDTH = 1600.0


def snapshot_of(scene: Scene) -> Snapshot:
    """The scene at tick 0, before anyone has moved: all who are there as they were placed, eyes ahead."""
    robot = scene.robot
    state = np.zeros((len(scene.humans), 9))
    for row, human in zip(state, scene.humans, strict=True):
        row[:8] = (*human.pose.position, 0.0, 0.0, *human.pose.direction, *human.pose.direction)
    radius = np.array([human.radius for human in scene.humans], dtype=float)
    still = RobotState(robot.pose.position, unit_vector(robot.pose.theta), (0.0, 0.0), 0.0, Twist(), False, robot)
    later = {human.id for human in scene.humans if human.enters > 0}
    ties = tuple(tie for tie in scene.interactions if tie.src not in later and tie.dst not in later)
    activity = activities_among(activities_of(scene), human_ids(scene), ties) if later else activities_of(scene)
    everybody = Humans(frozen(state), human_ids(scene), frozen(radius), activity)
    humans = everybody.only(np.flatnonzero([human.enters == 0 for human in scene.humans]))
    return Snapshot(0, 0.0, scene, still, humans, ties)


def scene_picture(
    *scenes: Scene,
    columns: int | None = None,
    scale: float | None = None,
    layers: Layers | None = None,
    titles: Sequence[str] | None = None,
) -> pygame.Surface:
    """A contact sheet of scenes, each with its title, all to the same scale.

    Args:
        columns: pictures a row; about as many as rows unless given.
        scale: pixels a metre; without it, what makes a sheet of usual width.
        titles: one a scene; name and seed unless given.

    Raises:
        RenderError: no scene is given, or one that cannot be drawn at that scale.
    """
    if not scenes:
        raise RenderError("there is no scene to draw; give at least one")
    columns = columns or math.ceil(math.sqrt(len(scenes)))
    layers, scale = layers or Layers(caption=False), scale or _common_scale(scenes, columns)
    names = titles or [f"{scene.name}   {origin(scene)}" for scene in scenes]
    tiles = [
        _titled(picture(snapshot_of(scene), layers=layers, camera=camera_for(scene, scale=scale)), name)
        for scene, name in zip(scenes, names, strict=True)
    ]
    return tiled(tiles, columns)


def moments(
    snapshots: Sequence[Snapshot],
    count: int,
    *,
    scale: float | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
    outcome: str | None = None,
) -> pygame.Surface:
    """So many moments of an episode side by side, evenly spread from first to last, each with the ways so far.

    Raises:
        RenderError: the count is not 1 .. the number of snapshots.
    """
    if not 1 <= count <= len(snapshots):
        raise RenderError(f"cannot show {count} moments of {len(snapshots)}; ask for 1 to {len(snapshots)}")
    scene, layers = snapshots[0].scene, layers or Layers()
    camera = camera_for(scene, scale=scale or _common_scale([scene], count))
    bare = replace(layers, caption=False)
    tiles = []
    for k in (round(x) for x in np.linspace(0 if count > 1 else len(snapshots) - 1, len(snapshots) - 1, count)):
        drawn = picture(snapshots[k], layers=bare, trails=Trails.of(snapshots[: k + 1]), camera=camera)
        tiles.append(_titled(drawn, f"{snapshots[k].time:.1f} s"))
    row = tiled(tiles, count)
    if layers.caption:
        row = _with_strip(row, summary(snapshots[-1], outcome) if caption is None else caption, camera.scale)
    return row


def tiled(pictures: Sequence[pygame.Surface], columns: int) -> pygame.Surface:
    """Pictures in rows from the upper left, each in the middle of its column."""
    columns = min(columns, len(pictures))
    rows = [pictures[k : k + columns] for k in range(0, len(pictures), columns)]
    width, heights = max(one.get_width() for one in pictures), [max(one.get_height() for one in row) for row in rows]
    sheet = pygame.Surface((columns * (width + _GAP) - _GAP, sum(heights) + (len(rows) - 1) * _GAP), 0, 32)
    sheet.fill(PAPER)
    for k, row in enumerate(rows):
        for column, one in enumerate(row):
            left = column * (width + _GAP) + (width - one.get_width()) // 2
            sheet.blit(one, (left, sum(heights[:k]) + k * _GAP))
    return sheet


def _common_scale(scenes: Sequence[Scene], columns: int) -> float:
    """Pixels a metre at which the widest scene fills one of so many columns."""
    widest = max(float(np.ptp(scene.outline[:, 0])) for scene in scenes) if all(s.polygon for s in scenes) else 10.0
    return min(80.0, (_SHEET_WIDTH / columns - _GAP) / (widest + 0.6))


def _titled(drawn: pygame.Surface, title: str) -> pygame.Surface:
    """The picture with a line of text above it."""
    width, height = drawn.get_size()
    sheet = pygame.Surface((width, height + _TITLE), 0, 32)
    sheet.fill(PAPER)
    sheet.blit(drawn, (0, _TITLE))
    Pixels(sheet).text(FAINT, shortened(title, width - 12, TEXT), (width // 2, _TITLE // 2 + 4), TEXT)
    return sheet


def _with_strip(drawn: pygame.Surface, text: str, scale: float) -> pygame.Surface:
    """The picture with the caption's strip below it."""
    width, height = drawn.get_size()
    sheet = pygame.Surface((width, height + STRIP), 0, 32)
    sheet.fill(PAPER)
    sheet.blit(drawn, (0, 0))
    draw_strip(Pixels(sheet), sheet.get_size(), text, scale, None)
    return sheet
