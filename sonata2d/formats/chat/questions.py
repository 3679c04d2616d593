"""Questions about an episode, and answers computed from its arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from zlib import crc32

import numpy as np

from ...core.arguments import whole_number
from ...core.entities import Human
from ...core.portable_math import Array
from ...core.relations import ACTIVITIES, ACTIVITY, RELATION
from ...core.rng import RandomStream
from ...metrics.words import listed, name_of, path_ticks, persons, tenths, value_word
from ...record.record import EpisodeRecord

_MARGIN, _SPEED_MARGIN = 0.15, 0.1  # m and m/s, by which an answer must be clear
_ATTEMPTS = 60  # for each question that is asked for
_BESIDE = 1.0  # m, of a robot from people that it could be between


@dataclass(frozen=True, slots=True)
class Question:
    """A question about an episode, with its answer.

    Attributes:
        kind: a key of `QUESTIONS`.
        text: the question.
        answer: to it.
        tick: of the moment in question; None: the whole episode.
        ids: of the people and objects that are named, in the order of the text.
        value: further parameter of the question: a distance, m, a type of object, or name and value of an attribute.
    """

    kind: str
    text: str
    answer: str
    tick: int | None = None
    ids: tuple[int, ...] = ()
    value: float | str | tuple[str, str] | None = None


class _Episode:
    """The arrays of an episode, and random choices of moments and people to ask about."""

    def __init__(self, record: EpisodeRecord, rng: RandomStream) -> None:
        self.record, self.scene, self.rng = record, record.scene(), rng
        self.states, self.ids = record.states, record.scene().human_table.id
        self.lacks = set(record.document.get("imported", {}).get("lacks", ()))
        self.robot, self.humans = self.states.robot, self.states.humans
        self.distance: Array = np.hypot(
            self.humans[..., 0] - self.robot[:, None, 0], self.humans[..., 1] - self.robot[:, None, 1]
        )

    @cached_property
    def at_start(self) -> list[Human]:
        """The people who are present at the start."""
        return [self.scene.humans[k] for k in np.flatnonzero(self.states.present[0]).tolist()]

    @cached_property
    def told(self) -> list[int]:
        """The ticks whose positions a question about the whole episode tells."""
        return path_ticks(self.record)

    def least_distance(self, k: int) -> tuple[float, float]:
        """Least distance of a person from the robot: of all ticks, and of the positions that are told; m."""
        own = np.where(np.isfinite(self.distance[:, k]), self.distance[:, k], math.inf)
        told = (
            math.dist(*([float(tenths(v)) for v in row[tick, :2]] for row in (self.robot, self.humans[:, k])))
            for tick in self.told
            if self.states.present[tick, k]
        )
        return float(own.min()), min(told, default=math.inf)

    def moment(self) -> tuple[int, str]:
        """A random tick, and its time in words."""
        tick = self.rng.integer(0, len(self.record) - 1)
        return tick, f"at {float(self.states.time[tick]):.1f} s"

    def person(self, tick: int | None = None) -> int | None:
        """The index of a random person, who is present at a tick."""
        rows = range(len(self.ids)) if tick is None else np.flatnonzero(self.states.present[tick]).tolist()
        return self.rng.choice(list(rows)) if len(rows) else None

    def interactions(self, tick: int) -> list[tuple[int, str, int]]:
        """Rows src, relation, dst at a tick."""
        return [(src, relation, dst) for src, relation, dst in self.record.document["frames"][tick]["interactions"]]

    def local(self, tick: int, k: int) -> tuple[float, float]:
        """Position of a person in the robot's frame, m: ahead and left."""
        dx, dy = self.humans[tick, k, 0] - self.robot[tick, 0], self.humans[tick, k, 1] - self.robot[tick, 1]
        c, s = math.cos(self.robot[tick, 2]), math.sin(self.robot[tick, 2])
        return float(dx * c + dy * s), float(dy * c - dx * s)


def _yes(flag: bool) -> str:
    return "yes" if flag else "no"


def _nearest_person(e: _Episode) -> Question | None:
    tick, when = e.moment()
    order = np.argsort(e.distance[tick])
    distance = e.distance[tick][order]
    if np.isfinite(distance).sum() < 2 or distance[1] - distance[0] < _MARGIN:
        return None
    return Question(
        "nearest-person", f"Which person is nearest to the robot {when}?", f"person {e.ids[order[0]]}", tick
    )


def _count_within(e: _Episode) -> Question | None:
    tick, when = e.moment()
    limit = e.rng.choice([1.5, 2.0, 3.0, 4.0])
    distance = e.distance[tick][e.states.present[tick]]
    if not len(distance) or np.abs(distance - limit).min() < 0.05:
        return None
    text = f"How many people are within {limit:g} m of the robot {when}, from centre to centre?"
    return Question("count-within", text, str(int((distance < limit).sum())), tick, value=limit)


def _activity(e: _Episode) -> Question | None:
    tick, when = e.moment()
    k = e.person(tick)
    if k is None:
        return None
    answer = ACTIVITY[ACTIVITIES[int(e.states.activity[tick, k])]].text
    return Question("activity", f"What does person {e.ids[k]} do {when}?", answer, tick, (int(e.ids[k]),))


