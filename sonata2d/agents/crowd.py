"""The people's minds: one array function a tick, from the snapshot to what each person wants."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..entities import Scene
from ..exact import Array, headings
from ..frame import CrowdCommands, Snapshot, activities_of
from .forces.drive import standing_acceleration
from .forces.walls import Sight
from .models.registry import MODELS
from .models.walkers import Walkers
from .wandering import Wanderers

HURRY = 1.3  # times the desired speed is the fastest anyone walks (Helbing & Molnár 1995)
EASE = 0.4  # s: who comes to a stop somewhere goes no faster than the distance left over this
STROLLING = 0.2  # m/s, above which the body follows the way it goes


class Crowd:
    """All people of a scene.

    Args:
        scene: who they are and where they start; its seed decides where they wander.

    Raises:
        ValueError: a human's model is unknown, or models are mixed.
    """

    def __init__(self, scene: Scene) -> None:
        people = scene.humans
        names = sorted({human.model for human in people} or {"moussaid2009"})
        if len(names) > 1 or names[0] not in MODELS:
            raise ValueError(f"people must share one walking model of {', '.join(MODELS)}; got {', '.join(names)}")
        self._model = MODELS[names[0]](scene)
        self._scene = scene
        self._wanderers = Wanderers(scene)
        self._walks = np.array([human.behaviour != "standing" for human in people], dtype=bool)
        self._home = np.array([human.pose.position for human in people], dtype=float).reshape(-1, 2)
        self._faces = headings(np.array([human.pose.theta for human in people]))
        self._speed = self._group_speeds()
        radius = [*(human.radius for human in people), scene.robot.radius]
        self._radius = np.array(radius, dtype=float)
        self._weight = self._who_minds_whom()
        self._sight = Sight(scene, len(people) + 1)
        self._member = self._who_walks_with_whom()
        self._others = self._whom_they_face()
        self._keeps_facing = self._who_stands_in_formation()
        self._activity = activities_of(scene)

    def act(self, snapshot: Snapshot) -> CrowdCommands:
        """What each person wants in this tick."""
        humans = snapshot.humans
        towards = self._wanderers.update(snapshot.tick, humans) - humans.position
        direction = np.where(self._walks[:, None], _unit(towards, humans.heading), 0.0)
        walkers = self._walkers(snapshot, direction, self._eased(towards))
        partner = _unit(self._whom(walkers.position) - humans.position, self._faces)
        often = self._model.evaluations

        def refresh(rows: Array) -> Array:
            position, velocity = rows[:, :2], rows[:, 2:]
            there = replace(walkers, position=position, velocity=velocity)
            return self._within_reason(velocity[:-1], self._acceleration(there), snapshot.dt / often)

        return CrowdCommands(
            acceleration=self._within_reason(humans.velocity, self._acceleration(walkers), snapshot.dt),
            facing=np.where(
                self._walks[:, None],
                self._ahead(humans.velocity, direction),
                np.where(self._keeps_facing[:, None], self._faces, partner),
            ),
            look=np.where(self._walks[:, None], direction, partner),  # heads lead the way
            activity=self._activity,
            interactions=snapshot.interactions,
            refresh=refresh if often > 1 else None,
            evaluations=often,
        )

    def _walkers(self, snapshot: Snapshot, direction: Array, speed: Array) -> Walkers:
        """Everybody as the model is told of them. The robot rides along as the last row: no array is one wide."""
        humans, robot = snapshot.humans, snapshot.robot
        position = np.concatenate((humans.position, np.array([robot.position])))
        return Walkers(
            position=position,
            velocity=np.concatenate((humans.velocity, np.array([robot.velocity]))),
            direction=np.concatenate((direction, np.zeros((1, 2)))),
            heading=np.concatenate((humans.heading, np.array([robot.heading]))),
            desired_speed=speed,
            radius=self._radius,
            weight=self._weight * self._sight.seen(position),
            member=self._member,
        )

    def _acceleration(self, walkers: Walkers) -> Array:
        """(N, 2), m/s2: of those who walk by the model, of those who stand back to where they stood."""
        people = len(self._walks)
        walking = self._model.acceleration(walkers)[:people]
        standing = standing_acceleration(walkers.position[:people], walkers.velocity[:people], self._home)
        return np.where(self._walks[:, None], walking, standing)

    def _within_reason(self, velocity: Array, acceleration: Array, dt: float) -> Array:
        """Cut what would make anyone faster than their hurry within the tick."""
        x, y = (velocity[:, k] + acceleration[:, k] * dt for k in (0, 1))
        speed, most = np.sqrt(x * x + y * y), HURRY * self._speed[: len(velocity)]
        part = np.where(speed > most, most / np.maximum(speed, 1e-6), 1.0)
        return np.stack(((x * part - velocity[:, 0]) / dt, (y * part - velocity[:, 1]) / dt), axis=1)

    def _eased(self, towards: Array) -> Array:
        """(N + 1,), m/s: desired speeds, less where the way ends."""
        left = np.sqrt(towards[:, 0] * towards[:, 0] + towards[:, 1] * towards[:, 1]) / EASE
        speed = self._speed.copy()
        speed[:-1] = np.where(self._wanderers.is_last, np.minimum(speed[:-1], left), speed[:-1])
        return speed

    def _ahead(self, velocity: Array, direction: Array) -> Array:
        """Walkers face the way they go, or want to go when slow."""
        speed = np.sqrt(velocity[:, 0] * velocity[:, 0] + velocity[:, 1] * velocity[:, 1])[:, None]
        ahead: Array = np.where(speed > STROLLING, velocity / np.maximum(speed, 1e-6), direction)
        return ahead

    def _whom(self, position: Array) -> Array:
        """(N, 2): the place each person attends to, in a group the middle of the others; ahead if there is none."""
        index, share, place = self._others
        middle = place
        for k in range(index.shape[1]):
            middle = middle + share[:, k, None] * position[index[:, k]]
        return middle

    def _group_speeds(self) -> Array:
        """(N + 1,), m/s: groups go at the pace of their slowest; the robot's is 0."""
        speed = {human.id: human.desired_speed for human in self._scene.humans}
        for group in self._scene.groups:
            slowest = min(speed[member] for member in group.members)
            speed.update(dict.fromkeys(group.members, slowest))
        return np.array([*(speed[human.id] for human in self._scene.humans), 0.0], dtype=float)

    def _who_minds_whom(self) -> Array:
        """(M, M), how much column i minds row j; the robot is the last."""
        people = self._scene.humans
        weight = 1.0 - np.eye(len(people) + 1)
        weight[-1, :-1] = [human.reacts_to_robot for human in people]
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

    def _whom_they_face(self) -> tuple[Any, Array, Array]:
        """Of each person the indices (N, K) and shares (N, K) of those they face, and the place (N, 2) if nobody."""
        scene = self._scene
        index = {human.id: k for k, human in enumerate(scene.humans)}
        things = {thing.id: thing.pose.position for thing in scene.furniture}
        others: list[list[int]] = [[] for _ in scene.humans]
        place = self._home + 3.0 * self._faces
        for tie in scene.interactions:
            src, dst = index[tie.src], index.get(tie.dst)
            if dst is not None:
                others[src].append(dst)
                others[dst].append(src)
            else:
                place[src] = things[tie.dst]
        most = max((1, *map(len, others)))
        rows = np.array([own + [k] * (most - len(own)) for k, own in enumerate(others)], dtype=int).reshape(-1, most)
        share = np.zeros(rows.shape)
        for k, own in enumerate(others):
            share[k, : len(own)] = 1.0 / max(len(own), 1)
        place[[len(own) > 0 for own in others]] = 0.0
        return rows, share, place

    def _who_stands_in_formation(self) -> Any:
        """(N,) of bool: who faces a space that a talking group shares, from the start on."""
        placed = {
            m for group in self._scene.groups if group.kind == "talking" and group.formation for m in group.members
        }
        return np.array([human.id in placed for human in self._scene.humans], dtype=bool)


def _unit(vectors: Array, otherwise: Array) -> Array:
    """Unit vectors along (N, 2) vectors, or the others where there is no length to speak of."""
    x, y = vectors[:, 0], vectors[:, 1]
    size = np.sqrt(x * x + y * y)
    return np.where((size > 1e-3)[:, None], vectors / np.maximum(size, 1e-3)[:, None], otherwise)
