"""Draws the films of docs/people.md: people who walk, meet, turn, and react to the robot.

    python docs/draw_people.py [FOLDER] [NAME ...]

Needs no display. The scenes are written by hand and run with the default world and crowd.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from sonata2d import Controller, Episode, EpisodeRecorder, Twist, generate, load_scenario
from sonata2d.core.entities import Furniture, Goal, Group, Human, Interaction, Reaction, Robot, Wall
from sonata2d.core.geometry import Disc, Point, Pose, Rectangle
from sonata2d.core.relations import TALKING, WALKING_TOGETHER
from sonata2d.core.scene import Rules, Scene, Social
from sonata2d.core.snapshot import Snapshot
from sonata2d.view.film import save_film
from sonata2d.view.layers import Layers

ROOT = Path(__file__).parent.parent

SIZE, FPS, SPEED, MAX_BYTES = (380, 240), 7, 1.6, 600_000  # pixels, pictures per second, relative to real time
AWAY = Pose(-3.6, -2.1)  # where the robot waits


class StraightAhead(Controller):
    """Drives straight ahead at a constant speed, up to a given x."""

    def __init__(self, speed: float = 0.0, until: float = 1e9) -> None:
        self.speed, self.until = speed, until

    def act(self, snapshot: Snapshot) -> Twist:
        return Twist(vx=self.speed) if snapshot.robot.position[0] < self.until else Twist()


def scene(
    humans: Sequence[Human], seconds: float, robot: Pose = AWAY, size: Point = (8.0, 5.0), **settings: object
) -> Scene:
    """A rectangular room, by default of 8 by 5 m, around the origin."""
    x, y = size[0] / 2, size[1] / 2
    polygon: tuple[Point, ...] = ((-x, -y), (x, -y), (x, y), (-x, y))
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


def wandering() -> tuple[Scene, Controller]:
    """Pedestrians wander, stand for a while, and go on."""
    furniture = (
        Furniture(10, "table", Pose(-1.2, 0.2), Rectangle(1.4, 0.8)),
        Furniture(11, "plant", Pose(2.6, -1.4), Disc(0.25)),
        Furniture(12, "shelf", Pose(1.8, 2.2), Rectangle(1.6, 0.4)),
    )  # fmt: skip
    starts = ((-3.0, 1.5), (-0.5, 1.8), (2.9, 0.8), (1.0, -1.7), (-2.5, -1.2))
    people = [Human(k, Pose(x, y, 0.7 * k), behaviour="wandering") for k, (x, y) in enumerate(starts, 1)]
    return scene(people, 20.0, Pose(3.6, -2.1), furniture=furniture, social=Social(pause=(1.0, 4.0))), StraightAhead()


def doorway() -> tuple[Scene, Controller]:
    """Three pedestrians in each direction pass a door of 0.8 m."""
    wall = (Wall((0.0, -2.5), (0.0, -0.4)), Wall((0.0, 0.4), (0.0, 2.5)))
    there = [walker(k, (-3.0 - 0.3 * k, 1.0 - 0.9 * k), (3.2, 1.4 - 0.7 * k), speed=1.2) for k in (1, 2, 3)]
    back = [walker(3 + k, (3.0 + 0.3 * k, 1.2 - 0.8 * k), (-3.0, 1.6 - 0.7 * k), speed=1.2) for k in (1, 2, 3)]
    return scene([*there, *back], 11.0, Pose(-3.5, 2.0), inner=wall), StraightAhead()


def crossing() -> tuple[Scene, Controller]:
    """Two streams of four cross at a right angle."""
    across = [walker(k, (-3.7 + 0.9 * (k // 3), 0.8 * (k % 2) - 0.4), (3.6, 0.8 * (k % 2) - 0.4)) for k in (1, 2, 3, 4)]
    up = [walker(4 + k, (0.8 * (k % 2), -2.3 + 0.8 * (k // 3)), (0.8 * (k % 2), 2.2), speed=1.1) for k in (1, 2, 3, 4)]
    return scene([*across, *up], 7.0, Pose(-3.6, 2.1)), StraightAhead()


def groups() -> tuple[Scene, Controller]:
    """A pair and three others meet, each group abreast."""
    pair = [walker(k, (-3.5, 0.2 - 0.75 * (k - 1)), (3.6, 0.1 - 0.75 * (k - 1)), speed=1.2, group=1) for k in (1, 2)]
    three = [
        walker(k, (3.5, 0.8 - 0.75 * (k - 3)), (-3.6, 0.8 - 0.75 * (k - 3)), speed=1.15, group=2) for k in (3, 4, 5)
    ]
    together = (Group(1, "walking", (1, 2)), Group(2, "walking", (3, 4, 5)))
    links = tuple(Interaction(a, WALKING_TOGETHER, b) for a, b in ((1, 2), (3, 4), (3, 5), (4, 5)))
    return scene([*pair, *three], 7.0, Pose(-3.6, 2.1), groups=together, interactions=links), StraightAhead()


def ring() -> tuple[Scene, Controller]:
    """Twenty pedestrians on a circle walk to the opposite side at once."""
    angles = [2.0 * math.pi * k / 20 for k in range(20)]
    people = [
        Human(k, Pose(3.2 * math.cos(a), 3.2 * math.sin(a), a + math.pi), behaviour="walking",
              goals=((-3.2 * math.cos(a), -3.2 * math.sin(a)),), desired_speed=1.3)
        for k, a in enumerate(angles, 1)
    ]  # fmt: skip
    return scene(people, 14.0, Pose(-5.6, -3.4), size=(12.2, 7.7)), StraightAhead()


def evacuation() -> tuple[Scene, Controller]:
    """Forty pedestrians leave a room by a door of 1.0 m."""
    wall = (Wall((2.0, -2.5), (2.0, -0.5)), Wall((2.0, 0.5), (2.0, 2.5)))
    people = [
        Human(k + 1, Pose(-3.5 + 0.7 * (k % 8), -2.0 + 1.0 * (k // 8), 0.0), behaviour="walking", exits=True,
              goals=((2.6, -0.2 + 0.1 * (k // 8)), (3.6, 0.6 * (k // 8) - 1.2)), desired_speed=1.1 + 0.1 * (k % 5))
        for k in range(40)
    ]  # fmt: skip
    return scene(people, 14.0, Pose(3.6, -2.2), inner=wall), StraightAhead()


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
    "wandering": wandering, "doorway": doorway, "crossing": crossing, "turn": turn, "groups": groups, "ring": ring,
    "evacuation": evacuation, "group": group, "visit": visit,
    "waiting": preset("waiting-room", 5, 22.0), "flows": preset("crossing-flows", 1, 20.0),
    **{kind: reacting(kind) for kind in ("ignores", "avoids", "stops", "curious", "scared")},
}  # fmt: skip


def snapshots_of(name: str) -> list[Snapshot]:
    """The snapshots of a film."""
    start, controller = FILMS[name]()
    recorder = EpisodeRecorder()
    Episode(start, controller, observers=[recorder]).run()
    return list(recorder.record().snapshots())


def main(folder: Path, names: Sequence[str]) -> None:
    """Draw the named films, or all."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names or FILMS:
        path = folder / f"people_{name}.gif"
        layers = Layers(goal=False, grid=False, caption=False, gaze=name != "evacuation")
        save_film(path, snapshots_of(name), fps=FPS, speed=SPEED, size=SIZE, layers=layers, interpolate=False)
        if path.stat().st_size > MAX_BYTES:
            raise SystemExit(f"{path} has {path.stat().st_size} bytes; make the film smaller or shorter")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images", sys.argv[2:])
