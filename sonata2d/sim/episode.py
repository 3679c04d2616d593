"""One episode: a scene, its crowd and a controller, run tick by tick to an outcome."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from typing import Any, SupportsIndex

from ..agents.controllers.base import Controller, External, Regenerate, Stop, recorded_path, require_controller
from ..agents.controllers.compiled import KernelController
from ..agents.pedestrians.crowd import Crowd
from ..agents.sensors.base import Renderer, SensorSuite, known_to, shown_to
from ..core.devices import DeviceEvent
from ..core.drawable import Drawable
from ..core.files import interruption
from ..core.geometry import Twist, quantised
from ..core.humans import X, Y
from ..core.scene import Scene
from ..core.snapshot import ControllerInfo, Frame, Frames, Observer, Outcome, Snapshot, Status
from ..core.wording import counted, described, shown, text_of
from ..errors import ControllerError, Sonata2dError
from ..registry import did_you_mean
from ..view.drawing import Drawing, drawing_of
from .inputs import Inputs, TickInput
from .member import CompiledRun
from .world import World


def renderer_for(controller: Controller) -> Renderer | None:
    """The renderer of the camera images that a controller requests.

    Returns:
        `sonata2d.view.image_of`; None, without importing pygame, if the controller requests no images.
    """
    sensors = controller.sensors if isinstance(controller.sensors, Sequence) else ()  # SensorSuite refuses others
    if controller.image is None and not any(getattr(sensor, "request", None) for sensor in sensors):
        return None
    from ..view.painter import image_of

    return image_of


class Episode(Drawable):
    """Runs a scene tick by tick: observe, decide, record, move.

    Args:
        scene: initial layout.
        controller: drives the robot; None: a client gives the commands, see `apply`.
        observers: receive every frame, e.g. recorders and windows.
        past: inputs of the first ticks, which are replayed before the controller is asked.
        controller_info: description of the controller in files; by default `controller_info_of(controller)`.
        renderer: draws the images that the controller requests, e.g. `sonata2d.view.image_of`.

    Raises:
        ControllerError: the controller requests an image, and no renderer is given.

    Attributes:
        past: inputs of all ticks so far.
        outcome: None while the episode runs.

    >>> from sonata2d import ScenarioConfig, StraightToGoal, generate
    >>> Episode(generate(ScenarioConfig(humans=0), seed=1), StraightToGoal()).run().status
    'goal'
    """

    def __init__(
        self,
        scene: Scene,
        controller: Controller | None = None,
        *,
        observers: Iterable[Observer] = (),
        past: Sequence[TickInput] = (),
        controller_info: ControllerInfo | None = None,
        renderer: Renderer | None = None,
    ) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(f"an episode needs a scene, such as generate() returns; got {shown(scene)}")
        controller = require_controller(controller or External())
        if controller.image is not None and renderer is None:
            raise ControllerError(
                f"{type(controller).__name__} requests a camera image; give Episode(renderer=sonata2d.view.image_of)"
            )
        if hasattr(observers, "on_frame"):
            raise TypeError(f"observers are several; write observers=[{type(observers).__name__}(...)]")
        self.scene, self.controller, self.observers = scene, controller, tuple(observers)
        self.past = Inputs()
        self.outcome: Outcome | None = None
        self._script, self._controller_info = Inputs(past), controller_info or controller_info_of(controller)
        self._renderer = renderer
        self._crowd, self._world = Crowd(scene), World(scene)
        self._observed: Snapshot | None = None  # of the present tick
        self._sensors = SensorSuite(controller.sensors, scene, renderer)
        controller.reset(known_to(controller, scene))
        for observer in self.observers:
            observer.open(scene, self._controller_info)

    def __repr__(self) -> str:
        state = "running" if self.outcome is None else self.outcome.status
        ticks = counted(len(self.past), "tick")
        return f"<Episode of {self.scene.title}: {type(self.controller).__name__}, {ticks}, {state}>"

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[Any, ...]:
        raise TypeError(
            "an episode cannot be copied or pickled; Episode(episode.scene, controller, past=episode.past) makes "
            "another one, which continues from its present tick"
        )

    def _facts(self) -> dict[str, object]:
        ticks = len(self.past)
        return {
            **self.scene.origin,
            "controller": type(self.controller).__name__,
            "outcome": "running" if self.outcome is None else f"{self.outcome.status}: {self.outcome.reason}",
            "length": f"{ticks * self.scene.rules.dt:g} s, {counted(ticks, 'tick')}",
            "people": len(self.scene.humans),
        }

    @property
    def is_over(self) -> bool:
        """Whether the episode has an outcome."""
        return self.outcome is not None

    def run(self) -> Outcome:
        """Run to the end.

        Raises:
            ControllerError: the controller's answer is not a finite twist. Exceptions of the controller itself pass
                through, with tick, episode and seed added as a note.
        """
        self.replay_past()
        run = self._compiled_run()
        while self.outcome is None:
            if run is None or not self._run_frames(run):
                self.step()
        return self.outcome

    def _compiled_run(self) -> CompiledRun | None:
        """The episode under its controller without the interpreter; None if the controller or an observer needs it."""
        controller = self.controller
        is_compiled = isinstance(controller, KernelController) and self._may_skip
        parts = controller.compiled(self.scene) if is_compiled else None  # type: ignore[attr-defined]
        return CompiledRun(self._world, self._crowd, *parts) if parts else None

    @property
    def _may_skip(self) -> bool:
        """Whether people and observers do without the interpreter in some ticks."""
        is_plain = type(self).step is Episode.step and self._crowd.is_compiled and not self._sensors
        return is_plain and all(map(_takes_many_frames, self.observers))

    def _run_frames(self, run: CompiledRun, limit: int | None = None) -> bool:
        """Run some ticks at once; False if there were none, and `step` is needed."""
        snapshot = self._observe_unless_over(())
        if snapshot is None:
            return True
        if snapshot.events:
            return False
        with interruption.held_back():
            frames = run.frames(snapshot, limit)
            is_replay = len(self.past) < len(self._script)
            if not len(frames.rows):
                if run.refused is not None and not is_replay:
                    self._refuse(run.refused, snapshot)
                return False
            if is_replay:
                labels = self._script.labels(len(self.past), len(self.past) + len(frames.rows))
                frames = frames._replace(labels=labels)
            self._observed = None
            self.past.extend(frames.commands, frames.labels)
            self._deliver(frames)
        return True

    def _refuse(self, command: Twist, snapshot: Snapshot) -> None:
        """End the episode because the controller gave a command that no file can hold."""
        try:
            checked_twist(command, type(self.controller))
        except ControllerError as error:
            self._close_after(error, snapshot)
            raise

    def _deliver(self, frames: Frames) -> None:
        """Send frames to all observers; the first error of one ends the episode."""
        errors: list[BaseException] = []
        for observer in self.observers:
            try:
                observer.on_frames(frames)  # type: ignore[attr-defined]
            except BaseException as error:  # the others get them all the same: the world has moved
                errors.append(error)
        if errors:
            interruption.reraise(errors[0])
            self._close_after(errors[0], self.snapshot())
            raise errors[0]

    def step(self, events: Sequence[DeviceEvent] = ()) -> Frame | None:
        """Run one tick: `observe`, ask the controller, `apply` its command.

        Args:
            events: of input devices since the last tick; ignored in a tick that is replayed.

        Returns:
            The frame of the tick; None if the episode is over, and its `outcome` set.

        Raises:
            ControllerError: as `run`.
        """
        tick = self._world.tick
        replayed = self._script[tick] if tick < len(self._script) else None
        snapshot = self._observe_unless_over(replayed.events if replayed else tuple(events))
        if snapshot is None:
            return None
        answer = replayed or self._decide(snapshot)
        if isinstance(answer, TickInput):
            return self._record_and_move(snapshot, answer)
        self._close(snapshot, answer)
        return None

    def observe(self, events: Sequence[DeviceEvent] = ()) -> Snapshot:
        """The state at the present tick, for a client that chooses the commands itself, see `apply`.

        The episode ends here if the goal is reached, at a contact if the rules say so, or at the time limit: its
        `outcome` is then set. Inputs given as `past` are replayed first.

        Args:
            events: of input devices since the last tick.

        >>> from sonata2d import ScenarioConfig, Twist, generate
        >>> episode = Episode(generate(ScenarioConfig(humans=2), seed=1))
        >>> while not episode.is_over and episode.observe().tick < 10:
        ...     frame = episode.apply(Twist(vx=0.5), label={"speed": 0.5})
        >>> frame.snapshot.tick, round(episode.observe().robot.executed.vx, 2)
        (9, 0.5)
        """
        self.replay_past()
        return self._observe(tuple(events))

    def apply(self, command: Twist, label: Any = None, events: Sequence[DeviceEvent] = ()) -> Frame | None:
        """Execute a command for one tick instead of asking the controller, and record the frame.

        Of a controller, `Controller.command_overridden` is called.

        Args:
            command: of the robot, body frame.
            label: of the frame, any value that JSON can hold; None: the command itself is the label.
            events: of input devices since the last `observe`.

        Returns:
            The frame of the tick; None if the episode is over, and its `outcome` set.

        Raises:
            ControllerError: the command is not a finite twist; the episode has not moved.
        """
        twist = checked_twist(command)
        self.replay_past()
        snapshot = self._observe_unless_over(tuple(events))
        if snapshot is None:
            return None
        self.controller.command_overridden(twist)
        return self._record_and_move(snapshot, TickInput(twist, deepcopy(label), snapshot.events))

    def snapshot(self) -> Snapshot:
        """The current state of the world, without device events."""
        return self._world.snapshot()

    def branch(
        self,
        tick: int,
        controller: Controller,
        *,
        observers: Iterable[Observer] = (),
        renderer: Renderer | None = None,
    ) -> Episode:
        """A new episode that equals this one to the bit up to a tick, and is then driven by another controller.

        Args:
            tick: number of ticks to replay, 0 to len(past).
            controller: drives from that tick on.
            observers: of the new episode, from its tick 0 on.
            renderer: as for `Episode`; by default the renderer of this episode.

        Raises:
            ValueError: the episode has not reached the tick.
        """
        if not 0 <= tick <= len(self.past):
            raise ValueError(f"tick must be 0..{len(self.past)}, the ticks run so far, got {tick}")
        return Episode(
            self.scene, controller, observers=observers, past=self.past[:tick], renderer=renderer or self._renderer
        ).replay_past()

    def replay_past(self) -> Episode:
        """Run the ticks whose inputs were given as `past`.

        Returns:
            This episode.
        """
        script, run = self._script, None
        if len(self.past) < len(script) and not script.has_events and self._may_skip:
            run = CompiledRun.of_commands(self._world, self._crowd, script.commands)
        while len(self.past) < len(script) and not self.is_over:
            if run is None or not self._run_frames(run, len(script) - len(self.past)):
                self.step()
        return self

    def end(self, status: Status, reason: str, events: Sequence[DeviceEvent] = ()) -> Outcome:
        """End the episode before the current tick; everything recorded so far is kept.

        Args:
            status, reason: of the outcome.
            events: of input devices since the last tick.

        Returns:
            The outcome; of an episode that has already ended, its earlier one.
        """
        if self.outcome is None:
            snapshot = self._with_events(tuple(events))
            self._close(snapshot, Outcome(status, reason, snapshot.tick, snapshot.time))
        assert self.outcome is not None
        return self.outcome

    def _observe(self, events: tuple[DeviceEvent, ...]) -> Snapshot:
        """`_with_events`; may end the episode, and ignores events after its end."""
        if self.outcome is not None:
            return self._with_events(())
        snapshot = self._with_events(events)
        outcome = outcome_at(snapshot)
        if outcome is not None:
            self._close(snapshot, outcome)
        return snapshot

    def _with_events(self, events: tuple[DeviceEvent, ...]) -> Snapshot:
        """The snapshot of the present tick, with events added to those that it already has."""
        snapshot = self._observed
        if snapshot is None or events:
            for event in events:
                if not isinstance(event, DeviceEvent):
                    raise TypeError(f"events must be a sequence of DeviceEvent, got {event!r} in it")
            snapshot = self._observed = self._world.snapshot(snapshot.events + events if snapshot else events)
        return snapshot

    def _observe_unless_over(self, events: tuple[DeviceEvent, ...]) -> Snapshot | None:
        """`_observe`; None if the episode is over, or ends here."""
        if self.outcome is not None:
            return None
        snapshot = self._observe(events)
        return None if self.is_over else snapshot

    def _decide(self, snapshot: Snapshot) -> TickInput | Outcome:
        """The controller's answer to a snapshot."""
        controller = self.controller
        try:
            if controller.image is not None and self._renderer is not None:
                snapshot = replace(snapshot, image=self._renderer(snapshot, controller.image))
            if self._sensors:
                snapshot = replace(snapshot, sensors=self._sensors.observe(snapshot))
            answer = controller.act(shown_to(controller, snapshot))
            if isinstance(answer, (Stop, Regenerate)):
                status: Status = "stopped" if isinstance(answer, Stop) else "regenerate"
                return Outcome(status, answer.reason, snapshot.tick, snapshot.time)
            command = checked_twist(answer, type(controller))
            label = controller.label(snapshot, command)
            if label is not None:
                label = deepcopy(label)  # the controller may reuse the object
                self._require_declared(label)
            return TickInput(command, label, snapshot.events)
        except BaseException as error:
            interruption.reraise(error)
            self._close_after(error, snapshot)
            raise

    def _record_and_move(self, snapshot: Snapshot, tick_input: TickInput) -> Frame:
        """Send the frame to the observers, then move the world."""
        frame = Frame(snapshot, tick_input.command, tick_input.label)
        try:
            if self._sensors:  # also in ticks in which the controller is not asked: odometry goes on
                self._sensors.observe(snapshot)
            for observer in self.observers:
                observer.on_frame(frame)
            self._world.run_tick(tick_input.command, self._crowd)
        except BaseException as error:
            interruption.reraise(error)
            self._close_after(error, snapshot)
            raise
        self.past.append(tick_input)
        self._observed = None
        return frame

    def _require_declared(self, label: Any) -> None:
        """Require that a label has only the keys that the controller declares: files explain only these.

        Raises:
            ControllerError: it has another key.
        """
        declared = self._controller_info.labels
        if declared and isinstance(label, Mapping):
            for key in label:
                if key not in declared:
                    hint = did_you_mean(str(key), declared) or f"; they explain {', '.join(declared)}"
                    raise ControllerError(
                        f"label() returned the key {shown(key)}, which the controller's `labels` do not explain{hint}"
                    )

    def _close_after(self, error: BaseException, snapshot: Snapshot) -> None:
        """Close the episode because an exception was raised; the exception gets tick, episode and seed as a note."""
        error.add_note(f"at tick {snapshot.tick} of episode {self.scene.episode}, seed {self.scene.seed}")
        reason = text_of(error)
        reason = f"{type(error).__name__}: {reason}" if reason is not None else type(error).__name__
        try:
            self._close(snapshot, Outcome("error", reason, snapshot.tick, snapshot.time))
        except Sonata2dError as failure:  # the first error is the one to raise
            error.add_note(f"the frames recorded so far could not be saved either: {failure}")

    def _close(self, snapshot: Snapshot, outcome: Outcome) -> None:
        self.outcome = outcome
        for observer in self.observers:
            observer.close(snapshot, outcome)


