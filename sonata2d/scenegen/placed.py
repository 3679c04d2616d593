"""What a scenario gives a place: moved a little for each layout, mirrored, and people made of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from ..core.entities import TALKING, WALKING_TOGETHER, Group, Human, Interaction
from ..core.geometry import Disc, Point, Pose, canonical_angle, inside_polygon, quantised
from ..core.portable_math import PI, angle_of
from ..core.rng import RandomStream
from ..core.scene import Scene
from ..errors import SceneError
from .placement import Layout, Spot, keeps_clear
from .robot_task import reserved
from .scenario.config import ScenarioConfig
from .scenario.people import PersonSpec, Track
from .scenario.ranges import Jitter
from .scenario.sections import PersonConfig
from .track import sampled

_SLOW = 0.1  # m/s, below which a velocity tells nothing of where somebody faces
_TOLERANCE = 1e-6  # ticks
_OVERLAP, _TOUCH = 0.09, 1e-6  # m, of outlines at a start that is given: the physics soon parts them


def settled(config: ScenarioConfig, rng: RandomStream) -> ScenarioConfig:
    """The same scenario with start, goal and people where one layout has them; where all is firm, nothing is drawn."""
    moved = {"people": tuple(_settled_person(person, rng) for person in config.people)}
    robot, goal = config.robot, config.goal
    if robot.pose is not None and any(robot.jitter):
        dx, dy, turn = _drawn(robot.jitter, rng)
        x, y, theta = robot.pose
        robot = robot.model_copy(update={"pose": (x + dx, y + dy, theta + turn)})
    if goal.position is not None and any(goal.jitter):
        dx, dy, _ = _drawn((*goal.jitter, 0.0), rng)
        goal = goal.model_copy(update={"position": (goal.position[0] + dx, goal.position[1] + dy)})
    return config.model_copy(update=moved | {"robot": robot, "goal": goal})


def flipped(config: ScenarioConfig) -> ScenarioConfig:
    """The mirror image of all that is given, y with the other sign."""
    robot, goal, groups = config.robot, config.goal, config.groups
    if robot.pose is not None:
        x, y, theta = robot.pose
        robot = robot.model_copy(update={"pose": (x, -y, -theta)})
    theta_of_goal = None if goal.theta is None else -goal.theta
    position = None if goal.position is None else _across(goal.position)
    pieces = (p.model_copy(update={"y": -p.y, "theta": PI - p.theta}) for p in config.furniture)  # fronts change sides
    return config.model_copy(
        update={
            "robot": robot,
            "goal": goal.model_copy(update={"position": position, "theta": theta_of_goal}),
            "furniture": tuple(pieces),
            "people": tuple(_flipped_person(person) for person in config.people),
            "groups": groups.model_copy(update={"places": tuple(_across(place) for place in groups.places)}),
        }
    )


@dataclass(frozen=True, slots=True)
class Given:
    """The people who are given, their groups, and who walks with whom."""

    humans: tuple[Human, ...] = ()
    groups: tuple[Group, ...] = ()
    interactions: tuple[Interaction, ...] = ()


def given_people(people: tuple[PersonSpec, ...], usual: PersonConfig, dt: float, rng: RandomStream) -> Given:
    """The people of `people`; what is not said of them is drawn.

    Args:
        people: as the scenario lists them.
        usual: what people are like.
        dt: s, the tick.
        chance: of the scene.

    Raises:
        SceneError: a track falls between two ticks.
    """
    taken = {person.id for person in people}
    free = (number for number in range(1, 2 * len(people) + 1) if number not in taken)
    humans = [_human(person, person.id or next(free), usual, dt, rng) for person in people]
    members: dict[int, list[int]] = {}
    for human in humans:
        if human.group is not None:
            members.setdefault(human.group, []).append(human.id)
    groups = {number: ids for number, ids in members.items() if len(ids) > 1}
    humans = [_in_company(human, person, humans) for human, person in zip(humans, people, strict=True)]
    stands = {human.group for human in humans if human.behaviour == "standing"}
    pairs = ((number, pair) for number, ids in groups.items() for pair in combinations(ids, 2))
    return Given(
        tuple(human if human.group in groups else replace(human, group=None) for human in humans),
        tuple(_group(number, ids, number in stands) for number, ids in sorted(groups.items())),
        tuple(Interaction(a, TALKING if n in stands else WALKING_TOGETHER, b) for n, (a, b) in pairs),
    )


def _group(number: int, ids: list[int], stands: bool) -> Group:
    if not stands:
        return Group(number, "walking", tuple(ids))
    return Group(number, "talking", tuple(ids), "circle" if len(ids) > 2 else None)


def _in_company(human: Human, given: PersonSpec, humans: list[Human]) -> Human:
    """Who walks in a group goes at its slowest's pace, and who talks in one faces its middle, unless told otherwise."""
    members = [other for other in humans if human.group is not None and other.group == human.group]
    if len(members) < 2:
        return human
    if human.behaviour != "standing":
        slowest = min(other.desired_speed for other in members)
        return human if given.desired_speed else replace(human, desired_speed=slowest)
    if given.theta is not None:
        return human
    x, y = (np.add.reduce(np.array([m.pose.position for m in members]), axis=0) / len(members)).tolist()
    theta = angle_of(y - human.pose.y, x - human.pose.x)
    return replace(human, pose=Pose(human.pose.x, human.pose.y, canonical_angle(theta)))


