"""The screen for driving: run after run, kept or discarded."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import pygame

from ..collect.session import Session
from ..collect.texts import text
from ..core.devices import DeviceEvent, View
from ..errors import Sonata2dError
from ..scenegen.scenario.config import ScenarioConfig
from ..view.interpolation import between
from ..view.palette import GREEN, INK, PAPER, VERMILLION, Colour
from .actions import Action
from .answer import LabelSlider
from .hud import Hud, Light, draw_legend
from .input import HOTPLUG_EVENTS, InputDevices, MouseJoystick
from .key_texts import keys_of
from .overlay import Overlay, Page
from .scene_camera import SceneCamera
from .stage import Screen, Stage

_NOTICE_SECONDS = 5.0
_MAX_TICKS = 3  # per frame of the window, to catch up; a longer delay is dropped and counted
_LIGHTS: dict[str, Light] = {"waiting": "waiting", "driving": "recording", "paused": "paused", "ended": "frozen"}
_PAGES: dict[Action, Page] = {Action.HELP: "help", Action.MENU: "menu", Action.SCENE: "scene"}
# The input devices must see releases even if a widget has used the event; otherwise a control would stay pressed.
_RELEASES = (pygame.KEYUP, pygame.MOUSEBUTTONUP, pygame.WINDOWFOCUSLOST, *HOTPLUG_EVENTS)


class Clock:
    """Advances a session in real time. It polls the devices once per tick, so that no tap is lost.

    Args:
        session: advanced by ticks.
        devices: source of the events.

    Attributes:
        lag: real time that the session has not simulated yet, s.
    """

    def __init__(self, session: Session, devices: InputDevices) -> None:
        self._session, self._devices = session, devices
        self._queue = list(devices.active())  # events for the next tick, in addition to those polled by then
        self.lag = 0.0

    @property
    def fraction(self) -> float:
        """Position of the displayed moment between the session's last two snapshots, 0 to 1."""
        return min(self.lag / self._session.after.dt, 1.0) if self._session.state == "driving" else 1.0

    def queue(self, events: Iterable[DeviceEvent]) -> None:
        """Add events to the next tick."""
        self._queue += events

    def poll(self) -> bool:
        """Poll the devices while nothing moves; returns whether the driver drives. The next tick gets the events."""
        events = self._devices.poll()
        self.queue(events)
        return self._devices.is_driving(events)

    def start(self) -> None:
        """Start or continue at once."""
        self.lag = 0.0
        self._tick()

    def advance(self, seconds: float) -> None:
        """Simulate the ticks of the real time that has passed while driving."""
        session, dt = self._session, self._session.after.dt
        self.lag += seconds
        for _ in range(_MAX_TICKS):
            if self.lag < dt or session.state != "driving":
                return
            self.lag -= dt
            self.queue(self._devices.poll())
            self._tick()
        dropped = int(self.lag / dt)
        self.lag -= dropped * dt
        session.dropped_ticks += dropped

    def _tick(self) -> None:
        last = {(event.device, event.control): event for event in self._queue}  # one event per control and tick
        self._queue = []
        self._session.tick(tuple(last.values()))


