"""A recorded episode in memory: its document, arrays over all ticks, and the scene, snapshots and frames."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsIndex, overload

import numpy as np

from ..core.devices import NETWORK_DEVICE, PREDICTED, ROUND_TRIP, DeviceEvent
from ..core.drawable import Drawable
from ..core.entities import OtherRobot
from ..core.geometry import Twist
from ..core.humans import BODY_X, BODY_Y, GAZE_X, GAZE_Y, OMEGA, VX, VY, Humans, X, Y, frozen
from ..core.labels import LabelSpec
from ..core.portable_math import Array, BoolArray, IntArray, unit_vector, unit_vectors
from ..core.scene import Scene
from ..core.snapshot import Contact, ControllerInfo, Frame, Outcome, RobotState, Snapshot, door_states
from ..core.tasks import next_stage, set_present_goal
from ..core.wording import counted
from ..view.drawing import Drawing, drawing_of
from .columns import Columns, States, columns_of
from .counts import run_counts
from .frames import never_entered
from .layout import (
    COMMAND_NAMES,
    ROW_HEAD,
    ROW_OMEGA,
    ROW_THETA,
    ROW_VX,
    ROW_VY,
    ROW_X,
    ROW_Y,
    JsonDict,
    interactions_from_rows,
    scene_from_json,
)
from .views import document_seen_by, document_until_arrival, document_with_robots_as_people

if TYPE_CHECKING:
    from ..agents.sensors.base import Readings, Sensor


@dataclass(frozen=True, eq=False, repr=False)
class EpisodeRecord(Drawable):
    """A recorded episode of T frames and N people. Its arrays are read-only.

    `record[i]` is the snapshot of frame i, `record[2:5]` a list of snapshots, and `for snapshot in record` iterates
    over the snapshots of all T frames. The final state, which has no command any more, is `record.snapshot(-1)`.

    Attributes:
        path: of the file.
        document: the whole file as parsed JSON, with keys that this version does not know.
        states: states of the world at all ticks, the final state included.
        command: (T, 3), columns vx (m/s), vy (m/s), omega (rad/s), body frame: the controller's command at each frame.
        executed: (T, 3), the same columns: what the drive executed in the tick that begins at the frame.
        guarded: (T,) of bool, whether the safety guard intervened during that tick.
        outcome: how the episode ended.

    Example:
        >>> import sonata2d as s2
        >>> record = s2.read_episode("demo/000000.json")
        >>> record.robot.shape == (len(record), 6)
        True
    """

    path: Path
    document: JsonDict
    states: States
    command: Array
    executed: Array
    guarded: BoolArray
    outcome: Outcome

    def __len__(self) -> int:
        """T, the number of frames."""
        return len(self.command)

    @overload
    def __getitem__(self, index: SupportsIndex) -> Snapshot: ...

    @overload
    def __getitem__(self, index: slice) -> list[Snapshot]: ...

    def __getitem__(self, index: SupportsIndex | slice) -> Snapshot | list[Snapshot]:
        """The snapshot of a frame, or a list of some.

        Raises:
            IndexError: there is no such frame.
        """
        if isinstance(index, slice):
            return [self.snapshot(t) for t in range(len(self))[index]]
        if not hasattr(index, "__index__"):
            raise TypeError(f"a record is indexed by the number of a frame, or a slice, got {index!r}")
        try:
            return self.snapshot(range(len(self))[index])
        except IndexError:
            raise IndexError(f"frame {index!r} of {self!r}: the numbers are 0 to {len(self) - 1}") from None

    def __iter__(self) -> Iterator[Snapshot]:
        """The snapshots of the T frames."""
        return (self.snapshot(t) for t in range(len(self)))

    def __repr__(self) -> str:
        people = counted(self.states.humans.shape[1], "person")
        frames = counted(len(self), "frame")
        return f"<EpisodeRecord {self.id} of {self.family}: {frames}, {self._end}, {people}, {self.outcome.status}>"

    @property
    def robot_ids(self) -> tuple[int, ...]:
        """Ids of all robots; that of `robot` first, which is 0 but in a view of another robot."""
        return self._scene.robot_ids

    def seen_by(self, robot_id: int) -> EpisodeRecord:
        """The episode with another robot in the place of the first: `robot`, `command`, contacts, goal, controller.

        Raises:
            KeyError: there is no such robot.
        """
        return self._with_document(document_seen_by(self.document, robot_id))

    def until_arrival(self) -> EpisodeRecord:
        """The episode up to the tick at which its robot reached its goal; itself if there is one robot, or it did not.

        An episode of several robots goes on until all have arrived; metrics are of each robot until it arrives.
        """
        return self._with_document(document_until_arrival(self.document))

    def with_robots_as_people(self) -> EpisodeRecord:
        """The episode as a robot sees it to which the others are people; itself if there is one robot."""
        return self._of_people

    @cached_property
    def _of_people(self) -> EpisodeRecord:
        return self._with_document(document_with_robots_as_people(self.document))

    def _with_document(self, document: JsonDict) -> EpisodeRecord:
        return self if document is self.document else record_from_document(document, self.path)

    @property
    def _end(self) -> str:
        return f"{float(self.states.time[-1]):g} s"

    def _facts(self) -> dict[str, object]:
        return {
            "file": self.path,
            **self._scene.origin,
            "controller": self.controller_info.path.rpartition(":")[2] or "none",
            "outcome": f"{self.outcome.status}: {self.outcome.reason}",
            "length": f"{self._end}, {counted(len(self), 'frame')}",
            "people": self.states.humans.shape[1],
            **({"robots": len(self.robot_ids)} if len(self.robot_ids) > 1 else {}),
            "contacts": self._contacts_text(),
        }

    def _contacts_text(self) -> str:
        """Number of frames in which the robot touched something, in words."""
        counts = self.counts()
        if "contacts" not in counts:
            return "not recorded"
        touched = counts["contacts"].get("any", {}).get("frames", 0)
        return f"in {touched} of {counted(len(self), 'frame')}" if touched else "none"

    @property
    def id(self) -> str:
        """Id of the episode."""
        return str(self.document["id"])

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return str(self.document["name"])

    @property
    def family(self) -> str:
        """Scenario and kind of room, by which data sets are split."""
        return str(self.document["family"])

    @property
    def seed(self) -> int:
        """Seed of the data set."""
        return int(self.document["seed"])

    @property
    def episode(self) -> int:
        """Number of the episode in the data set."""
        return int(self.document["episode"])

    @property
    def contributor(self) -> str | None:
        """Name of the person who drove or recorded."""
        contributor: str | None = self.document["contributor"]
        return contributor

    @property
    def context(self) -> str | None:
        """Text for the raters of the episode."""
        context: str | None = self.document["context"]
        return context

    @cached_property
    def label_spec(self) -> LabelSpec:
        """The label that the driver was asked for; `LabelSpec()` if there was none."""
        settings = self.document.get("label_spec")
        return LabelSpec.from_settings(settings) if settings else LabelSpec()

    @property
    def label(self) -> Any:
        """Label of the whole run; None if the driver was not asked for one."""
        return self.document.get("label")

    @cached_property
    def controller_info(self) -> ControllerInfo:
        """The robot's controller, and the meaning of its labels."""
        others = tuple(_controller_info(other) for other in self.document.get("robots") or ())
        return replace(_controller_info(self.document), others=others)

    @property
    def tick(self) -> IntArray:
        """(T,) of int."""
        return self.states.tick[:-1]

    @property
    def time(self) -> Array:
        """(T,), s."""
        return self.states.time[:-1]

    @property
    def robot(self) -> Array:
        """(T, 6), columns x, y, theta, vx, vy, omega; SI units, world frame."""
        return self.states.robot[:-1]

    @property
    def robots(self) -> Array:
        """(T, M, 6), the same columns of the M other robots."""
        return self.states.robots[:-1]

    @property
    def humans(self) -> Array:
        """(T, N, 7), columns x, y, theta, vx, vy, omega, head; SI units, world frame; NaN where not present."""
        return self.states.humans[:-1]

    @property
    def present(self) -> BoolArray:
        """(T, N) of bool."""
        return self.states.present[:-1]

    @property
    def activity(self) -> IntArray:
        """(T, N) of int, into `relations.ACTIVITIES`; -1 where not present."""
        return self.states.activity[:-1]

    @property
    def labels(self) -> list[Any]:
        """The label of each frame; its command, [vx, vy, omega], where it has no label."""
        return [frame["label"] if "label" in frame else frame["command"] for frame in self.document["frames"]]

    @cached_property
    def round_trips(self) -> Array:
        """(T,), s: how late a person who drove in a browser saw the world at each frame; NaN where it is not known.

        The time from the request of a tick to its answer, as last measured; 1 stands for a second or more.
        """
        return self._network(ROUND_TRIP)

    @cached_property
    def predicted(self) -> BoolArray:
        """(T,): whether the browser of the person who drove showed ticks that it simulated itself, at each frame.

        The person then saw the robot react at once, whatever the round-trip time to the server.
        """
        return np.asarray(self._network(PREDICTED) == 1.0)

    def _network(self, control: str) -> Array:
        """(T,), the last value of a control of the network at each frame; NaN before the first."""
        value, values = np.nan, []
        for frame in self.document["frames"]:
            for event in frame.get("events") or ():
                if event["device"] == NETWORK_DEVICE and event["control"] == control:
                    value = float(event["value"])
            values.append(value)
        return np.array(values)

    def round_trip_summary(self) -> tuple[float, float] | None:
        """Median and 95th percentile of the known `round_trips`, s; None if all are unknown."""
        times = self.round_trips[np.isfinite(self.round_trips)]
        return (float(np.median(times)), float(np.percentile(times, 95))) if len(times) else None

    @property
    def never_entered(self) -> list[int]:
        """Ids of the pedestrians who never appear, because the place where they enter stays occupied to the end."""
        return never_entered(self.scene().humans, np.logical_or.reduce(self.states.present), self.outcome.tick)

    def counts(self) -> JsonDict:
        """Return the contacts, and the commands beyond the limits, of all robots, as a manifest holds them.

        Empty for an imported episode, whose contacts were not recorded.
        """
        if self.document.get("imported"):
            return {}
        states = [*self.document["frames"], self.document["final"]]
        contacts = [
            [_contact(row) for robot in (state, *(state.get("robots") or ())) for row in robot["contacts"]]
            for state in states
            if state["contacts"] or "robots" in state
        ]
        commands = self.command[:, None]
        if self._scene.robots:
            others = [[robot["command"] for robot in frame["robots"]] for frame in self.document["frames"]]
            shape = len(self), len(self._scene.robots), len(COMMAND_NAMES)
            commands = np.concatenate((commands, np.array(others, dtype=float).reshape(shape)), axis=1)
        return run_counts([robot for robot, _ in self._scene.tasks], contacts, commands.swapaxes(0, 1))

    def scene(self) -> Scene:
        """Return the scene, equal to the one that was recorded."""
        return self._scene

    @cached_property
    def _scene(self) -> Scene:
        return scene_from_json(self.document)

    def snapshot(self, index: int) -> Snapshot:
        """Restore a snapshot, at the precision of files.

        Args:
            index: of a frame; T, or -1: the final state.

        Raises:
            IndexError: there is no such frame.
        """
        t = range(len(self) + 1)[index]
        look = self._look(t)
        return replace(look, sensors=self._readings_at(t)) if self.sensors else look

    def _look(self, t: int) -> Snapshot:
        """The snapshot of a frame, or of the final state, without readings."""
        state = self.document["frames"][t] if t < len(self) else self.document["final"]
        robots, others = self._scene.robots, state.get("robots") or ()
        before = self.document["frames"][t - 1].get("robots") or () if t else others
        snapshot = Snapshot(
            tick=int(self.states.tick[t]),
            time=float(self.states.time[t]),
            scene=self._scene,
            robot=self._robot_state(t),
            robots=tuple(
                _other_robot(other, now, last if t else {})
                for other, now, last in zip(robots, others, before, strict=True)
            ),
            contacts_of_robots=tuple(tuple(map(_contact, other["contacts"])) for other in others),
            humans=self._present_humans(t),
            doors=door_states(self._scene, self.states.doors[t].tolist()),
            interactions=interactions_from_rows(state["interactions"]),
            contacts=tuple(_contact(row) for row in state["contacts"]),
            events=events_of(state),
        )
        if self._scene.goal.moves:
            set_present_goal(snapshot, self._stages[t])
        return snapshot

    @cached_property
    def _stages(self) -> list[int]:
        """Number of places that the robot has reached in each state, see `core.tasks`."""
        stage, stages = 0, []
        for x, y in self.states.robot[:, :2].tolist():
            stage = next_stage(self._scene.goal, stage, (x, y))
            stages.append(stage)
        return stages

    @cached_property
    def goals(self) -> Array:
        """(T + 1, 3), columns x, y (m) and theta (rad): the goal in each state."""
        scene = self._scene
        goals = [s.goal for s in self.snapshots()] if scene.goal.moves else [scene.goal] * (len(self) + 1)
        return frozen(np.array([(goal.x, goal.y, goal.theta) for goal in goals], dtype=float))

    @cached_property
    def sensors(self) -> dict[str, Sensor | None]:
        """The recorded sensors of the robot, by name; None for a sensor of an unregistered type.

        `snapshot.sensors` has their readings, as the controller got them, at the precision of files. Readings of an
        unregistered sensor are JSON values.
        """
        from ..agents.sensors.base import sensor_from  # most files have no readings, and are read without sensors

        return {each["name"]: sensor_from(each) for each in self.document.get("sensors") or ()}

    @cached_property
    def _arrivals(self) -> dict[str, list[int]]:
        """Numbers of the frames in which readings of each sensor arrived."""
        frames = self.document["frames"]
        return {
            name: [t for t, frame in enumerate(frames) if name in (frame.get("sensors") or ())] for name in self.sensors
        }

    def _readings_at(self, t: int) -> Readings:
        """The last readings until a frame."""
        from ..agents.sensors.base import Readings

        readings: dict[str, Any] = {}
        for name, sensor in self.sensors.items():
            number = bisect_right(self._arrivals[name], t)
            value = self.document["frames"][self._arrivals[name][number - 1]]["sensors"][name] if number else None
            readings[name] = value if value is None or sensor is None else sensor.from_json(value, self._look)
        return Readings(readings)

    def snapshots(self) -> Iterator[Snapshot]:
        """Iterate over the T + 1 snapshots, the final state last."""
        return (self.snapshot(t) for t in range(len(self) + 1))

    def frames(self) -> Iterator[Frame]:
        """Iterate over the T frames; the label is None where a frame has none."""
        is_sensing = any(robot.get("sensors") for robot in (self.document, *(self.document.get("robots") or ())))
        for t, frame in enumerate(self.document["frames"]):
            others = tuple((Twist(*other["command"]), other.get("label")) for other in frame.get("robots") or ())
            robots = (frame, *(frame.get("robots") or ())) if is_sensing else ()
            readings = tuple(robot.get("sensors") or {} for robot in robots)
            yield Frame(self.snapshot(t), Twist(*self.command[t].tolist()), frame.get("label"), others, readings)

    def _robot_state(self, t: int) -> RobotState:
        x, y, theta, vx, vy, omega = self.states.robot[t].tolist()
        # a snapshot holds what was executed before it, a frame what was executed after it
        executed = Twist(*self.executed[t - 1].tolist()) if t > 0 else Twist()
        guarded = bool(self.guarded[t - 1]) if t > 0 else False
        body, id = self._scene.robot, self._scene.robot_id
        return RobotState((x, y), unit_vector(theta), (vx, vy), omega, executed, guarded, body, id)

    def _present_humans(self, t: int) -> Humans:
        rows, present = self.states.humans[t], self.states.present[t]
        state = np.full((len(rows), 9), np.nan)
        state[:, X : Y + 1], state[:, VX : VY + 1] = rows[:, ROW_X : ROW_Y + 1], rows[:, ROW_VX : ROW_VY + 1]
        state[:, OMEGA] = rows[:, ROW_OMEGA]
        state[present, BODY_X : BODY_Y + 1] = unit_vectors(rows[present, ROW_THETA])
        state[present, GAZE_X : GAZE_Y + 1] = unit_vectors(rows[present, ROW_HEAD])
        humans = self._scene.human_table.with_state(frozen(state), self.states.activity[t])
        return humans.select(np.flatnonzero(present))


