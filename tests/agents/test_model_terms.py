"""The force terms of the published models and the shared ones, compared with calculations by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonata2d.agents.pedestrians.models import base, farina2017, helbing1995, helbing2000, moussaid2009, orca2011
from sonata2d.agents.pedestrians.models.moussaid2009 import interaction_acceleration, pair_excess_radius
from sonata2d.core.entities import Wall
from sonata2d.core.geometry import Barriers
from sonata2d.core.portable_math import Array

from ..conftest import L_SHAPE, room

WALL = Barriers.of([((-5.0, 0.0), (5.0, 0.0), 0.0)])
EAST = np.array([[1.0, 0.0]])
EAST_AND_WEST, BOTH_EAST = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([[1.0, 0.0], [1.0, 0.0]])
BOTH = 1.0 - np.eye(2)  # weights of a pair that attend to each other
MOUSSAID = moussaid2009.Moussaid2009()

# Terms that all models share


def test_driving_force_reaches_the_desired_velocity_in_the_relaxation_time() -> None:
    found = base.desired_acceleration(np.array([[0.5, 0.0]]), EAST, np.array([1.3]), relaxation_time=0.5)
    assert found[0] == pytest.approx((1.6, 0.0))
    with pytest.raises(ValueError, match="positive"):
        base.desired_acceleration(found, found, np.array([1.3]), relaxation_time=0.0)


def test_standing_pedestrians_return_without_overshoot() -> None:
    position, velocity = np.array([[0.3, 0.0]]), np.zeros((1, 2))
    for _ in range(400):
        velocity = velocity + 0.01 * base.standing_acceleration(position, velocity, np.zeros((1, 2)))
        position = position + 0.01 * velocity
        assert position[0, 0] > -1e-3
    assert position[0, 0] < 0.01


def test_walls_repel_perpendicularly_and_by_the_gap() -> None:
    position, radius = np.array([[0.0, 0.3], [1.0, -0.5]]), np.array([0.2, 0.2])
    found = base.wall_acceleration(position, radius, WALL, strength=3.0, decay_length=0.1)
    assert found[0] == pytest.approx((0.0, 3.0 * math.exp(-1.0)), abs=1e-6)
    assert found[1] == pytest.approx((0.0, -3.0 * math.exp(-3.0)), abs=1e-6)


def test_walls_block_the_line_of_sight() -> None:
    scene = room(polygon=L_SHAPE, inner=[Wall((-4.0, -2.0), (-1.0, -2.0))])
    position = np.array([[-3.0, 3.0], [3.0, -0.5], [-3.0, -1.0], [-3.0, -3.0]])
    visible = base.LineOfSight(scene, 4).visible(position)
    assert not visible[0, 1]  # round the corner of the L
    assert visible[0, 2]
    assert not visible[2, 3]  # through the inner wall
    assert np.array_equal(visible, visible.T)


def test_the_walls_of_a_square_room_block_no_view() -> None:
    assert base.LineOfSight(room(), 2).visible(np.array([[-3.0, -3.0], [3.0, 3.0]])).all()


# moussaid2009


def test_moussaid2009_interaction_by_hand() -> None:
    """Two people 1 m apart, side by side, one walking at 1 m/s across the other's front: D = (2, 0) + (0, 1)."""
    position, velocity = np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([[1.0, 0.0], [0.0, 0.0]])
    d = math.sqrt(5.0)
    t, b = np.array([2.0, 1.0]) / d, 0.35 * d
    theta = math.atan2(t[0] * 1.0 - t[1] * 0.0, t[1]) + 0.005 * b
    decay = math.exp(-1.0 / b)
    left = np.array([-t[1], t[0]])
    by_hand = -4.5 * decay * (math.exp(-((3 * b * theta) ** 2)) * t + math.exp(-((2 * b * theta) ** 2)) * left)
    found = interaction_acceleration(position, velocity, BOTH, np.zeros((2, 2)), 1, MOUSSAID)
    assert found[0] == pytest.approx(by_hand, abs=1e-6)


def test_moussaid2009_larger_bodies_repel_from_farther_away() -> None:
    position, velocity = np.array([[0.0, 0.0], [1.5, 0.0]]), np.array([[1.3, 0.0], [0.0, 0.0]])
    found = {
        r: interaction_acceleration(position, velocity, BOTH, pair_excess_radius(np.array([0.2, r])), 1, MOUSSAID)
        for r in (0.2, 0.4)
    }
    nearer = interaction_acceleration(position * (1.3 / 1.5), velocity, BOTH, np.zeros((2, 2)), 1, MOUSSAID)
    assert found[0.4][0] == pytest.approx(nearer[0])
    assert np.linalg.norm(found[0.4][0]) > np.linalg.norm(found[0.2][0])


@pytest.mark.parametrize("side", [1, -1])
def test_moussaid2009_head_on_encounters_are_evaded_to_the_biased_side(side: int) -> None:
    position, velocity = np.array([[0.0, 0.0], [3.0, 0.0]]), np.array([[1.3, 0.0], [-1.3, 0.0]])
    found = interaction_acceleration(position, velocity, BOTH, np.zeros((2, 2)), side, MOUSSAID)
    assert found[0, 1] * side < 0.0  # for a walker along +x, right is -y
    assert found[1, 1] * side > 0.0