def _partners(e: _Episode) -> Question | None:
    tick, when = e.moment()
    talking = [row for row in e.interactions(tick) if RELATION[row[1]].group == "talking"]
    if not talking:
        return None
    src, relation, dst = e.rng.choice(talking)
    id = e.rng.choice([src, dst])
    others = sorted({b if a == id else a for a, name, b in talking if id in (a, b) and name == relation})
    activity = ACTIVITY[RELATION[relation].activity].text
    return Question("partners", f"Person {id} is {activity} {when}. With whom?", persons(others), tick, (id,), relation)


def _object_of(e: _Episode) -> Question | None:
    tick, when = e.moment()
    things = {piece.id for piece in e.scene.furniture}
    rows = [row for row in e.interactions(tick) if row[2] in things]
    if not rows:
        return None
    src, _, dst = e.rng.choice(rows)
    text = f"Which object does person {src} attend to {when}?"
    return Question("object-of", text, name_of(e.scene, dst), tick, (src,))


def _side(e: _Episode) -> Question | None:
    return _half(e, "side", 1, "Is person {id} to the left or to the right of the robot {when}?", ("left", "right"))


def _ahead(e: _Episode) -> Question | None:
    return _half(e, "ahead", 0, "Is person {id} ahead of the robot or behind it {when}?", ("ahead", "behind"))


def _half(e: _Episode, kind: str, axis: int, text: str, answers: tuple[str, str]) -> Question | None:
    """On which side of the robot a person is: positive or negative along an axis of the robot's frame."""
    tick, when = e.moment()
    k = e.person(tick)
    if k is None or abs(offset := e.local(tick, k)[axis]) < _MARGIN:
        return None
    id = int(e.ids[k])
    return Question(kind, text.format(id=id, when=when), answers[0 if offset > 0.0 else 1], tick, (id,))


def _approaches(e: _Episode) -> Question | None:
    tick, when = e.moment()
    k = e.person(tick)
    if k is None:
        return None
    offset = e.robot[tick, :2] - e.humans[tick, k, :2]
    towards = float(offset @ e.humans[tick, k, 3:5]) / max(float(np.hypot(*offset)), 1e-9)
    if abs(towards) < _SPEED_MARGIN:
        return None
    text = f"Does person {e.ids[k]} move towards the robot {when}?"
    return Question("approaches", text, _yes(towards > 0.0), tick, (int(e.ids[k]),))


def _faster(e: _Episode) -> Question | None:
    tick, when = e.moment()
    k = e.person(tick)
    if k is None:
        return None
    difference = float(np.hypot(*e.humans[tick, k, 3:5]) - np.hypot(*e.robot[tick, 3:5]))
    if abs(difference) < _SPEED_MARGIN:
        return None
    text = f"Is person {e.ids[k]} faster than the robot {when}?"
    return Question("faster", text, _yes(difference > 0.0), tick, (int(e.ids[k]),))


def _present(e: _Episode) -> Question | None:
    if e.states.present.all():
        return None
    tick, when = e.moment()
    k = e.rng.integer(0, len(e.ids) - 1)
    text = f"Is person {e.ids[k]} in the room {when}?"
    return Question("present", text, _yes(bool(e.states.present[tick, k])), tick, (int(e.ids[k]),))


def _closest_approach(e: _Episode) -> Question | None:
    k = e.person()
    if k is None:
        return None
    least, told = e.least_distance(k)
    is_told = math.isfinite(told) and tenths(least) == tenths(told)
    if not (is_told and _is_clear(least, 0.005) and _is_clear(told, 1e-6)):
        return None
    text = f"How near does the robot come to person {e.ids[k]}, from centre to centre?"
    return Question("closest-approach", text, f"{least:.1f} m", None, (int(e.ids[k]),))


def _comes_nearer(e: _Episode) -> Question | None:
    a, b = e.person(), e.person()
    if a is None or b is None or a == b:
        return None
    (first, told_first), (second, told_second) = e.least_distance(a), e.least_distance(b)
    if not (math.isfinite(told_first) and math.isfinite(told_second) and abs(first - second) >= _MARGIN):
        return None
    if abs(told_first - told_second) < _MARGIN or (told_first < told_second) != (first < second):
        return None
    ids = int(e.ids[a]), int(e.ids[b])
    text = f"To whom does the robot come nearer, to person {ids[0]} or to person {ids[1]}?"
    return Question("comes-nearer", text, f"person {ids[0] if first < second else ids[1]}", None, ids)


