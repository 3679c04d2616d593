"""Each limit of `check` on the numbers of an episode: a value at the limit is accepted, a larger one is found."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sonata2d.core.entities import Furniture, Human, Limits
from sonata2d.core.geometry import Disc, Pose, Rectangle
from sonata2d.core.relations import ACTIVITIES
from sonata2d.core.scene import Rules, Scene
from sonata2d.core.turning import BODY_TURN
from sonata2d.datasets import verify
from sonata2d.record.recorder import JsonRecorder

from ..record.samples import run, scene

Edit = Callable[[Any], None]
FIRST = Human(1, Pose(2.0, 2.0, 1.5708), 0.2)  # half a shoulder line of 0.025 m, along x; at 1.3 m/s by default
TOP_SPEED = math.hypot(0.8, 0.5)  # m/s, of the robot


def sample(human: Human = FIRST, *, limits: Limits | None = None, **rules: Any) -> Scene:
    """The scene of all edits: pedestrian 1 stands, the robot moves along x from (-1, 0) at 0.5 m/s; 0.1 s a tick."""
    of = scene()
    robot = replace(of.robot, limits=limits or of.robot.limits)
    return replace(
        of, humans=(human, *of.humans[1:]), robot=robot, rules=replace(Rules(time_limit=20.0, substeps=10), **rules)
    )


def put(*path: Any) -> Edit:
    """Set the value at some keys of a document; the last item is the value."""
    *keys, last, value = path

    def edit(document: Any) -> None:
        for key in keys:
            document = document[key]
        document[last] = value

    return edit


def everywhere(*path: Any) -> Edit:
    """Set a value in all frames and in the final state."""

    def edit(document: Any) -> None:
        for state in [*document["frames"], document["final"]]:
            put(*deepcopy(path))(state)

    return edit


def later(*path: Any) -> Edit:
    """Set a value in all states from tick 3 on."""
    return both(*(put("frames", k, *path) for k in (3, 4, 5)), put("final", *path))


def both(*edits: Edit) -> Edit:
    """Several edits of one document."""

    def edit(document: Any) -> None:
        for one in edits:
            one(document)

    return edit


def findings(folder: Path, of: Scene, *edits: Edit) -> str:
    """What `check` says of an episode after some edits."""
    path = folder / "edited.json"
    with JsonRecorder(path) as recorder:
        run(recorder, of)
    document = json.loads(path.read_bytes())
    for edit in edits:
        edit(document)
    path.write_text(json.dumps(document))
    return "\n".join(map(str, verify(path)))


def assert_limit(folder: Path, of: Scene, edit: Callable[[Any], Edit], accepted: Any, found: Any, message: str) -> None:
    """A value is accepted, another one is found."""
    text = message.split(" is ")[-1].split(" ", 1)[-1]  # without subject and number
    assert text not in findings(folder, of, edit(accepted))
    assert message in findings(folder, of, edit(found))


STRONG = Limits(ahead=0.8, turn=20.0, acceleration=10.1)
AT_REST = {
    "default": (sample(), 2.69),  # 1.3 times 1.3 m/s, and 1 m/s of a push
    "dt of 1 s": (sample(dt=1.0), 1.69 * 3),  # it can be turned round within the tick
    "dt of 0.2 s": (sample(dt=0.2), 1.69 * 1.8),
    "dt of 0.01 s": (sample(replace(FIRST, velocity=(4.0, 0.0)), dt=0.01), 4.0 * 1.5),
    "without guard": (sample(guard=False), 2.69 + TOP_SPEED),
    "start": (sample(replace(FIRST, velocity=(1.8, 2.4))), 3.0 * 1.5),
    "slow": (sample(replace(FIRST, desired_speed=0.5)), 0.65 + 1.0),
}


@pytest.mark.parametrize("name", AT_REST)
def test_speed_of_a_pedestrian(tmp_path: Path, name: str) -> None:
    of, limit = AT_REST[name]
    assert_limit(
        tmp_path,
        of,
        lambda speed: put("frames", 3, "humans", 0, 4, speed),
        math.floor(limit * 1e4) / 1e4,
        round(limit + 0.002, 4),
        "frames.3.humans: human 1 is 0.002 m/s faster than possible",
    )


def _overlap(of: Scene) -> float:
    """Depth to which outlines may overlap where a substep is long, m."""
    substep = of.rules.dt / of.rules.substeps
    overlap = 2.0 * (1.69 + BODY_TURN * 0.025) * substep
    return overlap if of.rules.guard else overlap + _TURNED + 2.0 * TOP_SPEED * substep


_TURNED = BODY_TURN * 0.1 * 0.025  # m, what a torso turns in a tick of 0.1 s
COARSE, RAMMED = sample(substeps=3), sample(substeps=4, guard=False)
MOTION = {
    "default": (sample(), 2.69 / 2 + 0.5),
    "dt of 0.03 s": (sample(dt=0.03), 2.69 / 2 + 0.05 / 0.03),
    "coarse": (COARSE, 2.69 / 2 + 0.5 + 2.0 * _overlap(COARSE) / 0.1),
    "without guard": (
        RAMMED,
        (2.69 + TOP_SPEED) / 2 + 0.5 + 2.0 * _overlap(RAMMED) / 0.1,
    ),
}


@pytest.mark.parametrize("name", MOTION)
def test_motion_of_a_pedestrian(tmp_path: Path, name: str) -> None:
    of, limit = MOTION[name]
    step = limit * of.rules.dt
    assert_limit(
        tmp_path,
        of,
        lambda distance: put("frames", 3, "humans", 0, 1, 2.0 + distance),
        math.floor(step * 1e4) / 1e4,
        math.ceil(step * 1e4 + 1.0) / 1e4,
        "m/s of motion beyond what the velocities explain",
    )
    edit = put("frames", 3, "humans", 0, 1, 2.0 + math.ceil(step * 1e4 + 1.0) / 1e4)
    assert "frames.2.humans: human 1 is " in findings(tmp_path, of, edit)


def test_velocities_explain_motion(tmp_path: Path) -> None:
    """The mean of the velocities before and after a tick, which is 1 m/s here, explains 0.1 m of 0.2845."""
    moving = both(*(put("frames", k, "humans", 0, 4, 1.0) for k in (2, 3)))
    assert_limit(
        tmp_path,
        sample(),
        lambda y: both(moving, later("humans", 0, 1, y)),
        2.2844,
        2.2847,
        "frames.2.humans: human 1 is 0.002 m/s of motion beyond what the velocities explain",
    )


def test_speed_and_turn_rate_of_the_drive(tmp_path: Path) -> None:
    assert_limit(
        tmp_path, sample(), lambda v: put("frames", 3, "executed", [v, 0.0, 0.0]), 0.9933, 0.9954,
        "frames.3.executed: the robot's drive is 0.002 m/s faster than its limits",
    )  # fmt: skip
    assert_limit(
        tmp_path, sample(), lambda v: put("frames", 3, "executed", [0.5, 0.0, -v]), 1.5002, 1.5022,
        "frames.3.executed: the robot's drive is 0.002 rad/s of turning beyond its limits",
    )  # fmt: skip


def test_speed_of_the_robot(tmp_path: Path) -> None:
    assert_limit(
        tmp_path, sample(), lambda v: put("frames", 3, "robot", 4, v), 0.8583, 0.8607,
        "frames.3.robot: the robot is 0.002 m/s too fast",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("of", "edit", "limit"),
    [
        (sample(), both(), TOP_SPEED / 2 + 0.5),
        (sample(limits=Limits(ahead=0.3, back=0.8)), both(), TOP_SPEED / 2 + 0.5),
        (sample(), put("frames", 2, "guarded", True), 2.0 * TOP_SPEED),
        (sample(), put("frames", 1, "guarded", True), 2.0 * TOP_SPEED),  # it stopped the robot, which starts again
        (sample(), put("frames", 3, "guarded", True), TOP_SPEED / 2 + 0.5),
        (sample(guard=False), both(), TOP_SPEED / 2 + 0.5 + 2.0 * (0.06 + 0.02 * TOP_SPEED + _TURNED) / 0.1),
        (sample(limits=STRONG), both(), 2.0 * TOP_SPEED),
        (sample(limits=replace(STRONG, acceleration=10.0)), both(), TOP_SPEED / 2 + 0.5),
        (sample(limits=replace(STRONG, acceleration=1.0)), put("frames", 2, "executed", 2, 10.1), 2.0 * TOP_SPEED),
        (sample(limits=replace(STRONG, acceleration=1.0)), put("frames", 2, "executed", 2, -10.1), 2.0 * TOP_SPEED),
        (sample(limits=replace(STRONG, acceleration=1.0)), put("frames", 2, "executed", 2, 9.9), TOP_SPEED / 2 + 0.5),
    ],
)
def test_motion_of_the_robot(tmp_path: Path, of: Scene, edit: Edit, limit: float) -> None:
    """Its position at tick 3, and at all later ones, is off by a distance."""

    def moved(distance: float) -> Edit:
        return both(edit, later("robot", 1, distance))

    assert_limit(
        tmp_path, of, moved, math.floor(limit * 1e3) / 1e4, math.ceil(limit * 1e3 + 1.0) / 1e4,
        "m/s of motion beyond what the velocities explain",
    )  # fmt: skip


def test_motion_of_an_imported_robot_has_no_sudden_stops(tmp_path: Path) -> None:
    edit = both(put("physics", 0), put("frames", 2, "guarded", True))
    moved = later("robot", 1, 0.15)
    assert "frames.2.robot: the robot is 0.528 m/s of motion" in findings(tmp_path, sample(), edit, moved)


def test_turn_of_the_robot(tmp_path: Path) -> None:
    assert_limit(
        tmp_path, sample(), lambda theta: put("frames", 3, "robot", 2, theta), 0.05, 0.052,
        "frames.2.robot: the robot is 0.002 rad turned beyond what its turn rate explains",
    )  # fmt: skip
    turned = later("robot", 2, 0.1)
    assert "turned" in findings(tmp_path, sample(), turned)
    assert "turned" not in findings(tmp_path, sample(), turned, put("frames", 2, "executed", 2, 1.0))
    around = both(everywhere("robot", 2, 3.14), later("robot", 2, -3.14))
    assert "turned" not in findings(tmp_path, sample(), around)


@pytest.mark.parametrize(
    ("of", "edit", "limit"),
    [
        (sample(), both(), 2e-4 * 1.05),
        (sample(), put("frames", 2, "guarded", True), 2e-4 * (1.0 + TOP_SPEED * 0.1)),
        (sample(guard=False), both(), 2e-4 * (1.0 + TOP_SPEED * 0.1)),
    ],
)
def test_displacement_of_the_robot_is_that_of_its_drive(tmp_path: Path, of: Scene, edit: Edit, limit: float) -> None:
    """At rest from tick 3 on, 0.05 m ahead of tick 2, while the drive of tick 2 led ahead."""

    def moved(distance: float) -> Edit:
        return both(edit, later("robot", 1, distance))

    assert_limit(tmp_path, of, moved, 0.0002, 0.0003, "from where its drive led")
    assert 0.0002 < limit < 0.0003


@pytest.mark.parametrize(("guarded", "omega", "found"), [(False, 1.5, True), (True, 1.5, False), (True, 0.1, True)])
def test_the_displacement_of_a_robot_that_turns(tmp_path: Path, guarded: bool, omega: float, found: bool) -> None:
    """It moved straight on along its old heading; where it is stopped in the tick, the arc explains that.

    The chord of an arc of 0.0943 m, its longest, over an angle of 0.15 rad ends 7 mm from the tangent; of 0.01 rad, at
    most 0.5 mm.
    """
    moved = later("robot", 1, 0.003)
    text = findings(
        tmp_path, sample(), moved, put("frames", 2, "executed", 2, omega), put("frames", 2, "guarded", guarded)
    )
    assert ("frames.2.robot: the robot is 0.00" in text and "from where its drive led" in text) == found


def test_a_unicycle_that_is_stopped_while_it_turns(tmp_path: Path) -> None:
    """The guard stops it during a tick in which it turns; it may be off by the arc, up to half the angle aside."""
    of = replace(sample(), robot=replace(sample().robot, kinematics="unicycle"))
    guarded = put("frames", 2, "guarded", True)
    text = findings(tmp_path, of, guarded, put("frames", 2, "executed", 2, 30.0))  # straight on, 1.5 rad off
    assert "off its heading" not in text
    assert "from where its drive led" not in text
    rests = (put("frames", k, "executed", [0.0, 0.0, 0.0]) for k in (3, 4, 5))
    stands = both(later("robot", 0, -0.9), *rests)  # 0.05 m less than its drive led; an arc of 2 rad explains 0.0479
    text = findings(tmp_path, of, guarded, stands, put("frames", 2, "executed", 2, 20.0))
    assert "frames.2.robot: the robot is 0.002 m from where its drive led" in text


@pytest.mark.parametrize("x", [3.8449, 3.8452])
def test_overlap_with_a_wall(tmp_path: Path, x: float) -> None:
    """The shoulder reaches 0.025 m beyond the centre: 0.06 m in the wall if it is at x = 3.835."""
    text = findings(tmp_path, sample(), everywhere("humans", 0, 0, round(x - 0.01, 4)))
    assert ("human 1 is 0.000 m too deep in a wall" in text) == (x > 3.845)


def test_overlap_with_a_wall_at_coarse_steps(tmp_path: Path) -> None:
    for of in (COARSE, RAMMED):
        x = 4.0 - 0.225 + _overlap(of)
        assert "too deep in a wall" not in findings(tmp_path, of, everywhere("humans", 0, 0, round(x - 0.001, 4)))
        found = findings(tmp_path, of, everywhere("humans", 0, 0, round(x + 0.002, 4)))
        assert "human 1 is 0.002 m too deep in a wall (the worst of 7 ticks)" in found


TABLE = Furniture(10, "table", Pose(2.0, 0.0, 1.5708), Rectangle(1.2, 0.8))
BENCH = Furniture(10, "bench", Pose(2.0, 0.0), Rectangle(1.0, 0.4), seat=True)
PLANT = Furniture(10, "plant", Pose(2.0, 0.0), Disc(0.2))


@pytest.mark.parametrize(
    ("thing", "y", "depth"),
    [
        (TABLE, 0.7, 0.04),  # 0.6 m from its middle to the edge; the body is 0.2 m deep
        (TABLE, -0.75, None),
        (TABLE, 0.5, 0.24),
        (PLANT, 0.3, 0.04),
        (PLANT, 0.35, None),
        (replace(PLANT, on=11), 0.3, None),
        (BENCH, 0.3, 0.04),
    ],
)
def test_overlap_with_furniture(tmp_path: Path, thing: Furniture, y: float, depth: float | None) -> None:
    of = replace(sample(), furniture=(thing, replace(TABLE, id=11, pose=Pose(-2.0, 3.0))), interactions=())
    text = findings(tmp_path, of, everywhere("humans", 0, 0, 2.0), everywhere("humans", 0, 1, y))
    expected = f"human 1 is {depth:.3f} m too deep in {thing.type} 10 (the worst of 7 ticks)" if depth else None
    assert expected in text if expected else "too deep in" not in text


def test_who_sits_is_on_the_seat(tmp_path: Path) -> None:
    """Also while sitting down; the robot and others are not on it."""
    of = replace(sample(), furniture=(BENCH,), interactions=())
    place = both(everywhere("humans", 0, 0, 2.0), everywhere("humans", 0, 1, 0.1))
    sits = everywhere("activity", 0, ACTIVITIES.index("sitting"))
    assert "too deep in" not in findings(tmp_path, of, place, sits)
    stands = put("frames", 4, "activity", 0, ACTIVITIES.index("standing"))
    found = findings(tmp_path, of, place, sits, stands)
    assert "frames.4.objects: human 1 is 0.240 m too deep in bench 10" in found
    assert "worst of" not in found
    robot = put("frames", 3, "robot", 0, 2.0)
    assert "frames.3.objects: the robot is 0.440 m too deep in bench 10" in findings(tmp_path, of, sits, robot)


def test_overlaps_of_several_people_are_told_apart(tmp_path: Path) -> None:
    """1 overlaps with 2 by 0.1 m and with 3 by 0.12 m, and with the robot at one tick."""
    edits = [everywhere("humans", k, [x, y, 1.5708, 0.0, 0.0, 0.0, 1.5708]) for k, x, y in
             ((0, 2.0, 0.0), (1, 2.0, 0.3), (2, 2.0, -0.28))]  # fmt: skip
    text = findings(tmp_path, sample(), *edits, put("frames", 4, "robot", 0, 1.6))
    for message in (
        "human 1 is 0.040 m too deep in human 2 (the worst of 7 ticks)",
        "human 1 is 0.060 m too deep in human 3 (the worst of 7 ticks)",
        "frames.4.humans: human 1 is 0.065 m too deep in the robot",
    ):
        assert message in text
    assert "human 2 is" not in text


@pytest.mark.parametrize(("x", "found"), [(2.391, False), (2.388, True)])
def test_overlap_of_shoulders(tmp_path: Path, x: float, found: bool) -> None:
    """Side by side; each body is 0.45 m broad."""
    beside = everywhere("humans", 1, [x, 2.0, 1.5708, 0.0, 0.0, 0.0, 1.5708])
    text = findings(tmp_path, sample(), beside)
    assert ("human 1 is 0.002 m too deep in human 2 (the worst of 7 ticks)" in text) == found
    assert ("too deep" in text) == found


def test_tracks_and_presence(tmp_path: Path) -> None:
    """A pedestrian walks on a track from tick 1 to tick 5."""
    track = tuple((2.0, round(2.0 - 0.1 * k, 4)) for k in range(5))
    of = sample(Human(1, Pose(2.0, 2.0, 1.5708), 0.2, behaviour="recorded", track=track, enters=1, leaves=6))
    ends: tuple[tuple[str | int, ...], ...] = (("frames", 0), ("final",))
    absent = both(*(both(put(*end, "humans", 0, None), put(*end, "activity", 0, -1)) for end in ends))
    follows = both(*(put("frames", k, "humans", 0, 1, round(2.1 - 0.1 * k, 4)) for k in range(1, 6)), absent)
    text = findings(tmp_path, of, follows)
    assert "recorded track" not in text
    assert "present before entering" not in text
    assert "off the recorded track" not in findings(tmp_path, of, follows, put("frames", 3, "humans", 0, 0, 2.0002))
    found = findings(tmp_path, of, follows, put("frames", 3, "humans", 0, 0, 2.0022))
    assert "frames.3.humans: human 1 is 0.002 m off the recorded track" in found
    beside = put("frames", 3, "humans", 0, 1, 1.8022)
    assert "frames.3.humans: human 1 is 0.002 m off the recorded track" in findings(tmp_path, of, follows, beside)
    for end, place in zip(ends, ("frames.0", "frames.6"), strict=True):
        appears = both(put(*end, "humans", 0, [2.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0]), put(*end, "activity", 0, 1))
        found = findings(tmp_path, of, follows, appears)
        assert f"{place}.humans: human 1 is present before entering or after leaving" in found


@pytest.mark.parametrize(("distance", "found"), [(0.549, False), (0.552, True)])
def test_whoever_is_near_a_recorded_pedestrian_may_be_pushed(tmp_path: Path, distance: float, found: bool) -> None:
    """Within 0.1 m of clearance between bodies that reach 0.225 m from their centres."""
    of = sample(replace(FIRST, behaviour="recorded", track=((2.0, 2.0),) * 7))
    place = everywhere("humans", 1, [2.0, round(2.0 - distance, 4), 1.5708, 0.0, 0.0, 0.0, 1.5708])
    text = findings(tmp_path, of, place, put("frames", 3, "humans", 1, 4, 4.0))
    assert ("human 2 is 1.570 m/s faster than possible" in text) == found  # than 1.43 + 1 m/s
    moved = put("frames", 3, "humans", 1, 0, 2.3)
    assert ("of motion beyond what the velocities explain" in findings(tmp_path, of, place, moved)) == found


@pytest.mark.parametrize(
    ("edits", "message"),
    [
        ([put("outcome", "time", 0.6002)], None),
        ([put("outcome", "time", 0.6004)], "is of tick 6 at 0.6004 s, but there are 6 frames"),
        ([put("outcome", "tick", 7)], "is of tick 7 at 0.6 s, but there are 6 frames"),
        ([put("outcome", "status", "goal"), put("goal", "x", -0.3)], None),
        ([put("outcome", "status", "goal"), put("goal", "x", -0.2977)], "but 0.002 m or rad were missing"),
        ([put("goal", "x", -0.35)], None),  # reached at the end only
        ([put("goal", "x", -0.352)], "the goal was reached at tick 5, but the episode went on"),
        ([put("goal", "x", -0.352), put("rules", "ends_on", ["time"])], None),
        (
            [
                put("outcome", "status", "goal"),
                put("goal", {"x": -0.7, "y": 0.0, "theta": 0.3, "distance": 0.4, "angle": 0.2}),
            ],
            "0.100 m or rad were missing",
        ),
        (  # within 3.1416 rad every heading is at the goal; within 3 rad not all
            [put("goal", "x", -0.352), everywhere("robot", 2, 3.1415)],
            "the goal was reached at tick 5, but the episode went on",
        ),
        ([put("goal", "x", -0.352), put("goal", "angle", 3.0), everywhere("robot", 2, 3.1415)], None),
        ([put("outcome", "status", "timeout"), put("rules", "time_limit", 0.6)], None),
        (
            [put("outcome", "status", "timeout"), put("rules", "time_limit", 0.7)],
            "was reached at 0.6 s; the limit is 0.7 s",
        ),
        ([put("frames", 3, "time", 0.3002)], None),
        ([put("frames", 3, "time", 0.3003)], "frames.3: time should be 0.3000 s, is 0.3003 s"),
        ([put("frames", 2, "humans", 0, 2, 3.1416)], None),
        ([put("frames", 2, "humans", 0, 2, 3.1417)], "angle is out of range"),
        ([put("frames", 2, "command", 2, 1.23456)], "frames.2.command: a number is not rounded"),
    ],
)
def test_outcome_time_and_rounding(tmp_path: Path, edits: list[Edit], message: str | None) -> None:
    if message is not None:
        assert message in findings(tmp_path, sample(), *edits)
        return
    text = findings(tmp_path, sample(), *edits)
    assert all(part not in text for part in ("outcome", "time should", "rounded", "range"))


def test_time_of_imported_episodes_rises(tmp_path: Path) -> None:
    assert "time" not in findings(tmp_path, sample(), put("physics", 0), put("frames", 3, "time", 0.39))
    text = findings(tmp_path, sample(), put("physics", 0), put("frames", 3, "time", 0.2))
    assert "frames.3: time must rise, is 0.2 s after 0.2 s" in text
