"""The view of a recorded episode from which metrics are computed: arrays up to the goal, and the robot's collisions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..core.doors import leaf_lines
from ..core.entities import ANY_HEADING
from ..core.geometry import PRECISION, Barriers, shoulder_lines, to_shoulder_line
from ..core.outlines import side_lines
from ..core.portable_math import Array, BoolArray, unit_vectors
from ..core.scene import Scene
from ..core.separation import outline_gaps
from ..core.snapshot import CLOSING_SPEED, ContactKind
from ..core.vectors import lengths, wrap_angles
from ..record.motion import OMEGA, THETA, VX, VY
from ..record.record import EpisodeRecord
from .shortest_path import shortest_length

Kind = ContactKind
Outline = tuple[Kind, int]  # kind, and id of the human, object, door or robot, or index of the wall
Fault = tuple[bool, bool]  # whether the robot's own velocity, and the other's, closes the gap


@dataclass(frozen=True, slots=True)
class Collision:
    """An uninterrupted contact of the robot with one outline.

    Attributes:
        kind, id: the outline; of a wall, its number in `Scene.wall_lines`.
        first, last: indices of the first and the last state in contact.
        robot_at_fault, other_at_fault: whether its own velocity closed the gap at any of these states.
    """

    kind: Kind
    id: int
    first: int
    last: int
    robot_at_fault: bool
    other_at_fault: bool


@dataclass(frozen=True, eq=False)
class Trajectory:
    """An episode of N humans as L states: the frames and the final state, cut after the goal is first reached.

    Positions are in metres, velocities in m/s, angles in radians, all in the world frame.

    Args:
        record: the episode.
        undisturbed: (T + 1, N, 2), m, positions of the humans at all states of the record when the same seed runs
            without a robot; None if unknown. See `disturbance.without_robot`.
        is_whole: whether the states after the goal is reached are kept.

    >>> trajectory = Trajectory(read_episode("demo/000000.json"))
    >>> trajectory.clearance.shape == trajectory.time.shape
    True
    """

    record: EpisodeRecord
    undisturbed: Array | None = None
    is_whole: bool = False

    @cached_property
    def scene(self) -> Scene:
        """The scene at the start."""
        return self.record.scene()

    @cached_property
    def goal_index(self) -> int | None:
        """Index of the first state within the time limit in which the robot is at the goal; None if never.

        Its heading must be an accepted one. None, too, for an imported episode whose source has no robot or no goal:
        their positions are placeholders.
        """
        states, goal = self.record.states, self.scene.goal
        robot = states.robot[states.time - states.time[0] <= self.scene.rules.time_limit + 0.5 * PRECISION]
        if self.scene.unmeasured & {"robot", "goal"}:
            return None
        if self.record.outcome.status == "goal":  # the outcome decides: recorded positions are rounded
            return len(robot) - 1 if len(robot) == len(states.robot) else None
        if not goal.is_plain:
            return None
        at_goal = lengths(robot[:, :2] - goal.position) <= goal.distance
        if goal.angle < ANY_HEADING:
            at_goal &= np.abs(wrap_angles(robot[:, THETA] - goal.theta)) <= goal.angle
        return int(np.argmax(at_goal)) if at_goal.any() else None

    def __len__(self) -> int:
        """L, one or more."""
        last = None if self.is_whole else self.goal_index
        return len(self.record.states.robot) if last is None else last + 1

    @cached_property
    def time(self) -> Array:
        """(L,), s."""
        return self.record.states.time[: len(self)]

    @cached_property
    def durations(self) -> Array:
        """(L - 1,), s, from each state to the next."""
        return np.diff(self.time)

    @property
    def total_time(self) -> float:
        """From the first state to the last, s."""
        return float(self.time[-1] - self.time[0])

    @cached_property
    def position(self) -> Array:
        """(L, 2), m, of the robot's centre."""
        return self.record.states.robot[: len(self), :2]

    @cached_property
    def heading(self) -> Array:
        """(L,), rad, of the robot."""
        return self.record.states.robot[: len(self), THETA]

    @cached_property
    def velocity(self) -> Array:
        """(L, 2), m/s, of the robot."""
        return self.record.states.robot[: len(self), VX : VY + 1]

    @cached_property
    def omega(self) -> Array:
        """(L,), rad/s, of the robot."""
        return self.record.states.robot[: len(self), OMEGA]

    @cached_property
    def radius(self) -> float:
        """Radius of the robot's outline, m; of one that is no disc, of the circle around it."""
        return self.scene.robot.radius

    @property
    def is_disc(self) -> bool:
        """Whether the robot's outline is a disc."""
        return len(self.scene.robot.outline.core) == 1

    def _gaps(self, lines: Array) -> Array:
        """(L, M), m, between the robot's outline and thick lines, (L or 1, M, 5): both ends and the radius, m."""
        return outline_gaps(self.scene.robot.outline, self.position, unit_vectors(self.heading), lines)

    @cached_property
    def present(self) -> BoolArray:
        """(L, N), whether each human is in the scene."""
        present: BoolArray = self.record.states.present[: len(self)]
        return present

    @cached_property
    def has_humans(self) -> bool:
        """Whether a human is present in any state."""
        return bool(self.present.any())

    @cached_property
    def human_position(self) -> Array:
        """(L, N, 2), m; NaN where absent."""
        return self.record.states.humans[: len(self), :, :2]

    @cached_property
    def human_heading(self) -> Array:
        """(L, N), rad; NaN where absent."""
        return self.record.states.humans[: len(self), :, THETA]

    @cached_property
    def human_velocity(self) -> Array:
        """(L, N, 2), m/s; NaN where absent."""
        return self.record.states.humans[: len(self), :, VX : VY + 1]

    @property
    def human_radius(self) -> Array:
        """(N,), m, half the depth of the humans' bodies."""
        return self.scene.human_table.radius

    @property
    def human_shoulder(self) -> Array:
        """(N,), m, half the length of the humans' shoulder lines; 0 for discs."""
        return self.scene.human_table.shoulder

    @cached_property
    def human_direction(self) -> Array:
        """(L, N, 2), unit vectors of the humans' headings; NaN where absent."""
        return unit_vectors(self.human_heading)

    @property
    def human_column(self) -> dict[int, int]:
        """Index along N of each human, by id."""
        return self.scene.human_table.row

    @cached_property
    def offset(self) -> Array:
        """(L, N, 2), m, from the robot's centre to each human's; NaN where absent."""
        offset: Array = self.human_position - self.position[:, None, :]
        return offset

    @cached_property
    def distance(self) -> Array:
        """(L, N), m, between the centres of robot and human; inf where absent."""
        return np.where(self.present, lengths(self.offset), np.inf)

    @cached_property
    def human_clearance(self) -> Array:
        """(L, N), m, between the outlines of robot and human, negative where they overlap; inf where absent."""
        if self.is_disc:
            return np.where(self.present, lengths(self.to_shoulder_line), np.inf) - self.human_radius - self.radius
        left, right = shoulder_lines(self.human_position, self.human_direction, self.human_shoulder)
        radii = np.broadcast_to(self.human_radius[:, None], (*self.present.shape, 1))
        return np.where(self.present, self._gaps(np.concatenate((left, right, radii), axis=-1)), np.inf)

    @cached_property
    def to_shoulder_line(self) -> Array:
        """(L, N, 2), m, from the robot's centre to the nearest point of each human's shoulder line; NaN if absent."""
        return to_shoulder_line(self.offset, self.human_direction, self.human_shoulder)

    @cached_property
    def clearance(self) -> Array:
        """(L,), m, from the robot's outline to the nearest human's, 0 where they overlap; inf without humans."""
        clearance: Array = np.maximum(self.human_clearance.min(axis=1, initial=np.inf), 0.0)
        return clearance

    @cached_property
    def barrier_clearance(self) -> Array:
        """(M, L), m, from the robot's outline to each barrier of a snapshot, negative where they overlap."""
        gaps = gaps_to(self, self.scene.barriers)
        if not self.scene.moving_doors:
            return gaps
        leaves = leaf_lines(self.scene.moving_doors, self.record.states.doors[: len(self)])
        return np.concatenate((gaps, self._gaps(leaves).T))

    @cached_property
    def robot_clearance(self) -> Array:
        """(L, M), m, from the robot's outline to each side of the other robots' outlines, negative where they overlap.

        Sides are in the order of the robots; a disc has one.
        """
        lines, rows = [np.empty((len(self), 0, 5))], self.record.states.robots[: len(self)]
        for k, other in enumerate(self.scene.robots):
            lines.append(side_lines(other.robot.outline, rows[:, k, :2], unit_vectors(rows[:, k, THETA])))
        return self._gaps(np.concatenate(lines, axis=1))

    @cached_property
    def collisions(self) -> list[Collision]:
        """The robot's collisions, ordered by their first state."""
        return _find_collisions(self)

    @cached_property
    def shortest_path(self) -> float | None:
        """Length of the shortest path from the robot's start to the edge of the goal, m; None if no path exists.

        The path avoids walls and furniture at the radius of the largest circle within the robot's outline, and ignores
        humans. None, too, for a goal that moves.
        """
        goal, table, radius = self.scene.goal, self.scene.barriers.table, float(self.scene.robot.outline.inradius)
        if not radius > 0.0 or goal.moves:
            return None
        x, y = self.position[0].tolist()
        length = shortest_length(table, radius, x, y, float(goal.x), float(goal.y), float(goal.distance))
        return length if np.isfinite(length) else None