def test_moussaid2010_separated_members_close_up_and_wait() -> None:
    position = np.array([[0.0, 0.0], [-2.0, 0.0], [5.0, 5.0]])
    direction = np.tile(EAST, (3, 1))
    member = np.zeros((3, 3))
    member[0, 1] = member[1, 0] = 1.0
    found = moussaid2009.group_acceleration(position, direction, direction, member, moussaid2009.Moussaid2010())
    assert found[0, 0] == pytest.approx(-4.0 - 3.0)  # brakes for the member behind, and is pulled back
    assert found[1, 0] == pytest.approx(3.0)
    assert found[2].tolist() == [0.0, 0.0]


# helbing1995


def test_helbing1995_elliptical_repulsion_by_hand() -> None:
    """The first agent stands 1 m to the left of the middle of a step of 2 m of the second, which walks at 1 m/s."""
    position, velocity = np.array([[1.0, 1.0], [0.0, 0.0]]), np.array([[0.0, 0.0], [1.0, 0.0]])
    direction = np.array([[0.0, -1.0], [1.0, 0.0]])
    found = helbing1995.elliptical_acceleration(position, velocity, direction, BOTH, helbing1995.Helbing1995())
    to_focus = math.sqrt(2.0)  # to either focus: a + c = 2 sqrt 2, 2b = 2
    by_hand = 2.1 / 0.3 * math.exp(-1.0 / 0.3) * (2.0 * to_focus) / 4.0 * (2.0 / to_focus)
    assert found[0] == pytest.approx((0.0, by_hand), abs=1e-6)


def test_helbing1995_agents_out_of_sight_count_half() -> None:
    position, velocity = np.array([[1.0, 0.0], [0.0, 0.0]]), np.zeros((2, 2))
    towards, away = (
        helbing1995.elliptical_acceleration(position, velocity, direction, BOTH, helbing1995.Helbing1995())[0]
        for direction in (EAST_AND_WEST[::-1], BOTH_EAST)
    )
    assert towards == pytest.approx((2.1 / 0.3 * math.exp(-1.0 / 0.3), 0.0), abs=1e-6)
    assert away == pytest.approx(0.5 * towards)


# helbing2000


@pytest.mark.parametrize("gap", [0.1, -0.02])
def test_helbing2000_compression_and_friction_by_hand(gap: float) -> None:
    """The second agent, to the right, slides upwards past the first, which is dragged along where they touch."""
    position = np.array([[0.0, 0.0], [0.4 + gap, 0.0]])
    velocity = np.array([[0.0, 0.0], [0.3, 0.8]])
    found = helbing2000.contact_acceleration(position, velocity, np.full(2, 0.2), BOTH, helbing2000.Helbing2000())
    overlap = max(-gap, 0.0)
    push = (2000.0 * math.exp(-gap / 0.08) + 1.2e5 * overlap) / 80.0
    assert found[0] == pytest.approx((-push, 2.4e5 * overlap * 0.8 / 80.0), rel=1e-5)
    assert found[1] == pytest.approx(-found[0])


@pytest.mark.parametrize("gap", [0.1, -0.02])
def test_helbing2000_walls_press_and_brake_by_hand(gap: float) -> None:
    position, velocity = np.array([[0.0, 0.2 + gap], [0.0, 3.0]]), np.array([[1.1, -0.2], [0.0, 0.0]])
    found = helbing2000.wall_contact_acceleration(position, velocity, np.full(2, 0.2), WALL, helbing2000.Helbing2000())
    overlap = max(-gap, 0.0)
    push = (2000.0 * math.exp(-gap / 0.08) + 1.2e5 * overlap) / 80.0
    assert found[0] == pytest.approx((-2.4e5 * overlap * 1.1 / 80.0, push), rel=1e-5)


# farina2017


def test_farina2017_the_drive_acts_ahead_only_and_slip_is_damped() -> None:
    drive, others = np.array([[1.0, 2.0]]), np.array([[0.3, -0.4]])
    velocity, direction = np.array([[0.5, 0.1]]), np.array([[0.0, 1.0]])  # faces +y, so its left is -x
    found = farina2017.headed_acceleration(drive, others, velocity, direction, farina2017.Farina2017())
    assert found[0] == pytest.approx((0.3 - 500.0 / 75.0 * 0.5, 2.0 - 0.4))


def test_farina2017_a_group_pulls_only_beyond_its_distances() -> None:
    """Three abreast, heading east; the third has fallen 4.5 m behind: the centre is 1.5 m behind the first two."""
    position = np.array([[0.0, 0.3], [0.0, -0.3], [-4.5, 0.0], [9.0, 9.0]])
    member = np.zeros((4, 4))
    member[:3, :3] = 1.0 - np.eye(3)
    pull = farina2017.headed_group_acceleration(position, np.repeat(EAST, 4, axis=0), member, farina2017.Farina2017())
    to_first = math.sqrt(1.5 * 1.5 + 0.3 * 0.3)
    assert pull[0] == pytest.approx((-200.0 / 75.0 * 1.5 / to_first, 0.0))
    assert pull[2] == pytest.approx((200.0 / 75.0, 0.0))
    assert pull[3].tolist() == [0.0, 0.0]


