"""Scenes and snapshots as JSON for `drawing.js`, which draws them in a browser."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any
from xml.etree import ElementTree

from ..core.attributes import attribute_text
from ..core.doors import DoorState
from ..core.entities import Area, Furniture, Human
from ..core.furniture_types import WOOD, WOOD_EDGE
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE, clearance, obstacle_clearance, touched_kind
from ..core.relations import ACTIVITIES, ACTIVITY
from ..core.scene import Scene
from ..core.snapshot import RobotState, Snapshot
from ..registry import person_kind
from .brush import Brush
from .draw import camera_for, draw_still_parts
from .figures import draw_chassis, draw_foot, draw_head, draw_limbs, draw_target
from .furniture import half_size
from .landmarks import AREA_WORD, centre_of, leaf_as_drawn
from .layers import Layers, visible_interactions
from .legend import Legend
from .palette import BLUE, FAINT, FLOOR, GOAL, INK, OTHER_ROBOT, REGARD, ROBOT, Colour, hex_colour, mixed, shaded
from .projection import Camera
from .svg import SvgCanvas
from .trails import human_tones

UNDRAWN = frozenset({"shared"})  # symbols of the legend that `drawing.js` does not draw
_SYMBOL = 20  # px, width of a symbol of the legend
_DIGITS = 3  # decimal places of metres, seconds and radians
_REACTIONS = {
    "ignores": "ignores the robot",
    "avoids": "",
    "stops": "stops for the robot",
    "curious": "curious about the robot",
    "scared": "scared of the robot",
}
_SCALE = 100.0  # px/m of the room and of symbols, whose lines then have two decimals; browsers draw them at any scale


def _tones(colour: Colour) -> dict[str, Colour]:
    """The tones in which the body of a person is drawn."""
    return {
        "fill": colour,
        "dark": shaded(colour),
        "outline": shaded(colour, 0.25),
        "body": mixed(FLOOR, colour, 0.28),
        "plain": mixed(FLOOR, colour, 0.7),
    }


_COLOURS = {
    "robot": ROBOT,
    "otherRobot": OTHER_ROBOT,
    "goal": GOAL,
    "zone": BLUE,
    "intimateLine": mixed(FLOOR, INK, 0.3),
    "personalLine": mixed(FLOOR, INK, 0.22),
    "link": FAINT,
    "regard": REGARD,
    "leaf": WOOD,
    "leafEdge": WOOD_EDGE,
    "ink": INK,
}


def scene_data(scene: Scene, layers: Layers = Layers()) -> dict[str, Any]:  # noqa: B008  frozen
    """The data of a scene that stay the same during an episode.

    Args:
        scene: the scene.
        layers: whether the room has grid lines.
    """
    camera = _camera_of(scene)
    width, height = (side / camera.scale for side in camera.size)
    return {
        "view": {"left": camera.left, "top": camera.top, "width": width, "height": height},
        "room": _room_url(scene, camera, layers),
        "dt": scene.rules.dt,
        "unmeasured": sorted(scene.unmeasured),
        "outline": scene.polygon,
        "holes": scene.holes,
        "walls": [[*wall.start, *wall.end] for wall in scene.walls],
        "goal": [*scene.goal.position, scene.goal.distance],
        "robotRadius": scene.robot.radius,
        "robots": [
            {"id": other.id, "radius": other.robot.radius, "goal": [*other.goal.position, other.goal.distance]}
            for other in scene.robots
        ],
        "humans": [
            {
                "id": h.id,
                "radius": h.radius,
                "shoulder": h.shoulder if "headings" not in scene.unmeasured else 0.0,
                **_figure(h),
                **_words(h),
                "ignores": h.reacts_to_robot == 0.0,
                "reaction": _REACTIONS[h.reaction] if "robot" not in scene.unmeasured else "",
                "path": hex_colour(human_tones(k)[-1]),
            }
            for k, h in enumerate(scene.humans)
        ],
        "things": [
            {"id": f.id, "type": f.type, "x": f.pose.x, "y": f.pose.y, "radius": 0.8 * min(half_size(f)), **_words(f)}
            for f in sorted(scene.furniture, key=lambda f: f.on is None)  # the pointer finds a laptop before its table
        ],
        "areas": [
            {"x": centre_of(a)[0][0], "y": centre_of(a)[0][1], "radius": AREA_WORD / 2, **_words(a)}
            for a in scene.areas
            if attribute_text(a.attributes)
        ],
        "activities": ACTIVITIES,
        "activityTexts": {name: activity.text for name, activity in ACTIVITY.items()},
        "tones": {
            name: {key: hex_colour(tone) for key, tone in _tones(activity.colour).items()}
            for name, activity in ACTIVITY.items()
        },
        "steps": {
            name: {"stride": activity.stride, "aside": activity.foot[1]}
            for name, activity in ACTIVITY.items()
            if activity.foot is not None and activity.stride
        },
        "gestures": {name: activity.gesture for name, activity in ACTIVITY.items() if activity.gesture},
        "colours": {name: hex_colour(colour) for name, colour in _COLOURS.items()},
        "zones": (INTIMATE_DISTANCE, PERSONAL_DISTANCE),
        "symbols": _symbols(scene),
    }


def _words(entity: Human | Furniture | Area) -> dict[str, str]:
    """The attributes of a pedestrian, an object or an area as words."""
    words = attribute_text(entity.attributes)
    return {"words": words} if words else {}


def _figure(human: Human) -> dict[str, Any]:
    """The properties of the drawing of a pedestrian that its kind changes."""
    kind = person_kind(human.kind)
    values = {"place": kind.place, "figure": kind.figure, "limbs": kind.limbs, "kit": kind.draw and f"kit {human.id}"}
    return {key: value for key, value in values.items() if value}


def _symbols(scene: Scene) -> dict[str, str]:
    """Drawings around the origin, as SVG elements; heads and limbs belong to a body of size 1 m."""
    outline = scene.robot.outline
    drawings: dict[str, Callable[[Brush], None]] = {
        "goal": partial(draw_target, radius=scene.goal.distance),
        "robot": partial(draw_chassis, shape=outline),
        "touching": partial(draw_chassis, shape=outline, touches=True),
        "head": partial(draw_head, r=1.0),
        "round head": partial(draw_head, r=1.0, nose=False),
    }
    for other in scene.robots:
        chassis = partial(draw_chassis, shape=other.robot.outline, is_other=True)
        drawings[f"robot {other.id}"], drawings[f"touching {other.id}"] = chassis, partial(chassis, touches=True)
        drawings[f"goal {other.id}"] = partial(draw_target, radius=other.goal.distance, is_other=True)
    for human in scene.humans:
        kit, shoulder = person_kind(human.kind).draw, human.shoulder
        if kit is not None:
            half = {"a": human.radius + max(-shoulder, 0.0), "b": human.radius + max(shoulder, 0.0)}
            drawings[f"kit {human.id}"] = partial(kit, **half)
    for name, activity in ACTIVITY.items():
        # of a walking pedestrian, the feet are placed one by one
        drawings[name] = partial(draw_foot if activity.stride else draw_limbs, activity=name, r=1.0)
    symbols = {}
    for name, draw in drawings.items():
        canvas = SvgCanvas((0, 0))
        draw(Brush(canvas, Camera(_SCALE, 0.0, 0.0, (0, 0))))
        symbols[name] = canvas.inline()
    return symbols


def state_data(snapshot: Snapshot) -> dict[str, Any]:
    """The data of one tick: time, rows of robots and pedestrians, links, contact, distances."""
    return {
        "time": _number(snapshot.time),
        "robot": _robot_row(snapshot.robot),
        **({"robots": [_other_row(snapshot, k) for k in range(len(snapshot.robots))]} if snapshot.robots else {}),
        **({"goal": snapshot.goal.position} if snapshot.goal.moves else {}),
        **({"doors": [_leaf_row(each) for each in snapshot.doors]} if snapshot.doors else {}),
        "people": _human_rows(snapshot),
        "links": [(link.src, link.dst) for link in visible_interactions(snapshot)],
        "touches": touched_kind(snapshot),
        "clearance": _number(clearance(snapshot)),
    }


def _leaf_row(state: DoorState) -> list[float | None]:
    """Both ends of the leaf of a door, m."""
    return [_number(value) for point in leaf_as_drawn(state) for value in point]


def states_data(snapshots: Sequence[Snapshot]) -> list[dict[str, Any]]:
    """The states of an episode; a state without `links` has the links of the state before."""
    states: list[dict[str, Any]] = []
    links = None
    for snapshot in snapshots:
        state = state_data(snapshot) | {"obstacleClearance": _number(obstacle_clearance(snapshot))}
        if state["links"] == links:
            del state["links"]
        else:
            links = state["links"]
        states.append(state)
    return states


def legend_data(legend: Legend) -> list[dict[str, str]]:
    """The symbols of a legend as SVG elements, with their names and meanings."""
    entries = []
    for entry in legend.entries:
        canvas = SvgCanvas((_SYMBOL, _SYMBOL))
        entry.draw_at(canvas, (_SYMBOL / 2, _SYMBOL / 2), _SYMBOL - 2)
        entries.append({"name": entry.name, "text": entry.text, "symbol": canvas.inline()})
    return entries


def _camera_of(scene: Scene) -> Camera:
    """A camera that sees the whole room, whatever its size."""
    fitting = camera_for(scene)
    factor = _SCALE / fitting.scale
    size = round(fitting.size[0] * factor), round(fitting.size[1] * factor)
    return Camera(_SCALE, fitting.left, fitting.top, size)


def _room_url(scene: Scene, camera: Camera, layers: Layers) -> str:
    """The room as SVG in a data URL, transparent outside."""
    canvas = SvgCanvas(camera.size)
    draw_still_parts(Brush(canvas, camera), scene, grid=layers.grid)
    return "data:image/svg+xml;base64," + base64.b64encode(ElementTree.tostring(canvas.root)).decode("ascii")


def _other_row(snapshot: Snapshot, k: int) -> list[float | None]:
    """The row of another robot, and whether it touches something, 1 or 0."""
    contacts = snapshot.contacts_of_robots
    return [*_robot_row(snapshot.robots[k]), 1.0 if contacts and contacts[k] else 0.0]


def _robot_row(robot: RobotState) -> list[float | None]:
    """x, y, theta, vx, vy, omega; the velocity in the body frame."""
    pose, twist = robot.pose, robot.twist
    return [_number(value) for value in (pose.x, pose.y, pose.theta, twist.vx, twist.vy, twist.omega)]


def _human_rows(snapshot: Snapshot) -> list[list[float | None] | None]:
    """For each pedestrian of the scene x, y, theta, head, speed, activity; None for an absent one."""
    humans = snapshot.humans
    rows: list[list[float | None] | None] = [None] * len(snapshot.scene.humans)
    indices = range(len(rows)) if humans.row is None else humans.row.tolist()
    for k, human, activity in zip(indices, humans, humans.activity_index.tolist(), strict=True):
        numbers = (human.pose.x, human.pose.y, human.pose.theta, human.head, math.hypot(*human.velocity))
        rows[k] = [*map(_number, numbers), activity]
    return rows


def _number(value: float) -> float | None:
    """A rounded number for JSON; None if it is not finite. Adding 0.0 turns -0.0 into 0.0."""
    return round(value, _DIGITS) + 0.0 if math.isfinite(value) else None
