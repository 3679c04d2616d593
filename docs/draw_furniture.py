"""Draws the picture of docs/scenario.md that shows each type of furniture at theta 0.

python docs/draw_furniture.py [FOLDER]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pygame

from sonata2d.core.entities import Furniture, Goal, Human, Interaction, Robot
from sonata2d.core.furniture_types import BUILT_IN
from sonata2d.core.geometry import Pose
from sonata2d.core.scene import Scene
from sonata2d.scenegen.pieces import shape_of_size
from sonata2d.view.brush import Brush
from sonata2d.view.furniture import half_size
from sonata2d.view.layers import Layers
from sonata2d.view.palette import BLUE, FAINT, INK, Colour
from sonata2d.view.stills import Still, save_surface, snapshot_of

ROOT = Path(__file__).parent.parent

SCALE, SPACE = 105.0, 0.5  # px/m; m between the outlines of two pieces
LOW, HIGH = -1.0, 0.82  # m, lower and upper edge of the picture
AXIS = 0.3  # m beyond the outline, to the left
MINIMUM_WIDTH = 1.0  # m, of the space of a piece
STAND = 0.45  # m, from the outline of a piece to a person who attends to it


def main(folder: Path) -> None:
    """Draw the picture."""
    folder.mkdir(parents=True, exist_ok=True)
    furniture: list[Furniture] = []
    right = SPACE / 2  # m, of the last piece and the space beside it
    for kind in BUILT_IN:
        if kind.size is not None:
            piece = Furniture(len(furniture), kind.name, Pose(0.0, 0.0), shape_of_size(kind.size))
            width = max(2 * half_size(piece)[0], MINIMUM_WIDTH)
            furniture.append(replace(piece, pose=Pose(right + width / 2, 0.0)))
            right += width + SPACE
    left, right = 0.0, right - SPACE / 2
    attended = {kind.name: kind.relation for kind in BUILT_IN if kind.relation is not None}
    people = [
        Human(10 + item.id, Pose(item.pose.x, -half_size(item)[1] - STAND, 1.5708), 0.16)
        for item in furniture
        if item.type in attended
    ]
    interactions = tuple(
        Interaction(10 + item.id, attended[item.type], item.id) for item in furniture if item.type in attended
    )
    corners = ((left, LOW), (right, LOW), (right, HIGH), (left, HIGH))
    # the robot and the goal are not part of the picture
    scene = Scene(
        "furniture", "furniture", corners, (), tuple(furniture), tuple(people), Robot(Pose(0.0, 0.0)),
        Goal(0.0, 0.0), interactions=interactions, unmeasured=frozenset({"robot", "goal"}),
    )  # fmt: skip
    layers = Layers(gaze=False, links=False, grid=False, caption=False)
    still = Still(snapshot_of(scene), scale=SCALE, layers=layers)
    canvas, camera = still.pixels(), still.camera
    brush = Brush(canvas, camera)
    for item in furniture:
        draw_axis(brush, item, (1.0, 0.0), "x")
        draw_axis(brush, item, (0.0, 1.0), "y")
        x, y = camera.to_pixels((item.pose.x, LOW))
        brush.canvas.text(INK, item.type, (x, y - 12), 18)
    (x0, y0), (x1, y1) = camera.to_pixels((left, HIGH)), camera.to_pixels((right, LOW))
    floor = pygame.Rect(round(x0), round(y0), round(x1 - x0), round(y1 - y0))
    save_surface(canvas.surface.subsurface(floor), folder / "furniture.png")


def draw_axis(brush: Brush, item: Furniture, direction: tuple[float, float], name: str) -> None:
    """Draw an arrow from the centre of a piece to beyond its outline."""
    half = half_size(item)["xy".index(name)]
    length = half + (AXIS if name == "y" else SPACE / 2 - 0.1)
    colour: Colour = BLUE if name == "x" else FAINT
    arrow = brush.at(item.pose.position, direction)
    arrow.stroke(colour, [(0.0, 0.0), (length - 0.05, 0.0)], 0.02)
    arrow.polygon(colour, [(length, 0.0), (length - 0.11, 0.045), (length - 0.11, -0.045)])
    x, y = brush.camera.to_pixels(
        (item.pose.x + (length + 0.08) * direction[0], item.pose.y + (length + 0.08) * direction[1])
    )
    brush.canvas.text(colour, name, (x, y), 18)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images")
