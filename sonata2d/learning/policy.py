"""`graph-policy`: the robot driven by a network that has learned from recorded runs."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from ..agents.controllers.base import Controller
from ..core.geometry import Twist
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import ControllerError
from .graph.graph import INTERVAL, ROUNDING, Graph
from .graph.modern import graph_of_looks
from .graph.paper import INSTANTS, TURNED, paper_graph
from .graph.source import Look, look_of
from .inputs import inputs_of
from .network import network_of
from .weights import STOCK, read_weights


class GraphPolicy(Controller):
    """Drives as a network learned to, from graphs of people, things, walls, the goal and who attends to whom.

    Args:
        weights: a file of `write_weights`; the package's own if None.

    Raises:
        ControllerError: the file holds no weights of a network that is known here.
    """

    version = "1"

    def __init__(self, weights: str | Path | None = None) -> None:
        self._path = None if weights is None else str(weights)
        self._weights = read_weights(STOCK if weights is None else Path(weights).resolve())
        self._network = network_of(self._weights)

    def settings(self) -> dict[str, Any]:
        return {"weights": self._path, "sha256": self._weights.sha256}

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], *, found: str | None = None) -> Self:
        """As a file tells of it.

        Args:
            settings: as in the file.
            found: where its weights are now, if they may have been moved.

        Raises:
            ControllerError: there are other weights now.
        """
        policy = cls(found or settings.get("weights"))
        if settings.get("sha256", policy._weights.sha256) != policy._weights.sha256:
            name, told = policy._path or "graph-policy", str(settings["sha256"])[:8]
            raise ControllerError(f"{name} has other weights now than those that drove, of SHA-256 {told}…; bring them")
        policy._path = settings.get("weights", policy._path)
        return policy

    def reset(self, scene: Scene) -> None:
        self._step = math.ceil((INTERVAL - ROUNDING) / scene.rules.dt)  # ticks, as of recordings
        self._looks: deque[Look] = deque(maxlen=(INSTANTS - 1) * self._step + 2)
        robot, limits = scene.robot, scene.robot.limits
        sideways = limits.sideways if robot.kinematics == "holonomic" else 0.0
        self._scale = np.array([limits.ahead, sideways, limits.turn])

    def act(self, snapshot: Snapshot) -> Twist:
        self._looks.append(look_of(snapshot))
        graph = self.graph(snapshot.scene)
        share = self._network(inputs_of(graph), graph.edges, graph.relation)
        if self._weights.graph == "paper":
            share = share * TURNED
        return Twist(*(share * self._scale).tolist())

    def graph(self, scene: Scene) -> Graph:
        """What the network reads now."""
        newest = self._looks[-1]
        if self._weights.graph == "modern":
            return graph_of_looks(scene, [newest], newest.robot[:3])
        instants = self._instants()
        return paper_graph(scene, instants, first=instants[-1][0].tick < 2 * self._step)

    def _instants(self) -> list[tuple[Look, Look]]:
        """Looks a second apart, the newest first, each with the one before it.

        As in recordings none is of the first second; the newest, if it is, counts as a second old.
        """
        known, newest = {look.tick: look for look in self._looks}, self._looks[-1]
        wanted = [newest.tick - i * self._step for i in range(INSTANTS)]
        told = [newest.tick, *(tick for tick in wanted[1:] if tick >= self._step and tick in known)]
        (look, before), *older = [(known[tick], known.get(tick - 1, known[tick])) for tick in told]
        return [(replace(look, tick=max(look.tick, self._step)), before), *older]