def _human(given: PersonSpec, id: int, usual: PersonConfig, dt: float, rng: RandomStream) -> Human:
    drawn_speed = usual.desired_speed.draw(rng)
    drawn_radius, ignores = usual.radius.draw(rng), rng.uniform() < usual.ignores_robot
    reacts = given.reacts_to_robot
    if reacts is None:
        heeds = given.does != "recorded" and not ignores  # nothing holds up who is recorded
        reacts = float(given.reaction != "ignores" if given.reaction else heeds)
    enters = int(given.enters / dt + 1.0 - _TOLERANCE)
    human = Human(
        id=id,
        pose=Pose(*given.start).rounded(),
        radius=quantised(given.radius.draw(rng) if given.radius else drawn_radius),
        desired_speed=quantised(given.desired_speed.draw(rng) if given.desired_speed else drawn_speed),
        behaviour=given.does,
        model=usual.model,
        reacts_to_robot=quantised(reacts),
        group=given.group,
        goals=tuple((quantised(x), quantised(y)) for x, y in given.goals),
        enters=enters,
        leaves=None if given.leaves is None else max(int(given.leaves / dt + 1.0 - _TOLERANCE), enters + 1),
        exits=given.exits,
    )
    if given.track is not None:
        human = _on_track(human, given.track, dt)
    vx, vy = given.velocity or human.velocity
    human = replace(human, velocity=(quantised(vx), quantised(vy)))
    theta = _facing(human) if given.theta is None else given.theta
    return replace(human, pose=Pose(human.pose.x, human.pose.y, canonical_angle(theta)))


def _on_track(human: Human, track: Track, dt: float) -> Human:
    """The person at each tick of their track.

    Raises:
        SceneError: there is no tick within it.
    """
    first, places = sampled(track, dt)
    if not places:
        span = f"{track[0][0]:g} to {track[-1][0]:g} s"
        raise SceneError(f"the track of person {human.id}, {span}, falls between two ticks; leave it out")
    (x, y), (u, v) = places[0], places[min(1, len(places) - 1)]
    velocity = (u - x) / dt, (v - y) / dt
    leaves = first + len(places)
    return replace(human, pose=Pose(x, y), velocity=velocity, enters=first, leaves=leaves, track=tuple(places))


def _facing(human: Human) -> float:
    """rad, where somebody goes first: by their velocity, or to their goal."""
    vx, vy = human.velocity
    if vx * vx + vy * vy > _SLOW * _SLOW:
        return angle_of(vy, vx)
    x, y = human.goals[0] if human.goals else human.pose.position
    return angle_of(y - human.pose.y, x - human.pose.x) if (x, y) != human.pose.position else 0.0


def refuse_outside(given: Given, outline: Any, robot: Pose | None, radius: float) -> None:
    """All that is given must lie in the room, and a given robot on nobody.

    Args:
        given: the people.
        outline: (K, 2), m, of the room.
        robot: its start, if that is given.
        radius: of the robot, m.

    Raises:
        SceneError: somebody would be outside, or under the robot.
    """
    for human in given.humans:
        for what, places in (("start", [human.pose.position]), ("track", human.track), ("goal", human.goals)):
            inside = inside_polygon(np.array(places, dtype=float).reshape(-1, 2), outline)
            for x, y in (place for place, is_in in zip(places, inside.tolist(), strict=True) if not is_in):
                raise SceneError(
                    f"the {what} of person {human.id} is outside the room at ({x:g}, {y:g}); widen the room"
                )
        if robot is not None and human.enters == 0:
            dx, dy, near = robot.x - human.pose.x, robot.y - human.pose.y, radius + human.radius
            if dx * dx + dy * dy < near * near:
                raise SceneError(f"the robot would start on person {human.id}; give it another pose")


