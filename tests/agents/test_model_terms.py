"""The force terms of the published models and the shared ones, compared with calculations by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.agents.pedestrians.models import base, farina2017, helbing1995, helbing2000, moussaid2009, orca2011
from sonata2d.agents.pedestrians.models.base import Walkers
from sonata2d.agents.pedestrians.models.moussaid2009 import excess_radius_of, interaction_acceleration
from sonata2d.core.geometry import Barriers
from sonata2d.core.portable_math import Array

from ..conftest import beside_walls, neighbour_lists

WALL = Barriers.of([((-5.0, 0.0), (5.0, 0.0), 0.0)])
EAST, WEST = (1.0, 0.0), (-1.0, 0.0)
MOUSSAID, HELBING = moussaid2009.PARAMETERS, helbing2000.PARAMETERS


def agents(
    position: list[list[float]], velocity: list[list[float]] | None = None, group: int = 0, radius: float = 0.2
) -> Walkers:
    """Agents that head and face east and attend to each other; the first ones are a group."""
    count = len(position)
    east = np.tile([EAST], (count, 1))
    return Walkers(
        position=np.array(position),
        velocity=np.zeros((count, 2)) if velocity is None else np.array(velocity),
        desired_direction=east,
        body_direction=east,
        desired_speed=np.full(count, 1.3),
        radius=np.full(count, radius),
        walks=np.ones(count, dtype=bool),
        **neighbour_lists(1.0 - np.eye(count)),
        group=np.where(np.arange(count) < group, 0, -1),
        is_abreast=np.ones(count, dtype=bool),
        shoulder=np.zeros(count),
        headway=np.ones(count),
        politeness=np.ones(count),
        heed=np.zeros(count),
        steering=np.zeros((count, 2)),
    )


# Terms that all models share


def test_driving_force_reaches_the_desired_velocity_in_the_relaxation_time() -> None:
    walkers = agents([[0.0, 0.0]], [[0.5, 0.0]])
    assert base.desired_acceleration(walkers, 0, EAST, 0.5) == pytest.approx((1.6, 0.0))
    with pytest.raises(ValueError, match="positive"):
        base.desired_acceleration(walkers, 0, EAST, 0.0)


@pytest.mark.parametrize("body", [EAST, WEST])
def test_standing_pedestrians_return_without_overshoot(body: tuple[float, float]) -> None:
    x, y, vx, vy = 0.3, -0.2, 0.0, 0.0
    for _ in range(500):
        ax, ay = base.standing_acceleration(x, y, vx, vy, 0.0, 0.0, *body)
        vx, vy = vx + 0.01 * ax, vy + 0.01 * ay
        x, y = x + 0.01 * vx, y + 0.01 * vy
        assert x > -1e-3
        assert y < 1e-3
    assert max(x, -y) < 0.01


def test_standing_pedestrians_step_ahead_faster_than_sideways_and_back() -> None:
    fastest = []
    for body in (WEST, (0.0, 1.0), EAST):
        x, vx = 2.0, 0.0
        speeds = []
        for _ in range(400):
            vx += 0.01 * base.standing_acceleration(x, 0.0, vx, 0.0, 0.0, 0.0, *body)[0]
            x += 0.01 * vx
            speeds.append(-vx)
        fastest.append(max(speeds))
    assert fastest == pytest.approx([2 * base.STEP_SPEED, base.STEP_SPEED, base.STEP_SPEED], rel=0.05)


def test_walls_repel_perpendicularly_and_by_the_gap() -> None:
    walkers = beside_walls(agents([[0.0, 0.3], [1.0, -0.5]]), WALL)
    above, below = (base.wall_acceleration(walkers, i, WALL.table, 0.2, 3.0, 0.1) for i in range(2))
    assert above == pytest.approx((0.0, 3.0 * math.exp(-1.0)), abs=1e-6)
    assert below == pytest.approx((0.0, -3.0 * math.exp(-3.0)), abs=1e-6)


# moussaid2009


def test_moussaid2009_interaction_by_hand() -> None:
    """Two people 1 m apart, side by side, one walking at 1 m/s across the other's front: D = (2, 0) + (0, 1)."""
    d = math.sqrt(5.0)
    t, b = np.array([2.0, 1.0]) / d, 0.35 * d
    theta = math.atan2(t[0] * 1.0 - t[1] * 0.0, t[1]) + 0.005 * b
    decay = math.exp(-1.0 / b)
    left = np.array([-t[1], t[0]])
    by_hand = -4.5 * decay * (math.exp(-((3 * b * theta) ** 2)) * t + math.exp(-((2 * b * theta) ** 2)) * left)
    found = interaction_acceleration(0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, MOUSSAID)
    assert found == pytest.approx(by_hand, abs=1e-6)