def _takes_many_frames(observer: Observer) -> bool:
    """Whether an observer has a method `on_frames` that belongs to its `on_frame`, and not to a base class only."""
    if "on_frame" in vars(observer):
        return False
    owner = next((kind for kind in type(observer).__mro__ if {"on_frame", "on_frames"} & vars(kind).keys()), None)
    return owner is not None and "on_frames" in vars(owner)


@drawing_of.register
def _(episode: Episode) -> Drawing:
    again = Episode(episode.scene, past=episode.past)  # the snapshots of earlier ticks are not kept
    snapshots = []
    for _ in episode.past:
        snapshots.append(again.snapshot())
        again.step()
    commands = [(tick.command.vx, tick.command.vy, tick.command.omega) for tick in episode.past]
    labels = [
        command if tick.label is None else tick.label for command, tick in zip(commands, episode.past, strict=True)
    ]
    status = None if episode.outcome is None else episode.outcome.status
    return Drawing([*snapshots, again.snapshot()], status, commands or None, labels or None)


def outcome_at(snapshot: Snapshot) -> Outcome | None:
    """The outcome if the episode ends at a snapshot: goal reached, contact if the rules say so, or time limit.

    Returns:
        None if the episode continues.
    """
    scene, row = snapshot.scene, snapshot.state.row
    goal, rules = scene.goal, scene.rules
    # The exact test needs the robot's heading, which takes longer to find than most ticks need for all of this.
    reach = goal.distance + 1e-6
    is_near = abs(goal.x - row.item(X)) <= reach and abs(goal.y - row.item(Y)) <= reach
    if is_near and "goal" in rules.ends_on and goal.is_reached(snapshot.robot.pose):
        return Outcome("goal", f"within {goal.distance} m of the goal", snapshot.tick, snapshot.time)
    if "contact" in rules.ends_on and snapshot.contacts:
        contact = snapshot.contacts[0]
        fault = _FAULTS[contact.robot_at_fault, contact.other_at_fault]
        reason = f"contact with {contact.kind} {contact.id}, at fault: {fault}"
        return Outcome("contact", reason, snapshot.tick, snapshot.time)
    if snapshot.tick >= rules.last_tick:
        return Outcome("timeout", f"{snapshot.time} s are over", snapshot.tick, snapshot.time)
    return None