def joined(scene: Scene, given: Given) -> Scene:
    """The scene with the people who are given, first; drawn people and things take the ids that they leave free."""
    if not given.humans:
        return scene
    taken, groups = {human.id for human in given.humans}, {group.id for group in given.groups}
    drawn = [*(human.id for human in scene.humans), *(thing.id for thing in scene.furniture)]
    new = dict(zip(drawn, _free(taken, len(drawn)), strict=True))
    band = dict(zip((g.id for g in scene.groups), _free(groups, len(scene.groups)), strict=True))
    people = (replace(h, id=new[h.id], group=None if h.group is None else band[h.group]) for h in scene.humans)
    things = (replace(f, id=new[f.id], on=None if f.on is None else new[f.on]) for f in scene.furniture)
    bands = (replace(g, id=band[g.id], members=tuple(new[id] for id in g.members)) for g in scene.groups)
    ties = (replace(tie, src=new[tie.src], dst=new[tie.dst]) for tie in scene.interactions)
    return replace(
        scene,
        humans=(*given.humans, *people),
        furniture=tuple(things),
        groups=(*given.groups, *bands),
        interactions=(*given.interactions, *ties),
    )


def _free(taken: set[int], count: int) -> list[int]:
    """The lowest ids from 1 that are not taken."""
    return [number for number in range(1, len(taken) + count + 1) if number not in taken][:count]


def put(config: ScenarioConfig, given: Given, layout: Layout) -> None:
    """Take the places of the people who are given and there at the start.

    Raises:
        SceneError: one who is not recorded would stand in a wall, in a thing or in somebody else.
    """
    solid = layout.taken[len(reserved(config)) :]
    for person, human in zip(config.people, given.humans, strict=True):
        if human.behaviour != "recorded" and not _fits(person, human, layout, solid):
            x, y = human.pose.position
            raise SceneError(
                f"person {human.id} at ({x:g}, {y:g}) does not fit there; move it, lessen its jitter, or widen the room"
            )
        if human.enters == 0:
            spot = Disc(human.radius), human.pose
            layout.taken.append(spot)
            solid.append(spot)


def _fits(person: PersonSpec, human: Human, layout: Layout, solid: list[Spot]) -> bool:
    """Whether there is room at the start: with all clearances for one who is moved, with an overlap for others.

    Recorded crowds squeeze together: among people it is enough that nobody's middle is within somebody else.
    """
    if any(person.jitter):
        gap = layout.config.clearance
        return layout.is_free(Disc(human.radius), human.pose, gap, gap)
    body, middle = Disc(human.radius - _OVERLAP), Disc(_TOUCH)
    in_room = layout.plan.holds(body, human.pose, _TOUCH)
    return in_room and (human.enters > 0 or keeps_clear(middle, human.pose, _TOUCH, solid))


def _settled_person(person: PersonSpec, rng: RandomStream) -> PersonSpec:
    if not any(person.jitter):
        return person
    dx, dy, turn = _drawn(person.jitter, rng)
    goals = tuple((x + dx, y + dy) for x, y in person.goals)
    x, y = person.start
    theta = None if person.theta is None else person.theta + turn
    return person.model_copy(update={"x": x + dx, "y": y + dy, "theta": theta, "goals": goals})


def _flipped_person(person: PersonSpec) -> PersonSpec:
    return person.model_copy(
        update={
            "y": None if person.y is None else -person.y,
            "theta": None if person.theta is None else -person.theta,
            "velocity": None if person.velocity is None else _across(person.velocity),
            "goals": tuple(_across(goal) for goal in person.goals),
            "track": person.track and tuple((t, x, -y) for t, x, y in person.track),
        }
    )


def _across(point: Point) -> Point:
    return point[0], -point[1]


def _drawn(jitter: Jitter, rng: RandomStream) -> tuple[float, float, float]:
    x, y, theta = (rng.uniform(-most, most) for most in jitter)
    return x, y, theta
