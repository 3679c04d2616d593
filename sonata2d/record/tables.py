"""Episodes as four tables that join on `episode_id` and `tick`; docs/formats.md describes their columns."""

from __future__ import annotations

from typing import Any

import numpy as np
import orjson

from .layout import COMMAND_NAMES, HUMAN_NAMES, ROBOT_NAMES, JsonDict
from .record import EpisodeRecord

TABLES = ("episodes", "frames", "agents", "interactions")
CONTACT_COLUMNS = ("human", "object", "wall")  # kinds of contacts that `episodes` counts
JSON_KEYS = ("contacts", "doors", "robots", "events", "label", "sensors")  # columns of `frames` that hold JSON


def tables_of(record: EpisodeRecord, name: str) -> dict[str, dict[str, Any]]:
    """The columns of each table for one episode.

    Args:
        record: the episode.
        name: its key `episode_id`, such as the name of its file without suffix.

    Returns:
        Columns of equal length by name, by table.
    """
    frames = [*record.document["frames"], record.document["final"]]
    rows = [(frame["tick"], *interaction) for frame in frames for interaction in frame["interactions"]]
    tick, src, relation, dst = (list(column) for column in zip(*rows, strict=True)) if rows else ([], [], [], [])
    return {
        "episodes": _episode(record, name),
        "frames": _frames(record, name, frames),
        "agents": _agents(record, name),
        "interactions": {
            "episode_id": [name] * len(rows), "tick": tick, "src": src, "relation": relation, "dst": dst
        },
    }  # fmt: skip


def _episode(record: EpisodeRecord, name: str) -> dict[str, Any]:
    document, scene = record.document, record.scene()
    header = {key: value for key, value in document.items() if key not in ("frames", "final")}
    row = {key: document[key] for key in ("name", "family", "contributor", "context", "seed", "episode", "physics")}
    row |= {
        "episode_id": name,
        "outcome": record.outcome.status,
        "outcome_reason": record.outcome.reason,
        "frames": len(record),
        "dt": scene.rules.dt,
        "goal_x": scene.goal.x,
        "goal_y": scene.goal.y,
        "goal_distance": scene.goal.distance,
        "robot_radius": scene.robot.radius,
        **{f"{kind}_contacts": _contacts(document, kind) for kind in CONTACT_COLUMNS},
        "label": _json(document, "label"),
        "header": orjson.dumps(header).decode(),
    }
    return {key: [value] for key, value in row.items()}


def _contacts(document: JsonDict, kind: str) -> int | None:
    """Number of states in which the robot is in contact with something of a kind; None if contacts are unknown."""
    if document.get("imported"):
        return None
    states = (*document["frames"], document["final"])
    return sum(any(row["kind"] == kind for row in state["contacts"]) for state in states)


def _json(tree: JsonDict, key: str) -> str | None:
    return orjson.dumps(tree[key]).decode() if key in tree else None


def _frames(record: EpisodeRecord, name: str, frames: list[JsonDict]) -> dict[str, Any]:
    robot = {f"robot_{key}": record.states.robot[:, k] for k, key in enumerate(ROBOT_NAMES)}
    goal = {f"goal_{key}": record.goals[:, k] for k, key in enumerate(("x", "y", "theta"))}
    twists = {
        f"{kind}_{key}": [frame[kind][k] if kind in frame else None for frame in frames]
        for kind in ("command", "executed")
        for k, key in enumerate(COMMAND_NAMES)
    }
    return {
        "episode_id": [name] * len(frames),
        "tick": record.states.tick,
        "time": record.states.time,
        **robot,
        **goal,
        **twists,
        "guarded": [frame.get("guarded") for frame in frames],
        **{key: [_json(frame, key) for frame in frames] for key in JSON_KEYS},
    }


def _agents(record: EpisodeRecord, name: str) -> dict[str, Any]:
    """A row for each pedestrian that is present in a frame."""
    states, humans = record.states, record.scene().human_table
    t, k = np.nonzero(states.present)
    activities = np.array(record.document["activities"], dtype=object)
    rows = states.humans[t, k]
    return {
        "episode_id": [name] * len(t),
        "tick": states.tick[t],
        "human_id": humans.id[k],
        **{key: rows[:, column] for column, key in enumerate(HUMAN_NAMES)},
        "activity": activities[states.activity[t, k]].tolist(),
        "radius": humans.radius[k],
        "breadth": np.array([human.breadth for human in record.scene().humans], dtype=float)[k],
    }
