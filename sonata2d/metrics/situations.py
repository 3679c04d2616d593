"""The canonical situations of social navigation: whether an episode shows one, and whether a scenario produces it.

Source: Francis et al., Principles and Guidelines for Evaluating Social Robot Navigation Algorithms, ACM Trans.
Hum.-Robot Interact. 14 (2025), arXiv 2306.16740, section on scenarios. The thresholds are ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..agents.controllers.base import Controller
from ..agents.sensors.base import Renderer
from ..core.geometry import Barriers, inside_rings
from ..core.proxemics import SOCIAL_DISTANCE
from ..core.vectors import lengths
from ..core.wording import counted
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
_IN_THE_WAY = 0.6  # m, of a standing person from the straight path
_WITHIN_SIGHT = 6.0  # m, of a person who walks the same way
_NARROW = 1.8  # m, width of a narrow hallway
_DOOR_AUDIENCE = 5.0  # m, of people beyond a door from the robot that passes it
_GESTURE_DELAY = 6.0  # s, between the passages of robot and human where one lets the other one go first
_STROLL, _COMPANY_TIME, _COMPANY_SHARE = 0.1, 5.0, 0.6  # m/s; s; share of the time
_JOINED, _LEFT = 0.4, 1.0  # m, beyond the circle of a group
_TRAFFIC, _CIRCLE = 3, 4  # people
_ROUND = 0.2  # standard deviation of the radii of starts on a circle, over their mean
_ACROSS = np.pi / 3, 2 * np.pi / 3  # rad, between the directions of people who walk across the robot's way
_CROWDING, _CROWD = 1.5, 4  # m, and people
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


def _standing_in_the_way(encounter: Encounter) -> Verdict:
    trajectory = encounter.trajectory
    line = Barriers(trajectory.position[:1], np.array([trajectory.scene.goal.position]), np.zeros(1))
    for m in encounter.meetings:
        place = trajectory.human_position[0, trajectory.human_column[m.person]]
        is_near = m.clearance < _MEETING_CLEARANCE and float(line.gaps(place[None])[0, 0]) < _IN_THE_WAY
        if m.kind in ("standing", "waiting") and is_near:
            return Verdict(True, f"person {m.person} stood on the straight path; clearance {m.clearance:.2f} m")
    return Verdict(False, "nobody stood on the straight path to the goal")


def _down_path(encounter: Encounter) -> Verdict:
    trajectory, same = encounter.trajectory, 0
    for k in range(trajectory.present.shape[1]):
        human, robot = trajectory.human_velocity[:, k], trajectory.velocity
        pace = lengths(human) * lengths(robot)
        is_same = (human * robot).sum(axis=1) > np.cos(SAME_WAY_ANGLE) * pace
        is_near = trajectory.distance[:, k] < _WITHIN_SIGHT
        same += int((is_same & is_near & (pace > _STROLL**2)).sum() * trajectory.scene.rules.dt > _COMPANY_TIME)
    towards = sum(m.kind == "head-on" and m.clearance < _MEETING_CLEARANCE for m in encounter.meetings)
    return Verdict(same > 0 and towards > 0, f"{same} walked the same way near the robot, {towards} came towards it")


def _narrow_hallway(encounter: Encounter) -> Verdict:
    """A person comes towards the robot; whether they pass each other does not matter."""
    trajectory = encounter.trajectory
    walls = Barriers.of((wall.start, wall.end, 0.0) for wall in trajectory.scene.straight_walls.values())
    humans = trajectory.scene.humans if len(walls) > 1 else ()
    for k, human in enumerate(humans):
        near = np.flatnonzero(trajectory.human_clearance[:, k] < _MEETING_CLEARANCE)
        if not len(near):
            continue
        t = int(near[0])
        width = 2.0 * float(np.sort(walls.gaps(trajectory.position[t][None])[:, 0])[:2].mean())
        offset, velocity = trajectory.offset[t, k], trajectory.human_velocity[t, k]
        towards = float(-(offset * velocity).sum()) > np.cos(np.pi - HEAD_ON_ANGLE) * lengths(offset) * lengths(
            velocity
        )
        if towards and lengths(velocity) > _STROLL and width < _NARROW:
            return Verdict(True, f"person {human.id} came towards the robot in a hallway of {width:.2f} m")
    return Verdict(False, "nobody came towards the robot in a narrow hallway")


def _through_a_door(area: str, enters: bool, encounter: Encounter) -> Verdict:
    """The robot enters or leaves an area, which the scene names, while people are on the side where it goes."""
    trajectory = encounter.trajectory
    polygons = [each.polygon for each in trajectory.scene.areas if each.name == area]
    if not polygons:
        return Verdict(False, f"the scene has no area named {area!r}")
    inside = inside_rings(trajectory.position, polygons[0], ())
    if inside[0] == enters or inside[-1] != enters:
        return Verdict(False, f"the robot did not {'enter' if enters else 'leave'} the {area}")
    passage = int(np.argmax(inside == enters))
    people = trajectory.human_position[passage][trajectory.present[passage]]
    beyond = inside_rings(people, polygons[0], ()) == enters if len(people) else np.zeros(0, dtype=bool)
    near = int((beyond & (lengths(people - trajectory.position[passage]) < _DOOR_AUDIENCE)).sum())
    verb = "entered" if enters else "left"
    return Verdict(
        near > 0,
        f"the robot {verb} the {area} with {counted(near, 'person')} within {_DOOR_AUDIENCE:g} m beyond the door",
    )


def _gesture(gesture: str, human_first: bool, encounter: Encounter) -> Verdict:
    """A person who gestures crosses the robot's way before it, or stands near it until the robot has passed."""
    scene, order = encounter.trajectory.scene, "first" if human_first else "second"
    for m in encounter.meetings:
        if scene.attributes_of(m.person).get("gesture") != gesture:
            continue
        lets_pass = m.kind == "standing" and m.clearance < _SUDDEN_DISTANCE and not human_first
        crosses = m.crossing_delay is not None and m.crossing_delay < _GESTURE_DELAY and m.human_first == human_first
        if lets_pass or crosses:
            return Verdict(
                True, f"person {m.person} gestured {gesture!r}, and went {order}; clearance {m.clearance:.2f} m"
            )
    return Verdict(False, f"nobody gestured {gesture!r} and went {order}")


