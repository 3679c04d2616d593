"""Playback of a recorded run: position and speed, and the bar that shows and changes the position."""

from __future__ import annotations

import pygame

from ..collect.texts import text
from ..core.snapshot import Snapshot
from ..record.record import EpisodeRecord
from ..view.interpolation import between
from ..view.palette import BLUE, GRID, PAPER, VERMILLION
from ..view.trails import Trails
from .widgets import Drag

_SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
_TRAIL = 8.0  # length of the trails, s


class Player:
    """Playback position in T frames and the final snapshot, independent of drawing.

    Args:
        record: the run.
        speed: seconds of the run per second of real time.
        speeds: speeds that `faster` and `slower` step through.

    Attributes:
        playing: whether time advances.
        speed: seconds of the run per second of real time.
        watched: whether the run was played to its end without a gap.
        last: index of the final snapshot, T.
        dt: time between snapshots, s.

    Raises:
        ValueError: the speed is not positive.
    """

    def __init__(self, record: EpisodeRecord, *, speed: float = 1.0, speeds: tuple[float, ...] = _SPEEDS) -> None:
        if not speed > 0.0:
            raise ValueError(f"speed is {speed}; it must be a number above 0")
        self.record, self.speed, self.playing = record, speed, True
        self.last, self.dt, self.watched = len(record), record.scene().rules.dt, False
        self._speeds = speeds
        self._position = 0.0  # in ticks, 0 to T
        self._seen = 0.0  # up to here the run was played from the start without a gap, ticks
        self._snapshots: dict[int, Snapshot] = {}

    @property
    def index(self) -> int:
        """Index of the snapshot reached last, 0 to T."""
        return int(self._position)

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
    def moment(self) -> Snapshot:
        """State at the position, interpolated between two snapshots."""
        before = self.index
        after = self._snapshot(min(before + 1, self.last))
        return between(self._snapshot(before), after, self._position - before)

    @property
    def trails(self) -> Trails:
        """Paths of the last seconds, from the arrays of the file."""
        states, end = self.record.states, self.index + 1
        part = slice(max(end - round(_TRAIL / self.dt), 0), end)
        positions = states.robot[part, :2], states.humans[part, :, :2]
        return Trails(states.time[part], *positions, is_tail=True, robots=states.robots[part, :, :2])

    @property
    def time_text(self) -> str:
        """Position, length and speed of the playback as text."""
        time, length = f"{self._position * self.dt:.1f}", f"{self.last * self.dt:.1f}"
        return text("player.time", time=time, length=length, speed=f"{self.speed:g}")

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


class Timeline:
    """Progress bar of a played run, which can be dragged.

    Args:
        player: of the run.
        box: px.
        scale: of the bar and its marks.
        draggable: whether the mouse moves it.
        show_contacts: whether the starts of contacts are marked.
    """

    def __init__(
        self, player: Player, box: pygame.Rect, *, scale: float, draggable: bool = True, show_contacts: bool = True
    ) -> None:
        self.player, self.box, self.draggable, self._unit = player, box, draggable, scale
        self._marks = player.contacts() if show_contacts else []
        self._drag = Drag(box, box.inflate(12, 8), player.seek)

    def handle(self, event: pygame.Event) -> bool:
        """Process an event; returns True if the timeline has used it."""
        return self.draggable and self._drag.handle(event)

    def draw(self, surface: pygame.Surface) -> None:
        box, u = self.box, self._unit
        x, y = box.left + round(self.player.fraction * box.width), box.centery
        half, corner = round(3 * u), round(3 * u)
        track = pygame.Rect(box.left, y - half, box.width, 2 * half)
        pygame.draw.rect(surface, GRID, track, border_radius=corner)
        pygame.draw.rect(surface, BLUE, (box.left, y - half, x - box.left, 2 * half), border_radius=corner)
        for mark in self._marks:
            at = box.left + round(mark * box.width)
            pygame.draw.line(surface, VERMILLION, (at, y - 4 * u), (at, y + 4 * u), max(round(2 * u), 1))
            pygame.draw.polygon(
                surface, VERMILLION, [(at, y - 5 * u), (at - 4 * u, y - 11 * u), (at + 4 * u, y - 11 * u)]
            )
        if self.draggable:
            pygame.draw.circle(surface, PAPER, (x, y), 9 * u)
            pygame.draw.aacircle(surface, BLUE, (x, y), 9 * u, max(round(3 * u), 1))
