"""Contacts, and commands beyond the robot's limits, in all episodes of a data set: sums over the rows of a manifest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..core.wording import counted
from ..record.counts import ANY_KIND, CONTACT_KINDS

_WARNING_SHARE = 0.5  # of the frames
_UNITS = {"vx": "m/s", "vy": "m/s", "omega": "rad/s"}


@dataclass(frozen=True, slots=True)
class Contacts:
    """Contacts of the robot with one kind of outline, or with any.

    Attributes:
        episodes: number of episodes with such a contact.
        frames: number of frames with such a contact.
        robot_at_fault, other_at_fault: number of these frames in which that side closes the gap; both can, or neither.
    """

    episodes: int
    frames: int
    robot_at_fault: int
    other_at_fault: int


@dataclass(frozen=True, slots=True)
class ContactSummary:
    """Contacts of the robot in several episodes.

    Attributes:
        episodes, frames: number of episodes whose contacts are counted, and of their frames.
        uncounted_episodes: number of the other episodes: imported ones.
        by_kind: contacts with any outline, a human, an object, a wall or a robot; kinds without a contact are left out.
    """

    episodes: int
    frames: int
    uncounted_episodes: int
    by_kind: dict[str, Contacts]

    def rows(self) -> list[tuple[str, str]]:
        """The summary as names and texts: all contacts, then each kind."""
        return [
            ("contacts", self._total_text()),
            *(self._kind_row(kind) for kind in CONTACT_KINDS if kind in self.by_kind),
        ]

    def _total_text(self) -> str:
        parts = ["none"] if self.episodes and not self.by_kind else []
        if self.by_kind:
            total = self.by_kind[ANY_KIND]
            parts = [
                f"in {total.episodes} of {counted(self.episodes, 'episode')}, {self.share(total.frames)} of the frames"
            ]
        if self.uncounted_episodes:
            parts.append(f"not counted in {counted(self.uncounted_episodes, 'episode')}")
        return "; ".join(parts)

    def share(self, frames: int) -> str:
        """A number of frames as a percentage of all counted frames; a contact never shows as 0 %."""
        return _percentage(frames / max(self.frames, 1))

    def _kind_row(self, kind: str) -> tuple[str, str]:
        contacts = self.by_kind[kind]
        text = f"in {counted(contacts.episodes, 'episode')}, {self.share(contacts.frames)} of the frames"
        faults = {"robot": contacts.robot_at_fault, "other": contacts.other_at_fault}
        at_fault = [f"{side} at fault in {self.share(frames)}" for side, frames in faults.items() if frames]
        return f"  with {'an' if kind == 'object' else 'a'} {kind}", "; ".join([text, *at_fault])


@dataclass(frozen=True, slots=True)
class ExcessiveCommands:
    """Commands of one component beyond the limits of the robot's drive; `str` gives them as text.

    Attributes:
        component: vx, vy or omega.
        frames: number of frames with such a command.
        share: these frames as a fraction of all counted frames, to four digits.
        command, limit: the command that exceeds its limit most, and that limit; m/s or rad/s.
    """

    component: str
    frames: int
    share: float
    command: float
    limit: float

    def __str__(self) -> str:
        limit = f"limit {self.limit:g} {_UNITS[self.component]}"
        if self.limit == 0.0:
            limit = "the drive does not move sideways"
        excess = f"{self.component} up to {self.command:g} {_UNITS[self.component]} ({limit})"
        return f"{excess} in {_percentage(self.share)} of the frames"


def _percentage(fraction: float) -> str:
    """A fraction as a percentage; what exists never shows as 0 %."""
    return f"{100.0 * fraction:.1f} %" if fraction >= 0.0005 or fraction == 0.0 else "<0.1 %"


def commands_warning(rows: Iterable[Mapping[str, Any]], name: str) -> str | None:
    """A warning if most commands of a controller are beyond the limits of the robot's drive; else None.

    Fewer are usual: a controller whose command is proportional to an error exceeds the limits while that is large.

    Args:
        rows: as for `totals_of`.
        name: of the controller.
    """
    excess = [command for command in totals_of(rows).excess if command.share > _WARNING_SHARE]
    if not excess:
        return None
    return f"{name}: commands exceed the limits of the drive, which executes less: {', '.join(map(str, excess))}"


@dataclass(frozen=True, slots=True)
class _Totals:
    """Sums over the rows of a manifest, which are read once.

    Attributes:
        episodes, frames, bytes: number of rows, and sums over them.
        contacts: of the robot.
        excess: commands beyond the limits of the robot's drive, by component; empty if there are none.
    """

    episodes: int
    frames: int
    bytes: int
    contacts: ContactSummary
    excess: list[ExcessiveCommands]


def totals_of(rows: Iterable[Mapping[str, Any]]) -> _Totals:
    """Sums over the files in a manifest.

    Args:
        rows: of the files, with the key `ticks`. Without `contacts` or `commands_beyond_limits` an episode does not
            count there; without `bytes` its size is 0.
    """
    episodes = frames = size = 0
    known_in = {"contacts": [0, 0], "commands_beyond_limits": [0, 0]}  # episodes, frames
    contacts: dict[str, list[int]] = {}
    commands: dict[str, tuple[int, float, float]] = {}  # frames, command and limit
    for row in rows:
        episodes, frames, size = episodes + 1, frames + row["ticks"], size + row.get("bytes", 0)
        for key, sums in known_in.items():
            if row.get(key) is not None:
                sums[0], sums[1] = sums[0] + 1, sums[1] + row["ticks"]
        for kind, contact in (row.get("contacts") or {}).items():
            known = contacts.setdefault(kind, [0, 0, 0, 0])
            for k, number in enumerate((1, contact["frames"], contact["robot_at_fault"], contact["other_at_fault"])):
                known[k] += number
        for component, excess in (row.get("commands_beyond_limits") or {}).items():
            number, command, limit = commands.get(component, (0, excess["command"], excess["limit"]))
            if abs(excess["command"] - excess["limit"]) > abs(command - limit):
                command, limit = excess["command"], excess["limit"]
            commands[component] = number + excess["frames"], command, limit
    with_contacts, contact_frames = known_in["contacts"]
    by_kind = {kind: Contacts(*contacts[kind]) for kind in (ANY_KIND, *CONTACT_KINDS) if kind in contacts}
    summary = ContactSummary(with_contacts, contact_frames, episodes - with_contacts, by_kind)
    commands_beyond = []
    for component in _UNITS:
        if component in commands:
            number, command, limit = commands[component]
            share = number / max(known_in["commands_beyond_limits"][1], 1)
            share = max(round(share, 4), 0.0001)  # as precise as it is shown; what exists is never 0
            commands_beyond.append(ExcessiveCommands(component, number, share, command, limit))
    return _Totals(episodes, frames, size, summary, commands_beyond)
