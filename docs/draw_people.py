"""Draws the films of docs/people.md: people who walk, meet, turn, and react to the robot.

    python docs/draw_people.py [FOLDER] [NAME ...]

Needs no display. The scenes are written by hand and run with the default world and crowd.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from sonata2d import Controller, Episode, Twist, generate, load_scenario
from sonata2d.core.entities import (
    TALKING,
    WALKING_TOGETHER,
    Furniture,
    Goal,
    Group,
    Human,
    Interaction,
    Reaction,
    Robot,
    Wall,
)
from sonata2d.core.geometry import Disc, Point, Pose, Rectangle
from sonata2d.core.scene import Rules, Scene, Social
from sonata2d.core.snapshot import Snapshot
from sonata2d.metrics.situations import SnapshotCollector
from sonata2d.view.draw import Layers
from sonata2d.view.film import save_film

ROOT = Path(__file__).parent.parent

SIZE, FPS, SPEED, MAX_BYTES = (380, 240), 7, 1.6, 300_000  # pixels, pictures per second, relative to real time
AWAY = Pose(-3.6, -2.1)  # where the robot waits


class StraightAhead(Controller):
    """Drives straight ahead at a constant speed, up to a given x."""

    def __init__(self, speed: float = 0.0, until: float = 1e9) -> None:
        self.speed, self.until = speed, until

    def act(self, snapshot: Snapshot) -> Twist:
        return Twist(vx=self.speed) if snapshot.robot.position[0] < self.until else Twist()


def scene(humans: Sequence[Human], seconds: float, robot: Pose = AWAY, **settings: object) -> Scene:
    """A room of 8 by 5 m."""
    polygon: tuple[Point, ...] = ((-4.0, -2.5), (4.0, -2.5), (4.0, 2.5), (-4.0, 2.5))
    inner = settings.pop("inner", ())
    edges = [Wall(a, b) for a, b in zip(polygon, (*polygon[1:], polygon[0]), strict=True)]
    rules = Rules(time_limit=seconds, ends_on=("time",))
    given = {"furniture": (), "seed": 0} | settings
    return Scene(
        "people", "people/given", polygon, (*edges, *inner), humans=tuple(humans), robot=Robot(robot),
        goal=Goal(3.5, 0.0), rules=rules, **given,
    )  # fmt: skip


def walker(number: int, start: Point, *goals: Point, speed: float = 1.3, **settings: object) -> Human:
    """A pedestrian who walks to its goals, starting at full speed."""
    dx, dy = goals[0][0] - start[0], goals[0][1] - start[1]
    size = math.hypot(dx, dy)
    return Human(
        number, Pose(*start, math.atan2(dy, dx)), desired_speed=speed, behaviour="walking", goals=goals,
        velocity=(speed * dx / size, speed * dy / size), **settings,
    )  # fmt: skip


def doorway() -> tuple[Scene, Controller]:
    """Three pedestrians in each direction pass a door of 1.0 m."""
    wall = (Wall((0.0, -2.5), (0.0, -0.5)), Wall((0.0, 0.5), (0.0, 2.5)))
    there = [walker(k, (-3.0 - 0.3 * k, 1.0 - 0.9 * k), (3.2, 1.4 - 0.7 * k), speed=1.2) for k in (1, 2, 3)]
    back = [walker(3 + k, (3.0 + 0.3 * k, 1.2 - 0.8 * k), (-3.0, 1.6 - 0.7 * k), speed=1.2) for k in (1, 2, 3)]
    return scene([*there, *back], 11.0, Pose(-3.5, 2.0), inner=wall), StraightAhead()


def crossing() -> tuple[Scene, Controller]:
    """Two streams of four cross at a right angle."""
    across = [walker(k, (-3.7 + 0.9 * (k // 3), 0.8 * (k % 2) - 0.4), (3.6, 0.8 * (k % 2) - 0.4)) for k in (1, 2, 3, 4)]
    up = [walker(4 + k, (0.8 * (k % 2), -2.3 + 0.8 * (k // 3)), (0.8 * (k % 2), 2.2), speed=1.1) for k in (1, 2, 3, 4)]
    return scene([*across, *up], 7.0, Pose(-3.6, 2.1)), StraightAhead()


def turn() -> tuple[Scene, Controller]:
    """The head turns towards the path ahead before the body does."""
    shelf = Furniture(9, "shelf", Pose(-0.5, 0.4), Rectangle(4.5, 0.6))
    return scene(
        [walker(1, (-3.2, -0.8), (3.0, -0.8), (2.4, 1.6), (-3.0, 1.6))], 11.0, furniture=(shelf,)
    ), StraightAhead()


def group() -> tuple[Scene, Controller]:
    """Three pedestrians walk together; another one joins a conversation of two."""
    pair = [Human(1, Pose(1.9, 0.3, math.pi / 2)), Human(2, Pose(1.9, 1.5, -math.pi / 2))]
    three = [
        Human(k, Pose(-3.2, -1.8 + 0.65 * (k - 3), 0.0), desired_speed=1.1, behaviour="wandering", group=1)
        for k in (3, 4, 5)
    ]
    comer = Human(6, Pose(-3.0, 1.9, 0.0), behaviour="wandering")
    interactions = (
        Interaction(1, TALKING, 2), Interaction(3, WALKING_TOGETHER, 4), Interaction(3, WALKING_TOGETHER, 5),
        Interaction(4, WALKING_TOGETHER, 5),
    )  # fmt: skip
    group_settings = {
        "interactions": interactions,
        "groups": (Group(1, "walking", (3, 4, 5)),),
        "social": Social(joins=1.0),
    }
    return scene([*pair, *three, comer], 16.0, Pose(3.5, -2.0), seed=3, **group_settings), StraightAhead()


def visit() -> tuple[Scene, Controller]:
    """Pedestrians visit a plant and a laptop; two who meet stop and talk."""
    furniture = (
        Furniture(10, "plant", Pose(-2.6, 1.6), Disc(0.2)), Furniture(11, "table", Pose(2.4, 1.7), Rectangle(0.8, 0.8)),
        Furniture(12, "laptop", Pose(2.4, 1.7), Rectangle(0.35, 0.25), on=11),
    )  # fmt: skip
    people = [Human(k, Pose(3.0 - 2.0 * k, -1.2, 0.0), behaviour="wandering") for k in (1, 2, 3)]
    social = Social(visits=0.8, meets=1.0, visit_time=(4.0, 6.0), talk_time=(5.0, 8.0))
    return scene(people, 20.0, Pose(3.4, -2.0), furniture=furniture, social=social, seed=1), StraightAhead()


def preset(name: str, seed: int, seconds: float) -> Callable[[], tuple[Scene, Controller]]:
    """A preset, from its start, without the robot's reaching its goal."""

    def build() -> tuple[Scene, Controller]:
        rules = {"time_limit": seconds, "ends_on": ["time"]}
        return generate(load_scenario(name).changed(rules=rules), seed), StraightAhead()

    return build


