"""Sentences about a scene and an episode: who is where, the robot's task, and what happens."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.attributes import Attributes, AttributeValue
from ..core.entities import AT_PERSON, DEFAULT_KIND, Interaction
from ..core.geometry import inside_rings
from ..core.portable_math import unit_vector
from ..core.relations import ACTIVITY, RELATION
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..record.record import EpisodeRecord
from .encounters import Kind, Meeting, encounter

_NEAR_GOAL = 1.5  # m, of an object or a person by which the goal is described
_NOTHING = ("", "none", "nothing")  # values of the attribute robot_carries
_MOST_MOMENTS = 60  # of a path in words
_STANDS, _STOP = 0.05, 1.0  # m/s, and s, of a stop that is worth a sentence
PASSES = 2.5  # m, between the centres, of a meeting that is worth a sentence

# What people do to others, or to an object, for sentences: of one person, and, where they all do the same, of several.
_VERBS = {
    "two_static_person_talking": ("talks with", "talk"),
    "wandering_human_interacting": ("walks with", "walk together"),
    "human_laptop_interaction": ("works at", ""),
    "human_plant_interaction": ("looks at", ""),
    "human_object_interaction": ("looks at", ""),
    "arguing": ("argues with", "argue"),
    "handing_over": ("hands something to", ""),
    "caring_for": ("cares for", ""),
    "watching_tv": ("watches", ""),
    "leading": ("leads", ""),
    "following": ("follows", ""),
}
_MEETINGS: dict[Kind, str] = {
    "head-on": "meets {who}, who comes towards it",
    "overtaking": "overtakes {who}",
    "overtaken": "is overtaken by {who}",
    "alongside": "goes beside {who}",
    "crossing": "crosses the way of {who}",
    "standing": "passes {who}, who stands",
    "waiting": "stands while {who} passes",
}


@dataclass(frozen=True, slots=True)
class Instruction:
    """The robot's task in words.

    Attributes:
        text: one or several sentences.
        slots: ids of the people and objects that it names, and names of areas, by role: `destination`, `area`,
            `person`, `undisturbed`, `fragile`, `no_go`, `slow`, `one_way`.
    """

    text: str
    slots: dict[str, list[int | str]]


def listed(names: Sequence[str]) -> str:
    """Names as a list in words.

    >>> listed(["person 1", "person 2", "person 3"])
    'person 1, person 2 and person 3'
    """
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def persons(ids: Sequence[int]) -> str:
    """People by their ids, such as `person 3`, or `persons 3 and 4`."""
    return f"person {ids[0]}" if len(ids) == 1 else f"persons {listed([str(id) for id in ids])}"


def name_of(scene: Scene, id: int) -> str:
    """A person or an object by its id, such as `person 3` or `laptop 7`."""
    piece = next((piece for piece in scene.furniture if piece.id == id), None)
    return f"person {id}" if piece is None else f"{piece.type.replace('_', ' ')} {id}"


def instruction(scene: Scene) -> Instruction:
    """The robot's task: where it goes, whom it leaves in peace, and the rules of the areas."""
    slots: dict[str, list[int | str]] = {}
    goal = np.array(scene.goal.position)
    near = [(float(np.hypot(*(np.array(f.pose.position) - goal))), f.id) for f in scene.furniture if f.on is None]
    engaged = {i.src for i in scene.interactions} | {i.dst for i in scene.interactions}  # not to be disturbed
    near += [
        (float(np.hypot(*(np.array(human.pose.position) - goal))), human.id)
        for human in scene.humans
        if human.behaviour == "standing" and human.is_always_present and human.id not in engaged
    ]
    distance, id = min(near, default=(math.inf, 0))
    if scene.goal.object is not None:
        distance, id = 0.0, scene.goal.object
    if distance < _NEAR_GOAL and scene.goal.task not in AT_PERSON and "goal" not in scene.unmeasured:
        slots["destination"] = [id]
        place = name_of(scene, id)
    else:
        place = f"the place {_offset(*scene.robot.pose.to_local(scene.goal.position))} from your start"
        if within := [a.name for a in scene.areas if inside_rings(goal[None], a.polygon, ())[0]]:
            slots["area"], place = [within[0]], f"{place}, in the area {within[0]}"
    further = [f"the one {_offset(*scene.robot.pose.to_local(point))}" for point in scene.goal.then]
    if scene.goal.person is not None:
        slots["person"] = [scene.goal.person]
    who = f"person {scene.goal.person}"
    carried = scene.attributes_of().get("robot_carries")
    load = carried if isinstance(carried, str) and carried not in _NOTHING else ""
    is_errand = bool(load) and scene.goal.task in ("go", "meet") and not further
    go = f"Bring {load}" if is_errand else "Go"
    parts = [{
        "go": f"{go} to {place}" + (f", then to {listed(further)}, in this order" if further else ""),
        "meet": f"{go} to {who}", "follow": f"Follow {who}", "accompany": f"Go beside {who}",
        "lead": f"Lead {who} to {place}", "wait": f"Go to {place} and wait there for {who}",
    }[scene.goal.task]]  # fmt: skip
    if "goal" in scene.unmeasured:
        parts = ["Drive among the people, to a goal that was not recorded"]
    if load and ("goal" in scene.unmeasured or not is_errand):
        parts.append(f"carry {load}")
    for ids, relation in _groups(scene.interactions):
        if RELATION[relation].group == "talking":
            single, plural = _VERBS[relation]
            slots.setdefault("undisturbed", []).extend(ids)
            if plural:
                parts.append(f"do not disturb {persons(ids)}, who {plural}")
            else:
                parts.append(f"do not disturb person {ids[0]}, who {single} {name_of(scene, ids[1])}")
    for piece in scene.furniture:
        if (piece.attributes or {}).get("fragile") is True:
            slots.setdefault("fragile", []).append(piece.id)
    if fragile := slots.get("fragile"):
        parts.append(f"keep away from {listed([name_of(scene, int(id)) for id in fragile])}, fragile as it is")
    for area in scene.areas:
        if area.no_go:
            slots.setdefault("no_go", []).append(area.name)
            parts.append(f"do not enter the {area.name}")
        if area.speed_limit is not None:
            slots.setdefault("slow", []).append(area.name)
            parts.append(f"drive at {area.speed_limit:g} m/s at most in the {area.name}")
        if area.one_way is not None:
            slots.setdefault("one_way", []).append(area.name)
            parts.append(f"keep to the direction of the {area.name}")
    return Instruction(f"{'; '.join(parts)}.", slots)


