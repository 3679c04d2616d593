"""What a scenario gives a place: moved a little for each scene, mirrored, and people made of it."""

from __future__ import annotations

from collections.abc import Sequence

from ..chance import Chance
from ..entities import TALKING, WALKING_TOGETHER, Human
from ..errors import SceneError
from ..exact import PI
from ..geometry import Point, Pose
from .cast import Cluster, draw_human
from .config import ScenarioConfig
from .people import FixedPerson, Jitter
from .placement import Layout
from .settings import Range

_STILL = (0.0, 0.0, 0.0)


def settled(config: ScenarioConfig, chance: Chance) -> ScenarioConfig:
    """The same scenario with start, goal and people where one layout has them; where all is firm, nothing is drawn."""
    moved = {"people": tuple(_settled_person(person, chance) for person in config.people)}
    robot, goal = config.robot, config.goal
    if robot.pose is not None and any(robot.jitter):
        dx, dy, turn = _drawn(robot.jitter, chance)
        x, y, theta = robot.pose
        robot = robot.model_copy(update={"pose": (x + dx, y + dy, theta + turn)})
    if goal.position is not None and any(goal.jitter):
        dx, dy, _ = _drawn((*goal.jitter, 0.0), chance)
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


def fixed_clusters(config: ScenarioConfig, chance: Chance) -> list[Cluster]:
    """The people at given places, those of one group together; poses are the world's."""
    groups: dict[str, list[FixedPerson]] = {}
    for k, person in enumerate(config.people):
        groups.setdefault(f"alone {k}" if person.group is None else f"group {person.group!r}", []).append(person)
    return [_cluster(config, members, chance) for members in groups.values()]


def put(clusters: Sequence[Cluster], layout: Layout) -> None:
    """Take the places of people who are given.

    Raises:
        SceneError: one would stand in a wall, in a thing or in somebody else.
    """
    for cluster in clusters:
        if not layout.take(cluster):
            x, y = cluster.members[0].pose.position
            what = f"{cluster.name} at ({x:g}, {y:g})"
            raise SceneError(f"the {what} does not fit there; move it, lessen its jitter, or widen the room")


def _cluster(config: ScenarioConfig, people: list[FixedPerson], chance: Chance) -> Cluster:
    members = tuple(_human(config, person, chance) for person in people)
    relation = None
    if len(people) > 1:
        relation = TALKING if people[0].behaviour == "standing" else WALKING_TOGETHER
    return Cluster("person" if relation is None else "group", members, Range(0.0, 0.0), relation)


def _human(config: ScenarioConfig, person: FixedPerson, chance: Chance) -> Human:
    return draw_human(
        config.person,
        person.behaviour,
        Pose(person.x, person.y, person.theta).rounded(),
        chance,
        speed=person.desired_speed,
        radius=person.radius,
        reacts=person.reacts_to_robot,
        goals=tuple(Pose(*goal).rounded().position for goal in person.goals),
        velocity=Pose(*person.velocity).rounded().position,
    )


def _settled_person(person: FixedPerson, chance: Chance) -> FixedPerson:
    if not any(person.jitter):
        return person
    dx, dy, turn = _drawn(person.jitter, chance)
    goals = tuple((x + dx, y + dy) for x, y in person.goals)
    moved = {"x": person.x + dx, "y": person.y + dy, "theta": person.theta + turn, "goals": goals, "jitter": _STILL}
    return person.model_copy(update=moved)


def _flipped_person(person: FixedPerson) -> FixedPerson:
    mirrored = {"velocity": _across(person.velocity), "goals": tuple(_across(goal) for goal in person.goals)}
    return person.model_copy(update=mirrored | {"y": -person.y, "theta": -person.theta})


def _across(point: Point) -> Point:
    return point[0], -point[1]


def _drawn(jitter: Jitter, chance: Chance) -> tuple[float, float, float]:
    x, y, theta = (chance.uniform(-most, most) for most in jitter)
    return x, y, theta
