"""An episode as one HTML file that plays it, without network: the room as a picture, what moves as numbers."""

from __future__ import annotations

import json
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
from .camera import Camera
from .caption import origin
from .draw import QUICK, Layers, backdrop, camera_for
from .palette import ACTIVITY, GOAL, ROBOT, Colour, shaded
from .still import url_of
from .things import half_size
from .ties import drawn_ties

_DIGITS = 3  # of metres, seconds and radians on a page
MANNERS = {
    "ignores": "ignores the robot",
    "avoids": "",
    "stops": "stops for the robot",
    "curious": "curious about the robot",
    "scared": "scared of the robot",
}
_SWITCHES = ("gaze", "links", "goal", "zones", "ids")  # layers with a box on the page
_ROOM_SIDE, _ROOM_SCALE = 1600.0, 160.0  # pixels, pixels a metre


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
    """Write a page that plays an episode: play, scrub, step, speed; what the pointer is on tells its numbers.

    Args:
        commands: (T, 3), or one row less as the last look has no command: m/s, m/s, rad/s; body frame.
        labels: (T,) or one less; texts, or whatever JSON can hold.
        layers: what is shown at first; the page has a box for each.
        caption: title, instead of the scenario's name.
        outcome: how the episode ended, shown at the end.

    Raises:
        RenderError: there is no frame, or the file cannot be written.
    """
    looks = list(snapshots)
    if not looks:
        raise RenderError("there is nothing to draw: the episode holds no frame")
    scene = looks[0].scene
    data = _scene_data(scene, layers or Layers()) | _frame_data(looks) | _told(commands, labels) | {"outcome": outcome}
    page = _template().render(title=scene.name if caption is None else caption, subtitle=origin(scene), data=data)
    try:
        Path(path).write_text(page, encoding="utf-8")
    except OSError as error:
        raise RenderError(f"cannot write {path}: {error}") from error


def _template() -> Any:
    """The page's template; its `tojson` leaves no `<` in a text, so that none can end the script."""
    environment = Environment(loader=PackageLoader(__package__, "."), autoescape=True)
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment.get_template("page.html")


def _scene_data(scene: Scene, layers: Layers) -> dict[str, Any]:
    """What stands still, and who there is."""
    camera = _room_camera(scene)
    width, height = (side / camera.scale for side in camera.size)
    tones = {**ACTIVITY, "robot": ROBOT, "goal": GOAL}
    return {
        "view": {"left": camera.left, "top": camera.top, "width": width, "height": height},
        "room": _room_image(scene, camera, layers),
        "dt": scene.rules.dt,
        "goal": [*scene.goal.position, scene.goal.distance],
        "robotRadius": scene.robot.radius,
        "humans": [
            {"id": h.id, "radius": h.radius, "ignores": h.reacts_to_robot == 0.0, "reaction": MANNERS[h.reaction]}
            for h in scene.humans
        ],
        "things": [
            {"id": f.id, "type": f.type, "x": f.pose.x, "y": f.pose.y, "radius": 0.8 * min(half_size(f))}
            for f in sorted(scene.furniture, key=lambda f: f.on is None)  # the laptop before its table
        ],
        "activities": ACTIVITIES,
        "colours": {name: _css(colour) for name, colour in tones.items()},
        "shades": {name: _css(shaded(colour)) for name, colour in tones.items()},
        "zones": (INTIMATE_DISTANCE, PERSONAL_DISTANCE),
        "layers": {"trails": True}
        | {name: getattr(layers, name) for name in ("gaze", "links", "goal", "zones", "ids")},
    }


def _room_camera(scene: Scene) -> Camera:
    """A camera fine enough for a large window, not so fine that the file grows large."""
    whole = camera_for(scene, scale=_ROOM_SCALE / 4)
    return camera_for(scene, scale=min(_ROOM_SCALE, _ROOM_SIDE / max(whole.size) * whole.scale))


def _room_image(scene: Scene, camera: Camera, layers: Layers) -> str:
    """The room as a PNG within a URL, transparent outside."""
    room = backdrop(scene, camera, layers, outside=None, fine=QUICK)
    return url_of(pygame.transform.smoothscale(room, camera.size))


def _frame_data(looks: Sequence[Snapshot]) -> dict[str, Any]:
    """What moves, one row a tick."""
    rows = [_human_rows(look) for look in looks]
    seen = {int(k) for look in looks for k in look.humans.activity_index}
    return {
        "time": [_number(look.time) for look in looks],
        "robot": [_robot_row(look) for look in looks],
        "people": [list(told) for told in zip(*rows, strict=True)],
        "links": _link_changes(looks),
        "touches": [tick for tick, look in enumerate(looks) if look.contacts],
        "clearance": [_number(_clearance(look)) for look in looks],
        "obstacleClearance": [_number(obstacle_clearance(look)) for look in looks],
        "shown": ["robot", "goal", *(ACTIVITIES[k] for k in sorted(seen))],
    }


def _robot_row(look: Snapshot) -> list[float | None]:
    """x, y, theta, ahead, left, omega."""
    pose, twist = look.robot.pose, look.robot.twist
    return [_number(value) for value in (pose.x, pose.y, pose.theta, twist.vx, twist.vy, twist.omega)]


def _human_rows(look: Snapshot) -> list[list[float | None] | None]:
    """Of each person of the scene x, y, theta, head, speed, activity; None for someone absent."""
    rows: list[list[float | None] | None] = [None] * len(look.scene.humans)
    where = range(len(rows)) if look.humans.row is None else look.humans.row.tolist()
    for k, human, activity in zip(where, look.humans, look.humans.activity_index.tolist(), strict=True):
        numbers = (human.pose.x, human.pose.y, human.pose.theta, human.head, math.hypot(*human.velocity))
        rows[k] = [*map(_number, numbers), activity]
    return rows


def _link_changes(looks: Sequence[Snapshot]) -> list[tuple[int, list[tuple[int, int]]]]:
    """(tick, links from then on), whenever they change."""
    changes: list[tuple[int, list[tuple[int, int]]]] = []
    for tick, look in enumerate(looks):
        links = [(link.src, link.dst) for link in drawn_ties(look)]
        if not changes or changes[-1][1] != links:
            changes.append((tick, links))
    return changes


def _clearance(look: Snapshot) -> float:
    """Gap to the nearest person who is there, m."""
    gaps = clearances(look)
    return float(gaps[np.isfinite(gaps)].min(initial=math.inf))


def _told(commands: Any, labels: Sequence[Any] | None) -> dict[str, Any]:
    """Commands and labels; of the labels' texts each stands once."""
    rows = None if commands is None else [[_number(float(v)) for v in row] for row in np.asarray(commands, dtype=float)]
    if labels is None:
        return {"commands": rows, "labels": None}
    texts = [_label_text(label) for label in labels]
    once = list(dict.fromkeys(texts))
    place = {text: k for k, text in enumerate(once)}
    return {"commands": rows, "labels": [place[text] for text in texts], "labelTexts": once}


def _label_text(label: Any) -> str:
    """A label in words: `name value, …` for a mapping."""
    if label is None or isinstance(label, str):
        return label or ""
    if isinstance(label, dict):
        return ", ".join(f"{name} {_label_text(value)}" for name, value in label.items())
    return json.dumps(label, default=str)


def _number(value: float) -> float | None:
    """A short number for JSON; None for what has no number there."""
    return round(value, _DIGITS) + 0.0 if math.isfinite(value) else None


def _css(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
