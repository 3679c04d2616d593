"""`Crowd`: accelerations, body directions and gaze of all pedestrians at each tick."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...core.entities import DEFAULT_MODEL
from ...core.humans import BODY_X, GAZE_X, Humans, X, Y, frozen, human_ids, initial_activities
from ...core.portable_math import Array
from ...core.scene import Scene
from ...core.snapshot import CrowdCommands, Snapshot
from ...core.vectors import lengths
from ...registry import PEDESTRIAN_MODELS
from .models.base import LineOfSight, Walkers, evaluations_per_tick, pedestrian_model, standing_acceleration
from .orientation import HEAD_LEAD_TIME, MINIMUM_HEAD_LEAD, Orientation, unit_directions
from .reactions import Reactions
from .social.dynamics import SocialDynamics
from .social.state import SocialState
from .wayfinding import Wayfinding


def with_absent_rows(snapshot: Snapshot) -> tuple[Snapshot, Array | None]:
    """Extend a snapshot to one row for each human of the scene.

    Returns:
        The snapshot, in which absent humans have their parking positions and the scene's interactions; and the presence
        (N + 1,): 1 for present humans and for the robot, which is last, 0 for absent humans. If all are present, the
        unchanged snapshot and None.
    """
    humans, scene = snapshot.humans, snapshot.scene
    if humans.row is None:
        return snapshot, None
    count = len(scene.humans)
    state = humans.expand(humans.state, count, 0.0)
    presence = np.zeros(count + 1)
    presence[humans.row], presence[-1] = 1.0, 1.0
    absent = presence[:-1] == 0.0
    state[absent, X : Y + 1] = scene.parking[absent]
    state[absent, BODY_X] = state[absent, GAZE_X] = 1.0
    radius = frozen(np.array([human.radius for human in scene.humans], dtype=float))
    all_humans = Humans(frozen(state), human_ids(scene), radius, initial_activities(scene))
    return replace(snapshot, humans=all_humans, interactions=scene.interactions), presence


MAXIMUM_SPEED_RATIO = 1.3  # maximum speed over desired speed (Helbing & Molnár 1995)
OWN_GOALS_BOND = 0.1  # bond to the group of members with goals of their own; 1 for wandering members
ARRIVAL_TIME = 0.4  # s: the desired speed near a final target is at most the remaining distance over this


class Crowd:
    """All pedestrians of a scene: one pedestrian model, wayfinding, social behaviour, reactions and orientation.

    Args:
        scene: the pedestrians and their initial states; its seed determines where they wander.

    Raises:
        ValueError: a human's model is unknown, or the humans have different models.
    """

    def __init__(self, scene: Scene) -> None:
        humans = scene.humans
        names = sorted({human.model for human in humans} or {DEFAULT_MODEL})
        if len(names) > 1:
            raise ValueError(f"all pedestrians must have the same model, got {', '.join(names)}")
        if names[0] not in PEDESTRIAN_MODELS:
            raise ValueError(PEDESTRIAN_MODELS.unknown(names[0]))
        self._model = pedestrian_model(names[0])(scene)
        self._scene = scene
        self._presence: Array | None = None
        self._wayfinding = Wayfinding(scene)
        self._social = SocialState(scene)
        self._social_dynamics = SocialDynamics(scene, self._social, self._wayfinding)
        self._reactions, self._orientation = Reactions(scene), Orientation(scene)
        self._standing_position = self._social.standing_position
        self._desired_speed = self._group_speeds()
        self._radius = np.array([*(human.radius for human in humans), scene.robot.radius], dtype=float)
        self._attention = _attention(len(humans))
        self._line_of_sight = LineOfSight(scene, len(humans) + 1)
        self._member = _walking_groups(scene)
        self._bond = np.array([*(OWN_GOALS_BOND if human.goals else 1.0 for human in humans), 0.0])

    def act(self, snapshot: Snapshot) -> CrowdCommands:
        """The commands of all pedestrians for the next tick."""
        snapshot, self._presence = with_absent_rows(snapshot)
        humans, social = snapshot.humans, self._social
        social.set_presence(self._presence)
        self._social_dynamics.update(snapshot.tick, humans)
        to_target = self._wayfinding.update(snapshot.tick, humans, self._presence) - humans.position
        direction = np.where(social.is_walking[:, None], unit_directions(to_target, humans.direction), 0.0)
        walkers = self._walkers(snapshot, direction, self._arrival_speed(to_target))
        self._standing_position = self._reactions.step_back(snapshot, social.standing_position)
        facing, gaze = self._orient(snapshot, walkers)
        evaluations = min(evaluations_per_tick(self._model.evaluations, snapshot.dt), self._scene.rules.substeps)
        interval = snapshot.dt / evaluations

        def refresh(rows: Array) -> Array:
            position, velocity = rows[:, :2], rows[:, 2:]
            moved = replace(walkers, position=position, velocity=velocity)
            return self._limit_speed(velocity[:-1], self._acceleration(moved), interval)

        return CrowdCommands(
            acceleration=self._limit_speed(humans.velocity, self._acceleration(walkers), interval),
            facing=facing,
            gaze=gaze,
            activity=social.activity,
            interactions=social.interactions,
            refresh=refresh if evaluations > 1 else None,
            evaluations=evaluations,
            leaving=self._wayfinding.leaving,
        )

    def _walkers(self, snapshot: Snapshot, direction: Array, speed: Array) -> Walkers:
        """The input of the pedestrian model.

        The robot is its last row, so that no array has a single column (see `models.base`).

        Args:
            snapshot: the present state, with one row for each human of the scene.
            direction: (N, 2), desired directions, unit vectors.
            speed: (N + 1,), desired speeds, m/s.
        """
        humans, robot = snapshot.humans, snapshot.robot
        position = np.concatenate((humans.position, np.array([robot.position])))
        visible = self._line_of_sight.visible(position)
        is_walking = self._social.is_walking
        direction, human_speed = self._reactions.adjust_course(
            snapshot, is_walking, direction, speed[:-1], visible[-1, :-1]
        )
        return Walkers(
            position=position,
            velocity=np.concatenate((humans.velocity, np.array([robot.velocity]))),
            desired_direction=np.concatenate((direction, np.zeros((1, 2)))),
            body_direction=np.concatenate((humans.direction, np.array([robot.direction]))),
            desired_speed=np.concatenate((human_speed, speed[-1:])),
            radius=self._radius,
            attention=self._between_present(self._attention * visible),
            member=None if self._member is None else self._between_present(self._member),
            bond=self._bond,
        )

    def _between_present(self, pairs: Array) -> Array:
        """Set the rows and columns of absent humans to 0; (M, M)."""
        presence = self._presence
        return pairs if presence is None else pairs * presence[:, None] * presence

    def _acceleration(self, walkers: Walkers) -> Array:
        """(N, 2), m/s^2: by the model for walking pedestrians, back to their positions for standing ones."""
        walking = self._model.acceleration(walkers)[:-1] + self._reactions.robot_repulsion(walkers.position)
        standing = standing_acceleration(walkers.position[:-1], walkers.velocity[:-1], self._standing_position)
        return np.where(self._social.is_walking[:, None], walking, standing)

    def _limit_speed(self, velocity: Array, acceleration: Array, dt: float) -> Array:
        """Reduce accelerations that would exceed the maximum speed within dt, s; (N, 2), m/s^2."""
        x, y = (velocity[:, k] + acceleration[:, k] * dt for k in (0, 1))
        speed, maximum = np.sqrt(x * x + y * y), MAXIMUM_SPEED_RATIO * self._desired_speed[: len(velocity)]
        scale = np.where(speed > maximum, maximum / np.maximum(speed, 1e-6), 1.0)
        return np.stack(((x * scale - velocity[:, 0]) / dt, (y * scale - velocity[:, 1]) / dt), axis=1)

    def _arrival_speed(self, to_target: Array) -> Array:
        """Desired speeds, (N + 1,), m/s, reduced near final targets; from the vectors to the targets, (N, 2), m."""
        maximum = lengths(to_target) / ARRIVAL_TIME
        speed = self._desired_speed.copy()
        speed[:-1] = np.where(self._wayfinding.is_final, np.minimum(speed[:-1], maximum), speed[:-1])
        return speed

    def _orient(self, snapshot: Snapshot, walkers: Walkers) -> tuple[Array, Array]:
        """Desired directions of bodies and heads, (N, 2) each, unit vectors."""
        course = (walkers.desired_direction * walkers.desired_speed[:, None])[:-1]
        facing = self._orientation.facing(snapshot, self._social, course, self._reactions)
        if self._model.headed:  # motion follows the body, so the body turns to the desired direction
            facing = np.where(self._social.is_walking[:, None], walkers.desired_direction[:-1], facing)
        head_lead = np.maximum(walkers.desired_speed[:-1] * HEAD_LEAD_TIME, MINIMUM_HEAD_LEAD)
        points_ahead = self._wayfinding.points_ahead(snapshot.humans.position, head_lead)
        return facing, self._orientation.gaze(snapshot, self._social, facing, points_ahead, self._reactions)

    def _group_speeds(self) -> Array:
        """Desired speeds, (N + 1,), m/s: wandering groups walk at the speed of the slowest member; the robot's is 0."""
        speed = {human.id: human.desired_speed for human in self._scene.humans}
        wandering = {human.id for human in self._scene.humans if human.behaviour == "wandering"}
        for group in self._scene.groups:
            slowest = min(speed[member] for member in group.members)
            speed.update({member: slowest for member in group.members if member in wandering})
        return np.array([*(speed[human.id] for human in self._scene.humans), 0.0], dtype=float)


def _attention(count: int) -> Array:
    """(count + 1, count + 1), ego first: all attend to all others, except that pedestrians ignore the robot.

    The robot, the last row, is handled by `Reactions`, whatever the pedestrian model.
    """
    attention = 1.0 - np.eye(count + 1)
    attention[:-1, -1] = 0.0
    return attention


def _walking_groups(scene: Scene) -> Array | None:
    """`Walkers.member` of a scene."""
    index = {human.id: k for k, human in enumerate(scene.humans)}
    member = np.zeros((len(scene.humans) + 1, len(scene.humans) + 1))
    for group in scene.groups:
        rows = [index[m] for m in group.members] if group.kind == "walking" else []
        member[np.ix_(rows, rows)] = 1.0
    np.fill_diagonal(member, 0.0)
    return member if member.any() else None
