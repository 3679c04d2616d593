"""Attributes: declared, drawn or given, recorded, observed, in graphs and in pictures."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest
from click.testing import CliRunner
from sonata2d_cli import main

import sonata2d as s2
from sonata2d.core.attributes import AttributeSpec, attribute_text
from sonata2d.datasets import verify
from sonata2d.errors import ConfigError, RecordError
from sonata2d.gym import SocialNavEnv, register_attribute_parts
from sonata2d.learning import GraphSamples
from sonata2d.learning.graph.graph import NODE_TYPES
from sonata2d.registry import OBSERVATION_PARTS
from sonata2d.view.layers import Layers
from sonata2d.view.scene_data import scene_data
from sonata2d.view.stills import picture, snapshot_of

from ..record.test_reader import rewrite

DECLARED: dict[str, Any] = {
    "people": {"emotion": {"calm": 3, "happy": 1, "angry": 1}, "hurried": 0.2, "age": [20, 90], "name": "text"},
    "objects": {"fragile": "bool", "load": ["empty", "full"]},
    "areas": {"quiet": "bool"},
    "episode": {"urgency": ["low", "high"], "limit": {"type": "number", "value": 4}},
}
WARD: dict[str, Any] = {
    "name": "ward", "wandering": 3, "standing": 2, "tables": 2, "plants": 1, "relations": 0,
    "room": {"kinds": ["square"], "side": 8},
    "areas": [{"name": "bay", "polygon": [[-1, -1], [1, -1], [1, 1], [-1, 1]], "attributes": {"quiet": True}}],
    "furniture": [{"type": "table", "x": 0, "y": 0, "attributes": {"fragile": True}}],
    "people": [{"x": 2.5, "y": 2.5, "attributes": {"emotion": "angry", "name": "Ann"}}],
}  # fmt: skip


def ward(**changes: Any) -> s2.ScenarioConfig:
    return s2.ScenarioConfig(**(WARD | {"attributes": DECLARED} | changes))


def write(scene: s2.Scene, path: Path) -> Path:
    s2.Episode(scene, s2.SocialPlanner(), observers=[s2.JsonRecorder(path)]).run()
    return path


def test_given_values_are_kept_and_others_are_drawn_by_weight() -> None:
    config = ward()
    scenes = [s2.generate(config, 1, episode) for episode in range(60)]
    first = scenes[0]
    assert first.humans[0].attributes is not None
    assert first.humans[0].attributes["emotion"] == "angry"
    assert first.humans[0].attributes["name"] == "Ann"
    given = next(piece for piece in first.furniture if piece.type == "table" and piece.pose.position == (0.0, 0.0))
    assert (given.attributes or {})["fragile"] is True
    assert first.areas[0].attributes == {"quiet": True}
    drawn = [human.attributes or {} for scene in scenes for human in scene.humans[1:]]
    assert sum(values["emotion"] == "calm" for values in drawn) / len(drawn) == pytest.approx(0.6, abs=0.08)
    assert sum(bool(values["hurried"]) for values in drawn) / len(drawn) == pytest.approx(0.2, abs=0.07)
    assert all(20.0 <= float(values["age"]) <= 90.0 for values in drawn)
    assert all("name" not in values for values in drawn)
    assert {scene.attributes_of()["urgency"] for scene in scenes} == {"low", "high"}
    assert {scene.attributes_of()["limit"] for scene in scenes} == {4.0}
    assert all("fragile" not in (piece.attributes or {}) for piece in first.furniture if piece.id != given.id)
    assert first.attributes_of(first.humans[0].id) == first.humans[0].attributes
    with pytest.raises(KeyError, match="there is no person or object 999"):
        first.attributes_of(999)


def test_attributes_change_nothing_else_in_a_scene() -> None:
    with_them, without = (s2.generate(ward(**changes), 3) for changes in ({}, {"attributes": {}, **PLAIN}))
    assert [human.pose for human in with_them.humans] == [human.pose for human in without.humans]
    assert [piece.pose for piece in with_them.furniture] == [piece.pose for piece in without.furniture]
    assert without.attributes == ()
    assert all(human.attributes is None for human in without.humans)


PLAIN = {key: [{k: v for k, v in row.items() if k != "attributes"} for row in WARD[key]]
         for key in ("areas", "furniture", "people")}  # fmt: skip


def test_a_file_holds_declarations_and_values_and_replays(tmp_path: Path) -> None:
    scene = s2.generate(ward(), 2)
    path = write(scene, tmp_path / "a.json")
    record = s2.read_episode(path)
    assert record.scene() == scene
    assert record.document["attributes"][0] == {
        "of": "people", "name": "emotion", "type": "classes", "values": ["calm", "happy", "angry"]
    }  # fmt: skip
    assert verify(path, replay=True) == []
    plain = s2.read_episode(write(s2.generate("empty", 2), tmp_path / "b.json"))
    assert "attributes" not in plain.document


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda d: d["humans"][0]["attributes"].update(emotion="sad"), "emotion must be one of calm, happy, angry"),
        (lambda d: d["humans"][0]["attributes"].update(mood="sad"), "mood is not declared"),
        (lambda d: d["attributes"][0].update(value="calm"), "the value of emotion is not as declared"),
    ],
)
def test_a_file_with_other_values_than_declared_is_refused(tmp_path: Path, change: Any, problem: str) -> None:
    path = write(s2.generate(ward(), 2), tmp_path / "a.json")
    with pytest.raises(RecordError, match=problem):
        s2.read_episode(rewrite(path, change))


@pytest.mark.parametrize(
    ("declared", "problem"),
    [
        ({"people": {"emotion": ["calm"]}}, "needs two names or more"),
        ({"people": {"emotion": "moods"}}, "'classes', 'yes_no', 'number' or 'text'"),
        ({"people": {"emotion": {"calm": 0, "sad": 0}}}, "at least one class needs a weight above 0"),
        ({"people": {"hurried": True}}, "an attribute is a type, or the values that it is drawn from"),
        ({"peple": {}}, "did you mean 'people'"),
        ({"people": {"age": {"type": "number", "share": 0.5}}}, "only an attribute of type yes_no has share"),
        (
            {"people": {"hurried": [False, True]}},
            r'names that YAML reads as true or false need quotes: \["yes", "no"\]',
        ),
        ({"episode": {"robot_carries": "text"}}, "the attribute has no value in any episode; give value, or what"),
        ({"people": {"emotion": {"values": ["calm", "sad"]}}}, "or a short form: a list of names"),
        ({"episode": {"limit": {"value": 3}}}, r"attributes\.episode\.limit\.type: Field required"),
        ({"episode": {"limit": {"type": "number", "value": "x"}}}, "must be a number"),
        ({"people": {"age": {"type": "number", "value": 3}}}, "a value in a declaration is of the episode"),
    ],
)
def test_a_declaration_that_makes_no_sense_is_refused(declared: Any, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        s2.ScenarioConfig(attributes=declared)


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"emotoin": "calm"}, "did you mean 'emotion'"),
        ({"emotion": "sad"}, "must be one of calm, happy, angry"),
        ({"hurried": "yes"}, "must be true or false"),
        ({"age": True}, "must be a number"),
        ({"name": 3}, "must be a text"),
        ({"name": "\ud800"}, "must be a text that UTF-8 can encode"),
        ({"age": float("nan")}, "must have a magnitude of at most 1e"),
        ({"age": 1e300}, "must have a magnitude of at most 1e"),
        ({"name": ["Ann"]}, "a value is true, false, a number or a text"),
    ],
)
def test_a_value_that_does_not_fit_its_declaration_is_refused(values: Any, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        ward(people=[{"x": 2.5, "y": 2.5, "attributes": values}])


@pytest.mark.parametrize(
    ("short", "long"),
    [
        ({"weights": {"calm": 1, "sad": 2}}, {"type": "classes", "weights": {"calm": 1, "sad": 2}}),
        ({"share": 0.5}, {"type": "yes_no", "share": 0.5}),
        ({"min": 1, "max": 2}, {"type": "number", "range": [1, 2]}),
        ({"min": 1, "mid": 1, "max": 2}, {"type": "classes", "weights": {"min": 1, "mid": 1, "max": 2}}),
    ],
)
def test_the_type_of_an_attribute_follows_from_its_distribution(short: Any, long: Any) -> None:
    found, expected = (s2.ScenarioConfig(attributes={"people": {"trait": value}}) for value in (short, long))
    assert found == expected


def test_short_forms_read_back_as_the_same_settings() -> None:
    config = ward()
    assert s2.ScenarioConfig(**config.settings()) == config
    assert "attributes" not in s2.ScenarioConfig().settings()


def test_observations_have_the_attributes_as_parts() -> None:
    try:
        names = register_attribute_parts(ward())
        assert names == ["human_attributes", "object_attributes", "area_attributes", "episode_attributes"]
        env = SocialNavEnv(ward(), parts=names, order="scene")
        observation, _ = env.reset(seed=5)
        assert env.observation_space.contains(observation)
        columns = [column.name for column in OBSERVATION_PARTS.load("human_attributes", lambda part: None).columns]
        assert columns == ["emotion=calm", "emotion=happy", "emotion=angry", "hurried", "age"]
        assert observation["human_attributes"][0, :3].tolist() == [0.0, 0.0, 1.0]  # of the person that is given
        assert observation["object_attributes"][:, 0].max() == 1.0
        assert observation["episode_attributes"].shape == (3,)
        assert observation["human_attributes"][observation["humans_mask"] == 0].sum() == 0.0
        for x, quiet in ((0.5, 1.0), (1.5, 0.0)):
            here = SocialNavEnv(ward(furniture=[], robot={"pose": [x, 0.5, 0.0]}), parts=names)
            assert here.reset(seed=5)[0]["area_attributes"].tolist() == [quiet]
    finally:
        OBSERVATION_PARTS.registered.clear()


def test_parts_of_another_scenario_are_refused() -> None:
    try:
        with pytest.raises(ConfigError, match=r"parts with attributes exist after sonata2d\.gym\.register_at"):
            SocialNavEnv(ward(), parts=["human_attributes"])
        names = register_attribute_parts(ward())
        others = ward(attributes=DECLARED | {"people": {"emotion": ["calm", "angry"], "name": "text"}})
        with pytest.raises(ConfigError, match="with other attributes of people than ward; call register_at"):
            SocialNavEnv(others, parts=names).reset(seed=1)
    finally:
        OBSERVATION_PARTS.registered.clear()


def test_graphs_have_the_attributes_as_features(tmp_path: Path) -> None:
    record = s2.read_episode(write(s2.generate(ward(), 2), tmp_path / "a.json"))
    plain, graph = (next(iter(GraphSamples(attributes=each, instants=1)(record))) for each in (False, True))
    added = graph.feature_names[len(plain.feature_names) :]
    assert added[:3] == ("people.emotion=calm", "people.emotion=happy", "people.emotion=angry")
    assert "objects.fragile" in added
    person = record.scene().humans[0].id
    row = graph.features[(graph.entity == person) & (graph.node_type == plain.node_type[1])][0]
    assert row[graph.feature_names.index("people.emotion=angry")] == 1.0
    assert (graph.features[:, : len(plain.feature_names)] == plain.features).all()
    assert graph.features[graph.node_type == graph.node_type[0]][:, len(plain.feature_names) :].sum() == 0.0


def test_nodes_have_the_attributes_of_the_area_where_they_are(tmp_path: Path) -> None:
    scene = s2.generate(ward(robot={"pose": [-3.0, 0.0, 0.0]}, goal={"position": [3.0, 0.3]}, robots=2), 2)
    record = s2.read_episode(write(scene, tmp_path / "a.json"))
    checked, quiet, states = 0, 0, record.states
    for graph in GraphSamples(attributes=True, every=0.5)(record):
        column = graph.features[:, graph.feature_names.index("areas.quiet")]
        for n, (kind, instant) in enumerate(zip(graph.node_type, graph.instant, strict=True)):
            tick, id = graph.ticks[instant], int(graph.entity[n])
            others = [robot.id for robot in scene.robots]
            if NODE_TYPES[kind] == "room":
                place = states.robot[tick]
            elif NODE_TYPES[kind] == "human":
                k = next((k for k, human in enumerate(scene.humans) if human.id == id), None)
                place = states.humans[tick, k] if k is not None else states.robots[tick, others.index(id)]
            elif NODE_TYPES[kind] == "object":
                place = np.array(next(piece.pose.position for piece in scene.furniture if piece.id == id))
            else:
                place = np.array([9.0, 9.0])  # the bay is a square of 2 m
            checked, quiet = checked + 1, quiet + int(column[n])
            assert column[n] == float(np.abs(place[:2]).max() < 1.0)
    assert 0 < quiet < checked


def test_pictures_show_the_attributes_as_words() -> None:
    scene = s2.generate(ward(), 2)
    shown, hidden = (
        pygame.image.tobytes(picture(snapshot_of(scene), layers=Layers(attributes=each)), "RGB")
        for each in (True, False)
    )
    assert shown != hidden
    assert scene_data(scene)["humans"][0]["words"].startswith("angry")
    assert [area["words"] for area in scene_data(scene)["areas"]] == ["quiet"]
    areas = replace(scene, humans=(), furniture=(), interactions=())
    with_words, without = (
        pygame.image.tobytes(picture(snapshot_of(areas), layers=Layers(attributes=each)), "RGB")
        for each in (True, False)
    )
    assert with_words != without
    assert (
        attribute_text({"emotion": "angry", "hurried": True, "calm": False, "age": 71.234})
        == "angry, hurried, age 71.2"
    )
    assert attribute_text(None) == ""


def test_a_spec_says_why_a_value_does_not_fit() -> None:
    assert AttributeSpec("people", "age", "number").problem(3) is None
    assert AttributeSpec("people", "age", "number").problem("3") == "must be a number"


def test_an_attribute_in_the_place_of_a_key_is_an_error_that_says_where_it_goes() -> None:
    with pytest.raises(ConfigError, match=r"a declared attribute is given as attributes: \{emotion: …\}"):
        ward(people=[{"x": 2.5, "y": 2.5, "emotion": "angry"}])


def test_describe_shows_kinds_areas_and_attributes(tmp_path: Path) -> None:
    path = write(s2.generate(ward(person={"kinds": {"adult": 1, "older": 1}}), 2), tmp_path / "a.json")
    output = CliRunner().invoke(main, ["describe", str(path)]).output
    rows = dict(re.split(r"  +", line, maxsplit=1) for line in output.splitlines() if "  " in line)
    assert rows["kinds of people"] == "4 adult, 2 older"
    assert rows["areas"] == "bay"
    assert "1 emotion=angry, 5 emotion=calm" in rows["attributes of people"]
    assert rows["attributes of areas"] == "1 quiet=True"
    assert rows["attributes of the episode"].startswith("limit, urgency=")
