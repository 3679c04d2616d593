"""Playback of recorded runs: position and speed, the list of files, pictures and exports, and text summaries."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pygame

from ..collect.texts import text
from ..core.devices import DeviceEvent, View
from ..core.labels import LabelSpec
from ..core.scene import Scene
from ..core.snapshot import Contact, Snapshot
from ..errors import RecordError
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from ..view.annotations import value_text
from ..view.interpolation import between
from ..view.layers import Layers
from ..view.painter import Painter
from ..view.projection import Camera
from ..view.stills import save_moment
from ..view.trails import Trails
from .answer import answer_text

logger = logging.getLogger(__name__)

SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
_TRAIL = 8.0  # length of the trails, s
_MIN_ZOOM, _MAX_ZOOM = 0.5, 4.0


class Player:
    """Playback position in T frames and the final snapshot, independent of drawing.

    Args:
        record: the run.
        speed: seconds of the run per second of real time.
        playing: whether playback starts at once.
        speeds: speeds that `faster` and `slower` step through.

    Attributes:
        playing: whether time advances.
        speed: seconds of the run per second of real time.
        watched: whether the run was played to its end without a gap.
        last: index of the final snapshot, T.
        dt: time between snapshots, s.
        length: duration of the run, s.

    Raises:
        ValueError: the speed is not positive.
    """

    def __init__(
        self, record: EpisodeRecord, *, speed: float = 1.0, playing: bool = True, speeds: tuple[float, ...] = SPEEDS
    ) -> None:
        if not speed > 0.0:
            raise ValueError(f"speed is {speed}; it must be a number above 0")
        self.record, self.speed, self.playing = record, speed, playing
        self.last, self.dt, self.watched = len(record), record.scene().rules.dt, False
        self.length = self.last * self.dt
        self._speeds = speeds
        self._position = 0.0  # in ticks, 0 to T
        self._seen = 0.0  # up to here the run was played from the start without a gap, ticks
        self._snapshots: dict[int, Snapshot] = {}

    @property
    def index(self) -> int:
        """Index of the snapshot reached last, 0 to T."""
        return int(self._position)

    @property
    def time(self) -> float:
        """Time since the start of the run, s."""
        return self._position * self.dt

    @property
    def fraction(self) -> float:
        """Position as a fraction of the run, 0 to 1."""
        return self._position / self.last if self.last else 1.0

    @property
    def at_end(self) -> bool:
        """Whether the final snapshot is reached."""
        return self._position >= self.last

    @property
    def snapshot(self) -> Snapshot:
        """The snapshot reached last."""
        return self._snapshot(self.index)

    @property
    def between(self) -> tuple[Snapshot, Snapshot, float]:
        """The snapshots before and after the position, and the fraction of the way between them, 0 to 1."""
        before = self.index
        return self._snapshot(before), self._snapshot(min(before + 1, self.last)), self._position - before

    def advance(self, seconds: float) -> None:
        """Play for a span of real time; playback stops at the end."""
        if not self.playing:
            return
        before = self._position
        self._position = min(before + max(seconds, 0.0) * self.speed / self.dt, float(self.last))
        if before <= self._seen:
            self._seen = max(self._seen, self._position)
        if self.at_end:
            self.playing = False
            self.watched = self.watched or self._seen >= self.last

    def toggle(self) -> None:
        """Play or pause; at the end, play from the start."""
        if not self.playing and self.at_end:
            self._position = 0.0
        self.playing = not self.playing

    def restart(self) -> None:
        """Play from the start."""
        self._position, self.playing = 0.0, True

    def step(self, ticks: int) -> None:
        """Pause and move by snapshots; between two of them, the nearest in the direction is the first step."""
        start = self.index if ticks >= 0 or self._position == self.index else self.index + 1
        self._position = float(min(max(start + ticks, 0), self.last))
        self.playing = False

    def step_seconds(self, seconds: float) -> None:
        """Pause and move by a span of time, at least one tick."""
        ticks = max(round(abs(seconds) / self.dt), 1)
        self.step(ticks if seconds >= 0 else -ticks)

    def seek(self, fraction: float) -> None:
        """Move to the snapshot at a fraction of the run, 0 to 1; playback continues if it was on."""
        self._position = float(round(min(max(fraction, 0.0), 1.0) * self.last))

    def faster(self) -> None:
        """Select the next higher speed."""
        self.speed = next((speed for speed in self._speeds if speed > self.speed), self.speed)

    def slower(self) -> None:
        """Select the next lower speed."""
        self.speed = next((speed for speed in reversed(self._speeds) if speed < self.speed), self.speed)

    def contacts(self) -> list[float]:
        """Starts of contacts as fractions of the run, read from the document without creating snapshots."""
        document = self.record.document
        touching = [bool(state["contacts"]) for state in (*document["frames"], document["final"])]
        starts = [t for t, touches in enumerate(touching) if touches and not (t and touching[t - 1])]
        return [t / self.last if self.last else 1.0 for t in starts]

    def _snapshot(self, index: int) -> Snapshot:
        """Each snapshot is created once, at its first use."""
        if index not in self._snapshots:
            self._snapshots[index] = self.record.snapshot(index)
        return self._snapshots[index]


class Playlist:
    """Files in order, one of which is open; files that cannot be read are skipped.

    Args:
        paths: of the files.

    Attributes:
        record: the open run.
        index: of the open file, from 0.
        skipped: error of the file skipped last when the list was opened; None if there is none.

    Raises:
        RecordError: none of the files can be read; the error of the last one.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = list(paths)
        opened, skipped = self._open(0, 1)
        if opened is None:
            raise skipped[-1] if skipped else RecordError("there is no file to view; give a folder that has episodes")
        self.index, self.record = opened
        self.skipped = skipped[-1] if skipped else None

    def __len__(self) -> int:
        return len(self._paths)

    def move(self, direction: int) -> str:
        """Open the next (1) or previous (-1) readable file; returns a notice for the user, or an empty text."""
        opened, skipped = self._open(self.index + direction, direction)
        notice = text("notice.skipped", problem=skipped[-1]) if skipped else ""
        if opened is None:
            end = text("notice.last_file" if direction > 0 else "notice.first_file")
            return f"{end}; {notice}" if notice else end
        self.index, self.record = opened
        return notice

    def _open(self, index: int, direction: int) -> tuple[tuple[int, EpisodeRecord] | None, list[RecordError]]:
        """The first readable file from an index on, and the errors of the files skipped before it."""
        skipped: list[RecordError] = []
        while 0 <= index < len(self._paths):
            try:
                return (index, read_episode(self._paths[index])), skipped
            except RecordError as error:
                logger.warning("skipped: %s", error)
                skipped.append(error)
                index += direction
        return None, skipped


