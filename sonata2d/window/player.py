"""A recorded run as a film: where it stands, how fast it goes, which two looks are to be mixed."""

from __future__ import annotations

from ..core.snapshot import Snapshot
from ..record.record import EpisodeRecord

SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
Between = tuple[Snapshot, Snapshot, float]  # before, after, and how far on from one to the other, 0 to 1


class Player:
    """Plays T frames and the final look; knows nothing of pixels.

    Args:
        record: the run.
        speed: seconds of the run in a second.
        playing: whether it runs at once.
        speeds: those that `faster` and `slower` go through.

    Attributes:
        playing: whether time goes on.
        speed: seconds of the run in a second.
        watched: whether it was played to its end without leaving anything out.
    """

    def __init__(
        self,
        record: EpisodeRecord,
        *,
        speed: float = 1.0,
        playing: bool = True,
        speeds: tuple[float, ...] = SPEEDS,
    ) -> None:
        if not speed > 0.0:
            raise ValueError(f"speed is {speed}; it is a number above 0")
        self.record, self.speed, self.playing = record, speed, playing
        self.watched = False
        self._speeds = speeds
        self._place = 0.0  # in ticks, 0 to T
        self._seen = 0.0  # as far as it was watched from the start without a leap
        self._looks: dict[int, Snapshot] = {}

    @property
    def last(self) -> int:
        """Index of the final look, T."""
        return len(self.record)

    @property
    def dt(self) -> float:
        """s, from look to look."""
        return self.record.scene().rules.dt

    @property
    def index(self) -> int:
        """Of the look that was reached last, 0 to T."""
        return int(self._place)

    @property
    def time(self) -> float:
        """s since the start."""
        return self._place * self.dt

    @property
    def length(self) -> float:
        """s, of the whole run."""
        return self.last * self.dt

    @property
    def share(self) -> float:
        """How much of the run has gone by, 0 to 1."""
        return self._place / self.last if self.last else 1.0

    @property
    def at_end(self) -> bool:
        return self._place >= self.last

    @property
    def look(self) -> Snapshot:
        """The look that was reached last."""
        return self._look(self.index)

    @property
    def between(self) -> Between:
        """The looks before and after the present moment, and how far it lies between them."""
        before = self.index
        return self._look(before), self._look(min(before + 1, self.last)), self._place - before

    def advance(self, seconds: float) -> None:
        """So much real time has passed; at the end it stops."""
        if not self.playing:
            return
        before = self._place
        self._place = min(before + max(seconds, 0.0) * self.speed / self.dt, float(self.last))
        if before <= self._seen:
            self._seen = max(self._seen, self._place)
        if self.at_end:
            self.playing = False
            self.watched = self.watched or self._seen >= self.last

    def toggle(self) -> None:
        """Play or pause; at the end, play again from the start."""
        if not self.playing and self.at_end:
            self._place = 0.0
        self.playing = not self.playing

    def restart(self) -> None:
        """From the start, playing."""
        self._place, self.playing = 0.0, True

    def step(self, ticks: int) -> None:
        """So many looks on, or back, and pause; between two looks, the nearest in that direction is the first step."""
        place = self.index if ticks >= 0 or self._place == self.index else self.index + 1
        self._place = float(min(max(place + ticks, 0), self.last))
        self.playing = False

    def step_seconds(self, seconds: float) -> None:
        """The same by time, a tick at least."""
        ticks = max(round(abs(seconds) / self.dt), 1)
        self.step(ticks if seconds >= 0 else -ticks)

    def seek(self, share: float) -> None:
        """Go to the look that lies there, 0 the first to 1 the final one; it plays on if it was playing."""
        self._place = float(round(min(max(share, 0.0), 1.0) * self.last))

    def faster(self) -> None:
        """The next speed."""
        self.speed = next((speed for speed in self._speeds if speed > self.speed), self.speed)

    def slower(self) -> None:
        """The one before it."""
        self.speed = next((speed for speed in reversed(self._speeds) if speed < self.speed), self.speed)

    def contacts(self) -> list[float]:
        """Where contacts begin, as shares of the run; the file is asked, no look is made."""
        document = self.record.document
        told = [bool(look["contacts"]) for look in (*document["frames"], document["final"])]
        begins = [t for t, touches in enumerate(told) if touches and not (t and told[t - 1])]
        return [t / self.last if self.last else 1.0 for t in begins]

    def _look(self, index: int) -> Snapshot:
        """Each look is made once, when it is first asked for."""
        if index not in self._looks:
            self._looks[index] = self.record.snapshot(index)
        return self._looks[index]
