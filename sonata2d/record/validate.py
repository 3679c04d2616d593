"""The gate of episode files: a document is checked once, when it is read, and code behind it relies on its content.

Checked are the schema (`models.Episode`), and what a schema cannot express: references between parts of the document,
lengths that must agree, and numbers within the range of the computations.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import orjson

from ..core.attributes import AttributeSpec
from ..core.entities import ROBOT_ID, is_seat_by_type
from ..core.files.limits import MAX_COUNT
from ..core.humans import Humans
from ..core.labels import LabelSpec
from ..core.relations import ACTIVITIES, RELATIONS
from ..core.scene import Scene
from ..core.state import HUMAN_SIZE
from ..core.wording import described, shown, text_of
from ..errors import InvalidFileError, RecordError, Sonata2dError
from .columns import Columns, columns_of, frames_to_compare
from .layout import ABSENT, COLUMNS, JsonDict, moving_doors, scene_to_json

if TYPE_CHECKING:
    from ..agents.sensors.base import Sensor
    from .models import Part

Finding = tuple[str, str]  # place, such as `frames.3.robot`, and what is wrong

_ENTITIES = ("humans", "objects", "groups", "doors", "queues", "places")  # the first two share their ids
_FIXTURES = ("walls", "objects", "doors", "queues", "places")
_MAX_FINDINGS = 100  # of the schema: of each list the first faulty entry


def require_valid(document: Any, path: Path) -> Columns:
    """Require a valid document of an episode.

    Args:
        document: parsed JSON.
        path: of the file, for the message.

    Returns:
        The arrays of the document.

    Raises:
        InvalidFileError: it is invalid; one line with the first finding, and all of them as `findings`.
    """
    try:
        columns = columns_of(document)
        reduced = document | {"frames": frames_to_compare(document, columns)}
    except (LookupError, TypeError, ValueError, OverflowError):
        reduced = document  # the schema says why
    findings = list(_findings(document, reduced))
    if findings:
        place, message = findings[0]
        rest = len(findings) - 1
        more = f" (and at least {rest} more; `sonata2d check` lists the first of each list)" if rest else ""
        raise InvalidFileError(f"{path} is not a valid episode: {place}: {message}{more}", findings)
    return columns


def consistent_scene(scene: Scene) -> JsonDict:
    """`scene_to_json` of a scene whose file can be read.

    Raises:
        RecordError: ids are not unique, references refer to nothing, a number is not finite, or there are more
            walls, objects, doors, queues or places than a file may hold.
    """
    document = scene_to_json(scene)
    for place, message in chain(_count_findings(document), _id_findings(document)):
        raise RecordError(f"the scene {scene.name} cannot be recorded: {place}: {message}")
    return document


def _count_findings(document: JsonDict) -> Iterator[Finding]:
    """Lists that are longer than the schema allows, for a scene that is not compared with the schema."""
    fixtures = {f"room.{key}": ring for key, ring in document["room"].items()}
    fixtures |= {key: document[key] for key in _FIXTURES}
    fixtures |= {key: document.get(key, ()) for key in ("areas", "interior_doors")}
    for place, entries in fixtures.items():
        if len(entries) > MAX_COUNT:
            yield place, f"there are {len(entries)}; the limit is {MAX_COUNT}"


def _findings(document: Any, reduced: Any) -> Iterator[Finding]:
    """All violations of the schema; if there are none, all inconsistencies of the content.

    Args:
        document: parsed JSON.
        reduced: the document without frames that agree with the schema.
    """
    from .models import Episode

    violations = list(schema_findings(reduced, Episode))
    if violations and reduced is not document:
        violations = list(schema_findings(document, Episode))  # with the numbers of all frames
    yield from violations
    if not violations:
        yield from _content_findings(document)


def schema_findings(document: Any, model: type[Part]) -> Iterator[Finding]:
    """Violations of the schema that a model describes."""
    from pydantic import ValidationError

    try:
        model.model_validate(document)
    except ValidationError as error:
        for finding in error.errors(include_url=False, include_context=False)[:_MAX_FINDINGS]:
            place = ".".join(map(str, finding["loc"]))
            if finding["type"] == "missing":
                yield place, "is missing"
            else:
                yield place, f"{finding['msg']}, got {shown(finding['input'])}"


def _content_findings(document: JsonDict) -> Iterator[Finding]:
    states = [*document["frames"], document["final"]]
    yield from _depth_findings(document)
    yield from _id_findings(document)
    yield from _activity_findings(document["activities"])
    yield from _attribute_findings(document)
    yield from _column_findings(document["columns"])
    yield from _label_findings(document)
    yield from _state_findings(document, states)
    yield from _reference_findings(document, states)
    if all(len(state.get("doors") or ()) == len(states[0].get("doors") or ()) for state in states):
        yield from _door_findings(document, states)
    if any(_has_readings(part) for part in (document, *document["frames"])):
        yield from _sensor_findings(document)
    for index, _ in (document.get("mirrored_from") or {}).get("thetas", ()):
        if not 0 <= index < len(document["objects"]):
            yield "mirrored_from.thetas", f"there is no object at index {index}"


def _depth_findings(document: JsonDict) -> Iterator[Finding]:
    """Labels, readings, settings and unknown keys of any structure must be possible to write again."""
    parts = {key: value for key, value in document.items() if key not in ("frames", "final")}
    free = [
        _free_values(each) for each in document["frames"] if "label" in each or "sensors" in each or "robots" in each
    ]
    for key, value in (parts | {"frames": free}).items():
        try:
            orjson.dumps(value)
        except orjson.JSONEncodeError:
            yield key, "values are nested more than 250 deep"


def _free_values(frame: JsonDict) -> list[Any]:
    """The values in a frame that may have any structure."""
    return [robot.get(key) for robot in (frame, *(frame.get("robots") or ())) for key in ("label", "sensors")]


def _id_findings(document: JsonDict) -> Iterator[Finding]:
    """Ids must be unique, and references must refer to existing entities."""
    ids = {key: [row["id"] for row in document[key]] for key in _ENTITIES}
    robots = [other["id"] for other in document.get("robots") or ()]
    of_kinds = {"ids": [ROBOT_ID, *robots, *ids["humans"], *ids["objects"]]} | {key: ids[key] for key in _ENTITIES[2:]}
    of_kinds["interior_doors"] = [door["id"] for door in document.get("interior_doors") or ()]
    for kind, numbers in of_kinds.items():
        for id, count in Counter(numbers).items():
            if count > 1:
                yield kind, f"id {id} is used {count} times"
    for group in document["groups"]:
        for id in set(group["members"]) - set(ids["humans"]):
            yield "groups", f"member {id} of group {group['id']} is not a human"
    for thing in document["objects"]:
        if thing["on"] is not None and thing["on"] not in ids["objects"]:
            yield "objects", f"object {thing['id']} lies on {thing['on']}, which is not an object"
    for human in document["humans"]:
        if human["behaviour"] == "recorded" and not human["track"]:
            yield "humans", f"human {human['id']} is recorded but has no track"
    if document.get("interior_doors") and document.get("version", 2) < 2:
        yield "version", "must be 2 for interior doors"
    yield from _start_findings(document, set(ids["queues"]))


def _start_findings(document: JsonDict, queue_ids: set[int]) -> Iterator[Finding]:
    """People must start on existing seats, one on each, and in existing queues."""
    things = (thing for thing in document["objects"] if thing["on"] is None)
    seat_ids = {thing["id"] for thing in things if is_seat_by_type(thing["type"], thing["seat"])}
    for human in document["humans"]:
        seat, queue = human["seat"], human["queue"]
        if seat is not None and seat not in seat_ids:
            yield "humans", f"human {human['id']} sits on {seat}, which is not a seat"
        if queue is not None and queue not in queue_ids:
            yield "humans", f"human {human['id']} stands in queue {queue}, which does not exist"
        if (seat, queue) != (None, None) and (human["behaviour"] != "wandering" or human["enters"] > 0):
            yield "humans", f"human {human['id']} has a seat or a queue, but does not wander from the start"
    seats = Counter(human["seat"] for human in document["humans"] if human["seat"] is not None)
    for seat, count in seats.items():
        if count > 1:
            yield "humans", f"{count} people sit on object {seat}"


def _attribute_findings(document: JsonDict) -> Iterator[Finding]:
    """Attributes must be declared, and their values as declared."""
    specs = {(row["of"], row["name"]): AttributeSpec(**row) for row in document.get("attributes") or ()}
    for (of, name), spec in specs.items():
        if spec.value is not None and (of != "episode" or spec.problem(spec.value)):
            yield "attributes", f"the value of {name} is not as declared"
    for of, key in (("people", "humans"), ("objects", "objects"), ("areas", "areas")):
        for k, row in enumerate(document.get(key) or ()):
            for name, value in (row.get("attributes") or {}).items():
                declared = specs.get((of, name))
                problem = declared.problem(value) if declared else "is not declared"
                if problem:
                    yield f"{key}.{k}.attributes", f"{name} {problem}"


def _activity_findings(names: list[str]) -> Iterator[Finding]:
    """Indices in frames refer to this list, and code behind the gate refers to `ACTIVITIES`."""
    if unknown := sorted(set(names) - set(ACTIVITIES)):
        yield "activities", f"unknown {unknown}"
    elif names != list(ACTIVITIES[: len(names)]):
        yield "activities", f"must be in the order {', '.join(ACTIVITIES)}"


def _column_findings(columns: JsonDict) -> Iterator[Finding]:
    for block, names in COLUMNS.items():
        if [column["name"] for column in columns[block]] != list(names):
            yield f"columns.{block}", f"must be {', '.join(names)}"


def _label_findings(document: JsonDict) -> Iterator[Finding]:
    """Answers must be possible answers to the question; an unanswered one is null."""
    settings = document.get("label_spec")
    if settings is None:
        return
    spec = LabelSpec.from_settings({key: settings[key] for key in LabelSpec.__dataclass_fields__})
    answers = [("label", document.get("label"))] if spec.per_run else []
    if spec.per_frame:
        labels = [(f"frames.{t}.label", frame.get("label")) for t, frame in enumerate(document["frames"])]
        answers = [(at, label.get(spec.name) if isinstance(label, dict) else label) for at, label in labels]
    for place, answer in answers:
        try:
            if answer is not None:
                spec.validate(answer)
        except ValueError as error:
            yield place, f"{error}"
            return


def _state_findings(document: JsonDict, states: list[JsonDict]) -> Iterator[Finding]:
    """Times must not decrease; a state must have a row for each pedestrian that is present, and null for the others."""
    time = states[0]["time"]
    count, names = len(document["humans"]), document["activities"]
    robots, arrivals = len(document.get("robots") or ()), document["outcome"].get("arrivals") or ()
    doors = len(moving_doors(document))
    if len(arrivals) != (1 + robots if robots else 0) or any(tick and tick >= len(states) for tick in arrivals):
        yield "outcome.arrivals", f"must be a tick or null for each of {1 + robots} robots, got {shown(arrivals)}"
    for t, state in enumerate(states):
        rows, activity = state["humans"], state["activity"]
        if state["tick"] != t:
            yield f"frames.{t}", f"tick should be {t}, is {state['tick']}"
            return
        if state["time"] < time:
            yield f"frames.{t}.time", f"is {state['time']} s, but {time} s in the state before"
            return
        time = state["time"]
        if len(state.get("doors") or ()) != doors:
            yield f"frames.{t}.doors", f"{len(state.get('doors') or ())} of {doors} interior doors that move"
            return
        if len(state.get("robots") or ()) != robots:
            yield f"frames.{t}.robots", f"{len(state.get('robots') or ())} of {robots} other robots"
            return
        if len(rows) != count or len(activity) != count:
            yield f"frames.{t}.humans", f"{len(rows)} rows and {len(activity)} activities of {count} people"
            return
        if count and max(activity) >= len(names):
            k = activity.index(max(activity))
            yield f"frames.{t}.activity.{k}", f"{activity[k]} is not in the list of activities"
            return
        if (None in rows or ABSENT in activity) and [r is None for r in rows] != [i == ABSENT for i in activity]:
            yield f"frames.{t}.humans", "must be null for people that are not present (activity -1), and only for these"
            return


def _door_findings(document: JsonDict, states: list[JsonDict]) -> Iterator[Finding]:
    """Doors begin as they are at the start, and their leaves move no faster than they can."""
    for door in document.get("interior_doors") or ():
        if door["kind"] == "sliding" and door.get("opening", 0.0) < 0.0:
            yield "interior_doors", f"the opening of sliding door {door['id']} is below 0"
    moving = moving_doors(document)
    if not moving:
        return
    openings = [[door.get("opening", 0.0) for door in moving], *(state["doors"] for state in states)]
    for t, (before, now) in enumerate(pairwise(openings)):
        for door, last, opening in zip(moving, before, now, strict=True):
            step = document["rules"]["dt"] / door.get("opening_time", 1.5) + document["precision"] if t else 0.0
            if abs(opening - last) > step + 1e-9 or (door["kind"] == "sliding" and opening < 0.0):
                yield f"frames.{t}.doors", f"door {door['id']} cannot be {opening:g} open after {last:g}"
                return


def _has_readings(part: JsonDict) -> bool:
    """Whether a document, or a frame, has sensors or readings of a robot."""
    return "sensors" in part or any("sensors" in robot for robot in part.get("robots") or ())


def _sensor_findings(document: JsonDict) -> Iterator[Finding]:
    """Readings must be those of the sensors that the document names."""
    from ..agents.sensors.base import sensor_from  # most files have no readings, and are read without sensors

    for k, robot in enumerate((document, *(document.get("robots") or ()))):
        place, definitions = f"robots.{k - 1}." if k else "", robot.get("sensors") or ()
        sensors, look_at = dict[str, Any](), partial(_ids_at, document, k)
        for definition in definitions:
            try:
                sensors[definition["name"]] = sensor_from(definition)
            except (TypeError, ValueError, Sonata2dError) as error:
                yield f"{place}sensors", f"{definition['name']}: {error}"
                return
        if len(sensors) < len(definitions):
            yield f"{place}sensors", "two have the same name"
        for t, frame in enumerate(document["frames"]):
            states = (frame, *(frame.get("robots") or ()))
            if k >= len(states):
                return  # as another finding says
            if message := _reading_problem(states[k].get("sensors") or {}, sensors, t, look_at):
                yield f"frames.{t}.{place}sensors", message
                return


def _reading_problem(
    readings: JsonDict, sensors: dict[str, Sensor | None], tick: int, look_at: Callable[[int], Any]
) -> str:
    """Why readings cannot be those of sensors; empty if they can."""
    for name, value in readings.items():
        if name not in sensors:
            return f"there is no sensor {name!r}"
        measured = value.get("tick", 0) if isinstance(value, dict) else 0
        if type(measured) is not int or not 0 <= measured <= tick:
            return f"{name}: tick must be 0 to {tick}, is {shown(measured)}"
        try:
            if sensor := sensors[name]:
                sensor.from_json(value, look_at)
        except KeyError as error:
            return f"{name}: {error} is missing"
        except (TypeError, ValueError) as error:
            return f"{name}: {text_of(error) or described(error)}"
    return ""


def _ids_at(document: JsonDict, robot: int, tick: int) -> SimpleNamespace:
    """In place of the snapshot of a tick from the view of a robot: the people present and the other robots, by ids."""
    activity = document["frames"][tick]["activity"]
    ids = [human["id"] for human, each in zip(document["humans"], activity, strict=True) if each != ABSENT]
    zeros = np.zeros(len(ids))
    columns = np.array(ids, dtype=int), zeros, zeros, zeros.astype(int), np.zeros(len(ids), dtype=str)
    humans = Humans(np.zeros((len(ids), HUMAN_SIZE)), *columns)
    robots = [ROBOT_ID, *(other["id"] for other in document.get("robots") or ())]
    return SimpleNamespace(humans=humans, robots=[SimpleNamespace(id=id) for k, id in enumerate(robots) if k != robot])


def _reference_findings(document: JsonDict, states: list[JsonDict]) -> Iterator[Finding]:
    """Interactions and contacts must be between existing entities."""
    humans, things = ({row["id"] for row in document[key]} for key in ("humans", "objects"))
    robots = {ROBOT_ID, *(other["id"] for other in document.get("robots") or ())}
    known = humans | things | robots
    doors = {door["id"] for door in document.get("interior_doors") or ()}
    walls = range(len(document["walls"]))
    touchable = {"human": humans, "object": things, "wall": walls, "door": doors, "robot": robots}
    for src, relation, dst in document["interactions"]:
        if src not in humans or dst not in known or relation not in RELATIONS:
            yield "interactions", f"{relation} of {src} and {dst}: unknown relation or entity"
    unknown = {(src, dst) for state in states for src, _, dst in state["interactions"]}
    unknown = {(src, dst) for src, dst in unknown if src not in humans or dst not in known}
    for t, state in enumerate(states):
        for src, relation, dst in state["interactions"] if unknown else ():
            if (src, dst) in unknown:
                yield f"frames.{t}.interactions", f"{relation} of {src} and {dst}: unknown entity"
                return
        if not state["contacts"] and "robots" not in state:
            continue
        for contact in chain(state["contacts"], *(other["contacts"] for other in state.get("robots") or ())):
            if contact["id"] not in touchable[contact["kind"]]:
                yield f"frames.{t}.contacts", f"there is no {contact['kind']} {contact['id']}"
                return
