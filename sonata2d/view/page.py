"""Writes an episode as one HTML file that plays it offline: the room as an image, the agents as numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pygame
from jinja2 import Environment, PackageLoader

from ..core.humans import ACTIVITIES
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE, clearances, obstacle_clearance
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import RenderError
from .annotations import origin, value_text
from .camera import Camera
from .draw import QUICK, Layers, backdrop, camera_for
from .furniture import half_size
from .layers import visible_interactions
from .legend import Legend, english, name_of
from .palette import ACTIVITY, BLUE, GOAL, ROBOT, hex_colour, shaded
from .stills import url_of, write_file
from .svg import SvgCanvas
from .trails import human_tones

_DIGITS = 3  # decimal places of metres, seconds and radians
_REACTIONS = {
    "ignores": "ignores the robot",
    "avoids": "",
    "stops": "stops for the robot",
    "curious": "curious about the robot",
    "scared": "scared of the robot",
}
_SWITCHES = {  # layers that have a check box on the page, and its text; the legend has the same words
    "trails": english("paths"),
    "gaze": english("gaze"),
    "links": english("interaction"),
    "goal": english("goal"),
    "zones": "intimate and personal space",
    "ids": "ids",
}
_LAYERS = {"gaze": "gaze", "interaction": "links", "goal": "goal", "paths": "trails", "zones": "zones"}  # of symbols
_UNUSED = "shared"  # symbol that the page does not draw
_SYMBOL = 20  # px, width of a symbol of the legend
_MAX_ROOM_SIDE, _MAX_ROOM_SCALE = 1600.0, 160.0  # px, px/m: fine enough for a large window, still a small file


def save_page(
    path: str | Path,
    snapshots: Iterable[Snapshot],
    *,
    commands: Any = None,
    labels: Sequence[Any] | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
    outcome: str | None = None,
) -> None:
    """Write a page that plays an episode: play, scrub, step, speed; the pointer shows the values of an entity.

    Args:
        path: the file to write.
        snapshots: of one episode, in order.
        commands: (T, 3) or (T - 1, 3), as the last snapshot has no command: m/s, m/s, rad/s; body frame.
        labels: (T,) or (T - 1,): texts or JSON values.
        layers: layers that are visible at first; the page has a check box for most of them.
        caption: title; by default the scenario's name.
        outcome: how the episode ended, shown at its last tick.

    Raises:
        RenderError: `snapshots` is empty, or the file cannot be written.
    """
    page = page_of(snapshots, commands=commands, labels=labels, layers=layers, caption=caption, outcome=outcome)
    write_file(path, page.encode())


def page_of(
    snapshots: Iterable[Snapshot],
    *,
    commands: Any = None,
    labels: Sequence[Any] | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
    outcome: str | None = None,
) -> str:
    """The page that `save_page` writes, with the same arguments.

    Raises:
        RenderError: `snapshots` is empty.
    """
    snapshots = list(snapshots)
    if not snapshots:
        raise RenderError("there is nothing to draw: the episode holds no frame")
    scene = snapshots[0].scene
    data = _scene_data(scene, layers or Layers()) | _frame_data(snapshots)
    is_driven = "robot" not in scene.unmeasured
    data |= _controller_data(commands if is_driven else None, labels if is_driven else None)
    data["outcome"] = None if "outcome" in scene.unmeasured else outcome
    title = scene.name if caption is None else caption
    page: str = _template().render(title=title, subtitle=origin(scene), data=data, legend=_legend(snapshots))
    return page


def _template() -> Any:
    """The page's template; its `tojson` filter escapes `<`, so that no text can end the script element."""
    environment = Environment(loader=PackageLoader(__package__, "."), autoescape=True)
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment.get_template("page.html")


def _legend(snapshots: Sequence[Snapshot]) -> list[dict[str, str]]:
    """The symbols of all layers of the page: meaning, name of the layer (empty if always visible), and drawing."""
    entries = []
    for entry in Legend.of(snapshots, Layers(zones=True, legend=True), paths=True).entries:
        if entry.name != _UNUSED:
            canvas = SvgCanvas((_SYMBOL, _SYMBOL))
            entry.draw_at(canvas, (_SYMBOL / 2, _SYMBOL / 2), _SYMBOL - 2)
            entries.append({"text": entry.text, "layer": _LAYERS.get(entry.name, ""), "symbol": canvas.inline()})
    return entries


