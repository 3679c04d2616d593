"""`Crowd`: accelerations, body directions and gaze of all pedestrians at each tick."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache, cached_property
from itertools import accumulate
from typing import Any

import numpy as np

from ...core.compiled.calls import FLAG, FLOAT, FLOATS, FLOATS2, INT, PACKED, address_of, call
from ...core.compiled.kernel import kernel, subroutine
from ...core.compiled.packing import Kept, Packed, arrays_of, pack, unpack, zeros
from ...core.compiled.scalar import Vector, length, rotation, turned_towards, unit_or
from ...core.entities import DEFAULT_MODEL, Interaction
from ...core.free_space import check_line, check_place
from ...core.geometry import Barriers, Point
from ...core.humans import BODY_X, BODY_Y, MAXIMUM_SPEED_RATIO, VX, VY, X, Y, frozen
from ...core.leaves import set_leaves, solids_with_doors
from ...core.path_search import find_path
from ...core.philox import draws_of
from ...core.portable_math import Array, BoolArray, IntArray
from ...core.relations import RELATION, RELATIONS
from ...core.scene import Scene
from ...core.snapshot import CrowdCommands, Snapshot
from ...core.turning import critically_damped, turn_limits
from ...registry import PEDESTRIAN_MODELS
from .crowd_state import PURPOSES, Calls, CrowdState, Intentions, Law
from .decisions.acts import plan_path, send, stand
from .decisions.congestion import avoid_queues
from .decisions.destinations import choose_destination, find_new_paths, start_straight
from .decisions.stops import start_stops
from .decisions.tasks import advance_tasks, begin, find_obstacles, leave, start_stay, update_partners
from .doorways import doorways_of, wait_at_doors
from .idling import ARGUING_RESTLESSNESS, change_posture, initial_idling, look_round, stand_straight
from .models.base import (
    KernelModel,
    PedestrianModel,
    Walkers,
    checked_acceleration,
    evaluations_per_tick,
    pedestrian_model,
    standing_acceleration,
    use_leaves,
)
from .neighbours import find_neighbours, find_walls, with_lists, with_longer_lists
from .orientation import HEAD_LEAD_TIME, IDLE_SPEED, MINIMUM_HEAD_LEAD, facing, gaze, initial_glances
from .passages import find_passages, give_way
from .reactions import (
    HEED_RANGE,
    adjust_course,
    apply_adjustment,
    choose_robot,
    initial_reactions,
    notice_robot,
    robot_repulsion,
    step_aside,
)
from .robots import robots_of
from .routes import (
    MOST_WAYPOINTS,
    Routes,
    advance_on_paths,
    corner_speed,
    keep_lanes,
    next_without_destination,
    point_ahead,
    set_targets,
    stopping_speed,
)
from .shoulders import wanted_twist
from .social.company import ARGUES, company_of
from .social.fixtures import fixtures_of, habits_of
from .social.tasks import Meetings, lines_of, tasks_of
from .wayfinding import Journeys, Spaces

# Fields of `CrowdState` that stay the same, hold addresses, or hold what is known of a floor plan.
_CONSTANT = frozenset({
    "solids", "view_blocks", "borders", "origins", "nodes", "visible", "component", "calls", "law",
    "fixtures", "habits", "find_row", "complete", "for_space", "for_space_graph", "for_tight", "for_tight_graph",
    "for_passable", "for_passable_graph", "for_places",
})  # fmt: skip
_PACE_RATIO = 1.15  # largest ratio of the speeds of two members of a group
_ROLLING_TIME = 0.25  # s, for which the acceleration across the heading turns a pedestrian that cannot side-step
_ROLLING_PACE = 0.3  # m/s ahead, at least, of the velocity to which it turns, so that braking does not turn it
_ROLLING_COSINE, _ROLLING_SINE = 0.6967067093471655, 0.7173560908995228  # of 0.8 rad, the largest angle of its turn
_TRACK_LOOK_AHEAD = 1.0  # s, how far ahead on its track a recorded pedestrian aims


class Crowd:
    """All pedestrians of a scene: one pedestrian model, wayfinding, social behaviour, reactions and orientation.

    A tick is two kernels, `prepare` (neighbours, decisions, targets, reactions to the robot, orientation) and
    `accelerate` (the pedestrian model). `sim.kernel.tick` calls them without the interpreter if the model is a kernel.

    Args:
        scene: the pedestrians and their initial states; its seed determines where they wander.

    Raises:
        ValueError: a human's model is unknown, or the humans have different models.
    """

    def __init__(self, scene: Scene) -> None:
        humans, count = scene.humans, len(scene.humans)
        names = sorted({human.model for human in humans} or {DEFAULT_MODEL})
        if len(names) > 1:
            raise ValueError(f"all pedestrians must have the same model, got {', '.join(names)}")
        if names[0] not in PEDESTRIAN_MODELS:
            raise ValueError(PEDESTRIAN_MODELS.unknown(names[0]))
        self._scene, self._model = scene, pedestrian_model(names[0])(scene)
        self._spaces = Spaces(scene, solids_with_doors(Barriers.of(_blocking_walls(scene)), scene.moving_doors))
        if scene.moving_doors:
            use_leaves(self._model, names[0], self._spaces.obstacles.solids.table)
        self._state = Packed(_initial_state(scene, self._spaces, self._model))
        self._all_present = True
        self._ids = [*scene.human_table.id.tolist(), *(piece.id for piece in scene.furniture)]
        seats = {piece: row for row, piece in enumerate(self._state.value.fixtures.seat_piece.tolist())}
        pieces = {piece.id: seats.get(k, -1) for k, piece in enumerate(scene.furniture)}
        queues = {queue.id: row for row, queue in enumerate(scene.queues)}
        seat = np.array([-1 if h.seat is None else pieces.get(h.seat, -1) for h in humans], dtype=np.int64)
        queue = np.array([-1 if h.queue is None else queues.get(h.queue, -1) for h in humans], dtype=np.int64)
        begin(self._state.argument, seat, queue)
        self._kept: list[Kept] = []
        self._version, self.activity, self.interactions = -1, np.zeros(count, dtype=np.int64), scene.interactions
        self.read_company()

    def __reduce__(self) -> tuple[Any, ...]:
        # The state holds addresses of its own arrays, so that a copy is made anew and gets the contents of the arrays.
        own = self.state
        lengths, arrays = (len(own.walkers.neighbour), len(own.walkers.wall)), [*arrays_of(own, _CONSTANT)]
        return _continued, (self._scene, self._model, lengths, arrays, self._all_present)

    def act(self, snapshot: Snapshot) -> CrowdCommands:
        """The commands of all pedestrians for the next tick.

        Raises:
            ValueError: the snapshot is of another scene, or the model's answer is not an (N, 2) array.
        """
        state, own = snapshot.state, self._state.value
        if len(state.humans) != len(own.is_present):
            raise ValueError(f"a crowd of {len(own.is_present)} got a snapshot of {len(state.humans)} pedestrians")
        self._set_presence(state.is_present)
        own.robots.state[0], own.robots.state[1:] = state.robot, state.robots
        own.doorways.openings[:] = state.doors
        while not prepare(self.argument, snapshot.tick, state.humans):
            self.extend_lists()
        acceleration = self._acceleration()
        self.read_company()
        own = self._state.value
        return CrowdCommands(
            acceleration=acceleration,
            facing=own.intentions.facing,
            gaze=own.intentions.gaze,
            activity=self.activity,
            interactions=self.interactions,
            refresh=self._refresh if own.law.evaluations > 1 else None,
            evaluations=own.law.evaluations,
            leaving=own.routes.is_leaving | own.tasks.is_leaving,
            seats=own.tasks.sits_on,
        )

    @property
    def state(self) -> CrowdState:
        """The arrays of the crowd, which its kernels change; some are exchanged for longer ones in `act`."""
        return self._state.value

    @property
    def argument(self) -> Any:
        """The state as kernels take it."""
        return self._state.argument

    @cached_property
    def is_compiled(self) -> bool:
        """Whether the pedestrian model is a kernel, which needs no call of ordinary Python in a tick."""
        return bool(self.state.law.kernel.any())

    def turn_shoulders_like(self, other: Crowd) -> None:
        """Copy the shoulder twist from another crowd of the same people, as it is wanted there."""
        own, theirs = self._state.value.intentions, other._state.value.intentions
        own.wanted_twist[:] = own.twist[:] = theirs.wanted_twist

    def read_company(self) -> None:
        """Update `activity` and `interactions` if they have changed."""
        company, ids = self._state.value.company, self._ids
        if company.version[0] != self._version:
            self._version = int(company.version[0])
            self.activity = frozen(company.activity.copy())
            rows = company.links[: company.link_count[0]].tolist()
            self.interactions = tuple(Interaction(ids[src], RELATIONS[kind], ids[dst]) for src, dst, kind in rows)

    def keep(self) -> None:
        """Keep a copy of the state, at the start, for `restart`."""
        memory = self._model.memory if isinstance(self._model, KernelModel) else ()
        self._kept = [Kept(self._state.value, _CONSTANT), *(Kept(part, frozenset()) for part in memory)]

    def restart(self) -> bool:
        """Return to the state of `keep`; False if some lists have been made longer since."""
        for kept in self._kept:
            kept.restore()
        self._version, self._all_present = -1, True
        self.read_company()
        return bool(self._kept)

    def extend_lists(self) -> None:
        """Make the lists of neighbours and walls as long as the last tick needed."""
        own = self._state.value
        self._use_lists(with_longer_lists(own.walkers, *own.needed.tolist()))

    def _use_lists(self, walkers: Walkers) -> None:
        """Exchange the lists of neighbours and walls; pairs that have met stay known."""
        own, self._kept = self._state.value, []
        other = np.zeros(len(walkers.neighbour), dtype=np.int64)
        other[: len(own.meetings.other)] = own.meetings.other
        law = own.law._replace(packed_walkers=pack(walkers))
        self._state = Packed(own._replace(walkers=walkers, law=law, meetings=own.meetings._replace(other=other)))

    def _refresh(self, rows: Array) -> Array:
        """`CrowdCommands.refresh`: the accelerations in the present state of the bodies."""
        walkers, robots = self._state.value.walkers, self._state.value.robots.state
        people = rows[: len(rows) - len(robots)]
        walkers.position[:], walkers.velocity[:] = people[:, X : Y + 1], people[:, VX : VY + 1]
        robots[:, X : Y + 1] = rows[len(people) :, X : Y + 1]
        return self._acceleration()

    def _acceleration(self) -> Array:
        """(N, 2), m/s^2: by the model for walking pedestrians, back to their positions for standing ones."""
        walking = checked_acceleration(self._model, self._state.value.walkers)
        total_acceleration(self._state.argument, walking)
        return self._state.value.intentions.acceleration

    def _set_presence(self, is_present: BoolArray | None) -> None:
        """Update what depends on which pedestrians are present."""
        if is_present is None and self._all_present:
            return
        self._all_present = is_present is None
        own = self._state.value.is_present
        present = np.ones_like(own) if is_present is None else is_present
        if (present != own).any():
            own[:] = present
            update_partners(self._state.argument)


def _continued(
    scene: Scene, model: PedestrianModel, lengths: tuple[int, int], arrays: list[Array], all_present: bool
) -> Crowd:
    """A crowd that goes on from the arrays of another one of the same scene; see `Crowd.__reduce__`."""
    crowd = Crowd(scene)
    crowd._model, crowd._all_present = model, all_present
    if scene.moving_doors:
        use_leaves(model, type(model).__name__, crowd._spaces.obstacles.solids.table)
    crowd._use_lists(with_lists(crowd.state.walkers, *lengths))
    for place, array in zip(arrays_of(crowd.state, _CONSTANT), arrays, strict=True):
        place[...] = array
    crowd._state = Packed(crowd.state._replace(law=_law_of(model, scene, crowd.state.walkers)))
    crowd._version = -1
    crowd.read_company()
    return crowd


def _initial_state(scene: Scene, spaces: Spaces, model: PedestrianModel) -> CrowdState:
    """The state of a crowd at the start, before `begin`."""
    humans, count = scene.humans, len(scene.humans)
    company, reactions = company_of(scene), initial_reactions(scene)
    routes, journeys = _routes(scene), _journeys(scene)
    walkers = with_longer_lists(
        _walkers(scene), min(count * count, 64 * count), min(len(scene.barrier_owner), 32) * count
    )
    law = _law_of(model, scene, walkers)
    return CrowdState(
        robots=robots_of(scene),
        obstacles=spaces.obstacles,
        doorways=doorways_of(scene),
        routes=routes,
        journeys=journeys,
        fixtures=fixtures_of(scene, spaces.clearance),
        habits=habits_of(scene, spaces.clearance),
        tasks=tasks_of(scene, company.stays),
        lines=lines_of(scene),
        meetings=Meetings(
            np.zeros(count + 1, dtype=np.int64), np.zeros(len(walkers.neighbour), dtype=np.int64), np.zeros(1, bool)
        ),
        passages=find_passages(scene),
        company=company,
        reactions=reactions,
        glances=initial_glances(scene, reactions),
        idling=initial_idling(count),
        intentions=zeros(
            Intentions, count, preferred_speed=_group_speeds(scene), robot_in_sight=np.ones(count, dtype=bool),
            standing_position=company.standing_position.copy(),
        ),
        walkers=walkers,
        draws=draws_of(scene.seed, scene.episode, "people", [human.id for human in humans], PURPOSES),
        law=law,
        is_present=np.ones(count, dtype=bool),
        needed=np.zeros(2, dtype=np.int64),
        in_file=_in_file(scene),
        rolls=np.array([not human.side_steps for human in humans], dtype=bool),
        calls=_calls(law.evaluations > 1),
    )  # fmt: skip


def _law_of(model: PedestrianModel, scene: Scene, walkers: Walkers) -> Law:
    """A pedestrian model for kernels."""
    kernel, parameters = np.zeros(2, dtype=np.int64), np.zeros(1, dtype=np.int64)
    if isinstance(model, KernelModel) and type(model).acceleration is KernelModel.acceleration:
        kernel = address_of(model.kernel, PACKED, PACKED, FLOATS2, FLOAT, FLOAT, FLOATS2)
        parameters = model.packed_parameters(len(scene.humans))
    evaluations = evaluations_per_tick(model.evaluations, scene.rules.dt)
    return Law(kernel, pack(walkers), parameters, bool(model.headed), evaluations, scene.rules.dt / evaluations)


def _routes(scene: Scene) -> Routes:
    """Routes without paths; members of wandering groups follow their leaders."""
    humans, count, index = scene.humans, len(scene.humans), scene.human_table.row
    walking = [k for k, human in enumerate(humans) if human.behaviour in ("wandering", "walking")]
    walks, first, leader = set(walking), np.arange(count), np.full(count, -1)
    groups = (group for group in scene.groups if group.kind == "walking")
    leader_of = {index[m]: index[group.members[0]] for group in groups for m in group.members}
    for k, other in leader_of.items():
        first[k] = other if other in walks else k
    for k in walking:
        # Members with goals of their own, or whose leader does not walk, lead themselves.
        other = k if humans[k].behaviour == "walking" else leader_of.get(k, k)
        leader[k] = other if other in walks else k
    order, version = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    order[: len(walking)] = walking
    version[walking] = np.arange(1, len(walking) + 1)
    has_goals = [len(human.goals) if human.behaviour == "walking" else -1 for human in humans]
    return zeros(
        Routes, count, order=order, walkers=np.array([len(walking)]), leader=leader, first=first,
        path=np.zeros((count, MOST_WAYPOINTS, 2)), version=version, copied=np.full(count, -1),
        goals_left=np.array(has_goals, dtype=np.int64), is_exiting=np.array([h.exits for h in humans], dtype=bool),
        onward=np.full((count, 2), math.nan), checkpoint=np.full((count, 2), math.nan),
        target=scene.human_table.position.copy(),
    )  # fmt: skip


def _journeys(scene: Scene) -> Journeys:
    """Goals of `walking` pedestrians and tracks of recorded ones."""
    humans, count = scene.humans, len(scene.humans)
    goals = [human.goals if human.behaviour == "walking" else () for human in humans]
    stays = [[*human.stays, *[0.0] * len(own)][: len(own)] for human, own in zip(humans, goals, strict=True)]
    tracks = [human.track if human.behaviour == "recorded" else () for human in humans]
    return zeros(
        Journeys, count, goal_start=np.array([*accumulate(map(len, goals), initial=0)], dtype=np.int64),
        goal=np.array([goal for own in goals for goal in own], dtype=float).reshape(-1, 2),
        goal_stay=np.array([stay for own in stays for stay in own], dtype=float),
        track_start=np.array([*accumulate(map(len, tracks), initial=0)], dtype=np.int64),
        track=np.array([place for own in tracks for place in own], dtype=float).reshape(-1, 2),
        enters=np.array([human.enters for human in humans], dtype=np.int64),
        look_ahead=np.array([int(_TRACK_LOOK_AHEAD / scene.rules.dt + 0.5)]), place=np.full(count, -1),
        spot=np.full((count, 2), math.nan), paths=np.array([count]),
        delay=np.array([human.pre_movement for human in humans], dtype=float),
    )  # fmt: skip


@kernel
def prepare(packed_state: Any, tick: int, humans: Array) -> bool:
    """Find what surrounds all pedestrians, and decide what they do in a tick.

    Args:
        packed_state: packed `CrowdState`, with the states of the robots; neighbour lists, walkers and intentions are
            filled.
        tick: that begins.
        humans: columns of `core.humans`; one row for each pedestrian of the scene.

    Returns:
        False if the lists are shorter than `CrowdState.needed`: nothing else has changed.
    """
    crowd = unpack(packed_state, CrowdState)
    walkers, doorways = crowd.walkers, crowd.doorways
    if len(doorways.openings) > 0:
        set_leaves(crowd.obstacles.solids.table, doorways.frames, doorways.openings)
        set_leaves(crowd.obstacles.view_blocks.table, doorways.frames, doorways.openings)
    for k in range(len(humans)):
        walkers.position[k, 0], walkers.position[k, 1] = humans[k, X], humans[k, Y]
        walkers.velocity[k, 0], walkers.velocity[k, 1] = humans[k, VX], humans[k, VY]
        c, s = rotation(-crowd.intentions.twist[k])
        walkers.body_direction[k, 0] = humans[k, BODY_X] * c - humans[k, BODY_Y] * s
        walkers.body_direction[k, 1] = humans[k, BODY_X] * s + humans[k, BODY_Y] * c
    crowd.needed[0] = find_neighbours(walkers, crowd.is_present, crowd.obstacles.view_blocks)
    crowd.needed[1] = find_walls(walkers, crowd.is_present, crowd.obstacles.solids)
    if crowd.needed[0] > len(walkers.neighbour) or crowd.needed[1] > len(walkers.wall):
        return False
    _decide(crowd, tick, humans)
    return True


@subroutine
def _decide(crowd: CrowdState, tick: int, humans: Array) -> None:
    """Decide what all pedestrians do in a tick."""
    calls, is_present, routes = crowd.calls, crowd.is_present, crowd.routes
    call(calls.advance_tasks, (crowd, tick))
    item = 0
    while item < routes.walkers[0]:
        item = next_without_destination(
            routes, item, tick, humans, is_present, crowd.company.is_walking, crowd.obstacles.solids
        )
        if item < routes.walkers[0]:
            call(calls.choose_destination, (crowd, routes.order[item], tick))
            item += 1
    if advance_on_paths(
        routes, tick, humans, is_present, calls.check_line, crowd.obstacles.for_space, crowd.obstacles.for_passable
    ):
        call(calls.find_new_paths, (crowd, tick))
    set_targets(routes, humans, is_present, crowd.obstacles.solids)
    for k in range(len(humans)):
        crowd.walkers.walks[k] = crowd.company.is_walking[k] and is_present[k]
    keep_lanes(routes, crowd.walkers, calls.check_line, crowd.obstacles.for_space)
    _set_desires(crowd, humans, is_present)
    give_way(crowd.passages, routes, crowd.walkers, humans, is_present, crowd.obstacles.side, crowd.obstacles.dt)
    if len(crowd.doorways.openings) > 0:
        wait_at_doors(crowd.doorways, routes, crowd.walkers, humans, is_present)
    for k in range(len(humans)):
        crowd.intentions.robot_in_sight[k] = is_present[k] and choose_robot(
            crowd.reactions, k, crowd.robots, crowd.obstacles.view_blocks, humans
        )
    _react(crowd, tick, humans, is_present)
    _orient(crowd, tick, humans, is_present)


@subroutine
def _set_desires(crowd: CrowdState, humans: Array, is_present: BoolArray) -> None:
    """Set where the pedestrians want to walk, as far as it does not depend on the robot."""
    routes, walkers = crowd.routes, crowd.walkers
    for k in range(len(humans)):
        dx, dy = routes.target[k, 0] - humans[k, X], routes.target[k, 1] - humans[k, Y]
        ux, uy = 0.0, 0.0
        if crowd.company.is_walking[k]:
            ux, uy = unit_or(dx, dy, 1e-3, humans[k, BODY_X], humans[k, BODY_Y])
        walkers.desired_direction[k, 0], walkers.desired_direction[k, 1] = ux, uy
        speed = min(crowd.intentions.preferred_speed[k], corner_speed(routes, k, humans[k, X], humans[k, Y]))
        if routes.is_final[k]:
            speed = min(speed, stopping_speed(length(dx, dy)))
        walkers.desired_speed[k] = speed
        walkers.is_abreast[k] = (routes.is_abreast[k] or routes.first[k] == k) and not crowd.in_file[k]


@subroutine
def _react(crowd: CrowdState, tick: int, humans: Array, is_present: BoolArray) -> None:
    """Adjust desired directions and speeds, and the positions of standing pedestrians, to the robot."""
    intentions, reactions, walkers, dt = crowd.intentions, crowd.reactions, crowd.walkers, crowd.obstacles.dt
    social, robots = crowd.company, crowd.robots
    any_notices, any_changed = False, False
    for k in range(len(humans)):
        reactions.notices[k] = False
        if is_present[k] and notice_robot(
            reactions, k, robots, humans, social.is_walking[k], intentions.robot_in_sight[k], dt
        ):
            any_notices = True
        is_near = reactions.notices[k] and reactions.gap[k] < HEED_RANGE
        walkers.heed[k] = reactions.weight[k] if is_near else 0.0
    direction, speed = walkers.desired_direction, walkers.desired_speed
    for k in range(len(humans)):
        if not is_present[k]:
            reactions.gap[k] = math.inf
            continue
        if not any_notices:
            reactions.delay[k] = max(reactions.delay[k] - 0.5 * dt, 0.0)
            reactions.wanted[k, 0], reactions.wanted[k, 1] = walkers.velocity[k, 0], walkers.velocity[k, 1]
        elif adjust_course(
            reactions, k, robots.state[reactions.robot[k]], walkers, direction[k, 0] * speed[k],
            direction[k, 1] * speed[k], speed[k], social.is_walking[k], crowd.obstacles.solids,
            crowd.obstacles.side, dt,
        ):  # fmt: skip
            any_changed = True
    for k in range(len(humans)):
        if any_changed and reactions.notices[k] and social.is_walking[k]:
            direction[k, 0], direction[k, 1], speed[k] = apply_adjustment(
                reactions, k, direction[k, 0] * speed[k], direction[k, 1] * speed[k], direction[k, 0], direction[k, 1]
            )
        x, y = social.standing_position[k, 0], social.standing_position[k, 1]
        if social.is_walking[k]:
            stand_straight(crowd.idling, k)
        elif crowd.tasks.sits_on[k] < 0:
            change_posture(
                crowd.idling, k, tick, x, y, walkers, social.size[k], crowd.obstacles.solids, crowd.draws,
                ARGUING_RESTLESSNESS if social.activity[k] == ARGUES else 1.0, crowd.obstacles.side, dt,
            )  # fmt: skip
            x, y = x + crowd.idling.shift[k, 0], y + crowd.idling.shift[k, 1]
            x, y = step_aside(
                reactions, k, robots.state[reactions.robot[k]], x, y, walkers.radius[k], crowd.obstacles.side,
                crowd.obstacles.solids,
            )  # fmt: skip
        intentions.standing_position[k, 0], intentions.standing_position[k, 1] = x, y


@subroutine
def _orient(crowd: CrowdState, tick: int, humans: Array, is_present: BoolArray) -> None:
    """Choose the desired directions of bodies and heads."""
    intentions, walkers, social = crowd.intentions, crowd.walkers, crowd.company

    for k in range(len(humans)):
        if not is_present[k]:
            intentions.facing[k, 0] = intentions.gaze[k, 0] = 1.0
            intentions.facing[k, 1] = intentions.gaze[k, 1] = 0.0
            continue
        ux, uy, speed = walkers.desired_direction[k, 0], walkers.desired_direction[k, 1], walkers.desired_speed[k]
        # A slow walker turns to where its model steers.
        to_x, to_y = unit_or(walkers.steering[k, 0], walkers.steering[k, 1], 0.5, ux, uy)
        pace = length(humans[k, VX], humans[k, VY])
        if pace > IDLE_SPEED or ux * to_x + uy * to_y <= 0.0:
            to_x, to_y = ux, uy
        facing_x, facing_y = facing(
            k, humans, social, to_x * speed, to_y * speed, crowd.reactions, crowd.obstacles.side
        )
        if social.is_walking[k] and crowd.law.is_headed:
            # Motion follows the body, so that the body turns to the desired direction.
            facing_x, facing_y = ux, uy
        elif social.is_walking[k] and crowd.rolls[k]:
            facing_x, facing_y = _rolling_direction(crowd, k, humans, to_x, to_y)
        twist = 0.0
        if social.is_walking[k]:
            twist = wanted_twist(
                walkers, k, crowd.obstacles.solids.table, intentions.wanted_twist[k], crowd.obstacles.side
            )
        # The body turns by the dynamics of `critically_damped`, and so does the twist, which is a part of this turn.
        rate, limit = turn_limits(pace)
        lag = twist - intentions.twist[k]
        change, intentions.twist_rate[k] = critically_damped(
            lag, intentions.twist_rate[k], rate, limit, crowd.obstacles.dt
        )
        intentions.wanted_twist[k], intentions.twist[k] = twist, intentions.twist[k] + change
        if not social.is_walking[k] and crowd.tasks.sits_on[k] < 0:
            c, s = crowd.idling.turn[k, 0], crowd.idling.turn[k, 1]
            facing_x, facing_y = facing_x * c - facing_y * s, facing_x * s + facing_y * c
        if crowd.rolls[k]:  # it turns calmly
            facing_x, facing_y = turned_towards(
                humans[k, BODY_X], humans[k, BODY_Y], facing_x, facing_y, _ROLLING_COSINE, _ROLLING_SINE,
                crowd.obstacles.side,
            )  # fmt: skip
        lead = max(speed * HEAD_LEAD_TIME, MINIMUM_HEAD_LEAD)
        ahead_x, ahead_y = point_ahead(crowd.routes, k, humans[k, X], humans[k, Y], lead)
        c, s = rotation(twist)
        intentions.facing[k, 0], intentions.facing[k, 1] = facing_x * c - facing_y * s, facing_x * s + facing_y * c
        if not social.is_walking[k] and social.partner_count[k] == 0 and not social.has_object[k]:
            facing_x, facing_y = look_round(
                crowd.idling, k, tick, humans, walkers, facing_x, facing_y, crowd.draws, crowd.obstacles.side,
                crowd.obstacles.dt,
            )  # fmt: skip
        intentions.gaze[k, 0], intentions.gaze[k, 1] = gaze(
            k, tick, humans, social, facing_x, facing_y, ahead_x, ahead_y, crowd.reactions, crowd.glances, crowd.draws,
            crowd.obstacles.dt,
        )  # fmt: skip


@subroutine
def _rolling_direction(crowd: CrowdState, k: int, humans: Array, to_x: float, to_y: float) -> Vector:
    """The direction to which pedestrian k turns that moves along its heading only: to where the law pushes it.

    Args:
        crowd: with the accelerations of the last tick.
        k: index of the pedestrian.
        humans: columns of `core.humans`.
        to_x, to_y: unit vector of the direction in which it wants to go.
    """
    bx, by = humans[k, BODY_X], humans[k, BODY_Y]
    if to_x * bx + to_y * by <= 0.0:
        return to_x, to_y  # about turn
    x = humans[k, VX] + crowd.intentions.acceleration[k, 0] * _ROLLING_TIME
    y = humans[k, VY] + crowd.intentions.acceleration[k, 1] * _ROLLING_TIME
    ahead, left = max(x * bx + y * by, _ROLLING_PACE), y * bx - x * by
    return unit_or(ahead * bx - left * by, ahead * by + left * bx, 1e-3, bx, by)


@kernel
def accelerate(packed_state: Any) -> None:
    """The accelerations of all pedestrians by a model that is a kernel.

    Args:
        packed_state: packed `CrowdState` after `prepare`; `intentions.acceleration` is filled.
    """
    crowd = unpack(packed_state, CrowdState)
    law, walking, obstacles = crowd.law, crowd.intentions.walking_acceleration, crowd.obstacles
    for k in range(len(walking)):
        walking[k, 0] = walking[k, 1] = 0.0
    barriers, side, dt = obstacles.solids.table, float(obstacles.side), obstacles.dt
    call(law.kernel, (law.packed_walkers, law.packed_parameters, barriers, side, dt, walking))
    _total_acceleration(crowd, walking)


@kernel
def refresh(packed_state: Any, bodies: Array) -> None:
    """The accelerations by a model that is evaluated several times in a tick, in the present state of the bodies.

    Args:
        packed_state: packed `CrowdState`; `intentions.acceleration` is filled.
        bodies: (N + R, 4), x, y, vx, vy, m and m/s, the robots last.
    """
    crowd = unpack(packed_state, CrowdState)
    walkers, robots = crowd.walkers, crowd.robots.state
    count = len(bodies) - len(robots)
    for axis in range(2):
        for k in range(count):
            walkers.position[k, axis], walkers.velocity[k, axis] = bodies[k, axis], bodies[k, 2 + axis]
        for r in range(len(robots)):
            robots[r, axis] = bodies[count + r, axis]
    call(crowd.calls.accelerate, (crowd,))


@kernel
def total_acceleration(packed_state: Any, walking: Array) -> None:
    """Complete the accelerations of a model, (N, 2), m/s^2, see `accelerate`."""
    _total_acceleration(unpack(packed_state, CrowdState), walking)


@cache
def _calls(is_stiff: bool) -> Calls:
    """The addresses of the kernels that kernels of pedestrians call."""
    ends = FLOAT, FLOAT, FLOAT, FLOAT
    return Calls(
        find_path=address_of(find_path, PACKED, PACKED, *ends, FLOATS2, FLOATS),
        check_place=address_of(check_place, PACKED, *ends),
        check_line=address_of(check_line, PACKED, *ends),
        plan_path=address_of(plan_path, PACKED, INT, *ends, FLOATS2),
        send=address_of(send, PACKED, INT, FLOAT, FLOAT),
        stand=address_of(stand, PACKED, INT, *ends, INT, FLAG),
        leave=address_of(leave, PACKED, INT, INT),
        start_stay=address_of(start_stay, PACKED, INT, FLOAT, FLOAT, FLOAT, INT),
        update_partners=address_of(update_partners, PACKED),
        start_straight=address_of(start_straight, PACKED),
        find_obstacles=address_of(find_obstacles, PACKED, FLAG),
        advance_tasks=address_of(advance_tasks, PACKED, INT),
        start_stops=address_of(start_stops, PACKED, INT),
        avoid_queues=address_of(avoid_queues, PACKED, INT),
        choose_destination=address_of(choose_destination, PACKED, INT, INT),
        find_new_paths=address_of(find_new_paths, PACKED, INT),
        prepare=address_of(prepare, PACKED, INT, FLOATS2),
        accelerate=address_of(accelerate, PACKED),
        refresh=address_of(refresh, PACKED, FLOATS2) if is_stiff else np.zeros(2, dtype=np.int64),
    )


@subroutine
def _total_acceleration(crowd: CrowdState, walking: Array) -> None:
    """Add the repulsion from robots to a model's accelerations, hold standing pedestrians, and limit speeds."""
    interval = crowd.law.interval
    intentions, walkers, reactions = crowd.intentions, crowd.walkers, crowd.reactions
    for k in range(len(intentions.acceleration)):
        x, y, vx, vy = walkers.position[k, 0], walkers.position[k, 1], walkers.velocity[k, 0], walkers.velocity[k, 1]
        if walkers.walks[k]:
            robot = crowd.robots.state[reactions.robot[k]]
            push_x, push_y = robot_repulsion(reactions, k, x, y, robot[X], robot[Y])
            ax, ay = walking[k, 0] + push_x, walking[k, 1] + push_y
        else:
            place = intentions.standing_position
            ax, ay = standing_acceleration(
                x, y, vx, vy, place[k, 0], place[k, 1], walkers.body_direction[k, 0], walkers.body_direction[k, 1]
            )
        # The speed after the interval is limited.
        vx_after, vy_after = vx + ax * interval, vy + ay * interval
        speed, maximum = math.sqrt(vx_after * vx_after + vy_after * vy_after), 0.0
        maximum = MAXIMUM_SPEED_RATIO * intentions.preferred_speed[k]
        scale = maximum / max(speed, 1e-6) if speed > maximum else 1.0
        intentions.acceleration[k, 0] = (vx_after * scale - vx) / interval
        intentions.acceleration[k, 1] = (vy_after * scale - vy) / interval