def record_from_document(document: JsonDict, path: Path, columns: Columns | None = None) -> EpisodeRecord:
    """Create a record from a document of this format version.

    Args:
        document: valid, see `validate.require_valid`.
        path: of the file.
        columns: of the document, if they are known.
    """
    outcome, (states, command, executed, guarded, _) = document["outcome"], columns or columns_of(document)
    arrivals = tuple(outcome.get("arrivals") or ())
    return EpisodeRecord(
        path, document, states, command, executed, guarded,
        Outcome(outcome["status"], outcome["reason"], outcome["tick"], outcome["time"], arrivals),
    )  # fmt: skip


@drawing_of.register
def _(record: EpisodeRecord) -> Drawing:
    return Drawing(list(record.snapshots()), record.outcome.status, record.command.tolist(), record.labels)


def _controller_info(robot: JsonDict) -> ControllerInfo:
    """The controller of a robot by its keys in a document."""
    controller = robot["controller"]
    sensors = tuple(robot.get("sensors") or ())
    return ControllerInfo(controller["path"], controller["version"], controller["settings"], robot["labels"], sensors)


def _other_robot(other: OtherRobot, now: JsonDict, before: JsonDict) -> RobotState:
    """The state of another robot.

    Args:
        other: the robot.
        now: its keys in the present frame.
        before: its keys in the last frame, which holds what was executed since; empty in the first one.
    """
    x, y, theta, vx, vy, omega = now["robot"]
    executed = Twist(*before["executed"]) if before else Twist()
    guarded = bool(before.get("guarded"))
    return RobotState((x, y), unit_vector(theta), (vx, vy), omega, executed, guarded, other.robot, other.id)


def _contact(row: JsonDict) -> Contact:
    return Contact(row["kind"], row["id"], row["robot_at_fault"], row["other_at_fault"])


def events_of(state: JsonDict) -> tuple[DeviceEvent, ...]:
    """Return the device events of a frame or of the final state."""
    return tuple(DeviceEvent(row["device"], row["control"], row["value"]) for row in state.get("events") or ())
