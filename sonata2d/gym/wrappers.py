"""Wrappers of the environment: other observations and actions.

All but `History` and `Noise` are functions of the present observation. Wrappers can be combined; those that read the
dictionary of `SocialNavEnv` (`WorldFrame`, `FieldOfView`, `Noise`, `Lidar`, `Graph`) come before `Flat`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.wrappers import NormalizeObservation
from numpy.typing import NDArray

from ..core.furniture_types import OBJECT_TYPES
from ..core.portable_math import PI, unit_vectors
from ..core.relations import ACTIVITIES, RELATIONS
from ..registry import did_you_mean
from .env import SocialNavEnv, base_of, wrappers_of
from .observation import FARTHEST, GOAL, HUMAN, OBJECT, ROBOT, WALL, Floats32, Observation
from .sensing import measure_ranges, visible

Env = gymnasium.Env[Any, Any]


def changes_spaces(env: gymnasium.Wrapper[Any, Any, Any, Any]) -> bool:
    """Whether the observations or actions of a wrapper have other spaces than those inside it."""
    inner = env.env
    return env.observation_space != inner.observation_space or env.action_space != inner.action_space


def has_memory(wrapper: gymnasium.Wrapper[Any, Any, Any, Any]) -> bool:
    """Whether what a wrapper of another package does to observations or actions depends on more than the present ones.

    Those of values have a memory if they have methods of their own to update it; of the others it is known whether they
    change anything only if the spaces change.
    """
    if isinstance(wrapper, EpisodeWrapper):
        return False
    if isinstance(wrapper, NormalizeObservation):
        return wrapper.update_running_mean
    for base in (gymnasium.ObservationWrapper, gymnasium.ActionWrapper):
        if isinstance(wrapper, base):
            return type(wrapper).reset is not base.reset or type(wrapper).step is not base.step
    return changes_spaces(wrapper) or type(wrapper).__name__ in ("MaxAndSkipObservation", "RepeatAction")


class EpisodeWrapper(gymnasium.ObservationWrapper[Any, Any, Any], RecordConstructorArgs):
    """Base class of the wrappers of observations.

    What a wrapper remembers must follow from the observations since the beginning of the episode, so that `restore`
    can repeat it.
    """

    def __init__(self, env: Env, **arguments: Any) -> None:
        # numbers of NumPy as those of Python, for files
        plain = {key: value.item() if isinstance(value, np.generic) else value for key, value in arguments.items()}
        RecordConstructorArgs.__init__(self, **plain)
        super().__init__(env)

    def begin(self) -> None:
        """Begin an episode: forget the last one."""

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        self.begin()
        return super().reset(seed=seed, options=options)

    def _parts(self) -> spaces.Dict:
        """The space of the wrapped environment, whose parts must be those of a `SocialNavEnv`.

        Raises:
            TypeError: a wrapper inside has changed them.
        """
        space, own, name = self.env.observation_space, self._base.encoder.space, type(self).__name__
        if not isinstance(space, spaces.Dict) or "humans" not in space.spaces:
            is_frame = isinstance(self, WorldFrame) and isinstance(self.env, Lidar)
            way = "use Lidar(keep=True)" if is_frame else f"put {name} inside it"
            raise TypeError(f"{name} needs the dictionary of SocialNavEnv, got {_shape_of(space)} of {self.env}; {way}")
        for part in own.spaces:
            if part not in space.spaces or space[part].shape != own[part].shape:
                raise TypeError(
                    f"{name} needs the parts of SocialNavEnv in the robot's frame, but {part!r} was changed inside "
                    f"{self.env}; put {name} inside WorldFrame and History"
                )
        return space

    def _require_rows(self, *names: str) -> None:
        """Require a row for each entity of some kinds, because those without one would not be in the way.

        Raises:
            ValueError: there are fewer rows than the scenario may have entities.
        """
        own, needed = asdict(self._base.encoder.sizes), asdict(self._base.entities)
        for name in names:
            if own[name] < needed[name]:
                raise ValueError(
                    f"{type(self).__name__} needs rows of all {name}, because they hide what is behind them: "
                    f"sizes[{name!r}] is {own[name]}, the scenario has up to {needed[name]}; leave out this size"
                )

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
            raise TypeError(f"Flat needs observations in a dictionary, got {_shape_of(space)} of {env}")
        self._keys = tuple(name for name in space if space[name].dtype == np.float32) if keys is None else keys
        if not self._keys:
            raise ValueError(f"keys must name one or more parts of {', '.join(space.spaces)}; None: those of floats")
        for name in self._keys:
            if name not in space.spaces:
                hint = did_you_mean(name, space.spaces) or f"; it has {', '.join(space.spaces)}"
                raise ValueError(f"the observation has no part {name!r}{hint}")
        bounds = [_bounds(space[name]) for name in self._keys]
        low, high = (np.concatenate([bound[k].ravel() for bound in bounds]) for k in range(2))
        self.observation_space = spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)

    def observation(self, observation: Observation) -> Floats32:
        return np.concatenate([observation[name].ravel() for name in self._keys], dtype=np.float32)


def _shape_of(space: spaces.Space[Any]) -> str:
    """A space in a few words: its bounds may fill pages."""
    if isinstance(space, spaces.Dict):
        return f"the parts {', '.join(space.spaces)}"
    return f"{type(space).__name__} of the shape {space.shape}"


def _bounds(space: spaces.Space[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Lowest and highest values of a part of an observation."""
    if isinstance(space, spaces.MultiDiscrete):
        return np.zeros(space.shape), space.nvec - 1
    assert isinstance(space, spaces.Box)
    return space.low, space.high


