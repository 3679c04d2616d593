"""An episode as it is read: arrays of the whole, its scene, and snapshots and frames as they were."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..core.devices import DeviceEvent
from ..core.geometry import Twist
from ..core.humans import BODY_X, GAZE_X, OMEGA, VX, Humans, frozen, human_ids
from ..core.labels import LabelSpec
from ..core.portable_math import Array, unit_vector, unit_vectors
from ..core.scene import Scene
from ..core.snapshot import Author, Contact, Frame, Outcome, RobotState, Snapshot
from ..errors import RecordError
from .layout import Tree, interactions_of, scene_of


@dataclass(frozen=True, eq=False)
class Looks:
    """What was seen at each tick, the final look included: T + 1 rows for T frames, N people; SI, world frame.

    Attributes:
        tick, time: (T + 1,), the time in s.
        robot: (T + 1, 6), columns x, y, theta, vx, vy, omega.
        humans: (T + 1, N, 7), the same and head; NaN where not present.
        present: (T + 1, N) of bool.
        activity: (T + 1, N) of int, into `humans.ACTIVITIES`; -1 where not present.
    """

    tick: Any
    time: Array
    robot: Array
    humans: Array
    present: Any
    activity: Any


@dataclass(frozen=True, eq=False)
class EpisodeRecord:
    """One recorded episode: T frames, N people.

    Attributes:
        path: of the file.
        document: all that the file says, as JSON gives it, with the keys that this version does not know.
        looks: what was seen, the final look included.
        command, executed: (T, 3), columns vx, vy, omega, body frame: what was asked for at the frame, and what the
            drive carried out in the tick that begins there.
        guarded: (T,) of bool, whether the guard stepped in during that tick.
        outcome: how it ended.
    """

    path: Path
    document: Tree
    looks: Looks
    command: Array
    executed: Array
    guarded: Any
    outcome: Outcome

    def __len__(self) -> int:
        """T, the number of frames."""
        return len(self.command)

    @property
    def id(self) -> str:
        return str(self.document["id"])

    @property
    def name(self) -> str:
        """Of the scenario."""
        return str(self.document["name"])

    @property
    def family(self) -> str:
        return str(self.document["family"])

    @property
    def seed(self) -> int:
        return int(self.document["seed"])

    @property
    def episode(self) -> int:
        return int(self.document["episode"])

    @property
    def contributor(self) -> str | None:
        return self._text("contributor")

    @property
    def context(self) -> str | None:
        return self._text("context")

    @cached_property
    def label_spec(self) -> LabelSpec:
        """What a person was asked for."""
        told = self.document.get("label_spec")
        return LabelSpec.restored(told) if told else LabelSpec()

    @property
    def label(self) -> Any:
        """Of the whole run; None if nobody was asked for one."""
        return self.document.get("label")

    def _text(self, key: str) -> str | None:
        value = self.document[key]
        return None if value is None else str(value)

    @cached_property
    def author(self) -> Author:
        """Who drove."""
        told = self.document["controller"]
        return Author(told["path"], told["version"], told["settings"], self.document["labels"])

    @property
    def tick(self) -> Any:
        """(T,) of int."""
        return self.looks.tick[:-1]

    @property
    def time(self) -> Array:
        """(T,), s."""
        return self.looks.time[:-1]

    @property
    def robot(self) -> Array:
        """(T, 6), columns x, y, theta, vx, vy, omega; SI, world frame."""
        return self.looks.robot[:-1]

    @property
    def humans(self) -> Array:
        """(T, N, 7), columns x, y, theta, vx, vy, omega, head; SI, world frame; NaN where not present."""
        return self.looks.humans[:-1]

    @property
    def present(self) -> Any:
        """(T, N) of bool."""
        return self.looks.present[:-1]

    @property
    def activity(self) -> Any:
        """(T, N) of int, into `humans.ACTIVITIES`; -1 where not present."""
        return self.looks.activity[:-1]

    @property
    def labels(self) -> list[Any]:
        """The label of each frame; the command, [vx, vy, omega], where there is none."""
        return [frame["label"] if "label" in frame else frame["command"] for frame in self.document["frames"]]

    def scene(self) -> Scene:
        """The scene it started from, equal to the one that was recorded."""
        return self._scene

    @cached_property
    def _scene(self) -> Scene:
        return scene_of(self.document)

    def snapshot(self, index: int) -> Snapshot:
        """The look at a frame, at the file's precision; index T, or -1, is the final look."""
        looks = range(len(self) + 1)
        t = looks[index]
        told = self.document["frames"][t] if t < len(self) else self.document["final"]
        with reading(self.path):
            return Snapshot(
                tick=int(self.looks.tick[t]),
                time=float(self.looks.time[t]),
                scene=self._scene,
                robot=self._robot_state(t),
                humans=self._humans(t),
                interactions=interactions_of(told["interactions"]),
                contacts=tuple(_contact(row) for row in told["contacts"]),
                events=tuple(_event(row) for row in told.get("events", ())),
            )

    def snapshots(self) -> Iterator[Snapshot]:
        """All looks, the final one last: T + 1."""
        return (self.snapshot(t) for t in range(len(self) + 1))

    def frames(self) -> Iterator[Frame]:
        """All frames as they were noted; the label is None where there was none."""
        for t, told in enumerate(self.document["frames"]):
            yield Frame(self.snapshot(t), Twist(*self.command[t].tolist()), told.get("label"))

    def _robot_state(self, t: int) -> RobotState:
        x, y, theta, vx, vy, omega = self.looks.robot[t].tolist()
        done = Twist(*self.executed[t - 1].tolist()) if t > 0 else Twist()
        guarded = bool(self.guarded[t - 1]) if t > 0 else False
        return RobotState((x, y), unit_vector(theta), (vx, vy), omega, done, guarded, self._scene.robot)

    def _humans(self, t: int) -> Humans:
        """The people who are there at a look."""
        rows, there = self.looks.humans[t], self.looks.present[t]
        state = np.full((len(rows), 9), np.nan)
        state[:, 0:2], state[:, VX : VX + 2], state[:, OMEGA] = rows[:, 0:2], rows[:, 3:5], rows[:, 5]
        state[there, BODY_X : BODY_X + 2] = unit_vectors(rows[there, 2])
        state[there, GAZE_X : GAZE_X + 2] = unit_vectors(rows[there, 6])
        return Humans(frozen(state), *self._people, self.looks.activity[t]).only(np.flatnonzero(there))

    @cached_property
    def _people(self) -> tuple[Any, Array]:
        """(N,) ids and (N,) radii, m."""
        return human_ids(self._scene), frozen(np.array([human.radius for human in self._scene.humans], dtype=float))


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Whatever a damaged document makes go wrong is one RecordError that names the file."""
    try:
        yield
    except KeyError as error:
        raise RecordError(f"{path} is no whole episode: {error} is missing") from error
    except (TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise RecordError(f"{path} is no whole episode: {error}") from error


def _contact(row: Tree) -> Contact:
    return Contact(row["kind"], row["id"], row["robot_at_fault"], row["other_at_fault"])


def _event(row: Tree) -> DeviceEvent:
    return DeviceEvent(row["device"], row["control"], row["value"])