# By fault of the robot and of the other side. Recorded in files.
_FAULTS = {(True, False): "the robot", (False, True): "the other", (True, True): "both", (False, False): "nobody"}


_USUAL = 1e4  # m/s, rad/s, beyond which the limits of files are looked at


def checked_twist(answer: object, controller_class: type | None = None) -> Twist:
    """A command as a twist that a file can hold.

    Args:
        answer: of a controller, or given to `Episode.apply`.
        controller_class: class of the controller, for the error messages; None: the command was given to `apply`.

    Raises:
        ControllerError: the answer is not a `Twist`, is not finite, or is too large for a file.
    """
    if type(answer) is Twist:  # the usual case in a third of the time
        vx, vy, omega = answer.vx, answer.vy, answer.omega
        is_small = type(vx) is type(vy) is type(omega) is float and -_USUAL < vx < _USUAL and -_USUAL < vy < _USUAL
        if is_small and -_USUAL < omega < _USUAL:
            return Twist(round(vx * 1e4) / 1e4 + 0.0, round(vy * 1e4) / 1e4 + 0.0, round(omega * 1e4) / 1e4 + 0.0)
    name = f"{controller_class.__name__}.act" if controller_class else ""
    must = f"{name} must return" if name else "the command must be"
    if not isinstance(answer, Twist):
        raise ControllerError(f"{must} a Twist, got {answer!r}; return Twist(vx, vy, omega)")
    vx, vy, omega = answer.vx, answer.vy, answer.omega
    if not (_is_finite(vx) and _is_finite(vy) and _is_finite(omega)):
        raise ControllerError(f"{must} finite numbers, got {answer!r}")
    try:
        return Twist(quantised(float(vx)), quantised(float(vy)), quantised(float(omega)))
    except ValueError as error:
        # part of the recorded reason of an episode that ended in an error: do not reword
        raise ControllerError(f"{name} answered {answer!r}: {error}" if name else f"{must} smaller: {error}") from None


