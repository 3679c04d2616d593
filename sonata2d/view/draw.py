"""A snapshot as a picture: a function of snapshot, camera and layers, which needs no display.

Everything is drawn with some times the pixels a side (`fine`) and then made smaller, which smooths every edge. What
stands still is drawn once (`backdrop`) and handed to each `picture` of the same scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pygame

from ..entities import Scene
from ..exact import Array
from ..frame import HumanState, Snapshot
from ..geometry import Barriers, Point
from .brush import Brush
from .camera import Camera
from .caption import STRIP, draw_strip, label, summary
from .palette import ACTIVITY, FLOOR, GRID, PAPER, ROBOT, WALL, Colour, shaded
from .people import draw_gaze, draw_goal, draw_human, draw_link, draw_robot, draw_velocity, draw_zones, link_ends
from .things import draw_thing, half_size
from .trails import Trails, draw_trails

FINE, QUICK = 4, 2  # times the pixels a side; powers of two, since pygame's smoothscale darkens others by a shade
_LARGE = 2_000_000  # pixels of a picture, past which QUICK does
_WALL_WIDTH, _PARTITION_WIDTH = 0.12, 0.05  # m; outer walls grow outward, so the line bodies stop at stays where it is


@dataclass(frozen=True, slots=True)
class Layers:
    """What a picture shows besides the room and who is in it."""

    gaze: bool = True
    links: bool = True
    goal: bool = True
    grid: bool = True  # faint lines, 1 m apart
    zones: bool = False  # where the robot would intrude into intimate and personal space
    velocities: bool = False
    ids: bool = False
    caption: bool = True  # the strip below, with the scale bar


def camera_for(
    scene: Scene, *, size: tuple[int, int] | None = None, scale: float | None = None, strip: int = 0
) -> Camera:
    """A camera that sees the whole room, `strip` pixels of the size left free for the caption."""
    corners = [*scene.polygon, *(end for wall in scene.walls for end in (wall.start, wall.end))]
    return Camera.fit(corners, size=(size[0], size[1] - strip) if size else None, scale=scale)


def backdrop(
    scene: Scene, camera: Camera, layers: Layers, *, outside: Colour | None = PAPER, fine: int | None = None
) -> pygame.Surface:
    """The room and its furniture, at `fine` times the camera's pixels.

    Args:
        outside: colour round the room; None leaves it transparent.
        fine: `FINE`, or `QUICK` for a large picture, unless given.
    """
    fine = fine or (FINE if camera.size[0] * camera.size[1] < _LARGE else QUICK)
    finer = camera.finer(fine)
    surface = pygame.Surface(finer.size, pygame.SRCALPHA if outside is None else 0, 32)
    surface.fill(outside if outside is not None else (*WALL, 0))
    brush = Brush(surface, finer, fine)
    _draw_room(brush, scene, layers)
    for thing in sorted(scene.furniture, key=lambda thing: thing.on is not None):
        draw_thing(brush, thing)
    return surface


def picture(
    snapshot: Snapshot,
    *,
    size: tuple[int, int] | None = None,
    scale: float | None = None,
    layers: Layers | None = None,
    trails: Trails | None = None,
    caption: str | None = None,
    outcome: str | None = None,
    camera: Camera | None = None,
    room: pygame.Surface | None = None,
) -> pygame.Surface:
    """Draw one look at the world.

    Args:
        size: width and height, pixels, caption included.
        scale: pixels a metre, if no size is given; without either, a usual one.
        trails: where robot and people went before.
        caption: text below; what scene and snapshot say of themselves unless given.
        outcome: how the episode ended, added to that text.
        camera: used as it is instead of fitting one to size and scale.
        room: `backdrop` of the same scene, camera and layers, so that it is not drawn again; it stays as it is.

    Raises:
        RenderError: the size cannot be drawn.
    """
    layers = layers or Layers()
    strip = STRIP if layers.caption else 0
    camera = camera or camera_for(snapshot.scene, size=size, scale=scale, strip=strip)
    surface = room.copy() if room is not None else backdrop(snapshot.scene, camera, layers)
    draw_moment(surface, camera, snapshot, layers, trails)
    finished = pygame.Surface((camera.size[0], camera.size[1] + strip), 0, 32)
    finished.fill(PAPER)
    pygame.transform.smoothscale(surface, camera.size, finished.subsurface((0, 0, *camera.size)))
    if layers.ids:
        _write_ids(finished, camera, snapshot)
    if strip:
        text = summary(snapshot, outcome) if caption is None else caption
        draw_strip(finished, text, camera.scale, trails.span if trails and not trails.is_tail else None)
    return finished


def draw_moment(
    surface: pygame.Surface, camera: Camera, snapshot: Snapshot, layers: Layers, trails: Trails | None = None
) -> None:
    """Draw all that moves onto a surface of some whole times the camera's pixels."""
    fine = surface.get_width() // camera.size[0]
    brush, people = Brush(surface, camera.finer(fine), fine), present(snapshot)
    if layers.goal:
        draw_goal(brush, snapshot.goal)
    if trails is not None:
        draw_trails(brush, trails)
    for human in people if layers.zones else ():
        draw_zones(brush, human)
    ends = link_ends(snapshot, people)
    for link in snapshot.interactions if layers.links else ():
        draw_link(brush, link, ends)
    for human in people if layers.gaze else ():
        draw_gaze(brush, human)
    ignoring = {human.id for human in snapshot.scene.humans if human.reacts_to_robot == 0.0}
    for human in people:
        draw_human(brush, human, snapshot.time, ignores_robot=human.id in ignoring)
    draw_robot(brush, snapshot.robot, touches=bool(snapshot.contacts))
    if layers.velocities:
        _draw_velocities(brush, snapshot, people)


