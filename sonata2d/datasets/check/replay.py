"""Runs recorded episodes again: verification by replay and rerun, and branches under another controller."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import orjson

from ...agents.controllers.base import Controller, External
from ...agents.controllers.loading import inner_of, is_installed, load_controller
from ...agents.sensors.base import Measure, Sensor, sensor_from
from ...core.devices import DeviceEvent
from ...core.files import interruption
from ...core.geometry import Twist
from ...core.scene import Scene
from ...core.snapshot import ControllerInfo, Observer, Snapshot
from ...errors import ConfigError, ControllerError, RecordError, SceneError
from ...record.canonical import serialise
from ...record.files import read_bytes
from ...record.layout import JsonDict
from ...record.reader import read_episode
from ...record.record import EpisodeRecord, events_of
from ...record.recorder import EpisodeRecorder
from ...registry import CONTROLLERS
from ...scenegen.generator import generate
from ...scenegen.scenario.config import ScenarioConfig
from ...sim.driver import controller_info_of, renderer_for
from ...sim.episode import Episode
from ...sim.inputs import TickInput
from ...version import LAST_REPLAY, PHYSICS_VERSION
from ..transforms.mirror import mirrored
from .episodes import Problem


@dataclass(frozen=True)
class _RecordedReadings(Sensor):
    """Stands for a sensor of an unregistered type: it returns the recorded readings.

    Attributes:
        readings: by tick, as files hold them.
    """

    readings: Mapping[int, Any] = field(default_factory=dict)

    def start(self, scene: Scene) -> Measure:
        return lambda snapshot, noise: self.readings.get(snapshot.tick)


class _RecordedCommandsOnly(External):
    """Controller of a replay; it is asked only if the recorded commands end before the episode does.

    Args:
        robot: its keys in the document.
        frames: its keys in the frames.
    """

    def __init__(self, robot: JsonDict, frames: list[JsonDict]) -> None:
        self.sensors = [_sensor_again(each, frames) for each in robot.get("sensors") or ()]

    def act(self, snapshot: Snapshot) -> Twist:
        raise ControllerError("the recorded commands end before the episode does")


def _sensor_again(definition: JsonDict, frames: list[JsonDict]) -> Sensor:
    """A recorded sensor that measures again, if it is registered."""
    if sensor := sensor_from(definition):
        return sensor
    name = definition["name"]
    given = {t: frame["sensors"][name] for t, frame in enumerate(frames) if name in (frame.get("sensors") or ())}
    return _RecordedReadings(name, record=True, readings=given)


def branch(
    path: str | Path,
    tick: int,
    controller: Controller,
    *,
    others: Sequence[Controller] | None = None,
    observers: Iterable[Observer] = (),
) -> Episode:
    """A recorded episode up to `tick`, to the bit, which another controller continues.

    Args:
        path: an episode file.
        tick: number of recorded ticks to keep.
        controller: drives the robot afterwards.
        others: drive the other robots; None: their recorded controllers.
        observers: receive the frames of the branch from tick 0.

    Raises:
        RecordError: the file cannot be read, is of another physics version, or is a mirror image, which cannot be run.
        ControllerError: a recorded controller of another robot is neither built in nor a plug-in, or cannot be loaded.
        ValueError: the recording has fewer ticks.
    """
    record = read_episode(path)
    if record.document.get("mirrored_from"):
        # The random choices of pedestrians follow the seed, so a mirror image would diverge at the first choice.
        raise RecordError(f"{path} is a mirror image, which cannot be run; branch its original and mirror the branch")
    if refusal := _other_physics(record):
        raise RecordError(f"{path} is {refusal}")
    past = _recorded_inputs(record)
    if not 0 <= tick <= len(past):
        raise ValueError(f"tick must be 0..{len(past)}, the ticks in {path}, got {tick}")
    renderer, others = renderer_for(controller), _other_controllers(record) if others is None else others
    return Episode(
        record.scene(), controller, others=others, observers=observers, past=past[:tick], renderer=renderer
    ).replay_past()


def _other_controllers(record: EpisodeRecord) -> list[Controller]:
    """The recorded controllers of the other robots.

    Raises:
        ControllerError: one cannot be loaded, or one object drove several of them.
    """
    infos = record.controller_info.others
    for info in infos:
        if not is_installed(info.path, info.settings or {}):
            raise ControllerError(
                f"the controller {info.path!r} of another robot is neither built in nor a plug-in, and code that a "
                "file names is not run; give the controllers of the other robots: others=[...]"
            )
    controllers = [load_controller(info.path, info.settings) for info in infos]
    for controller, info in zip(controllers, infos, strict=True):
        if controller.drives_several:
            raise ControllerError(
                f"{info.path} may have driven several robots, which the file does not say; give others=[...]"
            )
    return controllers


def _other_physics(record: EpisodeRecord) -> str:
    """Why an episode cannot be run again, if another version of the physics made it; else empty."""
    physics = record.document["physics"]
    if physics == PHYSICS_VERSION:
        return ""
    release = f"; sonata2d {LAST_REPLAY[physics]} is the last release that can" if physics in LAST_REPLAY else ""
    return f"of physics version {physics}, which this sonata2d (physics version {PHYSICS_VERSION}) cannot run{release}"


def _recorded_inputs(record: EpisodeRecord) -> list[TickInput]:
    """Command, label and device events of each recorded tick."""
    commands, frames = record.command.tolist(), record.document["frames"]
    return [
        TickInput(
            Twist(*command),
            frame.get("label"),
            events_of(frame),
            tuple((Twist(*other["command"]), other.get("label")) for other in frame.get("robots") or ()),
        )
        for command, frame in zip(commands, frames, strict=True)
    ]


def _final_events(record: EpisodeRecord) -> tuple[DeviceEvent, ...]:
    return events_of(record.document["final"])


def _replayed_document(record: EpisodeRecord) -> bytes:
    """The episode document that results from the recorded commands.

    Raises:
        ControllerError: the recorded commands end before the episode does.
    """
    recorder, outcome, frames = _recorder_like(record), record.outcome, record.document["frames"]
    episode = Episode(
        record.scene(),
        _RecordedCommandsOnly(record.document, frames),
        others=[
            _RecordedCommandsOnly(robot, [frame["robots"][k] for frame in frames])
            for k, robot in enumerate(record.document.get("robots") or ())
        ],
        observers=[recorder],
        past=_recorded_inputs(record),
        controller_info=record.controller_info,
    ).replay_past()
    last_events = _final_events(record)
    if outcome.status in ("stopped", "regenerate", "error"):  # ended from outside; the simulation cannot tell
        episode.end(outcome.status, outcome.reason, last_events)
    else:
        episode.step(last_events)
    return recorder.document()


def _rerun_document(record: EpisodeRecord, controller: Controller, others: list[Controller]) -> bytes:
    """The episode document that results when the controllers run again with the recorded device events."""
    recorder = _recorder_like(record)
    branched, inputs = record.document["branched_from"], _recorded_inputs(record)
    past = inputs[: branched["tick"]] if branched else []  # another controller drove before the branch
    info = controller_info_of(controller, record.controller_info.path)
    episode = Episode(
        record.scene(),
        controller,
        others=others,
        observers=[recorder],
        past=past,
        controller_info=replace(info, others=record.controller_info.others),
        renderer=renderer_for(controller),
    )
    try:
        for events in (*(tick.events for tick in inputs), _final_events(record)):
            episode.step(events)
        episode.run()
    except BaseException as error:
        interruption.reraise(error)
        if record.outcome.status != "error":
            raise
    return recorder.document()


def check_replay(stored: EpisodeRecord) -> list[Problem]:
    """Problems of an episode that its scene and commands, or its seed and settings, do not reproduce.

    For a mirror image the original is replayed, and the file must be its exact image: the random choices of pedestrians
    follow the seed, so a mirror image cannot be run itself.

    Args:
        stored: the content of a file.
    """
    path = stored.path
    record, problems = _original(stored)
    if record.document.get("imported"):
        return [Problem(path.name, "replay", "imported: there is no simulation to replay")]
    if refusal := _other_physics(record):
        return [Problem(path.name, "physics", refusal)]
    problems += _check_scene(path, record)
    try:
        replayed = _replayed_document(record)
    except (ControllerError, ValueError) as error:
        if any(str(error) in problem.message for problem in problems):  # such as a plug-in that is not installed
            return problems
        return [*problems, Problem(path.name, "replay", str(error))]
    return problems + _first_difference(path.name, "replay", _document_of(stored, record), replayed)


def check_rerun(stored: EpisodeRecord, name: str | None = None) -> list[Problem]:
    """Problems of an episode that its controller does not reproduce; for a mirror image the original is run.

    Args:
        stored: the content of a file.
        name: name of the controller; None: the recorded one, if it is built in or a plug-in's. Code and weights that
            only the file names are not loaded.
    """
    path = stored.path
    record, _ = _original(stored)
    if refusal := _other_physics(record):
        return [Problem(path.name, "physics", refusal)]
    if record is not stored and stored.document["mirrored_from"]["labels"]:
        message = "its labels were mirrored by an unknown function; mirror it back (--labels twist) and check that"
        return [Problem(path.name, "rerun", message)]
    infos = [record.controller_info, *record.controller_info.others]
    for info in infos if name is None else infos[1:]:
        if problem := _not_installed(info):
            return [Problem(path.name, "rerun", problem)]
    recorded, settings = record.controller_info.path, record.controller_info.settings or {}
    controller = load_controller(name or recorded, settings)
    try:
        others = _other_controllers(record)
    except ControllerError as error:
        return [Problem(path.name, "rerun", str(error))]
    if not all(each.deterministic for each in (controller, *others)):
        return []
    document = _document_of(stored, record)  # before the controller can change the working folder
    return _first_difference(path.name, "rerun", document, _rerun_document(record, controller, others))


def _not_installed(info: ControllerInfo) -> str:
    """Why a controller cannot be run again without running code that only the file names; empty if it can."""
    recorded, settings = info.path, info.settings or {}
    if not is_installed(recorded, settings):
        # only a plug-in has a name without a path: the name of a stock controller with own weights contains their path
        is_plugin = recorded not in CONTROLLERS.built_in and not any(letter in recorded for letter in ":./+")
        remedy = (
            " of an installed package; install the package that provides it"
            if is_plugin
            else f", and code that a file names is not run; if you trust it, give --controller {_place_of(recorded)}"
        )
        inner = inner_of(settings)
        which = f"the controller {recorded!r}{f' around {inner[0]!r}' if inner else ''}"
        return f"{which} is neither built in nor a plug-in{remedy}"
    return ""


def _place_of(recorded: str) -> str:
    """The name of a controller for the command line; of one in a script that was run, a placeholder for its file."""
    return recorded.replace("__main__:", "./FILE.py:") if recorded.startswith("__main__:") else recorded


def _original(record: EpisodeRecord) -> tuple[EpisodeRecord, list[Problem]]:
    """The episode of a file, or the original of a mirror image with the problems of an inexact image."""
    path = record.path
    origin = record.document.get("mirrored_from")
    if not origin:
        return record, []
    original = mirrored(record)
    document = serialise(original.document)
    problems = _first_difference(path.name, "mirrored_from", read_bytes(path), serialise(mirrored(original).document))
    if origin["labels"]:
        problems = []  # the function that mirrored the labels is unknown, so bytes cannot be compared
    elif hashlib.sha256(document).hexdigest() != origin["sha256"]:
        message = f"mirroring it back does not give the original {origin['id']}: the SHA-256 differs"
        problems.append(Problem(path.name, "mirrored_from", message))
    return original, problems


def _document_of(stored: EpisodeRecord, record: EpisodeRecord) -> bytes:
    """The document in the file, or the document of the original if the file is a mirror image."""
    return read_bytes(stored.path) if record is stored else serialise(record.document)


def _check_scene(path: Path, record: EpisodeRecord) -> list[Problem]:
    """Whether settings and seed give the recorded scene; scenes not generated from settings always pass."""
    settings = record.scene().settings
    if settings is None:
        return []
    try:
        scene = generate(ScenarioConfig(**settings), record.seed, record.episode)
    except (ValueError, ConfigError, SceneError) as error:
        return [Problem(path.name, "settings", f"they give no scene: {error}")]
    is_equal = replace(scene, settings=settings) == record.scene()  # newer versions have more settings
    return [] if is_equal else [Problem(path.name, "scene", "settings and seed give another scene")]


def _first_difference(name: str, place: str, recorded: bytes, again: bytes) -> list[Problem]:
    """The first line in which two documents differ, apart from their software blocks."""
    if recorded == again:
        return []
    canonical = serialise(orjson.loads(recorded))  # an edited file may be formatted otherwise
    recorded_lines, new_lines = canonical.splitlines(), again.splitlines()
    for number, (old, new) in enumerate(zip(recorded_lines, new_lines, strict=False), 1):
        if old != new and not old.startswith(b'"software"'):
            return [Problem(name, place, f"line {number} differs: {_excerpts(old, new)}")]
    if len(recorded_lines) == len(new_lines):
        same = "the content is the same, but the file is not formatted as sonata2d writes it"
        return [Problem(name, place, same)] if canonical != recorded else []
    return [Problem(name, place, f"has {len(recorded_lines)} lines, should have {len(new_lines)}")]


def _excerpts(old: bytes, new: bytes) -> str:
    """The text of both lines around their first difference."""
    differences = (k for k, (a, b) in enumerate(zip(old, new, strict=False)) if a != b)
    start = next(differences, min(len(old), len(new)))
    shown = slice(max(start - 20, 0), start + 20)
    return f"recorded …{old[shown].decode(errors='replace')}…, again …{new[shown].decode(errors='replace')}…"


def _recorder_like(record: EpisodeRecord) -> EpisodeRecorder:
    """A recorder that writes the same header."""
    branched = record.document["branched_from"]
    recorder = EpisodeRecorder(
        id=record.id,
        contributor=record.contributor,
        context=record.context,
        branched_from=branched and (branched["id"], branched["tick"]),
        label_spec=record.label_spec,
    )
    recorder.label = record.label
    return recorder
