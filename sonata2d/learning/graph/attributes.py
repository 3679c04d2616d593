"""Attributes of people, objects and areas as further features of the nodes of a graph."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...core.attributes import Holder, attribute_columns
from ...core.portable_math import Array
from ...record.record import EpisodeRecord
from .graph import NODE_TYPES, Graph

_HUMAN, _OBJECT, _HUB = (NODE_TYPES.index(name) for name in ("human", "object", "room"))


def with_attributes(graph: Graph, record: EpisodeRecord) -> Graph:
    """Return a graph with features for the attributes of people, objects and areas.

    Args:
        graph: with F features.
        record: the episode of the graph, with the declared attributes.

    Returns:
        The graph with A further features, named `people.emotion=angry`, `objects.fragile`, `areas.quiet` and so on: 1
        for the class of a node or a flag that is true, or the number; 0 for all other nodes. The attributes of areas
        are features of the people, the objects and the hub, by the area in which a person, an object or the robot is at
        the instant. Texts have no feature.
    """
    scene = record.scene()
    values = {human.id: human.attributes for human in scene.humans}
    values |= {piece.id: piece.attributes for piece in scene.furniture}
    names, blocks = [*graph.feature_names], [graph.features]
    holders: tuple[tuple[Holder, int], ...] = (("people", _HUMAN), ("objects", _OBJECT))
    for of, kind in holders:
        for column in attribute_columns(scene.attributes, of):
            numbers = {id: column.number(attributes) for id, attributes in values.items()}
            is_of = graph.node_type == kind
            block = [  # robots that are seen as people have no attributes
                numbers.get(id, 0.0) if each else 0.0 for id, each in zip(graph.entity.tolist(), is_of, strict=True)
            ]
            names.append(f"{of}.{column.name}")
            blocks.append(np.array(block, dtype=float)[:, None])
    if in_areas := attribute_columns(scene.attributes, "areas"):
        names += [f"areas.{column.name}" for column in in_areas]
        blocks.append(scene.attributes_at(in_areas, _places(graph, record)))
    return replace(graph, feature_names=tuple(names), features=np.concatenate(blocks, axis=1))


def _places(graph: Graph, record: EpisodeRecord) -> Array:
    """Where the person or object of each node is at its instant, and the robot of the hub; (k N, 2), m, world frame."""
    seen, states = record.with_robots_as_people(), record.states
    scene, places = seen.scene(), np.full((len(graph.entity), 2), np.nan)
    person = {human.id: k for k, human in enumerate(scene.humans)}
    furniture = {piece.id: piece.pose.position for piece in scene.furniture}
    for n, (kind, id, instant) in enumerate(zip(graph.node_type, graph.entity.tolist(), graph.instant, strict=True)):
        tick = graph.ticks[instant]
        if kind == _HUB:
            places[n] = states.robot[tick, :2]
        elif kind == _HUMAN:
            places[n] = seen.states.humans[tick, person[id], :2]
        elif kind == _OBJECT:
            places[n] = furniture[id]
    return places
