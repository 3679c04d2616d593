"""Episodes with several robots for formats that know one robot."""

from __future__ import annotations

from ..core.entities import ROBOT_ID
from ..errors import UnsuitableEpisode
from ..record.layout import JsonDict
from ..record.record import EpisodeRecord, record_from_document
from .format import Options

ONE_OF = "one_of_robots"  # key of documents that describe one of several robots, and are no files of sonata2d


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
    document = {key: value for key, value in document.items() if key != "robot_id"} | {"robots": robots, ONE_OF: True}
    for key in ("frames", "final"):
        states = document[key] if key == "frames" else [document[key]]
        renamed = [_with_first_as(state, chosen) for state in states]
        document[key] = renamed if key == "frames" else renamed[0]
    record = record_from_document(document, record.path)
    if options.robots_as == "objects":
        return record
    return record.with_robots_as_people()


def _with_first_as(state: JsonDict, id: int) -> JsonDict:
    """A frame, or the final state, in whose contacts the first robot has another id."""
    contacts = [
        contact | {"id": id} if (contact["kind"], contact["id"]) == ("robot", ROBOT_ID) else contact
        for contact in state["contacts"]
    ]
    return state | {"contacts": contacts}
