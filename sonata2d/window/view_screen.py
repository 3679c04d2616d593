"""The screen that plays recorded runs one after another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pygame
from pygame_gui.elements import UIButton

from ..collect.texts import text
from ..core.devices import View
from ..errors import RenderError
from ..view.palette import OUTSIDE
from .actions import Action
from .cards import Card
from .hud import Hud, draw_hud, draw_legend, free_area, legend_box
from .playback import Exporter, Player, Playlist, frame_label, frame_summary, playing_time, run_summary
from .stage import Screen, Stage
from .widgets import MINUS, PLUS, SMALL, TEXT, Timeline, button_row, draw_panel, text_size, write

_BAR = 146  # height of the lower bar, px at scale 1
_NARROW, _NOT_IN_NARROW = 900, ("zones", "trails", "png", "svg")  # px; these buttons do not fit (their keys work)
_REST = 1.5  # time at the end of a run before the next one begins, s
_NOTICE = 5.0  # time for which a notice is shown, s
_HELP_PAGE, _ABOUT_PAGE = "help_title", "about_title"
_HELP = (  # a key, or the key of its text; the key of its meaning
    ("player.space_key", "player.help_play"),
    ("player.arrow_keys", "player.help_frame"),
    ("player.shift_arrow_keys", "player.help_second"),
    ("player.home_key", "player.help_home"),
    ("+ -", "player.help_speed"),
    ("N, B", "player.help_files"),
    ("V", "action.view"),
    ("Z", "action.zones"),
    ("T", "player.help_trails"),
    ("H", "action.hud"),
    ("player.wheel", "help.zoom"),
    ("P, S", "player.help_save"),
    ("I", "player.about_title"),
    ("F1", "help.this"),
    ("F12", "help.screenshot"),
    ("Esc", "keys.close"),
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
        saved: paths of the pictures that the user saved.
        card: of the help or about page, while it is open.
        timeline: of the open run; dragging it moves the position.

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
        self.card: Card | None = None
        self._card_end = 0  # lower edge of the space for the card, px
        if self.files.skipped:
            self._notify(text("notice.skipped", problem=self.files.skipped))

    @property
    def notice(self) -> str:
        """The latest notice while it is shown, otherwise an empty text."""
        return self._notice if self._notice_left > 0.0 else ""

    @property
    def picture(self) -> pygame.Rect:
        """The part of the window above the lower bar, px."""
        return pygame.Rect(0, 0, self._bar.width, self._bar.top)

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        (width, height), s = stage.size, stage.scale
        self._bar = pygame.Rect(0, height - round(_BAR * s), width, round(_BAR * s))
        inner = self._bar.inflate(-round(28 * s), 0)
        row = pygame.Rect(inner.left, inner.top + round(40 * s), inner.width, round(36 * s))
        words = {name: text(f"player.{name}") for name, _, _ in self._commands() if name}
        words["pause"] = max(words["pause"], text("player.play"), key=len)  # the button has space for both texts
        specs = [
            (words[name], command, text(f"player.{'play' if name == 'pause' else name}_tip"))
            for name, command, _ in self._commands()
            if name and (width >= _NARROW * s or name not in _NOT_IN_NARROW)
        ]
        self._play_button: UIButton = button_row(stage.ui, row, specs, gap=round(5 * s))[2]
        self._build_timeline()
        self.card = None  # its widgets belonged to the window before
        self._build_card()

    def handle(self, event: pygame.Event) -> None:
        if self.card is not None and self.card.pressed(event):
            self._show_page("")
        elif self.timeline.handle(event):
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
        if self.card is not None and self._card_end != self._end_of_card():  # activities or the run have changed
            self._build_card()
        words = text("player.pause" if self.player.playing else "player.play")
        if self._play_button.text != words:
            self._play_button.set_text(words)
        return None if self._closing else self

    def draw(self, surface: pygame.Surface) -> None:
        whole = surface.subsurface(self.picture)
        hud, scale, area = self._hud(), self._stage.scale, whole.get_rect()
        if self._show_hud:  # the scene is drawn where the readings leave space
            whole.fill(OUTSIDE)
            area = free_area(whole, hud, scale=scale)
        camera = self.exporter.draw(whole.subsurface(area))
        if self._show_hud:
            draw_hud(whole, hud, self.exporter.moment, camera, scale=scale, origin=area.topleft)
        if self.card is not None:
            self.card.draw(surface)
        if self._page == _HELP_PAGE:
            shown = self.exporter
            draw_legend(whole, shown.moment, zones=shown.zones, paths=shown.trails, scale=scale)
        draw_panel(surface, self._bar, edge="top")
        self.timeline.draw(surface)
        self._draw_texts(surface)

    def leave(self) -> None:
        """Nothing needs to be saved."""

    def _commands(self) -> list[tuple[str, Callable[[], object], tuple[int, ...]]]:
        """Name of a button (empty: no button), the command, and its keys."""
        return [
            ("previous", lambda: self._open_file(-1), (pygame.K_b, pygame.K_PAGEUP)),
            ("back", lambda: self._step(-1), (pygame.K_LEFT,)),
            ("pause", self._toggle, (pygame.K_SPACE,)),
            ("forward", lambda: self._step(1), (pygame.K_RIGHT,)),
            ("next", lambda: self._open_file(1), (pygame.K_n, pygame.K_PAGEDOWN)),
            ("slower", lambda: self.player.slower(), (*MINUS, pygame.K_LEFTBRACKET)),
            ("faster", lambda: self.player.faster(), (*PLUS, pygame.K_RIGHTBRACKET)),
            ("camera", lambda: self.exporter.switch_view(), (pygame.K_v,)),
            ("zones", lambda: self._toggle_layer("zones"), (pygame.K_z,)),
            ("trails", lambda: self._toggle_layer("trails"), (pygame.K_t,)),
            ("png", lambda: self._save(".png"), (pygame.K_p,)),
            ("svg", lambda: self._save(".svg"), (pygame.K_s,)),
            ("about", lambda: self._show_page(_ABOUT_PAGE), (pygame.K_i,)),
            ("help", lambda: self._show_page(_HELP_PAGE), (pygame.K_F1,)),
            ("", self.player.restart, (pygame.K_HOME,)),
            ("", self._toggle_hud, (pygame.K_h,)),
            ("", self._escape, (pygame.K_ESCAPE,)),
        ]

    def _press(self, event: pygame.Event) -> None:
        """Process a key."""
        if event.key in (pygame.K_LEFT, pygame.K_RIGHT) and event.mod & pygame.KMOD_SHIFT:
            self._rest = None
            self.player.step_seconds(1 if event.key == pygame.K_RIGHT else -1)
            return
        for _, command, keys in self._commands():
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

    def _show_page(self, page: str) -> None:
        """Open a page, or close it if it is open already."""
        self._page = "" if self._page == page else page
        self._build_card()

    def _escape(self) -> None:
        """Close the page, or the window if no page is open."""
        self._closing = not self._page
        self._show_page("")

    def _build_card(self) -> None:
        """Replace the card by that of the open page."""
        if self.card is not None:
            self.card.kill()
        self.card, self._card_end = None, self._end_of_card()
        if self._page:
            buttons = [(text("help.close"), Action.HELP)]
            title, stage = text(f"player.{self._page}"), self._stage
            # The page about the run leaves the lower part free, in which the robot is in the view from behind it.
            top = None if self._page == _HELP_PAGE else free_area(stage.surface, self._hud(), scale=stage.scale).top
            lines, end = self._page_lines(), self._card_end
            self.card = Card(stage.ui, stage.scale, title, lines, buttons, top=top, bottom=end)

    def _end_of_card(self) -> int:
        """Upper edge of what is below the card: of the legend with all layers, or of the lower bar, px."""
        if self._page != _HELP_PAGE:
            return self._bar.top
        shown, scale = self.exporter.moment, self._stage.scale
        return legend_box(self.picture.size, shown, zones=True, paths=True, scale=scale).top

    def _open_file(self, direction: int) -> None:
        """Open the next or previous file that can be read."""
        before = self.files.index
        self._rest = None
        self._notify(self.files.move(direction))
        if self.files.index != before:
            self.player = Player(self.files.record, speed=self.player.speed)
            self.exporter = Exporter(self.player, like=self.exporter)
            self._build_timeline()
            self._build_card()

    def _notify(self, notice: str) -> None:
        self._notice, self._notice_left = notice, _NOTICE

    def _save(self, suffix: str) -> None:
        try:
            self.saved.append(self.exporter.save(Path.cwd(), suffix))
            self._notify(text("notice.saved", path=self.saved[-1]))
        except RenderError as error:
            self._notify(str(error))

    def _build_timeline(self) -> None:
        s, bar = self._stage.scale, self._bar
        box = pygame.Rect(bar.left + round(26 * s), bar.top + round(10 * s), bar.width - round(230 * s), round(24 * s))
        self.timeline = Timeline(self.player, box, scale=s)

    def _hud(self) -> Hud:
        record = self.files.record
        label = frame_label(record, self.player.index)
        number, count = self.files.index + 1, len(self.files)
        return Hud(number, count, contributor=record.contributor or "", light="replay", label=label)

    def _page_lines(self) -> Sequence[str | tuple[str, str]]:
        """Lines of the open page: keys and their meanings, or a summary of the run."""
        if self._page == _HELP_PAGE:
            return [(text(key) if key.startswith("player.") else key, text(meaning)) for key, meaning in _HELP]
        summary = run_summary(self.files.record)
        return [text("player.entry", name=text(f"player.{name}"), value=value) for name, value in summary]

    def _draw_texts(self, surface: pygame.Surface) -> None:
        """Draw time and speed beside the timeline, and below the buttons the tick and the run (or a notice)."""
        player, s, bar, record = self.player, self._stage.scale, self._bar, self.files.record
        left, right = bar.left + round(16 * s), bar.right - round(16 * s)
        time = playing_time(player)
        write(surface, time, (right, self.timeline.box.centery), size=text_size(TEXT, s), anchor="midright")
        label = frame_label(record, player.index)
        texts = [text("player.tick", number=player.snapshot.tick), *([label] if label and not self._show_hud else [])]
        texts += frame_summary(record, player.snapshot, player.index)
        run = dict(run_summary(record))
        # The readings show the contributor already.
        names = ("file", "outcome", "label", *(() if self._show_hud else ("contributor",)), "context")
        run_texts = [run[name] for name in names if name in run]
        lines = ("   ·   ".join(texts), self.notice or "   ·   ".join(run_texts))
        for line, y in zip(lines, (98, 124), strict=True):
            write(surface, line, (left, bar.top + round(y * s)), size=text_size(SMALL, s), max_width=right - left)