def _walkers(scene: Scene) -> Walkers:
    """The input of the pedestrian model, filled as far as it stays the same."""
    count = len(scene.humans)
    return zeros(
        Walkers,
        count,
        radius=scene.human_table.radius.copy(),
        neighbour_start=np.zeros(count + 1, dtype=np.int64),
        neighbour=np.zeros(0, dtype=np.int64),
        attention=np.zeros(0),
        wall_start=np.zeros(count + 1, dtype=np.int64),
        wall=np.zeros(0, dtype=np.int64),
        group=_walking_groups(scene),
        is_abreast=np.ones(count, dtype=bool),
        shoulder=scene.human_table.shoulder.copy(),
        headway=np.array([human.headway for human in scene.humans], dtype=float),
        politeness=np.array([human.politeness for human in scene.humans], dtype=float),
    )


def _group_speeds(scene: Scene) -> Array:
    """Preferred speeds, (N,), m/s: wandering groups walk at the speed of their slowest member.

    Members with goals of their own are faster by `_PACE_RATIO` at most, as the mean speeds of recorded ones are.
    """
    speed = {human.id: human.desired_speed for human in scene.humans}
    wandering = {human.id for human in scene.humans if human.behaviour == "wandering"}
    for group in scene.groups:
        slowest = min(speed[member] for member in group.members)
        for member in group.members:
            speed[member] = min(speed[member], slowest if member in wandering else _PACE_RATIO * slowest)
    return np.array([speed[human.id] for human in scene.humans], dtype=float)


def _walking_groups(scene: Scene) -> IntArray:
    """`Walkers.group` of a scene."""
    index = scene.human_table.row
    group = np.full(len(index), -1)
    for rows in ([index[m] for m in g.members] for g in scene.groups if g.kind == "walking" and len(g.members) > 1):
        group[rows] = rows[0]
    return group


def _in_file(scene: Scene) -> BoolArray:
    """Whether each pedestrian walks in a file with another one, (N,) of bool."""
    files = [{i.src, i.dst} for i in scene.interactions if RELATION[i.relation].in_file]
    members = {id for pair in files for id in pair}
    return np.array([human.id in members for human in scene.humans], dtype=bool)


def _blocking_walls(scene: Scene) -> Iterator[tuple[Point, Point, float]]:
    """Inner walls, and edges of the outline with a corner of the room on their outer side: they can block a view."""
    for k, wall in enumerate(scene.walls):
        (ax, ay), (bx, by) = wall.start, wall.end
        sides = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in scene.polygon]
        if k >= len(scene.polygon) or min(sides) < -1e-9:  # the first walls are the edges of the outline
            yield wall.start, wall.end, 0.0
    yield from scene.fixed_leaves