def _is_finite(value: Any) -> bool:
    """Whether a value is a finite number of Python or NumPy."""
    if type(value) is not float and hasattr(value, "item"):
        value = value.item()
    return isinstance(value, (int, float)) and math.isfinite(value)


@interruption.surroundings_kept()
def controller_info_of(controller: Controller, path: str | None = None) -> ControllerInfo:
    """The description of a controller that files record.

    Args:
        controller: the controller.
        path: its name, e.g. on the command line; by default its module and class.

    Raises:
        ControllerError: `settings()` raises an exception, or a value is not of the kind that files hold.
    """
    name = path or recorded_path(type(controller))
    try:
        settings = controller.settings()
    except BaseException as error:
        interruption.reraise(error)
        raise ControllerError(f"settings() of {name} raised {described(error)}") from error
    version, labels = controller.version, controller.labels
    if not isinstance(settings, Mapping):
        raise ControllerError(f"settings() of {name} must return a dict, got {shown(settings)}")
    if version is not None and not isinstance(version, str):
        raise ControllerError(
            f"version of {name} must be text, got {shown(version)}; write version = {shown(str(version))}"
        )
    if not isinstance(labels, Mapping) or not all(isinstance(meaning, str) for meaning in labels.values()):
        raise ControllerError(f"labels of {name} must be a dict of names and their meanings, got {shown(labels)}")
    return ControllerInfo(name, version, dict(settings), dict(labels) or None)
