"""A simulated person at the window, for tests and pictures: posts events and shows frames."""

from __future__ import annotations

from collections.abc import Callable

import pygame
from pygame_gui.elements import UIButton

from sonata2d.agents.controllers.planner import SocialPlanner
from sonata2d.collect.session import Session
from sonata2d.core.geometry import Twist
from sonata2d.window.stage import Screen, Stage

FRAME = 1 / 60  # s


class Person:
    """Operates a stage at sixty frames per second of simulated time.

    Args:
        make: creates the first screen after the window is open.
        size: of the window, px.
    """

    def __init__(self, make: Callable[[], Screen], size: tuple[int, int] = (1280, 800)) -> None:
        self.stage = Stage(size=size, clock=lambda fps: round(1000 * FRAME))
        self.screen: Screen | None = make()
        self._down: set[int] = set()
        self.screen.enter(self.stage)

    @property
    def is_open(self) -> bool:
        """Whether the window is open."""
        return self.screen is not None

    def frames(self, count: int = 1) -> None:
        """Show a number of frames."""
        for _ in range(count):
            if self.screen is not None:
                self.screen = self.stage.show_frame(self.screen)

    def wait(self, seconds: float = FRAME) -> None:
        """Show frames for a time, at least one."""
        self.frames(max(round(seconds / FRAME), 1))

    def press(self, *keys: int, mod: int = 0) -> None:
        """Press and release keys one after another."""
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

    def type(self, text: str) -> None:
        """Type letters."""
        for letter in text:
            pygame.event.post(pygame.event.Event(pygame.TEXTINPUT, text=letter))
            self._post(ord(letter), True, letter=letter)
            self._post(ord(letter), False, letter=letter)
            self.wait()

    def mouse(self, kind: int, position: tuple[int, int], *, held: bool = True) -> None:
        """Post one mouse event of the left button."""
        more = {"rel": (0, 0), "buttons": (int(held), 0, 0)} if kind == pygame.MOUSEMOTION else {"button": 1}
        pygame.event.post(pygame.event.Event(kind, pos=position, **more))
        self.wait()

    def click(self, x: int, y: int) -> None:
        """Click with the left button."""
        pygame.mouse.set_pos(x, y)
        self.mouse(pygame.MOUSEMOTION, (x, y), held=False)
        self.mouse(pygame.MOUSEBUTTONDOWN, (x, y))
        self.mouse(pygame.MOUSEBUTTONUP, (x, y))

    @property
    def buttons(self) -> dict[str, pygame.Rect]:
        """Places of the buttons on show by their texts; the last one of those with the same text."""
        widgets = self.stage.ui.get_sprite_group().sprites()
        return {widget.text: widget.rect for widget in widgets if isinstance(widget, UIButton)}

    def push(self, text: str) -> None:
        """Click a button."""
        self.click(*self.buttons[text].center)
        self.wait()

    def resize(self, size: tuple[int, int]) -> None:
        """Change the size of the window."""
        pygame.display.set_mode(size, pygame.RESIZABLE)
        pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, size=size, w=size[0], h=size[1]))
        self.frames(2)

    def drive(self, session: Session, seconds: float = 90.0) -> None:
        """Drive with keys like the planner, until the run ends or the time has passed."""
        planner = SocialPlanner()
        planner.reset(session.scene)
        tick, number = -1, session.scene.episode
        for _ in range(round(seconds / FRAME)):
            if session.state == "ended" or session.scene.episode != number:
                break
            if session.after.tick != tick:
                tick = session.after.tick
                twist = planner.act(session.after)
                assert isinstance(twist, Twist)
                self.hold(*_keys_for(twist))
            self.wait()
        self.hold()

    def _post(self, key: int, down: bool, mod: int = 0, letter: str = "") -> None:
        kind = pygame.KEYDOWN if down else pygame.KEYUP
        pygame.event.post(pygame.event.Event(kind, key=key, mod=mod, scancode=0, unicode=letter))


def _keys_for(twist: Twist) -> list[int]:
    """The keys closest to a twist."""
    wanted = {
        pygame.K_w: twist.vx > 0.3,
        pygame.K_s: twist.vx < -0.15,
        pygame.K_a: twist.omega > 0.4,
        pygame.K_d: twist.omega < -0.4,
        pygame.K_q: twist.vy > 0.2,
        pygame.K_e: twist.vy < -0.2,
    }
    return [key for key, is_down in wanted.items() if is_down] or [pygame.K_LSHIFT]