def reacting(reaction: Reaction) -> Callable[[], tuple[Scene, Controller]]:
    """A robot drives through the room; one person crosses its path, another stands beside it."""

    def build() -> tuple[Scene, Controller]:
        crosses = walker(1, (3.0, -2.1), (-1.5, 2.1), speed=0.9, reaction=reaction)
        stands = Human(2, Pose(1.7, 1.3, 0.6), reaction=reaction)
        until, seconds = (-0.3, 15.0) if reaction == "curious" else (3.3, 9.0)
        return scene([crosses, stands], seconds, Pose(-2.3, 0.0)), StraightAhead(1.0, until)

    return build


FILMS: dict[str, Callable[[], tuple[Scene, Controller]]] = {
    "doorway": doorway, "crossing": crossing, "turn": turn, "group": group, "visit": visit,
    "waiting": preset("waiting-room", 5, 22.0), "flows": preset("crossing-flows", 1, 20.0),
    **{kind: reacting(kind) for kind in ("ignores", "avoids", "stops", "curious", "scared")},
}  # fmt: skip


def snapshots_of(name: str) -> list[Snapshot]:
    """The snapshots of a film."""
    start, controller = FILMS[name]()
    collector = SnapshotCollector()
    Episode(start, controller, observers=[collector]).run()
    return collector.snapshots


def main(folder: Path, names: Sequence[str]) -> None:
    """Draw the named films, or all."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names or FILMS:
        path = folder / f"people_{name}.gif"
        layers = Layers(goal=False, grid=False, caption=False)
        save_film(path, snapshots_of(name), fps=FPS, speed=SPEED, size=SIZE, layers=layers, interpolate=False)
        if path.stat().st_size > MAX_BYTES:
            raise SystemExit(f"{path} has {path.stat().st_size} bytes; make the film smaller or shorter")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images", sys.argv[2:])