class CollectScreen(Screen):
    """The screen for driving the runs of a session.

    Args:
        session: the runs.
        devices: keyboard, mouse and pads.
        runs: number of runs requested; None for no limit.
        view: initial view.
        scene_changes: whether the driver may change the counts of pedestrians and objects, which a study usually fixes.
        new_person: makes the screen for another driver; None if the session is for one driver.

    Attributes:
        overlay: the card, the question and the panel over the scene.
    """

    def __init__(
        self,
        session: Session,
        devices: InputDevices,
        *,
        runs: int | None = None,
        view: View = "follow",
        scene_changes: bool = False,
        new_person: Callable[[], Screen] | None = None,
    ) -> None:
        self.session, self.devices, self._runs = session, devices, runs
        allowed = {Action.SCENE: scene_changes, Action.NEW_PERSON: new_person is not None}
        self._hidden = frozenset(action for action, is_allowed in allowed.items() if not is_allowed)
        self._camera = SceneCamera(view)
        self._commands: dict[Action, Callable[[], object]] = {
            Action.CONFIRM: self._confirm,
            Action.DISCARD: self._discard,
            Action.PAUSE: self._toggle_pause,
            Action.REDO: lambda: self._without_page(self._redo),
            Action.NEXT: lambda: self._without_page(self._next),
            Action.UNDO: lambda: self._without_page(self._undo),
            Action.FULLSCREEN: lambda: self._without_page(pygame.display.toggle_fullscreen),
            Action.NEW_PERSON: lambda: self._follow(new_person() if new_person else self),
            Action.QUIT: lambda: self._follow(None),
        }
        self._notice, self._notice_left, self._has_answer = "", 0.0, False
        self.overlay = Overlay(session, runs, devices.profiles, self._hidden)
        self._following: Screen | None = self
        self._begin_scene()
        if session.recovered is not None or session.notice:
            self._notice, self._notice_left = session.notice or _recovered_notice(session), 3 * _NOTICE_SECONDS

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        self._rebuild()

    def handle(self, event: pygame.Event) -> None:
        if event.type == pygame.QUIT:
            self._follow(None)
            return
        try:
            request = self.overlay.handle(event)
            if not request or event.type in _RELEASES:
                request = self.devices.handle(event, self._stage.size) or request
            if event.type == pygame.WINDOWFOCUSLOST and self.session.state == "driving":
                self._pause(text("notice.out_of_focus"))
            if isinstance(request, ScenarioConfig):
                self._next(config=request)
            elif isinstance(request, Action):
                self._perform(request)
        except (Sonata2dError, ValueError, pygame.error) as error:  # shown to the driver; nothing is lost
            if not self.overlay.show_problem(str(error)):
                self._notify(str(error))

    def advance(self, seconds: float) -> Screen | None:
        if self._following is not self:  # nothing may start in the next run before its screen is on show
            return self._following
        has_answer = self.overlay.label is not None
        if has_answer and not self._has_answer:
            self._notice_left = 0.0  # the notice may have asked for the answer
        self._has_answer = has_answer
        self._notice_left -= seconds
        self._check_pads()
        session = self.session
        if session.state == "driving":
            self._clock.advance(seconds)
            if session.outcome is not None:
                self._end()
        elif self._clock.poll() and session.state in ("waiting", "paused") and self.overlay.page is None:
            self._start()
        return self._following

    def draw(self, surface: pygame.Surface) -> None:
        session = self.session
        snapshot = between(session.before, session.after, self._clock.fraction)
        notice = self.notice
        hud = self._hud("" if self.overlay.covers else notice)
        self._camera.draw(surface, snapshot, hud, scale=self._stage.scale, top=self.overlay.end_of_ended_card)
        if session.state in ("waiting", "ended"):
            _draw_tint(surface, GREEN if session.state == "waiting" else VERMILLION, 24)
        if self.devices.joystick is not None:
            _draw_mouse_joystick(surface, self.devices.joystick)
        self.overlay.draw(surface, notice)
        if self.overlay.page == "help":
            draw_legend(surface, snapshot, zones=self._camera.zones, scale=self._stage.scale)

    def leave(self) -> None:
        self.devices.release()
        self.session.pause()
        self.session.close()

    @property
    def notice(self) -> str:
        """The latest notice while it is shown, a problem of the journal, or a hint for the present state."""
        if self._notice_left > 0.0:
            return self._notice
        has_hint = self.session.state in ("paused", "waiting") and not self.overlay.covers
        return self.session.journal_error or (text(f"notice.{self.session.state}") if has_hint else "")

    # Actions

    def _perform(self, action: Action) -> None:
        """Carry out an action."""
        if action is Action.SCENE and action in self._hidden:
            self._notify(text("notice.fixed_scenes"))  # the driver may wonder why nothing happens
        elif action in self._hidden or self._camera.apply(action):
            pass  # the camera has changed the display, which needs nothing else
        elif action in self._commands:
            self._commands[action]()
        elif action in _PAGES:
            self._toggle_page(_PAGES[action])
        # What is left is about labels: the wheel and the triggers answer the question on show.
        elif self.overlay.answer is not None:
            self.overlay.apply(self._stage, action)
        elif self.session.label_spec.per_frame and self._slider.apply(action) and self._slider.event:
            self._clock.queue([self._slider.event])

    def _without_page(self, command: Callable[[], object]) -> None:
        """Close the open page and carry out a command; the widgets are replaced even if it fails."""
        self.overlay.page = None
        try:
            command()
        finally:
            self._rebuild()

    def _toggle_pause(self) -> None:
        if self.session.state == "paused":
            self._start()
        else:
            self._pause()

    def _follow(self, screen: Screen | None) -> None:
        """Show another screen next; None closes the window."""
        self._following = screen

    def _confirm(self) -> None:
        """Enter closes a page, ends the run, keeps an ended run, or starts the next one, by the state."""
        session = self.session
        if self.overlay.page is not None:
            self._close_page()
        elif session.state == "driving":
            session.stop()
            self._end()
        elif session.state == "ended":
            label = self.overlay.label
            if self.overlay.answer is not None and label is None:  # a run without its label would be of no use
                self._notify(text("notice.answer_first"))
                return
            self._keep(label)
        elif self.overlay.is_done:  # the card offers more runs than were asked for
            self.overlay.drives_on = True
        else:
            self._start()
        self._rebuild()

    def _discard(self) -> None:
        """End the run; an ended run is discarded, and the next scene begins."""
        if self.session.state in ("driving", "paused"):
            self.session.stop()
            self._end()
        elif self.session.state == "ended":
            self._next("discarded")

    def _keep(self, label: Any) -> None:
        self.session.keep(label)
        self._begin_scene()
        self._notify(" ".join(part for part in (text("notice.kept"), self.session.notice) if part))

    def _redo(self) -> None:
        path = self.session.redo()
        self._begin_scene()
        self._notify(text("notice.redo" if path else "notice.redo_fresh"))

    def _next(self, reason: str = "another scene", config: ScenarioConfig | None = None) -> None:
        path = self.session.next(config, reason)
        self._begin_scene()
        self._close_page()
        discarded = "notice.discarded" if reason == "discarded" else "notice.next"
        self._notify(text(discarded if path else "notice.next_fresh"))

    def _undo(self) -> None:
        self.devices.release()
        self.session.undo()
        self._begin_scene()
        self.overlay.label = self.session.undone_label
        self._notify(text("notice.undone"))

    def _start(self) -> None:
        """Start or continue the run."""
        self._notice_left = 0.0
        self._clock.start()
        self._close_page()
        if self.session.state == "ended":
            self._end()

    def _pause(self, notice: str = "") -> None:
        if self.session.state == "driving":
            self.devices.release()
            self.session.pause()
            self._rebuild()
        if notice:
            self._notify(notice)

    def _end(self) -> None:
        """Show the card of an ended run."""
        self.devices.release()
        self._close_page()

    def _begin_scene(self) -> None:
        """Reset clock, label and answer for a new scene."""
        self._clock = Clock(self.session, self.devices)
        self.overlay.label = None
        self._slider = LabelSlider(self.session.label_spec)
        self._slider.set(self.session.label)

    # Display

    def _toggle_page(self, page: Page) -> None:
        """Open help, menu or scene panel, or close it; the menu key closes any page."""
        self._pause()
        self.devices.release()
        shown = self.overlay.page
        self.overlay.page = None if shown == page or (shown and page == "menu") else page
        self._rebuild()

    def _close_page(self) -> None:
        self.overlay.page = None
        self._rebuild()

    def _rebuild(self) -> None:
        self.overlay.rebuild(self._stage)

    def _check_pads(self) -> None:
        """Report connected and disconnected pads; a disconnection pauses the run."""
        lost, new = self.devices.pop_disconnected(), self.devices.pop_connected()
        if lost:
            self._pause()
            self._notify(text("notice.pad_lost", device=lost))
        elif new:
            later = self.session.ticks and not self.devices.pads_match(self.session.mappings)
            self.session.set_mappings(self.devices.mappings)
            self._notify(text("notice.pad_later" if later else "notice.pad_found", device=new))

    def _notify(self, notice: str) -> None:
        self._notice, self._notice_left = notice, _NOTICE_SECONDS

    def _hud(self, notice: str) -> Hud:
        session = self.session
        is_typing = session.state == "ended" and session.label_spec.kind == "text"
        return Hud(
            run=min(session.kept + 1, self._runs or session.kept + 1),
            runs=self._runs,
            kept=session.kept,
            contributor=session.contributor,
            light=_LIGHTS[session.state],
            question=self._slider.shown(session.label),
            keys=keys_of("typing" if is_typing else session.state, self.devices.profiles, self._hidden),
            notice=notice,
            has_arrived=session.has_arrived,
        )


