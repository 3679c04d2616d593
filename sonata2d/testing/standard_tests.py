"""Standard tests of pedestrian models: what guidelines for simulations of evacuations ask of a two-dimensional model.

Sources: RiMEA, Guideline for Microscopic Evacuation Analysis, version 3.0 (2016), appendix 1; Ronchi, Kuligowski,
Reneke, Peacock & Nilsson, The Process of Verification and Validation of Building Fire Evacuation Models, NIST TN 1822
(2013); ISO 20414:2020. Their tests of stairs, lifts, smoke, incapacitated people and doors that close do not apply.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from ..agents.pedestrians.crowd import Crowd
from ..core.entities import DEFAULT_MODEL, PERSON_BREADTH, PERSON_RADIUS
from ..core.geometry import Barriers, Pose, Twist, segments_cross
from ..core.portable_math import Array, BoolArray, IntArray
from ..core.rng import RandomStream
from ..core.scene import Scene
from ..scenegen.human_sampling import draw_human
from ..scenegen.scenario.sections import PersonConfig
from ..sim.world import World
from .realism import scene_from_state, simulate

Size = Literal["small", "full"]

_DT = 0.1  # s
_SPEED, _SPEED_DEVIATION, _SLOWEST, _FASTEST = 1.34, 0.26, 0.6, 2.1  # m/s; Weidmann, ETH Zürich IVT 90 (1993)
_FAR = 15.0  # m, of destinations beyond what is measured


@dataclass(frozen=True)
class Finding:
    """The result of a standard test.

    Attributes:
        name: of the test.
        sources: its numbers in the guidelines.
        found: what was measured.
        required: what the guidelines ask for; where they give no figure, ours.
        passed: whether the model meets it.
    """

    name: str
    sources: str
    found: str
    required: str
    passed: bool


class _Setting(NamedTuple):
    """The model under test, and whether the numbers of people and the times are those of the guidelines."""

    model: str
    is_full: bool
    seed: int

    def number(self, small: int, full: int) -> int:
        return full if self.is_full else small

    def draws(self) -> list[_Setting]:
        """Five settings with seeds of their own, for the mean of a time that depends on the last person of a crowd."""
        return [self._replace(seed=self.seed + k) for k in range(5)]

    def speeds(self, count: int) -> Array:
        """Desired speeds, (count,), m/s."""
        drawn = np.clip(np.random.default_rng(self.seed).normal(_SPEED, _SPEED_DEVIATION, count), _SLOWEST, _FASTEST)
        return np.asarray(drawn * (_SPEED / drawn.mean()))  # few people have the mean of many


_Outcome = tuple[str, str, bool]  # found, required, passed
_Wall = tuple[float, float, float, float]  # x1, y1, x2, y2, m


def run_standard_tests(
    model: str = DEFAULT_MODEL, *, size: Size = "small", only: Sequence[str] = (), seed: int = 0
) -> Iterator[Finding]:
    """Run the standard tests, one after another.

    Args:
        model: name of the pedestrian model.
        size: full: the numbers of people and the times of the guidelines, which takes minutes; small: fewer and
            shorter ones.
        only: names of the tests to run; default: all of `STANDARD_TESTS`.
        seed: of positions, desired speeds, and of what people do.

    Yields:
        The finding of each test as soon as it is known.

    Raises:
        ValueError: a name is not that of a test.

    Example:
        >>> [finding] = run_standard_tests(only=["speed in a corridor"])
        >>> finding.passed
        True
    """
    for name in only:
        if name not in STANDARD_TESTS:
            raise ValueError(f"{name!r} is no standard test; there are {', '.join(STANDARD_TESTS)}")
    setting = _Setting(model, size == "full", seed)
    for name, (sources, test) in STANDARD_TESTS.items():
        if not only or name in only:
            yield Finding(name, sources, *test(setting))


def _corridor_speed(setting: _Setting) -> _Outcome:
    """One person walks 40 m in a corridor of 2 m at 1.33 m/s."""
    walls = _walls([(-2, 0, 60, 0), (-2, 2, 60, 2)])
    scene = _scene(setting, [(0.0, 1.0)], [(60.0, 1.0)], [1.33], walls)
    time = _passing_times(_tracks(scene, 60.0)[:, :, 0], 40.0)[0]
    return f"{time:.1f} s", "26 to 34 s", bool(26.0 <= time <= 34.0)


def _fundamental_diagram(setting: _Setting) -> _Outcome:
    """People in a ring-shaped corridor of 2 m, that walk in one direction at several densities."""
    densities = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0) if setting.is_full else (0.5, 1.5, 3.0)
    speeds = [_ring_speed(setting, density) for density in densities]
    expected = [_SPEED * (1.0 - np.exp(-1.913 * (1.0 / density - 1.0 / 5.4))) for density in densities]
    error = float(np.sqrt(np.mean((np.array(speeds) - expected) ** 2)))
    shown = ", ".join(f"{speed:.2f} at {density:g}" for speed, density in zip(speeds, densities, strict=True))
    is_falling = all(later < earlier for earlier, later in pairwise(speeds))
    return (
        f"{shown} /m²; RMS difference {error:.2f} m/s",
        "speed falls with density; RMS difference to Weidmann at most 0.2 m/s",
        is_falling and error <= 0.2,
    )


def _ring_speed(setting: _Setting, density: float) -> float:
    """Mean speed in a periodic corridor of 16 m by 2 m, m/s."""
    length, width, margin, settling = 16.0, 2.0, 5.0, 5
    count = round(density * length * width)
    place, velocity, speeds = _lattice(setting, count, 0.0, 0.3, length, width - 0.3), np.zeros((count, 2)), []
    desired, walls = setting.speeds(count), _walls([(-40, 0, 56, 0), (-40, width, 56, width)])
    for second in range(2 * settling):
        # those near an end also walk, as copies, beyond the other end
        low, high = np.flatnonzero(place[:, 0] < margin), np.flatnonzero(place[:, 0] >= length - margin)
        source = np.concatenate([np.arange(count), low, high])
        begin = place[source] + np.repeat([[0.0, 0.0], [length, 0.0], [-length, 0.0]], [count, len(low), len(high)], 0)
        track = simulate(
            begin, velocity[source], begin + np.array([30.0, 0.0]), desired[source], walls, _DT, 10,
            model=setting.model, seed=setting.seed + second,
        )[:, :count]  # fmt: skip
        if second >= settling:
            speeds.append(float((track[-1, :, 0] - place[:, 0]).mean()))
        velocity, place = (track[-1] - track[-2]) / _DT, track[-1].copy()
        place[:, 0] %= length
    return float(np.mean(speeds))


def _pre_movement(setting: _Setting) -> _Outcome:
    """Ten people in a room set off at times of their own."""
    low, high = (10.0, 100.0) if setting.is_full else (1.0, 10.0)
    times = np.random.default_rng(setting.seed).uniform(low, high, 10)
    start = [(1.0 + 1.5 * (k % 5), 1.0 + 2.0 * (k // 5)) for k in range(10)]
    scene = _scene(setting, start, [(30.0, y) for _, y in start], setting.speeds(10), _walls([]))
    humans = (replace(human, pre_movement=float(time)) for human, time in zip(scene.humans, times, strict=True))
    track = _tracks(replace(scene, humans=tuple(humans)), high + 5.0)
    delay = _passing_times(track[:, :, 0] - np.array(start)[:, 0], 0.2) - times
    return (
        f"{delay.min():.1f} to {delay.max():.1f} s after the given times, until 0.2 m are walked",
        "0 to 1.5 s",
        bool(delay.min() >= 0.0 and delay.max() <= 1.5),
    )


def _corner(setting: _Setting) -> _Outcome:
    """Twenty people walk round a corner in a corridor of 2 m."""
    walls = _walls([(-1, 0, 12, 0), (12, 0, 12, 12), (-1, 2, 10, 2), (10, 2, 10, 12), (-1, 0, -1, 2)])
    start = _lattice(setting, 20, 0.0, 0.3, 6.0, 1.7)
    track = _tracks(_scene(setting, start, [(11.0, 12.0 + _FAR)] * 20, setting.speeds(20), walls), 60.0)
    crossings, late = _wall_crossings(track, walls), int(np.isnan(_passing_times(track[:, :, 1], 12.0)).sum())
    return f"{crossings} steps through walls, {late} did not arrive in 60 s", "0, 0", crossings == 0 and late == 0


def _demographics(setting: _Setting) -> _Outcome:
    """Fifty people with drawn desired speeds walk beside each other, far apart."""
    rng, person = RandomStream(setting.seed, 0, "people"), PersonConfig()
    desired = np.array([draw_human(person, "walking", Pose(0.0, 0.0), rng).desired_speed for _ in range(50)])
    start = [(0.0, 3.0 * k) for k in range(50)]
    track = _tracks(_scene(setting, start, [(40.0, y) for _, y in start], desired, _walls([])), 25.0)
    speeds = 12.0 / (_passing_times(track[:, :, 0], 14.0) - _passing_times(track[:, :, 0], 2.0))
    difference, given = float(np.abs(speeds / desired - 1.0).mean()), person.desired_speed
    return (
        f"mean {speeds.mean():.2f} and deviation {speeds.std():.2f} m/s; people {difference:.1%} off their own",
        f"mean {given.mean:g} m/s within 0.1 m/s; at most 5% off",
        bool(abs(speeds.mean() - given.mean) <= 0.1 and difference <= 0.05),
    )


def _number_of_exits(setting: _Setting) -> _Outcome:
    """A crowd leaves a room of 30 m by 20 m through four exits of 1 m, and through two."""
    count, times = setting.number(80, 1000), []
    start = _lattice(setting, count, 1.0, 1.0, 29.0, 19.0)
    for is_open in (True, False):
        exits = [(8.0, 0.0), (22.0, 0.0), *([(8.0, 20.0), (22.0, 20.0)] if is_open else [])]
        walls = _walls([
            *_wall_with_gaps(0.0, 0.0, 30.0, [x for x, y in exits if y == 0.0]),
            *_wall_with_gaps(20.0, 0.0, 30.0, [x for x, y in exits if y > 0.0]),
            (0, 0, 0, 20), (30, 0, 30, 20),
        ])  # fmt: skip
        nearest = np.array([[np.hypot(x - a, y - b) for a, b in exits] for x, y in start]).argmin(axis=1)
        goals = [(exits[e][0], exits[e][1] + (_FAR if exits[e][1] > 0.0 else -_FAR)) for e in nearest.tolist()]
        scene = _scene(setting, start, goals, setting.speeds(count), walls)
        track = _tracks(scene, 0.5 * count + 60.0, _is_out_of_hall)
        times.append(float(_first_times(_is_out_of_hall(track)).max()))
    ratio = times[1] / times[0]
    found = f"{times[0]:.0f} s by four, {times[1]:.0f} s by two: {ratio:.2f} times"
    # a small crowd spends a part of the time on the way to its exit
    low = 1.7 if setting.is_full else 1.3
    return found, f"about twice: {low:g} to 2.4 times", bool(low <= ratio <= 2.4)


def _is_out_of_hall(position: Array) -> BoolArray:
    """Whether positions, (..., 2), m, are beyond the long sides of a hall that is 20 m wide."""
    return np.asarray((position[..., 1] < 0.0) | (position[..., 1] > 20.0))


def _assigned_exits(setting: _Setting) -> _Outcome:
    """23 people in twelve rooms beside a corridor leave by the exits that they are given."""
    doors = [2.0 + 4.0 * k for k in range(6)]
    walls = [*_wall_with_gaps(0.0, 0.0, 24.0, doors, 0.9), *_wall_with_gaps(2.0, 0.0, 24.0, doors, 0.9)]
    walls += [(0, -4, 24, -4), (0, 6, 24, 6)]
    walls += [(4 * k, y, 4 * k, y + 4) for k in range(7) for y in (-4, 2)]
    start = [(door + dx, y) for y in (-2.5, 4.5) for door in doors for dx in (-0.8, 0.8)][:-1]
    is_main = np.array([x < 16.0 for x, _ in start])
    goals = [(-_FAR, 1.0) if main else (24.0 + _FAR, 1.0) for main in is_main]
    track = _tracks(_scene(setting, start, goals, setting.speeds(len(start)), _walls(walls)), 60.0)
    right = int(np.where(is_main, (track[:, :, 0] < 0.0).any(axis=0), (track[:, :, 0] > 24.0).any(axis=0)).sum())
    return f"{right} of {len(start)} by their exit", "all", right == len(start)


def _choice_of_exit(setting: _Setting) -> _Outcome:
    """A crowd in one half of a room of 30 m by 20 m, nearer to one of two exits of 1 m."""
    count = setting.number(60, 500)
    walls = _walls([*_wall_with_gaps(0.0, 0.0, 30.0, [7.0, 20.0]), (0, 0, 0, 20), (30, 0, 30, 20), (0, 20, 30, 20)])
    start = _lattice(setting, count, 2.0, 1.0, 12.0, 8.0 if count < 100 else 19.0)
    scene = _scene(setting, start, [(7.0, -_FAR)] * count, setting.speeds(count), walls)
    track = _tracks(scene, 0.8 * count + 60.0, _is_out_of_hall)
    is_out = _is_out_of_hall(track)
    first = is_out.argmax(axis=0)
    place = track[first, np.arange(count), 0]
    near, far = int((place[is_out.any(axis=0)] < 13.0).sum()), int((place[is_out.any(axis=0)] > 13.0).sum())
    found = f"{near} by the nearer exit, {far} by the other one, {count - near - far} not in time"
    return (
        found,
        "most by the nearer one, 5% or more by the other one, 0",
        bool(near > far >= 0.05 * count and near + far == count),
    )


def _bottleneck(setting: _Setting) -> _Outcome:
    """A crowd goes from a room through a corridor of 5 m by 1 m into a second one, and leaves it by an exit of 1 m."""
    count = setting.number(40, 150)
    walls: list[_Wall] = [(0, 0, 10, 0), (0, 10, 10, 10), (0, 0, 0, 10), (15, 0, 25, 0), (15, 10, 25, 10)]
    walls += [(x, y, x, y + 4.5) for x in (10, 15, 25) for y in (0, 5.5)] + [(10, y, 15, y) for y in (4.5, 5.5)]
    start = _lattice(setting, count, 0.5, 0.5, 9.0 if count < 100 else 6.5, 9.5)
    scene = _scene(setting, start, [(25.0 + _FAR, 5.0)] * count, setting.speeds(count), _walls(walls))
    track = _tracks(scene, 1.0 * count + 70.0, _is_past(0, 25.0))
    x, is_level = track[:, :, 0], np.abs(track[:, :, 1] - 5.0) < 2.0
    first, second = (
        float(np.percentile((is_level & (x > end - 2.5) & (x < end)).sum(axis=1), 95.0)) / 10.0 for end in (10.0, 25.0)
    )
    late = int(np.isnan(_passing_times(x, 25.0)).sum())
    found = f"{first:.1f} /m² before the corridor, {second:.1f} before the exit (95th percentile); {late} did not leave"
    return found, "no congestion in the second room: less than half; 0", second < first / 2.0 and late == 0


def _crowd_at_corner(setting: _Setting) -> _Outcome:
    """A crowd walks round a corner in a corridor of 4 m, and in straight ones as long as its inner and outer side."""
    inner, corner, outer = np.mean([_times_round_corner(draw) for draw in setting.draws()], axis=0)
    found = f"{inner:.1f} s inner, {corner:.1f} s corner, {outer:.1f} s outer"
    return found, "inner < corner < outer", bool(inner < corner < outer)


def _times_round_corner(setting: _Setting) -> tuple[float, float, float]:
    """The times after which the last one has passed the shorter straight corridor, the corner and the longer one, s."""
    count, arm, width, limit = setting.number(60, 300), 20.0, 4.0, 300.0
    start = _lattice(setting, count, 0.0, 0.4, 10.0 if count < 100 else 25.0, width - 0.4)
    begin, speeds = float(start[:, 0].max()), setting.speeds(count)

    def last_time(walls: list[_Wall], goals: list[tuple[float, float]], axis: int, end: float) -> float:
        track = _tracks(_scene(setting, start, goals, speeds, _walls(walls)), limit, _is_past(axis, end))
        return float(_passing_times(track[:, :, axis], end).max())

    def straight(length: float) -> float:
        end = begin + length
        walls: list[_Wall] = [(-1, 0, end, 0), (-1, width, end, width), (-1, 0, -1, width)]
        return last_time(walls, [(end + _FAR, y) for y in start[:, 1]], 0, end)

    x, end = begin + arm, width + arm
    corner: list[_Wall] = [
        (-1, 0, x + width, 0), (x + width, 0, x + width, end), (-1, width, x, width),
        (x, width, x, end), (-1, 0, -1, width),
    ]  # fmt: skip
    around = last_time(corner, [(x + width - y, end + _FAR) for y in start[:, 1]], 1, end)
    return straight(2.0 * arm), around, straight(2.0 * (arm + width))


def _is_past(axis: int, limit: float) -> Callable[[Array], BoolArray]:
    """A function of positions, (..., 2): whether they have reached a coordinate on an axis, m."""
    return lambda position: np.asarray(position[..., axis] >= limit)


def _counter_flow(setting: _Setting) -> _Outcome:
    """A crowd walks through a corridor of 10 m by 2 m to another room, against fewer or more people."""
    draws = [_counter_flow_times(draw) for draw in setting.draws()]
    times, late = np.mean([times for times, _ in draws], axis=0), sum(late for _, late in draws)
    found = ", ".join(f"{time:.0f}" for time in times) + f" s against 0, 10, 50, 100%; {late} did not arrive in 150 s"
    is_slower = times[3] > times[0] and all(b > 0.9 * a for a, b in pairwise(times))
    return found, "time grows with the number of others; 0", bool(is_slower and late == 0)


def _counter_flow_times(setting: _Setting) -> tuple[list[float], int]:
    """Time until the whole crowd has passed, by the share of others, s, and the number of people who did not arrive."""
    count = setting.number(30, 100)
    walls = [(-10, -5, -10, 5), (20, -5, 20, 5), (0, -1, 10, -1), (0, 1, 10, 1)]
    walls += [(x, y, x, y + 4) for x in (0, 10) for y in (-5, 1)]
    walls += [(x, y, x + 10, y) for x in (-10, 10) for y in (-5, 5)]
    times, late = [], 0
    for share in (0.0, 0.1, 0.5, 1.0):
        others = round(share * count)
        ours = _lattice(setting, count, -9.5, -4.5, -3.0, 4.5)
        start = np.concatenate([ours, np.array([10.0, 0.0]) - ours[:others] * [1.0, -1.0]])
        # a place of its own in the other room for each one
        goals = np.concatenate([ours + np.array([22.0, 0.0]), np.array([-12.0, 0.0]) - ours[:others] * [1.0, -1.0]])
        track = _tracks(_scene(setting, start, goals, setting.speeds(count + others), _walls(walls)), 150.0)
        passed = _passing_times(track[:, :count, 0], 10.5)
        back = _passing_times(-track[:, count:, 0], 0.5)
        late += int(np.isnan(passed).sum() + np.isnan(back).sum())
        times.append(float(np.nan_to_num(passed, nan=150.0).max()))
    return times, late


def _group(setting: _Setting) -> _Outcome:
    """Five people of one group, one of whom is slow, walk 30 m."""
    start = [(0.0, 0.8 * k) for k in range(5)]
    speeds, groups = [1.25, 1.25, 0.5, 1.25, 1.25], np.ones(5, dtype=int)
    scene = _scene(setting, start, [(30.0 + _FAR, y) for _, y in start], speeds, _walls([]), groups)
    track = _tracks(scene, 90.0)
    times = _passing_times(track[:, :, 0], 30.0)
    walking = track[50 : int(np.nanmax(times) / _DT)]
    largest = float(np.hypot(*np.moveaxis(walking[:, :, None] - walking[:, None], -1, 0)).max())
    found = f"{largest:.1f} m between two members at most; {np.ptp(times):.1f} s between their arrivals"
    return found, "at most 5 m and 5 s", bool(largest <= 5.0 and np.ptp(times) <= 5.0)


def _door(setting: _Setting) -> _Outcome:
    """A crowd leaves a room by a door of 1 m in a wall of 0.2 m."""
    count = setting.number(80, 100)
    walls = _walls([
        *_wall_with_gaps(0.0, -4.0, 4.0, [0.0]), *_wall_with_gaps(-0.2, -4.0, 4.0, [0.0]),
        (-0.5, 0, -0.5, -0.2), (0.5, 0, 0.5, -0.2), (-4, 0, -4, 12), (4, 0, 4, 12), (-4, 12, 4, 12),
    ])  # fmt: skip
    start = _lattice(setting, count, -3.5, 0.6, 3.5, 0.6 + count / 2.5 / 7.0)
    goals = [(0.3 * x / 3.5, -_FAR) for x in start[:, 0]]
    track = _tracks(_scene(setting, start, goals, setting.speeds(count), walls), 120.0)
    times = np.sort(_passing_times(-track[:, :, 1], 0.0))
    low, high = count // 5, 4 * count // 5
    flow = (high - low) / float(times[high] - times[low])
    return f"{flow:.2f} /(m s)", "1.3 to 2.2 /(m s)", bool(1.3 <= flow <= 2.2)


STANDARD_TESTS: dict[str, tuple[str, Callable[[_Setting], _Outcome]]] = {
    "speed in a corridor": ("RiMEA 1, NIST 2.1", _corridor_speed),
    "fundamental diagram": ("RiMEA 4", _fundamental_diagram),
    "pre-movement time": ("RiMEA 5, NIST 1.1", _pre_movement),
    "corner": ("RiMEA 6, NIST 2.3", _corner),
    "demographics": ("RiMEA 7, NIST 2.4", _demographics),
    "number of exits": ("RiMEA 9", _number_of_exits),
    "assigned exits": ("RiMEA 10, NIST 3.1", _assigned_exits),
    "choice of exit": ("RiMEA 11", _choice_of_exit),
    "bottleneck": ("RiMEA 12", _bottleneck),
    "crowd at a corner": ("RiMEA 15", _crowd_at_corner),
    "counter-flow": ("NIST 2.8", _counter_flow),
    "group": ("NIST 2.9", _group),
    "flow through a door": ("NIST 5.2", _door),
}
"""The tests by name, with their numbers in the guidelines; ISO 20414 has those of NIST."""


# Scenes and measurements


def _walls(rows: Sequence[_Wall]) -> Array:
    return np.array(rows, dtype=float).reshape(-1, 4)


def _wall_with_gaps(y: float, low: float, high: float, gaps: Sequence[float], width: float = 1.0) -> list[_Wall]:
    """Pieces of a wall along x with gaps around some places, m."""
    ends = [low, *(gap + side * width / 2 for gap in gaps for side in (-1, 1)), high]
    return [(a, y, b, y) for a, b in zip(ends[::2], ends[1::2], strict=True)]


def _lattice(setting: _Setting, count: int, x: float, y: float, to_x: float, to_y: float) -> Array:
    """Places of people in a rectangle, evenly spread and a little at random, (count, 2), m."""
    spacing = np.sqrt((to_x - x) * (to_y - y) / count)
    rows = max(round((to_y - y) / spacing), 1)
    columns = -(-count // rows)
    k = np.arange(count)
    step_x, step_y = (to_x - x) / columns, (to_y - y) / rows
    jitter = np.random.default_rng(setting.seed).uniform(-0.05, 0.05, (count, 2))
    return np.stack([x + (k // rows + 0.5) * step_x, y + (k % rows + 0.5) * step_y], axis=1) + jitter


def _scene(
    setting: _Setting, start: Sequence[tuple[float, float]] | Array, goals: Sequence[tuple[float, float]] | Array,
    speeds: Sequence[float] | Array, walls: Array, groups: IntArray | None = None,
) -> Scene:  # fmt: skip
    """A scene of people who start at rest, each with a goal at which it leaves."""
    places = np.array(start, dtype=float)
    scene = scene_from_state(
        places, np.zeros_like(places), np.array(goals, dtype=float), np.array(speeds, dtype=float), walls, groups,
        dt=_DT, model=setting.model, radius=PERSON_RADIUS, breadth=PERSON_BREADTH, seed=setting.seed,
    )  # fmt: skip
    return replace(scene, humans=tuple(replace(human, exits=True) for human in scene.humans))


def _tracks(scene: Scene, seconds: float, is_out: Callable[[Array], BoolArray] | None = None) -> Array:
    """Positions at all ticks, (T, N, 2), m, until everybody is out, or for a time, s."""
    world, crowd = World(scene), Crowd(scene)
    positions: list[Array] = []
    for _ in range(round(seconds / _DT)):
        snapshot = world.snapshot()
        place, is_present = snapshot.state.humans[:, :2].copy(), snapshot.state.is_present
        if is_present is not None:  # those who have left stay where they were seen last
            place[~is_present] = positions[-1][~is_present]
        positions.append(place)
        if is_out is not None and is_out(positions[-1]).all():
            break
        world.step(Twist(), crowd.act(snapshot))
    return np.array(positions)


def _first_times(reached: BoolArray) -> Array:
    """The first time at which each column of (T, N) is true, s; NaN if it never is."""
    return np.where(reached.any(axis=0), reached.argmax(axis=0) * _DT, np.nan)


def _passing_times(values: Array, limit: float) -> Array:
    """The time at which each column of (T, N) reaches a limit, s."""
    return _first_times(values >= limit)


def _wall_crossings(track: Array, walls: Array) -> int:
    """Number of steps of (T, N, 2) through a wall."""
    barriers = Barriers.of(((x1, y1), (x2, y2), 0.0) for x1, y1, x2, y2 in walls.tolist())
    start, end = track[:-1].reshape(-1, 2), track[1:].reshape(-1, 2)
    return int(segments_cross(start, end, barriers).any(axis=0).sum())
