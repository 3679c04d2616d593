"""Any controller at work in the window, scene after scene; nothing is recorded."""

from __future__ import annotations

from collections.abc import Callable

import pygame

from ..agents import Controller
from ..episode import Episode
from ..errors import Sonata2dError
from ..frame import Snapshot
from ..plugins import load_controller
from ..scenegen import ScenarioConfig, generate
from ..topics import View
from ..view import Hud, Layers, Painter, between, draw_hud, image_of
from .actions import Action
from .collect_screen import MARGIN
from .hands import Hands
from .stage import Screen, Stage

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
        self.view: View = view
        self._zones, self._hud, self._notice = False, True, ""
        self._hands: Hands | None = None
        self.outcomes: list[str] = []
        self._open, self._lag, self._rest = True, 0.0, REST
        self._begin()

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        self._hands = self._hands or Hands()

    def handle(self, event: pygame.Event) -> None:
        assert self._hands is not None
        action = self._hands.handle(event, self._stage.size)
        if event.type == pygame.QUIT or action in (Action.MENU, Action.QUIT):
            self._open = False
        elif action is not None and action in self._doings:
            self._doings[action]()

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
        zoom, layers = MARGIN if self.view == "top" else 1.0, Layers(caption=False, zones=self._zones)
        camera = self._painter.draw(surface, snapshot, view=self.view, layers=layers, zoom=zoom)
        if self._hud:
            outcome = self._run.outcome
            said = f"{outcome.status}: {outcome.reason}" if outcome else ""
            hud = Hud(
                run=self._number + 1,
                contributor=self._name,
                light="paused" if self._paused else "watching",
                keys=_KEYS,
                notice=self._notice or said,
            )
            draw_hud(surface, hud, snapshot, camera, scale=self._stage.scale)

    def leave(self) -> None:
        """Nothing is to be kept."""

    @property
    def _doings(self) -> dict[Action, Callable[[], None]]:
        return {
            Action.PAUSE: lambda: self._set("_paused", not self._paused),
            Action.CONFIRM: lambda: self._set("_paused", not self._paused),
            Action.NEXT: lambda: self._go(1),
            Action.REDO: lambda: self._go(0),
            Action.VIEW: lambda: self._set("view", "top" if self.view == "follow" else "follow"),
            Action.ZONES: lambda: self._set("_zones", not self._zones),
            Action.HUD: lambda: self._set("_hud", not self._hud),
            Action.ZOOM_IN: lambda: self._set("_speed", min(self._speed * 2.0, 16.0)),
            Action.ZOOM_OUT: lambda: self._set("_speed", max(self._speed / 2.0, 0.125)),
        }

    def _set(self, name: str, value: object) -> None:
        setattr(self, name, value)

    def _go(self, by: int) -> None:
        self._number += by
        self._begin()

    def _begin(self) -> None:
        """The scene of this number, from its start."""
        scene = generate(self._config, self._seed, self._number)
        self._run = Episode(scene, self._controller, renderer=image_of)
        self._painter, self._lag, self._rest, self._notice = Painter(scene), 0.0, REST, ""
        self.before: Snapshot = self._run.look()
        self.after: Snapshot = self.before

    def _tick(self) -> None:
        """One tick; what a controller does wrong is told, and ends the run."""
        assert self._hands is not None
        try:
            frame = self._run.step(self._hands.look())
        except Exception as error:  # the controller is somebody else's, and the window shall stay
            self._notice = f"{type(error).__name__}: {error}"
            if isinstance(error, Sonata2dError):
                self._notice = str(error)
            self._rest = 1e9
            return
        if self._run.outcome is not None:
            self.outcomes.append(self._run.outcome.status)
        self.before = frame.snapshot if frame else self.after
        self.after = self._run.look()
