"""A part of a Gymnasium observation: the number of pedestrians near the robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sonata2d.gym import Column, DerivedPart, Table

RADIUS = 2.0  # m


class Crowding(DerivedPart):
    """Number of observed pedestrians within 2 m."""

    name, about = "crowding", frozenset({"humans"})
    columns = (Column("count", high=100.0),)

    def derive(self, tables: Mapping[str, Table]) -> Sequence[float]:
        humans = tables["humans"]
        return [float(np.count_nonzero(np.hypot(humans["x"], humans["y"]) < RADIUS))]
