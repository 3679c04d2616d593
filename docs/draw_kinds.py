"""Draws the picture of docs/how-to/kinds-and-attributes.md that shows each kind of person.

python docs/draw_kinds.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import pygame

from sonata2d.core.entities import Goal, Human, Robot
from sonata2d.core.geometry import Pose
from sonata2d.core.person_kinds import BUILT_IN
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Scene
from sonata2d.scenegen.human_sampling import body_of_kind
from sonata2d.view.layers import Layers
from sonata2d.view.palette import INK
from sonata2d.view.stills import Still, save_surface, snapshot_of

ROOT = Path(__file__).parent.parent

SCALE, SPACE = 125.0, 0.45  # px/m; m between two outlines
LOW, HIGH = -0.7, 0.5  # m, lower and upper edge of the picture
ADULT = {"radius": 0.14, "breadth": 0.45, "desired_speed": 1.3, "headway": 1.0, "politeness": 1.0}


def main(folder: Path) -> None:
    """Draw the picture."""
    folder.mkdir(parents=True, exist_ok=True)
    people: list[Human] = []
    right = SPACE / 2  # m, of the last person and the space beside it
    for k, kind in enumerate(BUILT_IN, 1):
        body = body_of_kind(kind, ADULT, RandomStream(0, 0, "scene", k))
        half = max(body.get("length", 0.0), 2 * body["radius"], 0.7) / 2
        people.append(Human(k, Pose(right + half, 0.0), **body))
        right += 2 * half + SPACE
    left, right = 0.0, right - SPACE / 2
    corners = ((left, LOW), (right, LOW), (right, HIGH), (left, HIGH))
    # the robot and the goal are not part of the picture
    scene = Scene(
        "kinds", "kinds", corners, (), (), tuple(people), Robot(Pose(0.0, 0.0)), Goal(0.0, 0.0),
        unmeasured=frozenset({"robot", "goal"}),
    )  # fmt: skip
    still = Still(snapshot_of(scene), scale=SCALE, layers=Layers(gaze=False, grid=False, caption=False))
    canvas, camera = still.pixels(), still.camera
    for human in people:
        x, y = camera.to_pixels((human.pose.x, LOW))
        canvas.text(INK, human.kind.replace("_", " "), (x, y - 12), 18)
    (x0, y0), (x1, y1) = camera.to_pixels((left, HIGH)), camera.to_pixels((right, LOW))
    floor = pygame.Rect(round(x0), round(y0), round(x1 - x0), round(y1 - y0))
    save_surface(canvas.surface.subsurface(floor), folder / "kinds.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images")
