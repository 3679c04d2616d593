"""Several robots in one scene: outlines judged by separate code, contacts, people, views, files, metrics, pictures."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest

import sonata2d as s2
from sonata2d.agents import FieldOfView, Lidar
from sonata2d.agents.controllers.base import External
from sonata2d.core.entities import Goal, OtherRobot, Robot, Wall
from sonata2d.core.geometry import Pose, Rectangle, Twist
from sonata2d.core.proxemics import touched_kind
from sonata2d.core.scene import Rules, Scene
from sonata2d.datasets import branch, mirrored, read_manifest, verify
from sonata2d.errors import ConfigError, ControllerError, SceneError
from sonata2d.formats.api import export_to, import_from
from sonata2d.formats.format import Options
from sonata2d.learning.graph import modern_graph
from sonata2d.learning.graph.graph import NODE_TYPES
from sonata2d.metrics import measure, measure_files
from sonata2d.sim.inputs import TickInput

from ..conftest import room, walker
from .test_shaped_robots import corners_of, depth

CART = Rectangle(0.9, 0.6)
FLEET = [
    {"body": {"shape": "rectangle", "length": 0.9, "width": 0.6}},
    {"kinematics": "unicycle"},
    {"kinematics": "differential", "body": {"shape": "rectangle", "length": 0.8, "width": 0.5}},
    {"kinematics": "bicycle", "body": {"shape": "rectangle", "length": 0.9, "width": 0.5}, "controller": "dwa"},
]


class Restless(s2.Controller):
    """Drives to and fro at random, whatever is in the way."""

    def __init__(self, seed: int = 0) -> None:
        self._seed = seed

    def reset(self, scene: Scene) -> None:
        self._rng = np.random.default_rng([self._seed, scene.robot_id])
        self._twist = Twist()

    def act(self, snapshot: s2.Snapshot) -> Twist:
        if snapshot.tick % 7 == 0:
            self._twist = Twist(*self._rng.uniform(-1.5, 1.5, 3).tolist())
        return self._twist


def crowded(seed: int, *, guard: bool = True, preset: str = "crowded-hall") -> Scene:
    """A preset with a fleet of five robots."""
    rules = {"guard": guard, "time_limit": 30.0, "ends_on": ["time"]}
    settings = s2.load_scenario(preset).changed(robots=FLEET, robot={"jitter": [0.5, 2.5, 0.8]}, rules=rules)
    return s2.generate(settings, seed=seed)


def facing(*robots: Robot, **changes: Any) -> Scene:
    """Robots in an empty room of 12 m, each with a goal at the mirror image of its start."""
    scene, (first, *others) = room(polygon=((-6.0, -6.0), (6.0, -6.0), (6.0, 6.0), (-6.0, 6.0))), robots
    goals = [Goal(-robot.pose.x, -robot.pose.y) for robot in robots]
    more = tuple(OtherRobot(11 + k, robot, goals[1 + k]) for k, robot in enumerate(others))
    return replace(scene, robot=first, goal=goals[0], robots=more, **changes)


def disc(x: float, y: float = 0.0, theta: float = 0.0, **changes: Any) -> Robot:
    return Robot(Pose(x, y, theta), **changes)


def run(scene: Scene, *controllers: s2.Controller, path: Path) -> s2.EpisodeRecord:
    with s2.JsonRecorder(path) as recorder:
        s2.Episode(scene, controllers[0], others=controllers[1:], observers=[recorder]).run()
    return s2.read_episode(path)


@pytest.mark.parametrize("guard", [True, False])
def test_robots_never_overlap_and_contacts_are_those_of_both(guard: bool) -> None:
    contacts = 0
    for seed in range(3):
        scene = crowded(seed, guard=guard, preset="empty")
        episode = s2.Episode(scene, Restless(seed), others=[Restless(seed) for _ in scene.robots])
        for _ in range(250):
            frame = episode.step()
            assert frame is not None
            snapshot = frame.snapshot
            robots = (snapshot.robot, *snapshot.robots)
            outlines = [corners_of(robot.body.outline, robot) for robot in robots]
            assert max(depth(a, b) for a, b in combinations(outlines, 2)) < 1e-3  # discs have 256 corners
            of_each = dict(zip(scene.robot_ids, (snapshot.contacts, *snapshot.contacts_of_robots), strict=True))
            for own, found in of_each.items():
                for contact in (each for each in found if each.kind == "robot"):
                    back = next(c for c in of_each[contact.id] if (c.kind, c.id) == ("robot", own))
                    faults = back.other_at_fault, back.robot_at_fault
                    assert (contact.robot_at_fault, contact.other_at_fault) == faults
                    contacts += 1
    assert contacts > 20


def test_a_robot_that_drives_into_another_is_at_fault_and_does_not_push_it() -> None:
    rules = Rules(guard=False, ends_on=("contact",))
    episode = s2.Episode(facing(disc(-1.0), disc(0.5, theta=1.0), rules=rules), others=[External()])
    while not episode.is_over:
        episode.apply(Twist(vx=0.8), others=[Twist()])
    snapshot = episode.snapshot()
    ((contact,), (back,)) = snapshot.contacts, snapshot.contacts_of_robots[0]
    assert (contact.kind, contact.id, contact.robot_at_fault, contact.other_at_fault) == ("robot", 11, True, False)
    assert (back.kind, back.id, back.robot_at_fault, back.other_at_fault) == ("robot", 0, False, True)
    assert snapshot.robots[0].position == (0.5, 0.0)
    assert 0.6 <= snapshot.robots[0].position[0] - snapshot.robot.position[0] < 0.62
    assert episode.outcome is not None
    assert episode.outcome.reason == "robot 0: contact with robot 11, at fault: the robot"


def test_planners_pass_each_other() -> None:
    scene = facing(disc(-4.0), disc(4.0, 0.1, math.pi), disc(0.2, -4.0, math.pi / 2), disc(0.0, 4.0, -math.pi / 2))
    episode = s2.Episode(scene, s2.SocialPlanner())
    assert {type(driver.controller).__name__ for driver in episode._drivers} == {"SocialPlanner"}
    outcome = episode.run()
    assert outcome.status == "goal"
    assert all(tick is not None and tick <= outcome.tick for tick in outcome.arrivals)
    assert max(outcome.arrivals) == outcome.tick  # type: ignore[type-var]


def test_a_robot_at_its_goal_stands_while_others_go_on() -> None:
    scene = facing(disc(-0.5), disc(-3.0, 2.0))
    episode = s2.Episode(scene, s2.StraightToGoal(), others=[s2.StraightToGoal()])
    outcome = episode.run()
    first, second = outcome.arrivals
    assert first is not None
    assert second is not None
    assert first < second == outcome.tick
    assert all(tick.command == Twist() for tick in episode.past[first:])
    assert episode.past[first - 1].command != Twist()


def test_people_avoid_the_robot_that_is_near_whichever_it_is() -> None:
    """A walker meets the other robot as it would meet the only one."""
    person = walker(1, -3.5, 0.02, behaviour="walking", goals=((3.5, 0.02),))
    alone = replace(room([person]), robot=disc(0.5), goal=Goal(3.0, 3.0))
    other = replace(alone, robot=disc(3.4, -3.4), robots=(OtherRobot(7, disc(0.5), Goal(3.0, 3.0)),))
    paths = []
    for scene in (alone, other):
        episode = s2.Episode(scene, others=[External() for _ in scene.robots])
        paths.append([])
        for _ in range(55):
            episode.apply(Twist(), others=[Twist() for _ in scene.robots])
            paths[-1].append(episode.snapshot().humans.position[0].tolist())
    assert np.allclose(*paths, atol=1e-9)
    assert max(abs(y) for _, y in paths[0]) > 0.3


def test_a_snapshot_is_the_same_from_every_robot() -> None:
    scene = crowded(4)
    episode = s2.Episode(scene, Restless(1), others=[Restless(k) for k, _ in enumerate(scene.robots)])
    for _ in range(20):
        episode.step()
    snapshot = episode.snapshot()
    for k, other in enumerate(scene.robots):
        view = snapshot.seen_by(other.id)
        assert view.scene is scene.seen_by(other.id)
        assert (view.robot, view.goal) == (snapshot.robots[k], other.goal)
        assert {each.id: each for each in view.robots} == {
            each.id: each for each in (snapshot.robot, *snapshot.robots) if each.id != other.id
        }
        assert np.array_equal(view.humans.state, snapshot.humans.state)
        back = view.seen_by(0)
        assert np.array_equal(back.state.row, snapshot.state.row)
        assert back.scene is scene
    with pytest.raises(KeyError, match=r"there is no robot 99; the scene has 0, "):
        snapshot.seen_by(99)


def test_other_robots_are_people_for_controllers_that_know_people() -> None:
    scene = crowded(5)
    snapshot = s2.Episode(scene, others=[External()] * 4).snapshot()
    view = snapshot.with_robots_as_people()
    count = len(scene.humans)
    assert len(view.scene.humans) == count + 4
    assert not view.scene.robots
    assert not view.robots
    people = [human for human in view.humans if human.id in scene.robot_ids]
    assert [human.pose.position for human in people] == [robot.position for robot in snapshot.robots]
    assert [human.radius for human in people] == [other.robot.radius for other in scene.robots]
    alone = room()
    assert alone.with_robots_as_people is alone


class Caller(s2.Controller):
    """One object for all robots: it notes by which it is asked."""

    drives_several = True

    def __init__(self) -> None:
        self._asked: list[int] = []
        self._reset: list[int] = []

    def reset(self, scene: Scene) -> None:
        self._reset.append(scene.robot_id)

    def act(self, snapshot: s2.Snapshot) -> Twist:
        self._asked.append(snapshot.robot.id)
        assert snapshot.robot.id == snapshot.scene.robot_id
        return Twist(vx=0.1)


def test_one_object_may_drive_several_robots() -> None:
    controller = Caller()
    scene = facing(disc(-4.0), disc(4.0), disc(0.0, 4.0))
    episode = s2.Episode(scene, controller, others=[controller, controller])
    episode.step()
    assert (controller._reset, controller._asked) == ([0, 11, 12], [0, 11, 12])


def test_wrong_controllers_are_refused() -> None:
    scene = facing(disc(-4.0), disc(4.0), disc(0.0, 4.0))
    planner = s2.SocialPlanner()
    with pytest.raises(ValueError, match=r"one SocialPlanner cannot drive several robots; give each robot an object"):
        s2.Episode(scene, planner, others=[planner, s2.Orca()])
    with pytest.raises(ValueError, match=r"the scene has 2 other robots, got 1 controller for them"):
        s2.Episode(scene, planner, others=[s2.Orca()])
    with pytest.raises(TypeError, match="pass Orca"):
        s2.Episode(scene, planner, others=[s2.Orca, s2.Orca()])  # type: ignore[list-item]
    episode = s2.Episode(scene, others=[External(), External()])
    with pytest.raises(ValueError, match=r"the scene has 2 other robots, got 1 commands"):
        episode.apply(Twist(), others=[Twist()])
    with pytest.raises(ControllerError, match="finite"):
        episode.apply(Twist(), others=[Twist(), Twist(math.nan)])
    assert episode.observe().tick == 0


def test_an_error_of_another_controller_names_the_robot() -> None:
    class Broken(s2.Controller):
        def act(self, snapshot: s2.Snapshot) -> Twist:
            raise ZeroDivisionError("broken")

    episode = s2.Episode(facing(disc(-4.0), disc(4.0)), s2.StraightToGoal(), others=[Broken()])
    with pytest.raises(ZeroDivisionError) as caught:
        episode.run()
    assert any("by the controller of robot 11" in note for note in caught.value.__notes__)
    assert episode.outcome is not None
    assert episode.outcome.status == "error"


def test_the_number_or_a_list_of_robots_is_a_setting() -> None:
    one, three = s2.load_scenario("sonata-2020"), s2.load_scenario("sonata-2020").changed(robots=3)
    assert "robots" not in one.settings()
    scene, alone = s2.generate(three, seed=2), s2.generate(one, seed=2)
    assert len(scene.robots) == 2
    assert (scene.humans, scene.furniture, scene.robot, scene.goal) == (
        alone.humans, alone.furniture, alone.robot, alone.goal,
    )  # fmt: skip
    ids = [*scene.robot_ids, *(human.id for human in scene.humans), *(piece.id for piece in scene.furniture)]
    assert len(set(ids)) == len(ids)
    assert s2.generate(s2.ScenarioConfig(**three.settings()), seed=2) == scene
    starts = [robot.pose.position for robot, _ in scene.tasks]
    assert min(math.dist(a, b) for a, b in combinations(starts, 2)) > 0.6
    cart = one.changed(robot={"kinematics": "unicycle", "pose": [0, 0, 0]}, robots=2).robots[0]
    assert (cart.kinematics, cart.pose, cart.count) == ("unicycle", None, 1)


@pytest.mark.parametrize(
    ("robots", "message"),
    [
        (0, r"robots: a scene has 1 to 256 robots, got 0"),
        (257, r"robots: a scene has 1 to 256 robots, got 257"),
        ([{"count": 300}], r"robots: a scene has at most 256 robots, got 301"),
        ([{"count": 2, "pose": [0, 0, 0]}], r"robots.0.count: robots with a given pose or goal position are listed"),
        ([{"controler": "orca"}], r"robots.0.controler: unknown key 'controler'; did you mean 'controller'"),
        ([{"controller": "./mine.py"}], r"robots.0.controller: a controller cannot be a file or a class"),
        ([{"pose": [1, 0, 0], "goal": {"position": [1, 0.1]}}], r"robots.0.goal.position: the robot would start on"),
    ],
)
def test_wrong_settings_of_other_robots_are_refused(robots: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        s2.load_scenario("empty").changed(robots=robots)


def test_given_robots_may_not_overlap() -> None:
    robots = [{"pose": [x, 0, 0], "goal": {"position": [0, 2]}} for x in (0.0, 0.5)]
    with pytest.raises(SceneError, match=r"robot 3 would start at \(0.5, 0\) on robot 2; move it"):
        s2.generate(s2.load_scenario("empty").changed(robots=robots), seed=1)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> s2.EpisodeRecord:
    """An episode of a data set in which some of four robots arrive."""
    folder = tmp_path_factory.mktemp("fleet") / "data"
    rules = {"time_limit": 12.0}
    scenario = s2.load_scenario("sonata-2020-crowded").changed(robots=4, rules=rules, flip=1.0)
    s2.generate_dataset(folder, scenario=scenario, controller="social-planner", episodes=1, seed=4, workers=1)
    return s2.read_episode(folder / "000000.json")


def test_files_hold_all_robots(recorded: s2.EpisodeRecord) -> None:
    document, scene = recorded.document, recorded.scene()
    assert document["version"] == 2
    assert [other["id"] for other in document["robots"]] == [other.id for other in scene.robots]
    assert document["robots"][0]["controller"]["path"] == "social-planner"
    assert recorded.robots.shape == (len(recorded), 3, 6)
    assert len(recorded.outcome.arrivals) == 4
    frame = document["frames"][7]
    assert {"robot", "command", "executed", "guarded", "contacts"} <= frame["robots"][1].keys()
    snapshot = recorded.snapshot(7)
    assert [robot.id for robot in snapshot.robots] == [other.id for other in scene.robots]
    assert snapshot.robots[1].position == tuple(frame["robots"][1]["robot"][:2])
    assert recorded.frames().__next__().others[0][0] == Twist(*document["frames"][0]["robots"][0]["command"])


def test_files_are_replayed_and_rerun(recorded: s2.EpisodeRecord) -> None:
    assert verify(recorded.path.parent, replay=True, rerun=True) == []


def test_contacts_between_robots_are_counted_named_and_shown(tmp_path: Path) -> None:
    other = {"pose": [1.0, 0.1, 3.1], "controller": "straight-to-goal", "goal": {"position": [-2.0, 0.1]}}
    scenario = s2.ScenarioConfig(
        humans=0,
        room={"kinds": "square", "side": 6},
        robot={"pose": [-1.0, 0.0, 0.0]},
        goal={"position": [2.0, 0.0]},
        robots=[other],
        rules={"guard": False, "time_limit": 4.0},
    )
    folder = tmp_path / "data"
    s2.generate_dataset(folder, scenario, "straight-to-goal", episodes=1, workers=1)
    assert read_manifest(folder)["files"][0]["contacts"]["robot"]["frames"] > 3
    assert verify(folder, replay=True) == []
    record = s2.read_episode(folder / "000000.json")
    touching = next(snapshot for snapshot in record if snapshot.contacts)
    assert touched_kind(touching) == "robot"
    s2.evaluate({"data": folder}, rerun=False).save(tmp_path / "page.html")
    assert "collision with another robot, caused by the robot" in (tmp_path / "page.html").read_text()


def test_code_that_only_a_file_names_is_not_run(recorded: s2.EpisodeRecord, tmp_path: Path) -> None:
    document = orjson.loads(recorded.path.read_bytes())
    document["robots"][1]["controller"]["path"] = f"{tmp_path / 'evil.py'}:Evil"
    (tmp_path / "evil.py").write_text("raise SystemExit('run')")
    changed = tmp_path / "changed.json"
    changed.write_bytes(orjson.dumps(document))
    with pytest.raises(ControllerError, match=r"code that a file names is not run; .* others="):
        branch(changed, 0, s2.StraightToGoal())
    with pytest.raises(ControllerError, match=r"neither built in nor a plug-in; .* others="):
        s2.Episode(s2.read_episode(changed).scene(), s2.StraightToGoal())
    others = [s2.StraightToGoal() for _ in range(3)]
    assert branch(changed, 2, s2.StraightToGoal(), others=others).past[1].others[0][0] == Twist(
        *document["frames"][1]["robots"][0]["command"]
    )


def test_keys_of_other_robots_do_not_hide_those_of_the_frame(recorded: s2.EpisodeRecord, tmp_path: Path) -> None:
    document = orjson.loads(recorded.path.read_bytes())
    for frame in document["frames"]:
        frame["robots"][0]["humans"] = 3
    changed = tmp_path / "changed.json"
    changed.write_bytes(orjson.dumps(document))
    view = s2.read_episode(changed).seen_by(recorded.robot_ids[1])
    assert view.humans.shape == recorded.humans.shape


def test_clients_without_controllers_give_all_commands() -> None:
    episode = s2.Episode(facing(disc(0.0), disc(3.0)), s2.StraightToGoal(), others=[External()])
    with pytest.raises(ControllerError, match=r"robot 11 has no controller; give its command too"):
        episode.apply(Twist(0.5))
    with pytest.raises(ControllerError, match=r"robot 11: the command must be finite numbers"):
        episode.apply(Twist(0.5), others=[Twist(math.nan)])
    assert not episode.is_over
    assert episode.apply(Twist(0.5), others=[Twist(0.1)]) is not None
    with pytest.raises(ValueError, match=r"give those of the branch too: others="):
        episode.branch(1, s2.StraightToGoal())
    with pytest.raises(TypeError, match=r"others are several controllers"):
        s2.Episode(episode.scene, others=s2.StraightToGoal())  # type: ignore[arg-type]


def test_robots_start_at_the_goals_of_others_and_messages_name_them() -> None:
    body = {"shape": "rectangle", "length": 0.8, "width": 0.4}
    room = {"polygon": [[0, 0], [10, 0], [10, 10], [0, 10]]}
    task: dict[str, Any] = {"robot": {"pose": [1, 5, 0], "body": body}, "goal": {"position": [9, 5]}, "humans": 0}
    other = {"pose": [9, 5, 3.14], "body": body, "goal": {"position": [1, 5]}}
    scene = s2.generate(s2.ScenarioConfig(room=room, robots=[other], **task), seed=1)
    assert scene.robots[0].robot.pose == Pose(9.0, 5.0, 3.14)
    for changes, message in (
        ({"pose": [100, 100, 0]}, r"robot 2's start \(100, 100\) is outside the room"),
        (
            {"pose": None, "goal": {}, "body": None, "radius": 6.0},
            r"no free start and goal for robot 2 .*, or make the robot smaller",
        ),
        ({"pose": [1, 5, 0], "goal": {"position": [5, 9]}}, r"robot 2 would start at \(1, 5\) on robot 1"),
    ):
        with pytest.raises(SceneError, match=message):
            s2.generate(s2.ScenarioConfig(room=room, robots=[other | changes], **task), seed=1)


def test_graphs_have_the_robots_that_a_policy_sees(recorded: s2.EpisodeRecord) -> None:
    graph = modern_graph(recorded, 5, instants=1)
    people = graph.entity[graph.node_type == NODE_TYPES.index("human")]
    assert {robot.id for robot in recorded.scene().robots} <= set(people.tolist())
    assert len(people) == int(recorded.states.present[5].sum()) + 3
    arrival = recorded.outcome.arrivals[0]
    samples = [*s2.learning.GraphSamples(every=0.1)(recorded)]
    assert len(samples) <= (len(recorded) if arrival is None else arrival)


def test_the_mirror_image_of_the_mirror_image_is_the_episode(recorded: s2.EpisodeRecord) -> None:
    image = mirrored(recorded)
    assert image.robots[3, 1, 1] == -recorded.robots[3, 1, 1]
    assert image.scene().robots[2].goal.y == -recorded.scene().robots[2].goal.y
    assert mirrored(image).document == recorded.document


def test_a_branch_of_a_recorded_episode_goes_on_with_all_robots(recorded: s2.EpisodeRecord) -> None:
    episode = branch(recorded.path, 30, s2.SocialPlanner())
    start = episode.snapshot().robots
    assert np.allclose([robot.position for robot in start], recorded.states.robots[30, :, :2], atol=1e-4)
    for _ in range(30):
        episode.step()
    moved = [math.dist(a.position, b.position) for a, b in zip(start, episode.snapshot().robots, strict=True)]
    assert max(moved) > 0.5


def test_other_robots_of_a_branch_remember_what_they_saw(recorded: s2.EpisodeRecord, tmp_path: Path) -> None:
    with s2.JsonRecorder(tmp_path / "episode.json") as recorder:
        s2.Episode(recorded.scene(), s2.StraightToGoal(), observers=[recorder]).run()
    record = s2.read_episode(tmp_path / "episode.json")
    again = s2.EpisodeRecorder()
    branch(record.path, 30, s2.StraightToGoal(), observers=[again]).run()
    assert again.record().document["frames"] == record.document["frames"]
    commands = [frame.command for frame in record.frames()]
    past = [TickInput(command) for command in commands[:40]]  # without the commands of others: they are asked
    episode = s2.Episode(recorded.scene(), s2.StraightToGoal(), past=past, observers=[whole := s2.EpisodeRecorder()])
    episode.run()
    assert whole.record().document["frames"] == record.document["frames"]


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda d: d["frames"][3]["robots"].pop(), r"frames.3.robots: 2 of 3 other robots"),
        (lambda d: d["robots"][0].update(id=0), r"ids: id 0 is used 2 times"),
        (lambda d: d["outcome"]["arrivals"].pop(), r"outcome.arrivals: must be a tick or null for each of 4 robots"),
        (lambda d: d["frames"][3]["robots"][0]["contacts"].append(
            {"kind": "robot", "id": 99, "robot_at_fault": True, "other_at_fault": True}
        ), r"frames.3.contacts: there is no robot 99"),
        (lambda d: d["frames"][3]["robots"][0].pop("command"), r"frames.3.robots.0.command: is missing"),
    ],
)  # fmt: skip
def test_damaged_files_are_refused(recorded: s2.EpisodeRecord, tmp_path: Path, edit: Any, message: str) -> None:
    document = orjson.loads(recorded.path.read_bytes())
    edit(document)
    (tmp_path / "bad.json").write_bytes(orjson.dumps(document))
    with pytest.raises(s2.errors.InvalidFileError, match=message):
        s2.read_episode(tmp_path / "bad.json")


def test_implausible_values_of_other_robots_are_found(recorded: s2.EpisodeRecord, tmp_path: Path) -> None:
    document = orjson.loads(recorded.path.read_bytes())
    document["frames"][40]["robots"][1]["robot"][0] += 3.0
    document["frames"][50]["robots"][0]["robot"][:2] = document["frames"][50]["robots"][2]["robot"][:2]
    (tmp_path / "000000.json").write_bytes(orjson.dumps(document))
    found = [problem.message for problem in verify(tmp_path / "000000.json")]
    ids = recorded.robot_ids
    assert any(message.startswith(f"robot {ids[2]} is") for message in found)
    assert any(f"robot {ids[1]} is" in message and f"too deep in robot {ids[3]}" in message for message in found)


def test_metrics_are_of_each_robot_and_together(recorded: s2.EpisodeRecord) -> None:
    (measured,) = measure_files([recorded.path], rerun=False)
    assert list(measured.robots) == list(recorded.robot_ids)
    for k, robot_id in enumerate(recorded.robot_ids):
        own, arrival = measured.robots[robot_id], recorded.outcome.arrivals[k]
        assert own == measure(recorded.seen_by(robot_id), rerun=False)
        assert own["success"] == float(arrival is not None)
        assert own["time_to_goal"] == (None if arrival is None else pytest.approx(arrival * 0.1))
    each = [values["path_length"] for values in measured.robots.values()]
    assert measured.values["path_length"] == pytest.approx(np.mean(each))  # type: ignore[arg-type]
    assert measured.values["success"] == min(values["success"] for values in measured.robots.values())  # type: ignore[type-var]


def test_clearance_between_robots_is_that_of_separate_code(tmp_path: Path) -> None:
    scene = facing(disc(-2.0, 0.1), disc(2.0, theta=2.0, shape=CART), rules=Rules(time_limit=4.0))
    record = run(scene, s2.StraightToGoal(), Restless(3), path=tmp_path / "two.json")
    gaps = []
    for snapshot in record.snapshots():
        first, second = [np.array(snapshot.robot.position)], corners_of(CART, snapshot.robots[0])
        lines = zip(second, np.roll(second, -1, axis=0), strict=True)
        gaps.append(min(_distance(first[0], a, b) - 0.3 for a, b in lines))
    assert measure(record, rerun=False)["robot_clearance_min"] == pytest.approx(min(gaps), abs=1e-3)


def _distance(point: Any, a: Any, b: Any) -> float:
    t = np.clip(np.dot(point - a, b - a) / np.dot(b - a, b - a), 0.0, 1.0)
    return float(np.linalg.norm(a + t * (b - a) - point))


def test_makespan_is_the_last_arrival(tmp_path: Path) -> None:
    scene = facing(disc(-1.0, 2.0), disc(-3.0, -2.0))
    record = run(scene, s2.StraightToGoal(), s2.StraightToGoal(), path=tmp_path / "two.json")
    assert measure(record, rerun=False)["makespan"] == pytest.approx(record.outcome.tick * 0.1)
    assert measure(record, rerun=False)["robot_collisions"] == 0.0


@pytest.mark.parametrize("format", ["socnav3", "sonata"])
def test_exports_take_the_chosen_robot_and_the_others_as_people_or_objects(
    recorded: s2.EpisodeRecord, tmp_path: Path, format: str
) -> None:
    chosen, count = recorded.robot_ids[2], len(recorded.scene().humans)

    def first_step(name: str, **options: Any) -> Any:
        out, types = tmp_path / f"{name}.json", {"types": {"robot": "shelf"}} if format == "socnav3" else {}
        assert export_to(recorded.path, format, out, Options(**types, **options)).files == [out]
        steps = orjson.loads(out.read_bytes())
        return (steps["sequence"] if format == "socnav3" else steps)[0]

    step = first_step("people", robot=2)
    things = len(step["objects"])
    assert len(step["people"]) == count + 3
    step = first_step("objects", robot=2, robots_as="objects")
    assert (len(step["people"]), len(step["objects"])) == (count, things + 3)
    if format == "socnav3":
        assert [step["robot"][key] for key in ("x", "y")] == recorded.seen_by(chosen).robot[0, :2].tolist()
        (back,) = import_from(tmp_path / "people.json", "socnav3", tmp_path / "back").files
        assert s2.read_episode(back).document["imported"]["format"] == "socnav3"  # it is no episode of the simulator
        (refused,) = import_from(tmp_path / "objects.json", "socnav3", tmp_path / "none").refused
        assert "has moved" in refused.reason  # objects of an episode stand still
    with pytest.raises(ValueError, match="robots_as must be people or objects, got 'object'"):
        Options(robots_as="object")  # type: ignore[arg-type]
    result = export_to(recorded.path, format, tmp_path / "none.json", Options(robot=4))
    assert "there is no robot 4; it has 0 to 3" in result.skipped[0].reason


def test_lidar_sees_the_outlines_of_other_robots() -> None:
    """Ranges by another formula: of rays to a disc ahead, and to the sides of a rectangle to the left."""

    class Scanner(External):
        sensors = (Lidar(rays=4, distance=10.0),)  # behind, right, ahead, left

    scene = facing(disc(0.0), disc(3.0), disc(0.0, 2.5, math.pi / 2, shape=CART))
    episode = s2.Episode(scene, Scanner(), others=[External(), External()])
    snapshot = episode.snapshot()
    reading = episode._drivers[0].sensors.observe(snapshot).lidar
    assert reading.ranges.tolist() == pytest.approx([6.0, 6.0, 2.7, 2.5 - 0.45])


def test_a_field_of_view_shows_robots_that_nothing_hides() -> None:
    class Looking(External):
        sensors = (FieldOfView(angle=math.pi / 2), FieldOfView("through", angle=math.pi / 2, occlusion=False))

    scene = facing(disc(-2.0), disc(1.0), disc(3.0, 0.5), disc(-3.0))
    wall = Wall((2.0, -1.0), (2.0, 1.0))
    for walls, seen in (((), [0, 1]), ((wall,), [0])):
        scene = replace(scene, walls=(*scene.walls, *walls))
        episode = s2.Episode(scene, Looking(), others=[External()] * 3)
        sensors = episode._drivers[0].sensors.observe(episode.snapshot())
        assert [robot.id for robot in sensors.field_of_view.robots] == [scene.robots[k].id for k in seen]
        assert [robot.id for robot in sensors.through.robots] == [scene.robots[k].id for k in (0, 1)]


def test_pictures_show_all_robots(recorded: s2.EpisodeRecord) -> None:
    from sonata2d.core.devices import ImageRequest
    from sonata2d.view import image_of
    from sonata2d.view.palette import OTHER_ROBOT

    shown = image_of(recorded.snapshot(0), ImageRequest(width=400, height=400, view="top"))
    assert (np.abs(shown.astype(int) - OTHER_ROBOT) <= 2).all(axis=-1).sum() > 300
