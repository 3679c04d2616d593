"""The screen in which a person drives: run after run."""

from __future__ import annotations

import pygame

from ..collect.session import Session
from ..core.devices import View
from ..errors import Sonata2dError
from ..scenegen.scenario.config import ScenarioConfig
from ..view.hud import Hud
from ..view.interpolation import between
from ..view.palette import GREEN, VERMILLION
from ..view.veil import draw_tint
from .actions import Action
from .collect_texts import KEYS, LIGHTS, WRITING, recovered_notice, standing_notice
from .desk import Desk, Overlay
from .dial import Dial
from .hands import Hands
from .pace import Pace
from .pads import PLUGGING
from .remap import RemapScreen
from .sight import Sight
from .stage import Screen, Stage
from .stick import draw_stick

NOTICE_SECONDS = 5.0
OVERLAYS: dict[Action, Overlay] = {Action.HELP: "help", Action.MENU: "menu", Action.SCENE: "scene"}
LET_GO = (pygame.KEYUP, pygame.MOUSEBUTTONUP, pygame.WINDOWFOCUSLOST, *PLUGGING)  # the hands hear of it in any case


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
        self._sight = Sight(view)
        self._notice, self._notice_left = "", 0.0
        self._desk = Desk(session, runs)
        self._following: Screen | None = self
        self._stage: Stage
        self._take_scene()
        if session.recovered is not None or session.notice:
            self._notice, self._notice_left = session.notice or recovered_notice(session), 3 * NOTICE_SECONDS

    def enter(self, stage: Stage) -> None:
        self._stage, self._following = stage, self
        self.session.read_by(self.hands.hands)  # they may have been set up anew meanwhile
        self._lay()

    def handle(self, event: pygame.Event) -> None:
        if event.type == pygame.QUIT:
            self._following = None
            return
        try:
            asked = self._desk.handle(event)
            if not asked or event.type in LET_GO:
                asked = self.hands.handle(event, self._stage.size) or asked
            if event.type == pygame.WINDOWFOCUSLOST and self.session.state == "driving":
                self._pause("Paused: the window is not in front.")
            if isinstance(asked, ScenarioConfig):
                self._next(config=asked)
            elif isinstance(asked, Action):
                self._do(asked)
        except (Sonata2dError, ValueError, pygame.error) as error:  # told, and nothing is lost
            self._tell(str(error))

    def advance(self, seconds: float) -> Screen | None:
        self._notice_left -= seconds
        self._watch_pads()
        session = self.session
        if session.state == "driving":
            self._pace.live(seconds)
            if session.outcome is not None:
                self._end()
        elif self._pace.stirs() and session.state in ("waiting", "paused") and self._desk.overlay is None:
            self._start()
        return self._following

    def draw(self, surface: pygame.Surface) -> None:
        session = self.session
        snapshot = between(session.before, session.after, self._pace.share)
        question = session.label_spec.meaning if session.label_spec.per_frame else ""
        self._sight.draw(surface, snapshot, self._hud_now(), scale=self._stage.scale, question=question)
        if session.state in ("waiting", "ended"):
            draw_tint(surface, GREEN if session.state == "waiting" else VERMILLION, 24)
        if self.hands.drag is not None:
            draw_stick(surface, self.hands.drag)
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
            try:
                simple[action]()
            finally:
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
        elif self._sight.turn(action):
            pass
        elif self._desk.answer is not None:
            self._desk.turn(self._stage, action)
        elif session.label_spec.per_frame and self._dial.turn(action) and self._dial.event:
            self._pace.tell([self._dial.event])

    def _confirm(self) -> None:
        """Enter: start, go on, end the run, or keep it."""
        session = self.session
        if self._desk.overlay is not None:
            self._uncover()
        elif session.state == "driving":
            session.stop()
            self._end()
        elif session.state == "ended":
            answer = self._desk.label
            if self._desk.answer is not None and answer is None:
                self._tell("Answer the question first, or discard the run.")
                return
            path = session.keep(answer)
            self._take_scene()
            self._tell(f"Kept {path.name}" + (f". {session.notice}" if session.notice else ""))
        elif self._desk.is_done:
            self._desk.drive_on()
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
        self.hands.release()
        place = self.session.undo()
        self._take_scene()
        self._desk.label = self.session.answered
        self._tell(f"Taken back; as it was kept, it is in {place.parent.name}/. Keep it again, discard it or redo it.")

    def _remap(self) -> None:
        if self.session.ticks and self.session.state != "ended":
            self._pause()
            self._tell("The controls are set up between runs: end this one first (Enter), or redo it (R).")
            return
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
        self._pace = Pace(self.session, self.hands)
        self._desk.label = None
        self._dial = Dial(self.session.label_spec)
        self._dial.set(self.session.label)

    def _cover(self, overlay: Overlay) -> None:
        """Show help, menu or scene panel, or take it away."""
        self._pause()
        self.hands.release()
        shown = self._desk.overlay
        self._desk.overlay = None if shown == overlay or (shown and overlay == "menu") else overlay
        self._lay()

    def _uncover(self) -> None:
        self._desk.overlay = None
        self._lay()

    def _lay(self) -> None:
        self._desk.lay(self._stage)

    def _watch_pads(self) -> None:
        """Stand still when a pad is unplugged."""
        lost, found = self.hands.take_lost(), self.hands.take_found()
        if lost:
            self._pause()
            self._tell(f"{lost} was unplugged; the robot stands still. Plug it in again, or take another device.")
        elif found:
            own = self.session.ticks and not self.hands.reads_as(self.session.hands)
            self.session.read_by(self.hands.hands)
            self._tell(f"{found} is ready." + (" Its own set-up counts from the next run on." if own else ""))

    def _tell(self, notice: str) -> None:
        self._notice, self._notice_left = notice, NOTICE_SECONDS
        self._desk.notice = notice

    def _hud_now(self) -> Hud:
        session = self.session
        notice = self._notice if self._notice_left > 0.0 else session.trouble or standing_notice(session)
        label = self._dial.label if self._dial.place is not None else session.label
        writes = session.state == "ended" and session.label_spec.kind == "text"
        return Hud(
            run=min(session.kept + 1, self._runs or session.kept + 1),
            runs=self._runs,
            kept=session.kept,
            contributor=session.contributor,
            light=LIGHTS[session.state],
            label=session.label_spec.in_words(label) if session.label_spec.per_frame else "",
            keys=WRITING if writes else KEYS[session.state],
            notice=notice,
        )
