"""The schema of SocNav3 trajectory files, written from its list of fields."""

from __future__ import annotations

from typing import Any

NUMBER: dict[str, Any] = {"type": "number"}


def thing(required: dict[str, Any], optional: dict[str, Any] | None = None) -> dict[str, Any]:
    """An object with these keys; extra ones are allowed."""
    return {"type": "object", "properties": required | (optional or {}), "required": list(required)}


def numbers(*names: str) -> dict[str, Any]:
    return dict.fromkeys(names, NUMBER)


def shape(*names: str) -> dict[str, Any]:
    return thing({"type": {"enum": list(names)}} | numbers("width", "length"))


POSE = numbers("x", "y", "angle")
GOAL = thing(
    {"type": {"enum": ["go-to", "guide-to", "follow"]}, "human": {"type": ["null", "number"]}} | POSE,
    numbers("pos_threshold", "angle_threshold"),
)
KINDS = {"enum": ["chair", "table", "plant", "tv", "shelf", "floor_lamp"]}
STEP = thing(
    {
        "timestamp": NUMBER,
        "robot": thing(POSE | numbers("speed_x", "speed_y", "speed_a") | {"shape": shape("circle", "rectangle")}),
        "people": {"type": "array", "items": thing({"id": NUMBER} | POSE)},
        "objects": {
            "type": "array",
            "items": thing({"id": NUMBER, "type": KINDS} | POSE | {"shape": shape("circle", "rectangle")}),
        },
        "goal": GOAL,
    }
)
GRID = thing(
    numbers("width", "height", "cell_size", "x_orig", "y_orig", "angle_orig")
    | {"data": {"type": "array", "items": {"type": "array", "items": {"enum": [-1, 0, 1]}}}}
)
SCHEMA = thing(
    {
        "grid": GRID,
        "walls": {"type": "array", "items": {"type": "array", "items": NUMBER, "minItems": 4, "maxItems": 4}},
        "sequence": {"type": "array", "items": STEP},
    },
    {"metadata": {"type": "string"}, "context_description": {"type": "string"}, "label": NUMBER},
)
