"""Cards and panels over the scene: end of the run with its question, menu, help, scene settings."""

from __future__ import annotations

from collections.abc import Mapping, Set
from functools import partial
from typing import Any, Literal

import pygame
import pygame_gui

from ..collect.session import Session
from ..collect.texts import text
from ..scenegen.scenario.config import ScenarioConfig
from .actions import Action
from .answer import Answer, LabelSlider, question_of
from .cards import Card
from .hud import Hud, free_area, legend_box
from .input import HOTPLUG_EVENTS
from .key_texts import help_rows
from .profiles import Profile
from .scene_panel import ScenePanel
from .stage import Stage

Page = Literal["help", "menu", "scene"]
_MENU = {
    "menu.continue": Action.MENU,
    "menu.redo": Action.REDO,
    "menu.next": Action.NEXT,
    "menu.undo": Action.UNDO,
    "menu.scene": Action.SCENE,
    "menu.help": Action.HELP,
    "menu.new_person": Action.NEW_PERSON,
    "menu.quit": Action.QUIT,
}
_DONE = {"run.close": Action.QUIT, "menu.new_person": Action.NEW_PERSON, "run.drive_on": Action.CONFIRM}
_ENDED = {"run.keep": Action.CONFIRM, "run.discard": Action.DISCARD, "run.redo": Action.REDO}
_OUTCOMES = ("goal", "timeout", "contact", "stopped")
_SHORT_RUN = 2.0  # s; a shorter run may have been ended by mistake
_COMMAND_KEYS = (pygame.K_RETURN, pygame.K_KP_ENTER, pygame.K_ESCAPE, pygame.K_F1)  # not part of a typed text
_PASSED_ON = (pygame.WINDOWFOCUSLOST, *HOTPLUG_EVENTS)  # reach the screen while the scene panel is open


