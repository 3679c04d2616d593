"""`graph-policy`: a network trained on recorded episodes drives the robot."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..agents.controllers.learned import LearnedController
from ..core.geometry import Twist
from ..core.portable_math import Array, IntArray
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..record.layout import ROW_THETA
from .graph.features import INSTANTS
from .graph.graph import INTERVAL, ROUNDING, Graph
from .graph.modern import graph_of_observations, inputs_of_rows, modern_rows
from .graph.paper import LABEL_SIGNS, nodes_of_instants, paper_graph, paper_rows
from .graph.source import Observation, SceneNodes, observation_of
from .network import network_of
from .weights import STOCK, read_weights


class GraphPolicy(LearnedController):
    """Drives with a network that reads graphs of pedestrians, objects, walls, the goal and the interactions.

    Args:
        weights: a file of `write_weights`; None: the weights that come with the package.

    Raises:
        ControllerError: the file does not hold the weights of a known network.

    Example:
        >>> import sonata2d as s2
        >>> scene = s2.generate(s2.ScenarioConfig(humans=(2, 4), rules={"time_limit": 1.0}), seed=1)
        >>> s2.Episode(scene, GraphPolicy()).run().status
        'timeout'
    """

    version = "1"
    stock = "graph-policy"

    def __init__(self, weights: str | Path | None = None) -> None:
        self._path = None if weights is None else str(weights)
        self._weights = read_weights(STOCK if weights is None else Path(weights).absolute())
        self._sha256 = self._weights.sha256
        self._network = network_of(self._weights)

    def reset(self, scene: Scene) -> None:
        self._step = math.ceil((INTERVAL - ROUNDING) / scene.rules.dt)  # ticks between instants, as in recordings
        self._history: deque[Observation] = deque(maxlen=(INSTANTS - 1) * self._step + 2)
        limits = scene.robot.limits
        self._scale = np.array([limits.ahead, scene.robot.sideways_limit, limits.turn])
        self._scene_nodes = SceneNodes(scene)

    def act(self, snapshot: Snapshot) -> Twist:
        self._history.append(observation_of(snapshot))
        if self._weights.graph == "modern":
            fraction = self._network(*self._modern_inputs())
        else:
            fraction = self._network(*self._paper_inputs()) * LABEL_SIGNS
        return Twist(*(fraction * self._scale).tolist())

    def _modern_inputs(self) -> tuple[Array, IntArray, IntArray]:
        """Inputs, edges and relations of the graph at the current tick."""
        newest = self._history[-1]
        nodes = self._scene_nodes.of([newest])
        rows = modern_rows(self._scene_nodes, nodes, [newest], newest.robot[: ROW_THETA + 1])
        return inputs_of_rows(rows, nodes.goal), *nodes.edges([newest.interactions])

    def _paper_inputs(self) -> tuple[Array, IntArray, IntArray]:
        instants = self._instants()
        nodes = nodes_of_instants(self._scene_nodes, instants)
        rows, _ = paper_rows(self._scene_nodes, nodes, instants, is_first=self._is_first(instants))
        return rows, *nodes.edges([current.interactions for current, _ in instants])

    def graph(self, scene: Scene) -> Graph:
        """Return the graph that the network reads at the current tick; call `act` first."""
        newest = self._history[-1]
        if self._weights.graph == "modern":
            return graph_of_observations(self._scene_nodes, [newest], newest.robot[: ROW_THETA + 1])
        instants = self._instants()
        return paper_graph(self._scene_nodes, instants, is_first=self._is_first(instants))

    def _is_first(self, instants: list[tuple[Observation, Observation]]) -> bool:
        """Whether the oldest instant is the first one of `paper_graphs` with `skip_first`."""
        return instants[-1][0].tick < 2 * self._step

    def _instants(self) -> list[tuple[Observation, Observation]]:
        """Observations a second apart, the newest first, each with the one of the tick before.

        The graphs for training, `paper_graphs` with `skip_first`, have no instant in the first second of an episode. So
        older instants in it are left out, and if the newest one is in it, it is treated as one second old.
        """
        by_tick, newest = {observation.tick: observation for observation in self._history}, self._history[-1]
        wanted = [newest.tick - i * self._step for i in range(INSTANTS)]
        ticks = [newest.tick, *(tick for tick in wanted[1:] if tick >= self._step and tick in by_tick)]
        # The first observation of all has no predecessor: it is paired with itself, which gives zero velocities.
        (current, before), *older = [(by_tick[tick], by_tick.get(tick - 1, by_tick[tick])) for tick in ticks]
        return [(replace(current, tick=max(current.tick, self._step)), before), *older]
