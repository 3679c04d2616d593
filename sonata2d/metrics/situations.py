"""The canonical situations of social navigation: whether an episode shows one, and whether a scenario produces it.

Source: Francis et al., Principles and Guidelines for Evaluating Social Robot Navigation Algorithms, ACM Trans.
Hum.-Robot Interact. 14 (2025), arXiv 2306.16740, section on scenarios. The thresholds are ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from ..agents.controllers.base import Controller
from ..agents.sensors.base import Renderer
from ..core.proxemics import SOCIAL_DISTANCE
from ..errors import ConfigError
from ..record.record import EpisodeRecord
from ..record.recorder import EpisodeRecorder
from ..registry import did_you_mean
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..sim.episode import Episode
from .encounters import HEAD_ON_ANGLE, SAME_WAY_ANGLE, Encounter, Kind, Meeting, encounter

_MEETING_CLEARANCE = 2.0  # m, between outlines; a larger clearance is not a meeting
_SUDDEN_DISTANCE = 5.0  # m, between centres; a human first seen nearer than this was hidden by a corner
_MAX_CROSSING_DELAY = 4.0  # s, between the passages of robot and human where their paths cross
_CROWD_NEIGHBOURS, _CROWD_DENSITY = 3, 0.1  # mean number of humans near the robot; humans per m²


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a situation took place, and a description of the encounter that decided."""

    took_place: bool
    description: str


def judge(situation: str, record: EpisodeRecord) -> Verdict:
    """Decide whether a situation took place in an episode.

    Args:
        situation: a key of `SITUATIONS`.
        record: the episode; of one that is run in memory, `EpisodeRecorder.record()`.

    Raises:
        ConfigError: the situation is unknown.
    """
    check_situation(situation)
    return SITUATIONS[situation](encounter(record))


def check_situation(situation: str) -> None:
    """Check that a situation of this name exists.

    Raises:
        ConfigError: the situation is unknown.
    """
    if situation not in SITUATIONS:
        hint = did_you_mean(situation, SITUATIONS)
        raise ConfigError(f"no situation is named {situation!r}; situations are {', '.join(SITUATIONS)}{hint}")


def rehearse(
    config: ScenarioConfig,
    situation: str,
    controller: Controller,
    *,
    seed: int = 0,
    episode: int = 0,
    renderer: Renderer | None = None,
) -> Verdict:
    """Run one episode of a scenario and decide whether a situation took place.

    Args:
        config: the scenario.
        situation: a key of `SITUATIONS`.
        controller: drives the robot.
        seed, episode: seed of the scenario and number of the episode.
        renderer: makes images for a controller that requests them.

    Raises:
        ConfigError: the situation is unknown.
        SceneError: no scene of the scenario can be generated.
    """
    recorder = EpisodeRecorder()
    Episode(generate(config, seed, episode), controller, observers=[recorder], renderer=renderer).run()
    return judge(situation, recorder.record())


def _first_match(description: str, matches: Callable[[Meeting], bool], encounter: Encounter) -> Verdict:
    """The verdict for situations in which one meeting decides."""
    for m in encounter.meetings:
        if matches(m):
            sight = "" if m.sight_distance is None else f", first seen at {m.sight_distance:.1f} m"
            door = "" if m.door_width is None else f", doorway {m.door_width:.2f} m wide"
            nearest = f"nearest at {m.time:.1f} s, clearance {m.clearance:.2f} m on the {m.side}"
            return Verdict(True, f"person {m.person} {description}: {nearest}{sight}{door}")
    nearest = "; ".join(f"person {m.person} {m.kind}, clearance {m.clearance:.1f} m" for m in encounter.meetings[:2])
    return Verdict(False, f"no person {description} ({nearest or 'there are no people'})")


def _is_in_sight(kind: Kind, meeting: Meeting) -> bool:
    """Whether a meeting is of a kind, with robot and human in sight of each other from the start."""
    return meeting.kind == kind and meeting.clearance < _MEETING_CLEARANCE and meeting.sight_distance is None


def _crosses(meeting: Meeting) -> bool:
    if meeting.crossing_delay is None or meeting.door_width is not None:  # paths through one doorway often cross
        return False
    is_near = meeting.crossing_delay < _MAX_CROSSING_DELAY and meeting.clearance < _MEETING_CLEARANCE
    return is_near and SAME_WAY_ANGLE < meeting.angle < HEAD_ON_ANGLE


def _appears(meeting: Meeting) -> bool:
    is_sudden = meeting.sight_distance is not None and meeting.sight_distance < _SUDDEN_DISTANCE
    return is_sudden and meeting.clearance < _MEETING_CLEARANCE


def _passes_a_door(meeting: Meeting) -> bool:
    return meeting.door_width is not None


def _crossing_a_group(encounter: Encounter) -> Verdict:
    for m in encounter.groups:
        if m.blocks_path and m.distance < m.radius + SOCIAL_DISTANCE / 2:
            path = "through" if m.distance < m.radius else "around"
            description = f"group {m.group} was on the straight path; the robot went {path} it at {m.distance:.2f} m"
            return Verdict(True, description)
    return Verdict(False, "no group was on the robot's straight path and near the robot")


def _joining_a_group(encounter: Encounter) -> Verdict:
    for m in encounter.groups:
        if m.joined:
            return Verdict(True, f"the robot stands with group {m.group} at the end")
    nearest = min((m.distance for m in encounter.groups), default=None)
    description = "there is no group" if nearest is None else f"the robot stayed {nearest:.2f} m or more from groups"
    return Verdict(False, description)


def _crowded_hall(encounter: Encounter) -> Verdict:
    people, density = encounter.neighbours, encounter.density
    description = f"on average {people:.1f} people near the robot, {density:.2f} per m² of the room"
    return Verdict(people >= _CROWD_NEIGHBOURS and density >= _CROWD_DENSITY, description)


SITUATIONS: dict[str, Callable[[Encounter], Verdict]] = {
    "frontal-approach": partial(_first_match, "came towards the robot", partial(_is_in_sight, "head-on")),
    "overtaking": partial(_first_match, "was overtaken by the robot", partial(_is_in_sight, "overtaking")),
    "being-overtaken": partial(_first_match, "overtook the robot", partial(_is_in_sight, "overtaken")),
    "intersection": partial(_first_match, "crossed the robot's path", _crosses),
    "blind-corner": partial(_first_match, "came into sight at a short distance", _appears),
    "narrow-doorway": partial(
        _first_match, "came to a narrow doorway with the robot on the other side", _passes_a_door
    ),
    "crossing-a-group": _crossing_a_group,
    "joining-a-group": _joining_a_group,
    "crowded-hall": _crowded_hall,
}