def gaps_to(trajectory: Trajectory, barriers: Barriers) -> Array:
    """(M, L), m, from the robot's outline to each of M barriers, negative where they overlap."""
    if trajectory.is_disc:
        return barriers.gaps(trajectory.position) - trajectory.radius
    return trajectory._gaps(barriers.table[None, :, :5]).T


def _find_collisions(trajectory: Trajectory) -> list[Collision]:
    """Join contacts at consecutive states into collisions.

    A state is in contact with an outline if the file records a contact, which is detected within a tick, or if the
    clearance at the state is below the scene's `contact_distance`.

    Returns:
        Collisions ordered by first state, kind and id.
    """
    contacts: dict[Outline, dict[int, Fault]] = {}
    # recorded contacts come last: at the same state they replace what positions and velocities suggest
    sources = (*_human_contacts(trajectory), *_barrier_contacts(trajectory), *_recorded_contacts(trajectory))
    for outline, index, fault in sources:
        contacts.setdefault(outline, {})[index] = fault
    collisions = [collision for outline, faults in contacts.items() for collision in _join(outline, faults)]
    return sorted(collisions, key=lambda collision: (collision.first, collision.kind, collision.id))


def _recorded_contacts(trajectory: Trajectory) -> Iterator[tuple[Outline, int, Fault]]:
    """Outline, state index and fault of the contacts in the file."""
    document, lines = trajectory.record.document, trajectory.scene.wall_lines
    for index, state in enumerate([*document["frames"], document["final"]][: len(trajectory)]):
        for row in state["contacts"]:
            kind, id = row["kind"], row["id"]
            outline = (kind, lines[id] if kind == "wall" else id)
            yield outline, index, (row["robot_at_fault"], row["other_at_fault"])


