"""Real time and ticks: the world lives by ticks, however quick or slow the window is."""

from __future__ import annotations

from collections.abc import Iterable

from ..collect.session import Session
from ..core.devices import DeviceEvent
from .hands import Hands

MOST = 3  # ticks in one picture, to catch up; what lags more is dropped, and counted


class Pace:
    """Drives a session on as real time passes. The hands are looked at once a tick, so that no tap is lost.

    Args:
        session: what is driven.
        hands: what drives.

    Attributes:
        lag: s of real time that the world has not lived through yet.
    """

    def __init__(self, session: Session, hands: Hands) -> None:
        self._session, self._hands = session, hands
        self._untold = list(hands.held())  # what the next tick hears of, besides what the hands tell by then
        self.lag = 0.0

    @property
    def share(self) -> float:
        """How far the picture is on its way from the session's look before to the one after, 0..1."""
        return min(self.lag / self._session.after.dt, 1.0) if self._session.state == "driving" else 1.0

    def tell(self, events: Iterable[DeviceEvent]) -> None:
        """What else the next tick shall hear of."""
        self._untold += events

    def stirs(self) -> bool:
        """While nothing moves: whether a hand drives now. The tick that follows hears of all that was done."""
        events = self._hands.look()
        self.tell(events)
        return self._hands.is_input(events)

    def start(self) -> None:
        """Begin, or go on, at once."""
        self.lag = 0.0
        self._tick()

    def live(self, seconds: float) -> None:
        """So much real time has passed while driving."""
        session, dt = self._session, self._session.after.dt
        self.lag += seconds
        for _ in range(MOST):
            if self.lag < dt or session.state != "driving":
                return
            self.lag -= dt
            self.tell(self._hands.look())
            self._tick()
        dropped = int(self.lag / dt)
        self.lag -= dropped * dt
        session.dropped += dropped

    def _tick(self) -> None:
        last = {(event.device, event.control): event for event in self._untold}  # one event a control and tick
        self._untold = []
        self._session.tick(tuple(last.values()))
