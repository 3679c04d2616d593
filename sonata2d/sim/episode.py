"""One episode: a scene, its crowd and a controller, run tick by tick to an outcome."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

from ..agents.controllers.base import Controller, Regenerate, Stop, recorded_path
from ..agents.pedestrians.crowd import Crowd
from ..core.devices import DeviceEvent, ImageRequest
from ..core.entities import Robot
from ..core.geometry import Twist
from ..core.scene import Scene
from ..core.snapshot import Author, Contact, Frame, Observer, Outcome, Snapshot, Status
from ..core.vectors import wrap_angle
from ..errors import ControllerError, Sonata2dError
from .world import World


def executable(asked: Twist, now: Twist, robot: Robot, dt: float) -> Twist:
    """The nearest twist to the one asked for that the drive can reach within a tick.

    Args:
        asked: what the controller wants, body frame.
        now: what the drive does at present, body frame; being pushed about does not count.
        robot: its drive and limits. A unicycle has no sideways velocity.
        dt: s.
    """
    limits = robot.limits
    vx = _clamped(asked.vx, -limits.back, limits.ahead)
    vy = _clamped(asked.vy, -limits.sideways, limits.sideways) if robot.kinematics == "holonomic" else 0.0
    omega = _clamped(asked.omega, -limits.turn, limits.turn)
    from_x, from_y = now.vx, now.vy if robot.kinematics == "holonomic" else 0.0
    dx, dy, most = vx - from_x, vy - from_y, limits.acceleration * dt
    change = math.sqrt(dx * dx + dy * dy)
    if change > most:
        vx, vy = from_x + dx * (most / change), from_y + dy * (most / change)
    turn = limits.turn_acceleration * dt
    return Twist(vx, vy, now.omega + _clamped(omega - now.omega, -turn, turn))


def _clamped(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


Renderer = Callable[[Snapshot, ImageRequest], Any]  # gives (H, W, 3) of uint8


def renderer_for(controller: Controller) -> Renderer | None:
    """The renderer of the camera images that a controller requests; None, and no pygame, if it requests none."""
    if controller.image is None:
        return None
    from ..view.eye import image_of

    return image_of


@dataclass(frozen=True, slots=True)
class Moment:
    """What came from outside at one tick: with the scene, all it takes to have the tick again."""

    command: Twist
    label: Any = None
    events: tuple[DeviceEvent, ...] = ()


class Episode:
    """Runs a scene tick by tick: look, think, note, move.

    Args:
        scene: where it starts.
        controller: drives the robot.
        observers: are told of every frame: recorders, windows.
        past: moments that were decided before; they are replayed before the controller is asked.
        author: what files say of the controller, if not what it says of itself.
        renderer: draws what a controller with an `image` request sees, e.g. `sonata2d.view.image_of`.

    Raises:
        ControllerError: the controller asks for an image, and there is no renderer.

    Attributes:
        past: every moment so far.
        outcome: None while it runs.
    """

    def __init__(
        self,
        scene: Scene,
        controller: Controller,
        *,
        observers: Iterable[Observer] = (),
        past: Sequence[Moment] = (),
        author: Author | None = None,
        renderer: Renderer | None = None,
    ) -> None:
        if controller.image is not None and renderer is None:
            raise ControllerError(
                f"{type(controller).__name__} asks for a camera image; give Episode(renderer=sonata2d.view.image_of)"
            )
        self.scene, self.controller, self.observers = scene, controller, tuple(observers)
        self.past: list[Moment] = []
        self.outcome: Outcome | None = None
        self._script, self._author = tuple(past), author or author_of(controller)
        self._renderer = renderer
        self._world, self._crowd = World(scene), Crowd(scene)
        controller.reset(scene)
        for observer in self.observers:
            observer.open(scene, self._author)

    def run(self) -> Outcome:
        """Run to the end.

        Raises:
            ControllerError: the controller answered what is no finite twist. What it raises itself passes through,
                with the tick added as a note.
        """
        while self.step() is not None:
            pass
        assert self.outcome is not None
        return self.outcome

    def step(self, events: Sequence[DeviceEvent] = ()) -> Frame | None:
        """One tick; None once the episode is over and its `outcome` known.

        Args:
            events: what a person did to a device since the last tick.

        Raises:
            ControllerError: as `run`.
        """
        if self.outcome is not None:
            return None
        tick = self._world.tick
        scripted = self._script[tick] if tick < len(self._script) else None
        snapshot = self._world.snapshot(scripted.events if scripted else tuple(events))
        outcome = ending(snapshot)
        if outcome is None:
            answer = scripted or self._ask(snapshot)
            if isinstance(answer, Moment):
                return self._note_and_move(snapshot, answer)
            outcome = answer
        self._close(snapshot, outcome)
        return None

    def look(self) -> Snapshot:
        """The world as it is now, without device events."""
        return self._world.snapshot()

    def branch(
        self,
        tick: int,
        controller: Controller,
        *,
        observers: Iterable[Observer] = (),
        renderer: Renderer | None = None,
    ) -> Episode:
        """The same episode up to `tick`, to the bit, then driven by another controller.

        Args:
            tick: how many ticks stay as they were, 0..len(past).
            controller: drives from there on.
            observers: see the branch from its tick 0 on.
            renderer: as for an episode; this one's unless given.

        Raises:
            ValueError: the episode did not get that far.
        """
        if not 0 <= tick <= len(self.past):
            raise ValueError(f"tick must be 0..{len(self.past)}, the ticks run so far, got {tick}")
        return Episode(
            self.scene, controller, observers=observers, past=self.past[:tick], renderer=renderer or self._renderer
        ).caught_up()

    def caught_up(self) -> Episode:
        """This episode, once the past that it was given is replayed."""
        while len(self.past) < len(self._script) and self.step() is not None:
            pass
        return self

    def end(self, status: Status, reason: str, events: Sequence[DeviceEvent] = ()) -> Outcome:
        """End the episode here, from outside: what is noted so far stays."""
        snapshot = self._world.snapshot(tuple(events))
        if self.outcome is None:
            self._close(snapshot, Outcome(status, reason, snapshot.tick, snapshot.time))
        assert self.outcome is not None
        return self.outcome

    def _ask(self, snapshot: Snapshot) -> Moment | Outcome:
        """The controller's answer to a snapshot."""
        with self._telling_tick(snapshot):
            if self.controller.image is not None and self._renderer is not None:
                snapshot = replace(snapshot, image=self._renderer(snapshot, self.controller.image))
            answer = self.controller.act(snapshot)
            if isinstance(answer, Stop | Regenerate):
                status: Status = "stopped" if isinstance(answer, Stop) else "regenerate"
                return Outcome(status, answer.reason, snapshot.tick, snapshot.time)
            command = checked_twist(answer, self.controller)
            label = deepcopy(self.controller.label(snapshot, command))  # the controller may use it again
            return Moment(command, label, snapshot.events)

    def _note_and_move(self, snapshot: Snapshot, moment: Moment) -> Frame:
        """Tell the observers of the frame, then let the world move."""
        frame = Frame(snapshot, moment.command, moment.label)
        with self._telling_tick(snapshot):
            for observer in self.observers:
                observer.note(frame)
        self.past.append(moment)
        robot = snapshot.robot
        twist = executable(moment.command, robot.executed, robot.body, snapshot.dt)
        self._world.step(twist, self._crowd.act(snapshot))
        return frame

    @contextmanager
    def _telling_tick(self, snapshot: Snapshot) -> Iterator[None]:
        """Close the episode on an error, which goes on with the tick as a note."""
        try:
            yield
        except Exception as error:
            error.add_note(f"at tick {snapshot.tick} of the episode")
            reason = f"{type(error).__name__}: {error}"
            try:
                self._close(snapshot, Outcome("error", reason, snapshot.tick, snapshot.time))
            except Sonata2dError as failure:
                error.add_note(f"nor could what was noted be kept: {failure}")
            raise

    def _close(self, snapshot: Snapshot, outcome: Outcome) -> None:
        self.outcome = outcome
        for observer in self.observers:
            observer.close(snapshot, outcome)


