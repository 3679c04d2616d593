"""The screen that plays recorded runs one after another."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import pygame
from pygame_gui.elements import UIButton

from ..collect.texts import text
from ..core.devices import View
from ..errors import RecordError, RenderError
from ..record.reader import read_episode
from ..view.layers import Layers
from ..view.stills import save_moment
from ..view.trails import Trails
from .actions import Action
from .cards import Card
from .hud import Hud, draw_legend, free_area, legend_box
from .playback import Player, Timeline
from .run_texts import frame_label, frame_summary, run_summary
from .scene_camera import SceneCamera
from .stage import Screen, Stage
from .widgets import MINUS, PLUS, SMALL, TEXT, button_row, draw_panel, text_size, write

logger = logging.getLogger(__name__)

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


class ViewScreen(Screen):
    """Plays recorded runs, each to its end and then the next; files that cannot be read are skipped.

    Args:
        paths: of the files, in order.
        view: initial view.
        speed: seconds of a run per second of real time.

    Attributes:
        files: the playlist.
        player: of the open run.
        camera: view, zoom and layers on show.
        shows_trails: whether the paths of the last seconds are drawn.
        saved: paths of the pictures that the user saved.
        card: of the help or about page, while it is open.
        timeline: of the open run; dragging it moves the position.

    Raises:
        RecordError: none of the files can be read.
    """

    def __init__(self, paths: Sequence[Path], *, view: View = "top", speed: float = 1.0) -> None:
        self.files = _Playlist(paths)
        self.saved: list[Path] = []
        self.player = Player(self.files.record, speed=speed)
        self.camera, self.shows_trails = SceneCamera(view), False
        self._page, self._closing = "", False
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
            (words[name], partial(self._do, command), text(f"player.{'play' if name == 'pause' else name}_tip"))
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
            self.camera.zoom_by(1.1**event.y)
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
        picture, moment, scale = surface.subsurface(self.picture), self.player.moment, self._stage.scale
        self.camera.draw(picture, moment, self._hud(), scale=scale, trails=self._trails)
        if self.card is not None:
            self.card.draw(surface)
        if self._page == _HELP_PAGE:
            draw_legend(picture, moment, zones=self.camera.zones, paths=self.shows_trails, scale=scale)
        draw_panel(surface, self._bar, edge="top")
        self.timeline.draw(surface)
        self._draw_texts(surface)

    def _commands(self) -> list[tuple[str, Callable[[], object], tuple[int, ...]]]:
        """Name of a button (empty: no button), the command, and its keys."""
        return [
            ("previous", lambda: self._open_file(-1), (pygame.K_b, pygame.K_PAGEUP)),
            ("back", lambda: self.player.step(-1), (pygame.K_LEFT,)),
            ("pause", lambda: self.player.toggle(), (pygame.K_SPACE,)),
            ("forward", lambda: self.player.step(1), (pygame.K_RIGHT,)),
            ("next", lambda: self._open_file(1), (pygame.K_n, pygame.K_PAGEDOWN)),
            ("slower", lambda: self.player.slower(), (*MINUS, pygame.K_LEFTBRACKET)),
            ("faster", lambda: self.player.faster(), (*PLUS, pygame.K_RIGHTBRACKET)),
            ("camera", lambda: self.camera.apply(Action.VIEW), (pygame.K_v,)),
            ("zones", lambda: self.camera.apply(Action.ZONES), (pygame.K_z,)),
            ("trails", self._toggle_trails, (pygame.K_t,)),
            ("png", lambda: self._save(".png"), (pygame.K_p,)),
            ("svg", lambda: self._save(".svg"), (pygame.K_s,)),
            ("about", lambda: self._show_page(_ABOUT_PAGE), (pygame.K_i,)),
            ("help", lambda: self._show_page(_HELP_PAGE), (pygame.K_F1,)),
            ("", lambda: self.player.restart(), (pygame.K_HOME,)),
            ("", lambda: self.camera.apply(Action.HUD), (pygame.K_h,)),
            ("", self._escape, (pygame.K_ESCAPE,)),
        ]

    def _press(self, event: pygame.Event) -> None:
        """Process a key."""
        if event.key in (pygame.K_LEFT, pygame.K_RIGHT) and event.mod & pygame.KMOD_SHIFT:
            self._do(lambda: self.player.step_seconds(1 if event.key == pygame.K_RIGHT else -1))
            return
        for _, command, keys in self._commands():
            if event.key in keys:
                self._do(command)
                return

    def _do(self, command: Callable[[], object]) -> None:
        """Carry out a command; the next file does not begin by itself then."""
        self._rest = None
        command()

    def _toggle_trails(self) -> None:
        self.shows_trails = not self.shows_trails

    @property
    def _trails(self) -> Trails | None:
        return self.player.trails if self.shows_trails else None

    def _show_page(self, page: str) -> None:
        """Open a page, or close it if it is open already."""
        self._page = "" if self._page == page else page
        self._build_card()

    def _escape(self) -> None:
        """Close the page, or the window if no page is open."""
        self._closing = not self._page
        self._show_page("")

    def _build_card(self) -> None:
        """Replace the card by the card of the open page."""
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
        """Upper edge of the legend with all layers, or of the lower bar, px: the card ends above it."""
        if self._page != _HELP_PAGE:
            return self._bar.top
        return legend_box(self.picture.size, self.player.moment, zones=True, paths=True, scale=self._stage.scale).top

    def _open_file(self, direction: int) -> None:
        """Open the next or previous file that can be read."""
        notices = []
        if self.files.move(direction):
            self.player = Player(self.files.record, speed=self.player.speed)
            self._build_timeline()
            self._build_card()
        else:
            notices.append(text("notice.last_file" if direction > 0 else "notice.first_file"))
        if self.files.skipped:
            notices.append(text("notice.skipped", problem=self.files.skipped))
        self._notify("; ".join(notices))

    def _notify(self, notice: str) -> None:
        self._notice, self._notice_left = notice, _NOTICE

    def _save(self, suffix: str) -> None:
        """Save the moment into the working directory as `.png` or `.svg`."""
        name = self.files.record.path.name.split(".")[0]
        path = Path.cwd() / f"{name}_t{self.player.snapshot.tick:04d}{suffix}"
        layers = Layers(zones=self.camera.zones, legend=True)
        try:
            save_moment(path, self.player.moment, view=self.camera.view, layers=layers, trails=self._trails)
        except RenderError as error:
            self._notify(str(error))
        else:
            self.saved.append(path)
            self._notify(text("notice.saved", path=path))

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
        write(surface, player.time_text, (right, self.timeline.box.centery), size=text_size(TEXT, s), anchor="midright")
        label = frame_label(record, player.index)
        texts = [
            text("player.tick", number=player.snapshot.tick),
            *([label] if label and not self.camera.shows_hud else []),
        ]
        texts += frame_summary(record, player.snapshot, player.index)
        run = dict(run_summary(record))
        # The readings show the contributor already.
        names = ("file", "outcome", "label", *(() if self.camera.shows_hud else ("contributor",)), "context")
        run_texts = [run[name] for name in names if name in run]
        lines = ("   ·   ".join(texts), self.notice or "   ·   ".join(run_texts))
        for line, y in zip(lines, (98, 124), strict=True):
            write(surface, line, (left, bar.top + round(y * s)), size=text_size(SMALL, s), max_width=right - left)


class _Playlist:
    """Files in order, one of which is open; files that cannot be read are skipped.

    Args:
        paths: of the files.

    Attributes:
        record: the open run.
        index: of the open file, from 0.
        skipped: error of the file that the latest move has skipped last; None if it has skipped no file.

    Raises:
        RecordError: none of the files can be read; the error of the last one.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths, self.index = list(paths), -1
        self.skipped: RecordError | None = None
        if not self.move(1):
            raise self.skipped or RecordError("there is no file to view; give a folder that has episodes")

    def __len__(self) -> int:
        return len(self._paths)

    def move(self, direction: int) -> bool:
        """Open the next (1) or previous (-1) readable file; returns False, and keeps the open one, at the end."""
        self.skipped, index = None, self.index + direction
        while 0 <= index < len(self._paths):
            try:
                self.record = read_episode(self._paths[index])
            except RecordError as error:
                logger.warning("skipped: %s", error)
                self.skipped, index = error, index + direction
            else:
                self.index = index
                return True
        return False
