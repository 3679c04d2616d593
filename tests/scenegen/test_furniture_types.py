"""Types of furniture: built-in ones and a registered one, in scenarios, scenes, pictures, words and observations."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pygame
import pytest

import sonata2d as s2
from sonata2d.collect.texts import choose_language, text
from sonata2d.core.entities import Furniture
from sonata2d.core.furniture_types import BUILT_IN, OBJECT_TYPES
from sonata2d.core.geometry import Pose, Rectangle
from sonata2d.core.relations import AT_OBJECT
from sonata2d.core.rng import RandomStream
from sonata2d.core.scene import Rules
from sonata2d.errors import ConfigError, PluginWarning
from sonata2d.formats.format import Options
from sonata2d.formats.socnav3 import export
from sonata2d.gym.observation import Encoder, Sizes
from sonata2d.registry import FURNITURE_TYPES, furniture_type, furniture_types
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.base import IntRange
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.view.scene_data import scene_data
from sonata2d.view.stills import picture, snapshot_of

from ..test_pinned_bytes import SCENES, pinned, scene_digest

drawn: list[tuple[float, float, bool]] = []


def draw_settee(pen: Any, depth: float, breadth: float, is_round: bool) -> None:
    drawn.append((depth, breadth, is_round))
    pen.box((200, 0, 0), (-depth, -breadth), (depth, breadth))


SETTEE = s2.FurnitureType(
    "settee", (1.8, 0.8), count="settees", is_seat=True, relation=None, draw=draw_settee,
    words={"en": "Settees", "es": "Canapés"}, names={"socnav3": "chair", "gym": "chair"},
)  # fmt: skip
EMPTY: dict[str, Any] = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0}


@pytest.fixture
def _settee() -> Iterator[None]:
    FURNITURE_TYPES.register("settee", SETTEE)
    drawn.clear()
    yield
    FURNITURE_TYPES.registered.clear()
    choose_language("en")


def test_built_in_types_are_registered_under_their_names_and_have_numbers_that_policies_know() -> None:
    assert [furniture_type(name) for name in FURNITURE_TYPES.built_in] == list(BUILT_IN)
    assert OBJECT_TYPES == ("table", "laptop", "plant", "chair", "shelf", "tv", "other")
    assert [kind.number for kind in BUILT_IN[:6]] == list(range(6))


def test_a_name_without_a_type_stands_for_an_object_to_look_at() -> None:
    kind = furniture_type("aquarium")
    assert (kind.size, kind.relation, kind.is_seat, kind.number) == (None, AT_OBJECT, False, 6)


@pytest.mark.parametrize("changes", [{"size": None}, {"words": {"de": "Settees"}}, {"on": "table"}])
def test_a_type_with_a_count_needs_a_size_and_an_english_word_and_stands_on_the_floor(changes: dict[str, Any]) -> None:
    settings: dict[str, Any] = {"size": 0.5, "count": "settees", "words": {"en": "Settees"}}
    with pytest.raises(ValueError, match="'settees'; it needs a size and an English word"):
        s2.FurnitureType("settee", **settings | changes)


@pytest.mark.usefixtures("_settee")
def test_scenarios_have_the_number_of_a_registered_type() -> None:
    config = ScenarioConfig(**EMPTY, settees=[1, 3])
    assert (config.counts["settee"].min, config.counts["settee"].max) == (1, 3)
    assert config.settings()["settees"] == [1, 3]
    assert ScenarioConfig(**config.settings()) == config
    assert config.changed(settees=2).counts["settee"].min == 2
    assert "settees" not in ScenarioConfig(settees=0).settings(), "files without settees need no such type"
    with pytest.raises(ConfigError, match="unknown key 'setteez'; did you mean 'settees'"):
        ScenarioConfig(setteez=1)  # type: ignore[call-arg]
    with pytest.raises(ConfigError, match="settees: a range is a number"):
        ScenarioConfig(settees="some")  # type: ignore[call-arg]


def test_a_number_of_an_unknown_type_is_an_unknown_key() -> None:
    with pytest.raises(ConfigError, match="unknown key 'settees'; did you mean 'seated'"):
        ScenarioConfig(settees=1)  # type: ignore[call-arg]
    with pytest.raises(ConfigError, match="unknown key 'kiosks'; install the package, if a plug-in defines it; keys"):
        ScenarioConfig(kiosks=1)  # type: ignore[call-arg]


@pytest.mark.usefixtures("_settee")
def test_people_sit_on_drawn_and_on_given_pieces_of_a_registered_type() -> None:
    settings = EMPTY | {"seated": 3, "settees": 2, "furniture": [{"type": "settee", "x": 0.0, "y": 0.0, "theta": 0.4}]}
    scene = generate(ScenarioConfig(**settings, room={"kinds": "hall"}), 3)
    assert [piece.type for piece in scene.furniture] == ["settee"] * 3
    assert all(piece.seat and piece.shape == Rectangle(1.8, 0.8) for piece in scene.furniture)
    assert {human.seat for human in scene.humans} == {piece.id for piece in scene.furniture}
    with pytest.raises(ConfigError, match="did you mean 'settee'"):
        ScenarioConfig(furniture=[{"type": "setteea", "x": 0.0, "y": 0.0}])


@pytest.mark.usefixtures("_settee")
def test_a_mirrored_scene_turns_the_front_of_a_registered_seat_as_that_of_a_chair_of_its_size() -> None:
    def mirrored(**piece: Any) -> float:
        settings = EMPTY | {"furniture": [{"x": 0.0, "y": 0.0, "theta": 0.4, **piece}], "flip": 1.0}
        return generate(ScenarioConfig(**settings, room={"kinds": "square", "side": 8}), 1).furniture[0].pose.theta

    assert mirrored(type="settee") == mirrored(type="chair", size=(1.8, 0.8))
    assert mirrored(type="settee", size=(0.8, 0.8)) == mirrored(type="chair") == -0.4


@pytest.mark.usefixtures("_settee")
def test_a_registered_type_draws_itself_in_pictures_and_pages() -> None:
    scene = generate(ScenarioConfig(**EMPTY, settees=1), 1)
    pixels = pygame.surfarray.array3d(picture(snapshot_of(scene)))
    assert (pixels == (200, 0, 0)).all(axis=2).any()
    room = base64.b64decode(scene_data(scene)["room"].rpartition(",")[2]).decode()
    assert "#c80000" in room
    assert set(drawn) == {(0.4, 0.9, False)}


@pytest.mark.usefixtures("_settee")
def test_the_window_names_the_number_of_a_registered_type_in_its_language() -> None:
    choose_language("es")
    assert (text("scene.settees"), text("scene.tables")) == ("Canapés", "Mesas")
    choose_language("de")
    assert (text("scene.settees"), text("scene.tables")) == ("Settees", "Tische")


@pytest.mark.usefixtures("_settee")
def test_observations_and_formats_have_a_type_of_their_own_in_its_place() -> None:
    config = ScenarioConfig(**EMPTY, settees=[0, 3])
    assert Sizes.of(config).objects == 3
    scene = generate(config.changed(settees=1), 1)
    encoder = Encoder(Sizes(1, 1, 4, 1))
    encoder.reset(scene)
    assert encoder.encode(snapshot_of(scene))["object_types"].tolist() == [OBJECT_TYPES.index("chair")]
    recorder = s2.EpisodeRecorder()
    s2.Episode(replace(scene, rules=Rules(time_limit=2.0)), s2.StraightToGoal(), observers=[recorder]).run()
    assert b'"type":"chair"' in export(recorder.record(), Options())


def test_a_type_whose_key_is_taken_is_not_drawn_and_one_of_another_name_does_not_load() -> None:
    words = {"en": "Things"}
    try:
        FURNITURE_TYPES.register("bench", s2.FurnitureType("bench", 0.5, count="humans", words=words))
        with pytest.warns(PluginWarning, match="'bench' is not drawn: the key 'humans' is taken"):
            assert "bench" not in ScenarioConfig().counts
        FURNITURE_TYPES.register("bench", s2.FurnitureType("settee", 0.5))
        with pytest.warns(PluginWarning, match="'bench' is named 'settee'; give the entry point the same name"):
            assert "bench" not in furniture_types()
        FURNITURE_TYPES.register("bench", "not a type")
        with pytest.raises(ConfigError, match=r"'bench' is not a sonata2d\.FurnitureType"):
            furniture_type("bench")
    finally:
        FURNITURE_TYPES.registered.clear()


@pytest.mark.usefixtures("_settee")
@pytest.mark.parametrize(("name", "seed"), SCENES)
def test_a_registered_type_changes_no_pinned_scene(name: str, seed: int) -> None:
    assert scene_digest(name, seed) == pinned()["scenes"][f"{name}, seed {seed}"]


@pytest.mark.usefixtures("_settee")
@pytest.mark.parametrize("preset", ["sonata-2020", "lively"])
def test_drawn_pieces_of_a_further_type_change_nothing_but_poses_that_are_in_the_way(
    preset: str,
) -> None:
    config = s2.load_scenario(preset).changed(room={"kinds": "hall"}, sizes={"settee": 0.05}, seated=0)
    same_poses = 0
    for seed in range(6):
        without, scene = generate(config, seed), generate(config.changed(settees=2), seed)
        assert [piece.type for piece in scene.furniture][len(without.furniture) :] == ["settee", "settee"]
        pairs = list(zip(without.humans, scene.humans, strict=True))
        assert all(replace(before, pose=after.pose) == after for before, after in pairs)
        same_poses += without.humans == scene.humans and without.furniture == scene.furniture[:-2]
    assert same_poses >= 4


def test_a_range_of_one_count_takes_no_random_number() -> None:
    rng, other = RandomStream(1, 2, "scene"), RandomStream(1, 2, "scene")
    assert [IntRange(3, 3).draw(rng), IntRange(0, 0).draw(rng)] == [3, 0]
    assert rng.uniform() == other.uniform()


def test_a_file_without_the_key_seat_has_chairs_as_its_only_seats() -> None:
    pieces = [Furniture(k, name, Pose(0.0, 0.0), Rectangle(1.0, 1.0)) for k, name in enumerate(("chair", "settee"))]
    assert [piece.is_seat for piece in pieces] == [True, False]
