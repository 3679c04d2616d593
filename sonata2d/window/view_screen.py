"""Recorded runs, played one after another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pygame
from pygame_gui.elements import UIButton

from ..core.devices import View
from ..errors import RenderError
from ..view.hud import Hud, draw_hud
from ..view.veil import draw_veil
from .bars import SMALL, TEXT, Entry, Timeline, button_row, plate, text_size, wrapped, write
from .facts import frame_facts, frame_label, run_facts
from .player import Player
from .playlist import Playlist
from .projector import Projector
from .stage import Screen, Stage

_HEIGHT = 138  # pixels of the bar below, at scale 1
_NARROW, _BY_KEY = 760, ("Zones", "Trails", "PNG", "SVG")  # pixels of a window that has no room for all buttons
_REST = 1.5  # s at the end of a run, before the next one begins
_NOTICE = 5.0  # s for which a notice is shown
_FASTER = (pygame.K_PLUS, pygame.K_EQUALS, pygame.K_KP_PLUS, pygame.K_RIGHTBRACKET)
_SLOWER = (pygame.K_MINUS, pygame.K_KP_MINUS, pygame.K_LEFTBRACKET)
_KEYS_PAGE, _ABOUT_PAGE = "Keys", "About this run"
_NAMES = ("file", "outcome", "label", "contributor", "context")
_HELP = (
    "Space   play, pause",
    "Left, Right   one frame back, on (with Shift: one second)",
    "+, -   faster, slower",
    "Home   from the start",
    "N, B   next file, file before (Page Down, Page Up)",
    "V   camera      Z   zones      T   trails      H   display",
    "Mouse wheel   zoom",
    "P, S   save this moment as PNG, as SVG",
    "I   about this run",
    "Esc   close",
)


class ViewScreen:
    """Plays recorded runs, each to its end and then the next; files that cannot be read are passed over.

    Args:
        paths: of the files, in their order.
        view: from which the first one is seen.
        speed: seconds of a run in a second.

    Attributes:
        saved: pictures that the person asked for.

    Raises:
        RecordError: none of the files can be read.
    """

    def __init__(self, paths: Sequence[Path], *, view: View = "top", speed: float = 1.0) -> None:
        self.files = Playlist(paths)
        self.saved: list[Path] = []
        self.player = Player(self.files.record, speed=speed)
        self.projector = Projector(self.player, view=view)
        self._hud, self._page, self._closing = True, "", False
        self._rest: float | None = None  # s until the next file begins
        self._notice, self._left = "", 0.0
        if self.files.passed:
            self._tell(f"passed over: {self.files.passed}")

    @property
    def notice(self) -> str:
        """What the person was told last, while it is shown."""
        return self._notice if self._left > 0.0 else ""

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        (width, height), s = stage.size, stage.scale
        self._bar = pygame.Rect(0, height - round(_HEIGHT * s), width, round(_HEIGHT * s))
        inner = self._bar.inflate(-round(28 * s), 0)
        row = pygame.Rect(inner.left, inner.top + round(40 * s), inner.width, round(36 * s))
        entries = [entry for entry in self._buttons() if width >= _NARROW or entry[0] not in _BY_KEY]
        buttons = button_row(stage.ui, row, entries, gap=round(5 * s))
        self._play_button: UIButton = buttons[2]
        self._lay_line()

    def handle(self, event: pygame.Event) -> None:
        if self._line.handle(event):
            self._rest = None
        elif event.type == pygame.QUIT:
            self._closing = True
        elif event.type == pygame.MOUSEWHEEL:
            self.projector.nearer(1.1**event.y)
        elif event.type == pygame.KEYDOWN:
            self._press(event)

    def advance(self, seconds: float) -> Screen | None:
        was_playing = self.player.playing
        self.player.advance(seconds)
        self._left = max(self._left - seconds, 0.0)
        if was_playing and self.player.at_end and self.files.index + 1 < len(self.files):
            self._rest = _REST
        elif self._rest is not None:
            self._rest -= seconds
            if self._rest <= 0.0:
                self._rest = None
                self._turn(1)
        text = "Pause" if self.player.playing else "Play"
        if self._play_button.text != text:
            self._play_button.set_text(text)
        return None if self._closing else self

    def draw(self, surface: pygame.Surface) -> None:
        picture = surface.subsurface((0, 0, self._bar.width, self._bar.top))
        camera = self.projector.draw(picture)
        if self._hud:
            draw_hud(picture, self._display(), self.projector.moment, camera, scale=self._stage.scale)
        if self._page:
            draw_veil(picture, self._page, self._page_lines(picture.get_width()), scale=self._stage.scale)
        plate(surface, self._bar, edge="top")
        self._line.draw(surface)
        self._words(surface)

    def leave(self) -> None:
        """Nothing is lost: nothing was changed."""

    def _buttons(self) -> list[Entry]:
        return [
            ("Previous", lambda: self._turn(-1), "file before (B)"),
            ("- 1", lambda: self._step(-1), "a frame back (left arrow)"),
            ("Pause", self._toggle, "play or pause (Space)"),
            ("+ 1", lambda: self._step(1), "a frame on (right arrow)"),
            ("Next", lambda: self._turn(1), "next file (N)"),
            ("Slower", lambda: self.player.slower(), "(-)"),
            ("Faster", lambda: self.player.faster(), "(+)"),
            ("Camera", lambda: self.projector.switch(), "whole room, or behind the robot (V)"),
            ("Zones", lambda: self._flip("zones"), "people's intimate and personal space (Z)"),
            ("Trails", lambda: self._flip("trails"), "where all came from (T)"),
            ("PNG", lambda: self._save(".png"), "save this moment as a picture (P)"),
            ("SVG", lambda: self._save(".svg"), "save this moment as a drawing (S)"),
            ("About", lambda: self._show(_ABOUT_PAGE), "what the file tells (I)"),
            ("Help", lambda: self._show(_KEYS_PAGE), "keys (F1)"),
        ]

    def _press(self, event: pygame.Event) -> None:
        """A key."""
        seconds = bool(event.mod & pygame.KMOD_SHIFT)
        doings: dict[int, Callable[[], object]] = {
            pygame.K_SPACE: self._toggle,
            pygame.K_LEFT: lambda: self._step(-1, seconds=seconds),
            pygame.K_RIGHT: lambda: self._step(1, seconds=seconds),
            pygame.K_HOME: self.player.restart,
            pygame.K_v: self.projector.switch,
            pygame.K_z: lambda: self._flip("zones"),
            pygame.K_t: lambda: self._flip("trails"),
            pygame.K_h: self._flip_hud,
            pygame.K_p: lambda: self._save(".png"),
            pygame.K_s: lambda: self._save(".svg"),
            pygame.K_i: lambda: self._show(_ABOUT_PAGE),
            pygame.K_F1: lambda: self._show(_KEYS_PAGE),
            pygame.K_ESCAPE: self._escape,
            **dict.fromkeys((pygame.K_n, pygame.K_PAGEDOWN), lambda: self._turn(1)),
            **dict.fromkeys((pygame.K_b, pygame.K_PAGEUP), lambda: self._turn(-1)),
            **dict.fromkeys(
                (pygame.K_PLUS, pygame.K_EQUALS, pygame.K_KP_PLUS, pygame.K_RIGHTBRACKET), self.player.faster
            ),
            **dict.fromkeys((pygame.K_MINUS, pygame.K_KP_MINUS, pygame.K_LEFTBRACKET), self.player.slower),
        }
        if event.key in doings:
            self._rest = None
            doings[event.key]()

    def _toggle(self) -> None:
        self._rest = None
        self.player.toggle()

    def _step(self, direction: int, *, seconds: bool = False) -> None:
        self._rest = None
        if seconds:
            self.player.step_seconds(direction)
        else:
            self.player.step(direction)

    def _flip(self, layer: str) -> None:
        setattr(self.projector, layer, not getattr(self.projector, layer))

    def _flip_hud(self) -> None:
        self._hud = not self._hud

    def _show(self, veil: str) -> None:
        """Put a page before the picture, or away."""
        self._page = "" if self._page == veil else veil

    def _escape(self) -> None:
        """Away with the page before the picture; without one, close."""
        self._page, self._closing = "", not self._page

    def _turn(self, direction: int) -> None:
        """To the next file that can be read, or the one before."""
        before = self.files.index
        self._rest = None
        self._tell(self.files.turn(direction))
        if self.files.index != before:
            self.player = Player(self.files.record, speed=self.player.speed)
            self.projector = Projector(self.player, like=self.projector)
            self._lay_line()

    def _tell(self, notice: str) -> None:
        self._notice, self._left = notice, _NOTICE

    def _save(self, suffix: str) -> None:
        try:
            self.saved.append(self.projector.save(Path.cwd(), suffix))
            self._tell(f"saved: {self.saved[-1]}")
        except RenderError as error:
            self._tell(str(error))

    def _lay_line(self) -> None:
        s, bar = self._stage.scale, self._bar
        box = pygame.Rect(bar.left + round(26 * s), bar.top + round(10 * s), bar.width - round(196 * s), round(24 * s))
        self._line = Timeline(self.player, box)

    def _display(self) -> Hud:
        record = self.files.record
        label = frame_label(record, self.player.index)
        place, count = self.files.index + 1, len(self.files)
        return Hud(place, count, contributor=record.contributor or "", light="replay", label=label)

    def _page_lines(self, width: int) -> Sequence[str]:
        """The keys, or what the file tells of the whole run, long texts in several lines."""
        if self._page == _KEYS_PAGE:
            return _HELP
        size = text_size(TEXT, self._stage.scale)
        facts = [f"{name}:  {value}" for name, value in run_facts(self.files.record)]
        return [line for fact in facts for line in wrapped(fact, width * 0.6, size, most=5)]

    def _words(self, surface: pygame.Surface) -> None:
        """Time and speed beside the line; below the buttons what happens now, and the run or a notice."""
        player, s, bar = self.player, self._stage.scale, self._bar
        left, right = bar.left + round(16 * s), bar.right - round(16 * s)
        time = f"{player.time:.1f} / {player.length:.1f} s   {player.speed:g}x"
        write(surface, time, (right, self._line.box.centery), size=text_size(TEXT, s), anchor="midright")
        facts = frame_facts(self.files.record, player.look, player.index)
        label = frame_label(self.files.record, player.index)
        facts = [f"tick {player.look.tick}", *([label] if label and not self._hud else []), *facts]
        lines = ("   ·   ".join(facts), self.notice or self._run_line())
        for line, y in zip(lines, (90, 114), strict=True):
            write(surface, line, (left, bar.top + round((y + 4) * s)), size=text_size(SMALL, s), room=right - left)

    def _run_line(self) -> str:
        """The file and how the run ended; more where the display does not show it."""
        told = dict(run_facts(self.files.record))
        names = ("file", "outcome", "label", "context") if self._hud else _NAMES
        return "   ·   ".join(told[name] for name in names if name in told)