# orca2011


def test_orca2011_half_plane_at_a_leg_of_the_cone_by_hand() -> None:
    """Head-on, 2 m apart, radii 0.2, closing at 2.6 m/s: the smallest change is perpendicular to a leg of the cone."""
    position, velocity = np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([[1.3, 0.0], [-1.3, 0.0]])
    half = np.full((2, 2), 0.5)
    planes = orca2011.reciprocal_half_planes(position, velocity, np.full(2, 0.2), BOTH, half, horizon=2.0, dt=0.1)
    sine = 0.4 / 2.0
    normal = np.array([-sine, -math.sqrt(1.0 - sine * sine)])
    assert (planes.x[1, 0], planes.y[1, 0]) == pytest.approx(normal)
    assert planes.minimum[1, 0] == pytest.approx(normal[0] * 1.3 + 0.5 * 2.6 * sine)


def test_orca2011_half_plane_at_the_arc_by_hand() -> None:
    """4 m apart, at rest: contact at the end of 2 s would take (4 - 0.4) / 2 m/s; each agent may use half of that."""
    position = np.array([[0.0, 0.0], [4.0, 0.0]])
    half = np.full((2, 2), 0.5)
    planes = orca2011.reciprocal_half_planes(
        position, np.zeros((2, 2)), np.full(2, 0.2), BOTH, half, horizon=2.0, dt=0.1
    )
    assert (planes.x[1, 0], planes.y[1, 0]) == pytest.approx((-1.0, 0.0))
    assert planes.minimum[1, 0] == pytest.approx(-0.9)


def test_orca2011_walls_permit_the_speed_that_reaches_them_at_the_horizon() -> None:
    planes = orca2011.wall_half_planes(np.array([[0.0, 0.8], [0.0, 0.15]]), np.full(2, 0.2), WALL, horizon=1.0, dt=0.1)
    assert planes.y[0] == pytest.approx((1.0, 1.0))
    assert planes.minimum[0] == pytest.approx((-0.6, 0.5))  # the second overlaps by 5 cm and must leave in one tick


# The linear program of orca2011, compared with a search of all velocities on a grid

STEP = 0.01
AXIS = np.arange(-1.5, 1.5 + STEP / 2, STEP)
GRID = np.stack(np.meshgrid(AXIS, AXIS), axis=-1).reshape(-1, 2)


def random_planes(rng: np.random.Generator, count: int, low: float, high: float) -> list[orca2011.HalfPlane]:
    """Half-planes with edges `low` to `high` m/s from zero velocity; negative where zero is permitted."""
    angle, minimum = rng.uniform(0.0, 2 * np.pi, count), rng.uniform(low, high, count)
    return [(float(np.cos(a)), float(np.sin(a)), float(c)) for a, c in zip(angle, minimum, strict=True)]


def violations(planes: list[orca2011.HalfPlane], velocity: Array) -> Array:
    """By how much each velocity, (K, 2), violates each half-plane, (P, K), m/s."""
    rows = np.array(planes).reshape(-1, 3)
    return rows[:, 2:] - rows[:, :2] @ velocity.T


@pytest.mark.parametrize("seed", range(40))
def test_nearest_velocity_is_the_nearest_on_a_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    planes = random_planes(rng, int(rng.integers(1, 9)), -1.0, 0.3)
    preferred = (float(rng.uniform(-1.5, 1.5)), float(rng.uniform(-1.5, 1.5)))
    found, satisfied = orca2011.nearest_velocity(planes, preferred, 1.3)
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
    found = np.array([orca2011.choose_velocity(hard, soft, (1.0, 0.2), 1.3)])
    assert violations(hard, found).max() < 1e-9
    assert np.linalg.norm(found) < 1.3 + 1e-9
    permitted = GRID[(violations(hard, GRID).max(axis=0) <= 0.0) & (np.linalg.norm(GRID, axis=1) <= 1.3)]
    best = max(violations(soft, permitted).max(axis=0).min(), 0.0)
    assert best - 1.5 * STEP < max(violations(soft, found).max(), 0.0) < best + 1e-6


def test_a_permitted_velocity_is_kept_and_a_fast_one_is_cut() -> None:
    assert orca2011.choose_velocity([], [(0.0, 1.0, -1.0)], (0.5, 0.25), 1.3) == (0.5, 0.25)
    assert orca2011.choose_velocity([], [], (3.0, 4.0), 1.0) == pytest.approx((0.6, 0.8))


def test_the_order_of_half_planes_does_not_change_the_choice() -> None:
    planes = random_planes(np.random.default_rng(3), 8, -0.8, 0.1)
    forward, backward = (orca2011.choose_velocity([], order, (1.2, 0.3), 1.3) for order in (planes, planes[::-1]))
    assert forward == pytest.approx(backward, abs=1e-9)
