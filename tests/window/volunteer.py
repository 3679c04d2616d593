"""A person at the window, for tests and pictures: posts pygame's events, and lets pictures go by."""

from __future__ import annotations

from collections.abc import Callable

import pygame

from sonata2d.agents.controllers.planner import SocialPlanner
from sonata2d.collect.session import Session
from sonata2d.core.geometry import Twist
from sonata2d.window.stage import Screen, Stage

PICTURE = 1 / 60  # s


class Person:
    """Turns the pages of a stage by hand, at sixty pictures a second of a time of its own.

    Args:
        make: of the first screen, once the window is open.
    """

    def __init__(self, make: Callable[[], Screen], size: tuple[int, int] = (1280, 800)) -> None:
        self.stage = Stage(size=size, clock=lambda fps: round(1000 * PICTURE))
        self.screen: Screen | None = make()
        self._down: set[int] = set()
        self.screen.enter(self.stage)

    def wait(self, seconds: float = PICTURE) -> None:
        """Let pictures go by."""
        for _ in range(max(round(seconds / PICTURE), 1)):
            if self.screen is not None:
                self.screen = self.stage.turn(self.screen)

    def press(self, *keys: int, mod: int = 0) -> None:
        """Press and let go of keys, one after the other."""
        for key in keys:
            self._post(key, True, mod)
            self._post(key, False, mod)
            self.wait()

    def hold(self, *keys: int) -> None:
        """Hold these keys down, and no others."""
        for key in self._down - set(keys):
            self._post(key, False)
        for key in set(keys) - self._down:
            self._post(key, True)
        self._down = set(keys)

    def click(self, x: int, y: int) -> None:
        """Click with the left button."""
        pygame.mouse.set_pos(x, y)
        for kind in (pygame.MOUSEMOTION, pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP):
            more = {"rel": (0, 0), "buttons": (0, 0, 0)} if kind == pygame.MOUSEMOTION else {"button": 1}
            pygame.event.post(pygame.event.Event(kind, pos=(x, y), **more))
            self.wait()

    def drive(self, session: Session, seconds: float = 90.0) -> None:
        """Drive by keys as the planner would, until the run ends or so much time has passed."""
        planner = SocialPlanner()
        planner.reset(session.scene)
        tick, number = -1, session.scene.episode
        for _ in range(round(seconds / PICTURE)):
            if session.state == "ended" or session.scene.episode != number:
                break
            if session.after.tick != tick:
                tick = session.after.tick
                twist = planner.act(session.after)
                assert isinstance(twist, Twist)
                self.hold(*_keys_for(twist))
            self.wait()
        self.hold()

    def _post(self, key: int, down: bool, mod: int = 0) -> None:
        kind = pygame.KEYDOWN if down else pygame.KEYUP
        pygame.event.post(pygame.event.Event(kind, key=key, mod=mod, scancode=0, unicode=""))


def _keys_for(twist: Twist) -> list[int]:
    """The keys that come nearest to a twist."""
    wanted = {
        pygame.K_w: twist.vx > 0.3,
        pygame.K_s: twist.vx < -0.15,
        pygame.K_a: twist.omega > 0.4,
        pygame.K_d: twist.omega < -0.4,
        pygame.K_q: twist.vy > 0.2,
        pygame.K_e: twist.vy < -0.2,
    }
    return [key for key, is_down in wanted.items() if is_down] or [pygame.K_LSHIFT]
