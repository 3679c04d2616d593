"""Episodes made by hand: no world is needed to record."""

from __future__ import annotations

from typing import Any

import numpy as np

from sonata2d.core.devices import DeviceEvent
from sonata2d.core.entities import (
    AT_LAPTOP,
    TALKING,
    WALKING_TOGETHER,
    Furniture,
    Goal,
    Group,
    Human,
    Interaction,
    Limits,
    Robot,
    Wall,
)
from sonata2d.core.geometry import Disc, Pose, Rectangle, Twist
from sonata2d.core.humans import Humans, human_ids
from sonata2d.core.portable_math import unit_vector, unit_vectors
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Author, Contact, Frame, Outcome, RobotState, Snapshot
from sonata2d.record.recorder import EpisodeRecorder

SQUARE = ((-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0))
AUTHOR = Author("tests:Creep", version="1", settings={"speed": 0.5}, labels={"near": "somebody is near"})
SPEED = 0.5  # m/s, ahead, of the robot


def scene(**changes: Any) -> Scene:
    """A room with one of everything."""
    given: dict[str, Any] = {
        "name": "by-hand",
        "family": "by-hand/square",
        "polygon": SQUARE,
        "walls": tuple(Wall(a, b) for a, b in zip(SQUARE, (*SQUARE[1:], SQUARE[0]), strict=True)),
        "furniture": (
            Furniture(10, "table", Pose(2.0, 3.0, 0.5), Rectangle(1.2, 0.8)),
            Furniture(11, "laptop", Pose(2.0, 3.0, 0.5), Rectangle(0.35, 0.25), on=10),
            Furniture(12, "plant", Pose(-3.5, 3.5), Disc(0.2)),
        ),
        "humans": (
            Human(1, Pose(2.0, 2.0, 1.5708), 0.2),
            Human(
                2, Pose(-2.0, -2.0, 3.1416), 0.2, desired_speed=1.1, behaviour="wandering", group=5, reacts_to_robot=0.0
            ),
            Human(3, Pose(-2.0, -2.6, 3.1416), 0.2, behaviour="wandering", group=5),
        ),
        "robot": Robot(Pose(-1.0, 0.0, 0.0), limits=Limits(ahead=0.8)),
        "goal": Goal(3.0, 0.0),
        "groups": (Group(5, "walking", (2, 3)),),
        "interactions": (Interaction(1, AT_LAPTOP, 11), Interaction(2, WALKING_TOGETHER, 3)),
        "rules": Rules(time_limit=20.0),
        "seed": 7,
        "episode": 3,
        "settings": {"name": "by-hand", "tiny": 0.00001},
        "dropped": ("plant 2 of 2",),
    }
    return Scene(**{**given, **changes})


def snapshot(of: Scene, tick: int, **changes: Any) -> Snapshot:
    """Where all are at a tick: the robot goes ahead, people who wander go to the left of the picture."""
    time = round(tick * of.rules.dt, 4)
    given: dict[str, Any] = {
        "tick": tick,
        "time": time,
        "scene": of,
        "robot": robot_state(of, time, moved=tick > 0),
        "humans": people(of, time),
        "interactions": of.interactions,
    }
    return Snapshot(**{**given, **changes})


def robot_state(of: Scene, time: float, *, moved: bool) -> RobotState:
    start, done = of.robot.pose, Twist(SPEED) if moved else Twist()
    place = (start.x + SPEED * time, start.y)
    return RobotState(place, unit_vector(start.theta), (SPEED, 0.0), 0.0, done, False, of.robot)


def people(of: Scene, time: float) -> Humans:
    """Those who wander walk at 0.2 m/s towards -x."""
    rows = np.zeros((len(of.humans), 9))
    for row, human in zip(rows, of.humans, strict=True):
        speed = -0.2 if human.behaviour == "wandering" else 0.0
        row[0:3] = human.pose.x + speed * time, human.pose.y, speed
    faces = unit_vectors(np.array([human.pose.theta for human in of.humans]))
    rows[:, 4:6] = rows[:, 6:8] = faces
    activity = np.array([1 if h.behaviour == "wandering" else 4 for h in of.humans], dtype=np.int64)
    return Humans(rows, human_ids(of), np.array([h.radius for h in of.humans]), activity)


def run(recorder: EpisodeRecorder, of: Scene | None = None, *, ticks: int = 6, labels: Any = None) -> list[Frame]:
    """Tell a recorder of an episode; what it was told."""
    of, told = of or scene(), []
    recorder.open(of, AUTHOR)
    for tick in range(ticks):
        frame = Frame(snapshot(of, tick, **extras(tick)), Twist(SPEED, 0.0, 0.0), labels(tick) if labels else None)
        recorder.note(frame)
        told.append(frame)
    last = snapshot(of, ticks)
    recorder.close(last, Outcome("stopped", "by hand", last.tick, last.time))
    return told


def extras(tick: int) -> dict[str, Any]:
    """What happens once: a touch and a key pressed at tick 2, other interactions from tick 4."""
    if tick == 2:
        return {"contacts": (Contact("human", 1, True, False),), "events": (DeviceEvent("keyboard", "w", 1.0),)}
    return {"interactions": (Interaction(2, TALKING, 3),)} if tick >= 4 else {}
