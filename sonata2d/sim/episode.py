"""One episode: a scene, its crowd and a controller, run tick by tick to an outcome."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from copy import deepcopy
from dataclasses import replace
from typing import Any, SupportsIndex

from ..agents.controllers.base import Controller, External, require_controller
from ..agents.controllers.compiled import KernelController
from ..agents.pedestrians.crowd import Crowd
from ..agents.sensors.base import Renderer
from ..core.devices import DeviceEvent
from ..core.drawable import Drawable
from ..core.files import interruption
from ..core.geometry import Twist
from ..core.scene import Scene
from ..core.snapshot import ControllerInfo, Frame, Frames, Observer, Outcome, Snapshot, Status
from ..core.wording import counted, shown, text_of
from ..errors import ControllerError, Sonata2dError
from ..view.drawing import Drawing, drawing_of
from .driver import checked_twist, drivers_of
from .inputs import Inputs, TickInput
from .member import CompiledRun
from .outcomes import arrivals_at, outcome_at, outcome_of_several
from .world import World


class Episode(Drawable):
    """Runs a scene tick by tick: observe, decide, record, move.

    In a scene with several robots, a robot that has reached its goal stands there and is not asked any more; the
    episode has the outcome `goal` when all have reached theirs.

    Args:
        scene: initial layout.
        controller: drives the robot; None: a client gives the commands, see `apply`.
        others: controllers of the other robots, in the order of `scene.robots`; None: those that the scene names. One
            object may drive several robots if it says so, see `Controller.drives_several`.
        observers: receive every frame, e.g. recorders and windows.
        past: inputs of the first ticks, which are replayed before the controller is asked. Controllers of other robots
            are asked in them too, and remember what they saw; their commands are those of the past, if it holds any.
        controller_info: description of the controller in files; by default `controller_info_of(controller)`.
        renderer: draws the images that the controller requests, e.g. `sonata2d.view.image_of`.

    Raises:
        ControllerError: a controller requests an image, and no renderer is given.
        ValueError: the number of other controllers is not that of the other robots.

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
        others: Sequence[Controller] | None = None,
        observers: Iterable[Observer] = (),
        past: Sequence[TickInput] = (),
        controller_info: ControllerInfo | None = None,
        renderer: Renderer | None = None,
    ) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(f"an episode needs a scene, such as generate() returns; got {shown(scene)}")
        controller = require_controller(controller or External())
        if hasattr(observers, "on_frame"):
            raise TypeError(f"observers are several; write observers=[{type(observers).__name__}(...)]")
        self.scene, self.controller, self.observers = scene, controller, tuple(observers)
        self.past = Inputs()
        self.outcome: Outcome | None = None
        self._script, self._renderer = Inputs(past), renderer
        self._crowd, self._world = Crowd(scene), World(scene)
        self._observed: Snapshot | None = None  # of the present tick
        self._has_given_others = bool(others)
        self._drivers = drivers_of(scene, controller, others, controller_info, renderer)
        self._observing = [driver for driver in self._drivers if driver.sensors]
        self._is_sensing = any(sensor.record for driver in self._observing for sensor in driver.controller.sensors)
        self._arrivals: list[int | None] = [None] * len(self._drivers)  # ticks; not of a single robot
        info = self._drivers[0].info
        if scene.robots:
            info = replace(info, others=tuple(driver.info for driver in self._drivers[1:]))
        for observer in self.observers:
            observer.open(scene, info)

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
    def arrivals(self) -> tuple[int | None, ...]:
        """Of several robots, the tick at which each reached its goal so far, in the order of `Scene.robot_ids`."""
        return tuple(self._arrivals)

    @property
    def is_over(self) -> bool:
        """Whether the episode has an outcome."""
        return self.outcome is not None

    @property
    def ends_here(self) -> bool:
        """Whether the episode has an outcome, or gets one at the present tick when it is observed."""
        return self.is_over or self._outcome_at(self.snapshot()) is not None

    def run(self) -> Outcome:
        """Run to the end.

        Raises:
            ControllerError: the controller's answer is not a finite twist. Exceptions of the controller itself pass
                through, with tick, episode and seed added as a note.
        """
        self.replay_past()
        self._run_on(self._compiled_run())
        assert self.outcome is not None
        return self.outcome

    def _run_on(self, run: CompiledRun | None, stop: int | None = None) -> None:
        """Run to a tick, or to the end, without the interpreter where possible."""
        with interruption.held_back() if run else nullcontext() as blocks:
            while self.outcome is None and (stop is None or len(self.past) < stop):
                limit = None if stop is None else stop - len(self.past)
                if run is None or blocks is None or not self._run_frames(run, blocks, limit):
                    self.step()

    def _compiled_run(self) -> CompiledRun | None:
        """The episode under its controller without the interpreter; None if the controller or an observer needs it."""
        controller = self.controller
        is_compiled = isinstance(controller, KernelController) and self._may_skip
        parts = controller.compiled(self.scene) if is_compiled else None  # type: ignore[attr-defined]
        return CompiledRun(self._world, self._crowd, *parts) if parts else None

    @property
    def _may_skip(self) -> bool:
        """Whether people and observers do without the interpreter in some ticks."""
        is_plain = type(self).step is Episode.step and self._crowd.is_compiled and not self._drivers[0].sensors
        is_plain = is_plain and self.scene.goal.is_plain
        return is_plain and not self.scene.robots and all(map(_takes_many_frames, self.observers))

    def _run_frames(self, run: CompiledRun, blocks: interruption.Blocks, limit: int | None) -> bool:
        """Run some ticks at once; False if there were none, and `step` is needed."""
        snapshot = self._observe_unless_over(())
        if snapshot is None:
            return True
        if snapshot.events:
            return False
        with blocks:
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
        answer = self._again(replayed, snapshot) if replayed else self._decide(snapshot)
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

    def apply(
        self,
        command: Twist,
        label: Any = None,
        events: Sequence[DeviceEvent] = (),
        others: Sequence[Twist] | None = None,
    ) -> Frame | None:
        """Execute a command for one tick instead of asking the controller, and record the frame.

        Of a controller, `Controller.command_overridden` is called.

        Args:
            command: of the robot, body frame.
            label: of the frame, any value that JSON can hold; None: the command itself is the label.
            events: of input devices since the last `observe`.
            others: commands of the other robots; None: their controllers are asked.

        Returns:
            The frame of the tick; None if the episode is over, and its `outcome` set.

        Raises:
            ControllerError: a command is not a finite twist, or another robot has neither a command nor a controller;
                the episode has not moved.
            ValueError: there are not as many other commands as other robots.
        """
        twist = checked_twist(command)
        self.replay_past()
        if others is not None and len(others) != len(self.scene.robots):
            raise ValueError(
                f"the scene has {counted(len(self.scene.robots), 'other robot')}, got {len(others)} commands"
            )
        twists = None if others is None else self._checked_twists(others)
        for driver in self._drivers[1:] if others is None else ():
            if isinstance(driver.controller, External):
                raise ControllerError(f"robot {driver.robot_id} has no controller; give its command too: others=[...]")
        snapshot = self._observe_unless_over(tuple(events))
        if snapshot is None:
            return None
        answers = self._answers_of_others(snapshot) if twists is None else [(other, None) for other in twists]
        if isinstance(answers, Outcome):
            self._close(snapshot, answers)
            return None
        self.controller.command_overridden(twist)
        for driver, other in zip(self._drivers[1:], twists or (), strict=False):
            driver.controller.command_overridden(other)
        return self._record_and_move(snapshot, TickInput(twist, deepcopy(label), snapshot.events, tuple(answers)))

    def _checked_twists(self, others: Sequence[Twist]) -> list[Twist]:
        """The commands of the other robots; an error names the robot."""
        twists = []
        for id, other in zip(self.scene.robot_ids[1:], others, strict=True):
            try:
                twists.append(checked_twist(other))
            except ControllerError as error:
                raise ControllerError(f"robot {id}: {error}") from None
        return twists

    def snapshot(self) -> Snapshot:
        """The current state of the world, without device events."""
        return self._world.snapshot()

    def branch(
        self,
        tick: int,
        controller: Controller,
        *,
        others: Sequence[Controller] | None = None,
        observers: Iterable[Observer] = (),
        renderer: Renderer | None = None,
    ) -> Episode:
        """A new episode that equals this one to the bit up to a tick, and is then driven by another controller.

        Args:
            tick: number of ticks to replay, 0 to len(past).
            controller: drives from that tick on.
            others: as for `Episode`.
            observers: of the new episode, from its tick 0 on.
            renderer: as for `Episode`; by default the renderer of this episode.

        Raises:
            ValueError: the episode has not reached the tick, or it was given `others` and the branch is not.
        """
        if not 0 <= tick <= len(self.past):
            raise ValueError(f"tick must be 0..{len(self.past)}, the ticks run so far, got {tick}")
        if others is None and self._has_given_others:
            raise ValueError(
                "this episode was given the controllers of its other robots; give those of the branch too: others=[...]"
            )
        past, renderer = self.past[:tick], renderer or self._renderer
        return Episode(
            self.scene, controller, others=others, observers=observers, past=past, renderer=renderer
        ).replay_past()

    def replay_past(self) -> Episode:
        """Run the ticks whose inputs were given as `past`.

        Returns:
            This episode.
        """
        script, run = self._script, None
        if len(self.past) < len(script) and not script.has_events and self._may_skip:
            run = CompiledRun.of_commands(self._world, self._crowd, script.commands)
        if len(self.past) < len(script):
            self._run_on(run, len(script))
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
        outcome = self._outcome_at(snapshot)
        if outcome is not None:
            self._close(snapshot, outcome)
        return snapshot

    def _outcome_at(self, snapshot: Snapshot) -> Outcome | None:
        """The outcome if the episode ends at the present snapshot."""
        if not self.scene.robots:
            return outcome_at(snapshot)
        for k, is_at_goal in enumerate(arrivals_at(snapshot)):
            if is_at_goal and self._arrivals[k] is None:
                self._arrivals[k] = snapshot.tick
        return outcome_of_several(snapshot, None not in self._arrivals)

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
        """The controllers' answers to a snapshot."""
        answer = self._answer(0, snapshot)
        if isinstance(answer, Outcome):
            return answer
        if len(self._drivers) == 1:
            return TickInput(*answer, snapshot.events)
        others = self._answers_of_others(snapshot)
        return others if isinstance(others, Outcome) else TickInput(*answer, snapshot.events, tuple(others))

    def _again(self, replayed: TickInput, snapshot: Snapshot) -> TickInput | Outcome:
        """An input of the past.

        Controllers of other robots are asked again, so that they know what they knew then; their answers are executed
        only if the past does not hold their commands.
        """
        if not self.scene.robots:
            return replayed
        if not replayed.others:
            answers = self._answers_of_others(snapshot)
            return answers if isinstance(answers, Outcome) else replace(replayed, others=tuple(answers))
        for k in range(1, len(self._drivers)):
            if not isinstance(self._drivers[k].controller, External):
                self._answer(k, snapshot)
        return replayed

    def _answers_of_others(self, snapshot: Snapshot) -> list[tuple[Twist, Any]] | Outcome:
        """Commands and labels of the other robots."""
        answers = []
        for k in range(1, len(self._drivers)):
            answer = self._answer(k, snapshot)
            if isinstance(answer, Outcome):
                return replace(answer, reason=f"robot {self._drivers[k].robot_id}: {answer.reason}")
            answers.append(answer)
        return answers

    def _answer(self, k: int, snapshot: Snapshot) -> tuple[Twist, Any] | Outcome:
        """Command and label of a robot; one of several that has arrived stands."""
        driver = self._drivers[k]
        try:
            if self._arrivals[k] is not None and not driver.controller.answers_after_arrival:
                return Twist(), None
            return driver.answer(snapshot)
        except BaseException as error:
            interruption.reraise(error)
            if k > 0:
                error.add_note(f"by the controller of robot {driver.robot_id}, {driver.info.path}")
            self._close_after(error, snapshot)
            raise

    def _record_and_move(self, snapshot: Snapshot, tick_input: TickInput) -> Frame:
        """Send the frame to the observers, then move the world."""
        if self.scene.robots:
            tick_input = self._standing_after_arrival(tick_input)
        try:
            for driver in self._observing:
                driver.look(snapshot)
            readings = tuple(driver.sensors.arrived for driver in self._drivers) if self._is_sensing else ()
            frame = Frame(snapshot, tick_input.command, tick_input.label, tick_input.others, readings)
            for observer in self.observers:
                observer.on_frame(frame)
            others = [other for other, _ in tick_input.others] if tick_input.others else ()
            self._world.run_tick(tick_input.command, self._crowd, others)
        except BaseException as error:
            interruption.reraise(error)
            self._close_after(error, snapshot)
            raise
        self.past.append(tick_input)
        self._observed = None
        return frame

    def _standing_after_arrival(self, tick_input: TickInput) -> TickInput:
        """The input with the command 0 for robots that have reached their goals."""
        command = Twist() if self._arrivals[0] is not None else tick_input.command
        others = tuple(
            (other if arrival is None else Twist(), label)
            for (other, label), arrival in zip(tick_input.others, self._arrivals[1:], strict=True)
        )
        return replace(tick_input, command=command, others=others)

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
        if self.scene.robots:
            outcome = replace(outcome, arrivals=tuple(self._arrivals))
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
    others = [External()] * len(episode.scene.robots)
    again = Episode(episode.scene, others=others, past=episode.past)  # the snapshots of earlier ticks are not kept
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