# Columns of vectors, by the part of the observation; those of points move with the origin of the frame.
_POINTS = (("x", "y"), ("start_x", "start_y"), ("end_x", "end_y"))
_VECTORS = (("vx", "vy"), ("cos", "sin"), ("gaze_cos", "gaze_sin"))
_WORLD = 10_000.0  # m, bound of coordinates in the world frame
_COLUMNS = {"robot": ROBOT, "goal": GOAL, "humans": HUMAN, "objects": OBJECT, "walls": WALL}


def _in_world(columns: dict[str, float]) -> NDArray[np.float64]:
    """The bounds of columns in the world frame."""
    points = {name for pair in _POINTS for name in pair}
    return np.array([_WORLD if name in points else bound for name, bound in columns.items()])


class WorldFrame(EpisodeWrapper):
    """Positions, velocities and directions in the frame of the world instead of the robot's.

    Coordinates are clipped to ±10 km. The part `robot` begins with the robot's own x, y (m), cosine and sine of its
    heading.
    """

    def __init__(self, env: Env) -> None:
        super().__init__(env)
        space = self._parts()
        robot = space["robot"]
        assert isinstance(robot, spaces.Box)
        self._high = {name: _in_world(columns) for name, columns in _COLUMNS.items()}
        boxes: dict[str, spaces.Space[Any]] = {}
        for name in ("goal", "humans", "objects", "walls"):
            inner = space[name]
            assert isinstance(inner, spaces.Box)
            high = np.broadcast_to(self._high[name], inner.shape).astype(np.float32)
            boxes[name] = spaces.Box(np.where(inner.low < 0.0, -high, inner.low), high, dtype=np.float32)
        own = np.array([_WORLD, _WORLD, 1.0, 1.0], dtype=np.float32)
        boxes["robot"] = spaces.Box(
            np.concatenate((-own, robot.low)), np.concatenate((own, robot.high)), (9,), np.float32
        )
        self.observation_space = spaces.Dict({**space.spaces, **boxes})

    def observation(self, observation: Observation) -> Observation:
        robot = self._base.snapshot.robot
        (x, y), (c, s) = robot.position, robot.direction
        result = dict(observation)
        for name, columns in _COLUMNS.items():
            rows, names = observation[name].astype(float), list(columns)
            for pair in (*_POINTS, *_VECTORS):
                if pair[0] in names:
                    i, k = names.index(pair[0]), names.index(pair[1])
                    at_x, at_y = (x, y) if pair in _POINTS else (0.0, 0.0)
                    a, b = rows[..., i].copy(), rows[..., k].copy()
                    rows[..., i], rows[..., k] = at_x + a * c - b * s, at_y + a * s + b * c
            if f"{name}_mask" in observation:
                rows *= observation[f"{name}_mask"][:, None]  # rows of absent entities stay 0
            result[name] = np.clip(rows, -self._high[name], self._high[name]).astype(np.float32)
        own = np.clip([x, y, c, s], -_WORLD, _WORLD).astype(np.float32)
        result["robot"] = np.concatenate((own, result["robot"]))
        return result


