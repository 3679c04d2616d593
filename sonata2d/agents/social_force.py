"""The robot as one more walker: it feels the social force that people feel."""

from __future__ import annotations

import math

import numpy as np

from ..entities import Scene
from ..exact import Array, angle_of
from ..frame import Snapshot
from ..geometry import Twist
from ..navigation import FreeSpace
from .controller import Controller
from .forces.drive import desired_acceleration
from .forces.moussaid2009 import Moussaid2009, bulk_of, interaction_acceleration
from .forces.walls import wall_acceleration

LOOK_EVERY = 5  # ticks between looks for the way


class SocialForce(Controller):
    """Walks the shortest way to the goal under the law of Moussaïd et al. (2009), as a person would.

    Args:
        speed: desired speed, m/s.
        gain: 1/s, how fast it turns the way it goes.
    """

    version = "1"

    def __init__(self, speed: float = 0.9, gain: float = 2.0) -> None:
        self.speed, self.gain = speed, gain
        self._law = Moussaid2009()

    def reset(self, scene: Scene) -> None:
        self._space = FreeSpace(scene.outline, scene.barriers.joined(scene.standing), scene.robot.radius + 0.05)
        self._towards = scene.goal.position
        self._take_note_of(np.array([human.radius for human in scene.humans]), scene.robot.radius)

    def _take_note_of(self, people: Array, robot: float) -> None:
        """The bulk and the weight of all who are there, by their radii, m."""
        radius = np.array([*people.tolist(), robot])
        self._bulk, self._weight = bulk_of(radius), np.zeros((len(radius), len(radius)))
        self._weight[:-1, -1] = 1.0

    def act(self, snapshot: Snapshot) -> Twist:
        if len(snapshot.humans) != len(self._bulk) - 1 or snapshot.humans.row is not None:
            self._take_note_of(snapshot.humans.radius, snapshot.robot.radius)
        robot, goal = snapshot.robot, snapshot.goal
        if snapshot.tick % LOOK_EVERY == 0:
            way = self._space.path(robot.position, goal.position)
            self._towards = goal.position if way is None or len(way) < 2 else (float(way[1][0]), float(way[1][1]))
        ax, ay = self._acceleration(snapshot)
        vx, vy = robot.velocity[0] + ax * snapshot.dt, robot.velocity[1] + ay * snapshot.dt
        c, s = robot.heading
        ahead, left = vx * c + vy * s, vy * c - vx * s
        speed = math.sqrt(vx * vx + vy * vy)
        return Twist(ahead, left, self.gain * angle_of(left, ahead) if speed > 0.1 else 0.0)

    def _acceleration(self, snapshot: Snapshot) -> tuple[float, float]:
        """The social force on the robot, m/s2, world frame."""
        humans, robot, law = snapshot.humans, snapshot.robot, self._law
        position = np.concatenate((humans.position, np.array([robot.position])))
        velocity = np.concatenate((humans.velocity, np.array([robot.velocity])))
        dx, dy = self._towards[0] - robot.position[0], self._towards[1] - robot.position[1]
        apart = max(math.sqrt(dx * dx + dy * dy), 1e-6)
        towards = np.array([[dx / apart, dy / apart]])
        side, tau = snapshot.scene.rules.side, law.relaxation_time
        force = interaction_acceleration(position, velocity, self._weight, self._bulk, side, law)[-1]
        force = force + desired_acceleration(velocity[-1:], towards, np.array([self.speed]), relaxation_time=tau)[0]
        twice = np.repeat(position[-1:], 2, axis=0)  # an array one wide would be summed in another order
        force = (
            force
            + wall_acceleration(
                twice,
                np.full(2, robot.radius),
                snapshot.scene.barriers,
                strength=law.wall_strength,
                reach=law.wall_reach,
            )[0]
        )
        return float(force[0]), float(force[1])