def test_moussaid2009_larger_bodies_repel_from_farther_away() -> None:
    people, robot = (
        interaction_acceleration(1.5, 0.0, 1.3, 0.0, excess_radius_of(0.2, radius), 1.0, 1.0, MOUSSAID)
        for radius in (0.2, 0.4)
    )
    assert robot == pytest.approx(interaction_acceleration(1.3, 0.0, 1.3, 0.0, 0.0, 1.0, 1.0, MOUSSAID))
    assert math.hypot(*robot) > math.hypot(*people)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_moussaid2009_head_on_encounters_are_evaded_to_the_biased_side(side: float) -> None:
    eastbound = interaction_acceleration(3.0, 0.0, 2.6, 0.0, 0.0, 1.0, side, MOUSSAID)
    westbound = interaction_acceleration(-3.0, 0.0, -2.6, 0.0, 0.0, 1.0, side, MOUSSAID)
    assert eastbound[1] * side < 0.0  # for a walker along +x, right is -y
    assert westbound[1] * side > 0.0


def test_moussaid2010_separated_members_close_up_and_wait() -> None:
    walkers = agents([[0.0, 0.0], [-2.0, 0.0], [5.0, 5.0]], [[1.0, 0.0]] * 3, group=2)
    found = [moussaid2009.group_acceleration(walkers, i, MOUSSAID.group) for i in range(3)]
    assert found[0][0] == pytest.approx(-4.0 - 3.0)  # brakes for the member behind, and is pulled back
    assert found[1][0] == pytest.approx(3.0)
    assert found[2] == (0.0, 0.0)


# helbing1995


def test_helbing1995_elliptical_repulsion_by_hand() -> None:
    """The first agent stands 1 m to the left of the middle of a step of 2 m of the second, which walks at 1 m/s."""
    step = helbing1995.next_step(agents([[0.0, 0.0]], [[1.0, 0.0]]), 0, helbing1995.PARAMETERS)
    assert step == (2.0, 0.0, 2.0)
    found = helbing1995.elliptical_acceleration(1.0, 1.0, *step, (0.0, -1.0), 1.0, helbing1995.PARAMETERS)
    to_focus = math.sqrt(2.0)  # to either focus: a + c = 2 sqrt 2, 2b = 2
    by_hand = 2.1 / 0.3 * math.exp(-1.0 / 0.3) * (2.0 * to_focus) / 4.0 * (2.0 / to_focus)
    assert found == pytest.approx((0.0, by_hand), abs=1e-6)


def test_helbing1995_agents_out_of_sight_count_half() -> None:
    towards, away = (
        helbing1995.elliptical_acceleration(1.0, 0.0, 0.0, 0.0, 0.0, direction, 1.0, helbing1995.PARAMETERS)
        for direction in (WEST, EAST)
    )
    assert towards == pytest.approx((2.1 / 0.3 * math.exp(-1.0 / 0.3), 0.0), abs=1e-6)
    assert away == pytest.approx((0.5 * towards[0], 0.0))


# helbing2000


