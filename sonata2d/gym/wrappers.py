"""Wrappers of the environment: other observations and actions.

All but `History` and `Noise` are functions of the present observation. Wrappers can be combined; `WorldFrame`,
`FieldOfView`, `Noise`, `Lidar` and `Graph` read the dictionary of `SocialNavEnv` and come before `Flat`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar, Literal

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array
from gymnasium.wrappers import NormalizeObservation

from ..agents.sensors.base import Measure, SensorNoise, angle_of_view
from ..agents.sensors.lidar import Lidar as Sensor
from ..core.arguments import finite_number, positive_number, whole_number
from ..core.files.limits import MAX_OBSERVATION, MAX_ROWS
from ..core.furniture_types import OBJECT_TYPES
from ..core.portable_math import PI, Array, BoolArray
from ..core.rays import visible
from ..core.relations import ACTIVITIES, RELATIONS
from ..core.scene import Scene
from ..core.wording import one_line
from ..registry import did_you_mean
from .env import Env, SocialNavEnv, base_of, wrappers_of
from .parts import FARTHEST, STANDARD, Floats32, Observation, Table


def has_memory(wrapper: gymnasium.Wrapper[Any, Any, Any, Any]) -> bool:
    """Whether a wrapper of another package is stateful.

    Observation and action wrappers are stateful if they override `reset` or `step`; any other wrapper counts as
    stateful if it changes a space.
    """
    if isinstance(wrapper, EpisodeWrapper):  # `restore` repeats its observations
        return False
    if isinstance(wrapper, NormalizeObservation):  # overrides nothing, but updates its mean in `observation`
        return wrapper.update_running_mean
    for base in (gymnasium.ObservationWrapper, gymnasium.ActionWrapper):
        if isinstance(wrapper, base):
            return type(wrapper).reset is not base.reset or type(wrapper).step is not base.step
    if type(wrapper).__name__ in ("MaxAndSkipObservation", "RepeatAction"):  # change the time of observations only
        return True
    inner = wrapper.env
    return wrapper.observation_space != inner.observation_space or wrapper.action_space != inner.action_space


class EpisodeWrapper(gymnasium.ObservationWrapper[Any, Any, Any], RecordConstructorArgs):
    """Base class of the wrappers of observations.

    The state of a wrapper may depend on the observations since the beginning of the episode only, so that `restore` can
    repeat them.

    Attributes:
        reads: names of the parts on which other parts of the wrapper's observation depend.
    """

    reads: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, env: Env, **arguments: Any) -> None:
        # numbers of NumPy as numbers of Python, for files
        plain = {key: value.item() if isinstance(value, np.generic) else value for key, value in arguments.items()}
        RecordConstructorArgs.__init__(self, **plain)
        super().__init__(env)

    def begin(self) -> None:
        """Begin an episode: forget the last one."""

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        self.begin()
        return super().reset(seed=seed, options=options)

    def _parts(self) -> spaces.Dict:
        """The space of the wrapped environment, which must have the parts of `SocialNavEnv`.

        Raises:
            TypeError: a wrapper inside has changed a part.
        """
        space, base_space, name = self.env.observation_space, self._base.encoder.space, type(self).__name__
        if not isinstance(space, spaces.Dict) or "humans" not in space.spaces:
            is_frame = isinstance(self, WorldFrame) and isinstance(self.env, Lidar)
            way = "use Lidar(keep=True)" if is_frame else f"put {name} inside it"
            got = one_line(shape_of(space), 100)
            raise TypeError(f"{name} needs the dictionary of SocialNavEnv, got {got} of {self.env}; {way}")
        for part in base_space.spaces:
            if part not in space.spaces or space[part].shape != base_space[part].shape:
                raise TypeError(
                    f"{name} needs the parts of SocialNavEnv in the robot's frame, but {part!r} was changed inside "
                    f"{self.env}; put {name} inside WorldFrame and History"
                )
        return space

    def _bodies(self) -> tuple[Array, BoolArray, Array, Array]:
        """The first arguments of the kernels of `core.rays`.

        Returns:
            The row of the present state; for each of the N pedestrians, whether it is in the room, (N,), its radius
            and half the length of its shoulder line, (N,), m.
        """
        state, table = self._base.snapshot.state, self._base.scene.human_table
        return state.row, self._base.encoder.present(state), table.radius, table.shoulder

    @property
    def _base(self) -> SocialNavEnv:
        return base_of(self.env)


class Flat(EpisodeWrapper):
    """All parts of floats, one after another, as one array.

    Args:
        env: with observations in a dictionary.
        keys: parts to keep, in this order; None: all parts of floats, in alphabetical order. Parts of integers are
            taken as floats if they are named.
    """

    def __init__(self, env: Env, keys: Iterable[str] | None = None) -> None:
        keys = None if keys is None else tuple(map(str, keys))
        super().__init__(env, keys=keys)
        space = env.observation_space
        if not isinstance(space, spaces.Dict):
            raise TypeError(f"Flat needs observations in a dictionary, got {shape_of(space)} of {env}")
        self.keys = tuple(name for name in space if space[name].dtype == np.float32) if keys is None else keys
        if not self.keys:
            raise ValueError(
                f"keys must name one or more parts of {', '.join(space.spaces)}; None: all parts of floats"
            )
        for name in self.keys:
            if name not in space.spaces:
                hint = did_you_mean(name, space.spaces) or f"; it has {', '.join(space.spaces)}"
                raise ValueError(f"the observation has no part {name!r}{hint}")
        self.observation_space = flat_space(space, self.keys)

    def observation(self, observation: Observation) -> Floats32:
        return np.concatenate([observation[name].ravel() for name in self.keys], dtype=np.float32)


def flat_space(space: spaces.Dict, keys: Iterable[str] | None = None) -> spaces.Box:
    """The space of parts one after another, as one array; None: of all parts of floats, in alphabetical order."""
    names = [name for name in space if space[name].dtype == np.float32] if keys is None else keys
    boxes: list[Any] = [batch_space(space[name], 1) for name in names]  # also of parts of integers
    low = np.concatenate([box.low.ravel() for box in boxes], dtype=np.float32)
    high = np.concatenate([box.high.ravel() for box in boxes], dtype=np.float32)
    return spaces.Box(low, high, dtype=np.float32)


def shape_of(space: spaces.Space[Any]) -> str:
    """Kind and shape of a space, in words; bounds are left out, because they depend on the scenario."""
    if isinstance(space, spaces.Dict):
        return ", ".join(f"{name} {shape_of(part)}" for name, part in space.items())
    if isinstance(space, spaces.Discrete):
        return f"Discrete({space.n})"
    return f"{type(space).__name__}{space.shape}"


_WORLD = 10_000.0  # m, bound of coordinates in the world frame


class WorldFrame(EpisodeWrapper):
    """Positions, velocities and directions in the frame of the world instead of the robot's.

    Coordinates are clipped to ±10 km. The part `robot` begins with the robot's own x, y (m), cosine and sine of its
    heading. Of all parts, the columns with `axes` change.
    """

    def __init__(self, env: Env) -> None:
        super().__init__(env)
        space = self._parts()
        self._turned = [part for part in self._base.encoder.parts if part.pairs()]
        boxes: dict[str, spaces.Box] = {}
        for part in self._turned:
            inner = space[part.name]
            assert isinstance(inner, spaces.Box)
            is_point = np.array([column.axes == "point" for column in part.columns])
            low, high = np.where(is_point, -_WORLD, inner.low), np.where(is_point, _WORLD, inner.high)
            boxes[part.name] = spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)
        self._clipped = dict(boxes)
        pose = np.array([_WORLD, _WORLD, 1.0, 1.0], dtype=np.float32)
        robot = boxes["robot"]
        boxes["robot"] = spaces.Box(np.concatenate((-pose, robot.low)), np.concatenate((pose, robot.high)))
        self.observation_space = spaces.Dict({**space.spaces, **boxes})

    def observation(self, observation: Observation) -> Observation:
        robot = self._base.snapshot.robot
        (x, y), (c, s) = robot.position, robot.direction
        result = dict(observation)
        for part in self._turned:
            rows, box = observation[part.name].astype(float), self._clipped[part.name]
            for k, column in part.pairs():
                origin_x, origin_y = (x, y) if column.axes == "point" else (0.0, 0.0)
                ahead, left = rows[..., k].copy(), rows[..., k + 1].copy()
                rows[..., k], rows[..., k + 1] = origin_x + ahead * c - left * s, origin_y + ahead * s + left * c
            if part.rows_of:
                rows *= observation[f"{part.rows_of}_mask"][:, None]  # empty rows stay 0
            result[part.name] = np.clip(rows, box.low, box.high).astype(np.float32)
        pose = np.clip([x, y, c, s], -_WORLD, _WORLD).astype(np.float32)
        result["robot"] = np.concatenate((pose, result["robot"]))
        return result


class Noise(EpisodeWrapper):
    """Normally distributed noise in positions, velocities and directions of pedestrians and furniture.

    It is added to the columns with `axes` of all tables of these, and derived parts are computed from the noisy rows.
    The noise of a tick depends on seed, episode and tick only.

    Args:
        env: with the dictionary of `SocialNavEnv`.
        position: standard deviation of positions, m.
        velocity: of velocities, m/s.
        angle: of headings and gazes, rad.
    """

    def __init__(self, env: Env, position: float = 0.05, velocity: float = 0.05, angle: float = 0.05) -> None:
        given = {"position": position, "velocity": velocity, "angle": angle}
        deviations = {name: finite_number(name, value, 0.0) for name, value in given.items()}
        super().__init__(env, **deviations)
        self._parts()
        self._deviations = tuple(deviations.values())
        self._depth = sum(isinstance(wrapper, Noise) for wrapper in wrappers_of(env))  # so that two noises differ

    def observation(self, observation: Observation) -> Observation:
        base, (position, velocity, angle) = self._base, self._deviations
        scene = base.scene
        random = np.random.default_rng([scene.seed, scene.episode, base.snapshot.tick, self._depth])
        result = dict(observation)
        for part in base.encoder.parts:
            if part.rows_of not in ("humans", "objects") or not part.pairs():
                continue
            rows = observation[part.name].astype(float)
            for k, column in part.pairs():
                a, b = rows[:, k].copy(), rows[:, k + 1].copy()
                if column.unit:  # a position or a velocity
                    deviation = position if column.axes == "point" else velocity
                    rows[:, k : k + 2] += deviation * random.standard_normal((len(rows), 2))
                else:  # a unit vector is turned, so that it keeps its length
                    turn = angle * random.standard_normal(len(rows))
                    rows[:, k] = a * np.cos(turn) - b * np.sin(turn)
                    rows[:, k + 1] = b * np.cos(turn) + a * np.sin(turn)
            rows *= observation[f"{part.rows_of}_mask"][:, None]
            result[part.name] = np.clip(rows, *part.bounds()).astype(np.float32)
        base.encoder.derive(result)
        return result


class FieldOfView(EpisodeWrapper):
    """A field of view: only pedestrians and furniture that the robot sees have rows; walls and the goal are known.

    An entity is seen if its centre, or one of the ends of a pedestrian's shoulders, is within angle and distance, and
    neither a wall nor another pedestrian is in between, whether these have rows or not. Furniture hides nothing: people
    see over it. Interactions are observed if both sides are. The rows of hidden entities are cleared in every part that
    has rows of them, and derived parts are computed from the rows that remain.

    Args:
        env: with the dictionary of `SocialNavEnv`.
        angle: of the field of view, rad, its middle straight ahead.
        distance: within which entities are seen, m.
        occlusion: whether walls and pedestrians hide what is behind them.
    """

    def __init__(
        self, env: Env, angle: float = 2.0 * math.pi / 3.0, distance: float = 10.0, occlusion: bool = True
    ) -> None:
        angle, distance = angle_of_view(angle), positive_number("distance", distance)
        super().__init__(env, angle=angle, distance=distance, occlusion=occlusion)
        self._parts()
        self._cosine, self._distance, self._occlusion = math.cos(angle / 2.0), distance, occlusion

    def observation(self, observation: Observation) -> Observation:
        result = {name: part.copy() for name, part in observation.items()}
        encoder, count = self._base.encoder, len(observation["humans"])
        is_seen = np.concatenate((observation["humans_mask"], observation["objects_mask"])) > 0.0
        visible(
            *self._bodies(), encoder.objects, encoder.walls, encoder.rows.humans, encoder.rows.objects, self._cosine,
            self._distance, self._occlusion, 1, is_seen,
        )  # fmt: skip
        encoder.hide(result, is_seen[:count], is_seen[count:])
        return result


class Lidar(EpisodeWrapper):
    """Distances along rays from the centre of the robot, in the part `lidar`, instead of the parts about entities.

    The parts about robot and goal only stay.

    The part holds the readings of a `sonata2d.agents.Lidar`: the rays end at all walls, pieces of furniture on the
    floor, and pedestrians in the room, whether these have rows or not; so `Noise` and `FieldOfView` change no range.
    The first of rays all around points straight ahead, that of a smaller field of view to its right end; the others
    follow counter-clockwise at equal angles.

    Args:
        env: with the dictionary of `SocialNavEnv`.
        rays: their number.
        distance: range, m, which is also the value of a ray that meets nothing or was lost.
        keep: whether the other parts of the observation stay.
        angle: of the field of view, rad, its middle at `heading`.
        mount: position of the scanner in the frame of the robot, m.
        heading: of the scanner in the frame of the robot, rad.
        noise: standard deviation of ranges, m; it depends on seed, episode and tick only.
        dropout: probability that a ray is lost.
        sees: of people, their bodies at the height of the shoulders, or two legs.
    """

    def __init__(
        self, env: Env, rays: int = 72, distance: float = 10.0, keep: bool = False, *, angle: float = 2.0 * PI,
        mount: tuple[float, float] = (0.0, 0.0), heading: float = 0.0, noise: float = 0.0, dropout: float = 0.0,
        sees: Literal["bodies", "legs"] = "bodies",
    ) -> None:  # fmt: skip
        rays, self._distance = whole_number("rays", rays, 1, MAX_ROWS), positive_number("distance", distance)
        place = tuple(mount) if isinstance(mount, (list, tuple)) else mount
        others: dict[str, Any] = {"angle": angle, "mount": place, "noise": noise, "dropout": dropout, "sees": sees}
        super().__init__(env, rays=rays, distance=self._distance, keep=keep, heading=heading, **others)
        is_turn = angle_of_view(angle) >= 2.0 * PI - 1e-9
        middle = finite_number("heading", heading) + (PI if is_turn else 0.0)  # the sensor begins behind
        self._sensor = Sensor(rays=rays, distance=self._distance, nearest=0.0, heading=middle, **others)
        self._scene: Scene | None = None
        self._measure: Measure | None = None
        space = self._parts()
        parts = [part.name for part in self._base.encoder.parts if part.about <= {"robot", "goal"}]
        self._kept = tuple(space.spaces) if keep else tuple(parts)
        box = spaces.Box(np.float32(0.0), np.float32(distance), (rays,), np.float32)
        self.observation_space = spaces.Dict({**{name: space[name] for name in self._kept}, "lidar": box})

    def observation(self, observation: Observation) -> Observation:
        scene, snapshot = self._base.scene, self._base.snapshot
        if self._measure is None or scene is not self._scene:
            self._scene, self._measure = scene, self._sensor.start(scene)
        ranges = self._measure(snapshot, SensorNoise(scene, self._sensor.name, snapshot.tick)).ranges
        is_short = ranges < self._distance  # neither infinite nor lost
        ranges = np.where(is_short, ranges, self._distance).astype(np.float32)
        return {**{name: observation[name] for name in self._kept}, "lidar": ranges}

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_scene": None, "_measure": None}  # a copy begins its sensor again


_NODE_TYPES = ("robot", "goal", "human", "object", "wall")
_MOTION = ("x", "y", "vx", "vy", "cos", "sin", "gaze_cos", "gaze_sin", "omega")
NODE_FEATURES = (*(f"is_{name}" for name in _NODE_TYPES), *_MOTION, "length", "width", *ACTIVITIES, *OBJECT_TYPES)
EDGE_TYPES = ("robot", *RELATIONS)
_FEATURE = {name: k for k, name in enumerate(NODE_FEATURES)}


def _nodes(kind: str, mask: Floats32, **columns: Any) -> Floats32:
    """Rows of `Graph.nodes` of one type, from their mask and the columns that are not 0."""
    nodes = np.zeros((len(mask), len(NODE_FEATURES)), dtype=np.float32)
    nodes[:, _FEATURE[f"is_{kind}"]] = mask
    for name, values in columns.items():
        nodes[:, _FEATURE[name]] = values
    return nodes


class Graph(EpisodeWrapper):
    """The observation as a graph in arrays of constant shape: `nodes`, `nodes_mask`, `edges`, `edge_types`,
    `edges_mask`.

    The nodes are the robot, the goal, and the rows of pedestrians, objects and walls; columns `NODE_FEATURES`. Edges
    are pairs of nodes (source, destination): both ways between the robot and every other node, and both ways for each
    interaction; types `EDGE_TYPES`. Further parts of the observation are left out.
    """

    reads = frozenset(part.name for part in STANDARD)

    def __init__(self, env: Env) -> None:
        super().__init__(env)
        self._parts()
        sizes = self._base.encoder.sizes
        nodes = 2 + sizes.humans + sizes.objects + sizes.walls
        count = 2 * (nodes - 1) + 2 * sizes.interactions
        bound, unit = np.full((nodes, len(NODE_FEATURES)), FARTHEST, dtype=np.float32), np.float32(1.0)
        self._to_robot = np.array([(k, 0) for k in range(1, nodes)] + [(0, k) for k in range(1, nodes)])
        self.observation_space = spaces.Dict(
            {
                "nodes": spaces.Box(-bound, bound, dtype=np.float32),
                "nodes_mask": spaces.Box(np.float32(0.0), unit, (nodes,), np.float32),
                "edges": spaces.Box(0, nodes - 1, (count, 2), np.int64),
                "edge_types": spaces.MultiDiscrete([len(EDGE_TYPES)] * count),
                "edges_mask": spaces.Box(np.float32(0.0), unit, (count,), np.float32),
            }
        )

    def observation(self, observation: Observation) -> Observation:
        robot, goal, humans, objects, walls = (Table(part, observation[part.name]) for part in STANDARD[:5])
        unit = np.ones(1, dtype=np.float32)
        human_mask, object_mask, wall_mask = (observation[f"{kind}_mask"] for kind in ("humans", "objects", "walls"))
        robot_size, goal_size, depth = 2.0 * robot["radius"], 2.0 * goal["distance"], 2.0 * humans["radius"]
        breadth = 2.0 * (humans["radius"] + humans["shoulder"])
        along_x, along_y = walls["end_x"] - walls["start_x"], walls["end_y"] - walls["start_y"]
        middle_x, middle_y = (walls["end_x"] + walls["start_x"]) / 2.0, (walls["end_y"] + walls["start_y"]) / 2.0
        size = np.sqrt(along_x * along_x + along_y * along_y)
        cos, sin = along_x / np.maximum(size, 1e-6), along_y / np.maximum(size, 1e-6)
        blocks = [
            _nodes("robot", unit, cos=1.0, length=robot_size, width=robot_size, **robot.columns("vx", "vy", "omega")),
            _nodes("goal", unit, length=goal_size, width=goal_size, **goal.columns("x", "y", "cos", "sin")),
            _nodes("human", human_mask, length=depth, width=breadth, **humans.columns(*_MOTION)),
            _nodes("object", object_mask, **objects.columns("x", "y", "cos", "sin", "length", "width")),
            _nodes("wall", wall_mask, x=middle_x, y=middle_y, cos=cos, sin=sin, length=size),
        ]
        blocks[2][np.arange(len(humans)), _FEATURE[ACTIVITIES[0]] + observation["activities"]] = human_mask
        blocks[3][np.arange(len(objects)), _FEATURE[OBJECT_TYPES[0]] + observation["object_types"]] = object_mask
        mask = np.concatenate((unit, unit, human_mask, object_mask, wall_mask))
        return {"nodes": np.concatenate(blocks), "nodes_mask": mask, **self._edges(observation, mask)}

    def _edges(self, observation: Observation, nodes_mask: Floats32) -> Observation:
        """The edges with their types and mask; edges of absent nodes are 0."""
        interactions, linked = observation["interactions"], observation["interactions_mask"]
        links = 2 + interactions[:, [0, 2]]  # pedestrians come right after robot and goal, objects after them
        edges = np.concatenate((self._to_robot, links, links[:, ::-1]))
        kinds = np.concatenate((np.zeros(len(self._to_robot), dtype=np.int64), *(1 + interactions[:, 1],) * 2))
        mask = np.concatenate((nodes_mask[self._to_robot].min(axis=1), linked, linked)).astype(np.float32)
        there = mask > 0.0
        return {"edges": edges * there[:, None], "edge_types": kinds * there, "edges_mask": mask}


class History(EpisodeWrapper):
    """The last observations, the newest last, along a further first axis; at the beginning the first one is repeated.

    Args:
        env: with one array, or a dictionary of arrays.
        length: number of observations.
    """

    def __init__(self, env: Env, length: int = 4) -> None:
        self._length = length = whole_number("length", length, 1)
        super().__init__(env, length=length)
        numbers = length * spaces.flatdim(env.observation_space)
        if numbers > MAX_OBSERVATION:
            raise ValueError(f"{length} observations hold {numbers} numbers; the limit is {MAX_OBSERVATION}")
        self._past: deque[Any] = deque(maxlen=length)
        self.observation_space: spaces.Space[Any] = batch_space(env.observation_space, length)

    def begin(self) -> None:
        self._past.clear()

    def observation(self, observation: Any) -> Any:
        self._past.append(observation)
        while len(self._past) < self._length:
            self._past.append(observation)
        return stacked(self.env.observation_space, self._past)


def stacked(space: spaces.Space[Any], observations: Iterable[Any]) -> Any:
    """Observations of a space as one, with a further first axis."""
    parts = tuple(observations)
    batch: Any = create_empty_array(space, len(parts))
    return concatenate(space, parts, batch)


# Fractions of the limits: forward, left, turn.
MOVES = {
    "stop": (0.0, 0.0, 0.0), "forward": (1.0, 0.0, 0.0), "forward left": (0.7, 0.0, 0.7),
    "forward right": (0.7, 0.0, -0.7), "turn left": (0.0, 0.0, 1.0), "turn right": (0.0, 0.0, -1.0),
    "slow": (0.4, 0.0, 0.0), "back": (-1.0, 0.0, 0.0),
}  # fmt: skip


class DiscreteActions(gymnasium.ActionWrapper[Any, Any, Any], RecordConstructorArgs):
    """One of some moves instead of fractions of the robot's limits.

    Args:
        env: with the actions of `SocialNavEnv`.
        moves: fractions of the limits forward, left and turning; None: the eight `MOVES`. A unicycle does not move
            left.

    Raises:
        TypeError: the environment has not the actions of `SocialNavEnv`.
        ValueError: the moves are not rows of three fractions.
    """

    def __init__(self, env: Env, moves: Sequence[Sequence[float]] | None = None) -> None:
        rows = None if moves is None else [[float(value) for value in move] for move in moves]
        RecordConstructorArgs.__init__(self, moves=rows)  # as plain data
        super().__init__(env)
        if not isinstance(env.action_space, spaces.Box) or env.action_space.shape not in ((3,), (2,)):
            raise TypeError(f"DiscreteActions needs the actions of SocialNavEnv, got {env.action_space} of {env}")
        table = np.array(list(MOVES.values()) if moves is None else moves, dtype=np.float32)
        if table.ndim != 2 or table.shape[0] < 1 or table.shape[1] != 3 or not (np.abs(table) <= 1.0).all():
            raise ValueError("moves must be one or more rows of three fractions in [-1, 1]: forward, left, turn")
        self._table = table if env.action_space.shape == (3,) else table[:, [0, 2]]
        self.action_space = spaces.Discrete(len(table))

    def action(self, action: Any) -> Floats32:
        if not self.action_space.contains(action):
            raise ValueError(f"an action is an index of the {len(self._table)} moves, got {action!r}")
        move: Floats32 = self._table[int(action)]
        return move

    def nearest(self, action: Floats32) -> int:
        """Index of the move that is nearest to an action of the wrapped environment."""
        return int(np.argmin(((self._table - action) ** 2).sum(axis=1)))
