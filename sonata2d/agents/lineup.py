"""A row for everybody: what lines up a snapshot, which shows those present, with the scene's people."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..exact import Array
from ..frame import Snapshot
from ..humans import HX, LX, Humans, X, Y, activities_of, frozen, human_ids


def lined_up(snapshot: Snapshot) -> tuple[Snapshot, Array | None]:
    """The snapshot with a row for every person of the scene, and who is there.

    Returns:
        The snapshot, in which absent people stand at their parking places with all ties of the scene, and (N + 1,),
        1 for those who are there and for the robot, the last, 0 for the others. Where everybody is there, the snapshot
        as it is, and None.
    """
    humans, scene = snapshot.humans, snapshot.scene
    if humans.row is None:
        return snapshot, None
    count = len(scene.humans)
    state = humans.among_all(humans.state, count, 0.0)
    there = np.zeros(count + 1)
    there[humans.row], there[-1] = 1.0, 1.0
    away = there[:-1] == 0.0
    state[away, X : Y + 1] = scene.parking[away]
    state[away, HX] = state[away, LX] = 1.0
    radius = frozen(np.array([human.radius for human in scene.humans], dtype=float))
    everybody = Humans(frozen(state), human_ids(scene), radius, activities_of(scene))
    return replace(snapshot, humans=everybody, interactions=scene.interactions), there
