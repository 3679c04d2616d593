"""Instructions, sentences, questions and answers, and their export in the chat form."""

from __future__ import annotations

import base64
import io
import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest

import sonata2d as s2
from sonata2d.formats import export_to, import_from
from sonata2d.formats.chat.export import FORMAT, export
from sonata2d.formats.chat.questions import QUESTIONS, ask
from sonata2d.formats.chat.recompute import recompute
from sonata2d.formats.format import Options
from sonata2d.metrics.words import instruction, listed, persons, situation, story
from tests.running import record_of

WARD: dict[str, Any] = {
    "name": "ward", "standing": 1, "wandering": 4, "tables": 1, "plants": 1, "at_laptop": 1, "relations": 0,
    "talking_groups": 1, "arguing_pairs": 1, "handing_over_pairs": 1, "room": {"kinds": ["square"], "side": 10},
    "person": {"kinds": {"adult": 2, "child": 1, "wheelchair": 1}},
    "doors": [{"inflow": 8}], "social": {"exits": 0.3},
    "areas": [
        {"name": "ward", "polygon": [[-5, -5], [0, -5], [0, 5], [-5, 5]], "speed_limit": 0.5},
        {"name": "carpet", "polygon": [[3, 3], [4, 3], [4, 4], [3, 4]], "no_go": True},
    ],
    "attributes": {
        "people": {"emotion": {"calm": 3, "angry": 1}, "hurried": 0.3}, "objects": {"fragile": 0.3},
        "episode": {"robot_carries": {"a cup": 1, "nothing": 0}},
    },
}  # fmt: skip


HALL: dict[str, Any] = {
    "standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0, "robot": {"pose": [-5, 0, 0]},
    "goal": {"position": [5, 0]}, "room": {"polygon": [[-6, -4], [6, -4], [6, 4], [-6, 4]]},
}  # fmt: skip


def run(config: s2.ScenarioConfig) -> s2.EpisodeRecord:
    return record_of(s2.generate(config, 1), s2.StraightToGoal())


@cache
def ward(seed: int) -> s2.EpisodeRecord:
    return record_of(s2.generate(s2.ScenarioConfig(**WARD), seed))


def test_every_answer_is_the_same_when_other_code_computes_it_and_every_kind_is_asked() -> None:
    kinds = set()
    for seed in range(8):
        record = ward(seed)
        questions = ask(record, 60)
        assert len({question.text for question in questions}) == len(questions)
        for q in questions:
            assert recompute(record.document, q.kind, q.tick, q.ids, q.value) == q.answer, q
            kinds.add(q.kind)
    assert set(QUESTIONS) - kinds <= {"arrival", "between"}


def test_a_wrong_answer_is_found() -> None:
    record = ward(0)
    changed = {**record.document, "outcome": record.document["outcome"] | {"status": "timeout"}}
    before = record.document["outcome"]["status"]
    assert before == "goal"
    assert recompute(record.document, "reaches-goal", None, (), None) == "yes"
    assert recompute(changed, "reaches-goal", None, (), None) == "no"
    with pytest.raises(ValueError, match="no question of the kind"):
        recompute(record.document, "who-knows", None, (), None)


def test_an_episode_has_the_same_questions_each_time() -> None:
    assert ask(ward(1), 15) == ask(ward(1), 15)
    assert ask(ward(1), 15) != ask(ward(2), 15)
    assert len(ask(ward(1), 5)) == 5
    assert ask(ward(1), 0) == []


def test_an_instruction_names_destination_people_areas_and_fragile_things_by_their_ids() -> None:
    scene = ward(0).scene()
    task = instruction(scene)
    talking = {member for group in scene.groups if group.kind == "talking" for member in group.members}
    assert set(task.slots["undisturbed"]) == talking
    assert (task.slots["no_go"], task.slots["slow"]) == (["carpet"], ["ward"])
    fragile = [piece.id for piece in scene.furniture if (piece.attributes or {})["fragile"]]
    assert task.slots.get("fragile", []) == fragile
    assert "who argue" in task.text
    assert "do not enter the carpet" in task.text
    assert task.text.startswith("Bring a cup to ")
    assert instruction(s2.generate("empty", 1)).slots == {}