def _between(e: _Episode) -> Question | None:
    tick, when = e.moment()
    pairs = [row for row in e.interactions(tick) if RELATION[row[1]].group == "talking"]
    if not pairs:
        return None
    src, _, dst = e.rng.choice(pairs)
    row = e.scene.human_table.row
    if src not in row or dst not in row:
        return None
    a, b, p = e.humans[tick, row[src], :2], e.humans[tick, row[dst], :2], e.robot[tick, :2]
    t = float((p - a) @ (b - a)) / max(float((b - a) @ (b - a)), 1e-9)
    gap = float(np.hypot(*(a + min(max(t, 0.0), 1.0) * (b - a) - p))) - e.scene.robot.radius
    if "robot.radius" in e.lacks or abs(gap) < 0.05 or gap > _BESIDE:
        return None
    text = f"Is the robot on the line between persons {src} and {dst} {when}?"
    return Question("between", text, _yes(gap < 0.0), tick, (src, dst))


def _reaches_goal(e: _Episode) -> Question | None:
    if e.lacks & {"goal", "outcome"}:
        return None
    return Question(
        "reaches-goal", "Does the robot reach its goal?", _yes(e.record.document["outcome"]["status"] == "goal")
    )


def _arrival(e: _Episode) -> Question | None:
    outcome = e.record.document["outcome"]
    if e.lacks & {"goal", "outcome"} or outcome["status"] != "goal" or not _is_clear(outcome["time"], 1e-6):
        return None
    return Question("arrival", "After how many seconds does the robot reach its goal?", f"{outcome['time']:.1f} s")


def _touches(e: _Episode) -> Question | None:
    if "frames.contacts" in e.lacks:
        return None
    states = [*e.record.document["frames"], e.record.document["final"]]
    touched = {k for k, s in enumerate(states) if any(contact["kind"] == "human" for contact in s["contacts"])}
    if touched and not touched & set(e.told):
        return None
    return Question("touches", "Does the robot touch a person?", _yes(bool(touched)))


def _object_count(e: _Episode) -> Question | None:
    types = sorted({piece.type for piece in e.scene.furniture})
    if not types:
        return None
    type = e.rng.choice(types)
    number = sum(piece.type == type for piece in e.scene.furniture)
    text = f"How many objects of the type {type.replace('_', ' ')} are in the room?"
    return Question("object-count", text, str(number), value=type)


def _kind_count(e: _Episode) -> Question | None:
    kinds = sorted({human.kind for human in e.at_start})
    if len(kinds) < 2:
        return None
    kind = e.rng.choice(kinds)
    number = sum(human.kind == kind for human in e.at_start)
    text = f"How many people of the kind {kind.replace('_', ' ')} are in the room at the start?"
    return Question("kind-count", text, str(number), 0, value=kind)


def _attribute(e: _Episode) -> Question | None:
    holders = [(h.id, h.attributes) for h in e.at_start] + [(f.id, f.attributes) for f in e.scene.furniture]
    given = [(id, name) for id, values in holders for name in values or {}]
    if not given:
        return None
    id, name = e.rng.choice(given)
    text = f"Which value has the attribute {name.replace('_', ' ')!r} of {name_of(e.scene, id)}?"
    return Question("attribute", text, value_word(e.scene.attributes_of(id)[name]), None, (id,), name)


def _who_has(e: _Episode) -> Question | None:
    given = [(name, v) for human in e.at_start for name, v in (human.attributes or {}).items() if isinstance(v, str)]
    if not given:
        return None
    name, value = e.rng.choice(given)
    ids = [human.id for human in e.at_start if (human.attributes or {}).get(name) == value]
    text = f"Of which people in the room at the start is the attribute {name.replace('_', ' ')!r} {value!r}?"
    return Question("who-has", text, listed([f"person {id}" for id in ids]), 0, value=(name, value))


def _is_clear(value: float, margin: float) -> bool:
    """Whether a number is farther than a margin from those that are rounded to other tenths."""
    return abs(value * 10.0 % 1.0 - 0.5) > 10.0 * margin


QUESTIONS: dict[str, Callable[[_Episode], Question | None]] = {
    "nearest-person": _nearest_person,
    "count-within": _count_within,
    "activity": _activity,
    "partners": _partners,
    "object-of": _object_of,
    "side": _side,
    "ahead": _ahead,
    "approaches": _approaches,
    "faster": _faster,
    "present": _present,
    "closest-approach": _closest_approach,
    "comes-nearer": _comes_nearer,
    "between": _between,
    "reaches-goal": _reaches_goal,
    "arrival": _arrival,
    "touches": _touches,
    "object-count": _object_count,
    "kind-count": _kind_count,
    "attribute": _attribute,
    "who-has": _who_has,
}


def ask(record: EpisodeRecord, count: int) -> list[Question]:
    """Questions about an episode, without repetition, that have a clear answer.

    Args:
        record: the episode; its id determines the questions.
        count: number of questions; fewer where an episode has not so many.

    Raises:
        ValueError: the count is negative.
    """
    whole_number("count", count, 0)
    if not len(record):
        return []
    episode = _Episode(record, RandomStream(crc32(record.id.encode()), max(record.episode or 0, 0), "words"))
    kinds, found = list(QUESTIONS.values()), dict[str, Question]()
    for _ in range(_ATTEMPTS * count):
        if len(found) == count:
            break
        question = episode.rng.choice(kinds)(episode)
        if question is not None:
            found.setdefault(question.text, question)
    return list(found.values())