def situation(snapshot: Snapshot) -> str:
    """Where everything is at a moment, in the robot's frame: x ahead and y left, m and m/s, one and two decimals."""
    scene, robot = snapshot.scene, snapshot.robot
    lines = [
        f"Time {snapshot.time:.1f} s. Positions and velocities are (x ahead, y left) of the robot in m and m/s. "
        f"The robot drives at {math.hypot(*robot.velocity):.2f} m/s."
    ]
    if "goal" not in scene.unmeasured:
        lines.append(f"Its goal is at {_place(robot.pose.to_local(snapshot.goal.position))}.")
    partner: dict[int, list[str]] = {}
    for i in snapshot.interactions:
        partner.setdefault(i.src, []).append(f"{_VERBS[i.relation][0]} {name_of(scene, i.dst)}")
    given = {human.id: attribute_words(human.attributes) for human in scene.humans}
    c, s = robot.direction
    for human in snapshot.humans:
        facts = [ACTIVITY[human.activity].text, *partner.get(human.id, [])]
        vx, vy = human.velocity
        moves = math.hypot(vx, vy) > _STANDS
        facts += [f"at {math.hypot(vx, vy):.2f} m/s, ({vx * c + vy * s:.2f}, {vy * c - vx * s:.2f})"] if moves else []
        facts += [human.kind.replace("_", " ")] if human.kind != DEFAULT_KIND else []
        facts += [given[human.id]] if given[human.id] else []
        place = _place(robot.pose.to_local(human.pose.position))
        lines.append(f"Person {human.id} is at {place}: {', '.join(facts)}.")
    for piece in scene.furniture:
        extra = f": {attribute_words(piece.attributes)}" if piece.attributes else ""
        name = name_of(scene, piece.id)
        lines.append(f"{name[0].upper()}{name[1:]} is at {_place(robot.pose.to_local(piece.pose.position))}{extra}.")
    for area in scene.areas:
        corners = ", ".join(_place(robot.pose.to_local(corner)) for corner in area.polygon)
        facts = []
        if area.one_way is not None:
            along, across = unit_vector(area.one_way - robot.pose.theta)
            facts.append(f"in it robots move along ({along:.2f}, {across:.2f})")
        facts += [attribute_words(area.attributes)] if area.attributes else []
        lines.append(f"The {area.name} has the corners {corners}{''.join(f'; {fact}' for fact in facts)}.")
    return " ".join(lines)


def attribute_words(attributes: Attributes | None) -> str:
    """Names and values of attributes.

    >>> attribute_words({"mood": "low", "hurried": True, "age": 71.0})
    'mood low, hurried yes, age 71'
    """
    return ", ".join(f"{name.replace('_', ' ')} {value_word(value)}" for name, value in (attributes or {}).items())


