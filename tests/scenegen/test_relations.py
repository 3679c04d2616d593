"""Relations beyond talking: pairs that argue, hand over, care, lead and follow; people who watch TV."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.core.relations import ACTIVITIES, RELATION, RELATIONS, activities_with
from sonata2d.datasets import verify
from sonata2d.errors import ConfigError
from tests.running import record_of

EMPTY: dict[str, Any] = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}
HALL: dict[str, Any] = {
    "room": {"polygon": [[-6, -5], [6, -5], [6, 5], [-6, 5]]}, "rules": {"ends_on": ["time"], "time_limit": 15}
}  # fmt: skip
PAIRS = {
    "arguing_pairs": ("arguing", "arguing", (0.6, 0.9)),
    "handing_over_pairs": ("handing_over", "handing over", (0.8, 1.0)),
    "caring_pairs": ("caring_for", "caring", (0.6, 0.8)),
}


def scene_of(seed: int = 0, **settings: Any) -> s2.Scene:
    return s2.generate(s2.ScenarioConfig.model_validate({**EMPTY, **HALL, **settings}), seed)


@pytest.mark.parametrize("key", PAIRS)
def test_a_standing_pair_faces_each_other_at_its_distance_and_has_its_activity(key: str) -> None:
    relation, activity, (low, high) = PAIRS[key]
    scene = scene_of(3, **{key: 1})
    (first, second), (interaction,) = scene.humans, scene.interactions
    assert (interaction.src, interaction.relation, interaction.dst) == (first.id, relation, second.id)
    offset = np.subtract(second.pose.position, first.pose.position)
    assert low - 1e-3 <= np.hypot(*offset) <= high + 1e-3
    assert offset @ first.pose.direction > 0.99 * np.hypot(*offset)
    states = record_of(scene).states
    assert (states.activity == ACTIVITIES.index(activity)).all()


def test_people_who_argue_move_more_than_people_who_talk() -> None:
    paths = {}
    for key in ("talking_pairs", "arguing_pairs"):
        rows = record_of(scene_of(1, **{key: 3}, rules={"ends_on": ["time"], "time_limit": 30})).states.humans
        paths[key] = float(np.hypot(*np.diff(rows[..., :2], axis=0).T).sum())
    assert paths["arguing_pairs"] > 2.0 * paths["talking_pairs"]


def test_who_leads_walks_ahead_and_who_follows_has_the_relation() -> None:
    people = [
        {"x": -4.0, "y": 0.0, "goals": [[5, 0]], "group": 1, "relation": "following"},
        {"x": -5.2, "y": 0.0, "goals": [[4, 0]], "group": 1},
    ]
    record = record_of(scene_of(people=people))
    first, second = (human.id for human in record.scene().humans)
    assert [tuple(row) for row in record.document["interactions"]] == [(second, "following", first)]
    x = record.states.humans[10:45, :, 0]
    assert (x[:, 0] - x[:, 1] > 0.4).all(), "the one ahead stays ahead"
    assert (x[:, 0] - x[:, 1] < 2.5).all(), "and the other keeps up"
    drawn = scene_of(2, leading_pairs=1)
    assert [i.relation for i in drawn.interactions] == ["leading"]
    assert drawn.interactions[0].src == drawn.groups[0].members[0]


def test_people_watch_a_given_tv_or_one_that_is_added() -> None:
    tv = {"type": "tv", "x": 0.0, "y": 4.5}
    for furniture, types in (([tv, {"type": "shelf", "x": 3, "y": 4.5}], ["tv", "shelf"]), ([], ["tv"])):
        scene = scene_of(1, watching_tv=1, furniture=furniture)
        assert sorted(piece.type for piece in scene.furniture) == sorted(types)
        person, screen = scene.humans[0], next(piece for piece in scene.furniture if piece.type == "tv")
        assert [(i.src, i.relation, i.dst) for i in scene.interactions] == [(person.id, "watching_tv", screen.id)]
        distance = np.hypot(*np.subtract(person.pose.position, screen.pose.position))
        assert 1.5 <= distance <= 3.0 + 1e-3


def test_files_with_the_relations_replay_and_list_their_activities(tmp_path: Path) -> None:
    scene = scene_of(4, **dict.fromkeys(PAIRS, 1), watching_tv=1, leading_pairs=1, following_pairs=1)
    path = tmp_path / "a.json"
    s2.Episode(scene, s2.SocialPlanner(), observers=[s2.JsonRecorder(path)]).run()
    assert s2.read_episode(path).document["activities"] == list(ACTIVITIES)
    assert verify(path, replay=True) == []
    assert s2.read_episode(path).scene() == scene


def test_files_without_them_list_the_activities_as_before() -> None:
    assert activities_with(RELATIONS[:5]) == ACTIVITIES[:8]
    assert activities_with(["arguing"]) == ACTIVITIES[:9]
    assert "arguing_pairs" not in s2.ScenarioConfig().settings()


def test_every_relation_has_settings_of_its_own() -> None:
    settings = s2.ScenarioConfig()
    for relation in RELATION.values():
        assert getattr(settings, relation.setting).max >= 0
        assert getattr(settings, relation.distance).min > 0.0


@pytest.mark.parametrize(
    ("people", "problem"),
    [
        ([{"x": 0, "y": 0, "relation": "arguing"}], "a relation needs a group"),
        ([{"x": 0, "y": 0, "group": 1, "relation": "arguin"}], "did you mean 'arguing'"),
        ([{"x": 0, "y": 0, "group": 1, "relation": "leading"}], "must walk"),
        ([{"x": 0, "y": 0, "group": 1, "goals": [[1, 1]], "relation": "arguing"}], "must stand"),
        (
            [{"x": k, "y": 0, "group": 1, "relation": name} for k, name in enumerate(("arguing", "caring_for"))],
            "group 1 has two relations",
        ),
        ([{"x": 0, "y": 0, "group": 1, "relation": "arguing"}], "group 1 has one member, and a relation two or more"),
        (
            [{"x": k, "y": 0, "group": 1, "relation": "caring_for"} for k in range(3)],
            "caring_for is a relation of two people; group 1 has 3",
        ),
    ],
)
def test_a_relation_that_does_not_fit_the_group_is_refused(people: Any, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        s2.ScenarioConfig(**EMPTY, **HALL, people=people)
