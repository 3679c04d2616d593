"""Parts of an observation with the attributes that a scenario declares."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..core.attributes import AttributeColumn, Holder, attribute_columns
from ..core.bounds import MAX_MAGNITUDE
from ..core.portable_math import Array
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import ConfigError
from ..registry import OBSERVATION_PARTS
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.load import scenario_of
from .parts import ATTRIBUTE_PARTS, Column, Rows, SnapshotPart


class _Attributes(SnapshotPart):
    """Base class of the parts: one row for each person or object, or a vector of the episode.

    Attributes:
        of: holders of the attributes.
        numeric: columns of the attributes.
    """

    about = frozenset()
    of: ClassVar[Holder] = "episode"
    numeric: ClassVar[tuple[AttributeColumn, ...]] = ()

    def begin(self, scene: Scene) -> None:
        columns = attribute_columns(scene.attributes, self.of)
        if [column.name for column in columns] != [column.name for column in self.numeric]:
            raise ConfigError(
                f"the part {self.name} is of a scenario with other attributes of {self.of} than {scene.name}; call "
                "register_attribute_parts for this one before the environment is made"
            )
        holders: list[Any] = [scene.attributes_of()]
        if self.rows_of:
            holders = [each.attributes for each in (scene.humans if self.rows_of == "humans" else scene.furniture)]
        numbers = [[column.number(values) for column in self.numeric] for values in holders]
        self._numbers: Array = np.array(numbers, dtype=float).reshape(-1, len(self.numeric))

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        if not self.rows_of:
            out[:] = self._numbers[0]
            return
        index = rows.humans if self.rows_of == "humans" else rows.objects
        out[index >= 0] = self._numbers[index[index >= 0]]


class _AtRobot(_Attributes):
    """The attributes of the area in which the robot's centre is."""

    def begin(self, scene: Scene) -> None:
        super().begin(scene)
        self._scene = scene

    def fill(self, snapshot: Snapshot, rows: Rows, out: NDArray[Any]) -> None:
        out[:] = self._scene.attributes_at(self.numeric, np.array([snapshot.robot.position]))[0]


def register_attribute_parts(config: str | Path | ScenarioConfig) -> list[str]:
    """Register observation parts for the attributes of a scenario; they replace those of an earlier call.

    Classes are one column each, of 0 or 1, flags a column of 0 or 1, numbers a column; texts are not observed. A
    program that restores a policy with these parts registers them first.

    Args:
        config: settings of the scenario, or the name of a preset or path of a file.

    Returns:
        Names of the parts, for `SocialNavEnv(parts=...)`: `human_attributes`, `object_attributes`, `area_attributes`,
        of the first area with a value in which the robot's centre is, and `episode_attributes`, as far as the scenario
        declares such attributes.

    Raises:
        ConfigError: there is no such preset or file, or the file is invalid.
    """
    specs, names = scenario_of(config).attributes.specs, []
    for of, (name, rows_of) in ATTRIBUTE_PARTS.items():
        columns = attribute_columns(specs, of)
        if not columns:
            continue
        bound = MAX_MAGNITUDE
        of_numbers = {"number": (bound, -bound), "yes_no": (1.0, 0.0), "classes": (1.0, 0.0)}
        fields: dict[str, Any] = {
            "__doc__": f"Attributes of {of}.", "name": name, "rows_of": rows_of, "of": of, "numeric": columns,
            "columns": tuple(Column(each.name, "", *of_numbers[each.spec.type]) for each in columns),
        }  # fmt: skip
        base = _AtRobot if of == "areas" else _Attributes
        fields["about"] = frozenset({"robot"} if of == "areas" else {rows_of} if rows_of else ())
        OBSERVATION_PARTS.register(name, type(f"Attributes_{name}", (base,), fields))
        names.append(name)
    return names
