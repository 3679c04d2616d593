"""Attributes of people and objects as further features of the nodes of a graph."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...core.attributes import Holder, attribute_columns
from ...core.scene import Scene
from .graph import NODE_TYPES, Graph

_HUMAN, _OBJECT = NODE_TYPES.index("human"), NODE_TYPES.index("object")


def with_attributes(graph: Graph, scene: Scene) -> Graph:
    """Return a graph with features for the attributes of its people and objects.

    Args:
        graph: with F features.
        scene: of the graph, with the declared attributes.

    Returns:
        The graph with A further features, named `people.emotion=angry`, `objects.fragile` and so on: 1 for the class of
        a node or a flag that is true, or the number; 0 for all other nodes. Texts have no feature.
    """
    values = {human.id: human.attributes for human in scene.humans}
    values |= {piece.id: piece.attributes for piece in scene.furniture}
    names, blocks = [*graph.feature_names], [graph.features]
    holders: tuple[tuple[Holder, int], ...] = (("people", _HUMAN), ("objects", _OBJECT))
    for of, kind in holders:
        for column in attribute_columns(scene.attributes, of):
            numbers = {id: column.number(attributes) for id, attributes in values.items()}
            is_of = graph.node_type == kind
            block = [numbers[id] if each else 0.0 for id, each in zip(graph.entity.tolist(), is_of, strict=True)]
            names.append(f"{of}.{column.name}")
            blocks.append(np.array(block, dtype=float)[:, None])
    return replace(graph, feature_names=tuple(names), features=np.concatenate(blocks, axis=1))
