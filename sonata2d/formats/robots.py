"""Episodes with several robots for formats that know one robot."""

from __future__ import annotations

from typing import Any

from ..core.entities import ROBOT_ID
from ..core.relations import ACTIVITIES
from ..errors import UnsuitableEpisode
from ..record.layout import ROW_THETA, JsonDict, human_to_json
from ..record.record import EpisodeRecord, record_from_document
from .format import Options

_WALKING = ACTIVITIES.index("walking")


def of_one_robot(record: EpisodeRecord, options: Options, *, ends_on_arrival: bool) -> EpisodeRecord:
    """The episode of the chosen robot, `Options.robot`; the other robots are people unless they are to be objects.

    The first robot takes the id of the chosen one.

    Args:
        record: the episode.
        options: `robot` and `robots_as`.
        ends_on_arrival: whether it ends where this robot reaches its goal.

    Raises:
        UnsuitableEpisode: there is no such robot.
    """
    count = len(record.robot_ids)
    if not 0 <= options.robot < count:
        numbers = f"0 to {count - 1}" if count > 1 else "0 only"
        raise UnsuitableEpisode(
            record.path, f"there is no robot {options.robot}; it has {numbers}", "choose one of these"
        )
    if count == 1:
        return record
    chosen = record.robot_ids[options.robot]
    record = record.seen_by(chosen)
    document = (record.until_arrival() if ends_on_arrival else record).document
    robots = [other | {"id": chosen if other["id"] == ROBOT_ID else other["id"]} for other in document["robots"]]
    document = {key: value for key, value in document.items() if key != "robot_id"} | {"robots": robots}
    record = record_from_document(document, record.path)
    if options.robots_as == "objects":
        return record
    people = record.scene().with_robots_as_people.humans[-len(robots) :]
    document |= {
        "humans": [*document["humans"], *map(human_to_json, people)],
        "frames": [_with_people(frame) for frame in document["frames"]],
        "final": _with_people(document["final"]),
        "outcome": {key: value for key, value in document["outcome"].items() if key != "arrivals"},
    }
    del document["robots"]
    return record_from_document(document, record.path)


def _with_people(frame: JsonDict) -> JsonDict:
    """A frame, or the final state, with its other robots as people that walk and look ahead."""
    rows = [[*other["robot"], other["robot"][ROW_THETA]] for other in frame["robots"]]
    contacts = [_with_human(contact) for contact in frame["contacts"]]
    kept: dict[str, Any] = {key: value for key, value in frame.items() if key != "robots"}
    activity = [*frame["activity"], *[_WALKING] * len(rows)]
    return kept | {"humans": [*frame["humans"], *rows], "activity": activity, "contacts": contacts}


def _with_human(contact: JsonDict) -> JsonDict:
    return contact | {"kind": "human"} if contact["kind"] == "robot" else contact
