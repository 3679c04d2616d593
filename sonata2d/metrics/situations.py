"""The canonical situations: whether one took place in an episode, and how often a scenario brings it about.

Source of the situations: Francis et al., Principles and Guidelines for Evaluating Social Robot Navigation Algorithms,
ACM Trans. Hum.-Robot Interact. 14 (2025), arXiv 2306.16740, section on scenarios. The thresholds are ours.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ..agents.controllers.base import Controller
from ..core.proxemics import SOCIAL_DISTANCE
from ..core.scene import Scene
from ..core.snapshot import Author, Frame, Outcome, Snapshot
from ..errors import ConfigError
from ..record.record import EpisodeRecord
from ..registry import did_you_mean
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..sim.episode import Episode, Renderer
from .encounters import HEAD_ON, SAME_WAY, Encounter, Kind, Meeting, encounter

MET = 2.0  # m, between outlines: nearer is a meeting
SUDDEN = 5.0  # m, between centres: who comes in sight at less was hidden by a corner
CROSSED = 4.0  # s, by which two may miss each other where their ways cross
CROWD, CROWDED = 3, 0.1  # people near the robot on average; people per m2


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a situation took place, and what was seen of it."""

    took_place: bool
    told: str


def judge(situation: str, episode: EpisodeRecord | Iterable[Snapshot]) -> Verdict:
    """Whether the situation of this name took place in an episode.

    Raises:
        ConfigError: there is no such situation.
    """
    return SITUATIONS[named(situation)](encounter(episode))


def named(situation: str) -> str:
    """The name, if there is such a situation.

    Raises:
        ConfigError: there is none.
    """
    if situation not in SITUATIONS:
        hint = did_you_mean(situation, SITUATIONS)
        raise ConfigError(f"no situation is named {situation!r}; situations are {', '.join(SITUATIONS)}{hint}")
    return situation


def rehearse(
    config: ScenarioConfig,
    situation: str,
    controller: Controller,
    *,
    seed: int = 0,
    episode: int = 0,
    renderer: Renderer | None = None,
) -> Verdict:
    """Run one episode of a scenario, and judge whether a situation took place.

    Args:
        renderer: for a controller that asks for a camera image.

    Raises:
        ConfigError: there is no such situation.
        SceneError: the scenario cannot be laid out.
    """
    looks = Looker()
    Episode(generate(config, seed, episode), controller, observers=[looks], renderer=renderer).run()
    return judge(situation, looks.snapshots)


class Looker:
    """An observer that keeps every look of an episode, the final one too."""

    def __init__(self) -> None:
        self.snapshots: list[Snapshot] = []

    def open(self, scene: Scene, author: Author) -> None:
        """An episode begins."""
        self.snapshots = []

    def note(self, frame: Frame) -> None:
        """One tick."""
        self.snapshots.append(frame.snapshot)

    def close(self, last: Snapshot, outcome: Outcome) -> None:
        """It is over."""
        self.snapshots.append(last)


def _met(what: str, kind: Kind) -> Callable[[Encounter], Verdict]:
    """A situation that is a meeting of a kind, in sight of each other from the start."""

    def verdict(seen: Encounter) -> Verdict:
        return _found(seen, what, lambda m: m.kind == kind and m.gap < MET and m.sight is None)

    return verdict


def _intersection(seen: Encounter) -> Verdict:
    def crosses(m: Meeting) -> bool:
        return m.missed is not None and m.missed < CROSSED and SAME_WAY < m.angle < HEAD_ON

    return _found(seen, "crossed the robot's way", lambda m: m.gap < MET and crosses(m))


def _blind_corner(seen: Encounter) -> Verdict:
    return _found(
        seen, "came in sight only close by", lambda m: m.sight is not None and m.sight < SUDDEN and m.gap < MET
    )


def _narrow_doorway(seen: Encounter) -> Verdict:
    return _found(seen, "came through a narrow doorway that the robot was at", lambda m: m.at_door is not None)


def _found(seen: Encounter, what: str, fits: Callable[[Meeting], bool]) -> Verdict:
    for one in seen.meetings:
        if fits(one):
            seen_at = "" if one.sight is None else f", first seen at {one.sight:.1f} m"
            door = "" if one.at_door is None else f", doorway {one.at_door:.2f} m"
            where = f"{one.gap:.2f} m off, on the {one.side}"
            return Verdict(True, f"person {one.person} {what}: nearest at {one.time:.1f} s, {where}{seen_at}{door}")
    nearest = "; ".join(f"person {m.person} {m.kind}, {m.gap:.1f} m off" for m in seen.meetings[:2])
    return Verdict(False, f"nobody {what} ({nearest or 'there is nobody'})")


def _crossing_a_group(seen: Encounter) -> Verdict:
    for one in seen.groups:
        if one.in_the_way and one.nearest < one.reach + SOCIAL_DISTANCE / 2:
            cut = "through" if one.nearest < one.reach else "round"
            return Verdict(True, f"group {one.group} was in the way; the robot went {cut} it, {one.nearest:.2f} m off")
    return Verdict(False, "no group was in the robot's straight way and near to it")


def _joining_a_group(seen: Encounter) -> Verdict:
    for one in seen.groups:
        if one.joined:
            return Verdict(True, f"in the end the robot stands with group {one.group}")
    nearest = min((one.nearest for one in seen.groups), default=None)
    return Verdict(False, "there is no group" if nearest is None else f"the robot came no nearer than {nearest:.2f} m")


def _crowded_hall(seen: Encounter) -> Verdict:
    told = f"{seen.company:.1f} people near the robot on average, {seen.density:.2f} per m2 in the room"
    return Verdict(seen.company >= CROWD and seen.density >= CROWDED, told)


SITUATIONS: dict[str, Callable[[Encounter], Verdict]] = {
    "frontal-approach": _met("came the other way", "head-on"),
    "overtaking": _met("was overtaken by the robot", "overtaking"),
    "being-overtaken": _met("overtook the robot", "overtaken"),
    "intersection": _intersection,
    "blind-corner": _blind_corner,
    "narrow-doorway": _narrow_doorway,
    "crossing-a-group": _crossing_a_group,
    "joining-a-group": _joining_a_group,
    "crowded-hall": _crowded_hall,
}
