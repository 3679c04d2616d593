"""A recorded file run again, to prove it, or branched, to see what another controller would have done."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from ..agents.controllers.base import Controller
from ..agents.controllers.loading import load_controller
from ..core.geometry import Twist
from ..core.snapshot import Observer, Snapshot
from ..errors import ControllerError, RecordError, SceneError
from ..record.canonical import written
from ..record.files import read_bytes
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from ..record.recorder import EpisodeRecorder
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..sim.episode import Episode, Moment, author_of, renderer_for
from ..version import PHYSICS_VERSION
from .check import Problem
from .mirror import mirrored


class _Nobody(Controller):
    """Drives when the recording is over and the episode is not: never."""

    def act(self, snapshot: Snapshot) -> Twist:
        raise ControllerError("the recorded commands end before the episode does")


def branch(path: str | Path, tick: int, controller: Controller, *, observers: Iterable[Observer] = ()) -> Episode:
    """A recorded episode up to `tick`, to the bit, then driven by another controller.

    Args:
        path: an episode file.
        tick: how many ticks stay as they were.
        controller: drives from there on.
        observers: see the branch from its tick 0 on.

    Raises:
        RecordError: the file cannot be read, or is a mirror image, which would go another way from its first choice.
        ValueError: the recording has no such tick.
    """
    record = read_episode(path)
    if record.document.get("mirrored_from"):
        raise RecordError(f"{path} is a mirror image, which does not run again; branch its original and mirror that")
    past = moments(record)
    if not 0 <= tick <= len(past):
        raise ValueError(f"tick must be 0..{len(past)}, the ticks in {path}, got {tick}")
    eye = renderer_for(controller)
    return Episode(record.scene(), controller, observers=observers, past=past[:tick], renderer=eye).caught_up()


def moments(record: EpisodeRecord) -> list[Moment]:
    """Command, label and device events of each recorded tick."""
    return [Moment(frame.command, frame.label, frame.snapshot.events) for frame in record.frames()]


def replayed(record: EpisodeRecord) -> bytes:
    """The document that the recorded commands give when they are run again."""
    recorder, past, outcome = _recorder_like(record), moments(record), record.outcome
    episode = Episode(record.scene(), _Nobody(), observers=[recorder], past=past, author=record.author).caught_up()
    last = record.snapshot(-1).events
    if outcome.status in ("stopped", "regenerate", "error"):
        episode.end(outcome.status, outcome.reason, last)
    else:
        episode.step(last)
    return recorder.document()


def rerun(record: EpisodeRecord, controller: Controller) -> bytes:
    """The document that the controller gives when it is asked again."""
    recorder, author = _recorder_like(record), author_of(controller, record.author.path)
    branched, told = record.document["branched_from"], moments(record)
    past = told[: branched["tick"]] if branched else []  # up to there another one drove
    eye = renderer_for(controller)
    episode = Episode(record.scene(), controller, observers=[recorder], past=past, author=author, renderer=eye)
    try:
        for events in (*(moment.events for moment in told), record.snapshot(-1).events):
            episode.step(events)
        episode.run()
    except Exception:
        if record.outcome.status != "error":
            raise
    return recorder.document()


def check_replay(path: Path) -> list[Problem]:
    """Whether a file is what its scene and its commands give, and its scene what its seed and settings give.

    Of a mirror image it is proven that it is the exact image of such an episode: people's choices on their way are
    drawn from the seed, so that an image, run by itself, would go another way.
    """
    record, problems = _original(path)
    physics = record.document["physics"]
    if physics != PHYSICS_VERSION:
        message = f"made by physics version {physics}, this sonata2d has {PHYSICS_VERSION}; it cannot be replayed"
        return [Problem(path.name, "physics", message)]
    problems += _check_scene(path, record)
    try:
        again = replayed(record)
    except (ControllerError, ValueError) as error:
        return [*problems, Problem(path.name, "replay", str(error))]
    return problems + _difference(path.name, "replay", _document_of(path, record), again)


def check_rerun(path: Path, name: str | None = None) -> list[Problem]:
    """Whether the controller drives the same again; of a mirror image, whether it drove the original.

    Args:
        path: an episode file.
        name: of the controller, if it is no longer found by what the file says.
    """
    record, _ = _original(path)
    if (record.path != path) and read_episode(path).document["mirrored_from"]["labels"]:
        message = "its labels were mirrored, by what it does not tell: mirror it back (--labels twist) and check that"
        return [Problem(path.name, "rerun", message)]
    controller = load_controller(name or record.author.path, record.author.settings or {})
    if not controller.deterministic:
        return []
    return _difference(path.name, "rerun", _document_of(path, record), rerun(record, controller))


def _original(path: Path) -> tuple[EpisodeRecord, list[Problem]]:
    """The episode of a file, or the one that it is the mirror image of; and why it is no exact image, if so."""
    record = read_episode(path)
    told = record.document.get("mirrored_from")
    if not told:
        return record, []
    original = mirrored(record)
    document = written(original.document)
    problems = _difference(path.name, "mirrored_from", read_bytes(path), written(mirrored(original).document))
    if told["labels"]:
        problems = []
    elif hashlib.sha256(document).hexdigest() != told["sha256"]:
        message = f"mirrored back it is not {told['id']} as it was (another SHA-256)"
        problems.append(Problem(path.name, "mirrored_from", message))
    return original, problems


def _document_of(path: Path, record: EpisodeRecord) -> bytes:
    """The file's own bytes; of a mirror image those of its original."""
    return read_bytes(path) if record.path == path else written(record.document)


def _check_scene(path: Path, record: EpisodeRecord) -> list[Problem]:
    """Whether settings and seed give the recorded scene; scenes made by hand have none."""
    settings = record.scene().settings
    if settings is None:
        return []
    try:
        again = generate(ScenarioConfig(**settings), record.seed, record.episode)
    except (ValueError, SceneError) as error:
        return [Problem(path.name, "settings", f"they give no scene: {error}")]
    same = replace(again, settings=settings) == record.scene()  # newer versions have more settings
    return [] if same else [Problem(path.name, "scene", "settings and seed give another one")]


def _difference(name: str, place: str, recorded: bytes, again: bytes) -> list[Problem]:
    """Where two documents part, all but their software blocks; nothing if they are the same bytes."""
    old, new = recorded.splitlines(), again.splitlines()
    for number, (was, now) in enumerate(zip(old, new, strict=False), 1):
        if was != now and not was.startswith(b'"software"'):
            return [Problem(name, place, f"line {number} differs: {_around(was, now)}")]
    return [] if len(old) == len(new) else [Problem(name, place, f"has {len(old)} lines, should have {len(new)}")]


def _around(was: bytes, now: bytes) -> str:
    """What stands where two lines part."""
    part = next(
        (k for k, pair in enumerate(zip(was, now, strict=False)) if pair[0] != pair[1]), min(len(was), len(now))
    )
    shown = slice(max(part - 20, 0), part + 20)
    return f"recorded …{was[shown].decode(errors='replace')}…, again …{now[shown].decode(errors='replace')}…"


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
