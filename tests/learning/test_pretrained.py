"""The weights that are shipped: small, told where they come from, and able to drive."""

from __future__ import annotations

import pytest

from sonata2d.agents.controllers.loading import load_controller
from sonata2d.learning.policy import GraphPolicy
from sonata2d.learning.weights import STOCK, read_weights
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario.load import load_scenario
from sonata2d.sim.episode import Episode


def test_they_are_small_and_say_how_they_came_to_be() -> None:
    weights = read_weights(STOCK)
    assert STOCK.stat().st_size < 500_000
    assert (weights.graph, weights.kind) == ("modern", "gatv2")
    assert weights.note["error"]["test"] < 0.1
    assert weights.note["data"]


@pytest.mark.parametrize("name", ["sonata-2020", "narrow-doorway", "blind-corner", "joining-a-group"])
def test_they_drive_to_the_goal(name: str) -> None:
    policy = load_controller("graph-policy")
    assert isinstance(policy, GraphPolicy)
    config = load_scenario(name)
    reached = [Episode(generate(config, 21, k), policy).run().status == "goal" for k in range(5)]
    assert sum(reached) >= 4, f"reached {sum(reached)} of 5 goals in {name}"