def _human_contacts(trajectory: Trajectory) -> Iterator[tuple[Outline, int, Fault]]:
    """Outline, state index and fault where the clearance to a human is below the contact distance."""
    near = np.argwhere(trajectory.human_clearance < trajectory.scene.rules.contact_distance).tolist()
    for index, k in near:
        offset = trajectory.to_shoulder_line[index, k]
        direction = offset / max(float(lengths(offset)), 1e-9)
        robot = float(trajectory.velocity[index] @ direction) > CLOSING_SPEED
        other = float(-trajectory.human_velocity[index, k] @ direction) > CLOSING_SPEED
        yield ("human", trajectory.scene.humans[k].id), index, (robot, other)


def _barrier_contacts(trajectory: Trajectory) -> Iterator[tuple[Outline, int, Fault]]:
    """Outline, state index and fault where the clearance to a wall or object is below the contact distance."""
    scene = trajectory.scene
    owners: tuple[Outline, ...] = scene.barrier_owner
    near = trajectory.barrier_clearance[: len(scene.barriers)] < scene.rules.contact_distance  # doors are in the file
    # the nearest edge of an outline comes last: it decides whose fault the contact is
    order = sorted(np.argwhere(near).tolist(), key=lambda pair: -trajectory.barrier_clearance[tuple(pair)])
    for m, index in order:
        x, y = scene.barriers.subset([m]).towards(trajectory.position[index : index + 1])
        vx, vy = trajectory.velocity[index].tolist()
        closing = (vx * float(x[0, 0]) + vy * float(y[0, 0])) / max(float(np.hypot(x, y)[0, 0]), 1e-9)
        yield owners[m], index, (closing > CLOSING_SPEED, False)


def _join(outline: Outline, faults: dict[int, Fault]) -> Iterator[Collision]:
    """One collision for each run of consecutive state indices."""
    order = np.array(sorted(faults))
    for part in np.split(order, np.flatnonzero(np.diff(order) > 1) + 1):
        robot, other = zip(*(faults[index] for index in part.tolist()), strict=True)
        yield Collision(*outline, int(part[0]), int(part[-1]), any(robot), any(other))
