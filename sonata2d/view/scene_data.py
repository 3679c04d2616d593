"""Scenes and snapshots as JSON for `drawing.js`, which draws them in a browser."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE, clearances, obstacle_clearance, touched_kind
from ..core.relations import ACTIVITIES, ACTIVITY
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from .brush import Brush
from .camera import Camera
from .draw import Layers, camera_for
from .furniture import draw_furniture, half_size
from .landmarks import draw_landmarks
from .layers import visible_interactions
from .legend import Legend
from .palette import BLUE, DARK, FAINT, FLOOR, GOAL, HAIR, INK, PAPER, ROBOT, Colour, hex_colour, mixed, shaded
from .room import FloorPlan, draw_room
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
_ROOM_SCALE = (
    100.0  # px/m of the drawing of the room, whose lines then have two decimals; browsers draw it at any scale
)


def _tones(colour: Colour) -> dict[str, Colour]:
    """The tones in which the body of a person is drawn."""
    return {
        "fill": colour,
        "dark": shaded(colour),
        "outline": shaded(colour, 0.25),
        "body": mixed(FLOOR, colour, 0.28),
        "plain": mixed(FLOOR, colour, 0.7),
        "feet": shaded(colour, 0.6),
        "sleeve": mixed(shaded(colour), colour, 0.5),
    }


_COLOURS = {
    "robot": ROBOT,
    "robotEdge": shaded(ROBOT),
    "goal": GOAL,
    "goalFloor": mixed(FLOOR, GOAL, 0.16),
    "zone": BLUE,
    "intimateLine": mixed(FLOOR, INK, 0.3),
    "personalLine": mixed(FLOOR, INK, 0.22),
    "link": FAINT,
    "dark": DARK,
    "paper": PAPER,
    "ink": INK,
    "hair": HAIR,
    "crown": mixed(HAIR, PAPER, 0.18),
}


def scene_data(scene: Scene, layers: Layers = Layers()) -> dict[str, Any]:  # noqa: B008  frozen
    """What does not change during an episode.

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
        "walls": [[*wall.start, *wall.end] for wall in scene.walls],
        "goal": [*scene.goal.position, scene.goal.distance],
        "robotRadius": scene.robot.radius,
        "humans": [
            {
                "id": h.id,
                "radius": h.radius,
                "shoulder": h.shoulder if "headings" not in scene.unmeasured else 0.0,
                "ignores": h.reacts_to_robot == 0.0,
                "reaction": _REACTIONS[h.reaction] if "robot" not in scene.unmeasured else "",
                "path": hex_colour(human_tones(k)[-1]),
            }
            for k, h in enumerate(scene.humans)
        ],
        "things": [
            {"id": f.id, "type": f.type, "x": f.pose.x, "y": f.pose.y, "radius": 0.8 * min(half_size(f))}
            for f in sorted(scene.furniture, key=lambda f: f.on is None)  # the pointer finds a laptop before its table
        ],
        "activities": ACTIVITIES,
        "activityTexts": {name: activity.text for name, activity in ACTIVITY.items()},
        "tones": {
            name: {key: hex_colour(tone) for key, tone in _tones(activity.colour).items()}
            for name, activity in ACTIVITY.items()
        },
        "poses": {
            name: {key: getattr(activity, key) for key in ("foot", "stride", "limbs", "width")}
            for name, activity in ACTIVITY.items()
        },
        "colours": {name: hex_colour(colour) for name, colour in _COLOURS.items()},
        "zones": (INTIMATE_DISTANCE, PERSONAL_DISTANCE),
    }


def state_data(snapshot: Snapshot) -> dict[str, Any]:
    """What changes from tick to tick: time, rows of robot and pedestrians, links, contact, distances."""
    return {
        "time": _number(snapshot.time),
        "robot": _robot_row(snapshot),
        "people": _human_rows(snapshot),
        "links": [(link.src, link.dst) for link in visible_interactions(snapshot)],
        "touches": touched_kind(snapshot),
        "clearance": _number(_clearance(snapshot)),
    }


def states_data(snapshots: Sequence[Snapshot]) -> list[dict[str, Any]]:
    """The states of an episode; one that has no `links` has those of the state before."""
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
    factor = _ROOM_SCALE / fitting.scale
    size = round(fitting.size[0] * factor), round(fitting.size[1] * factor)
    return Camera(_ROOM_SCALE, fitting.left, fitting.top, size)


def _room_url(scene: Scene, camera: Camera, layers: Layers) -> str:
    """The room as SVG in a data URL, transparent outside."""
    canvas = SvgCanvas(camera.size)
    brush = Brush(canvas, camera)
    draw_room(brush, FloorPlan.of(scene), grid=layers.grid)
    draw_landmarks(brush, scene)
    draw_furniture(brush, scene)
    return "data:image/svg+xml;base64," + base64.b64encode(ElementTree.tostring(canvas.root)).decode("ascii")


def _robot_row(snapshot: Snapshot) -> list[float | None]:
    """x, y, theta, vx, vy, omega; the velocity in the body frame."""
    pose, twist = snapshot.robot.pose, snapshot.robot.twist
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


def _clearance(snapshot: Snapshot) -> float:
    """Gap between the robot and the nearest pedestrian, m; infinite without pedestrians."""
    gaps = clearances(snapshot)
    return float(gaps[np.isfinite(gaps)].min(initial=math.inf))


def _number(value: float) -> float | None:
    """A rounded number for JSON; None if it is not finite. Adding 0.0 turns -0.0 into 0.0."""
    return round(value, _DIGITS) + 0.0 if math.isfinite(value) else None
