"""The example of a robot that waits for the end of an argument."""

from __future__ import annotations

from pathlib import Path

import sonata2d as s2

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_the_robot_waits_while_guest_and_host_argue_and_serves_otherwise() -> None:
    config = s2.load_scenario(EXAMPLES / "scenarios/argument.yaml")
    people = config.settings()["people"]
    calm = config.changed(people=[{k: v for k, v in row.items() if k != "relation"} for row in people])
    for settings, advice in ((config, "wait"), (calm, "serve")):
        scene = s2.generate(settings, 1)
        recorder = s2.EpisodeRecorder()
        s2.Episode(scene, s2.load_controller(f"{EXAMPLES}/waiter.py:Waiter"), observers=[recorder]).run()
        record = recorder.record()
        assert {label["advice"] for label in record.labels} == {advice}
        assert scene.attributes_of() == {"robot_carries": "a full cup"}
        assert [(human.attributes or {})["role"] for human in scene.humans[:2]] == ["guest", "host"]
        assert (record.document["outcome"]["status"] == "goal") == (advice == "serve")
