"""Scenarios from maps, by the reader of their format."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.doors import DoorKind
from ...core.rng import RandomStream
from ...core.wording import one_line
from ...errors import ConfigError, SceneError
from ...registry import MAP_READERS
from ..floor_plans import draw_floor_plan
from ..interior_doors import opening_at
from ..scenario.config import ScenarioConfig
from .plan import MapOptions, Picture, Plan, corners_of, piece_settings, shapely

_PEOPLE = {"standing": [0, 4], "wandering": [2, 6], "tables": 0, "plants": 0, "relations": 0}  # drawn by default
_SLOWEST = 0.4  # m/s, at which a robot crosses the whole building three times within the time limit
_SHORTEST = 60.0  # s


@dataclass(frozen=True)
class MapScenario:
    """A scenario from a map.

    Attributes:
        config: the scenario.
        picture: the map.
        facts: number of walls, rooms, pieces of furniture and doors, and the area of the floor, m².
        notes: what was left out or changed.
    """

    config: ScenarioConfig
    picture: Picture
    facts: dict[str, Any]
    notes: list[str]


def scenario_from_map(path: str | Path, **options: Any) -> MapScenario:
    """Make a scenario of a floor plan: a map of ROS, an image, or an SVG or DXF drawing.

    The room is the connected floor with its walls. People and the robot are placed on it as in any scenario. Rooms are
    `areas`, doors to the outside are `doors`, and obstacles on the floor are furniture.

    Args:
        path: a file of a format in `registry.MAP_READERS`, by its suffix: `.yaml` (ROS), `.png` and other images,
            `.svg`, `.dxf`.
        options: fields of `MapOptions`.

    Raises:
        ConfigError: the suffix is unknown, the file cannot be read, or it has no floor.
        TypeError: an option is unknown.
    """
    path = Path(path)
    loaded = [MAP_READERS.load(name) for name in MAP_READERS]
    readers = {suffix: reader for reader in loaded for suffix in reader.suffixes}
    if path.suffix.lower() not in readers:
        raise ConfigError(f"{path}: maps have one of the suffixes {', '.join(readers)}")
    reader, geometry = readers[path.suffix.lower()](), shapely()
    try:
        chosen = MapOptions(**options)
        plan = reader.read(path, chosen)
        settings = _settings(plan, path)
    except geometry.errors.ShapelyError as error:
        raise ConfigError(f"{path.name}: the outlines of the map cannot be used: {one_line(error, 200)}") from error
    try:
        config = ScenarioConfig(**settings)
    except ConfigError as error:
        raise ConfigError(f"{path}: the map gives no valid scenario: {error}") from error
    if chosen.leaves:
        config = _with_leaves(config, plan, chosen.leaves)
    rings = (config.room.polygon or (), *config.room.holes)
    facts = {
        "walls": sum(map(len, rings)),
        "rooms": len(config.areas),
        "furniture": len(config.furniture),
        "entrances": len(config.doors),
        **({"doors that open": len(config.interior_doors)} if config.interior_doors else {}),
        "floor": round(float(plan.floor.area), 1),
    }
    return MapScenario(config, plan.picture, facts, plan.notes)


def _with_leaves(config: ScenarioConfig, plan: Plan, kind: DoorKind) -> ScenarioConfig:
    """The scenario with leaves of a kind in the doorways between rooms; what has no walls on both sides is noted."""
    room, doors = draw_floor_plan(config.room, RandomStream(0, 0, "scene")), []
    for x, y in plan.doorways:
        place = round(x, 3), round(y, 3)
        try:
            opening_at(room, place)
        except SceneError as error:
            plan.notes.append(f"a door stays a free doorway: {error}")
        else:
            doors.append({"x": place[0], "y": place[1], "kind": kind})
    if not plan.doorways:
        plan.notes.append("there are no doors between rooms that could open and close; images have none")
    return config.changed(interior_doors=doors)


def _settings(plan: Plan, path: Path) -> dict[str, Any]:
    low_x, low_y, high_x, high_y = plan.floor.bounds
    across = math.hypot(high_x - low_x, high_y - low_y)
    return {
        "name": path.stem,
        "description": f"floor plan of {path.name}",
        **_PEOPLE,
        "room": {
            "polygon": corners_of(plan.floor.exterior),
            "holes": [corners_of(ring) for ring in plan.floor.interiors],
        },
        "areas": [{"name": name, "polygon": corners_of(area.exterior)} for name, area in plan.areas.items()],
        "furniture": [piece_settings(piece) for piece in plan.furniture],
        "doors": [
            {"x": round(x, 3), "y": round(y, 3), "width": round(min(max(width, 0.7), 3.0), 2)}
            for (x, y), width in plan.entrances
        ],
        "rules": {"time_limit": float(math.ceil(max(_SHORTEST, 3.0 * across / _SLOWEST)))},
    }
