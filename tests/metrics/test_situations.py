"""Each situation's preset brings about the encounter it is named after, and no other preset passes for it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sonata2d import Episode, JsonRecorder, SocialPlanner, StraightToGoal, generate, load_scenario
from sonata2d.agents.controllers.base import Controller
from sonata2d.core.entities import PERSON_RADIUS
from sonata2d.core.snapshot import Snapshot
from sonata2d.errors import ConfigError
from sonata2d.metrics.encounters import Course, Encounter, doorways, encounter
from sonata2d.metrics.situations import SITUATIONS, Looker, judge, rehearse
from sonata2d.record.reader import read_episode
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.load import scenario_names

SEEDS = range(4)


@cache
def looks(name: str, seed: int, driver: type[Controller] = SocialPlanner) -> tuple[Snapshot, ...]:
    looker = Looker()
    Episode(generate(load_scenario(name), seed), driver(), observers=[looker]).run()
    return tuple(looker.snapshots)


@cache
def seen(name: str, seed: int, driver: type[Controller] = SocialPlanner) -> Encounter:
    return encounter(looks(name, seed, driver))


@pytest.mark.parametrize("driver", [SocialPlanner, StraightToGoal])
@pytest.mark.parametrize("name", SITUATIONS)
def test_a_preset_brings_about_the_encounter_it_is_named_after(name: str, driver: type[Controller]) -> None:
    for seed in SEEDS:
        verdict = SITUATIONS[name](seen(name, seed, driver))
        assert verdict.took_place, f"{name}, seed {seed}: {verdict.told}"


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
    ],
)
def test_another_encounter_does_not_pass_for_a_situation(name: str, other: str) -> None:
    assert not any(SITUATIONS[name](seen(other, seed)).took_place for seed in SEEDS)


def test_every_situation_is_a_preset_of_its_own_name() -> None:
    assert set(SITUATIONS) <= set(scenario_names())


@pytest.mark.parametrize("name", SITUATIONS)
def test_no_two_scenes_of_a_situation_are_alike(name: str) -> None:
    config = load_scenario(name)
    layouts = {(s.robot.pose, s.humans, s.polygon) for s in (generate(config, 1, episode) for episode in range(20))}
    assert len(layouts) == 20


def test_an_empty_room_is_no_situation() -> None:
    for name in SITUATIONS:
        verdict = rehearse(load_scenario("empty"), name, StraightToGoal(), seed=1)
        assert not verdict.took_place
        assert verdict.told


def test_a_person_far_off_is_not_met() -> None:
    corridor = load_scenario("frontal-approach")
    wide = corridor.changed(room={"kinds": {"rectangle": 1}, "breadth": 12, "length": 13}, people=[
        corridor.people[0].model_copy(update={"y": 5.0, "goals": ((-5.5, 5.0),)}).model_dump(mode="json")
    ])  # fmt: skip
    verdict = rehearse(wide, "frontal-approach", StraightToGoal(), seed=1)
    assert not verdict.took_place
    assert "nobody came the other way (person 1 head-on, " in verdict.told


def test_people_who_come_and_go_are_met_while_they_are_there(tmp_path: Path) -> None:
    config = load_scenario("frontal-approach")
    passer = {"x": -5.0, "y": 0.8, "goals": [[5.0, 0.8]], "enters": 2.0, "exits": True, "group": 1}
    late = {"x": 5.0, "y": -0.8, "goals": [[-5.0, -0.8]], "enters": 50.0, "exits": True, "group": 1}
    people = [person.model_dump(mode="json", exclude_unset=True) for person in config.people]
    scene = generate(config.changed(people=[*people, passer, late]), 1)
    looker = Looker()
    with JsonRecorder(tmp_path / "one.json") as recorder:
        Episode(scene, SocialPlanner(), observers=[looker, recorder]).run()
    live, recorded = encounter(looker.snapshots), encounter(read_episode(tmp_path / "one.json"))
    assert live.groups == recorded.groups == ()  # never whole
    assert [m.person for m in live.meetings] == [m.person for m in recorded.meetings] == [1, 2]
    assert live.meetings[1].kind in ("overtaken", "alongside")
    assert live.density * 13 * 2.2 < 3
    assert judge("frontal-approach", looker.snapshots).took_place


def test_a_recorded_episode_is_judged_like_the_live_one(tmp_path: Path) -> None:
    with JsonRecorder(tmp_path / "corner.json") as recorder:
        Episode(generate(load_scenario("blind-corner"), 2), SocialPlanner(), observers=[recorder]).run()
    recorded, live = (
        judge("blind-corner", read_episode(tmp_path / "corner.json")),
        judge("blind-corner", looks("blind-corner", 2)),
    )
    assert recorded.took_place
    assert recorded == live


def test_who_meets_whom_where_and_when_is_told() -> None:
    (meeting,) = seen("blind-corner", 1).meetings
    there = looks("blind-corner", 1)
    nearest = round(meeting.time / there[0].dt)
    gaps = [math.dist(s.robot.position, s.humans.position[0]) for s in there]
    assert meeting.person == 1
    assert min(gaps) == pytest.approx(gaps[nearest])
    assert meeting.gap == pytest.approx(gaps[nearest] - 0.3 - PERSON_RADIUS)
    assert 2.0 < meeting.sight < 4.0


def test_an_encounter_turns_and_mirrors_with_the_scene() -> None:
    course = Course.of(looks("intersection", 3))
    (meeting,) = seen("intersection", 3).meetings
    flipped = mirror_image(looks("intersection", 3))
    assert flipped.side != meeting.side
    assert (flipped.kind, flipped.time, flipped.sight) == (meeting.kind, meeting.time, meeting.sight)
    assert flipped.gap == pytest.approx(meeting.gap)
    assert len(course.robot) == len(looks("intersection", 3))


def mirror_image(there: tuple[Snapshot, ...]) -> object:
    """The only meeting of a run whose y has the other sign."""

    def across(snapshot: Snapshot) -> Snapshot:
        x, y = snapshot.robot.position
        scene = snapshot.scene
        walls = tuple(replace(w, start=(w.start[0], -w.start[1]), end=(w.end[0], -w.end[1])) for w in scene.walls)
        state = snapshot.humans.state.copy()
        state[:, 1] *= -1.0
        return replace(
            snapshot,
            scene=replace(scene, walls=walls),
            robot=replace(snapshot.robot, position=(x, -y)),
            humans=replace(snapshot.humans, state=state),
        )

    return encounter([across(snapshot) for snapshot in there]).meetings[0]


def test_doorways_are_gaps_between_loose_ends_of_walls() -> None:
    scene = generate(ScenarioConfig(humans=0, relations=0, room={"kinds": "doorway", "door": 1.0, "door_offset": 0}), 1)
    ((a, b),) = doorways(scene)
    assert math.dist(a, b) == pytest.approx(1.0, abs=1e-3)
    assert doorways(generate(load_scenario("intersection"), 1)) == []


def test_the_middle_of_an_open_circle_is_its_centre() -> None:
    (group,) = seen("joining-a-group", 1).groups
    assert group.reach == pytest.approx(0.85, abs=0.1)
    assert group.joined
    robot = np.array(looks("joining-a-group", 1)[-1].robot.position)
    assert float(np.hypot(*robot)) == pytest.approx(group.nearest, abs=0.15)


def test_an_unknown_situation_is_refused_with_those_there_are() -> None:
    with pytest.raises(ConfigError, match="no situation is named 'corner'; situations are frontal-approach, "):
        judge("corner", looks("overtaking", 0))