class Noise(EpisodeWrapper):
    """Normally distributed noise in what is observed of pedestrians and furniture.

    The noise of a tick depends on seed, episode and tick only.

    Args:
        env: with the dictionary of `SocialNavEnv`.
        position: standard deviation of positions, m.
        velocity: of velocities, m/s.
        angle: of headings and gazes, rad.
    """

    def __init__(self, env: Env, position: float = 0.05, velocity: float = 0.05, angle: float = 0.05) -> None:
        super().__init__(env, position=position, velocity=velocity, angle=angle)
        self._parts()
        for name, value in (("position", position), ("velocity", velocity), ("angle", angle)):
            if not 0.0 <= value < math.inf:
                raise ValueError(f"{name} must be a standard deviation of 0 or more, got {value!r}")
        self._deviations = position, velocity, angle
        self._depth = sum(isinstance(wrapper, Noise) for wrapper in wrappers_of(env))  # so that two noises differ

    def observation(self, observation: Observation) -> Observation:
        base, (position, velocity, angle) = self._base, self._deviations
        random = np.random.default_rng([*base.episode_id, base.snapshot.tick, self._depth])
        result = dict(observation)
        for name in ("humans", "objects"):
            rows, columns = observation[name].astype(float), list(_COLUMNS[name])
            for pair, deviation in ((("x", "y"), position), (("vx", "vy"), velocity)):
                if pair[0] in columns:
                    at = columns.index(pair[0])
                    rows[:, at : at + 2] += deviation * random.standard_normal((len(rows), 2))
            for pair in (("cos", "sin"), ("gaze_cos", "gaze_sin")):
                if pair[0] in columns:
                    at, turn = columns.index(pair[0]), angle * random.standard_normal(len(rows))
                    c, s = rows[:, at].copy(), rows[:, at + 1].copy()
                    rows[:, at] = c * np.cos(turn) - s * np.sin(turn)
                    rows[:, at + 1] = s * np.cos(turn) + c * np.sin(turn)
            rows *= observation[f"{name}_mask"][:, None]
            high = np.array(list(_COLUMNS[name].values()))
            result[name] = np.clip(rows, -high, high).astype(np.float32)
        return result


class FieldOfView(EpisodeWrapper):
    """Only the pedestrians and the furniture that the robot can see; walls and the goal are known.

    An entity is seen if its centre, or one of the ends of a pedestrian's shoulders, is within angle and distance, and
    neither a wall nor another pedestrian is in between. Furniture hides nothing: people see over it. Interactions are
    observed if both sides are.

    Args:
        env: with the dictionary of `SocialNavEnv`.
        angle: of the field of view, rad, its middle straight ahead.
        distance: within which entities are seen, m.
        occlusion: whether walls and pedestrians hide what is behind them.
    """

    def __init__(
        self, env: Env, angle: float = 2.0 * math.pi / 3.0, distance: float = 10.0, occlusion: bool = True
    ) -> None:
        super().__init__(env, angle=angle, distance=distance, occlusion=occlusion)
        self._parts()
        if not 0.0 < angle <= 2.0 * math.pi:
            raise ValueError(f"angle must be above 0 and at most 2 pi, got {angle!r}")
        if not 0.0 < distance < math.inf:
            raise ValueError(f"distance must be positive and finite, got {distance!r}")
        if occlusion:
            self._require_rows("humans", "walls")
        self._cosine, self._distance, self._occlusion = math.cos(angle / 2.0), distance, occlusion

    def observation(self, observation: Observation) -> Observation:
        result = {name: part.copy() for name, part in observation.items()}
        humans, objects, walls = (observation[name].astype(float) for name in ("humans", "objects", "walls"))
        is_seen = np.concatenate((observation["humans_mask"], observation["objects_mask"])) > 0.0
        wall_count = int(observation["walls_mask"].sum()) if self._occlusion else 0
        visible(humans, objects, walls[:wall_count], self._cosine, self._distance, self._occlusion, is_seen)
        human_is_seen, object_is_seen = is_seen[: len(humans)], is_seen[len(humans) :]
        for name, seen in (("humans", human_is_seen), ("objects", object_is_seen)):
            result[name][~seen] = 0.0
            result[f"{name}_mask"][~seen] = 0.0
        result["activities"][~human_is_seen] = 0
        result["object_types"][~object_is_seen] = 0
        ends = observation["interactions"][:, [0, 2]]
        hidden = ~is_seen[ends].all(axis=1)
        result["interactions"][hidden] = 0
        result["interactions_mask"][hidden] = 0.0
        return result