class Exporter:
    """Draws the moment that a player shows, on a surface or into a file.

    Args:
        player: of a recorded run.
        view: `top` (the whole room) or `follow` (above the robot, which points up).
        like: exporter of another run; its view, layers and zoom are taken over.

    Attributes:
        zones, trails: whether personal space and trails are drawn.
        zoom: scale factor, 1 by default.
    """

    def __init__(self, player: Player, *, view: View = "top", like: Exporter | None = None) -> None:
        self.player = player
        self.view: View = like.view if like else view
        self.zones: bool = like.zones if like else False
        self.trails: bool = like.trails if like else False
        self.zoom: float = like.zoom if like else 1.0
        self._painter = Painter(player.record.scene())

    @property
    def moment(self) -> Snapshot:
        """State at the player's position, interpolated between two ticks."""
        return between(*self.player.between)

    def draw(self, surface: pygame.Surface) -> Camera:
        """Draw the moment on a surface; returns the camera of the picture."""
        layers = Layers(zones=self.zones, caption=False)
        return self._painter.draw(
            surface, self.moment, view=self.view, layers=layers, zoom=self.zoom, trails=self._trails()
        )

    def switch_view(self) -> None:
        """Select the other view."""
        self.view = "top" if self.view == "follow" else "follow"

    def zoom_by(self, factor: float) -> None:
        """Multiply the zoom, within 0.5 to 4."""
        self.zoom = min(max(self.zoom * factor, _MIN_ZOOM), _MAX_ZOOM)

    def save(self, folder: Path, suffix: str) -> Path:
        """Write the moment into a folder as `.png` or `.svg`.

        Returns:
            The path of the picture.

        Raises:
            RenderError: the file cannot be written.
        """
        name = self.player.record.path.name.split(".")[0]
        path = folder / f"{name}_t{self.player.snapshot.tick:04d}{suffix}"
        layers = Layers(zones=self.zones, legend=True)
        save_moment(path, self.moment, view=self.view, layers=layers, trails=self._trails())
        return path

    def _trails(self) -> Trails | None:
        """Paths of the last seconds, from the arrays of the file."""
        if not self.trails:
            return None
        states, end = self.player.record.states, self.player.index + 1
        part = slice(max(end - round(_TRAIL / self.player.dt), 0), end)
        return Trails(states.time[part], states.robot[part, :2], states.humans[part, :, :2], is_tail=True)