@pytest.mark.parametrize("gap", [0.1, -0.02])
def test_helbing2000_compression_and_friction_by_hand(gap: float) -> None:
    """The second agent, to the right, slides upwards past the first, which is dragged along where they touch."""
    pair = agents([[0.0, 0.0], [0.4 + gap, 0.0]], [[0.0, 0.0], [0.3, 0.8]])
    first, second = (helbing2000.contact_acceleration(pair, i, HELBING) for i in (0, 1))
    overlap = max(-gap, 0.0)
    push = (2000.0 * math.exp(-gap / 0.08) + 1.2e5 * overlap) / 80.0
    assert first == pytest.approx((-push, 2.4e5 * overlap * 0.8 / 80.0), rel=1e-5)
    assert second == pytest.approx((-first[0], -first[1]))


@pytest.mark.parametrize("gap", [0.1, -0.02])
def test_helbing2000_walls_press_and_brake_by_hand(gap: float) -> None:
    walkers = agents([[0.0, 0.2 + gap]], [[1.1, -0.2]])
    found = helbing2000.wall_contact_acceleration(beside_walls(walkers, WALL), 0, WALL.table, HELBING)
    overlap = max(-gap, 0.0)
    push = (2000.0 * math.exp(-gap / 0.08) + 1.2e5 * overlap) / 80.0
    assert found == pytest.approx((-2.4e5 * overlap * 1.1 / 80.0, push), rel=1e-5)


# farina2017


def test_farina2017_the_drive_acts_ahead_only_and_slip_is_damped() -> None:
    drive, others, velocity = (1.0, 2.0), (0.3, -0.4), (0.5, 0.1)
    found = farina2017.headed_acceleration(drive, others, velocity, (0.0, 1.0), farina2017.PARAMETERS)
    assert found == pytest.approx((0.3 - 500.0 / 75.0 * 0.5, 2.0 - 0.4))  # faces +y, so its left is -x


def test_farina2017_a_group_pulls_only_beyond_its_distances() -> None:
    """Three abreast, heading east; the third has fallen 4.5 m behind: the centre is 1.5 m behind the first two."""
    walkers = agents([[0.0, 0.3], [0.0, -0.3], [-4.5, 0.0], [9.0, 9.0]], group=3)
    pull = [farina2017.headed_group_acceleration(walkers, i, EAST, farina2017.PARAMETERS) for i in range(4)]
    to_first = math.sqrt(1.5 * 1.5 + 0.3 * 0.3)
    assert pull[0] == pytest.approx((-200.0 / 75.0 * 1.5 / to_first, 0.0))
    assert pull[2] == pytest.approx((200.0 / 75.0, 0.0))
    assert pull[3] == (0.0, 0.0)


# orca2011


def test_orca2011_half_plane_at_a_leg_of_the_cone_by_hand() -> None:
    """Head-on, 2 m apart, radii 0.2, closing at 2.6 m/s: the smallest change is perpendicular to a leg of the cone."""
    a, b, c = orca2011.reciprocal_half_plane(2.0, 0.0, (1.3, 0.0), (-1.3, 0.0), 0.4, 0.5, 2.0, 0.1)
    sine = 0.4 / 2.0
    normal = np.array([-sine, -math.sqrt(1.0 - sine * sine)])
    assert (a, b) == pytest.approx(normal)
    assert c == pytest.approx(normal[0] * 1.3 + 0.5 * 2.6 * sine)


def test_orca2011_half_plane_at_the_arc_by_hand() -> None:
    """4 m apart, at rest: contact at the end of 2 s would take (4 - 0.4) / 2 m/s; each agent may use half of that."""
    plane = orca2011.reciprocal_half_plane(4.0, 0.0, (0.0, 0.0), (0.0, 0.0), 0.4, 0.5, 2.0, 0.1)
    assert plane == pytest.approx((-1.0, 0.0, -0.9))


def test_orca2011_walls_permit_the_speed_that_reaches_them_at_the_horizon() -> None:
    apart, overlapping = (orca2011.wall_half_plane(WALL.table, 0, 0.0, y, 0.2, 1.0, 0.1) for y in (0.8, 0.15))
    assert apart == pytest.approx((0.0, 1.0, -0.6))
    assert overlapping == pytest.approx((0.0, 1.0, 0.5))  # it overlaps by 5 cm and must leave in one tick