class Lidar(EpisodeWrapper):
    """Distances along rays from the centre of the robot instead of the entities: parts `robot`, `goal` and `lidar`.

    The rays end at walls, furniture and pedestrians; the first one points straight ahead, the others follow
    counter-clockwise at equal angles.

    Args:
        env: with the dictionary of `SocialNavEnv`; the rays end at the walls, objects and pedestrians that have rows.
        rays: their number.
        distance: range, m, which is also the value of a ray that meets nothing.
        keep: whether the other parts of the observation stay.
    """

    def __init__(self, env: Env, rays: int = 72, distance: float = 10.0, keep: bool = False) -> None:
        super().__init__(env, rays=rays, distance=distance, keep=keep)
        if not (isinstance(rays, int | np.integer) and rays >= 1):
            raise ValueError(f"rays must be an integer of 1 or more, got {rays!r}")
        if not 0.0 < distance < math.inf:
            raise ValueError(f"distance must be positive and finite, got {distance!r}")
        space, self._distance = self._parts(), distance
        self._require_rows("humans", "objects", "walls")
        self._kept = tuple(space.spaces) if keep else ("goal", "robot")
        self._directions = unit_vectors(np.arange(rays, dtype=float) * (2.0 * PI / rays))
        box = spaces.Box(np.float32(0.0), np.float32(distance), (rays,), np.float32)
        self.observation_space = spaces.Dict({**{name: space[name] for name in self._kept}, "lidar": box})

    def observation(self, observation: Observation) -> Observation:
        humans, objects, walls = (
            observation[name][observation[f"{name}_mask"] > 0.0].astype(float)
            for name in ("humans", "objects", "walls")
        )
        ranges = np.full(len(self._directions), self._distance)
        measure_ranges(humans, objects, walls, self._directions, ranges)
        return {**{name: observation[name] for name in self._kept}, "lidar": ranges.astype(np.float32)}


# Columns of the nodes of `Graph`.
_NODE_TYPES = ("robot", "goal", "human", "object", "wall")
_NODE = ("x", "y", "vx", "vy", "cos", "sin", "gaze_cos", "gaze_sin", "omega", "length", "width")
NODE_FEATURES = (*(f"is_{name}" for name in _NODE_TYPES), *_NODE, *ACTIVITIES, *OBJECT_TYPES)
EDGE_TYPES = ("robot", *RELATIONS)


