"""The simulator in a page: it answers the messages of a page without a server, in a Python that runs in the browser.

`worker.js` starts it with Pyodide. A page without a server drives a robot, or watches a controller, with `open`. The
page of a study simulates with `follow` the run that the server simulates too, and shows a tick before the server does.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import orjson

from ..agents.controllers.base import Controller
from ..agents.controllers.loading import load_controller
from ..agents.controllers.teleoperation import STOP, Teleoperation
from ..core.devices import DeviceEvent
from ..core.wording import described, one_line
from ..errors import ConfigError, Sonata2dError
from ..record.recorder import EpisodeRecorder
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.load import load_scenario
from ..sim.driver import controller_info_of
from ..sim.episode import Episode

if find_spec("pygame") is None:
    # Modules that draw import pygame for their pixels; a page draws SVG and a canvas, which need none.
    _pygame: Any = ModuleType("pygame")
    _pygame.freetype = ModuleType("pygame.freetype")
    sys.modules |= {"pygame": _pygame, "pygame.freetype": _pygame.freetype}

from ..view.layers import Layers
from ..view.legend import Legend
from ..view.scene_data import UNDRAWN, legend_data, scene_data, state_data

Json = dict[str, Any]

_LAYERS = Layers(zones=True, legend=True)


class PageSimulator:
    """Answers the messages of one page, one after the other.

    Args:
        folder: for the file of a controller that a person writes in the page.
    """

    def __init__(self, folder: Path = Path()) -> None:
        self._own = folder / "own_controller.py"
        self._run = 0
        self._first: tuple[DeviceEvent, ...] = ()  # events before those of the next tick
        self._begin(generate("empty"), Teleoperation(), EpisodeRecorder(), "teleoperation")

    def answer(self, message: str) -> str:
        """The answer to a message, both as JSON.

        The messages, by `type`:

        - `open` begins a run: of the preset `scenario` with `changes` of its settings, `seed`, and a `controller`: a
          name or, with `code`, the text of a file that defines a class derived from `Controller`. The answer is a view,
          as of the server of a study.
        - `tick`, `pause` and `stop` are those of the page of a study.
        - `file` requests the episode file of a run that ended.
        - `follow` begins the run of a study, with the ticks that it has, or continues it; see `Session.beginning`.
        """
        content = orjson.loads(message)
        try:
            answer = getattr(self, f"_{content['type']}")(content)
        except Exception as error:  # of a controller that a person wrote, too
            text = one_line(error, 400) if isinstance(error, Sonata2dError) else described(error, 400)
            answer = {"type": "error", "asked": content["type"], "text": text, "line": self._line_of(error)}
        return orjson.dumps(answer).decode()

    def _open(self, message: Json) -> Json:
        config = load_scenario(message["scenario"]).changed(**message["changes"])
        name = message["controller"]
        if (code := message.get("code")) is not None:
            if not code.strip():
                raise ConfigError("there is no code; write a class derived from sonata2d.Controller")
            self._own.write_text(code, encoding="utf-8")
            sys.modules.pop(self._own.stem, None)
            name = str(self._own)
        controller = Teleoperation() if name == "teleoperation" else load_controller(name)
        recorder = EpisodeRecorder(context=config.context, label_spec=config.label)
        self._begin(generate(config, message["seed"]), controller, recorder, name)
        return self._view()

    def _follow(self, message: Json) -> Json:
        begun = message["beginning"]
        if message["past"] is not None or begun["run"] != self._run:
            scene = generate(ScenarioConfig(**begun["settings"]), begun["seed"], begun["episode"])
            self._begin(scene, Teleoperation.from_settings(begun["controller"]), EpisodeRecorder(), "teleoperation")
            self._run = begun["run"]
            for events in message["past"] or ():
                self._advance(map(_event, events))
        self._first = tuple(map(_event, message["first"]))
        return {"type": "followed", "run": self._run, "ticks": self._ticks}

    def _begin(self, scene: Any, controller: Controller, recorder: EpisodeRecorder, name: str) -> None:
        info = controller_info_of(controller, name)
        self._recorder, self._episode = recorder, Episode(scene, controller, observers=[recorder], controller_info=info)
        self._run, self._status = self._run + 1, "waiting"
        self._before = self._after = self._episode.snapshot()
        self._first = ()

    @property
    def _ticks(self) -> int:
        return len(self._episode.past)

    def _advance(self, events: Iterable[DeviceEvent]) -> None:
        first, self._first = self._first, ()
        frame = self._episode.step((*first, *events))
        if frame is None:
            self._status = "ended"
        else:
            self._status, self._before, self._after = "driving", frame.snapshot, self._episode.snapshot()

    def _tick(self, message: Json) -> Json | None:
        if message["run"] != self._run or message["number"] > self._ticks:
            return None  # of an earlier run, or after ticks that this one lacks
        if message["number"] == self._ticks and self._status != "ended":
            self._advance(DeviceEvent(**event) for event in message["events"])
        return {"type": "tick", "asked": message["number"], **self._state()}

    def _pause(self, message: Json) -> Json:
        if self._status == "driving":
            self._status = "paused"
            pressed = self._episode.controller.pressed if isinstance(self._episode.controller, Teleoperation) else ()
            self._first = tuple(DeviceEvent(event.device, event.control, 0.0) for event in pressed)
        return self._view()

    def _stop(self, message: Json) -> Json:
        if self._ticks and self._status != "ended":
            if isinstance(self._episode.controller, Teleoperation):
                self._advance([STOP])
            else:
                self._episode.end("stopped", "stopped in the page")
                self._status = "ended"
        return self._view()

    def _file(self, message: Json) -> Json:
        document = self._recorder.document().decode()
        return {"type": "file", "name": f"{orjson.loads(document)['id']}.json", "text": document}

    def _state(self) -> Json:
        outcome = self._episode.outcome
        return {
            "run": self._run,
            "ticks": self._ticks,
            "status": self._status,
            "state": state_data(self._after) | {"hasArrived": self._episode.arrivals[0] is not None},
            "outcome": outcome and outcome.status,
        }

    def _view(self) -> Json:
        scene = self._episode.scene
        entries = legend_data(Legend.of([self._after], _LAYERS))
        drive = {
            **self._state(),
            "before": state_data(self._before),
            "scene": scene_data(scene),
            "isHolonomic": scene.robot.moves_sideways,
            "limit": scene.rules.time_limit,
            "people": len(scene.humans),
            "changes": ["view", "zoom", "zones"],
            "view": "follow",
            "legend": [entry for entry in entries if entry["name"] not in UNDRAWN],
        }
        return {"type": "view", "drive": drive}

    def _line_of(self, error: BaseException) -> int | None:
        """Line of the code that a person wrote in the page, at which an error arose; None if it arose elsewhere."""
        seen: BaseException | None = error
        while seen is not None:
            if isinstance(seen, SyntaxError) and Path(seen.filename or "").name == self._own.name:
                return seen.lineno
            lines = [
                frame.lineno for frame in traceback.extract_tb(seen.__traceback__) if frame.filename == str(self._own)
            ]
            if lines:
                return lines[-1]
            seen = seen.__cause__
        return None


def _event(event: list[Any]) -> DeviceEvent:
    return DeviceEvent(*event)