class Overlay:
    """Widgets over the scene; call `rebuild` after every change of state, page, window or size.

    Args:
        session: its state decides what is shown.
        runs: number of runs requested; None for no limit.
        profiles: of the devices, for the help page.
        hidden: actions that the driver may not request.

    Attributes:
        page: page that the driver opened, shown instead of the card of the state.
        answer: widgets of the question at the end of the run, while they are shown.
        card: the card on show.
        panel: of the scene settings, while it is open.
        drives_on: whether the driver continues although all requested runs are kept.
    """

    def __init__(
        self, session: Session, runs: int | None, profiles: Mapping[str, Profile], hidden: Set[Action]
    ) -> None:
        self._session, self._runs, self._profiles, self._hidden = session, runs, profiles, hidden
        self.drives_on = False
        self._label: Any = None
        self.page: Page | None = None
        self.answer: Answer | None = None
        self.card: Card | None = None
        self.panel: ScenePanel | None = None

    @property
    def label(self) -> Any:
        """Answer about this run so far; it outlives its widgets."""
        return self.answer.label if self.answer is not None else self._label

    @label.setter
    def label(self, label: Any) -> None:
        if self.answer is not None:
            self.answer.kill()
        self._label, self.answer = label, None

    @property
    def is_done(self) -> bool:
        """Whether all requested runs are kept and the driver has not decided to drive on."""
        done = self._runs is not None and self._session.kept >= self._runs
        return done and self._session.state == "waiting" and not self.drives_on

    def rebuild(self, stage: Stage) -> None:
        """Replace the widgets by the widgets of the open page, or of the state."""
        self._label = self.label
        for widget in (self.card, self.panel, self.answer):
            if widget is not None:
                widget.kill()
        self.card = self.panel = self.answer = None
        session, ui, scale = self._session, stage.ui, stage.scale
        # A page that the driver has opened comes before the card of the state.
        if self.page == "scene":
            self.panel = ScenePanel(ui, scale, session.config)
        elif self.page == "help":
            rows = help_rows(self._profiles, self._hidden)
            # The zones can be switched on while the help is open; the legend has its most rows then.
            end = legend_box(stage.size, session.after, zones=True, scale=scale).top
            self.card = Card(ui, scale, text("help.title"), rows, [(text("help.close"), Action.HELP)], bottom=end)
        elif self.page == "menu":
            lines = [text("menu.kept", count=session.kept)]
            self.card = Card(ui, scale, text("menu.title"), lines, self._buttons(_MENU), stacked=True)
        elif session.state == "ended":
            self.card = _ended_card(ui, scale, session, free_area(stage.surface, Hud(), scale=scale).top)
            if session.label_spec.per_run:
                self.answer = Answer(session.label_spec, ui, self.card.free, self.card.scale, self._label)
        elif self.is_done:
            lines = [text("run.done_count", count=session.kept)]
            self.card = Card(ui, scale, text("run.done"), lines, self._buttons(_DONE))

    def _buttons(self, actions: Mapping[str, Action]) -> list[tuple[str, Action]]:
        """Texts and actions of buttons, without hidden actions."""
        return [(text(key), action) for key, action in actions.items() if action not in self._hidden]

    @property
    def covers(self) -> bool:
        """Whether a card or the panel is shown; it shows notices then."""
        return self.card is not None or self.panel is not None

    @property
    def end_of_ended_card(self) -> int:
        """Lower edge of the card at the end of a run, px, below which the scene stays visible; 0 without that card."""
        is_shown = self.card is not None and self.page is None and self._session.state == "ended"
        return self.card.box.bottom if self.card is not None and is_shown else 0

    def handle(self, event: pygame.Event) -> Action | ScenarioConfig | bool | None:
        """Process an event.

        Returns:
            An action, new scene settings, True if the event was used otherwise, or a false value if it was not used.

        Raises:
            ConfigError: the counts of the scene panel contradict each other.
        """
        if self.panel is not None:  # it covers the scene, so nothing else may react to keys and clicks
            return self.panel.handle(event) or event.type not in _PASSED_ON
        if self.answer is not None and event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED:
            return Action.CONFIRM  # the text field does not pass Enter on
        if self.answer is not None and (self.answer.handle(event) or self._types(event, self.answer)):
            return True
        if self.card is None:
            return None
        on_card = event.type == pygame.MOUSEBUTTONDOWN and self.card.box.collidepoint(event.pos)
        return self.card.pressed(event) or on_card or None

    def apply(self, stage: Stage, action: Action) -> None:
        """Change the answer by a label action (wheel, trigger or button)."""
        if self.answer is None or self.answer.spec.kind == "text":
            return
        slider = LabelSlider(self.answer.spec)
        slider.set(self.answer.label)
        slider.apply(action)
        self.label = slider.label
        self.rebuild(stage)

    def draw(self, surface: pygame.Surface, notice: str = "") -> None:
        """Draw everything but the widgets; a notice is shown beside the card."""
        if self.card is not None:
            self.card.draw(surface, notice)
        if self.answer is not None:
            self.answer.draw(surface)

    def show_problem(self, problem: str) -> bool:
        """Show an error in the scene panel; returns False if the panel is not open."""
        if self.panel is None:
            return False
        self.panel.show_problem(problem)
        return True

    def _types(self, event: pygame.Event, answer: Answer) -> bool:
        """Whether a key types a letter of a text answer, so that it does nothing else; the text gets it in any case."""
        if event.type not in (pygame.KEYDOWN, pygame.KEYUP, pygame.TEXTINPUT) or answer.spec.kind != "text":
            return False
        if event.type != pygame.TEXTINPUT and event.key in _COMMAND_KEYS:
            return False
        answer.type_key(event)
        return True


def _ended_card(ui: pygame_gui.UIManager, scale: float, session: Session, top: int) -> Card:
    """The card at the end of a run: the question about the run is the headline."""
    assert session.outcome is not None
    spec, status, time = session.label_spec, session.outcome.status, session.outcome.time
    return Card(
        ui,
        scale,
        question_of(spec) if spec.per_run else text("run.keep_question"),
        buttons=[(text(key), action) for key, action in _ENDED.items()],
        above=text(f"run.{status}", time=f"{time:.1f}") if status in _OUTCOMES else status,
        warning=text("run.short", time=f"{time:.1f}") if time < _SHORT_RUN else "",
        free_height=partial(Answer.height_of, spec) if spec.per_run else None,
        top=top,
    )
