"""Documents of episodes with several robots, from the view of one of them."""

from __future__ import annotations

from ..core.entities import ROBOT_ID
from ..core.geometry import quantised
from ..core.relations import ACTIVITIES
from .layout import ROW_THETA, JsonDict, human_to_json, scene_from_json

_WALKING = ACTIVITIES.index("walking")

_OF_ROBOT = ("robot", "goal", "controller", "labels", "sensors")  # top-level keys that each other robot has too
_OF_FRAME = ("robot", "command", "executed", "guarded", "contacts", "label", "sensors")


def document_seen_by(document: JsonDict, robot_id: int) -> JsonDict:
    """The document with another robot in the place of the first one; its key `robot_id` names that robot.

    Args:
        document: of an episode; its parts are not copied.
        robot_id: of one of its robots.

    Raises:
        KeyError: there is no such robot.
    """
    own = document.get("robot_id", ROBOT_ID)
    if robot_id == own:
        return document
    robots = document.get("robots") or []
    ids = [other["id"] for other in robots]
    if robot_id not in ids:
        raise KeyError(f"there is no robot {robot_id}; the episode has {', '.join(map(str, [own, *ids]))}")
    all_ids = [own, *ids]
    order = [all_ids.index(id) for id in (robot_id, *sorted(id for id in all_ids if id != robot_id))]
    everyone = [{"id": own, **{key: document[key] for key in _OF_ROBOT if key in document}}, *robots]
    arrivals = document["outcome"]["arrivals"]
    kept = {key: value for key, value in document.items() if key != "sensors"}
    view: JsonDict = kept | {
        **{key: everyone[order[0]][key] for key in _OF_ROBOT if key in everyone[order[0]]},
        "robot_id": robot_id,
        "robots": [everyone[k] for k in order[1:]],
        "outcome": document["outcome"] | {"arrivals": [arrivals[k] for k in order]},
        "frames": [_frame_seen_by(frame, order) for frame in document["frames"]],
        "final": _frame_seen_by(document["final"], order),
    }
    return view


def _frame_seen_by(frame: JsonDict, order: list[int]) -> JsonDict:
    """A frame, or the final state, with its robots in another order, of which the first one has its keys."""
    robots = [{key: each[key] for key in _OF_FRAME if key in each} for each in (frame, *frame["robots"])]
    kept = {key: value for key, value in frame.items() if key not in _OF_FRAME}
    seen: JsonDict = kept | robots[order[0]] | {"robots": [robots[k] for k in order[1:]]}
    return seen


def document_with_robots_as_people(document: JsonDict) -> JsonDict:
    """The document with the other robots as people that walk and look ahead."""
    robots = document.get("robots") or []
    if not robots:
        return document
    people = scene_from_json(document).with_robots_as_people.humans[-len(robots) :]
    left_out = {"robots", "robot_id"}
    return {key: value for key, value in document.items() if key not in left_out} | {
        "humans": [*document["humans"], *map(human_to_json, people)],
        "frames": [_frame_with_people(frame) for frame in document["frames"]],
        "final": _frame_with_people(document["final"]),
        "outcome": {key: value for key, value in document["outcome"].items() if key != "arrivals"},
    }


def _frame_with_people(frame: JsonDict) -> JsonDict:
    """A frame, or the final state, with its other robots as people that walk and look ahead."""
    rows = [[*other["robot"], other["robot"][ROW_THETA]] for other in frame["robots"]]
    contacts = [contact | {"kind": "human"} if contact["kind"] == "robot" else contact for contact in frame["contacts"]]
    kept: JsonDict = {key: value for key, value in frame.items() if key != "robots"}
    activity = [*frame["activity"], *[_WALKING] * len(rows)]
    return kept | {"humans": [*frame["humans"], *rows], "activity": activity, "contacts": contacts}


def document_until_arrival(document: JsonDict) -> JsonDict:
    """The document up to the tick at which its robot reached its goal, which is then the outcome."""
    arrivals, frames = document["outcome"].get("arrivals"), document["frames"]
    if not arrivals or arrivals[0] is None:
        return document
    tick = arrivals[0]
    final = frames[tick] if tick < len(frames) else document["final"]
    left_out = {"command", "executed", "guarded", "label", "sensors"}
    outcome = {
        "status": "goal",
        "reason": "the robot has reached its goal",
        "tick": tick,
        "time": quantised(final["time"]),
        "arrivals": arrivals,
    }
    return document | {
        "outcome": outcome,
        "frames": frames[:tick],
        "final": {key: value for key, value in final.items() if key not in left_out},
    }
