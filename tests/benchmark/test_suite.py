"""Suites are frozen, and their seeds are as public as they claim."""

from __future__ import annotations

import pytest

from sonata2d.benchmark import load_suite
from sonata2d.benchmark.suite import (
    commitment,
    difficulty_of,
    joint_sha256,
    merged,
    new_secret,
    quarters_of,
    read_secret,
    scene_sha256,
)
from sonata2d.errors import BenchmarkError
from sonata2d.metrics.situations import SITUATIONS

FROZEN = {
    "s2b-1": "5a3b5728f411eb566faa008c25e76ef0b998e7157f990d1af094e9b78302dbfc",
    "s2b-1-recorded": "16cb5617108f78398120486785ab685a6bbd6520d7b26c5b987477648d2b303a",
}


@pytest.mark.parametrize("name", FROZEN)
def test_a_suite_never_changes(name: str) -> None:
    assert load_suite(name).sha256 == FROZEN[name], "a suite is frozen: give the changed one a new name"


def test_the_suite_has_its_parts_and_all_situations() -> None:
    suite = load_suite()
    assert suite.count == 2800
    assert {entry.situation for entry in suite.entries} - {None} == set(SITUATIONS)
    assert {entry.part for entry in suite.entries} == set(suite.questions)
    assert not any(entry.config.rules.guard for entry in suite.entries)
    suite.require_versions()


@pytest.mark.parametrize("name", ["home", "unicycle", "frontal-approach"])
def test_the_test_seed_gives_the_same_scenes_everywhere(name: str) -> None:
    suite = load_suite()
    entry = suite.entry(name)
    scenes = [entry.scene(suite.test_seed, episode) for episode in range(entry.scenes)]
    assert joint_sha256([scene_sha256(scene) for scene in scenes]) == suite.scenes_sha256[name]


def test_the_time_limit_follows_the_difficulty() -> None:
    suite = load_suite()
    scene = suite.entry("sonata-2020").scene(suite.test_seed, 0)
    value = difficulty_of(scene)
    assert value is not None
    assert scene.rules.time_limit == pytest.approx(max(5.0 + 2.5 * value, 15.0), abs=0.06)


def test_hidden_seeds_follow_from_secret_and_suite() -> None:
    suite, secret = load_suite(), new_secret()
    assert suite.seed_of("hidden", secret) == suite.hidden_seed(secret) != suite.hidden_seed(new_secret())
    assert read_secret(f"{secret.hex()}\n") == secret
    with pytest.raises(BenchmarkError, match="need the secret"):
        suite.seed_of("hidden")
    with pytest.raises(BenchmarkError, match="64 hexadecimal digits"):
        read_secret("abc")


def test_revealed_quarters_belong_to_their_commitments() -> None:
    suite = load_suite()
    revealed = {name: each for name, each in quarters_of("s2b-1").items() if each["secret"]}
    assert revealed
    for name, each in revealed.items():
        secret = read_secret(str(each["secret"]))
        assert commitment(secret) == each["commitment"]
        assert suite.seed_of(name) == suite.hidden_seed(secret)


def test_seeds_of_development_are_not_the_test_seed() -> None:
    suite = load_suite()
    assert suite.seed_of("dev", seed=7) == 7
    with pytest.raises(ValueError, match="is the test seed"):
        suite.seed_of("dev", seed=suite.test_seed)
    with pytest.raises(BenchmarkError, match="has no seeds 'tset'; seeds are dev, test, hidden, 2026q4-trial; did"):
        suite.seed_of("tset")


def test_parts_and_numbers_of_scenes_can_be_chosen() -> None:
    suite = load_suite().chosen(["maps", "lively"], scenes=2)
    assert [(entry.name, entry.scenes) for entry in suite.entries] == [
        ("lively", 2), ("clinic_corridor", 2), ("home", 2), ("office", 2)
    ]  # fmt: skip
    with pytest.raises(BenchmarkError, match="did you mean 'maps'"):
        suite.chosen(["map"])
    with pytest.raises(BenchmarkError, match="there is no suite 's2b-2'"):
        load_suite("s2b-2")


def test_marked_sections_are_replaced() -> None:
    assert merged({"kinds": {"a": 1}, "n": 1}, {"kinds=": {"b": 2}}) == {"kinds": {"b": 2}, "n": 1}