def _in_company(place: str, encounter: Encounter) -> Verdict:
    """Robot and person go the same way, the person ahead, behind or beside, for most of the time in which both move."""
    trajectory, best = encounter.trajectory, 0.0
    for k in range(trajectory.present.shape[1]):
        velocity, offset = trajectory.human_velocity[:, k], trajectory.offset[:, k]
        pace = lengths(velocity)
        moves = trajectory.present[:, k] & (pace > _STROLL) & (lengths(trajectory.velocity) > _STROLL)
        if moves.sum() * trajectory.scene.rules.dt < _COMPANY_TIME:
            continue
        ux, uy = (velocity[moves] / pace[moves, None]).T
        ahead = offset[moves, 0] * ux + offset[moves, 1] * uy
        aside = np.abs(offset[moves, 1] * ux - offset[moves, 0] * uy)
        holds = {
            "ahead": (ahead > 0.5) & (ahead < 4.0) & (aside < 1.2),
            "behind": (ahead < -0.5) & (ahead > -4.0) & (aside < 1.2),
            "beside": (np.abs(ahead) < 1.2) & (aside > 0.4) & (aside < 2.2),
        }[place]
        best = max(best, float(holds.mean()))
    return Verdict(best >= _COMPANY_SHARE, f"a person was {place} for {100 * best:.0f} % of the time on the way")


def _leaving_a_group(encounter: Encounter) -> Verdict:
    trajectory = encounter.trajectory
    for group in trajectory.scene.groups:
        columns = [trajectory.human_column[member] for member in group.members]
        members = trajectory.human_position[0, columns]
        centre, start, end = members.mean(axis=0), trajectory.position[0], trajectory.position[-1]
        radius = float(lengths(members - centre).mean())
        if lengths(start - centre) < radius + _JOINED and lengths(end - centre) > radius + _LEFT:
            return Verdict(
                True, f"the robot stood with group {group.id} at first, and went {lengths(end - centre):.1f} m away"
            )
    return Verdict(False, "the robot did not stand with a group at first, or stayed")


def _traffic(is_along: bool, encounter: Encounter) -> Verdict:
    near = [m for m in encounter.meetings if m.clearance < _MEETING_CLEARANCE and m.kind != "standing"]
    if is_along:
        count = sum(m.angle <= SAME_WAY_ANGLE or m.angle >= HEAD_ON_ANGLE for m in near)
        return Verdict(count >= _TRAFFIC, f"{count} people walked along the robot's way near it")
    count = sum(_ACROSS[0] < m.angle < _ACROSS[1] for m in near)
    return Verdict(count >= _TRAFFIC, f"{count} people walked across the robot's way near it")


def _circular_crossing(encounter: Encounter) -> Verdict:
    trajectory = encounter.trajectory
    starts = [trajectory.scene.robot.pose.position, *(h.pose.position for h in trajectory.scene.humans if h.goals)]
    goals = [trajectory.scene.goal.position, *(human.goals[-1] for human in trajectory.scene.humans if human.goals)]
    lines = Barriers(np.array(starts), np.array(goals), np.zeros(len(starts)))
    middle = np.mean(starts, axis=0)
    gaps, radii = lines.gaps(middle[None])[:, 0], lengths(np.array(starts) - middle)
    is_circle = float(radii.std()) < _ROUND * float(radii.mean())
    count, near = int((gaps[1:] < 1.0).sum()), sum(m.clearance < _MEETING_CLEARANCE for m in encounter.meetings)
    took_place = is_circle and gaps[0] < 1.0 and count >= _CIRCLE and near >= _TRAFFIC
    return Verdict(bool(took_place), f"{count} people crossed the middle of the circle, {near} came near the robot")


def _robot_crowding(encounter: Encounter) -> Verdict:
    trajectory = encounter.trajectory
    near, best = trajectory.human_clearance < _CROWDING, 0
    for t in range(len(trajectory)):
        offset = trajectory.offset[t, near[t]]
        quadrants = set(zip((offset[:, 0] > 0.0).tolist(), (offset[:, 1] > 0.0).tolist(), strict=True))
        best = max(best, len(offset) if len(quadrants) >= 3 else 0)
    return Verdict(best >= _CROWD, f"{best} people at once round the robot within {_CROWDING:g} m")


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
    "pedestrian-obstruction": _standing_in_the_way,
    "down-path": _down_path,
    "narrow-hallway": _narrow_hallway,
    "entering-room": partial(_through_a_door, "room", True),
    "exiting-room": partial(_through_a_door, "room", False),
    "entering-elevator": partial(_through_a_door, "elevator", True),
    "exiting-elevator": partial(_through_a_door, "elevator", False),
    "intersection-wait": partial(_gesture, "wait", True),
    "intersection-proceed": partial(_gesture, "proceed", False),
    "following": partial(_in_company, "ahead"),
    "leading": partial(_in_company, "behind"),
    "accompanying": partial(_in_company, "beside"),
    "leaving-a-group": _leaving_a_group,
    "parallel-traffic": partial(_traffic, True),
    "perpendicular-traffic": partial(_traffic, False),
    "circular-crossing": _circular_crossing,
    "robot-crowding": _robot_crowding,
}