def ending(snapshot: Snapshot) -> Outcome | None:
    """Whether the episode ends at this look: goal reached, contact where that ends it, or out of time."""
    scene, robot = snapshot.scene, snapshot.robot
    goal, rules = scene.goal, scene.rules
    dx, dy = goal.x - robot.position[0], goal.y - robot.position[1]
    turned = abs(wrap_angle(robot.pose.theta - goal.theta)) if goal.angle < 3.14 else 0.0
    if "goal" in rules.ends_on and math.sqrt(dx * dx + dy * dy) <= goal.distance and turned <= goal.angle:
        return Outcome("goal", f"within {goal.distance} m of the goal", snapshot.tick, snapshot.time)
    if "contact" in rules.ends_on and snapshot.contacts:
        return Outcome("contact", _told(snapshot.contacts[0]), snapshot.tick, snapshot.time)
    if snapshot.tick >= rules.last_tick:
        return Outcome("timeout", f"{rules.time_limit} s are over", snapshot.tick, snapshot.time)
    return None


def _told(contact: Contact) -> str:
    faults = {(True, False): "the robot", (False, True): "the other", (True, True): "both", (False, False): "nobody"}
    return (
        f"contact with {contact.kind} {contact.id}, at fault: {faults[contact.robot_at_fault, contact.other_at_fault]}"
    )


def checked_twist(answer: object, controller: Controller) -> Twist:
    """The answer as a twist that a file can hold.

    Raises:
        ControllerError: it is no `Twist`, or not finite.
    """
    name = type(controller).__name__
    if not isinstance(answer, Twist):
        raise ControllerError(f"{name}.act must return a Twist, got {answer!r}; return Twist(vx, vy, omega)")
    values = (answer.vx, answer.vy, answer.omega)
    if not all(isinstance(v, int | float) and math.isfinite(v) for v in map(_plain, values)):
        raise ControllerError(f"{name}.act must return finite numbers, got {answer!r}")
    try:
        return Twist(*(float(v) for v in values)).rounded()
    except ValueError as error:
        raise ControllerError(f"{name}.act answered {answer!r}: {error}") from None


def _plain(value: object) -> object:
    """A NumPy scalar as the Python number it holds."""
    return value.item() if hasattr(value, "item") else value


def author_of(controller: Controller, path: str | None = None) -> Author:
    """What a file says of a controller.

    Args:
        path: how it was named, e.g. on the command line; by default its module and class.
    """
    return Author(
        path=path or recorded_path(type(controller)),
        version=controller.version,
        settings=dict(controller.settings()),
        labels=dict(controller.labels) or None,
    )
