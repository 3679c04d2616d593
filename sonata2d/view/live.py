"""The world as a window shows it: drawn straight onto a surface of any size, many times a second."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import pygame

from ..core.devices import View
from ..core.humans import HumanState
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from .brush import Brush
from .camera import Camera
from .draw import Layers, backdrop, camera_for, draw_over, draw_under, draw_velocities, ignoring, present
from .gaze import cut_short, walls_of
from .palette import OUTSIDE
from .people import draw_body, draw_chassis, draw_fan, draw_gaze, draw_head, draw_target, draw_zones, swing_of
from .room import FloorPlan, draw_room
from .smooth import Smooth
from .sprites import Stamps
from .tails import draw_tails
from .things import draw_thing, front_of
from .trails import Trails

REACH = 5.0  # m, from the robot to the upper edge of the follow view
_SWINGS = 24  # poses of a stride that are told apart


class Painter:
    """Draws looks at one scene onto surfaces, and keeps what every picture needs again.

    Args:
        scene: whose snapshots will be drawn.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene, self._plan = scene, FloorPlan.of(scene)
        self._ignoring, self._walls = ignoring(scene), walls_of(scene)
        self._things = sorted(scene.furniture, key=lambda thing: thing.on is not None)
        self._stamps = Stamps()
        self._room: tuple[tuple[Any, ...], pygame.Surface] | None = None

    def draw(
        self,
        surface: pygame.Surface,
        snapshot: Snapshot,
        *,
        view: View = "follow",
        layers: Layers = Layers(caption=False),  # noqa: B008  frozen
        zoom: float = 1.0,
        trails: Trails | None = None,
        reach: float = REACH,
    ) -> Camera:
        """Fill the surface with one look.

        Args:
            view: `follow`, from behind and above the robot, which looks up in the picture; or `top`, the whole room.
            zoom: how many times nearer.
            trails: where robot and people went before.
            reach: m, of the follow view at zoom 1, from the robot to the upper edge.

        Returns:
            The camera used, with which callers can place things.

        Raises:
            RenderError: size, zoom or reach make no picture.
        """
        camera = self.camera(surface.get_size(), snapshot, view=view, zoom=zoom, reach=reach)
        brush = Brush(Smooth(surface), camera)
        self._draw_room(surface, brush, layers, still=view == "top" and zoom <= 1.0)
        if layers.goal:
            self._draw_goal(surface, camera, snapshot)
        if trails is not None:
            draw_tails(surface, camera, trails)
        people = present(snapshot)
        for human in people if layers.zones else ():
            part = ("zones", human.radius), partial(draw_zones, r=human.radius), camera.up
            self._stamps.put(surface, camera, human.pose.position, part, whole=True)
        draw_under(brush, snapshot, people, layers)
        reaches = cut_short(people, self._walls) if layers.gaze else {}
        for human in people if layers.gaze else ():
            self._draw_gaze(surface, brush, human, reaches.get(human.id))
        for human in people:
            self._draw_human(surface, camera, human, snapshot.time)
        self._draw_robot(surface, camera, snapshot)
        if layers.velocities:
            draw_velocities(brush, snapshot, people)
        draw_over(brush, snapshot, people, layers)
        return camera

    def camera(
        self,
        size: tuple[int, int],
        snapshot: Snapshot,
        *,
        view: View = "follow",
        zoom: float = 1.0,
        reach: float = REACH,
    ) -> Camera:
        """The camera that `draw` uses for a surface of this size."""
        if view == "follow":
            return Camera.behind(snapshot.robot.position, snapshot.robot.direction, size=size, reach=reach / zoom)
        whole = camera_for(self._scene, size=size)
        return whole if zoom == 1.0 else whole.nearer(zoom, snapshot.robot.position)

    def _draw_room(self, surface: pygame.Surface, brush: Brush, layers: Layers, *, still: bool) -> None:
        """The room: from a picture made before if the camera stands still, else anew."""
        if still:
            seen = (brush.camera, layers.grid)
            if self._room is None or self._room[0] != seen:
                self._room = (
                    seen,
                    _smoothed(backdrop(self._scene, brush.camera, layers, outside=OUTSIDE), brush.camera.size),
                )
            surface.blit(self._room[1], (0, 0))
            return
        surface.fill(OUTSIDE)
        draw_room(brush, self._plan, grid=layers.grid)
        for thing in self._things:
            part = ("thing", thing.id), partial(draw_thing, thing=thing), front_of(thing)
            self._stamps.put(surface, brush.camera, thing.pose.position, part)

    def _draw_goal(self, surface: pygame.Surface, camera: Camera, snapshot: Snapshot) -> None:
        reach = snapshot.goal.distance
        part = ("goal", reach), partial(draw_target, reach=reach), (1.0, 0.0)
        self._stamps.put(surface, camera, snapshot.goal.position, part)

    def _draw_gaze(self, surface: pygame.Surface, brush: Brush, human: HumanState, reaches: list[float] | None) -> None:
        if reaches is not None:
            draw_gaze(brush, human, reaches)
            return
        r, kind = human.radius, human.activity
        part = ("fan", kind, r), partial(draw_fan, activity=kind, r=r), (math.cos(human.head), math.sin(human.head))
        self._stamps.put(surface, brush.camera, human.pose.position, part)

    def _draw_human(self, surface: pygame.Surface, camera: Camera, human: HumanState, time: float) -> None:
        r, kind, ignores = human.radius, human.activity, human.id in self._ignoring
        swing = round(swing_of(human, time) * _SWINGS) / _SWINGS
        body = partial(draw_body, activity=kind, r=r, swing=swing, ignores_robot=ignores)
        look = math.cos(human.head), math.sin(human.head)
        parts = (
            (("body", kind, r, swing, ignores), body, human.pose.direction),
            (("head", r), partial(draw_head, r=r), look),
        )
        self._stamps.put(surface, camera, human.pose.position, *parts)

    def _draw_robot(self, surface: pygame.Surface, camera: Camera, snapshot: Snapshot) -> None:
        robot, touches = snapshot.robot, bool(snapshot.contacts)
        draw = partial(draw_chassis, r=robot.radius, touches=touches)
        self._stamps.put(surface, camera, robot.position, (("robot", robot.radius, touches), draw, robot.direction))


def _smoothed(surface: pygame.Surface, size: tuple[int, int]) -> pygame.Surface:
    small = pygame.Surface(size, 0, 32)
    return pygame.transform.smoothscale(surface, size, small)
