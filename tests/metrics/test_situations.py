"""The canonical situations: each preset produces its own situation, and no other preset is taken for it."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sonata2d import Episode, EpisodeRecorder, JsonRecorder, SocialPlanner, StraightToGoal, generate, load_scenario
from sonata2d.agents.controllers.base import Controller
from sonata2d.core.geometry import inside_polygon
from sonata2d.core.proxemics import clearance
from sonata2d.core.snapshot import Snapshot
from sonata2d.datasets.transforms.mirror import mirrored
from sonata2d.errors import ConfigError
from sonata2d.metrics.encounters import Encounter, doorways, encounter
from sonata2d.metrics.situations import SITUATIONS, judge, rehearse
from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.load import scenario_names

SEEDS = range(4)


@cache
def record_of(name: str, seed: int, driver: type[Controller] = SocialPlanner) -> EpisodeRecord:
    """An episode of a preset."""
    recorder = EpisodeRecorder()
    Episode(generate(load_scenario(name), seed), driver(), observers=[recorder]).run()
    return recorder.record()


@cache
def encounter_of(name: str, seed: int, driver: type[Controller] = SocialPlanner) -> Encounter:
    return encounter(record_of(name, seed, driver))


@pytest.mark.parametrize("driver", [SocialPlanner, StraightToGoal])
@pytest.mark.parametrize("name", SITUATIONS)
def test_preset_produces_its_situation(name: str, driver: type[Controller]) -> None:
    for seed in SEEDS:
        verdict = SITUATIONS[name](encounter_of(name, seed, driver))
        assert verdict.took_place, f"{name}, seed {seed}: {verdict.description}"


@pytest.mark.parametrize(
    ("name", "other"),
    [
        *(
            ("frontal-approach", other)
            for other in ("overtaking", "being-overtaken", "intersection", "crossing-a-group")
        ),
        *(("overtaking", other) for other in ("frontal-approach", "being-overtaken", "intersection", "narrow-doorway")),
        *(("being-overtaken", other) for other in ("frontal-approach", "overtaking", "blind-corner")),
        *(("intersection", other) for other in ("frontal-approach", "overtaking", "blind-corner", "narrow-doorway")),
        *(("blind-corner", other) for other in ("frontal-approach", "overtaking", "crossing-a-group")),
        *(("narrow-doorway", other) for other in ("frontal-approach", "intersection", "blind-corner")),
        *(("crossing-a-group", other) for other in ("frontal-approach", "intersection")),
        *(("joining-a-group", other) for other in ("crossing-a-group", "frontal-approach", "blind-corner")),
        *(("crowded-hall", other) for other in ("frontal-approach", "crossing-a-group", "joining-a-group")),
        *(("pedestrian-obstruction", other) for other in ("frontal-approach", "overtaking", "parallel-traffic")),
        *(("down-path", other) for other in ("frontal-approach", "following", "intersection")),
        *(("narrow-hallway", other) for other in ("frontal-approach", "parallel-traffic", "following")),
        *(("entering-room", other) for other in ("exiting-room", "entering-elevator", "narrow-doorway")),
        *(("exiting-room", other) for other in ("entering-room", "exiting-elevator")),
        *(("entering-elevator", other) for other in ("exiting-elevator", "entering-room")),
        *(("exiting-elevator", other) for other in ("entering-elevator", "exiting-room")),
        *(("intersection-wait", other) for other in ("intersection-proceed", "intersection")),
        *(("intersection-proceed", other) for other in ("intersection-wait", "intersection")),
        *(("following", other) for other in ("leading", "accompanying", "frontal-approach", "being-overtaken")),
        *(("leading", other) for other in ("following", "accompanying", "overtaking")),
        *(("accompanying", other) for other in ("following", "leading", "frontal-approach")),
        *(("leaving-a-group", other) for other in ("joining-a-group", "crossing-a-group")),
        *(("parallel-traffic", other) for other in ("perpendicular-traffic", "frontal-approach")),
        *(("perpendicular-traffic", other) for other in ("parallel-traffic", "intersection")),
        *(("circular-crossing", other) for other in ("parallel-traffic", "perpendicular-traffic", "intersection")),
        *(("robot-crowding", other) for other in ("joining-a-group", "parallel-traffic", "frontal-approach")),
    ],
)
def test_preset_of_another_situation_is_rejected(name: str, other: str) -> None:
    assert not any(SITUATIONS[name](encounter_of(other, seed)).took_place for seed in SEEDS)


def test_every_situation_has_a_preset_of_its_name() -> None:
    assert set(SITUATIONS) <= set(scenario_names())


@pytest.mark.parametrize("name", SITUATIONS)
def test_scenes_of_a_situation_differ(name: str) -> None:
    config = load_scenario(name)
    layouts = {(s.robot.pose, s.humans, s.polygon) for s in (generate(config, 1, episode) for episode in range(20))}
    assert len(layouts) == 20


@pytest.mark.parametrize("name", SITUATIONS)
def test_empty_room_shows_no_situation(name: str) -> None:
    verdict = rehearse(load_scenario("empty"), name, StraightToGoal(), seed=1)
    assert not verdict.took_place
    assert verdict.description


def test_distant_person_is_not_met() -> None:
    corridor = load_scenario("frontal-approach")
    wide = corridor.changed(room={"kinds": {"rectangle": 1}, "breadth": 12, "length": 13}, people=[
        corridor.people[0].model_copy(update={"y": 5.0, "goals": ((-5.5, 5.0),)}).model_dump(mode="json")
    ])  # fmt: skip
    verdict = rehearse(wide, "frontal-approach", StraightToGoal(), seed=1)
    assert not verdict.took_place
    assert "no person came towards the robot (person 1 head-on, " in verdict.description


def test_people_are_met_only_while_they_are_present() -> None:
    config = load_scenario("frontal-approach")
    passer = {"x": -5.0, "y": 0.8, "goals": [[5.0, 0.8]], "enters": 2.0, "exits": True, "group": 1}
    late = {"x": 5.0, "y": -0.8, "goals": [[-5.0, -0.8]], "enters": 50.0, "exits": True, "group": 1}
    people = [person.model_dump(mode="json", exclude_unset=True) for person in config.people]
    scene = generate(config.changed(people=[*people, passer, late]), 1)
    recorder = EpisodeRecorder()
    Episode(scene, SocialPlanner(), observers=[recorder]).run()
    found = encounter(recorder.record())
    assert found.groups == ()  # the members are never present together
    assert [m.person for m in found.meetings] == [1, 2]
    assert found.meetings[1].kind in ("overtaken", "alongside")
    assert found.density * 13 * 2.2 < 3
    assert judge("frontal-approach", recorder.record()).took_place


def test_recorded_episode_has_the_verdict_of_the_live_one(tmp_path: Path) -> None:
    with JsonRecorder(tmp_path / "corner.json") as recorder:
        Episode(generate(load_scenario("blind-corner"), 2), SocialPlanner(), observers=[recorder]).run()
    recorded = judge("blind-corner", read_episode(tmp_path / "corner.json"))
    assert recorded.took_place
    assert recorded == judge("blind-corner", record_of("blind-corner", 2))


def test_meeting_has_person_time_clearance_and_sight_distance() -> None:
    (meeting,) = encounter_of("blind-corner", 1).meetings
    states = list(record_of("blind-corner", 1).snapshots())
    nearest = round(meeting.time / states[0].dt)
    distances = [math.dist(s.robot.position, s.humans.position[0]) for s in states]
    assert meeting.person == 1
    gaps = [clearance(s) for s in states]
    assert min(gaps) == pytest.approx(gaps[nearest])
    assert meeting.clearance == pytest.approx(clearance(states[nearest]))
    assert meeting.sight_distance == pytest.approx(
        next(d for d, s in zip(distances, states, strict=True) if is_seen(s))
    )
    assert 1.0 < meeting.sight_distance < distances[0] - 1.0


def is_seen(snapshot: Snapshot) -> bool:
    """Whether the line from the robot to the first person lies in the room."""
    fraction = np.linspace(0.0, 1.0, 1000)[:, None]
    line = (1.0 - fraction) * np.array(snapshot.robot.position) + fraction * snapshot.humans.position[0]
    return bool(inside_polygon(line, snapshot.scene.outline).all())


def test_meeting_of_a_mirrored_episode_changes_sides_only() -> None:
    record = record_of("intersection", 3)
    (meeting,), (mirror_image,) = encounter(record).meetings, encounter(mirrored(record)).meetings
    assert mirror_image.side != meeting.side
    assert (mirror_image.kind, mirror_image.time) == (meeting.kind, meeting.time)
    assert mirror_image.sight_distance == meeting.sight_distance
    assert mirror_image.clearance == pytest.approx(meeting.clearance)


def test_doorway_is_a_gap_between_free_ends_of_walls() -> None:
    scene = generate(ScenarioConfig(humans=0, relations=0, room={"kinds": "doorway", "door": 1.0, "door_offset": 0}), 1)
    ((a, b),) = doorways(scene)
    assert math.dist(a, b) == pytest.approx(1.0, abs=1e-3)
    assert doorways(generate(load_scenario("intersection"), 1)) == []


def test_centre_of_an_open_circle_is_that_of_the_circle() -> None:
    (group,) = encounter_of("joining-a-group", 1).groups
    assert group.radius == pytest.approx(0.85, abs=0.1)
    assert group.joined
    robot = record_of("joining-a-group", 1).states.robot[-1, :2]
    assert float(np.hypot(*robot)) == pytest.approx(group.distance, abs=0.15)


def test_unknown_situation_is_refused_with_the_known_names() -> None:
    with pytest.raises(ConfigError, match="no situation is named 'corner'; situations are frontal-approach, "):
        judge("corner", record_of("overtaking", 0))
