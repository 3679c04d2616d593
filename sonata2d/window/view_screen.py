"""The screen that plays recorded runs one after another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pygame
from pygame_gui.elements import UIButton

from ..core.devices import View
from ..errors import RenderError
from .hud import Hud, draw_hud, draw_veil
from .playback import Exporter, Player, Playlist, frame_label, frame_summary, run_summary
from .stage import Screen, Stage
from .widgets import MINUS, PLUS, SMALL, TEXT, Timeline, button_row, draw_panel, text_size, wrapped, write

_BAR = 138  # height of the lower bar, px at scale 1
_NARROW, _NOT_IN_NARROW = 760, ("Zones", "Trails", "PNG", "SVG")  # px; these buttons do not fit (their keys work)
_REST = 1.5  # time at the end of a run before the next one begins, s
_NOTICE = 5.0  # time for which a notice is shown, s
_HELP_PAGE, _ABOUT_PAGE = "Keys", "About this run"
_HELP = (
    "Space   play, pause",
    "Left, Right   one frame back, forward (with Shift: one second)",
    "+, -   faster, slower",
    "Home   from the start",
    "N, B   next file, previous file (Page Down, Page Up)",
    "V   camera      Z   zones      T   trails      H   readings",
    "Mouse wheel   zoom",
    "P, S   save this moment as PNG, as SVG",
    "I   about this run",
    "Esc   close",
)


class ViewScreen:
    """Plays recorded runs, each to its end and then the next; files that cannot be read are skipped.

    Args:
        paths: of the files, in order.
        view: initial view.
        speed: seconds of a run per second of real time.

    Attributes:
        files: the playlist.
        player: of the open run.
        exporter: draws and saves the moment on show.
        saved: paths of the pictures that the person saved.

    Raises:
        RecordError: none of the files can be read.
    """

    def __init__(self, paths: Sequence[Path], *, view: View = "top", speed: float = 1.0) -> None:
        self.files = Playlist(paths)
        self.saved: list[Path] = []
        self.player = Player(self.files.record, speed=speed)
        self.exporter = Exporter(self.player, view=view)
        self._show_hud, self._page, self._closing = True, "", False
        self._rest: float | None = None  # time until the next file begins, s
        self._notice, self._notice_left = "", 0.0
        if self.files.skipped:
            self._notify(f"skipped: {self.files.skipped}")

    @property
    def notice(self) -> str:
        """The latest notice while it is shown, otherwise an empty text."""
        return self._notice if self._notice_left > 0.0 else ""

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        (width, height), s = stage.size, stage.scale
        self._bar = pygame.Rect(0, height - round(_BAR * s), width, round(_BAR * s))
        inner = self._bar.inflate(-round(28 * s), 0)
        row = pygame.Rect(inner.left, inner.top + round(40 * s), inner.width, round(36 * s))
        specs = [
            (text, command, tip)
            for text, tip, command, _ in self._commands()
            if text and (width >= _NARROW or text not in _NOT_IN_NARROW)
        ]
        self._play_button: UIButton = button_row(stage.ui, row, specs, gap=round(5 * s))[2]
        self._build_timeline()

    def handle(self, event: pygame.Event) -> None:
        if self._timeline.handle(event):
            self._rest = None
        elif event.type == pygame.QUIT:
            self._closing = True
        elif event.type == pygame.MOUSEWHEEL:
            self.exporter.zoom_by(1.1**event.y)
        elif event.type == pygame.KEYDOWN:
            self._press(event)

    def advance(self, seconds: float) -> Screen | None:
        was_playing = self.player.playing
        self.player.advance(seconds)
        self._notice_left = max(self._notice_left - seconds, 0.0)
        if was_playing and self.player.at_end and self.files.index + 1 < len(self.files):
            self._rest = _REST
        elif self._rest is not None:
            self._rest -= seconds
            if self._rest <= 0.0:
                self._rest = None
                self._open_file(1)
        text = "Pause" if self.player.playing else "Play"
        if self._play_button.text != text:
            self._play_button.set_text(text)
        return None if self._closing else self

    def draw(self, surface: pygame.Surface) -> None:
        picture = surface.subsurface((0, 0, self._bar.width, self._bar.top))
        camera = self.exporter.draw(picture)
        if self._show_hud:
            draw_hud(picture, self._hud(), self.exporter.moment, camera, scale=self._stage.scale)
        if self._page:
            draw_veil(picture, self._page, self._page_lines(picture.get_width()), scale=self._stage.scale)
        draw_panel(surface, self._bar, edge="top")
        self._timeline.draw(surface)
        self._draw_texts(surface)

    def leave(self) -> None:
        """Nothing needs to be saved."""

    def _commands(self) -> list[tuple[str, str, Callable[[], object], tuple[int, ...]]]:
        """Text and tool tip of a button (without text: no button), the command, and its keys."""
        return [
            ("Previous", "previous file (B)", lambda: self._open_file(-1), (pygame.K_b, pygame.K_PAGEUP)),
            ("- 1", "one frame back (left arrow)", lambda: self._step(-1), (pygame.K_LEFT,)),
            ("Pause", "play or pause (Space)", self._toggle, (pygame.K_SPACE,)),
            ("+ 1", "one frame forward (right arrow)", lambda: self._step(1), (pygame.K_RIGHT,)),
            ("Next", "next file (N)", lambda: self._open_file(1), (pygame.K_n, pygame.K_PAGEDOWN)),
            ("Slower", "(-)", lambda: self.player.slower(), (*MINUS, pygame.K_LEFTBRACKET)),
            ("Faster", "(+)", lambda: self.player.faster(), (*PLUS, pygame.K_RIGHTBRACKET)),
            ("Camera", "whole room, or behind the robot (V)", lambda: self.exporter.switch_view(), (pygame.K_v,)),
            ("Zones", "people's intimate and personal space (Z)", lambda: self._toggle_layer("zones"), (pygame.K_z,)),
            ("Trails", "paths of the last seconds (T)", lambda: self._toggle_layer("trails"), (pygame.K_t,)),
            ("PNG", "save this moment as a picture (P)", lambda: self._save(".png"), (pygame.K_p,)),
            ("SVG", "save this moment as a drawing (S)", lambda: self._save(".svg"), (pygame.K_s,)),
            ("About", "about this run (I)", lambda: self._toggle_page(_ABOUT_PAGE), (pygame.K_i,)),
            ("Help", "keys (F1)", lambda: self._toggle_page(_HELP_PAGE), (pygame.K_F1,)),
            ("", "", self.player.restart, (pygame.K_HOME,)),
            ("", "", self._toggle_hud, (pygame.K_h,)),
            ("", "", self._escape, (pygame.K_ESCAPE,)),
        ]

    def _press(self, event: pygame.Event) -> None:
        """Process a key."""
        if event.key in (pygame.K_LEFT, pygame.K_RIGHT) and event.mod & pygame.KMOD_SHIFT:
            self._rest = None
            self.player.step_seconds(1 if event.key == pygame.K_RIGHT else -1)
            return
        for _, _, command, keys in self._commands():
            if event.key in keys:
                self._rest = None
                command()
                return

    def _toggle(self) -> None:
        self._rest = None
        self.player.toggle()

    def _step(self, direction: int) -> None:
        self._rest = None
        self.player.step(direction)

    def _toggle_layer(self, layer: str) -> None:
        setattr(self.exporter, layer, not getattr(self.exporter, layer))

    def _toggle_hud(self) -> None:
        self._show_hud = not self._show_hud

    def _toggle_page(self, page: str) -> None:
        self._page = "" if self._page == page else page

    def _escape(self) -> None:
        """Close the page, or the window if no page is open."""
        self._page, self._closing = "", not self._page

    def _open_file(self, direction: int) -> None:
        """Open the next or previous file that can be read."""
        before = self.files.index
        self._rest = None
        self._notify(self.files.move(direction))
        if self.files.index != before:
            self.player = Player(self.files.record, speed=self.player.speed)
            self.exporter = Exporter(self.player, like=self.exporter)
            self._build_timeline()

    def _notify(self, notice: str) -> None:
        self._notice, self._notice_left = notice, _NOTICE

    def _save(self, suffix: str) -> None:
        try:
            self.saved.append(self.exporter.save(Path.cwd(), suffix))
            self._notify(f"saved: {self.saved[-1]}")
        except RenderError as error:
            self._notify(str(error))

    def _build_timeline(self) -> None:
        s, bar = self._stage.scale, self._bar
        box = pygame.Rect(bar.left + round(26 * s), bar.top + round(10 * s), bar.width - round(196 * s), round(24 * s))
        self._timeline = Timeline(self.player, box)

    def _hud(self) -> Hud:
        record = self.files.record
        label = frame_label(record, self.player.index)
        number, count = self.files.index + 1, len(self.files)
        return Hud(number, count, contributor=record.contributor or "", light="replay", label=label)

    def _page_lines(self, width: int) -> Sequence[str]:
        """Lines of the open page: the keys, or a summary of the run with long texts wrapped."""
        if self._page == _HELP_PAGE:
            return _HELP
        size = text_size(TEXT, self._stage.scale)
        texts = [f"{name}:  {value}" for name, value in run_summary(self.files.record)]
        return [line for text in texts for line in wrapped(text, width * 0.6, size, max_lines=5)]

    def _draw_texts(self, surface: pygame.Surface) -> None:
        """Draw time and speed beside the timeline, and below the buttons the tick and the run (or a notice)."""
        player, s, bar, record = self.player, self._stage.scale, self._bar, self.files.record
        left, right = bar.left + round(16 * s), bar.right - round(16 * s)
        time = f"{player.time:.1f} / {player.length:.1f} s   {player.speed:g}x"
        write(surface, time, (right, self._timeline.box.centery), size=text_size(TEXT, s), anchor="midright")
        label = frame_label(record, player.index)
        texts = [f"tick {player.snapshot.tick}", *([label] if label and not self._show_hud else [])]
        texts += frame_summary(record, player.snapshot, player.index)
        run = dict(run_summary(record))
        # The readings show the contributor already.
        names = ("file", "outcome", "label", *(() if self._show_hud else ("contributor",)), "context")
        run_texts = [run[name] for name in names if name in run]
        lines = ("   ·   ".join(texts), self.notice or "   ·   ".join(run_texts))
        for line, y in zip(lines, (94, 118), strict=True):
            write(surface, line, (left, bar.top + round(y * s)), size=text_size(SMALL, s), max_width=right - left)