def present(snapshot: Snapshot) -> list[HumanState]:
    """The people who are there: rows without a place are left out."""
    there = np.isfinite(snapshot.humans.state).all(axis=1)
    return [snapshot.humans[int(k)] for k in np.flatnonzero(there)]


def _draw_velocities(brush: Brush, snapshot: Snapshot, people: list[HumanState]) -> None:
    for human in people:
        draw_velocity(brush, human.pose.position, human.velocity, shaded(ACTIVITY[human.activity], 0.3))
    draw_velocity(brush, snapshot.robot.position, snapshot.robot.velocity, shaded(ROBOT, 0.3))


def _write_ids(surface: pygame.Surface, camera: Camera, snapshot: Snapshot) -> None:
    """Ids of people and things, right above them."""
    for human in present(snapshot):
        label(surface, str(human.id), camera.to_pixels((human.pose.x, human.pose.y + human.radius)))
    for thing in snapshot.objects:
        label(surface, str(thing.id), camera.to_pixels((thing.pose.x, thing.pose.y + 0.7 * min(half_size(thing)))))


def _draw_room(brush: Brush, scene: Scene, layers: Layers) -> None:
    for wall in scene.walls:
        brush.stroke(WALL, [wall.start, wall.end], 2 * _WALL_WIDTH)  # the floor will cover the inner half
    if scene.polygon:
        brush.polygon(FLOOR, scene.polygon)
        if layers.grid:
            _draw_grid(brush, scene.outline)
    for wall in scene.walls:
        if not scene.polygon or _is_partition(wall.start, wall.end, scene.outline):
            brush.stroke(WALL, [wall.start, wall.end], _PARTITION_WIDTH)


def _is_partition(start: Point, end: Point, outline: Array) -> bool:
    """Whether a wall stands within the room rather than on its outline."""
    edges = Barriers(outline, np.roll(outline, -1, axis=0), np.zeros(len(outline)))
    middle = np.array([[(start[0] + end[0]) / 2, (start[1] + end[1]) / 2]])
    return float(edges.gaps(middle).min()) > 1e-3


def _draw_grid(brush: Brush, outline: Array) -> None:
    """Lines at whole metres, as far as the floor goes."""
    for axis in (0, 1):
        along, low, high = outline[:, 1 - axis], outline[:, axis].min(), outline[:, axis].max()
        for at in range(math.ceil(low), math.floor(high) + 1):
            for a, b in _spans(outline[:, axis], along, at + 1e-6):
                ends = [(float(at), a), (float(at), b)] if axis == 0 else [(a, float(at)), (b, float(at))]
                brush.stroke(GRID, ends, 0.0)


def _spans(across: Array, along: Array, at: float) -> list[tuple[float, float]]:
    """Where the line across = at runs within a polygon: stretches of along (even-odd rule)."""
    a, b = np.roll(across, 1), across
    cut = (a > at) != (b > at)
    share = (at - a[cut]) / (b[cut] - a[cut])
    start = np.roll(along, 1)[cut]
    hits = sorted(float(hit) for hit in start + share * (along[cut] - start))
    return list(zip(hits[::2], hits[1::2], strict=False))
