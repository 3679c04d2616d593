"""Any controller at work in the window, scene after scene; nothing is recorded."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

import pygame

from ..agents.controllers.base import Controller
from ..agents.controllers.loading import load_controller
from ..core.devices import View
from ..core.snapshot import Snapshot
from ..errors import SceneError, Sonata2dError
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..sim.episode import Episode
from ..view.eye import image_of
from ..view.hud import Hud
from ..view.interpolation import between
from .actions import Action
from .hands import Hands
from .sight import Sight
from .stage import Screen, Stage

logger = logging.getLogger(__name__)

TRIES = 20  # scenes in a row that find no place for all
REST = 2.0  # s that an ended run stays to be seen
MOST = 20  # ticks in one picture, at high speed
_KEYS = (("P", "pause"), ("N", "next scene"), ("R", "again"), ("+ -", "pace"), ("V", "camera"), ("Z", "zones"))


class LiveScreen:
    """Runs a controller and shows it.

    Args:
        config: what scenes may look like.
        controller: its name, as on the command line.
        seed: of the scenes.
        view: from which the first one is seen.
        speed: seconds of the world in a second.

    Attributes:
        outcomes: how the scenes ended that were seen to their end.
        failed: whether the controller raised an error in any of them.

    Raises:
        ControllerError: there is no such controller.
        SceneError: a scene cannot be laid out.
    """

    def __init__(
        self, config: ScenarioConfig, controller: str, seed: int = 0, *, view: View = "top", speed: float = 1.0
    ) -> None:
        self._config, self._name, self._seed = config, controller, seed
        self._controller: Controller = load_controller(controller)
        self._number, self._speed, self._paused = 0, speed, False
        self._sight, self._notice, self.failed = Sight(view), "", False
        self._hands: Hands | None = None
        self.outcomes: list[str] = []
        self._open, self._lag, self._rest = True, 0.0, REST
        self._begin(0)

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        self._hands = self._hands or Hands()

    def handle(self, event: pygame.Event) -> None:
        assert self._hands is not None
        action = self._hands.handle(event, self._stage.size)
        if event.type == pygame.QUIT or action in (Action.MENU, Action.QUIT):
            self._open = False
        elif action in self._doings:
            self._doings[action]()
        elif action is not None and not self._changes_pace(action):
            self._sight.turn(action)

    def advance(self, seconds: float) -> Screen | None:
        assert self._hands is not None
        if not self._open:
            return None
        if self._run.outcome is not None:
            self._rest -= seconds
            if self._rest <= 0.0 and not self._paused:
                self._go(1)
        elif not self._paused:
            self._lag += seconds * self._speed
            for _ in range(MOST):
                if self._lag < self.after.dt or self._run.outcome is not None:
                    break
                self._lag -= self.after.dt
                self._tick()
            self._lag = min(self._lag, self.after.dt)
        return self

    def draw(self, surface: pygame.Surface) -> None:
        share = min(self._lag / self.after.dt, 1.0) if self._run.outcome is None else 1.0
        snapshot = between(self.before, self.after, share)
        outcome = self._run.outcome
        said = f"{outcome.status}: {outcome.reason}" if outcome else ""
        hud = Hud(
            run=self._number + 1,
            contributor=self._name,
            light="frozen" if self._rest == math.inf else "paused" if self._paused else "watching",
            keys=_KEYS,
            notice=self._notice or said,
        )
        self._sight.draw(surface, snapshot, hud, scale=self._stage.scale)

    def leave(self) -> None:
        """Nothing is to be kept."""

    @property
    def _doings(self) -> dict[Action | None, Callable[[], None]]:
        return {
            Action.PAUSE: self._pause,
            Action.CONFIRM: self._pause,
            Action.NEXT: lambda: self._go(1),
            Action.REDO: lambda: self._go(0),
        }

    def _changes_pace(self, action: Action) -> bool:
        """Faster or slower; whether the action asks for that."""
        if action not in (Action.ZOOM_IN, Action.ZOOM_OUT):
            return False
        self._speed = min(max(self._speed * (2.0 if action is Action.ZOOM_IN else 0.5), 0.125), 16.0)
        return True

    def _pause(self) -> None:
        self._paused = not self._paused

    def _go(self, by: int) -> None:
        """Another scene; those in which not all find a place are passed over."""
        for number in range(self._number + by, self._number + by + TRIES):
            try:
                self._begin(number)
                return
            except SceneError as error:
                self._notice = str(error)
            except Exception as error:  # the controller's reset is somebody else's, and the window shall stay
                self._tell(error)
                return

    def _begin(self, number: int) -> None:
        """The scene of this number, from its start."""
        scene = generate(self._config, self._seed, number)
        self._run = Episode(scene, self._controller, renderer=image_of)
        self._number, self._lag, self._rest, self._notice = number, 0.0, REST, ""
        self.before: Snapshot = self._run.look()
        self.after: Snapshot = self.before

    def _tick(self) -> None:
        """One tick; what a controller does wrong is told, and ends the run."""
        assert self._hands is not None
        try:
            frame = self._run.step(self._hands.look())
        except Exception as error:  # as in `_go`
            self._tell(error)
            return
        if self._run.outcome is not None:
            self.outcomes.append(self._run.outcome.status)
        self.before = frame.snapshot if frame else self.after
        self.after = self._run.look()

    def _tell(self, error: Exception) -> None:
        """Say what went wrong, in the window and with its place in the log; the scene stays to be seen."""
        self._notice = str(error) if isinstance(error, Sonata2dError) else f"{type(error).__name__}: {error}"
        self.failed, self._rest = True, math.inf
        logger.exception("the controller raised an error at tick %d of scene %d", self.after.tick, self._number)
