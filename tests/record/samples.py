"""Episodes created without a world, from hand-written snapshots."""

from __future__ import annotations

from typing import Any

import numpy as np

from sonata2d.core.devices import DeviceEvent
from sonata2d.core.entities import Furniture, Goal, Group, Human, Interaction, Limits, Robot, Wall
from sonata2d.core.geometry import Disc, Pose, Rectangle, Twist
from sonata2d.core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, VX, Humans, X, Y
from sonata2d.core.portable_math import unit_vector, unit_vectors
from sonata2d.core.relations import AT_LAPTOP, TALKING, WALKING_TOGETHER
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.snapshot import Contact, ControllerInfo, Frame, Outcome, RobotState, Snapshot
from sonata2d.record.recorder import EpisodeRecorder

SQUARE = ((-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0))
CONTROLLER_INFO = ControllerInfo(
    "tests:Creep", version="1", settings={"speed": 0.5}, labels={"near": "somebody is near"}
)
SPEED = 0.5  # m/s, of the robot, forward


def scene(**changes: Any) -> Scene:
    """A scene with an entity of every kind.

    Args:
        changes: fields of `Scene` to replace.
    """
    fields: dict[str, Any] = {
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
        "rules": Rules(time_limit=20.0, substeps=10),
        "seed": 7,
        "episode": 3,
        "settings": {"name": "by-hand", "tiny": 0.00001},
        "dropped": ("plant 2 of 2",),
    }
    return Scene(**{**fields, **changes})


def snapshot(of: Scene, tick: int, **changes: Any) -> Snapshot:
    """The snapshot at a tick: the robot moves along x, wandering pedestrians move along -x.

    Args:
        of: the scene.
        tick: of the snapshot.
        changes: fields of `Snapshot` to replace.
    """
    time = round(tick * of.rules.dt, 4)
    fields: dict[str, Any] = {
        "tick": tick,
        "time": time,
        "scene": of,
        "robot": robot_state(of, time, moved=tick > 0),
        "humans": people(of, time),
        "interactions": of.interactions,
    }
    return Snapshot(**{**fields, **changes})


def robot_state(of: Scene, time: float, *, moved: bool) -> RobotState:
    """The state of the robot after `time` (s); `moved`: whether it has executed a command."""
    start, executed = of.robot.pose, Twist(SPEED) if moved else Twist()
    position = (start.x + SPEED * time, start.y)
    return RobotState(position, unit_vector(start.theta), (SPEED, 0.0), 0.0, executed, False, of.robot)


def people(of: Scene, time: float) -> Humans:
    """The pedestrians after `time` (s): wandering ones walk at 0.2 m/s along -x."""
    rows = np.zeros((len(of.humans), 9))
    for row, human in zip(rows, of.humans, strict=True):
        speed = -0.2 if human.behaviour == "wandering" else 0.0
        row[X], row[Y], row[VX] = human.pose.x + speed * time, human.pose.y, speed
    directions = unit_vectors(np.array([human.pose.theta for human in of.humans]))
    rows[:, BODY_X : BODY_Y + 1] = rows[:, GAZE_X : GAZE_Y + 1] = directions
    activity = np.array([1 if h.behaviour == "wandering" else 4 for h in of.humans], dtype=np.int64)
    return of.human_table.with_state(rows, activity)


def run(recorder: EpisodeRecorder, of: Scene | None = None, *, ticks: int = 6, labels: Any = None) -> list[Frame]:
    """Record an episode.

    Args:
        recorder: receives the episode.
        of: the scene; default: `scene()`.
        ticks: number of frames.
        labels: function of the tick that returns the frame's label.

    Returns:
        The recorded frames.
    """
    of, frames = of or scene(), []
    recorder.open(of, CONTROLLER_INFO)
    for tick in range(ticks):
        frame = Frame(snapshot(of, tick, **events_at(tick)), Twist(SPEED, 0.0, 0.0), labels(tick) if labels else None)
        recorder.on_frame(frame)
        frames.append(frame)
    last = snapshot(of, ticks)
    recorder.close(last, Outcome("stopped", "by hand", last.tick, last.time))
    return frames


def events_at(tick: int) -> dict[str, Any]:
    """Fields of the snapshot at some ticks: a contact and a pressed key at tick 2, another interaction from tick 4."""
    if tick == 2:
        return {"contacts": (Contact("human", 1, True, False),), "events": (DeviceEvent("keyboard", "w", 1.0),)}
    return {"interactions": (Interaction(2, TALKING, 3),)} if tick >= 4 else {}
