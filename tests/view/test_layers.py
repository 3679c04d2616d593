"""Interactions of a group of six: lines between neighbours only, and one shared space."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

from sonata2d.core.entities import Group, Interaction
from sonata2d.core.relations import AT_OBJECT, TALKING
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.view.layers import Layers, _interacting_groups, visible_interactions
from sonata2d.view.stills import picture

from .conftest import snapshot_at


def six(scene: Scene, formation: str | None) -> Snapshot:
    """Six pedestrians that all talk with each other."""
    ids = tuple(human.id for human in scene.humans)
    interactions = tuple(Interaction(a, TALKING, b) for a, b in combinations(ids, 2))
    groups = (Group(1, "talking", ids, formation),)  # type: ignore[arg-type]
    return snapshot_at(replace(scene, groups=groups, interactions=interactions))


def test_a_circle_of_six_has_six_lines(scene: Scene) -> None:
    ids = [human.id for human in scene.humans]
    drawn = {frozenset((link.src, link.dst)) for link in visible_interactions(six(scene, "circle"))}
    assert drawn == {frozenset(pair) for pair in zip(ids, [*ids[1:], ids[0]], strict=True)}


def test_an_open_row_is_not_closed(scene: Scene) -> None:
    assert len(visible_interactions(six(scene, "semicircle"))) == 5
    assert len(visible_interactions(six(scene, None))) == 5


def test_a_circle_stays_closed_when_a_member_leaves(scene: Scene) -> None:
    snapshot, gone = six(scene, "circle"), scene.humans[2].id
    remaining = tuple(link for link in snapshot.interactions if gone not in (link.src, link.dst))
    drawn = visible_interactions(replace(snapshot, interactions=remaining))
    assert len(drawn) == 5
    assert not any(gone in (link.src, link.dst) for link in drawn)


def test_a_member_that_turns_to_an_object_leaves_the_circle(scene: Scene) -> None:
    snapshot, (gone, *_) = six(scene, "circle"), (human.id for human in scene.humans)
    remaining = tuple(link for link in snapshot.interactions if gone not in (link.src, link.dst))
    interactions = (*remaining, Interaction(gone, AT_OBJECT, scene.furniture[0].id))
    ((members, _),) = _interacting_groups(replace(snapshot, interactions=interactions), "talking")
    assert gone not in members
    assert len(members) == 5


def test_interactions_of_pairs_and_with_objects_are_all_drawn(scene: Scene) -> None:
    assert visible_interactions(snapshot_at(scene)) == list(scene.interactions)


def test_the_shared_space_of_a_group_belongs_to_the_zones(scene: Scene) -> None:
    with_zones, without = Layers(zones=True, caption=False), Layers(caption=False)
    snapshot = six(scene, "circle")
    pictures = [picture(snapshot, size=(300, 240), layers=layers).get_buffer().raw for layers in (with_zones, without)]
    assert pictures[0] != pictures[1]