# Text summaries


def playing_time(player: Player) -> str:
    """Position, length and speed of the playback."""
    time, length = f"{player.time:.1f}", f"{player.length:.1f}"
    return text("player.time", time=time, length=length, speed=f"{player.speed:g}")


def frame_summary(record: EpisodeRecord, snapshot: Snapshot, index: int) -> list[str]:
    """Command, contacts and device events of a tick, one text each.

    Args:
        record: the run.
        snapshot: the state at the tick.
        index: of the tick; T, the final snapshot, has no command.
    """
    texts = []
    if index < len(record) and "robot" not in snapshot.scene.unmeasured:
        vx, vy, omega = (f"{value:+.2f}" for value in record.command[index].tolist())
        is_sideways = bool(record.command[index, 1])
        texts.append(
            text("player.command_sideways", ahead=vx, left=vy, turn=omega)
            if is_sideways
            else text("player.command", ahead=vx, turn=omega)
        )
    if snapshot.robot.guarded:
        texts.append(text("player.guarded"))
    texts += [_contact_text(contact, snapshot.scene) for contact in snapshot.contacts]
    return texts + [_event_text(event) for event in snapshot.events]


def frame_label(record: EpisodeRecord, index: int) -> str:
    """The label of a frame as text; empty if it has none."""
    frames = record.document["frames"]
    label = frames[index].get("label") if index < len(frames) else None
    return "" if label is None else label_text(label, record.label_spec)


def run_summary(record: EpisodeRecord) -> list[tuple[str, str]]:
    """Keys of names (`player.…`) and values that describe the whole run; absent values are left out."""
    outcome, spec = record.outcome, record.label_spec
    entries = [
        ("file", record.path.name),
        ("scenario", text("player.scenario_value", name=record.family, seed=record.seed, episode=record.episode)),
        ("driven_by", record.controller_info.path),
        ("contributor", record.contributor or ""),
        (
            "outcome",
            text("player.outcome_value", status=outcome.status, reason=outcome.reason, time=f"{outcome.time:.1f}"),
        ),
        ("question", spec.question),
        ("label", "" if record.label is None else label_text(record.label, spec)),
        ("context", record.context or ""),
    ]
    return [(name, value) for name, value in entries if value]


def label_text(label: Any, spec: LabelSpec) -> str:
    """A label as text.

    >>> label_text({"label": 2}, LabelSpec("classes", classes=("poor", "fair")))
    'label: 2 fair'
    """
    if isinstance(label, dict):
        return ", ".join(f"{name}: {_value_text(v, spec if name == spec.name else None)}" for name, v in label.items())
    return _value_text(label, spec)


def _contact_text(contact: Contact, scene: Scene) -> str:
    """What the robot touches, and which of the two is at fault."""
    types = {item.id: item.type for item in scene.furniture}
    name = types.get(contact.id, "object") if contact.kind == "object" else contact.kind
    fault = {(True, False): "robot", (False, True): "other", (True, True): "both"}.get(
        (contact.robot_at_fault, contact.other_at_fault)
    )
    if fault is None:
        return text("player.touches", what=name, number=contact.id)
    return text("player.touches_fault", what=name, number=contact.id, fault=text(f"player.fault_{fault}"))


def _event_text(event: DeviceEvent) -> str:
    return f"{event.device} {event.control} {event.value:g}"


def _value_text(value: Any, spec: LabelSpec | None) -> str:
    """One value; the answer to a question in its own words."""
    if spec is not None and spec.kind != "command":
        return answer_text(value, spec)
    if isinstance(value, bool):
        return text("question.yes" if value else "question.no")
    return f"{value:.2f}" if isinstance(value, float) else value_text(value)
