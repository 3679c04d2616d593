"""Answers to questions computed again, from the JSON document alone and without arrays: a check of `questions`.

Nothing of `questions` is used here, so that a mistake would have to be made twice to be missed.
"""

from __future__ import annotations

import math
from typing import Any

from ...core.relations import ACTIVITY
from ...record.layout import JsonDict

_X, _Y, _THETA, _VX, _VY = range(5)


def recompute(document: JsonDict, kind: str, tick: int | None, ids: tuple[int, ...], value: Any) -> str:
    """The answer to a question.

    Args:
        document: the episode as its file holds it.
        kind, tick, ids, value: of the question, see `questions.Question`.

    Raises:
        ValueError: there is no such kind.
    """
    states = [*document["frames"], document["final"]]
    people = {human["id"]: k for k, human in enumerate(document["humans"])}
    frame = states[tick] if tick is not None else states[0]
    robot, rows = frame["robot"], frame["humans"]

    def apart(state: JsonDict, id: int) -> float:
        row = state["humans"][people[id]]
        return math.inf if row is None else math.dist(row[:2], state["robot"][:2])

    def in_frame(id: int) -> tuple[float, float]:
        row = rows[people[id]]
        distance, bearing = math.dist(row[:2], robot[:2]), math.atan2(row[_Y] - robot[_Y], row[_X] - robot[_X])
        return distance * math.cos(bearing - robot[_THETA]), distance * math.sin(bearing - robot[_THETA])

    def yes(flag: bool) -> str:
        return "yes" if flag else "no"

    match kind:
        case "nearest-person":
            return f"person {min(people, key=lambda id: apart(frame, id))}"
        case "count-within":
            return str(len([id for id in people if apart(frame, id) < value]))
        case "activity":
            return ACTIVITY[document["activities"][frame["activity"][people[ids[0]]]]].text
        case "partners":
            linked = [row for row in frame["interactions"] if row[1] == value and ids[0] in (row[0], row[2])]
            others = sorted({row[2] if row[0] == ids[0] else row[0] for row in linked})
            words = [str(id) for id in others]
            if len(words) == 1:
                return f"person {words[0]}"
            return f"persons {', '.join(words[:-1])} and {words[-1]}"
        case "object-of":
            things = {thing["id"]: thing["type"] for thing in document["objects"]}
            dst = next(row[2] for row in frame["interactions"] if row[0] == ids[0] and row[2] in things)
            return f"{things[dst].replace('_', ' ')} {dst}"
        case "side":
            return "left" if in_frame(ids[0])[1] > 0.0 else "right"
        case "ahead":
            return "ahead" if in_frame(ids[0])[0] > 0.0 else "behind"
        case "approaches":
            row = rows[people[ids[0]]]
            later = [row[_X] + 1e-3 * row[_VX], row[_Y] + 1e-3 * row[_VY]]
            return yes(math.dist(later, robot[:2]) < math.dist(row[:2], robot[:2]))
        case "faster":
            row = rows[people[ids[0]]]
            return yes(math.hypot(row[_VX], row[_VY]) > math.hypot(robot[_VX], robot[_VY]))
        case "present":
            return yes(rows[people[ids[0]]] is not None)
        case "closest-approach":
            return f"{min(apart(state, ids[0]) for state in states):.1f} m"
        case "comes-nearer":
            return f"person {min(ids, key=lambda id: min(apart(state, id) for state in states))}"
        case "between":
            return yes(_gap_to_line(robot, rows[people[ids[0]]], rows[people[ids[1]]]) < document["robot"]["radius"])
        case "reaches-goal":
            return yes(document["outcome"]["status"] == "goal")
        case "arrival":
            return f"{document['outcome']['tick'] * document['rules']['dt']:.1f} s"
        case "touches":
            return yes(any(contact["kind"] == "human" for state in states for contact in state["contacts"]))
        case "object-count":
            return str(len([thing for thing in document["objects"] if thing["type"] == value]))
        case "kind-count":
            here = [human for human, row in zip(document["humans"], rows, strict=True) if row is not None]
            return str([human.get("kind", "adult") for human in here].count(value))
        case "attribute":
            holders = {each["id"]: each for each in (*document["humans"], *document["objects"])}
            given = holders[ids[0]]["attributes"][value]
            if isinstance(given, str):
                return given
            return yes(given) if given is True or given is False else str(round(given, 2)).removesuffix(".0")
        case "who-has":
            name, wanted = value
            here = [human for human, row in zip(document["humans"], rows, strict=True) if row is not None]
            found = [f"person {h['id']}" for h in here if (h.get("attributes") or {}).get(name) == wanted]
            return found[0] if len(found) == 1 else f"{', '.join(found[:-1])} and {found[-1]}"
    raise ValueError(f"there is no question of the kind {kind!r}")


def _gap_to_line(robot: list[float], first: list[float], second: list[float]) -> float:
    """Distance of the robot's centre from the line between two people, m, by bisection along the line."""
    low, high = 0.0, 1.0

    def away(t: float) -> float:
        return math.hypot(
            first[_X] + t * (second[_X] - first[_X]) - robot[_X], first[_Y] + t * (second[_Y] - first[_Y]) - robot[_Y]
        )

    for _ in range(60):
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        low, high = (low, b) if away(a) < away(b) else (a, high)
    return away((low + high) / 2.0)
