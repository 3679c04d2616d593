"""The safety guard against plain loops: what is near, how far velocities are reduced, contacts and faults."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest

from sonata2d.core.barrier_grid import Solids, solids_of
from sonata2d.core.compiled.kernel import kernel
from sonata2d.core.compiled.packing import Packed, pack, unpack
from sonata2d.core.geometry import Barriers
from sonata2d.core.portable_math import Array
from sonata2d.sim.kernel.rules import CONTACT_DISTANCE, GUARD, HOLONOMIC, HUMAN_RANGE, OWN_SPEED, ROBOT_RADIUS, TICK
from sonata2d.sim.kernel.safety import Guard, find_near, limited

H = 0.02  # s, a substep
RADIUS = 0.3  # m, of the robot
NEAR = 0.01  # m, below which a gap is a contact
CASES = 400
TOUCHED, BY_ROBOT, BY_OTHER = 1, 2, 4


class Situation(NamedTuple):
    """A robot among people and walls; `bodies`, `barriers`, `rules` as in `limited`."""

    guard: Guard
    bodies: Array
    barriers: Array
    rules: Array


def solids(case: Situation) -> Packed[Solids]:
    """Its walls; the caller keeps them while a kernel reads them."""
    table = case.barriers
    ends = zip(table[:, :2].tolist(), table[:, 2:4].tolist(), table[:, 4].tolist(), strict=True)
    return Packed(solids_of(Barriers.of([((ax, ay), (bx, by), radius) for (ax, ay), (bx, by), radius in ends])))


@kernel
def found_near(packed_guard: Any, bodies: Array, packed_solids: Any, rules: Array) -> None:
    """Compiled `find_near`."""
    find_near(unpack(packed_guard, Guard), bodies, len(bodies) - 1, unpack(packed_solids, Solids), rules)


@kernel
def reduced(packed_guard: Any, vx: float, vy: float, bodies: Array, packed_solids: Any, rules: Array, h: float) -> Any:
    """Compiled `limited`."""
    return limited(unpack(packed_guard, Guard), vx, vy, bodies, unpack(packed_solids, Solids), rules, h)


def situation(
    people: list[tuple[float, ...]] = [],  # noqa: B006
    walls: list[tuple[float, ...]] = [],  # noqa: B006
    *,
    velocity: tuple[float, float] = (0.0, 0.0),
    owners: list[int] | None = None,
    **rules: float,
) -> Situation:
    """A situation with the robot at the origin.

    Args:
        people: x, y, vx, vy, heading, radius and shoulder of each.
        walls: x and y of both ends, and half the thickness, of each.
        velocity: of the robot, m/s.
        owners: `Guard.barrier_owner`; each wall of its own if None.
        rules: `guard`, `holonomic`, `speed`, `reach`: see `rules_of`.
    """
    rows = np.array(people, dtype=float).reshape(-1, 7)
    count, barriers = len(people), np.zeros((len(walls), 8))
    for row, (ax, ay, bx, by, radius) in zip(barriers, walls, strict=True):
        square = (bx - ax) ** 2 + (by - ay) ** 2
        row[:] = ax, ay, bx, by, radius, bx - ax, by - ay, 1.0 / square if square else 0.0
    values = np.zeros(16)
    values[[TICK, CONTACT_DISTANCE, GUARD, ROBOT_RADIUS, HOLONOMIC, OWN_SPEED, HUMAN_RANGE]] = (
        0.1, NEAR, rules.get("guard", 1), RADIUS, rules.get("holonomic", 1), rules.get("speed", 1.0),
        rules.get("reach", 0.3),
    )  # fmt: skip
    guard = Guard(
        radius=rows[:, 5].copy(),
        shoulder=rows[:, 6].copy(),
        torso=np.column_stack([np.cos(rows[:, 4]), np.sin(rows[:, 4])]),
        human_contact=np.full(count, 7),
        barrier_contact=np.full(len(walls), 7),
        robot_contact=np.full(1, 7),
        barrier_owner=np.array(range(len(walls)) if owners is None else owners, dtype=np.int64),
        near=np.zeros(count + len(walls), dtype=np.int64),
        counts=np.array([9, 9, 9, 0]),
        separation=np.zeros((count + len(walls), 4)),
    )
    return Situation(guard, np.vstack([rows[:, :4], (0.0, 0.0, *velocity)]), barriers, values)


def near(case: Situation) -> tuple[list[int], list[int]]:
    """The people and the walls that are near, after all contacts are cleared."""
    walls = solids(case)
    found_near(pack(case.guard), case.bodies, walls.argument, case.rules)
    assert not case.guard.human_contact.any() | case.guard.barrier_contact.any() | case.guard.robot_contact.any()
    assert not case.guard.counts[2]
    people, barriers, *_ = case.guard.counts.tolist()
    found = case.guard.near.tolist()
    return found[:people], found[people : people + barriers]


def drive(case: Situation, vx: float, vy: float) -> tuple[Array, float, bool]:
    """Velocity, push and whether the guard reduced it, for a wanted velocity."""
    near(case)
    walls = solids(case)
    velocity, push, is_reduced = reduced(pack(case.guard), vx, vy, case.bodies, walls.argument, case.rules, H)
    return np.array(velocity), push, is_reduced


def to_segment(point: Array, start: Array, end: Array) -> Array:
    """The vector from a point to the nearest one of a segment."""
    along, square = end - start, float((end - start) @ (end - start))
    t = min(max(float((point - start) @ along) / square, 0.0), 1.0) if square else 0.0
    return np.asarray(start + t * along - point)


def outlines(case: Situation, at: Array, later: float = 0.0) -> list[tuple[Array, float]]:
    """Unit vector and gap from the robot at a point to each person, after `later` seconds, and to each wall."""
    found = []
    for k, row in enumerate(case.bodies[:-1]):
        middle, across = row[:2] + row[2:] * later, case.guard.torso[k][::-1] * (-1.0, 1.0) * case.guard.shoulder[k]
        found.append((to_segment(at, middle - across, middle + across), case.guard.radius[k] + RADIUS))
    found += [(to_segment(at, row[:2], row[2:4]), row[4] + RADIUS) for row in case.barriers]
    lengths = [(vector, float(np.hypot(*vector)), radii) for vector, radii in found]
    return [(vector / length if length else np.array([1.0, 0.0]), length - radii) for vector, length, radii in lengths]


def random_situation(rng: np.random.Generator, **rules: float) -> Situation:
    """People, two walls and a disc around the robot, none of which it overlaps with by more than 5 cm."""
    people, walls = [], []
    while len(people) < 3:
        person = (*rng.uniform(-1, 1, 2), *rng.uniform(-2, 2, 2), rng.uniform(-3, 3), rng.uniform(0.1, 0.2), 0.1)
        if np.hypot(*person[:2]) > RADIUS + person[5] + 0.05:
            people.append(person)
    while len(walls) < 3:
        start, end = rng.uniform(-0.8, 0.8, (2, 2))
        wall = (*start, *(end if len(walls) < 2 else start), rng.choice([0.0, 0.1]))
        if outlines(situation(walls=[wall]), np.zeros(2))[0][1] > -0.05:
            walls.append(wall)
    velocity = tuple(rng.uniform(-1, 1, 2))
    return situation(people, walls, velocity=velocity, owners=[0, 0, 2], **rules)  # type: ignore[arg-type]


@pytest.mark.parametrize("speed", [0.2, 3.0])
def test_what_can_come_near_within_a_tick_is_near(speed: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(CASES):
        case = random_situation(rng, speed=speed, reach=rng.uniform(0.0, 0.3))
        people, walls = near(case)
        reach = max(speed, float(np.hypot(*case.bodies[-1, 2:]))) * 0.1
        gaps = [gap for _, gap in outlines(case, np.zeros(2))]
        discs = [
            float(np.hypot(*row[:2])) - RADIUS - case.guard.radius[k] - 0.1 for k, row in enumerate(case.bodies[:3])
        ]
        assert people == [k for k, gap in enumerate(discs) if gap < reach + case.rules[HUMAN_RANGE]]
        assert walls == [k for k, gap in enumerate(gaps[3:]) if gap < reach + 0.1]


@pytest.mark.parametrize("holonomic", [1, 0])
@pytest.mark.parametrize("guard", [1, 0])
def test_a_velocity_is_reduced_where_it_would_close_a_gap_and_only_there(holonomic: int, guard: int) -> None:
    rng = np.random.default_rng(2)
    slides = 0
    for _ in range(CASES):
        case = random_situation(rng, guard=guard, holonomic=holonomic, speed=9.0)  # all are near
        wanted = rng.uniform(-6, 6, 2)
        velocity, _, is_reduced = drive(case, *wanted)
        before, after = (outlines(case, at, H) for at in (np.zeros(2), velocity * H))
        depth = 0.0 if guard else 0.5 * float(np.hypot(*wanted)) * H
        limits = []
        for k, ((normal, gap), (_, new_gap)) in enumerate(zip(before, after, strict=True)):
            allowed = 0.0
            if k < 3 and not guard:
                free = min(gap_to_walls(case, k), depth)
                allowed = max(free, 0.0)
            assert new_gap >= min(gap, -allowed) - 1e-8
            limits.append((normal, max(gap + allowed, 0.0) / H))
        broken = [(normal, limit) for normal, limit in limits if wanted @ normal > limit + 1e-9]
        assert bool((velocity == wanted).all()) == (not broken)
        assert is_reduced == bool(guard and broken)
        if not holonomic and broken:  # slowed down as little as possible
            fraction = float(velocity @ wanted / (wanted @ wanted))
            np.testing.assert_allclose(velocity, fraction * wanted, atol=1e-12)
            assert fraction == pytest.approx(min(limit / (wanted @ normal) for normal, limit in broken))
        if holonomic and len(broken) == 1:
            ((normal, limit),) = broken
            slid = wanted - (wanted @ normal - limit) * normal
            if all(slid @ other <= bound + 1e-9 for other, bound in limits):
                np.testing.assert_allclose(velocity, slid, atol=1e-8)
                slides += 1
    assert slides > 50 or not holonomic


def gap_to_walls(case: Situation, k: int) -> float:
    """Gap between the outline of a person at the end of the substep and the nearest wall."""
    middle = case.bodies[k, :2] + case.bodies[k, 2:] * H
    across = case.guard.torso[k][::-1] * (-1.0, 1.0) * case.guard.shoulder[k]
    a, b = middle - across, middle + across
    gaps = []
    for wall in case.barriers:
        c, d = wall[:2], wall[2:4]
        pairs = ((a, c, d), (b, c, d), (c, a, b), (d, a, b))
        sides = [np.linalg.det([end - start, point - start]) for point, start, end in pairs]
        crosses = sides[0] * sides[1] < 0.0 and sides[2] * sides[3] < 0.0
        gaps.append((0.0 if crosses else min(float(np.hypot(*to_segment(*pair))) for pair in pairs)) - wall[4])
    return min(gaps) - float(case.guard.radius[k])


@pytest.mark.parametrize("guard", [1, 0])
def test_contacts_and_faults_are_those_of_a_plain_loop(guard: int) -> None:
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(CASES):
        case = random_situation(rng, guard=guard, speed=9.0)
        wanted = rng.uniform(-2, 2, 2)
        velocity, _, _ = drive(case, *wanted)
        found = outlines(case, np.zeros(2), H)
        expected = []
        for k, (normal, gap) in enumerate(found):
            closing, others = wanted @ normal, 0.0
            if k < 3:
                others = -case.bodies[k, 2:] @ normal
            else:  # of the nearest edge of the same object
                edges = [3, 4] if k < 5 else [5]
                closing = wanted @ found[min(edges, key=lambda edge: found[edge][1])][0]
            touches = gap - velocity @ normal * H < NEAR
            expected.append(touches * (TOUCHED + BY_ROBOT * (closing > 0.01) + BY_OTHER * (others > 0.01)))
        bits = [*case.guard.human_contact.tolist(), *case.guard.barrier_contact.tolist()]
        assert bits == expected
        assert case.guard.counts[2] == any(bits)
        seen |= {(k < 3, bit) for k, bit in enumerate(bits)}
    assert seen == {(True, bit) for bit in (0, 1, 3, 5, 7)} | {(False, bit) for bit in (0, 1, 3)}


@pytest.mark.parametrize(
    ("velocity", "degrees", "push"),
    [
        ((0.0, 0.0), 0, 0.5),  # equal masses share the velocity
        ((0.5, 0.0), 0, 0.75),
        ((1.0, 0.0), 0, 1.0),  # it moves away as fast
        ((-0.5, 0.0), 0, 0.25),
        ((-1.5, 0.0), 0, 0.0),  # it is not pushed back
        ((0.0, 0.0), 60, 0.875),
        ((0.0, 0.0), 90, 1.0),
    ],
)
def test_a_robot_without_guard_keeps_the_share_of_an_inelastic_collision(
    velocity: tuple[float, float], degrees: float, push: float
) -> None:
    """The robot overlaps with the person after three quarters of the substep; velocities in units of its speed."""
    angle, speed = math.radians(degrees), 0.8
    place = RADIUS + 0.15 + (0.75 * math.cos(angle) - velocity[0]) * speed * H
    case = situation([(place, 0.0, velocity[0] * speed, velocity[1] * speed, 0.0, 0.15, 0.0)], guard=0)
    _, share, is_reduced = drive(case, math.cos(angle) * speed, math.sin(angle) * speed)
    assert share == pytest.approx(push)
    assert not is_reduced


def test_a_person_who_is_pressed_against_a_wall_stops_a_robot_without_guard() -> None:
    person = (RADIUS + 0.15, 0.0, 0.0, 0.0, 0.0, 0.15, 0.1)
    for gap, fraction in ((0.0, 0.0), (0.004, 0.2), (0.01, 0.5), (0.5, 0.5)):  # overlap of half its motion at most
        case = situation([person], [(place := RADIUS + 0.3 + gap, -1.0, place, 1.0, 0.0)], guard=0)
        velocity, _, is_reduced = drive(case, 1.0, 0.0)
        np.testing.assert_allclose(velocity, (fraction, 0.0), atol=1e-9)
        assert not is_reduced


def test_a_robot_that_no_outline_is_near_is_free() -> None:
    for guard in (0, 1):
        velocity, push, is_reduced = drive(situation(guard=guard), 1.0, 0.5)
        assert velocity.tolist() == [1.0, 0.5]
        assert (push, is_reduced) == (1.0 - guard, False)


def test_a_robot_that_is_wedged_in_stops() -> None:
    """Between walls at 20 degrees to each other, to which no velocity with a component into the corner keeps."""
    y, x = RADIUS * math.cos(math.radians(10)), RADIUS * math.sin(math.radians(10))
    walls = [(x - 2.0 * y, sign * (y + 2.0 * x), x + 2.0 * y, sign * (y - 2.0 * x), 0.0) for sign in (1, -1)]
    velocity, _, is_reduced = drive(situation(walls=walls), 1.0, 0.3)
    assert velocity.tolist() == [0.0, 0.0]
    assert is_reduced


def test_a_robot_at_the_core_of_an_outline_moves_away_from_it_only() -> None:
    """The normal of an outline whose core the robot's centre has reached is x."""
    case = situation(walls=[(-1.0, 0.0, 1.0, 0.0, 0.1)])
    assert drive(case, 1.0, 0.5)[0].tolist() == [0.0, 0.5]
    assert drive(case, -1.0, 0.5)[0].tolist() == [-1.0, 0.5]
