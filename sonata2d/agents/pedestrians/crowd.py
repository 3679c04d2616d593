"""The crowd: accelerations, facing and gaze of all pedestrians at one tick."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...core.entities import DEFAULT_MODEL
from ...core.humans import BODY_X, GAZE_X, Humans, X, Y, activities_of, frozen, human_ids
from ...core.portable_math import Array
from ...core.scene import Scene
from ...core.snapshot import CrowdCommands, Snapshot
from ...core.vectors import lengths
from ...registry import PEDESTRIAN_MODELS
from .models.base import Sight, Walkers, pedestrian_model, standing_acceleration, times_a_tick
from .orientation import AHEAD, SHORTEST, Attention, directed
from .reactions import Reactions
from .social.dynamics import SocialLife
from .social.state import SocialState
from .wayfinding import Wanderers


def with_absent_rows(snapshot: Snapshot) -> tuple[Snapshot, Array | None]:
    """The snapshot with a row for every person of the scene, and who is there.

    Returns:
        The snapshot, in which absent people stand at their parking places with all ties of the scene, and (N + 1,),
        1 for those who are there and for the robot, the last, 0 for the others. Where everybody is there, the snapshot
        as it is, and None.
    """
    humans, scene = snapshot.humans, snapshot.scene
    if humans.row is None:
        return snapshot, None
    count = len(scene.humans)
    state = humans.among_all(humans.state, count, 0.0)
    there = np.zeros(count + 1)
    there[humans.row], there[-1] = 1.0, 1.0
    away = there[:-1] == 0.0
    state[away, X : Y + 1] = scene.parking[away]
    state[away, BODY_X] = state[away, GAZE_X] = 1.0
    radius = frozen(np.array([human.radius for human in scene.humans], dtype=float))
    everybody = Humans(frozen(state), human_ids(scene), radius, activities_of(scene))
    return replace(snapshot, humans=everybody, interactions=scene.interactions), there


HURRY = 1.3  # times the desired speed is the fastest anyone walks (Helbing & Molnár 1995)
OWN_WAY = 0.1  # of the bond of a group's members who wander is that of those who have goals of their own
EASE = 0.4  # s: who comes to a stop somewhere goes no faster than the distance left over this


class Crowd:
    """All people of a scene.

    Args:
        scene: who they are and where they start; its seed decides where they wander.

    Raises:
        ValueError: a human's model is unknown, or models are mixed.
    """

    def __init__(self, scene: Scene) -> None:
        people = scene.humans
        names = sorted({human.model for human in people} or {DEFAULT_MODEL})
        if len(names) > 1:
            raise ValueError(f"all pedestrians must share one model, got {', '.join(names)}")
        if names[0] not in PEDESTRIAN_MODELS:
            raise ValueError(PEDESTRIAN_MODELS.unknown(names[0]))
        self._model = pedestrian_model(names[0])(scene)
        self._scene = scene
        self._there: Array | None = None
        self._wanderers = Wanderers(scene)
        self._social = SocialState(scene)
        self._life = SocialLife(scene, self._social, self._wanderers)
        self._reactions, self._attention = Reactions(scene), Attention(scene)
        self._keep_to = self._social.home
        self._speed = self._group_speeds()
        radius = [*(human.radius for human in people), scene.robot.radius]
        self._radius = np.array(radius, dtype=float)
        self._weight = self._who_minds_whom()
        self._sight = Sight(scene, len(people) + 1)
        self._member = self._who_walks_with_whom()
        self._bond = np.array([*(OWN_WAY if human.goals else 1.0 for human in people), 0.0])

    def act(self, snapshot: Snapshot) -> CrowdCommands:
        """What each person wants in this tick."""
        snapshot, self._there = with_absent_rows(snapshot)
        humans, social = snapshot.humans, self._social
        social.attend(self._there)
        self._life.update(snapshot.tick, humans)
        towards = self._wanderers.update(snapshot.tick, humans, self._there) - humans.position
        direction = np.where(social.walks[:, None], directed(towards, humans.direction), 0.0)
        walkers = self._walkers(snapshot, direction, self._eased(towards))
        self._keep_to = self._reactions.stepped_back(snapshot, social.home)
        facing, look = self._posture(snapshot, walkers)
        often = min(times_a_tick(self._model.evaluations, snapshot.dt), self._scene.rules.substeps)
        until_asked_again = snapshot.dt / often

        def refresh(rows: Array) -> Array:
            position, velocity = rows[:, :2], rows[:, 2:]
            there = replace(walkers, position=position, velocity=velocity)
            return self._within_reason(velocity[:-1], self._acceleration(there), until_asked_again)

        return CrowdCommands(
            acceleration=self._within_reason(humans.velocity, self._acceleration(walkers), until_asked_again),
            facing=facing,
            look=look,
            activity=social.activity,
            interactions=social.interactions,
            refresh=refresh if often > 1 else None,
            evaluations=often,
            leaving=self._wanderers.leaving,
        )

    def _walkers(self, snapshot: Snapshot, direction: Array, speed: Array) -> Walkers:
        """Everybody as the model is told of them. The robot rides along as the last row: no array is one wide."""
        humans, robot = snapshot.humans, snapshot.robot
        position = np.concatenate((humans.position, np.array([robot.position])))
        seen = self._sight.seen(position)
        direction, pace = self._reactions.course(snapshot, self._social.walks, direction, speed[:-1], seen[-1, :-1])
        speed = np.concatenate((pace, speed[-1:]))
        return Walkers(
            position=position,
            velocity=np.concatenate((humans.velocity, np.array([robot.velocity]))),
            desired_direction=np.concatenate((direction, np.zeros((1, 2)))),
            body_direction=np.concatenate((humans.direction, np.array([robot.direction]))),
            desired_speed=speed,
            radius=self._radius,
            weight=self._among_those_present(self._weight * seen),
            member=None if self._member is None else self._among_those_present(self._member),
            bond=self._bond,
        )

    def _among_those_present(self, pairs: Array) -> Array:
        """(M, M), 0 where either is absent."""
        there = self._there
        return pairs if there is None else pairs * there[:, None] * there

    def _acceleration(self, walkers: Walkers) -> Array:
        """(N, 2), m/s2: of those who walk by the model, of those who stand back to where they stood."""
        walking = self._model.acceleration(walkers)[:-1] + self._reactions.push(walkers.position)
        standing = standing_acceleration(walkers.position[:-1], walkers.velocity[:-1], self._keep_to)
        return np.where(self._social.walks[:, None], walking, standing)

    def _within_reason(self, velocity: Array, acceleration: Array, dt: float) -> Array:
        """Cut what would make anyone faster than their hurry within the tick."""
        x, y = (velocity[:, k] + acceleration[:, k] * dt for k in (0, 1))
        speed, most = np.sqrt(x * x + y * y), HURRY * self._speed[: len(velocity)]
        part = np.where(speed > most, most / np.maximum(speed, 1e-6), 1.0)
        return np.stack(((x * part - velocity[:, 0]) / dt, (y * part - velocity[:, 1]) / dt), axis=1)

    def _eased(self, towards: Array) -> Array:
        """(N + 1,), m/s: desired speeds, less where the way ends."""
        left = lengths(towards) / EASE
        speed = self._speed.copy()
        speed[:-1] = np.where(self._wanderers.is_last, np.minimum(speed[:-1], left), speed[:-1])
        return speed

    def _posture(self, snapshot: Snapshot, walkers: Walkers) -> tuple[Array, Array]:
        """Where bodies face and heads look, (N, 2) each, unit vectors."""
        course = (walkers.desired_direction * walkers.desired_speed[:, None])[:-1]
        facing = self._attention.facing(snapshot, self._social, course, self._reactions)
        if self._model.headed:  # who goes where they face, faces where they want to go
            facing = np.where(self._social.walks[:, None], walkers.desired_direction[:-1], facing)
        reach = np.maximum(walkers.desired_speed[:-1] * AHEAD, SHORTEST)
        ahead = self._wanderers.ahead(snapshot.humans.position, reach)
        return facing, self._attention.look(snapshot, self._social, facing, ahead, self._reactions)

    def _group_speeds(self) -> Array:
        """(N + 1,), m/s: who wanders in a group goes at the pace of its slowest; the robot's is 0."""
        speed = {human.id: human.desired_speed for human in self._scene.humans}
        wandering = {human.id for human in self._scene.humans if human.behaviour == "wandering"}
        for group in self._scene.groups:
            slowest = min(speed[member] for member in group.members)
            speed.update({member: slowest for member in group.members if member in wandering})
        return np.array([*(speed[human.id] for human in self._scene.humans), 0.0], dtype=float)

    def _who_minds_whom(self) -> Array:
        """(M, M), how much column i minds row j; the robot, which is the last, is left to the reactions."""
        people = self._scene.humans
        weight = 1.0 - np.eye(len(people) + 1)
        weight[-1, :-1] = 0.0  # what people do about the robot is a matter of `Reactions`, whatever the law
        return weight

    def _who_walks_with_whom(self) -> Array | None:
        """(M, M), 1 where two walk in one group; None where nobody does."""
        member = np.zeros_like(self._weight)
        index = {human.id: k for k, human in enumerate(self._scene.humans)}
        for group in self._scene.groups:
            rows = [index[m] for m in group.members] if group.kind == "walking" else []
            member[np.ix_(rows, rows)] = 1.0
        np.fill_diagonal(member, 0.0)
        return member if member.any() else None