# The linear program of orca2011, compared with a search of all velocities on a grid

STEP = 0.01
AXIS = np.arange(-1.5, 1.5 + STEP / 2, STEP)
GRID = np.stack(np.meshgrid(AXIS, AXIS), axis=-1).reshape(-1, 2)
NONE = np.zeros((0, 3))


def random_planes(rng: np.random.Generator, count: int, low: float, high: float) -> Array:
    """Half-planes, (count, 3), with edges `low` to `high` m/s from zero velocity; negative where zero is permitted."""
    angle, minimum = rng.uniform(0.0, 2 * np.pi, count), rng.uniform(low, high, count)
    return np.stack((np.cos(angle), np.sin(angle), minimum), axis=1)


def violations(planes: Array, velocity: Array) -> Array:
    """By how much each velocity, (K, 2), violates each half-plane, (P, K), m/s."""
    return planes[:, 2:] - planes[:, :2] @ velocity.T


def chosen(hard: Array, soft: Array, preferred: tuple[float, float], maximum_speed: float) -> Array:
    """The velocity (2,) that `choose_velocity` chooses, m/s."""
    planes = np.concatenate((hard, soft))
    return np.array(orca2011.choose_velocity(planes, len(hard), preferred, maximum_speed, np.empty_like(planes)))


@pytest.mark.parametrize("seed", range(40))
def test_nearest_velocity_is_the_nearest_on_a_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    planes = random_planes(rng, int(rng.integers(1, 9)), -1.0, 0.3)
    preferred = (float(rng.uniform(-1.5, 1.5)), float(rng.uniform(-1.5, 1.5)))
    *found, satisfied = orca2011.nearest_velocity(planes, preferred, 1.3)
    permitted = GRID[(violations(planes, GRID).max(axis=0) <= 0.0) & (np.linalg.norm(GRID, axis=1) <= 1.3)]
    if satisfied < len(planes):
        assert len(permitted) < 20  # nothing, or a sliver between grid points
        return
    assert violations(planes, np.array([found])).max() < 1e-9
    assert np.linalg.norm(found) < 1.3 + 1e-9
    if len(permitted):
        best = np.linalg.norm(permitted - preferred, axis=1).min()
        assert np.linalg.norm(np.subtract(found, preferred)) < best + 1e-9


@pytest.mark.parametrize("seed", range(40))
def test_conflicting_planes_give_the_smallest_violation_on_a_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hard, soft = random_planes(rng, 2, -0.5, 0.0), random_planes(rng, int(rng.integers(3, 12)), 0.2, 1.0)
    found = chosen(hard, soft, (1.0, 0.2), 1.3)[None]
    assert violations(hard, found).max() < 1e-9
    assert np.linalg.norm(found) < 1.3 + 1e-9
    permitted = GRID[(violations(hard, GRID).max(axis=0) <= 0.0) & (np.linalg.norm(GRID, axis=1) <= 1.3)]
    best = max(violations(soft, permitted).max(axis=0).min(), 0.0)
    assert best - 1.5 * STEP < max(violations(soft, found).max(), 0.0) < best + 1e-6


def test_a_permitted_velocity_is_kept_and_a_fast_one_is_cut() -> None:
    assert chosen(NONE, np.array([[0.0, 1.0, -1.0]]), (0.5, 0.25), 1.3).tolist() == [0.5, 0.25]
    assert chosen(NONE, NONE, (3.0, 4.0), 1.0) == pytest.approx((0.6, 0.8))


def test_the_order_of_half_planes_does_not_change_the_choice() -> None:
    planes = random_planes(np.random.default_rng(3), 8, -0.8, 0.1)
    forward, backward = (chosen(NONE, order, (1.2, 0.3), 1.3) for order in (planes, planes[::-1]))
    assert forward == pytest.approx(backward, abs=1e-9)