class Graph(EpisodeWrapper):
    """The observation as a graph in arrays of constant shape: `nodes`, `nodes_mask`, `edges`, `edge_types`,
    `edges_mask`.

    The nodes are the robot, the goal, and the rows of pedestrians, objects and walls; columns `NODE_FEATURES`. Edges
    are pairs of nodes (source, destination): both ways between the robot and every other node, and both ways for each
    interaction; types `EDGE_TYPES`.
    """

    def __init__(self, env: Env) -> None:
        super().__init__(env)
        space = self._parts()
        rows = [space[name].shape for name in ("humans", "objects", "walls", "interactions")]
        self._humans, self._objects, self._walls, interactions = (shape[0] for shape in rows if shape is not None)
        nodes = 2 + self._humans + self._objects + self._walls
        count = 2 * (nodes - 1) + 2 * interactions
        bound, one = np.full((nodes, len(NODE_FEATURES)), FARTHEST, dtype=np.float32), np.float32(1.0)
        self._to_robot = np.array([(k, 0) for k in range(1, nodes)] + [(0, k) for k in range(1, nodes)])
        self.observation_space = spaces.Dict(
            {
                "nodes": spaces.Box(-bound, bound, dtype=np.float32),
                "nodes_mask": spaces.Box(np.float32(0.0), one, (nodes,), np.float32),
                "edges": spaces.Box(0, nodes - 1, (count, 2), np.int64),
                "edge_types": spaces.MultiDiscrete([len(EDGE_TYPES)] * count),
                "edges_mask": spaces.Box(np.float32(0.0), one, (count,), np.float32),
            }
        )

    def observation(self, observation: Observation) -> Observation:
        humans, objects, walls = self._humans, self._objects, self._walls
        nodes = np.zeros((2 + humans + objects + walls, len(NODE_FEATURES)), dtype=np.float32)
        at = {name: k for k, name in enumerate(NODE_FEATURES)}
        robot, goal = (dict(zip(_COLUMNS[name], observation[name], strict=True)) for name in ("robot", "goal"))
        nodes[0, [at["is_robot"], at["cos"]]] = 1.0
        nodes[0, [at["vx"], at["vy"], at["omega"]]] = robot["vx"], robot["vy"], robot["omega"]
        nodes[0, [at["length"], at["width"]]] = 2.0 * robot["radius"]
        nodes[1, at["is_goal"]] = 1.0
        nodes[1, [at["x"], at["y"], at["cos"], at["sin"]]] = goal["x"], goal["y"], goal["cos"], goal["sin"]
        nodes[1, [at["length"], at["width"]]] = 2.0 * goal["distance"]
        first, mask = 2, [np.ones(2, dtype=np.float32)]
        for name, columns, count in (("humans", HUMAN, humans), ("objects", OBJECT, objects), ("walls", WALL, walls)):
            rows, is_there = nodes[first : first + count], observation[f"{name}_mask"]
            rows[:, at[f"is_{name[:-1]}"]] = is_there
            for k, column in enumerate(columns):
                if column in at:
                    rows[:, at[column]] = observation[name][:, k]
            mask.append(is_there)
            first += count
        human, wall = observation["humans"], observation["walls"]
        radius, shoulder = (human[:, list(HUMAN).index(name)] for name in ("radius", "shoulder"))
        nodes[2 : 2 + humans, at["length"]] = 2.0 * radius
        nodes[2 : 2 + humans, at["width"]] = 2.0 * (radius + shoulder)
        nodes[2 + np.arange(humans), at[ACTIVITIES[0]] + observation["activities"]] = observation["humans_mask"]
        things = 2 + humans + np.arange(objects)
        nodes[things, at[OBJECT_TYPES[0]] + observation["object_types"]] = observation["objects_mask"]
        along = wall[:, 2:] - wall[:, :2]
        size = np.sqrt((along * along).sum(axis=1))
        rows = nodes[2 + humans + objects :]
        rows[:, [at["x"], at["y"]]] = (wall[:, 2:] + wall[:, :2]) / 2.0
        rows[:, [at["cos"], at["sin"]]] = along / np.maximum(size, 1e-6)[:, None]
        rows[:, at["length"]] = size
        return {"nodes": nodes, "nodes_mask": np.concatenate(mask), **self._edges(observation, np.concatenate(mask))}

    def _edges(self, observation: Observation, nodes_mask: Floats32) -> Observation:
        """The edges with their types and mask; those of absent nodes are 0."""
        interactions, linked = observation["interactions"], observation["interactions_mask"]
        links = 2 + interactions[:, [0, 2]]  # pedestrians come right after robot and goal, objects after them
        edges = np.concatenate((self._to_robot, links, links[:, ::-1]))
        kinds = np.concatenate((np.zeros(len(self._to_robot), dtype=np.int64), *(1 + interactions[:, 1],) * 2))
        mask = np.concatenate((nodes_mask[self._to_robot].min(axis=1), linked, linked)).astype(np.float32)
        there = mask > 0.0
        return {"edges": edges * there[:, None], "edge_types": kinds * there, "edges_mask": mask}


class History(EpisodeWrapper):
    """The last observations, the newest last, each part with a further first axis; the first one is repeated.

    Args:
        env: with one array, or a dictionary of arrays.
        length: number of observations.
    """

    def __init__(self, env: Env, length: int = 4) -> None:
        super().__init__(env, length=length)
        if not (isinstance(length, int | np.integer) and length >= 1):
            raise ValueError(f"length must be an integer of 1 or more, got {length!r}")
        self._length = length
        self._past: deque[Any] = deque(maxlen=int(length))
        space = env.observation_space
        if isinstance(space, spaces.Dict):
            self.observation_space: spaces.Space[Any] = spaces.Dict(
                {name: _repeated(part, length) for name, part in space.items()}
            )
        else:
            self.observation_space = _repeated(space, length)

    def begin(self) -> None:
        self._past.clear()

    def observation(self, observation: Any) -> Any:
        self._past.append(observation)
        while len(self._past) < self._length:
            self._past.append(observation)
        if isinstance(observation, dict):
            return {name: np.stack([past[name] for past in self._past]) for name in observation}
        return np.stack(list(self._past))


def _repeated(space: spaces.Space[Any], length: int) -> spaces.Box:
    """The space of `length` values of a space."""
    low, high = _bounds(space)
    return spaces.Box(np.stack([low] * length), np.stack([high] * length), dtype=space.dtype)  # type: ignore[arg-type]


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
        TypeError: the actions are not those of `SocialNavEnv`.
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
        """The index of the move that is nearest to an action of the wrapped environment."""
        return int(np.argmin(((self._table - action) ** 2).sum(axis=1)))
