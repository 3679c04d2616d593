"""The screen for driving: run after run, kept or discarded."""

from __future__ import annotations

from collections.abc import Iterable

import pygame

from ..collect.session import Session
from ..core.devices import DeviceEvent, View
from ..errors import Sonata2dError
from ..scenegen.scenario.config import ScenarioConfig
from ..view.interpolation import between
from ..view.palette import GREEN, VERMILLION
from .actions import Action
from .answer import LabelSlider
from .camera import SceneCamera, draw_mouse_joystick
from .cards import KEYS, LIGHTS, TYPING_KEYS, recovered_notice, state_notice
from .controls_screen import ControlsScreen
from .hud import Hud, draw_tint
from .input import HOTPLUG_EVENTS, InputDevices
from .overlay import Overlay, Page
from .stage import Screen, Stage

_NOTICE_SECONDS = 5.0
_MAX_TICKS = 3  # per frame of the window, to catch up; a longer delay is dropped and counted
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
        """Poll the devices while nothing moves; returns whether the person drives. The next tick gets the events."""
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


class CollectScreen:
    """Lets a person drive the runs of a session.

    Args:
        session: the runs.
        devices: keyboard, mouse and pads.
        runs: number of runs requested; None for no limit.
        view: initial view.
    """

    def __init__(
        self, session: Session, devices: InputDevices, *, runs: int | None = None, view: View = "follow"
    ) -> None:
        self.session, self.devices, self._runs = session, devices, runs
        self._camera = SceneCamera(view)
        self._notice, self._notice_left = "", 0.0
        self._overlay = Overlay(session, runs)
        self._following: Screen | None = self
        self._stage: Stage
        self._begin_scene()
        if session.recovered is not None or session.notice:
            self._notice, self._notice_left = session.notice or recovered_notice(session), 3 * _NOTICE_SECONDS

    def enter(self, stage: Stage) -> None:
        self._stage, self._following = stage, self
        self.session.set_mappings(self.devices.mappings)  # the controls page may have changed them
        self._rebuild()

    def handle(self, event: pygame.Event) -> None:
        if event.type == pygame.QUIT:
            self._following = None
            return
        try:
            request = self._overlay.handle(event)
            if not request or event.type in _RELEASES:
                request = self.devices.handle(event, self._stage.size) or request
            if event.type == pygame.WINDOWFOCUSLOST and self.session.state == "driving":
                self._pause("Paused: the window is not in front.")
            if isinstance(request, ScenarioConfig):
                self._next(config=request)
            elif isinstance(request, Action):
                self._perform(request)
        except (Sonata2dError, ValueError, pygame.error) as error:  # shown to the person; nothing is lost
            self._notify(str(error))

    def advance(self, seconds: float) -> Screen | None:
        self._notice_left -= seconds
        self._check_pads()
        session = self.session
        if session.state == "driving":
            self._clock.advance(seconds)
            if session.outcome is not None:
                self._end()
        elif self._clock.poll() and session.state in ("waiting", "paused") and self._overlay.page is None:
            self._start()
        return self._following

    def draw(self, surface: pygame.Surface) -> None:
        session = self.session
        snapshot = between(session.before, session.after, self._clock.fraction)
        question = session.label_spec.meaning if session.label_spec.per_frame else ""
        self._camera.draw(surface, snapshot, self._hud(), scale=self._stage.scale, question=question)
        if session.state in ("waiting", "ended"):
            draw_tint(surface, GREEN if session.state == "waiting" else VERMILLION, 24)
        if self.devices.joystick is not None:
            draw_mouse_joystick(surface, self.devices.joystick)
        self._overlay.draw(surface)

    def leave(self) -> None:
        self.devices.release()
        self.session.pause()
        if self._following is None:
            self.session.close()

    # Actions

    def _perform(self, action: Action) -> None:
        session = self.session
        simple = {
            Action.REDO: self._redo,
            Action.NEXT: self._next,
            Action.UNDO: self._undo,
            Action.REMAP: self._set_up_controls,
            Action.FULLSCREEN: pygame.display.toggle_fullscreen,
        }
        if action in simple:
            self._overlay.page = None
            try:
                simple[action]()
            finally:
                self._rebuild()
        elif action is Action.CONFIRM:
            self._confirm()
        elif action is Action.DISCARD:
            self._discard()
        elif action is Action.PAUSE:
            if session.state == "driving":
                self._pause()
            elif session.state == "paused":
                self._start()
        elif action is Action.QUIT:
            self._following = None
        elif action in _PAGES:
            self._toggle_page(_PAGES[action])
        elif self._camera.apply(action):
            pass
        elif self._overlay.answer is not None:
            self._overlay.apply(self._stage, action)
        elif session.label_spec.per_frame and self._slider.apply(action) and self._slider.event:
            self._clock.queue([self._slider.event])

    def _confirm(self) -> None:
        """Enter closes a page, ends the run, keeps an ended run, or starts the next one, by the state."""
        session = self.session
        if self._overlay.page is not None:
            self._close_page()
        elif session.state == "driving":
            session.stop()
            self._end()
        elif session.state == "ended":
            label = self._overlay.label
            if self._overlay.answer is not None and label is None:
                self._notify("Answer the question first, or discard the run.")
                return
            path = session.keep(label)
            self._begin_scene()
            self._notify(f"Kept {path.name}" + (f". {session.notice}" if session.notice else ""))
        elif self._overlay.is_done:
            self._overlay.drive_on()
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

    def _redo(self) -> None:
        path = self.session.redo()
        self._begin_scene()
        self._notify("The same scene again." + (f" The run is in {path.parent.name}/." if path else ""))

    def _next(self, reason: str = "another scene", config: ScenarioConfig | None = None) -> None:
        path = self.session.next(config, reason)
        self._begin_scene()
        self._close_page()
        self._notify("Another scene." + (f" The run is in {path.parent.name}/." if path else ""))

    def _undo(self) -> None:
        self.devices.release()
        path = self.session.undo()
        self._begin_scene()
        self._overlay.label = self.session.undone_label
        self._notify(f"The last run is open again; its file is in {path.parent.name}/. Keep, discard or redo it.")

    def _set_up_controls(self) -> None:
        if self.session.ticks and self.session.state != "ended":
            self._pause()
            self._notify("Controls can be changed between runs. First end this run (Enter) or redo it (R).")
            return
        self._following = ControlsScreen(self.devices, self)

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
        """Reset what belongs to one scene."""
        self._clock = Clock(self.session, self.devices)
        self._overlay.label = None
        self._slider = LabelSlider(self.session.label_spec)
        self._slider.set(self.session.label)

    # Display

    def _toggle_page(self, page: Page) -> None:
        """Open help, menu or scene panel, or close it; the menu key closes any page."""
        self._pause()
        self.devices.release()
        shown = self._overlay.page
        self._overlay.page = None if shown == page or (shown and page == "menu") else page
        self._rebuild()

    def _close_page(self) -> None:
        self._overlay.page = None
        self._rebuild()

    def _rebuild(self) -> None:
        self._overlay.rebuild(self._stage)

    def _check_pads(self) -> None:
        """Report connected and disconnected pads; a disconnection pauses the run."""
        lost, found = self.devices.pop_disconnected(), self.devices.pop_connected()
        if lost:
            self._pause()
            self._notify(f"{lost} was disconnected and the robot stands still. Reconnect it, or use another device.")
        elif found:
            later = self.session.ticks and not self.devices.pads_match(self.session.mappings)
            self.session.set_mappings(self.devices.mappings)
            self._notify(f"{found} is ready." + (" Its own controls apply from the next run." if later else ""))

    def _notify(self, notice: str) -> None:
        self._notice, self._notice_left = notice, _NOTICE_SECONDS
        self._overlay.notice = notice

    def _hud(self) -> Hud:
        session = self.session
        notice = self._notice if self._notice_left > 0.0 else session.journal_error or state_notice(session)
        label = self._slider.label if self._slider.position is not None else session.label
        is_typing = session.state == "ended" and session.label_spec.kind == "text"
        return Hud(
            run=min(session.kept + 1, self._runs or session.kept + 1),
            runs=self._runs,
            kept=session.kept,
            contributor=session.contributor,
            light=LIGHTS[session.state],
            label=session.label_spec.in_words(label) if session.label_spec.per_frame else "",
            keys=TYPING_KEYS if is_typing else KEYS[session.state],
            notice=notice,
        )