def _scene_data(scene: Scene, layers: Layers) -> dict[str, Any]:
    """The static part of the page's data."""
    camera = _room_camera(scene)
    width, height = (side / camera.scale for side in camera.size)
    tones = {**ACTIVITY, "robot": ROBOT, "goal": GOAL, "zone": BLUE}
    return {
        "view": {"left": camera.left, "top": camera.top, "width": width, "height": height},
        "room": _room_image(scene, camera, layers),
        "dt": scene.rules.dt,
        "unmeasured": sorted(scene.unmeasured),
        "outline": scene.polygon,
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
        "activityTexts": {name: english(name_of(name)) for name in ACTIVITIES},
        "colours": {name: hex_colour(colour) for name, colour in tones.items()},
        "shades": {name: hex_colour(shaded(colour)) for name, colour in tones.items()},
        "outlines": {name: hex_colour(shaded(colour, 0.25)) for name, colour in ACTIVITY.items()},
        "zones": (INTIMATE_DISTANCE, PERSONAL_DISTANCE),
        "layers": {name: name == "trails" or getattr(layers, name) for name in _switches(scene)},
        "layerTexts": _SWITCHES,
    }


def _switches(scene: Scene) -> list[str]:
    """The layers that have a check box on the page of a scene: those of which something is known."""
    unknown = {"gaze"} if "heads" in scene.unmeasured else set()
    unknown |= {"goal"} & scene.unmeasured
    return [name for name in _SWITCHES if name not in unknown]


def _room_camera(scene: Scene) -> Camera:
    whole = camera_for(scene, scale=_MAX_ROOM_SCALE / 4)
    return camera_for(scene, scale=min(_MAX_ROOM_SCALE, _MAX_ROOM_SIDE / max(whole.size) * whole.scale))


def _room_image(scene: Scene, camera: Camera, layers: Layers) -> str:
    """The room as a PNG in a data URL, transparent outside."""
    room = backdrop(scene, camera, layers, outside=None, fine=QUICK)
    return url_of(pygame.transform.smoothscale(room, camera.size))


def _frame_data(snapshots: Sequence[Snapshot]) -> dict[str, Any]:
    """The part of the page's data that changes over time; mostly lists with one entry per tick."""
    rows = [_human_rows(snapshot) for snapshot in snapshots]
    return {
        "time": [_number(snapshot.time) for snapshot in snapshots],
        "robot": [_robot_row(snapshot) for snapshot in snapshots],
        "people": [list(human_rows) for human_rows in zip(*rows, strict=True)],
        "links": _link_changes(snapshots),
        "touches": [tick for tick, snapshot in enumerate(snapshots) if snapshot.contacts],
        "clearance": [_number(_clearance(snapshot)) for snapshot in snapshots],
        "obstacleClearance": [_number(obstacle_clearance(snapshot)) for snapshot in snapshots],
    }


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


def _link_changes(snapshots: Sequence[Snapshot]) -> list[tuple[int, list[tuple[int, int]]]]:
    """(tick, links from this tick on) for each tick at which the links change."""
    changes: list[tuple[int, list[tuple[int, int]]]] = []
    for tick, snapshot in enumerate(snapshots):
        links = [(link.src, link.dst) for link in visible_interactions(snapshot)]
        if not changes or changes[-1][1] != links:
            changes.append((tick, links))
    return changes


def _clearance(snapshot: Snapshot) -> float:
    """Gap between the robot and the nearest pedestrian, m; infinite without pedestrians."""
    gaps = clearances(snapshot)
    return float(gaps[np.isfinite(gaps)].min(initial=math.inf))


def _controller_data(commands: Any, labels: Sequence[Any] | None) -> dict[str, Any]:
    """Commands and labels; each distinct label text is stored once."""
    rows = None if commands is None else [[_number(float(v)) for v in row] for row in np.asarray(commands, dtype=float)]
    if labels is None:
        return {"commands": rows, "labels": None}
    texts = ["" if label is None else value_text(label) for label in labels]
    distinct = list(dict.fromkeys(texts))
    index = {text: k for k, text in enumerate(distinct)}
    return {"commands": rows, "labels": [index[text] for text in texts], "labelTexts": distinct}


def _number(value: float) -> float | None:
    """A rounded number for JSON; None if it is not finite. Adding 0.0 turns -0.0 into 0.0."""
    return round(value, _DIGITS) + 0.0 if math.isfinite(value) else None
