"""A group of six stays legible: lines between neighbours, one space for all."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

from sonata2d.core.entities import AT_OBJECT, TALKING, Group, Interaction
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.view.draw import Layers, picture
from sonata2d.view.ties import circles, drawn_ties

from .conftest import look


def six(scene: Scene, formation: str | None) -> Snapshot:
    """Six people who all talk with each other."""
    ids = tuple(human.id for human in scene.humans)
    ties = tuple(Interaction(a, TALKING, b) for a, b in combinations(ids, 2))
    groups = (Group(1, "talking", ids, formation),)  # type: ignore[arg-type]
    return look(replace(scene, groups=groups, interactions=ties))


def test_of_a_circle_of_six_six_lines_are_drawn(scene: Scene) -> None:
    ids = [human.id for human in scene.humans]
    drawn = {frozenset((tie.src, tie.dst)) for tie in drawn_ties(six(scene, "circle"))}
    assert drawn == {frozenset(pair) for pair in zip(ids, [*ids[1:], ids[0]], strict=True)}


def test_an_open_row_is_not_closed(scene: Scene) -> None:
    assert len(drawn_ties(six(scene, "semicircle"))) == 5
    assert len(drawn_ties(six(scene, None))) == 5


def test_who_left_a_circle_leaves_no_gap_in_it(scene: Scene) -> None:
    snapshot, gone = six(scene, "circle"), scene.humans[2].id
    stay = tuple(tie for tie in snapshot.interactions if gone not in (tie.src, tie.dst))
    drawn = drawn_ties(replace(snapshot, interactions=stay))
    assert len(drawn) == 5
    assert not any(gone in (tie.src, tie.dst) for tie in drawn)


def test_who_left_a_circle_for_a_thing_is_no_longer_in_it(scene: Scene) -> None:
    snapshot, (gone, *_) = six(scene, "circle"), (human.id for human in scene.humans)
    stay = tuple(tie for tie in snapshot.interactions if gone not in (tie.src, tie.dst))
    ties = (*stay, Interaction(gone, AT_OBJECT, scene.furniture[0].id))
    ((ring, _),) = circles(replace(snapshot, interactions=ties), "talking")
    assert gone not in ring
    assert len(ring) == 5


def test_ties_of_two_and_to_things_are_drawn_as_they_are(scene: Scene) -> None:
    assert drawn_ties(look(scene)) == list(scene.interactions)


def test_the_space_a_group_shares_shows_among_the_zones(scene: Scene) -> None:
    with_zones, without = Layers(zones=True, caption=False), Layers(caption=False)
    snapshot = six(scene, "circle")
    pictures = [picture(snapshot, size=(300, 240), layers=layers).get_buffer().raw for layers in (with_zones, without)]
    assert pictures[0] != pictures[1]