def _recovered_notice(session: Session) -> str:
    """Notice about a run that continues from an earlier session."""
    assert session.recovered is not None
    notice = text("notice.recovered", time=f"{session.recovered:.1f}")
    if session.scene.name == session.config.name:
        return notice
    return f"{notice} {text('notice.recovered_scenario', old=session.scene.name, new=session.config.name)}"


def _draw_mouse_joystick(surface: pygame.Surface, joystick: MouseJoystick) -> None:
    """Draw a ring where the mouse was pressed, and a knob at the mouse, at most on the ring."""
    (x, y), (to_x, to_y), radius = joystick
    dx, dy = to_x - x, to_y - y
    distance = math.hypot(dx, dy)
    fraction = min(radius / distance, 1.0) if distance > 0.0 else 1.0
    knob = (round(x + dx * fraction), round(y + dy * fraction))
    side = round(2 * radius) + 4
    disc = pygame.Surface((side, side), pygame.SRCALPHA, 32)
    pygame.draw.aacircle(disc, (*PAPER, 70), (side // 2, side // 2), radius)
    surface.blit(disc, (x - side // 2, y - side // 2))
    pygame.draw.aacircle(surface, INK, (x, y), radius, 2)
    pygame.draw.aacircle(surface, INK, knob, radius * 0.22)


def _draw_tint(surface: pygame.Surface, colour: Colour, alpha: int) -> None:
    """Blend a colour over the whole picture; alpha is 0 (no effect) to 255 (only the colour)."""
    kept = 255 - alpha
    surface.fill((kept, kept, kept), special_flags=pygame.BLEND_RGB_MULT)
    r, g, b = (value * alpha // 255 for value in colour)
    surface.fill((r, g, b), special_flags=pygame.BLEND_RGB_ADD)
