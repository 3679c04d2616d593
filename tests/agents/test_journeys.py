"""Pedestrians pause, sit, queue, enter and leave through doors, and go to places of interest."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import sonata2d as s2
from sonata2d.agents.pedestrians.routes import ARRIVAL_DISTANCE
from sonata2d.core.entities import Door, Furniture, Group, Human, Interaction, Place, Queue
from sonata2d.core.geometry import Disc, Pose, Rectangle
from sonata2d.core.relations import WALKING_TOGETHER
from sonata2d.core.scene import Rules, Scene, Social
from sonata2d.core.snapshot import Snapshot
from sonata2d.datasets import verify
from sonata2d.datasets.check.replay import check_replay, check_rerun
from sonata2d.record.reader import read_episode
from sonata2d.record.recorder import JsonRecorder

from ..conftest import room, walker
from .test_crowd import positions, simulate

CORNER = Pose(-3.5, -3.5)
CHAIR = Furniture(20, "chair", Pose(0.0, 2.0, -math.pi / 2), Rectangle(0.45, 0.45))
QUEUE = Queue(1, Pose(0.0, 3.0, math.pi / 2), service=(6.0, 6.0), capacity=4)
LEFT_DOOR, RIGHT_DOOR = Door(1, Pose(-4.0, 0.0, 0.0)), Door(2, Pose(4.0, 0.0, math.pi))


def waiting(count: int) -> list[Human]:
    """Pedestrians that stand in QUEUE, the first one first."""
    return [walker(k + 1, *QUEUE.slot(k), math.pi / 2, queue=1) for k in range(count)]


def activity(snapshot: Snapshot, id: int) -> str | None:
    """What a pedestrian does; None: it is absent."""
    return next((human.activity for human in snapshot.humans if human.id == id), None)


def steps_of(scene: Scene, seconds: float) -> list[Snapshot]:
    """The snapshots of an episode in which the robot stands."""
    return simulate(replace(scene, rules=replace(scene.rules, time_limit=seconds, ends_on=("time",))), seconds)


# Queues


def test_who_was_served_does_not_queue_again_at_once() -> None:
    run = simulate(room(waiting(1), queues=[QUEUE], robot=CORNER, social=Social(queues=1.0)), 60.0)
    queues = [activity(snapshot, 1) == "queueing" for snapshot in run]
    assert queues[0]
    assert not any(queues[queues.index(False) :])


def test_a_queue_serves_in_order_and_moves_up_one_after_the_other() -> None:
    run = simulate(room(waiting(4), queues=[QUEUE], robot=CORNER), 40.0)
    assert [activity(run[0], k) for k in (1, 2, 3, 4)] == ["queueing"] * 4
    ends = [next(s.tick for s in run if activity(s, k) != "queueing") for k in (1, 2, 3, 4)]
    assert ends[0] == pytest.approx(60, abs=2)
    assert all(later - sooner > 60 for sooner, later in pairwise(ends))  # the next one must walk to the head
    moves = [next(s.tick for s in run if s.humans[k].pose.y > QUEUE.slot(k)[1] + 0.2) for k in (1, 2, 3)]
    assert moves == sorted(moves)
    assert moves[0] > ends[0]
    assert [run[ends[0] + 55].humans[k].pose.y for k in (1, 2, 3)] == pytest.approx([3.0, 2.25, 1.5], abs=0.1)
    for snapshot in run:
        queued = [human.pose.y for human in snapshot.humans if human.activity == "queueing"]
        assert queued == sorted(queued, reverse=True)  # nobody passes another one
        assert all(a - b > 0.4 for a, b in pairwise(queued))


def test_newcomers_join_at_the_end_and_a_full_queue_is_left_alone() -> None:
    people = [*waiting(2), *(walker(k, -3.0 + k, -3.0) for k in range(3, 8))]
    endless = replace(QUEUE, service=(500.0, 500.0))
    run = simulate(room(people, queues=[endless], social=Social(queues=1.0), robot=CORNER, seed=3), 60.0)
    lengths = [sum(human.activity == "queueing" for human in snapshot.humans) for snapshot in run]
    assert lengths == sorted(lengths)
    assert lengths[-1] == 4
    places = sorted((h.pose.position for h in run[-1].humans if h.activity == "queueing"), key=lambda p: -p[1])
    for number, place in enumerate(places):
        assert math.dist(place, QUEUE.slot(number)) < 0.1
    assert all(human.activity == "queueing" for human in run[-1].humans if human.id < 3)


def test_who_was_served_does_something_else_next() -> None:
    run = simulate(room(waiting(1), queues=[QUEUE], social=Social(queues=1.0), robot=CORNER), 15.0)
    left = next(s.tick for s in run if activity(s, 1) == "walking")
    assert max(math.dist(s.humans[0].pose.position, QUEUE.slot(0)) for s in run[left:]) > 1.4


# Seats


def test_a_seat_holds_one_person_who_faces_its_front_and_gets_up_again() -> None:
    people = [walker(k, 1.5 * k - 4.0, -2.0) for k in (1, 2, 3)]
    scene = room(people, [CHAIR], social=Social(sits=1.0, sit_time=(6.0, 6.0)), robot=CORNER, seed=1)
    run = simulate(scene, 60.0)
    sitters = [[human for human in snapshot.humans if human.activity == "sitting"] for snapshot in run]
    assert max(len(sitting) for sitting in sitters) == 1
    rests = [k for k, sitting in enumerate(sitters) if sitting]
    assert len({sitters[k][0].id for k in rests}) > 1
    middle = next(k for k in rests if sitters[k - 30] == [] and k > 30) + 40
    human = sitters[middle][0]
    assert human.pose.position == pytest.approx((0.0, 2.0), abs=0.03)
    assert human.pose.theta == pytest.approx(-math.pi / 2, abs=0.1)
    for snapshot, sitting in zip(run, sitters, strict=True):
        others = [h for h in snapshot.humans if h.activity != "sitting"]
        gaps = scene.barriers.gaps(np.array([h.pose.position for h in others])).min(axis=0)
        assert gaps.min() > 0.2 - 0.02  # the chair is solid for all but the one on it
        assert len(sitting) < 2
    assert any(activity(s, human.id) == "walking" for s in run[middle:])


def test_a_person_turns_its_back_to_the_seat_before_it_sits_down() -> None:
    scene = room([walker(1, 0.0, -1.5, math.pi / 2)], [CHAIR], social=Social(sits=1.0), robot=CORNER, seed=4)
    run = simulate(scene, 40.0)
    start = next(s.tick for s in run if activity(s, 1) == "sitting")
    human = run[start].humans[0]
    assert human.pose.y == pytest.approx(2.0 - 0.225 - 0.35, abs=0.12)  # in front of the chair
    assert math.cos(human.pose.theta + math.pi / 2) > 0.9


def test_a_person_that_sits_at_the_start_stays_on_its_seat_and_then_goes() -> None:
    sitter = walker(1, 0.0, 2.0, -math.pi / 2, seat=20)
    run = simulate(room([sitter], [CHAIR], social=Social(sit_time=(10.0, 10.0)), robot=CORNER, seed=4), 20.0)
    assert activity(run[0], 1) == "sitting"
    end = next(s.tick for s in run if activity(s, 1) != "sitting")
    assert 30 < end < 130
    still = positions(run[: end - 25])[:, 0]
    assert still == pytest.approx(np.tile((0.0, 2.0), (len(still), 1)), abs=0.01)
    assert min(s.humans[0].pose.y for s in run[end:]) < 1.5


def test_a_chair_at_a_table_is_used_from_its_side() -> None:
    table = Furniture(21, "table", Pose(0.0, 1.35), Rectangle(0.8, 0.8))
    scene = room([walker(1, -2.0, -1.0)], [CHAIR, table], social=Social(sits=1.0), robot=CORNER, seed=2)
    run = simulate(scene, 60.0)
    start = next(s.tick for s in run if activity(s, 1) == "sitting")
    assert run[start].humans[0].pose.y == pytest.approx(2.0, abs=0.15)
    assert abs(run[start].humans[0].pose.x) > 0.4


# Doors


def test_people_leave_through_doors_and_are_in_no_later_frame() -> None:
    people = [walker(k, 0.4 * k, -2.0 + 0.9 * k) for k in range(1, 6)]
    scene = room(people, doors=[LEFT_DOOR, RIGHT_DOOR], social=Social(exits=1.0), robot=CORNER, seed=2)
    run = simulate(scene, 40.0)
    assert len(run[-1].humans) == 0
    for id in range(1, 6):
        present = [id in snapshot.humans.id for snapshot in run]
        assert present == sorted(present, reverse=True)
        last = next(h for h in run[present.index(False) - 1].humans if h.id == id)
        assert min(math.dist(last.pose.position, d.pose.position) for d in scene.doors) < 0.75
        assert 4.0 - abs(last.pose.x) < 0.6
        assert abs(last.pose.y) < 0.5
        assert math.hypot(*last.velocity) > 0.5  # they do not stop at the door


def test_people_do_not_leave_through_the_door_by_which_they_came_and_choose_by_share() -> None:
    entering = [walker(k, 3.65, 0.0, math.pi, enters=60 * k, velocity=(-1.3, 0.0)) for k in range(1, 5)]
    closed = replace(LEFT_DOOR, id=3, pose=Pose(0.0, -4.0, math.pi / 2), share=0.0)
    doors = [LEFT_DOOR, RIGHT_DOOR, closed]
    run = simulate(room(entering, doors=doors, social=Social(exits=1.0), robot=CORNER), 40.0)
    assert len(run[-1].humans) == 0
    for id in range(1, 5):
        last = [human for snapshot in run for human in snapshot.humans if human.id == id][-1]
        assert last.pose.x < -3.3


def pair(**fields: object) -> tuple[list[Human], dict[str, object]]:
    """Two members of a walking group, and the fields of their scene."""
    people = [walker(k, 3.6, 0.3 * (2 * k - 3), math.pi, group=1, **fields) for k in (1, 2)]
    return people, {"groups": (Group(1, "walking", (1, 2)),), "interactions": (Interaction(1, WALKING_TOGETHER, 2),)}


def test_a_group_enters_walks_and_leaves_together() -> None:
    people, fields = pair(enters=20, velocity=(-1.2, 0.0))
    scene = room(people, doors=[LEFT_DOOR, RIGHT_DOOR], social=Social(exits=1.0), robot=CORNER, **fields)
    run = simulate(scene, 30.0)
    present = [tuple(snapshot.humans.id.tolist()) for snapshot in run]
    both = [t for t, ids in enumerate(present) if ids == (1, 2)]
    assert both[0] == 20
    assert set(present[:20]) == {()}
    assert len(present) - 1 > present.index((), both[0]) - both[-1] < 20  # the second one leaves within two seconds
    gaps = [math.dist(*run[t].humans.position) for t in both[30:]]
    assert np.median(gaps) < 1.3


def test_a_group_enters_only_when_there_is_room_for_all() -> None:
    people, fields = pair(enters=5)
    blocker = Human(9, Pose(3.6, 0.35), 0.2, leaves=60)
    run = simulate(room([*people, blocker], robot=CORNER, **fields), 8.0)
    assert [snapshot.humans.id.tolist() for snapshot in run[:60]] == [[9]] * 60
    assert run[65].humans.id.tolist() == [1, 2]


# Pauses and places


@pytest.mark.usefixtures("motionless", "no_deviations")
def test_wandering_people_stand_at_their_destinations_and_then_go_on() -> None:
    scene = room([walker(1, 0.0, 0.0), walker(2, 2.0, 2.0)], social=Social(pause=(3.0, 5.0)), robot=CORNER, seed=1)
    run = simulate(scene, 60.0)
    for id in (1, 2):
        kinds = [activity(snapshot, id) for snapshot in run]
        runs = np.split(np.arange(len(kinds)), [t for t in range(1, len(kinds)) if kinds[t] != kinds[t - 1]])
        pauses = [part for part in runs[1:-1] if kinds[part[0]] == "standing"]
        assert len(pauses) > 2
        assert all(28 <= len(part) <= 52 for part in pauses)
        for part in pauses:
            path = np.array([run[t].humans[id - 1].pose.position for t in part])
            assert np.ptp(path[15:], axis=0).max() < 0.15


@pytest.mark.usefixtures("motionless")
def test_a_walking_person_stays_at_its_goals_for_a_time_and_at_the_last_for_good() -> None:
    human = walker(1, -3.0, 0.0, behaviour="walking", goals=((0.0, 0.0), (3.0, 0.0)), stays=(4.0,))
    run = simulate(room([human], robot=CORNER), 15.0)
    kinds = [activity(s, 1) for s in run]
    changes = [t for t in range(1, len(run)) if kinds[t] != kinds[t - 1]]
    assert [kinds[t] for t in (0, *changes)] == ["walking", "standing", "walking", "standing"]
    assert changes[1] - changes[0] == pytest.approx(40, abs=1)
    assert run[changes[1]].humans[0].pose.position == pytest.approx((0.0, 0.0), abs=0.3)
    assert run[-1].humans[0].pose.position == pytest.approx((3.0, 0.0), abs=0.3)


def test_a_group_pauses_together_side_by_side() -> None:
    people, fields = pair()
    run = simulate(room(people, social=Social(pause=(4.0, 4.0)), robot=CORNER, seed=2, **fields), 40.0)
    both = [s for s in run if {activity(s, 1), activity(s, 2)} == {"standing"}]
    assert len(both) > 60
    for snapshot in both[::10]:
        assert math.dist(*snapshot.humans.position) < 1.25
    assert all(s.interactions == run[0].interactions for s in run)  # they stay a group


def test_followers_reach_their_leader_when_it_pauses() -> None:
    config = s2.load_scenario("crowded-hall")
    config = config.model_copy(update={"rules": replace(config.rules, ends_on=("time",))})
    distances = []
    for scene in (s2.generate(config, seed, 0) for seed in (2, 3, 4, 5)):
        groups = [group.members for group in scene.groups if group.kind == "walking"]
        assert groups
        since: dict[int, int] = {}
        for snapshot in steps_of(scene, 40.0):
            human = {h.id: h for h in snapshot.humans}
            for leader, *followers in groups:
                rests = leader in human and human[leader].activity == "standing"
                since[leader] = since.get(leader, 0) + 1 if rests else 0
                if since[leader] == 45:
                    first = human[leader].pose.position
                    distances += [math.dist(human[k].pose.position, first) for k in followers if k in human]
    assert len(distances) > 5
    assert max(distances) < 1.3


def test_people_go_to_places_of_interest_and_stay_there() -> None:
    places = [Place(1, -2.5, 2.5, 0.5, stay=(2.0, 2.0)), Place(2, 2.5, -2.5, 0.5, stay=(2.0, 2.0))]
    run = simulate(room([walker(1, 0.0, 0.0), walker(2, 1.0, 0.0)], places=places, robot=CORNER, seed=1), 60.0)
    rests = [
        h.pose.position for s in run for h in s.humans if h.activity == "standing" and math.hypot(*h.velocity) < 0.1
    ]
    assert len(rests) > 60
    distances = np.array([[math.dist(rest, place.position) for place in places] for rest in rests])
    assert distances.min(axis=1).max() < 0.5 + ARRIVAL_DISTANCE
    assert set(distances.argmin(axis=1).tolist()) == {0, 1}


# All together


def busy_config(**changes: object) -> s2.ScenarioConfig:
    settings: dict[str, object] = {
        "room": {"kinds": "rectangle", "breadth": 7, "length": 9}, "standing": 1, "wandering": 2, "tables": 0,
        "plants": 1, "relations": 0, "chairs": 3, "seated": 1, "walking_pairs": 1,
        "doors": [{"inflow": 8, "pairs": 0.4}, {"inflow": 4}], "places": [{"x": 0, "y": 0}],
        "queues": [{"x": 3, "y": 2.8, "theta": 1.5708, "waiting": 2, "service": [2, 4]}],
        "social": {"exits": 0.25, "queues": 0.25, "sits": 0.25, "visits": 0.1, "sit_time": [3, 6], "pause": [0, 2]},
        "rules": {"time_limit": 30, "ends_on": ["time"]},
    }  # fmt: skip
    return s2.ScenarioConfig(**{**settings, **changes})  # type: ignore[arg-type]


def record_busy_episode(file: str) -> None:
    """Record an episode in which everything of this module happens."""
    with JsonRecorder(file) as recorder:
        s2.Episode(s2.generate(busy_config(), 5), s2.StraightToGoal(), observers=[recorder]).run()


def test_an_episode_with_everything_is_plausible_and_is_replayed_to_the_byte(tmp_path: Path) -> None:
    path = tmp_path / "busy.json"
    record_busy_episode(str(path))
    assert [problem for problem in verify(path) if problem] == []
    assert check_replay(read_episode(path)) == []
    assert check_rerun(read_episode(path)) == []
    activities = set(read_episode(path).states.activity.ravel().tolist())
    assert {-1, 0, 1, 6, 7} <= activities


def test_the_interpreter_gives_the_bytes_of_compiled_code(tmp_path: Path) -> None:
    record_busy_episode(str(tmp_path / "compiled.json"))
    code = "import sys; from tests.agents.test_journeys import record_busy_episode as run; run(sys.argv[1])"
    command = [sys.executable, "-W", "error", "-c", code, str(tmp_path / "interpreted.json")]
    subprocess.run(command, cwd=Path(__file__).parents[2], env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, check=True)
    first, second = ((tmp_path / f"{name}.json").read_text().split("\n") for name in ("compiled", "interpreted"))
    assert first[1:] == [line.replace('"interpreted"', '"compiled"') for line in second][1:]


def test_a_mirrored_queue_and_seat_give_mirrored_motion() -> None:
    sitter = walker(9, 2.0, 0.5, 0.3, seat=20)
    chair = Furniture(20, "chair", Pose(2.0, 0.5, 0.3), Rectangle(0.45, 0.45))
    queue = Queue(1, Pose(-1.0, 2.0, 0.8), service=(1.0, 1.0))
    stands = [walker(k + 1, *queue.slot(k), 0.8, queue=1, goals=()) for k in range(3)]
    plant = Furniture(21, "plant", Pose(2.62, 0.69), Disc(0.2))  # in front of the chair: it is left to the side
    away = Place(1, 1.0, 3.0, 1e-12, stay=(0.0, 0.0))  # the destination of all, which is mirrored too
    social, fields = Social(sit_time=(1.0, 1.0)), {"queues": [queue], "places": [away], "robot": CORNER}
    scene = room([*stands, sitter], [chair, plant], social=social, **fields)  # type: ignore[arg-type]

    def pose(p: Pose) -> Pose:
        return Pose(p.x, 0.0 - p.y, 0.0 - p.theta)

    image = replace(
        scene,
        humans=tuple(replace(human, pose=pose(human.pose)) for human in scene.humans),
        furniture=tuple(replace(piece, pose=pose(piece.pose)) for piece in scene.furniture),
        queues=(replace(queue, pose=pose(queue.pose)),),
        places=(replace(away, y=-away.y),),
        robot=replace(scene.robot, pose=pose(scene.robot.pose)),
        rules=Rules(side=-1),
    )
    moved = False
    for a, b in zip(simulate(scene, 4.0), simulate(image, 4.0), strict=True):
        assert (a.humans.activity_index == b.humans.activity_index).all()
        assert b.humans.position * (1, -1) == pytest.approx(a.humans.position, abs=1e-9)
        moved = moved or math.dist(a.humans.position[1], queue.slot(0)) < 0.3
    assert moved