def value_word(value: AttributeValue) -> str:
    """The value of an attribute: a text, yes, no, or a number with two decimals at most."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else f"{value:.2f}".rstrip("0").rstrip(".")


def path_ticks(record: EpisodeRecord) -> list[int]:
    """The ticks of `path_words`."""
    step = max(round(1.0 / record.scene().rules.dt), math.ceil(len(record) / _MOST_MOMENTS))
    return sorted({*range(0, len(record) + 1, step), len(record)})


def path_words(record: EpisodeRecord) -> str:
    """Positions of the robot and of the people who are present, each second, or less often in a long episode."""
    states = record.states
    ids, lines = record.scene().human_table.id.tolist(), []
    for tick in path_ticks(record):
        people = [
            f"person {ids[k]} {_place((row[0], row[1]))}"
            for k, row in enumerate(states.humans[tick].tolist())
            if states.present[tick, k]
        ]
        robot = _place((float(states.robot[tick, 0]), float(states.robot[tick, 1])))
        lines.append(f"{float(states.time[tick]):.1f} s: {', '.join([f'robot {robot}', *people])}.")
    return "Positions in the room, (x, y) in m. " + " ".join(lines)


def story(record: EpisodeRecord) -> list[str]:
    """Sentences on an episode: the task, who is with whom at the start, meetings, stops, contacts and the end."""
    scene, states = record.scene(), record.states
    dx, dy = np.subtract(scene.goal.position, scene.robot.pose.position).tolist()
    lacks = set(record.document.get("imported", {}).get("lacks", ()))
    target = f"person {scene.goal.person}" if scene.goal.task in AT_PERSON else "its goal"
    target = "the first of its goals" if scene.goal.then else target
    sentences = [] if "goal" in lacks else [f"The robot starts {math.hypot(dx, dy):.1f} m from {target}."]
    person = scene.goal.person
    if person is not None and not states.present[0, scene.human_table.row[person]]:
        sentences = [f"Person {person} is not there at the start."]
    for ids, relation in _groups(scene.interactions):
        single, plural = _VERBS[relation]
        if plural:
            sentences.append(f"{persons(ids)[0].upper()}{persons(ids)[1:]} {plural}.")
        else:
            sentences.append(f"Person {ids[0]} {single} {name_of(scene, ids[1])}.")
    distance = np.hypot(*(states.humans[..., :2] - states.robot[:, None, :2]).transpose(2, 0, 1))
    events = []
    for meeting in encounter(record).meetings:
        nearest = distance[:, scene.human_table.row[meeting.person]]
        tick = int(np.nanargmin(nearest))
        # At the start and at the end they do not pass each other.
        if nearest[tick] < PASSES and 0 < tick < len(record):
            events.append((float(states.time[tick]), _meeting_text(meeting, float(nearest[tick]))))
    speed = np.hypot(states.robot[: len(record), 3], states.robot[: len(record), 4])
    for first, end in _runs((speed < _STANDS).tolist()):
        duration = float(states.time[end] - states.time[first])
        if duration >= _STOP and end < len(record):
            events.append((float(states.time[first]), f"it stands for {duration:.1f} s"))
    touched: set[tuple[str, int]] = set()
    for frame in [*record.document["frames"], record.document["final"]]:
        for contact in frame["contacts"]:
            key = contact["kind"], contact["id"]
            if key not in touched:
                touched.add(key)
                what = {"human": f"person {key[1]}", "wall": "a wall", "door": "a door", "robot": f"robot {key[1]}"}
                events.append((float(frame["time"]), f"it touches {what.get(key[0]) or name_of(scene, key[1])}"))
    sentences += [f"At {time:.1f} s {text}." for time, text in sorted(events)]
    outcome, is_plain = record.document["outcome"], scene.goal.is_plain
    if lacks & {"goal", "outcome"}:
        sentences.append(f"The recording ends after {float(states.time[-1] - states.time[0]):.1f} s.")
    elif outcome["status"] == "goal":
        sentences.append(f"It {'reaches its goal' if is_plain else 'has done its task'} after {outcome['time']:.1f} s.")
    else:
        missed = "has not reached its goal" if is_plain else "has not done its task"
        sentences.append(f"It {missed} when the episode ends after {outcome['time']:.1f} s.")
    return sentences


def _meeting_text(meeting: Meeting, distance: float) -> str:
    """A meeting in words, with the smallest distance of the centres, m."""
    what = _MEETINGS[meeting.kind].format(who=f"person {meeting.person}")
    return f"the robot {what}, on its {meeting.side}, {distance:.1f} m from centre to centre"


def _groups(interactions: Sequence[Interaction]) -> list[tuple[list[int], str]]:
    """Ids of the people, or of a person and an object, that are connected by interactions of one relation."""
    found: list[tuple[list[int], str]] = []
    for i in interactions:
        for ids, relation in found:
            is_group = RELATION[relation].group is not None and not RELATION[relation].in_file
            if relation == i.relation and is_group and (i.src in ids or i.dst in ids):
                ids += [id for id in (i.src, i.dst) if id not in ids]
                break
        else:
            found.append(([i.src, i.dst], i.relation))
    return found


def _runs(flags: list[bool]) -> Iterator[tuple[int, int]]:
    """First index and index after the last one of each series of true values."""
    first = None
    for k, flag in enumerate([*flags, False]):
        if flag and first is None:
            first = k
        elif not flag and first is not None:
            yield first, k
            first = None


def _place(point: tuple[float, float]) -> str:
    return f"({tenths(point[0])}, {tenths(point[1])})"


def tenths(value: float) -> str:
    """A number with one decimal.

    >>> tenths(1.26)
    '1.3'
    """
    return f"{value + 0.0:.1f}"


def _offset(ahead: float, left: float) -> str:
    """A place relative to the robot in words."""
    along, across = "ahead" if ahead >= 0.0 else "behind", "left" if left >= 0.0 else "right"
    return f"{abs(ahead):.1f} m {along} and {abs(left):.1f} m {across}"
