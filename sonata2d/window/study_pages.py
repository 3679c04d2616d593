"""Pages and questions of a study in the window."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import pygame
import pygame_gui

from ..collect.texts import text
from ..core.labels import LabelSpec
from ..errors import Sonata2dError
from ..study.config import in_language
from ..study.content import Json, step_content
from ..study.markdown import Paragraph, paragraphs_of
from ..view.fonts import width_of, wrapped
from ..view.palette import BLUE, FAINT, FLOOR, INK, PAPER, VERMILLION, Colour
from .actions import Action
from .answer import Answer
from .cards import Card
from .stage import Screen, Stage
from .widgets import LARGE, SMALL, TEXT, ButtonSpec, button_row, line_height, text_size, write, write_lines

if TYPE_CHECKING:
    from .study_flow import StudyFlow

_WIDTH, _EDGE, _ROW, _GAP = 820, 20, 42, 10  # px at scale 1: of the text, and around it; height of a button
_INDENT, _TICK, _BAR = 28, 20, 6  # px at scale 1: of a list item; side of a box to tick; width of the scroll bar
_STEP = 60  # px at scale 1 that a turn of the wheel or an arrow key scrolls
_ENTER = (pygame.K_RETURN, pygame.K_KP_ENTER)


class _Line(NamedTuple):
    """A line of a page: its place within the text, words, height and colour."""

    x: int
    y: int
    words: str
    size: int
    colour: Colour


class PageScreen:
    """A page to read, the consent, or the end.

    Args:
        flow: of the participant.
    """

    def __init__(self, flow: StudyFlow) -> None:
        self._flow, self._content = flow, step_content(flow.participant)
        self._ticked = [False] * len(self._content.get("statements", ()))
        self._problem, self._offset = "", 0
        self._following: Screen | None = self

    def enter(self, stage: Stage) -> None:
        self._stage, s = stage, stage.scale
        width, height = stage.size
        edge, row = round(_EDGE * s), round(_ROW * s)
        column = pygame.Rect(0, edge, min(round(_WIDTH * s), width - 2 * edge), 0)
        column.centerx = width // 2
        column.top += self._build_languages(stage, column, row)
        size = text_size(LARGE, s)
        self._title = wrapped(self._heading(), column.width, size)
        self._head = pygame.Rect(*column.topleft, column.width, len(self._title) * line_height(size) + edge // 2)
        buttons = pygame.Rect(column.left, height - edge - row, column.width, row)
        button_row(stage.ui, buttons, list(self._buttons()), gap=round(_GAP * s))
        top = self._head.bottom
        self._view = pygame.Rect(column.left, top, column.width, max(buttons.top - line_height(size) - top, 1))
        self._lay_out(column.width - round(3 * _BAR * s))
        self._scroll(0)

    def handle(self, event: pygame.Event) -> None:
        step = round(_STEP * self._stage.scale)
        if event.type == pygame.QUIT or (event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE):
            self._following = None
        elif event.type == pygame.MOUSEWHEEL:
            self._scroll(-event.y * step)
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1 and self._view.collidepoint(event.pos):
            place = event.pos[0] - self._view.left, event.pos[1] - self._view.top + self._offset
            self._tick(next((k for k, box in enumerate(self._boxes) if box.collidepoint(place)), None))
        elif event.type == pygame.KEYDOWN:
            moves = {pygame.K_DOWN: step, pygame.K_UP: -step}
            moves |= {pygame.K_PAGEDOWN: self._view.height, pygame.K_PAGEUP: -self._view.height}
            if event.key in moves:
                self._scroll(moves[event.key])
            elif event.key in _ENTER:
                self._confirm()
            elif pygame.K_1 <= event.key <= pygame.K_9:
                self._tick(event.key - pygame.K_1)

    def advance(self, seconds: float) -> Screen | None:
        return self._following

    def draw(self, surface: pygame.Surface) -> None:
        s = self._stage.scale
        surface.fill(FLOOR)
        middle = self._head.centery - round(_EDGE * s) // 4
        write_lines(surface, self._title, (self._head.left, middle), size=text_size(LARGE, s), anchor="midleft")
        picture = surface.subsurface(self._view.clip(surface.get_rect()))
        for line in self._lines:
            y = line.y - self._offset
            if -line.size < y < self._view.height + line.size:
                write(picture, line.words, (line.x, y), size=line.size, colour=line.colour)
        for k, box in enumerate(self._boxes):
            self._draw_tick(picture, box, self._ticked[k], str(k + 1))
        if self._height > self._view.height:
            length = self._view.height**2 // self._height
            top = self._offset * (self._view.height - length) // (self._height - self._view.height)
            width = round(_BAR * s)
            place = pygame.Rect(self._view.width - width, top, width, length)
            pygame.draw.rect(picture, FAINT, place, border_radius=width // 2)
        number = text("web.number", id=self._flow.participant.id)
        write(surface, number, (self._head.left, round(_EDGE * s)), size=text_size(SMALL, s), colour=FAINT)
        size = text_size(TEXT, s)
        write(surface, self._problem, (self._view.left, self._view.bottom + line_height(size) / 2), size=size,
              colour=VERMILLION, max_width=self._view.width)  # fmt: skip

    def leave(self) -> None:
        self._flow.left(self._following)

    # What a participant does

    def _buttons(self) -> Iterator[ButtonSpec]:
        kind = self._content["kind"]
        if self._flow.participant.can_undo:
            yield text("menu.undo"), self._undo, ""
        if kind == "consent":
            yield text("web.decline"), lambda: self._do(lambda: self._flow.participant.decline(self._content["id"])), ""
            yield text("web.agree"), self._confirm, ""
        elif kind == "declined":
            yield text("web.reconsider"), lambda: self._do(self._flow.participant.reconsider), ""
        elif kind != "thanks":
            yield text("web.continue"), self._confirm, ""
        if kind in ("declined", "thanks"):
            yield text("run.close"), self._close, ""

    def _confirm(self) -> None:
        participant, step, kind = self._flow.participant, self._content["id"], self._content["kind"]
        if kind == "thanks":
            self._close()
        elif kind == "consent" and not all(self._ticked):
            self._problem = text("web.tick_all")
        elif kind == "consent":
            self._do(lambda: participant.consent(step, self._ticked))
        elif kind == "page":
            self._do(lambda: participant.read(step))

    def _undo(self) -> None:
        self._do(self._flow.participant.undo)

    def _close(self) -> None:
        self._following = None

    def _do(self, act: Callable[[], object]) -> None:
        """Do something, and show the next step; an error is shown, and nothing is lost."""
        try:
            act()
            self._following = self._flow.screen()
        except (Sonata2dError, ValueError) as error:
            self._problem = str(error)

    def _tick(self, k: int | None) -> None:
        if k is not None and k < len(self._ticked):
            self._ticked[k], self._problem = not self._ticked[k], ""

    # Layout

    def _heading(self) -> str:
        study = self._flow.participant.study
        titles = {"thanks": text("rating.thanks"), "declined": text("web.declined_title")}
        title = in_language(study.config.title, self._flow.participant.language)
        return self._content.get("title") or titles.get(self._content["kind"], title)

    def _build_languages(self, stage: Stage, column: pygame.Rect, row: int) -> int:
        """Buttons of the languages of the study above the page; returns the height that they need, px."""
        study = self._flow.participant.study
        if len(study.config.languages) < 2:
            return 0
        specs = [
            (study.tables[language]["web.name"], partial(self._choose, language), "")
            for language in study.config.languages
        ]
        place = pygame.Rect(column.left, column.top, min(column.width, len(specs) * 4 * row), row)
        place.right = column.right
        button_row(stage.ui, place, specs, gap=round(_GAP * stage.scale), equal=True)
        return row + round(_GAP * stage.scale)

    def _choose(self, language: str) -> None:
        self._do(lambda: self._flow.participant.choose_language(language))

    def _lay_out(self, width: int) -> None:
        """Lines of the page, and boxes to tick, from the top of the text, px."""
        s = self._stage.scale
        self._lines: list[_Line] = []
        self._boxes: list[pygame.Rect] = []
        kind, words = self._content["kind"], self._content.get("text", "")
        if not words:
            words = {"thanks": text("web.thanks"), "declined": text("web.declined")}.get(kind, "")
        y = 0
        for paragraph in paragraphs_of(words):
            y = self._add(paragraph, y, width)
        for statement in self._content.get("statements", ()):
            parts = [Paragraph(part.text, indent=1) for part in paragraphs_of(statement)]
            top = y
            for part in parts:
                y = self._add(part, y, width)
            self._boxes.append(pygame.Rect(0, top, width, y - top - round(_GAP * s)))
        self._height = y

    def _add(self, paragraph: Paragraph, y: int, width: int) -> int:
        """Add the lines of a paragraph from y on; returns where the next one begins."""
        s = self._stage.scale
        size = text_size(24 if paragraph.kind == "heading" else SMALL if paragraph.kind == "code" else TEXT, s)
        x = round(paragraph.indent * _INDENT * s)
        if paragraph.mark:
            place = x - width_of(f"{paragraph.mark} ", size)
            self._lines.append(_Line(place, y + line_height(size) // 2, paragraph.mark, size, INK))
        for part in paragraph.text.split("\n"):
            for words in wrapped(part, width - x, size):
                self._lines.append(_Line(x, y + line_height(size) // 2, words, size, INK))
                y += line_height(size)
        return y + round(_GAP * s)

    def _draw_tick(self, surface: pygame.Surface, box: pygame.Rect, is_ticked: bool, key: str) -> None:
        s = self._stage.scale
        side = round(_TICK * s)
        square = pygame.Rect(2, box.top - self._offset + round(3 * s), side, side)
        pygame.draw.rect(surface, BLUE if is_ticked else PAPER, square, border_radius=round(4 * s))
        pygame.draw.rect(surface, BLUE if is_ticked else FAINT, square, max(round(s), 1), border_radius=round(4 * s))
        if is_ticked:
            (x, y), u = square.center, side / 20
            points = [(x - 5 * u, y), (x - 1.5 * u, y + 4 * u), (x + 5 * u, y - 4 * u)]
            pygame.draw.lines(surface, PAPER, False, points, max(round(2.5 * u), 1))

    def _scroll(self, distance: int) -> None:
        self._offset = min(max(self._offset + distance, 0), max(self._height - self._view.height, 0))


@dataclass(frozen=True)
class Asked:
    """One question on the screen: a question of the study, or a row of a table.

    Attributes:
        name: of the question in the study.
        item: of the row; None for a question without rows.
        above: question above the table; empty for others.
        spec: the question as that of a label; a number is asked for as a text.
        required: whether it has to be answered.
        limits: of a number; None for other kinds.
        is_integer: whether a number is a whole one.
    """

    name: str
    item: str | None
    above: str
    spec: LabelSpec
    required: bool
    limits: tuple[float | None, float | None] | None = None
    is_integer: bool = False

    def value_of(self, label: Any) -> Any:
        """The answer as the study stores it.

        Raises:
            ValueError: it is no number, or not within the limits.
        """
        if self.limits is None or label is None:
            return label
        low, high = self.limits
        try:
            number = float(str(label).replace(",", "."))
        except ValueError:
            number = float("nan")
        is_within = (low is None or number >= low) and (high is None or number <= high)
        if not is_within or not math.isfinite(number) or (self.is_integer and not number.is_integer()):
            key = "web.whole_number" if self.is_integer else "web.wrong_number"
            limits = {"low": "…" if low is None else f"{low:g}", "high": "…" if high is None else f"{high:g}"}
            raise ValueError(text(key, **limits))
        return int(number) if number.is_integer() else number


def asked_in(questions: list[Json]) -> Iterator[Asked]:
    """The questions of a page one by one, with a question for each row of a table."""
    for question in questions:
        name, words, required = question["name"], question["question"] or question["name"], question["required"]
        if question["kind"] != "likert":
            kind: Any = "text" if question["kind"] == "number" else question["kind"]
            more: dict[str, Any] = {key: tuple(question[key]) for key in ("classes", "ends") if question.get(key)}
            limits = (question["minimum"], question["maximum"]) if question["kind"] == "number" else None
            spec = LabelSpec(kind=kind, name=name, question=words, **more)
            yield Asked(name, None, "", spec, required, limits, bool(question.get("integer")))
            continue
        for item in question["items"]:
            ends = item["ends"] or question.get("ends") or ("", "")
            points = question["labels"] or [
                {1: ends[0], question["points"]: ends[1]}.get(k) or str(k) for k in range(1, question["points"] + 1)
            ]
            row = item["text"] or f"{ends[0]} – {ends[1]}"
            spec = LabelSpec(kind="classes", name=name, question=row, classes=tuple(points))
            yield Asked(name, item["name"], question["question"], spec, required)


class QuestionsScreen:
    """The questions of a page of a study, one after the other.

    Args:
        flow: of the participant.
    """

    def __init__(self, flow: StudyFlow) -> None:
        self._flow = flow
        content = step_content(flow.participant)
        self._step, self._asked = content["id"], list(asked_in(content["questions"]))
        self._labels: list[Any] = [None] * len(self._asked)
        self._k, self._problem = 0, ""
        self._answer: Answer | None = None
        self._following: Screen | None = self

    def enter(self, stage: Stage) -> None:
        self._stage = stage
        self._build()

    def handle(self, event: pygame.Event) -> None:
        assert self._answer is not None
        answer, is_key = self._answer, event.type == pygame.KEYDOWN
        is_enter = is_key and event.key in _ENTER and not answer.is_typing
        if event.type == pygame.QUIT or (is_key and event.key == pygame.K_ESCAPE):
            self._following = None
        elif is_enter or event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED:
            self._confirm()
        elif pressed := self._card.pressed(event):
            act = {Action.UNDO: self._undo, Action.REDO: self._back, Action.CONFIRM: self._confirm}[pressed]
            act()
        elif not answer.handle(event) and is_key:
            answer.type_key(event)

    def advance(self, seconds: float) -> Screen | None:
        return self._following

    def draw(self, surface: pygame.Surface) -> None:
        assert self._answer is not None
        surface.fill(FLOOR)
        self._card.draw(surface)
        self._answer.draw(surface)

    def leave(self) -> None:
        self._flow.left(self._following)

    def _build(self) -> None:
        """Show the present question."""
        if self._answer is not None:
            self._labels[self._k] = self._answer.label
        self._stage.ui.clear_and_reset()
        asked = self._asked[self._k]
        buttons = [(text("web.continue"), Action.CONFIRM)]
        if self._k > 0:
            buttons.insert(0, (text("question.back"), Action.REDO))
        elif self._flow.participant.can_undo:
            buttons.insert(0, (text("menu.undo"), Action.UNDO))
        place = text("question.number_of", number=self._k + 1, count=len(self._asked))
        optional = "" if asked.required else f" ({text('web.optional')})"
        self._card = Card(
            self._stage.ui,
            self._stage.scale,
            asked.spec.question + optional,
            buttons=buttons,
            above=f"{place}   {asked.above}",
            warning=self._problem,
            free_height=lambda width, scale: Answer.height_of(asked.spec, width, scale),
        )
        card = self._card
        self._answer = Answer(asked.spec, self._stage.ui, card.free, card.scale, self._labels[self._k])

    def _go_to(self, k: int, problem: str = "") -> None:
        assert self._answer is not None
        self._labels[self._k] = self._answer.label
        self._answer, self._k, self._problem = None, k, problem
        self._build()

    def _confirm(self) -> None:
        """Go on to the next question; after the last one, store all answers."""
        assert self._answer is not None
        asked, label = self._asked[self._k], self._answer.label
        try:
            asked.value_of(label)
        except ValueError as error:
            self._go_to(self._k, str(error))
            return
        if label is None and asked.required:
            self._go_to(self._k, text("web.required"))
        elif self._k + 1 < len(self._asked):
            self._go_to(self._k + 1)
        else:
            self._labels[self._k] = label
            self._store()

    def _store(self) -> None:
        values: dict[str, Any] = {}
        for asked, label in zip(self._asked, self._labels, strict=True):
            value = asked.value_of(label)
            if value is not None and asked.item is not None:
                values.setdefault(asked.name, {})[asked.item] = value
            elif value is not None:
                values[asked.name] = value
        try:
            self._flow.participant.answer(self._step, values)
            self._following = self._flow.screen()
        except (Sonata2dError, ValueError) as error:
            self._go_to(self._k, str(error))

    def _back(self) -> None:
        self._go_to(self._k - 1)

    def _undo(self) -> None:
        try:
            self._flow.participant.undo()
            self._following = self._flow.screen()
        except (Sonata2dError, ValueError) as error:
            self._go_to(self._k, str(error))