def test_an_instruction_says_what_to_bring_and_in_which_area() -> None:
    carries = {"episode": {"robot_carries": {"type": "text", "value": "a glass"}}}
    kitchen = [{"name": "kitchen", "polygon": [[2, -4], [6, -4], [6, 4], [2, 4]]}]
    guest = [{"x": 3, "y": 2}]
    found = instruction(s2.generate(s2.ScenarioConfig(**HALL, attributes=carries, areas=kitchen), 1))
    assert found.text == "Bring a glass to the place 10.0 m ahead and 0.0 m left from your start, in the area kitchen."
    assert found.slots == {"area": ["kitchen"]}
    meet = s2.ScenarioConfig(**HALL | {"goal": {"task": "meet", "person": 1}}, attributes=carries, people=guest)
    assert instruction(s2.generate(meet, 1)).text == "Bring a glass to person 1."
    follow = {"goal": {"task": "follow", "person": 1}, "people": [{"x": 3, "y": 2, "goals": [[0, 0]]}]}
    assert instruction(s2.generate(s2.ScenarioConfig(**HALL | follow, attributes=carries), 1)).text == (
        "Follow person 1; carry a glass."
    )


def test_a_situation_describes_everything_in_the_robots_frame() -> None:
    snapshot = ward(0).snapshot(20)
    text = situation(snapshot)
    for human in snapshot.humans:
        ahead, left = snapshot.robot.pose.to_local(human.pose.position)
        assert f"Person {human.id} is at ({ahead + 0.0:.1f}, {left + 0.0:.1f})" in text
    assert text.count(" is at (") == 1 + len(snapshot.humans) + len(snapshot.scene.furniture)  # 1: the goal


def test_a_story_tells_start_meetings_and_end() -> None:
    sentences = story(ward(0))
    assert sentences[0].startswith("The robot starts ")
    assert sentences[-1].startswith("It reaches its goal after ")
    times = [float(line.split()[1]) for line in sentences if line.startswith("At ")]
    assert times == sorted(times)
    met = s2.generate(s2.load_scenario("frontal-approach"), 0)
    recorder = s2.EpisodeRecorder()
    s2.Episode(met, s2.SocialPlanner(), observers=[recorder]).run()
    assert any("meets person 1, who comes towards it" in line for line in story(recorder.record()))


def test_the_export_has_a_description_and_questions_with_pictures_on_request(tmp_path: Path) -> None:
    record = ward(0)
    lines = [json.loads(line) for line in export(record, Options(questions=4, pictures=True)).splitlines()]
    assert [line["meta"]["kind"] == "description" for line in lines] == [True, False, False, False]
    assert [message["role"] for message in lines[0]["messages"]] == ["system", "user", "assistant"]
    picture, text = lines[1]["messages"][1]["content"]
    image = pygame.image.load(io.BytesIO(base64.b64decode(picture["image_url"]["url"].partition(",")[2])))
    assert max(image.get_size()) <= 480
    assert text["text"].endswith("?")
    plain = [json.loads(line) for line in export(record, Options()).splitlines()]
    assert len(plain) == 20
    assert isinstance(plain[1]["messages"][1]["content"], str)


def test_episodes_without_a_robot_are_refused(tmp_path: Path) -> None:
    assert FORMAT.options == {"questions", "pictures"}
    tracks = tmp_path / "tracks.csv"
    tracks.write_text("frame,ped,x,y\n" + "".join(f"{k},1,{0.1 * k},0\n{k},2,{0.1 * k},1\n" for k in range(30)))
    [path] = import_from(tracks, "csv", tmp_path / "in", Options(frame_time=0.1)).files
    result = export_to(path, "chat", tmp_path / "out")
    assert ["no recorded robot" in omission.reason for omission in result.skipped] == [True]


def test_lists_in_words() -> None:
    assert listed(["a"]) == "a"
    assert persons([3]) == "person 3"
    assert persons([3, 4, 5]) == "persons 3, 4 and 5"


