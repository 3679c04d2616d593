"""The screen in which a person drives: run after run."""

from __future__ import annotations

import pygame

from ..errors import Sonata2dError
from ..scenegen import ScenarioConfig
from ..session import Session
from ..topics import View
from ..view import Hud, Layers, Painter, between, draw_hud, draw_tint
from ..view.palette import GREEN, VERMILLION
from .actions import Action
from .collect_texts import KEYS, LIGHTS, standing_notice
from .desk import Desk, Overlay
from .dial import Dial, in_words
from .hands import Hands
from .pace import Pace
from .remap import RemapScreen
from .stage import Screen, Stage
from .stick import draw_stick

NOTICE_SECONDS = 5.0
OVERLAYS: dict[Action, Overlay] = {Action.HELP: "help", Action.MENU: "menu", Action.SCENE: "scene"}
_ZOOM, MARGIN = 1.25, 0.92  # a step; the whole room, free of the readings in the corners


class CollectScreen:
    """Drives a session by a person's hands.

    Args:
        session: what is driven and kept.
        hands: what drives.
        runs: how many are asked for; None: as many as they like.
        view: from which the first scene is seen.
    """

    def __init__(self, session: Session, hands: Hands, *, runs: int | None = None, view: View = "follow") -> None:
        self.session, self.hands, self._runs = session, hands, runs
        self.view: View = view
        self._zoom, self._zones, self._hud = 1.0, False, True
        self._notice, self._notice_left = "", 0.0
        self._desk = Desk(session)
        self._following: Screen | None = self
        self._stage: Stage
        self._take_scene()
        if session.recovered is not None:
            self._notice = f"Your last run was left open after {session.recovered:.1f} s; it goes on from there."
            self._notice_left = 3 * NOTICE_SECONDS

    def enter(self, stage: Stage) -> None:
        self._stage, self._following = stage, self
        self.session.read_by(self.hands.hands)  # they may have been set up anew meanwhile
        self._lay()

    def handle(self, event: pygame.Event) -> None:
        if event.type == pygame.QUIT:
            self._following = None
            return
        try:
            asked = self._desk.handle(event) or self.hands.handle(event, self._stage.size)
            if event.type == pygame.WINDOWFOCUSLOST:
                self._pause("Paused: the window is not in front.")
            if isinstance(asked, ScenarioConfig):
                self._next(config=asked)
            elif isinstance(asked, Action):
                self._do(asked)
        except (Sonata2dError, ValueError) as error:  # told, and nothing is lost
            self._tell(str(error))

    def advance(self, seconds: float) -> Screen | None:
        self._notice_left -= seconds
        self._watch_pads()
        events = self.hands.look()
        self._pace.tell(events)
        session = self.session
        if session.state == "driving":
            self._pace.live(seconds)
            if session.outcome is not None:
                self._end()
        elif session.state in ("waiting", "paused") and self._desk.overlay is None and self.hands.is_input(events):
            self._start()
        return self._following

    def draw(self, surface: pygame.Surface) -> None:
        session = self.session
        snapshot = between(session.before, session.after, self._pace.share)
        layers = Layers(caption=False, zones=self._zones)
        zoom = self._zoom * (MARGIN if self.view == "top" else 1.0)
        camera = self._painter.draw(surface, snapshot, view=self.view, layers=layers, zoom=zoom)
        if session.state in ("waiting", "ended"):
            draw_tint(surface, GREEN if session.state == "waiting" else VERMILLION, 24)
        if self.hands.drag is not None:
            draw_stick(surface, self.hands.drag)
        if self._hud:
            spec = session.label_spec
            question = (spec.question or spec.name) if spec.per_frame else ""
            draw_hud(surface, self._hud_now(), snapshot, camera, scale=self._stage.scale, question=question)
        self._desk.draw(surface)

    def leave(self) -> None:
        self.hands.release()
        self.session.pause()
        if self._following is None:
            self.session.close()

    def _do(self, action: Action) -> None:
        """What an action asks for."""
        session = self.session
        simple = {
            Action.REDO: self._redo,
            Action.NEXT: self._next,
            Action.UNDO: self._undo,
            Action.REMAP: self._remap,
            Action.FULLSCREEN: pygame.display.toggle_fullscreen,
        }
        if action in simple:
            self._desk.overlay = None
            simple[action]()
            self._lay()
        elif action is Action.CONFIRM:
            self._confirm()
        elif action is Action.DISCARD:
            self._discard()
        elif action is Action.PAUSE:
            self._pause() if session.state == "driving" else self._go_on()
        elif action is Action.QUIT:
            self._following = None
        elif action in OVERLAYS:
            self._cover(OVERLAYS[action])
        elif action in (Action.HUD, Action.ZONES, Action.VIEW, Action.ZOOM_IN, Action.ZOOM_OUT):
            self._look_otherwise(action)
        elif self._desk.answer is not None:
            self._desk.turn(self._stage, action)
        elif session.label_spec.per_frame and self._dial.turn(action) and self._dial.event:
            self._pace.tell([self._dial.event])

    def _look_otherwise(self, action: Action) -> None:
        if action is Action.HUD:
            self._hud = not self._hud
        elif action is Action.ZONES:
            self._zones = not self._zones
        elif action is Action.VIEW:
            self.view = "top" if self.view == "follow" else "follow"
        else:
            zoom = self._zoom * (_ZOOM if action is Action.ZOOM_IN else 1 / _ZOOM)
            self._zoom = min(max(zoom, 0.4), 3.0)

    def _confirm(self) -> None:
        """Enter: start, go on, end the run, or keep it."""
        session = self.session
        if self._desk.overlay is not None:
            self._uncover()
        elif session.state == "driving":
            session.stop()
            self._end()
        elif session.state == "ended":
            answer = self._desk.answer.label if self._desk.answer else None
            if self._desk.answer is not None and answer is None:
                self._tell("Answer the question first, or discard the run.")
                return
            path = session.keep(answer)
            self._take_scene()
            self._tell(f"Kept {path.name}")
        else:
            self._start()
        self._lay()

    def _discard(self) -> None:
        """End the run, or put an ended one into the bin and open the next scene."""
        if self.session.state in ("driving", "paused"):
            self.session.stop()
            self._end()
        elif self.session.state == "ended":
            self._next("discarded")

    def _redo(self) -> None:
        path = self.session.redo()
        self._take_scene()
        self._tell("The same scene again." + (f" The run is in {path.parent.name}/." if path else ""))

    def _next(self, reason: str = "another scene", config: ScenarioConfig | None = None) -> None:
        path = self.session.next(config, reason)
        self._take_scene()
        self._uncover()
        self._tell("Another scene." + (f" The run is in {path.parent.name}/." if path else ""))

    def _undo(self) -> None:
        place = self.session.undo()
        self._tell(f"{place.name} is taken back; it is in {place.parent.name}/.")

    def _remap(self) -> None:
        self._pause()
        self._following = RemapScreen(self.hands, self.hands.profiles, self)

    def _start(self) -> None:
        """Begin the run, or go on with it."""
        self._notice_left = 0.0
        self._pace.start()
        self._uncover()
        if self.session.state == "ended":
            self._end()

    def _go_on(self) -> None:
        if self.session.state == "paused":
            self._start()

    def _pause(self, notice: str = "") -> None:
        if self.session.state == "driving":
            self.hands.release()
            self.session.pause()
            self._lay()
        if notice:
            self._tell(notice)

    def _end(self) -> None:
        """The run is over: ask what shall become of it."""
        self.hands.release()
        self._uncover()

    def _take_scene(self) -> None:
        """Everything that goes with one scene."""
        self._painter = Painter(self.session.scene)
        self._pace = Pace(self.session, self.hands.held())
        self._dial = Dial(self.session.label_spec)
        self._dial.set(self.session.label)

    def _cover(self, overlay: Overlay) -> None:
        """Show help, menu or scene panel, or take it away."""
        self._pause()
        self._desk.overlay = None if self._desk.overlay == overlay else overlay
        self._lay()

    def _uncover(self) -> None:
        self._desk.overlay = None
        self._lay()

    def _lay(self) -> None:
        label = self._desk.answer.label if self._desk.answer else None
        self._desk.lay(self._stage, label, self._notice if self._notice_left > 0.0 else "")

    def _watch_pads(self) -> None:
        """Stand still when a pad is unplugged."""
        lost, found = self.hands.take_lost(), self.hands.take_found()
        if lost:
            self._pause()
            self._tell(f"{lost} was unplugged; the robot stands still. Plug it in again, or take another device.")
        elif found:
            self.session.read_by(self.hands.hands)
            self._tell(f"{found} is ready.")

    def _tell(self, notice: str) -> None:
        self._notice, self._notice_left = notice, NOTICE_SECONDS
        if self.session.state == "ended":
            self._lay()

    def _hud_now(self) -> Hud:
        session = self.session
        notice = self._notice if self._notice_left > 0.0 else session.trouble or standing_notice(session, self._runs)
        label = in_words(session.label_spec, session.label) if session.label_spec.per_frame else ""
        return Hud(
            run=session.kept + 1,
            runs=self._runs,
            kept=session.kept,
            contributor=session.contributor,
            light=LIGHTS[session.state],
            label=label,
            keys=KEYS[session.state],
            notice=notice,
        )
