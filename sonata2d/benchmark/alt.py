"""`alt`: a recurrent network that rates a whole episode, learned from people's ratings.

It follows the ALT metric of Bachiller-Burgos et al., Towards Data-Driven Metrics for Social Robot Navigation
Benchmarking, arXiv 2509.01251: a sequence of vectors of the robot's motion, of metrics and of numbers that describe the
context goes through a gated recurrent unit. The implementation, the scales and the files are sonata2d's own; weights of
the authors' programs cannot be loaded.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..core.arguments import whole_number
from ..core.files.archives import read_npz, write_npz
from ..core.files.limits import MAX_WEIGHTS_BYTES
from ..core.files.optional import optional
from ..core.geometry import contact_times
from ..core.portable_math import Array, IntArray
from ..core.vectors import lengths, wrap_angles
from ..core.wording import one_line
from ..datasets.transforms.split import scene_key
from ..errors import BenchmarkError
from ..metrics.trajectory import Trajectory
from ..record.files import read_bytes
from ..record.reader import read_episode
from ..record.record import EpisodeRecord
from .rating import rank_correlation, rated_episodes

SUFFIX = ".npz"
CONTEXT = (
    "urgency",
    "importance",
    "risk",
    "distance_from_human",
    "distance_from_object",
    "speed",
    "comfort",
    "bumping_human",
    "bumping_object",
    "predictability",
)  # fmt: skip  how much each matters in a context, 0 to 100, as the tables of SocNavData2026 have it

_FORMAT, _VERSION = "sonata2d-alt", 1
_ABOUT = "about"  # name of the archive entry with the JSON header
_STEP = 0.2  # s, between the vectors
_FAR, _LONG, _MOST = 10.0, 10.0, 10.0  # m, s and 1/s, at which distances, times and costs are cut
_NEAR = (0.4, 0.6, 0.8)  # m, from the nearest person; the social space of the authors, and 1.5 and 2 times as much
_FEWEST = 100  # rated episodes
_HIDDEN, _DENSE = 64, 32
_BATCH, _PATIENCE, _RATE = 32, 20, 1e-3
_MIRRORED = (1, 3, 5, 6, 8)  # columns of the motion whose sign changes in a mirrored episode
_ARRAYS = ("mean", "deviation", "typical", "weight_ih", "weight_hh", "bias_ih", "bias_hh", "dense0.weight",
           "dense0.bias", "dense1.weight", "dense1.bias")  # fmt: skip


@dataclass(frozen=True, eq=False)
class AltModel:
    """A network that predicts the rating of an episode.

    With x_t the features of an instant and the context, h_t = GRU(x_t, h_{t-1}) (Cho et al., EMNLP 2014, as in
    PyTorch); a dense layer with leaky ReLU and one with a sigmoid give the rating from the last h and the context.

    Attributes:
        question: that raters answered.
        episodes, raters: numbers of them.
        correlation: Spearman's rank correlation of ratings with predictions for a tenth of the episodes, on which the
            network was neither trained nor chosen.
        contexts: numbers of `CONTEXT`, 0 to 1, by the text of a context; other episodes have the mean of the training.
        arrays: weights by name.
    """

    question: str
    episodes: int
    raters: int
    correlation: float
    contexts: Mapping[str, tuple[float, ...]]
    arrays: Mapping[str, Array]

    def __call__(self, record: EpisodeRecord) -> float:
        """The predicted rating, 0 to 1, to four decimals: so that it does not depend on the processor.

        Args:
            record: of the episode.
        """
        given, weights = self.contexts.get(record.context or ""), self.arrays
        context = np.array(given) if given is not None else weights["typical"]
        rows = features_of(record)
        x = _scaled(np.concatenate((rows, np.broadcast_to(context, (len(rows), len(CONTEXT)))), axis=1), weights)
        inputs, h = x @ weights["weight_ih"].T + weights["bias_ih"], np.zeros(weights["weight_hh"].shape[1])
        size = len(h)
        for row in inputs:
            hidden = weights["weight_hh"] @ h + weights["bias_hh"]
            gates = _sigmoid(row[: 2 * size] + hidden[: 2 * size])
            new = np.tanh(row[2 * size :] + gates[:size] * hidden[2 * size :])
            h = new + gates[size:] * (h - new)
        dense = weights["dense0.weight"] @ np.concatenate((h, context)) + weights["dense0.bias"]
        dense = np.where(dense > 0.0, dense, 0.01 * dense)
        return round(float(_sigmoid(weights["dense1.weight"] @ dense + weights["dense1.bias"])[0]), 4)

    def save(self, path: str | Path) -> None:
        """Write the model to a file (.npz).

        Raises:
            BenchmarkError: the path ends otherwise.
        """
        if Path(path).suffix != SUFFIX:
            raise BenchmarkError(f"an alt model is written to a {SUFFIX} file, got {path}")
        about = {name: getattr(self, name) for name in _SINGLE} | {"contexts": dict(self.contexts)}
        header = json.dumps({"format": _FORMAT, "version": _VERSION, **about}, sort_keys=True)
        arrays = {name: self.arrays[name].astype(np.float32) for name in _ARRAYS}
        write_npz(Path(path), {_ABOUT: np.array(header), **arrays})

    @classmethod
    def load(cls, path: str | Path) -> AltModel:
        """Read a model; nothing in the file is executed.

        Raises:
            BenchmarkError: the file is no alt model.
        """
        try:
            stored = read_npz(read_bytes(Path(path), max_bytes=MAX_WEIGHTS_BYTES), MAX_WEIGHTS_BYTES)
            about = json.loads(str(stored.pop(_ABOUT)))
            if (about["format"], about["version"]) != (_FORMAT, _VERSION):
                raise ValueError(f"it is {about['format']} {about['version']}")
            arrays = {name: np.asarray(stored[name], dtype=np.float64) for name in _ARRAYS}
            _check(arrays)
            contexts = {text: tuple(map(float, values)) for text, values in about["contexts"].items()}
            if any(len(values) != len(CONTEXT) for values in contexts.values()):
                raise ValueError(f"its contexts do not have {len(CONTEXT)} numbers")
            return cls(**{name: about[name] for name in _SINGLE}, contexts=contexts, arrays=arrays)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise BenchmarkError(f"{path} is no alt model: {one_line(str(error), 200)}") from None


_SINGLE = ("question", "episodes", "raters", "correlation")


def features_of(record: EpisodeRecord) -> Array:
    """The vectors of an episode, one for every 0.2 s until the goal is reached.

    Of the robot in the frame of the goal: position, cosine and sine of the heading, velocity, turn rate, acceleration,
    radius, and the tolerances of the goal. Then metrics: distance and angle to the goal, whether it is reached, whether
    there are people and walls; clearance of the nearest person, piece of furniture and wall, contacts with these, and
    the number of people and its square within 0.4, 0.6 and 0.8 m; smallest clearance of people so far; time to
    collision, 1 / this time (fear), and the cost of near misses (panic; Singamaneni et al., IROS 2021); path
    efficiency, share of the time, and the end.

    Args:
        record: of the episode.

    Returns:
        (T, F).
    """
    trajectory = Trajectory(record)
    columns = [*_motion(trajectory), *_task(trajectory), *_surroundings(trajectory), *_collision(trajectory)]
    return np.stack(columns, axis=1)[_instants(trajectory)]


def _instants(trajectory: Trajectory) -> IntArray:
    """Indices of the states at the ends of steps of 0.2 s; the last is the last state."""
    step = np.floor((trajectory.time[-1] - trajectory.time) / _STEP + 1e-6)
    return np.flatnonzero(np.diff(step, append=-1.0))


def _motion(trajectory: Trajectory) -> list[Array]:
    goal = trajectory.record.goals[: len(trajectory)]
    c, s = np.cos(goal[:, 2]), np.sin(goal[:, 2])

    def turned(vectors: Array, scale: float) -> list[Array]:
        x, y = vectors.T / scale
        return [np.clip(x * c + y * s, -1.0, 1.0), np.clip(y * c - x * s, -1.0, 1.0)]

    angle = trajectory.heading - goal[:, 2]
    change = np.diff(trajectory.velocity, axis=0, prepend=trajectory.velocity[:1])
    acceleration = change / np.diff(trajectory.time, prepend=trajectory.time[0] - 1.0)[:, None]
    target, ones = trajectory.scene.goal, np.ones(len(trajectory))
    return [
        *turned(trajectory.position - goal[:, :2], _FAR), np.cos(angle), np.sin(angle),
        *turned(trajectory.velocity, 2.0), np.clip(trajectory.omega / np.pi, -1.0, 1.0), *turned(acceleration, 4.0),
        ones * trajectory.radius, ones * target.distance, ones * min(target.angle / np.pi, 1.0),
    ]  # fmt: skip


def _task(trajectory: Trajectory) -> list[Array]:
    goal = trajectory.record.goals[: len(trajectory)]
    distance = lengths(trajectory.position - goal[:, :2])
    angle = np.abs(wrap_angles(trajectory.heading - goal[:, 2]))
    reached = (distance <= trajectory.scene.goal.distance) & (angle <= trajectory.scene.goal.angle)
    travelled = np.concatenate(([0.0], np.cumsum(lengths(np.diff(trajectory.position, axis=0)))))
    efficiency = np.minimum(distance[0] / np.maximum(travelled, 1e-9), 1.0)
    elapsed = (trajectory.time - trajectory.time[0]) / max(trajectory.total_time, 1e-9)
    end = np.arange(len(trajectory)) == len(trajectory) - 1
    return [np.minimum(distance / _FAR, 1.0), angle / np.pi, reached * 1.0, efficiency, elapsed, end * 1.0]


def _surroundings(trajectory: Trajectory) -> list[Array]:
    kinds = np.array([kind for kind, _ in trajectory.scene.barrier_owner])
    gaps = trajectory.barrier_clearance
    is_wall = np.zeros(len(gaps), dtype=bool)
    is_wall[: len(kinds)] = kinds == "wall"  # the leaves of doors, at the end, count as furniture
    objects, walls = gaps[~is_wall].min(axis=0, initial=_FAR), gaps[is_wall].min(axis=0, initial=_FAR)
    people = trajectory.human_clearance.min(axis=1, initial=_FAR)
    touching = trajectory.scene.rules.contact_distance
    ones = np.ones(len(trajectory))
    columns: list[Array] = [trajectory.present.any(axis=1).astype(float), ones * float(is_wall.any())]
    columns += [np.clip(clearance / _FAR, 0.0, 1.0) for clearance in (people, objects, walls)]
    columns += [(clearance < touching) * 1.0 for clearance in (people, objects, walls)]
    for near in _NEAR:
        number = np.minimum((trajectory.human_clearance < near).sum(axis=1) / 5.0, 1.0)
        columns += [number, number * number]
    columns.append(np.clip(np.minimum.accumulate(people) / _FAR, 0.0, 1.0))
    return columns


def _collision(trajectory: Trajectory) -> list[Array]:
    relative = trajectory.velocity[:, None, :] - trajectory.human_velocity
    radii = trajectory.human_radius + trajectory.radius
    body = (trajectory.human_direction, trajectory.human_shoulder)
    times = contact_times(trajectory.offset, relative, radii, *body)
    smallest = np.minimum(np.where(trajectory.present, times, np.inf).min(axis=1, initial=np.inf), _LONG)
    speed, distance = lengths(relative), np.maximum(lengths(trajectory.offset), 1e-9)
    ahead = (trajectory.offset * relative).sum(axis=2)
    side = np.sqrt(np.maximum((speed * distance) ** 2 - ahead * ahead, 0.0))  # speed times the distance of the miss
    margin = side - speed * radii
    misses = trajectory.present & (ahead > 0.0) & (margin > 0.01)
    cost = np.where(misses, speed / distance * side / np.where(misses, margin, 1.0), 0.0)
    panic, fear = cost.max(axis=1, initial=0.0), 1.0 / np.maximum(smallest, 1.0 / _MOST)
    return [smallest / _LONG, fear / _MOST, np.minimum(panic / _MOST, 1.0)]


def _scaled(rows: Array, weights: Mapping[str, Array]) -> Array:
    return np.clip((rows - weights["mean"]) / weights["deviation"], -5.0, 5.0)


def _sigmoid(x: Array) -> Array:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(x, -60.0, 60.0))))


def _check(arrays: Mapping[str, Array]) -> None:
    """Check shapes and values.

    Raises:
        ValueError: they form no network.
    """
    inputs, context = len(arrays["mean"]), len(CONTEXT)
    hidden, dense = arrays["weight_hh"].shape[-1], len(arrays["dense0.bias"])
    shapes = {
        "mean": (FEATURES + context,), "deviation": (inputs,), "typical": (context,),
        "weight_ih": (3 * hidden, inputs), "weight_hh": (3 * hidden, hidden), "bias_ih": (3 * hidden,),
        "bias_hh": (3 * hidden,), "dense0.weight": (dense, hidden + context), "dense0.bias": (dense,),
        "dense1.weight": (1, dense), "dense1.bias": (1,),
    }  # fmt: skip
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise ValueError(f"{name} has the shape {arrays[name].shape}, not {shape}")
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} is not finite")
    if not (arrays["deviation"] > 0.0).all():
        raise ValueError("deviation is not positive")


FEATURES = 12 + 6 + 15 + 3  # of `features_of`


def read_contexts(path: str | Path) -> dict[str, tuple[float, ...]]:
    """Read the numbers of contexts: a JSON object of objects with the keys of `CONTEXT`, 0 to 100, by text.

    SocNavData2026 has such a table, which language models have filled in.

    Returns:
        The numbers, 0 to 1.

    Raises:
        BenchmarkError: the file is no such table.
    """
    try:
        table = orjson.loads(read_bytes(Path(path)))
        found = {text: tuple(float(numbers[name]) / 100.0 for name in CONTEXT) for text, numbers in table.items()}
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise BenchmarkError(
            f"{path} is no table of contexts: {one_line(reason, 200)}; it has the form"
            f' {{"A text": {{"urgency": 50, ...}}}} with the numbers {", ".join(CONTEXT)}'
        ) from None
    for text, numbers in found.items():
        if not all(0.0 <= number <= 1.0 for number in numbers):
            raise BenchmarkError(f"{path}: a number of the context {text!r} is not from 0 to 100")
    return found


def fit_alt_model(
    folders: Sequence[str | Path],
    *,
    contexts: str | Path | None = None,
    epochs: int = 200,
    seed: int = 0,
) -> AltModel:
    """Learn an alt model from rated episodes; needs PyTorch (`pip install 'sonata2d[graph]'`).

    Eight tenths of the scenes train the network, one tenth chooses the epoch, and one tenth measures the correlation.
    Half of the episodes in a batch are mirrored.

    Args:
        folders: data sets or collections, with ratings in their subfolders, or imported with `socnav3` with labels.
        contexts: file for `read_contexts`.
        epochs: at most; training stops when 20 epochs do not lower the error of the second part.
        seed: of the parts, the first weights and the order of the episodes.

    Raises:
        BenchmarkError: there are fewer than 100 rated episodes, or as of `fit_rating_model`; PyTorch is not installed;
            the table of contexts is invalid.
        RecordError: an episode or a file of ratings is damaged.
    """
    torch = optional("torch", BenchmarkError, extra="graph")
    whole_number("epochs", epochs, 1)
    table = {} if contexts is None else read_contexts(contexts)
    rated = rated_episodes(folders, fewest=_FEWEST, model="an alt model")
    target = np.array(rated.ratings)
    rows, given, scenes = [], [], []
    for file in rated.files:
        record = read_episode(file)
        rows.append(features_of(record))
        given.append(table.get(record.context or ""))
        scenes.append(scene_key(record))
    known = [numbers for numbers in given if numbers is not None]
    typical = np.mean(known, axis=0) if known else np.full(len(CONTEXT), 0.5)
    context = np.array([typical if numbers is None else numbers for numbers in given])
    whole = [
        np.column_stack((each, np.tile(numbers, (len(each), 1)))) for each, numbers in zip(rows, context, strict=True)
    ]
    train, chosen, kept = _parts(scenes, seed)
    stacked = np.concatenate([whole[i] for i in train])
    scale = {"mean": stacked.mean(axis=0), "deviation": np.maximum(stacked.std(axis=0), 0.01)}
    scale["mean"][list(_MIRRORED)] = 0.0  # so that a mirrored episode differs in signs only
    data = _Data(torch, [_scaled(each, scale) for each in whole], context, target)
    arrays = scale | {"typical": typical} | _trained(torch, data, train, chosen, epochs, seed)
    arrays = {name: array.astype(np.float32).astype(np.float64) for name, array in arrays.items()}  # as in files
    model = AltModel(rated.question, len(target), rated.raters, 0.0, table, arrays)
    predicted = np.array([model(read_episode(rated.files[i])) for i in kept])
    return replace(model, correlation=round(rank_correlation(predicted, target[kept]), 3))


def _parts(scenes: Sequence[str], seed: int) -> tuple[IntArray, IntArray, IntArray]:
    """The numbers of the episodes of each part; episodes of one scene stay together.

    Raises:
        BenchmarkError: there are too few scenes.
    """
    _, scene = np.unique(np.array(scenes), return_inverse=True)
    count = int(scene.max()) + 1
    if count < 10:
        raise BenchmarkError(f"the rated episodes show {count} scenes; an alt model needs 10 or more")
    rank, tenth = np.random.default_rng(seed).permutation(count)[scene], count // 10
    return (
        np.flatnonzero(rank >= 2 * tenth),
        np.flatnonzero((rank >= tenth) & (rank < 2 * tenth)),
        np.flatnonzero(rank < tenth),
    )


class _Data:
    """Episodes as padded batches of tensors."""

    def __init__(self, torch: Any, inputs: list[Array], context: Array, target: Array) -> None:
        self._torch = torch
        self._inputs = [torch.as_tensor(rows, dtype=torch.float32) for rows in inputs]
        self._context = torch.as_tensor(context, dtype=torch.float32)
        self._target = torch.as_tensor(target, dtype=torch.float32)
        self._signs = torch.ones(inputs[0].shape[1])
        self._signs[list(_MIRRORED)] = -1.0

    def batch(self, chosen: IntArray, mirrored: Sequence[bool] | None = None) -> tuple[Any, Any, Any]:
        """Packed sequences, contexts (B, C) and ratings (B,) of episodes."""
        rows = [self._inputs[i] for i in chosen.tolist()]
        if mirrored is not None:
            rows = [each * self._signs if flag else each for each, flag in zip(rows, mirrored, strict=True)]
        packed = self._torch.nn.utils.rnn.pack_sequence(rows, enforce_sorted=False)
        return packed, self._context[chosen], self._target[chosen]


def _trained(torch: Any, data: _Data, train: IntArray, chosen: IntArray, epochs: int, seed: int) -> dict[str, Array]:
    """The weights of the epoch with the least error of the episodes `chosen`."""
    rng = np.random.default_rng(seed)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        gru = torch.nn.GRU(FEATURES + len(CONTEXT), _HIDDEN)
        dense = torch.nn.Sequential(
            torch.nn.Linear(_HIDDEN + len(CONTEXT), _DENSE), torch.nn.LeakyReLU(0.01), torch.nn.Linear(_DENSE, 1)
        )
    modules = torch.nn.ModuleList((gru, dense))
    optimiser = torch.optim.Adam(modules.parameters(), lr=_RATE, weight_decay=1e-4)

    def error(packed: Any, context: Any, target: Any) -> Any:
        _, last = gru(packed)
        predicted = torch.sigmoid(dense(torch.cat((last[0], context), dim=1)))[:, 0]
        return ((predicted - target) ** 2).mean()

    least, best, since = float("inf"), {}, 0
    for _ in range(epochs):
        order = rng.permutation(train)
        for start in range(0, len(order), _BATCH):
            own = order[start : start + _BATCH]
            optimiser.zero_grad()
            error(*data.batch(own, (rng.random(len(own)) < 0.5).tolist())).backward()
            torch.nn.utils.clip_grad_norm_(modules.parameters(), 1.0)
            optimiser.step()
        with torch.no_grad():
            found = float(error(*data.batch(chosen)))
        since += 1
        if found < least:
            least, best, since = found, {name: w.clone() for name, w in modules.state_dict().items()}, 0
        if since == _PATIENCE:
            break
    if not best:
        raise BenchmarkError("the error of the network is not finite in any epoch; check the ratings and the episodes")
    names = {
        "0.weight_ih_l0": "weight_ih", "0.weight_hh_l0": "weight_hh", "0.bias_ih_l0": "bias_ih",
        "0.bias_hh_l0": "bias_hh", "1.0.weight": "dense0.weight", "1.0.bias": "dense0.bias",
        "1.2.weight": "dense1.weight", "1.2.bias": "dense1.bias",
    }  # fmt: skip
    return {new: best[old].numpy().astype(np.float64) for old, new in names.items()}
