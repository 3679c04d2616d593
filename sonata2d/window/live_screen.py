"""Shows a controller that drives in the window, scene after scene; nothing is recorded."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

import pygame

from ..agents.controllers.base import Controller
from ..agents.controllers.loading import load_controller
from ..collect.texts import text
from ..core.devices import View
from ..core.files import interruption
from ..core.snapshot import Snapshot
from ..errors import SceneError, Sonata2dError
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..sim.episode import Episode
from ..view.interpolation import between
from ..view.painter import image_of
from .actions import Action
from .hud import Hud
from .input import InputDevices
from .key_texts import keys_of
from .profiles import read_profiles
from .scene_camera import SceneCamera
from .stage import Screen, Stage

logger = logging.getLogger(__name__)

_MAX_FAILURES = 20  # scenes in a row that cannot be laid out, before the search ends
_REST = 2.0  # time for which an ended run stays on screen, s
_MAX_TICKS = 20  # per frame of the window, at high speed


class LiveScreen(Screen):
    """Runs a controller in generated scenes and shows it.

    Args:
        config: scenario of the scenes.
        controller: name, as on the command line.
        seed: of the scenes.
        view: initial view.
        speed: simulated seconds per second of real time.

    Attributes:
        outcomes: status of each run that was shown to its end.
        failed: whether the controller raised an error in any run.

    Raises:
        ConfigError: the file of controls is wrong.
        ControllerError: the controller does not exist.
        SceneError: the first scene cannot be laid out.
    """

    def __init__(
        self, config: ScenarioConfig, controller: str, seed: int = 0, *, view: View = "top", speed: float = 1.0
    ) -> None:
        self._config, self._name, self._seed = config, controller, seed
        self._controller: Controller = load_controller(controller)
        self._number, self._speed, self._paused = 0, speed, False
        self._camera, self._notice, self.failed = SceneCamera(view), "", False
        self._profiles = read_profiles()
        self._devices: InputDevices | None = None
        self.outcomes: list[str] = []
        self._open, self._lag, self._rest = True, 0.0, _REST
        self._begin(0)

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        self._devices = self._devices or InputDevices(self._profiles)

    def handle(self, event: pygame.Event) -> None:
        assert self._devices is not None
        action = self._devices.handle(event, self._stage.size)
        if event.type == pygame.QUIT or action in (Action.MENU, Action.QUIT):
            self._open = False
        elif action in self._commands:
            self._commands[action]()
        elif action is not None:
            self._camera.apply(action)

    def advance(self, seconds: float) -> Screen | None:
        if not self._open:
            return None
        if self._episode.outcome is not None:
            self._rest -= seconds
            if self._rest <= 0.0 and not self._paused:
                self._go(1)
        elif not self._paused:
            self._lag += seconds * self._speed
            for _ in range(_MAX_TICKS):
                if self._lag < self.after.dt or self._episode.outcome is not None:
                    break
                self._lag -= self.after.dt
                self._tick()
            self._lag = min(self._lag, self.after.dt)
        return self

    def draw(self, surface: pygame.Surface) -> None:
        outcome = self._episode.outcome
        fraction = min(self._lag / self.after.dt, 1.0) if outcome is None else 1.0
        ended = text("notice.outcome", status=outcome.status, reason=outcome.reason) if outcome else ""
        hud = Hud(
            run=self._number + 1,
            contributor=self._name,
            light="frozen" if self._rest == math.inf else "paused" if self._paused else "watching",
            keys=keys_of("watching", self._profiles, frozenset()),
            notice=self._notice or ended,
            has_arrived=self._episode.arrivals[0] is not None,
        )
        self._camera.draw(surface, between(self.before, self.after, fraction), hud, scale=self._stage.scale)

    @property
    def _commands(self) -> dict[Action | None, Callable[[], None]]:
        return {
            Action.PAUSE: self._pause,
            Action.CONFIRM: self._pause,
            Action.NEXT: lambda: self._go(1),
            Action.REDO: lambda: self._go(0),
            Action.ZOOM_IN: lambda: self._scale_speed(2.0),
            Action.ZOOM_OUT: lambda: self._scale_speed(0.5),
        }

    def _scale_speed(self, factor: float) -> None:
        self._speed = min(max(self._speed * factor, 0.125), 16.0)

    def _pause(self) -> None:
        self._paused = not self._paused

    def _go(self, by: int) -> None:
        """Begin another scene (1) or the same one (0); scenes that cannot be laid out are skipped."""
        for number in range(self._number + by, self._number + by + _MAX_FAILURES):
            try:
                self._begin(number)
                return
            except SceneError as error:
                self._notice = str(error)
            except BaseException as error:  # the controller's `reset` is foreign code, and the window must stay open
                interruption.reraise(error)
                self._report(error)
                return

    def _begin(self, number: int) -> None:
        """Begin a scene by its number."""
        scene = generate(self._config, self._seed, number)
        self._episode = Episode(scene, self._controller, renderer=image_of)
        self._number, self._lag, self._rest, self._notice = number, 0.0, _REST, ""
        self.before: Snapshot = self._episode.snapshot()
        self.after: Snapshot = self.before

    def _tick(self) -> None:
        """Simulate one tick; an error of the controller is shown and ends the run."""
        assert self._devices is not None
        try:
            frame = self._episode.step(self._devices.poll())
        except BaseException as error:  # as in `_go`
            interruption.reraise(error)
            self._report(error)
            return
        if self._episode.outcome is not None:
            self.outcomes.append(self._episode.outcome.status)
        self.before = frame.snapshot if frame else self.after
        self.after = self._episode.snapshot()

    def _report(self, error: BaseException) -> None:
        """Show an error in the window and log its traceback; the scene stays visible."""
        kind = type(error).__name__
        is_ours = isinstance(error, Sonata2dError)
        self._notice = str(error) if is_ours else text("notice.live_error", kind=kind, message=error)
        self.failed, self._rest = True, math.inf
        logger.exception("the controller raised an error at tick %d of scene %d", self.after.tick, self._number)
