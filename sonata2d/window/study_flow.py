"""A study in the window: one screen for each step of a participant."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ..collect.texts import text, use_table
from ..core.labels import LabelSpec
from ..study.content import shown_label
from ..study.load import spec_of
from ..study.participant import Participant
from .actions import Action
from .cards import ENDED, EndedRun
from .collect_screen import CollectScreen
from .hud import Hud
from .input import InputDevices
from .rate_screen import RateScreen
from .stage import Screen
from .study_pages import PageScreen, QuestionsScreen

_CHANGES = {"view": [Action.VIEW], "zones": [Action.ZONES], "zoom": [Action.ZOOM_IN, Action.ZOOM_OUT]}


class StudyFlow:
    """Makes the screens of a study.

    Args:
        participant: the participant.
        devices: keyboard, mouse and pads.
    """

    def __init__(self, participant: Participant, devices: InputDevices) -> None:
        self.participant, self.devices = participant, devices

    def screen(self, notice: str = "") -> Screen:
        """The screen of the present step.

        Args:
            notice: shown while driving.
        """
        participant = self.participant
        use_table(participant.study.tables[participant.language])
        kind = participant.step.kind
        if participant.has_declined or kind in ("page", "consent", "thanks"):
            return PageScreen(self)
        if kind == "questions":
            return QuestionsScreen(self)
        return self._rate_screen() if kind == "ratings" else StudyDriveScreen(self, notice)

    def left(self, following: Screen | None) -> None:
        """A screen was left: with the last one, the participant's part ends."""
        if following is None:
            self.participant.close()

    def _rate_screen(self) -> RateScreen:
        participant = self.participant
        assert participant.rating is not None
        block = participant.study.config.ratings[participant.step.block]
        return RateScreen(
            participant.rating,
            view=block.view,
            label=replace(participant.rating.spec, **_texts_of(spec_of(block.question, participant.language))),
            follow=self._after_ratings,
        )

    def _after_ratings(self) -> Screen:
        self.participant.resume()
        return self.screen()


class StudyDriveScreen(CollectScreen):
    """The screen for a run, or a practice run, of a study.

    Args:
        flow: of the participant.
        notice: shown at first.
    """

    def __init__(self, flow: StudyFlow, notice: str = "") -> None:
        participant = flow.participant
        config = participant.study.config
        assert participant.session is not None
        self._flow, self._participant = flow, participant
        self._step = participant.step
        allowed = {Action.DISCARD: config.discard, Action.REDO: config.redo, Action.UNDO: config.undo}
        if self._is_practice:
            allowed = {Action.DISCARD: False, Action.REDO: True, Action.UNDO: False}
        hidden = {Action.NEXT, Action.REMAP, *(action for action, is_allowed in allowed.items() if not is_allowed)}
        hidden |= {action for name, actions in _CHANGES.items() if name not in config.changes for action in actions}
        super().__init__(participant.session, flow.devices, view=config.view, hidden=hidden)
        if participant.session.state == "ended":  # it was taken back
            self._overlay.label = participant.session.undone_label
        if notice:
            self._notify(notice)

    def leave(self) -> None:
        self.devices.release()
        self.session.pause()
        self._flow.left(self._following)

    @property
    def label_spec(self) -> LabelSpec:
        block = None if self._is_practice else self._participant.study.config.runs[self._step.block]
        return shown_label(self.session.label_spec, block, self._participant.language)

    @property
    def notice(self) -> str:
        notice = super().notice
        if notice == text("notice.waiting") and self._is_practice:
            return text("web.practice_hint")
        return notice

    @property
    def _is_practice(self) -> bool:
        return self._step.kind == "practice"

    def _ended_run(self) -> EndedRun:
        config = self._participant.study.config
        if self._is_practice:
            buttons = [(text("web.continue"), Action.CONFIRM), (text("run.redo"), Action.REDO)]
            return EndedRun(text("web.practice_done"), buttons)
        ended = EndedRun.of(self.session, self.label_spec)
        buttons = [(text(key), action) for key, action in ENDED.items() if action not in self._hidden]
        if self.session.after.time >= config.minimum_length:
            return replace(ended, buttons=buttons)
        buttons = [button for button in buttons if button[1] is not Action.CONFIRM]
        if not any(action is Action.REDO for _, action in buttons):
            buttons.append((text("run.redo"), Action.REDO))
        return EndedRun(text("web.too_short", seconds=f"{config.minimum_length:g}"), buttons)

    def _perform(self, action: Action) -> None:
        if action is Action.REDO and self.session.state == "ended":  # a run that is too short can be driven again
            self._redo()
        else:
            super()._perform(action)

    def _keep(self, label: Any) -> None:
        if self._is_practice:
            self._participant.finish_practice()
            self._following = self._flow.screen()
        else:
            self._participant.keep(label)
            self._following = self._flow.screen(text("notice.kept"))

    def _next(self, reason: str = "another scene", config: Any = None) -> None:
        self._participant.discard()
        self._following = self._flow.screen(text("notice.discarded"))

    def _start_again(self) -> Path | None:
        return self._participant.redo()

    def _take_back(self) -> None:
        self._participant.undo()

    def _hud(self, notice: str) -> Hud:
        kept, count = self._participant.runs
        hud = replace(super()._hud(notice), run=min(kept + 1, count), runs=count)
        if not self._is_practice:
            return hud
        keys = tuple(key for key in hud.keys if key[1] != text("keys.keep"))
        return replace(hud, title=text("web.practice"), keys=keys)


def _texts_of(spec: LabelSpec) -> dict[str, Any]:
    return {"question": spec.question, "classes": spec.classes, "ends": spec.ends}
