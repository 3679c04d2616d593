"""A snapshot as a picture: a function of snapshot, camera and layers, which needs no display.

Everything is drawn with some times the pixels a side (`fine`) and then made smaller, which smooths every edge. What
stands still is drawn once (`backdrop`) and handed to each `picture` of the same scene.
"""

from __future__ import annotations

from dataclasses import dataclass

import pygame

from ..core.geometry import Point
from ..core.humans import HumanState
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from .brush import Brush
from .camera import Camera
from .canvas import Canvas, Pixels
from .caption import STRIP, draw_strip, label, summary
from .gaze import cut_short, walls_of
from .legend import draw_legend
from .palette import ACTIVITY, PAPER, ROBOT, WALL, Colour, shaded
from .people import (
    draw_gaze,
    draw_goal,
    draw_human,
    draw_link,
    draw_robot,
    draw_shared,
    draw_velocity,
    draw_zones,
    link_ends,
)
from .room import FloorPlan, draw_furniture, draw_room
from .smooth import Smooth
from .things import half_size
from .ties import circles, draw_circle, drawn_ties
from .trails import Trails, draw_trails

FINE, QUICK = 4, 2  # times the pixels a side; powers of two, since pygame's smoothscale darkens others by a shade
_LARGE = 2_000_000  # pixels of a picture, past which QUICK does


@dataclass(frozen=True, slots=True)
class Layers:
    """What a picture shows besides the room and who is in it."""

    gaze: bool = True
    links: bool = True
    goal: bool = True
    grid: bool = True  # faint lines, 1 m apart
    zones: bool = False  # where the robot would intrude: intimate and personal space, and what people share
    velocities: bool = False
    ids: bool = False
    caption: bool = True  # the strip below, with the scale bar
    legend: bool = False  # what colours stand for


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
    brush = Brush(Pixels(surface), finer, fine)
    draw_room(brush, FloorPlan.of(scene), grid=layers.grid)
    draw_furniture(brush, scene)
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
    draw_over(Brush(Smooth(finished), camera), snapshot, present(snapshot), layers)
    if strip:
        text = summary(snapshot, outcome) if caption is None else caption
        span = trails.span if trails and not trails.is_tail else None
        draw_strip(Pixels(finished), finished.get_size(), text, camera.scale, span)
    return finished


def draw_moment(
    surface: pygame.Surface, camera: Camera, snapshot: Snapshot, layers: Layers, trails: Trails | None = None
) -> None:
    """Draw all that moves onto a surface of some whole times the camera's pixels."""
    fine = surface.get_width() // camera.size[0]
    draw_all(Brush(Pixels(surface), camera.finer(fine), fine), snapshot, layers, trails)


def draw_all(brush: Brush, snapshot: Snapshot, layers: Layers, trails: Trails | None = None) -> None:
    """Draw all that moves, and the goal."""
    people, deaf = present(snapshot), ignoring(snapshot.scene)
    if layers.goal:
        draw_goal(brush, snapshot.goal)
    if trails is not None:
        draw_trails(brush, trails)
    for human in people if layers.zones else ():
        draw_zones(brush.at(human.pose.position), human.radius)
    draw_under(brush, snapshot, people, layers)
    reaches = cut_short(people, walls_of(snapshot.scene)) if layers.gaze else {}
    for human in people if layers.gaze else ():
        draw_gaze(brush, human, reaches.get(human.id))
    for human in people:
        draw_human(brush, human, snapshot.time, ignores_robot=human.id in deaf)
    draw_robot(brush, snapshot.robot, touches=bool(snapshot.contacts))
    if layers.velocities:
        draw_velocities(brush, snapshot, people)


def draw_under(brush: Brush, snapshot: Snapshot, people: list[HumanState], layers: Layers) -> None:
    """Draw what lies below people and robot: shared spaces, links."""
    ends = link_ends(snapshot, people)
    talking = circles(snapshot, "talking") if layers.zones else []
    for ring, _ in talking:
        draw_circle(brush, [ends[member][0] for member in ring if member in ends])
    in_circle = {member for ring, _ in talking for member in ring}
    for link in snapshot.interactions if layers.zones else ():
        if link.src not in in_circle:
            draw_shared(brush, link, ends)
    for link in drawn_ties(snapshot) if layers.links else ():
        draw_link(brush, link, ends)


def draw_over(brush: Brush, snapshot: Snapshot, people: list[HumanState], layers: Layers) -> None:
    """Draw what lies above people and robot on a picture of its final size: ids, legend."""
    if layers.ids:
        _write_ids(brush.canvas, brush.camera, snapshot)
    if layers.legend:
        draw_legend(brush.canvas, brush.camera.size, [human.activity for human in people])


def ignoring(scene: Scene) -> frozenset[int]:
    """Ids of the people who ignore the robot."""
    return frozenset(human.id for human in scene.humans if human.reacts_to_robot == 0.0)


def present(snapshot: Snapshot) -> list[HumanState]:
    """The people who are there."""
    return list(snapshot.humans)


def draw_velocities(brush: Brush, snapshot: Snapshot, people: list[HumanState]) -> None:
    for human in people:
        draw_velocity(brush, human.pose.position, human.velocity, shaded(ACTIVITY[human.activity], 0.3))
    draw_velocity(brush, snapshot.robot.position, snapshot.robot.velocity, shaded(ROBOT, 0.3))


def _write_ids(canvas: Canvas, camera: Camera, snapshot: Snapshot) -> None:
    """Ids of people and things, right above them."""
    for human in present(snapshot):
        label(canvas, str(human.id), camera.to_pixels(_above(camera, human.pose.position, human.radius)))
    for thing in snapshot.objects:
        label(canvas, str(thing.id), camera.to_pixels(_above(camera, thing.pose.position, 0.7 * min(half_size(thing)))))


def _above(camera: Camera, place: Point, by: float) -> Point:
    """A point so many metres above another in the picture."""
    return place[0] + by * camera.up[0], place[1] + by * camera.up[1]