def test_what_an_import_lacks_is_neither_told_nor_asked(tmp_path: Path) -> None:
    recorder = s2.JsonRecorder(tmp_path / "a.json")
    scene = s2.generate(s2.ScenarioConfig(**(HALL | {"wandering": 3, "talking_pairs": 1})), 1)
    s2.Episode(scene, s2.SocialPlanner(), observers=[recorder]).run()
    [sonata] = export_to(tmp_path / "a.json", "sonata", tmp_path / "out").files
    [path] = import_from(sonata, "sonata", tmp_path / "in").files
    record = s2.read_episode(path)
    assert {"outcome", "frames.contacts", "robot.radius"} <= set(record.document["imported"]["lacks"])
    kinds = {q.kind for q in ask(record, 200)}
    assert {"nearest-person", "side"} <= kinds
    assert {"reaches-goal", "arrival", "touches", "between"}.isdisjoint(kinds)
    assert story(record)[-1].startswith("The recording ends after")
    assert "radius" not in situation(record.snapshot(0))


def test_a_contact_that_ends_an_episode_is_told() -> None:
    people = [{"x": 3, "y": 0, "behaviour": "walking", "goals": [[-5.5, 0]], "reacts_to_robot": 0}]
    rules = {"guard": False, "ends_on": ["goal", "time", "contact"], "time_limit": 20}
    record = run(s2.ScenarioConfig(**HALL, people=people, rules=rules))
    assert record.outcome.status == "contact"
    assert any("it touches person 1" in sentence for sentence in story(record))


def test_seconds_on_the_edge_between_two_tenths_are_not_asked() -> None:
    config = s2.ScenarioConfig(**(HALL | {"goal": {"position": [-1.89, 0]}}), rules={"dt": 0.05})
    record = run(config)
    assert record.outcome.status == "goal"
    assert round(record.outcome.time * 100) % 10 == 5
    questions = ask(record, 40)
    assert questions
    for q in questions:
        assert recompute(record.document, q.kind, q.tick, q.ids, q.value) == q.answer
    assert "arrival" not in {q.kind for q in questions}


def test_names_and_values_of_attributes_are_told_apart() -> None:
    people = [{"x": 1, "y": 1, "attributes": {"mood=x": "low", "stress": "high", "age": 67170}}]
    declared = {"people": {"mood=x": ["low", "high"], "stress": ["low", "high"], "age": "number"}}
    record = run(s2.ScenarioConfig(**HALL, people=people, attributes=declared, rules={"time_limit": 2}))
    assert "mood=x low, stress high, age 67170" in situation(record.snapshot(0))
    questions = ask(record, 200)
    assert {"attribute", "who-has"} <= {q.kind for q in questions}
    for q in questions:
        assert recompute(record.document, q.kind, q.tick, q.ids, q.value) == q.answer


def test_the_positions_in_the_text_suffice_for_the_answer_which_is_not_in_it() -> None:
    places = re.compile(r"(robot|person \d+) \(([-\d.]+), ([-\d.]+)\)")
    answered = 0
    for seed in range(4):
        record = ward(seed)
        sentences = story(record)
        for line in map(json.loads, export(record, Options(questions=60)).splitlines()):
            text, answer, meta = line["messages"][1]["content"], line["messages"][2]["content"], line["meta"]
            assert not any(sentence in text for sentence in sentences[1:])
            if meta["kind"] not in ("closest-approach", "comes-nearer"):
                continue
            least = dict.fromkeys(meta["ids"], np.inf)
            for moment in text.partition("Positions in the room")[2].split(" s: ")[1:]:
                at = {name: np.array([float(x), float(y)]) for name, x, y in places.findall(moment)}
                for id in meta["ids"]:
                    if f"person {id}" in at:
                        least[id] = min(least[id], float(np.hypot(*(at[f"person {id}"] - at["robot"]))))
            if meta["kind"] == "closest-approach":
                assert answer == f"{least[meta['ids'][0]]:.1f} m"
            else:
                assert answer == f"person {min(least, key=lambda id: least[id])}"
            answered += 1
    assert answered > 5
