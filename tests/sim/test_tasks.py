"""Tasks of the robot: places in order; people to meet, follow, accompany, lead and wait for."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.controllers.local_planner import Dwa
from sonata2d.core.tasks import ARRIVED
from sonata2d.datasets import mirror_file, verify
from sonata2d.errors import ConfigError, ControllerError, SceneError, UnsuitableEpisode
from sonata2d.formats.format import Options
from sonata2d.formats.socnav3 import export as to_socnav3
from sonata2d.gym import SocialNavEnv
from sonata2d.learning import GraphPolicy
from sonata2d.learning.graph import modern_graph
from sonata2d.learning.graph.graph import NODE_TYPES
from sonata2d.metrics import Trajectory
from sonata2d.metrics.catalogue import METRICS
from sonata2d.metrics.scene_difficulty import difficulty
from sonata2d.metrics.words import instruction, story
from sonata2d.view.stills import picture
from tests.running import record_of

HALL: dict[str, Any] = {
    "standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0, "rules": {"time_limit": 60},
    "room": {"polygon": [[-8, -4], [8, -4], [8, 4], [-8, 4]]}, "robot": {"pose": [-6, 0, 0]},
    "people": [{"x": -4, "y": 0, "goals": [[4, 2], [5, -3]], "desired_speed": 0.7}],
}  # fmt: skip
TASKS: dict[str, dict[str, Any]] = {
    "then": {"position": [0, 2], "then": [[3, -2], [6, 2]]},
    "meet": {"task": "meet", "person": 1, "near": 1.2},
    "follow": {"task": "follow", "person": 1},
    "accompany": {"task": "accompany", "person": 1},
    "lead": {"task": "lead", "person": 1, "position": [5, -3]},
    "wait": {"task": "wait", "person": 1, "position": [4, 0]},
}


def scene_of(goal: dict[str, Any], **changes: Any) -> s2.Scene:
    return s2.generate(s2.ScenarioConfig(**(HALL | changes), goal=goal), 1)


def gaps(record: s2.EpisodeRecord) -> Any:
    return np.hypot(*(record.states.humans[:, 0, :2] - record.states.robot[:, :2]).T)


@pytest.mark.parametrize("name", TASKS)
@pytest.mark.parametrize("controller", [s2.SocialPlanner, s2.StraightToGoal, s2.Orca, s2.SocialForce])
def test_controllers_do_each_task(name: str, controller: type[s2.Controller], tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    scene = scene_of(TASKS[name])
    episode = s2.Episode(scene, controller(), observers=[s2.JsonRecorder(path)])
    assert episode.run().status == "goal"
    record = s2.read_episode(path)
    assert record.scene() == scene
    assert verify(path, replay=True) == []
    again, goals = s2.Episode(scene, past=episode.past), []
    for _ in range(len(record) + 1):
        goals.append(again.snapshot().goal)
        again.step()
    assert record.goals[:, :2].tolist() == [list(goal.position) for goal in goals]
    assert [snapshot.goal for snapshot in record.snapshots()] == goals


def test_places_are_visited_in_order() -> None:
    record = record_of(scene_of(TASKS["then"]))
    first = {tuple(place): tick for tick, place in reversed([*enumerate(record.goals[:, :2].tolist())])}
    assert [*sorted(first, key=lambda place: first[place])] == [(0.0, 2.0), (3.0, -2.0), (6.0, 2.0)]
    for tick, place in zip(
        [*sorted(first.values())[1:], len(record)], sorted(first, key=first.__getitem__), strict=True
    ):
        assert np.hypot(*(record.states.robot[tick, :2] - place)) <= 0.4
    missed = record_of(scene_of(TASKS["then"] | {"position": [-7.5, -3.5]}, rules={"time_limit": 3}))
    assert missed.outcome.status == "timeout"
    passing = record_of(scene_of({"position": [7, 0], "then": [[-5, 0]]}, people=[], rules={"time_limit": 3}))
    assert passing.outcome.status == "timeout", "the last place counts only after the first"


def test_a_person_is_met_where_it_is_and_not_where_it_was() -> None:
    record = record_of(scene_of(TASKS["meet"]))
    distance = gaps(record)
    assert distance[-1] <= 1.2 < distance[:-1].min()
    offset = record.goals[:, :2] - record.states.humans[:, 0, :2]
    assert np.abs(offset).max() <= 0.125 + 1e-9, "the goal moves with the person, on a grid"


@pytest.mark.parametrize("name", ["follow", "accompany"])
def test_the_robot_stays_with_a_person_to_the_end_of_its_way(name: str) -> None:
    record = record_of(scene_of(TASKS[name]))
    person, robot = record.states.humans[:, 0], record.states.robot
    assert np.hypot(*(person[-1, :2] - (5, -3))) <= ARRIVED
    assert METRICS["company"].function(Trajectory(record)) == pytest.approx((gaps(record) <= 2.0).mean())
    assert (gaps(record)[len(record) // 3 :] < 2.5).all()
    c, s = np.cos(person[:, 2]), np.sin(person[:, 2])
    dx, dy = (robot[:, :2] - person[:, :2]).T
    aside = np.abs(dy * c - dx * s)[len(record) // 3 : -20]
    assert (np.median(aside) > 0.5) == (name == "accompany")


def test_a_person_who_is_led_or_awaited_has_to_be_near() -> None:
    alone = record_of(scene_of(TASKS["lead"], people=[{"x": -7, "y": 3}], rules={"time_limit": 20}))
    assert alone.outcome.status == "timeout"
    assert np.hypot(*(alone.states.robot[-1, :2] - (5, -3))) < 0.4
    late = record_of(scene_of(TASKS["wait"] | {"position": [-5, -2]}, rules={"time_limit": 15}))
    assert late.outcome.status == "timeout"
    assert METRICS["company"].function(Trajectory(alone)) == 0.0


def test_the_robot_stays_where_it_is_until_the_person_comes() -> None:
    record = record_of(scene_of(TASKS["follow"], people=[HALL["people"][0] | {"enters": 3.0}]))
    assert record.outcome.status == "goal"
    assert not record.states.present[20, 0]
    assert np.hypot(*(record.states.robot[20, :2] - record.states.robot[0, :2])) < 0.1
    assert story(record)[0] == "Person 1 is not there at the start."


def test_a_person_is_met_in_a_room_too_small_for_a_drawn_goal() -> None:
    room = {"polygon": [[-1.2, -1], [1.2, -1], [1.2, 1], [-1.2, 1]]}
    changes = {"room": room, "robot": {"pose": [-0.5, -0.2, 0]}, "people": [{"x": 0.7, "y": 0.5}]}
    assert scene_of({"task": "meet", "person": 1, "near": 0.9}, **changes).goal.position == (0.7, 0.5)


def test_rewards_count_progress_to_the_goal_before_the_step() -> None:
    env = SocialNavEnv(s2.ScenarioConfig(**(HALL | {"people": []}), goal={"position": [-3, 0], "then": [[-3, 3]]}))
    env.reset(seed=1)
    rewards = []
    while env.unwrapped.snapshot.goal.then:
        action = np.zeros(env.action_space.shape[0], dtype=np.float32)
        action[0] = 1.0
        rewards.append(float(env.step(action)[1]))
    assert min(rewards[5:]) > 0.0, "a place that is reached is no step back"


def test_observations_of_a_record_begin_once(monkeypatch: pytest.MonkeyPatch) -> None:
    env = SocialNavEnv(s2.ScenarioConfig(**HALL, goal=TASKS["follow"]))
    env.reset(seed=1)
    record, resets = record_of(env.unwrapped.scene), []
    begin = type(env.encoder).reset
    monkeypatch.setattr(type(env.encoder), "reset", lambda self, scene: (resets.append(scene), begin(self, scene)))
    for snapshot in record.snapshots():
        observation = env.observe(snapshot)
        assert observation["goal"][:2].tolist() == pytest.approx(
            snapshot.robot.pose.to_local(snapshot.goal.position), abs=1e-4
        )
    assert len(resets) == 1


def test_difficulty_is_not_defined_for_a_goal_that_moves() -> None:
    with pytest.raises(SceneError, match=r"difficulty is defined for one goal, and that of .* moves"):
        difficulty(scene_of(TASKS["then"]))


def test_environments_show_the_goal_of_the_tick() -> None:
    config = s2.ScenarioConfig(**HALL, goal=TASKS["follow"])
    env = SocialNavEnv(config)
    observation, _ = env.reset(seed=1)
    for _ in range(40):
        observation, *_ = env.step(np.array([1.0, 0.0, 0.0], dtype=np.float32)[: env.action_space.shape[0]])
    snapshot = env.unwrapped.snapshot
    expected = snapshot.robot.pose.to_local(snapshot.goal.position)
    assert observation["goal"][:2].tolist() == pytest.approx(expected, abs=1e-5)
    assert snapshot.goal.x > -3.0
    with pytest.raises(TypeError, match=r"the task of .* is 'follow' with places or a person; Worlds and vectors take"):
        s2.Worlds([s2.generate(config, 1)]).reset()


def test_mirror_images_of_tasks_have_their_places_mirrored(tmp_path: Path) -> None:
    s2.Episode(scene_of(TASKS["then"]), s2.SocialPlanner(), observers=[s2.JsonRecorder(tmp_path / "a.json")]).run()
    mirror_file(tmp_path / "a.json", tmp_path / "b.json")
    image = s2.read_episode(tmp_path / "b.json").scene()
    assert image.goal.then == ((3.0, 2.0), (6.0, -2.0))
    assert verify(tmp_path / "b.json") == []
    flipped = s2.generate(s2.ScenarioConfig(**HALL, goal=TASKS["then"], flip=1.0), 1)
    assert flipped.goal.then == image.goal.then


@pytest.mark.parametrize("task", ["follow", "then"])
def test_graphs_have_the_goal_of_each_instant(task: str) -> None:
    record = record_of(scene_of(TASKS[task]))
    graph = modern_graph(record, len(record), frame="world", instants=4, interval=2.0)
    is_goal = graph.node_type == NODE_TYPES.index("goal")
    expected = record.goals[[graph.ticks[instant] for instant in graph.instant[is_goal]]]
    columns = [graph.feature_names.index(name) for name in ("x", "y", "cos", "sin")]
    found = graph.features[np.ix_(is_goal, columns)]
    assert np.allclose(found, np.column_stack((expected[:, :2], np.cos(expected[:, 2]), np.sin(expected[:, 2]))))
    assert len(np.unique(record.goals[:, :2], axis=0)) > 1
    at_goal = modern_graph(record, len(record), frame="goal", instants=1)
    assert np.allclose(at_goal.features[at_goal.node_type == NODE_TYPES.index("goal")][0, columns[:2]], 0.0)


def test_the_policy_reads_the_graphs_of_its_recorded_task() -> None:
    policy, record = GraphPolicy(), record_of(scene_of(TASKS["then"]))
    policy.reset(record.scene())
    for tick, snapshot in enumerate(record.snapshots()):
        policy.act(snapshot)
        read = policy.graph(record.scene())
        assert np.allclose(read.features, modern_graph(record, tick, instants=1).features, atol=1e-9)


def test_formats_with_one_goal_refuse_a_goal_that_moves() -> None:
    record = record_of(scene_of(TASKS["follow"]))
    with pytest.raises(UnsuitableEpisode, match=r"the robot has the task 'follow', and socnav3 has one position only"):
        to_socnav3(record, Options())
    with pytest.raises(ControllerError, match=r"Dwa drives to one position, and the goal of this scene moves"):
        record_of(record.scene(), Dwa())


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("then", r"Go to the place .* from your start, then to the one .* and the one .*, in this order\."),
        ("meet", r"Go to person 1\."),
        ("follow", r"Follow person 1\."),
        ("accompany", r"Go beside person 1\."),
        ("lead", r"Lead person 1 to the place .*\."),
        ("wait", r"Go to the place .* from your start and wait there for person 1\."),
    ],
)
def test_tasks_in_words(name: str, text: str) -> None:
    scene = scene_of(TASKS[name])
    found = instruction(scene)
    assert re.fullmatch(text, found.text), found.text
    assert found.slots.get("person") == (None if name == "then" else [1])
    assert story(record_of(scene))[-1].startswith("It has done its task after")


def test_pictures_show_the_goal_of_the_tick() -> None:
    record = record_of(scene_of(TASKS["follow"]))
    late = record.snapshot(-1)
    scene = late.scene.with_goal(record.scene().goal)
    assert scene.goal == record.scene().goal
    moved = picture(late, size=(400, 220))
    still = picture(replace(late, scene=record.scene()), size=(400, 220))
    assert moved.get_buffer().raw != still.get_buffer().raw


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ({"task": "follow"}, r"goal\.person: the task 'follow' is about a person; give its number in people"),
        ({"person": 1}, r"goal\.person: person is of other tasks than go"),
        ({"task": "meet", "person": 2}, r"goal\.person: there is no person 2; people has 1"),
        ({"task": "meet", "person": 1, "position": [1, 1]}, r"the goal of the task 'meet' is at the person; omit"),
        ({"task": "wait", "person": 1, "then": [[1, 1]]}, r"further places are of the task go, not of 'wait'"),
        ({"task": "chase", "person": 1}, r"goal\.task"),
        ({"near": 3}, r"goal\.near: near has no effect on the task 'go'; omit it"),
        ({"task": "meet", "person": 1, "theta": 1.0}, r"goal\.theta: theta has no effect on the task 'meet'; omit it"),
        (
            {"task": "meet", "person": 1, "near": 0.2},
            r"goal\.near: near is 0\.5 m or more, from centre",
        ),
        ({"task": "accompany", "person": 1, "near": 1}, r"goal\.near: near is 1\.2 m or more"),
    ],
)
def test_wrong_tasks_are_refused(goal: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        s2.ScenarioConfig(**HALL, goal=goal)


def test_goals_are_beside_an_object_of_a_type(tmp_path: Path) -> None:
    config = s2.ScenarioConfig(tables=2, plants=2, at_laptop=1, drop=True, goal={"object": "laptop"})
    for episode in range(12):
        scene = s2.generate(config, 3, episode)
        laptops = {piece.id: piece for piece in scene.furniture if piece.type == "laptop"}
        assert scene.goal.object in laptops
        apart = {id: np.hypot(*np.subtract(p.pose.position, scene.goal.position)) for id, p in laptops.items()}
        assert min(apart, key=lambda id: apart[id]) == scene.goal.object
        assert apart[scene.goal.object] < 2.5
        found = instruction(scene)
        assert found.text.startswith(f"Go to laptop {scene.goal.object}")
        assert found.slots["destination"] == [scene.goal.object]
    path = tmp_path / "a.json"
    s2.Episode(scene, s2.SocialPlanner(), observers=[s2.JsonRecorder(path)]).run()
    assert s2.read_episode(path).scene().goal == scene.goal
    assert verify(path, replay=True) == []
    with pytest.raises(SceneError, match=r"goal\.object is 'sofa', which is not in the scene; it has no furniture"):
        scene_of({"object": "sofa"})
    with pytest.raises(ConfigError, match="the goal is beside an object, or at a position or in an area"):
        scene_of({"object": "sofa", "position": [1, 1]})


def test_tasks_that_no_scene_can_have_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"person 1 walks nowhere; give goals, at the last of which the task ends"):
        s2.ScenarioConfig(**(HALL | {"people": [{"x": 0, "y": 0}]}), goal=TASKS["follow"])
    for change, message in (
        ({"exits": True}, "person 1 leaves the scene, and the task ends where it stays"),
        ({"leaves": 5}, "person 1 leaves the scene"),
        ({"goals": [[4, 2], [-4, 0.5]]}, r"the way of person 1 comes within 1\.2 m of its end.*; move a goal"),
        ({"goals": [[4, 0], [-4, 3], [0, 0.5]]}, "the way of person 1 comes within"),
    ):
        person = HALL["people"][0] | change
        with pytest.raises(ConfigError, match=message):
            s2.ScenarioConfig(**(HALL | {"people": [person]}), goal=TASKS["follow"])
    with pytest.raises(SceneError, match=r"the robot cannot be at the further place \(20, 0\) of its goal; move it"):
        scene_of({"position": [0, 2], "then": [[20, 0]]})
    with pytest.raises(SceneError, match=r"the robot starts within 3 m of person 1, whom it is to meet"):
        scene_of(TASKS["meet"] | {"near": 3})
    with pytest.raises(ConfigError, match=r"tasks, further places and objects are of the first robot"):
        s2.ScenarioConfig(**HALL, robots=[{"goal": {"then": [[1, 1]]}}])
