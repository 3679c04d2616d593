"""`CrowdState`: everything that pedestrians know and intend, as one named tuple of arrays for kernels."""

from __future__ import annotations

from typing import NamedTuple

from ...core.compiled.packing import Bools, Floats, Floats2, Ints
from ...core.philox import Draws
from .doorways import Doorways
from .idling import POSTURES, Idling
from .models.base import Walkers
from .orientation import GLANCES, Glances
from .passages import Passages
from .reactions import Reactions
from .robots import Robots
from .routes import Routes
from .social.company import Company
from .social.fixtures import Fixtures, Habits
from .social.tasks import Lines, Meetings, Tasks
from .wayfinding import Journeys, Obstacles

PLACES, COMPANY, WAYS = 0, 1, 3  # purposes of random numbers, besides `GLANCES` and `POSTURES`
PURPOSES = 5
assert (GLANCES, POSTURES) == (2, 4)


class Intentions(NamedTuple):
    """Intentions of the pedestrians in a tick.

    Attributes:
        preferred_speed: (N,), m/s; walking groups have the speed of their slowest member.
        robot_in_sight: (N,) of bool, whether the robot that a pedestrian heeds is in its sight.
        standing_position: (N, 2), m, to which standing pedestrians return if they are pushed.
        facing, gaze: (N, 2), unit vectors of the desired headings and gazes.
        walking_acceleration: (N, 2), m/s^2, by the pedestrian model.
        acceleration: (N, 2), m/s^2, of all.
        wanted_twist: (N,), rad, by which the shoulders should be turned from the direction of the feet.
        twist: (N,), rad, by which they are turned.
        twist_rate: (N,), rad/s, at which this angle changes.
    """

    preferred_speed: Floats
    robot_in_sight: Bools
    standing_position: Floats2
    facing: Floats2
    gaze: Floats2
    walking_acceleration: Floats2
    acceleration: Floats2
    wanted_twist: Floats
    twist: Floats
    twist_rate: Floats


class Calls(NamedTuple):
    """Addresses of the kernels that kernels of pedestrians call, see `core.compiled.calls`."""

    find_path: Ints
    check_place: Ints
    check_line: Ints
    plan_path: Ints
    send: Ints
    stand: Ints
    leave: Ints
    start_stay: Ints
    update_partners: Ints
    start_straight: Ints
    find_obstacles: Ints
    advance_tasks: Ints
    start_stops: Ints
    avoid_queues: Ints
    choose_destination: Ints
    find_new_paths: Ints
    prepare: Ints
    accelerate: Ints
    refresh: Ints


class Law(NamedTuple):
    """The pedestrian model of a crowd.

    Attributes:
        kernel: address of a `KernelModel.kernel`; zeros for a model in ordinary Python.
        packed_walkers: `CrowdState.walkers`, packed.
        packed_parameters: of the kernel.
        is_headed: whether pedestrians walk where their bodies face.
        evaluations: number of evaluations in a tick.
        interval: between them, s.
    """

    kernel: Ints
    packed_walkers: Ints
    packed_parameters: Ints
    is_headed: bool
    evaluations: int
    interval: float


class CrowdState(NamedTuple):
    """State of a crowd of N pedestrians.

    Attributes:
        robots: of the scene; whoever calls `crowd.prepare` sets their state before.
        is_present: (N,) of bool.
        needed: (2,) of int, lengths of the lists of neighbours and walls that the last tick needed.
        in_file: (N,) of bool, pedestrians that lead or follow another one.
        rolls: (N,) of bool, pedestrians that cannot move sideways.
    """

    robots: Robots
    obstacles: Obstacles
    doorways: Doorways
    routes: Routes
    journeys: Journeys
    fixtures: Fixtures
    habits: Habits
    tasks: Tasks
    lines: Lines
    meetings: Meetings
    passages: Passages
    company: Company
    reactions: Reactions
    glances: Glances
    idling: Idling
    intentions: Intentions
    walkers: Walkers
    draws: Draws
    law: Law
    is_present: Bools
    needed: Ints
    in_file: Bools
    rolls: Bools
    calls: Calls
