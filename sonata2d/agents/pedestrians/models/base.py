"""Common parts of the pedestrian models: input, interface, driving force, side bias, and walls.

The models are kernels (`core.compiled`). A kernel computes the acceleration of one agent i after the other and calls a
subroutine for each term. Forces of neighbours j and of barriers are added one by one in the scene's order: the order
of a floating-point sum decides its last bits. Terms of a pair take numbers, and only terms of an agent take `Walkers`:
compiled code passes every array of a tuple, which would take longer than the term.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from ....core.compiled.kernel import subroutine
from ....core.compiled.packing import Bools, Floats, Floats2, Ints, Packed, pack
from ....core.compiled.scalar import RADIUS, Vector, exp, extent, length, towards
from ....core.portable_math import Array
from ....core.scene import Scene
from ....registry import PEDESTRIAN_MODELS


class Walkers(NamedTuple):
    """Input of a pedestrian model: M agents, world frame.

    All arrays are contiguous and writeable: numba compiles a kernel anew for other kinds of arrays. The neighbours of
    agent i are `neighbour[n]` with n from `neighbour_start[i]` to before `neighbour_start[i + 1]`, in ascending order:
    the agents to whom it attends, within `neighbours.INTERACTION_RANGE`, and the members of its walking group.

    Attributes:
        position: (M, 2), m.
        velocity: (M, 2), m/s.
        desired_direction: (M, 2), unit vectors towards the next waypoint; zero for agents that stand.
        body_direction: (M, 2), unit vectors of the direction in which the feet point, and the shoulders unless they are
            turned in a narrow gap.
        desired_speed: (M,), m/s.
        radius: (M,), m.
        walks: (M,) of bool, the agents whose accelerations are used. The others are there to be avoided; a model may
            skip their rows.
        neighbour_start: (M + 1,) of int, where the neighbours of each agent begin; the last item is their total number.
        neighbour: (K,) of int, the neighbours of agent 0, of agent 1, and so on; K may exceed the total number.
        attention: (K,), how much the agent attends to each neighbour, in [0, 1]. Zero for members of the group where a
            wall blocks the line of sight, and beyond the range.
        wall_start: (M + 1,) of int, where the walls of each agent begin in `wall`; the last item is their total number.
        wall: (W,) of int, walls and edges of furniture near each agent (`neighbours.WALL_RANGE`), rows of the barriers
            in ascending order; W may exceed the total number.
        group: (M,) of int, the same number for the members of a walking group, less than M; -1 without a group.
        is_abreast: (M,) of bool, whether there is room for each agent to walk abreast of its group.
        shoulder: (M,), half the length of the shoulder line, m, across `body_direction`; of long bodies negative: along
            it; 0 for a disc.
        headway, politeness: (M,), factors of each agent's time gap to those ahead and of the strength with which it
            avoids others; 1 on average.
        heed: (M,), how much each agent heeds a robot that it has in view, in [0, 1].
        steering: (M, 2), output: unit vectors of the directions that the model chose, to which the bodies of slow
            walkers turn; zero, as they come, where a model chooses none.
    """

    position: Floats2
    velocity: Floats2
    desired_direction: Floats2
    body_direction: Floats2
    desired_speed: Floats
    radius: Floats
    walks: Bools
    neighbour_start: Ints
    neighbour: Ints
    attention: Floats
    wall_start: Ints
    wall: Ints
    group: Ints
    is_abreast: Bools
    shoulder: Floats
    headway: Floats
    politeness: Floats
    heed: Floats
    steering: Floats2


def evaluations_per_tick(evaluations: int, dt: float) -> int:
    """Number of evaluations of the forces in a tick.

    Args:
        evaluations: in 0.1 s, see `PedestrianModel`; 1 for a model that is not stiff.
        dt: tick, s.

    Returns:
        At least 1; always 1 for a model that is not stiff.
    """
    return 1 if evaluations == 1 else max(int(evaluations * dt / 0.1 + 0.999), 1)


def physics_steps(scene: Scene) -> int:
    """Number of physics steps in a tick: `Rules.substeps`, or as many as a stiff model is evaluated."""
    models = {human.model for human in scene.humans}
    counts = [evaluations_per_tick(pedestrian_model(name).evaluations, scene.rules.dt) for name in models]
    return max([scene.rules.substeps, *counts])


class PedestrianModel(Protocol):
    """A pedestrian model, created for one scene.

    Attributes:
        evaluations: how often the forces must be evaluated in 0.1 s; more than 1 for stiff models.
        headed: True if pedestrians walk where their bodies face; bodies then turn towards the next waypoint.
    """

    evaluations: int
    headed: bool

    def __init__(self, scene: Scene) -> None: ...

    def acceleration(self, walkers: Walkers) -> Array:
        """Acceleration of the agents that walk, (M, 2), m/s^2, world frame; other rows are not used.

        M, the number of agents, can be 0 or 1, and differ from the number of humans in the scene. The returned array
        may be used again at the next call.
        """


class KernelModel:
    """Base class of the models that are kernels: keeps what kernels need of a scene, in the types that they take.

    Subclasses name their `kernel`, which a crowd calls without the interpreter.

    Args:
        scene: its walls and furniture, the side of its rules and its tick.

    Attributes:
        parameters: of the model, a named tuple of floats.
        kernel: its arguments are the packed input and parameters, barriers, side, dt, and the array for the result.
    """

    evaluations = 1
    headed = False
    parameters: tuple[Any, ...] = ()
    kernel: Callable[..., None]

    def __init__(self, scene: Scene) -> None:
        # A copy, since kernels take writeable arrays.
        self._barriers, self._side, self._dt = scene.barriers.table.copy(), float(scene.rules.side), scene.rules.dt
        self._parameters: Any = pack(self.parameters) if self.parameters else np.zeros(1, dtype=np.int64)
        self._result = np.zeros((0, 2))
        self._walkers: Packed[Walkers] | None = None  # the last input

    def acceleration(self, walkers: Walkers) -> Array:
        """Acceleration of the agents that walk, by the kernel; see `PedestrianModel.acceleration`."""
        acceleration = self._output(walkers)
        parameters = self.packed_parameters(len(acceleration))
        self.kernel(self._packed(walkers), parameters, self._barriers, self._side, self._dt, acceleration)
        return acceleration

    def use_barriers(self, table: Array) -> None:
        """See other barriers than those of the scene: rows of `Barriers.table`, of which some may move."""
        self._barriers = table

    @property
    def memory(self) -> tuple[tuple[Any, ...], ...]:
        """Named tuples of arrays in which the kernel remembers something from tick to tick."""
        return ()

    def packed_parameters(self, count: int) -> Any:
        """The second argument of the kernel for a number of agents: by default the packed `parameters`."""
        return self._parameters

    def _packed(self, walkers: Walkers) -> Any:
        """The packed input; agents are mostly the same arrays as at the last call."""
        if self._walkers is None or self._walkers.value is not walkers:
            self._walkers = Packed(walkers)
        return self._walkers.argument

    def _output(self, walkers: Walkers) -> Array:
        """The array (M, 2) for the accelerations, of zeros; the same one while M is the same."""
        if len(self._result) != len(walkers.position):
            self._result = np.zeros((len(walkers.position), 2))
        self._result.fill(0.0)
        return self._result


def use_leaves(model: PedestrianModel, name: str, table: Array) -> None:
    """Let a pedestrian model see the leaves of doors.

    Args:
        model, name: of the pedestrians.
        table: of the barriers, the leaves last, see `KernelModel.use_barriers`.

    Raises:
        ValueError: the model is ordinary Python, and knows the walls of the start only.
    """
    if not isinstance(model, KernelModel):
        raise ValueError(
            f"the pedestrian model {name} does not see doors that open and close; use a model that is a KernelModel, "
            "or interior doors with opened_by: nobody"
        )
    model.use_barriers(table)


def checked_acceleration(model: PedestrianModel, walkers: Walkers) -> Array:
    """The accelerations by a model, (M, 2), contiguous, as kernels take them.

    Raises:
        ValueError: the model returns an array of another shape.
    """
    answer = model.acceleration(walkers)
    acceleration: Array = np.ascontiguousarray(answer, dtype=float)
    if acceleration.shape != walkers.position.shape:
        problem = f"shape {acceleration.shape}" if isinstance(answer, np.ndarray) else repr(answer)
        raise ValueError(
            f"{type(model).__name__}.acceleration must return an array of shape {walkers.position.shape}, one row for "
            f"each agent, got {problem}"
        )
    return acceleration


def pedestrian_model(name: str) -> type[PedestrianModel]:
    """The class of a pedestrian model.

    Raises:
        Sonata2dError: the name is unknown, or the plug-in that provides the model does not load.
    """
    model: type[PedestrianModel] = PEDESTRIAN_MODELS.load(name, _problem)
    return model


def _problem(item: object) -> str | None:
    """Why an object cannot be used as a pedestrian model, or None."""
    missing = [name for name in ("acceleration", "evaluations", "headed") if not hasattr(item, name)]
    if not isinstance(item, type):
        return "is not a pedestrian model; it must be a class"
    return f"is not a pedestrian model; it lacks {', '.join(missing)}" if missing else None


@subroutine
def desired_acceleration(walkers: Walkers, i: int, direction: Vector, relaxation_time: float) -> Vector:
    """Accelerate an agent towards its desired velocity.

    Args:
        walkers: all agents; the velocity and the desired speed of agent i are used.
        direction: unit vector towards the next waypoint; zero to stop.
        relaxation_time: time constant of the velocity error, s; positive.

    Returns:
        m/s^2.

    Raises:
        ValueError: relaxation_time is zero or negative.

    Source: Helbing & Molnár, Phys. Rev. E 51 (1995) 4282, eq. 2.
    """
    if relaxation_time <= 0.0:
        raise ValueError("relaxation_time must be positive")
    speed, tau = walkers.desired_speed[i], relaxation_time  # v0, τ
    return (direction[0] * speed - walkers.velocity[i, 0]) / tau, (direction[1] * speed - walkers.velocity[i, 1]) / tau


_STANDING_RATE = 2.0  # 1/s; most of the way back takes about 2 / _STANDING_RATE seconds
STEP_SPEED = 0.25  # m/s, of steps sideways and backwards
_STANDING_LIMIT = 1.5  # m/s^2, so that a pedestrian that stops to stand brakes as walkers do


@subroutine
def are_together(walkers: Walkers, i: int, j: int) -> bool:
    """Whether two agents are members of one group."""
    return bool(walkers.group[i] >= 0 and walkers.group[i] == walkers.group[j])


@subroutine
def standing_acceleration(
    x: float, y: float, vx: float, vy: float, standing_x: float, standing_y: float, body_x: float, body_y: float
) -> Vector:
    """Return a standing pedestrian that was pushed to its place: a critically damped spring of limited force.

    It steps ahead at up to 0.5 m/s, sideways and backwards at half that speed.

    Args:
        x, y: position, m.
        vx, vy: velocity, m/s.
        standing_x, standing_y: the place, m.
        body_x, body_y: unit vector of its heading.

    Returns:
        m/s^2.
    """
    stiffness, damping = _STANDING_RATE * _STANDING_RATE, 2.0 * _STANDING_RATE
    dx, dy = standing_x - x, standing_y - y
    distance = max(length(dx, dy), 1e-6)
    ahead = max((dx * body_x + dy * body_y) / distance, 0.0)
    reach = STEP_SPEED * (1.0 + ahead) * 2.0 / _STANDING_RATE  # m, from which the spring moves a body at this speed
    scale = min(1.0, reach / distance)
    ax, ay = dx * scale * stiffness - vx * damping, dy * scale * stiffness - vy * damping
    scale = min(1.0, _STANDING_LIMIT / max(length(ax, ay), 1e-6))
    return ax * scale, ay * scale


_SIDE_BIAS = 0.003  # sideways component of a biased direction: 3 mm per metre


@subroutine
def biased_direction(x: float, y: float, side: float) -> Vector:
    """Lean a direction slightly to the side of the rules.

    Models without a side leave two pedestrians that meet head-on face to face. Their papers add noise or start
    asymmetrically; here forces contain no random numbers, so that a mirrored scene gives mirrored motion.

    Args:
        x, y: unit vector, or zero, which stays zero.
        side: +1 leans to the right, -1 to the left.

    Returns:
        Of length 1 within 5e-6.

    Source: ours.
    """
    return x + side * _SIDE_BIAS * y, y - side * _SIDE_BIAS * x


@subroutine
def wall_acceleration(
    walkers: Walkers, i: int, barriers: Array, radius: float, strength: float, decay_length: float
) -> Vector:
    """Repulsion of agent i from walls and furniture.

    Args:
        walkers: all agents.
        i: index of the agent.
        barriers: (B, 8), rows of `Barriers.table`.
        radius: m.
        strength: m/s^2, at contact.
        decay_length: distance over which the repulsion falls to 1/e, m.

    Returns:
        m/s^2, summed in the order of the barriers.

    Source: Moussaïd et al., Proc. R. Soc. B 276 (2009) 2755, wall term a exp(-d/b), with d from outline to wall.
    """
    total_x, total_y = 0.0, 0.0
    for n in range(walkers.wall_start[i], walkers.wall_start[i + 1]):
        k = walkers.wall[n]
        wall_x, wall_y = towards(barriers, k, walkers.position[i, 0], walkers.position[i, 1])
        distance = max(length(wall_x, wall_y), 1e-6)
        gap = max(distance - barriers[k, RADIUS] - radius, 0.0)
        push = exp(gap * (-1.0 / decay_length)) * (-strength) / distance
        total_x += push * wall_x
        total_y += push * wall_y
    return total_x, total_y


@subroutine
def fill_walls(
    walls: Array, walkers: Walkers, i: int, barriers: Array, outline: tuple[float, float, float, float], time: float,
    reach: float,
) -> int:  # fmt: skip
    """Find how fast agent i can approach walls and furniture near it without reaching them within a given time.

    Args:
        walls: (B, 3), is filled: unit vector to the barrier, and largest speed in this direction, m/s.
        walkers: all agents.
        i: index of the agent.
        barriers: (B, 8), rows of `Barriers.table`.
        outline: radius and `Walkers.shoulder`, m, and unit vector of the heading.
        time: s.
        reach: distance of a barrier beyond which it is left out, m.

    Returns:
        Number of rows that were filled.
    """
    radius, shoulder, bx, by = outline
    count = 0
    for n in range(walkers.wall_start[i], walkers.wall_start[i + 1]):
        k = walkers.wall[n]
        dx, dy = towards(barriers, k, walkers.position[i, 0], walkers.position[i, 1])
        square, limit = dx * dx + dy * dy, reach + barriers[k, RADIUS]
        if square > limit * limit:
            continue
        distance = max(math.sqrt(square), 1e-6)
        nx, ny = dx / distance, dy / distance
        gap = distance - barriers[k, RADIUS] - radius - extent(nx, ny, bx, by, shoulder)
        walls[count, 0], walls[count, 1], walls[count, 2] = nx, ny, max(gap, 0.0) / time
        count += 1
    return count


@subroutine
def offset_of_group(walkers: Walkers, i: int) -> tuple[float, float, float]:
    """The other members of an agent's walking group.

    Returns:
        The sum of the vectors from agent i to them (x, y), m, and their number.
    """
    x, y, count = 0.0, 0.0, 0.0
    if walkers.group[i] < 0:
        return x, y, count
    for n in range(walkers.neighbour_start[i], walkers.neighbour_start[i + 1]):
        j = walkers.neighbour[n]
        if walkers.group[j] == walkers.group[i]:
            x += walkers.position[j, 0] - walkers.position[i, 0]
            y += walkers.position[j, 1] - walkers.position[i, 1]
            count += 1.0
    return x, y, count


@subroutine
def attention_to(walkers: Walkers, i: int, j: int) -> float:
    """Attention of agent i to agent j, in [0, 1]; 0 if j is not among its neighbours."""
    low, high = walkers.neighbour_start[i], walkers.neighbour_start[i + 1]
    while low < high:  # binary search in the ascending list
        middle = (low + high) // 2
        if walkers.neighbour[middle] == j:
            return float(walkers.attention[middle])
        if walkers.neighbour[middle] < j:
            low = middle + 1
        else:
            high = middle
    return 0.0
