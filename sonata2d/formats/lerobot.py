"""`lerobot`: a LeRobotDataset of version 3.0, which LeRobot trains policies on.

| feature | shape | content |
| --- | --- | --- |
| `observation.state` | 7 | velocity of the robot, and position and heading of the goal, in the robot's frame |
| `observation.environment_state` | 84 | the 8 nearest people, and 36 ranges of a laser scanner, in the robot's frame |
| `observation.pose`, `observation.goal` | 3 | x, y, theta of robot and goal in the world frame |
| `observation.images.top` | 128 × 128 × 3 | the room from above, with the option `pictures` |
| `action` | 3 | command: forward and left in m/s, turn rate in rad/s |

The task of an episode is a sentence, such as `Go to the place 3.1 m ahead of your start.` Source: LeRobot,
lerobot/datasets, codebase version 3.0.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from ..agents.sensors.base import SensorNoise
from ..agents.sensors.lidar import Lidar
from ..core.devices import ImageRequest
from ..core.files.locations import make_folder
from ..core.files.optional import optional
from ..core.files.whole_file import whole_file
from ..core.portable_math import Array
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.vectors import lengths
from ..datasets.tables import pyarrow
from ..errors import RecordError, UnsuitableEpisode
from ..metrics.words import instruction
from ..record.files import write_atomically
from ..record.record import EpisodeRecord
from .format import Format, Options, Tables, require_even_times, require_task

NAME = "lerobot"
PEOPLE, RAYS, RANGE = 8, 36, 10.0  # nearest people; rays of the scanner, and their range, m
IMAGE = ImageRequest(128, 128, view="top")

_CODEBASE = "v3.0"
_CHUNK = 1000  # files in a folder, and episodes in a file
_PICTURES = "observation.images.top"
_FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
_DATA, _EPISODES = f"data/{_FILE}.parquet", f"meta/episodes/{_FILE}.parquet"
_VIDEO = f"videos/{{video_key}}/{_FILE}.mp4"
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_PERSON = ("x", "y", "vx", "vy", "radius", "present")
_NAMES = {
    "observation.state": ("vx", "vy", "omega", "goal_x", "goal_y", "goal_cos", "goal_sin"),
    "observation.environment_state": (
        *(f"person{k}_{name}" for k in range(PEOPLE) for name in _PERSON), *(f"range{k}" for k in range(RAYS)),
    ),
    "observation.pose": ("x", "y", "theta"),
    "observation.goal": ("x", "y", "theta"),
    "action": ("vx", "vy", "omega"),
}  # fmt: skip
_INDICES = ("frame_index", "episode_index", "index", "task_index")
_PANDAS = "pandas"  # key of the metadata from which pandas takes the index of a table

Statistics = dict[str, dict[str, Array]]  # by feature and name


class Observer:
    """The observation of a policy, the same in a data set and while it drives.

    Args:
        scene: in which the robot drives.

    Example:
        >>> import sonata2d as s2
        >>> observe = Observer(s2.generate(s2.load_scenario("empty"), seed=1))
    """

    def __init__(self, scene: Scene) -> None:
        self._scan, self._scene = Lidar(rays=RAYS, distance=RANGE).start(scene), scene

    def __call__(self, snapshot: Snapshot) -> dict[str, Array]:
        """The features of a tick, float32.

        A person row is x, y, vx, vy (relative to the robot's frame, in m and m/s), radius and 1; rows of absent people
        are 0. Ranges are m, counter-clockwise from behind; 10 m if a ray meets nothing.

        Args:
            snapshot: of the tick.

        Returns:
            `observation.state` (7,), `observation.environment_state` (84,), `observation.pose` (3,) and
            `observation.goal` (3,).
        """
        robot, goal, pose = snapshot.robot, snapshot.goal, snapshot.robot.pose
        ahead = np.array(robot.direction)
        axes = np.array((ahead, (-ahead[1], ahead[0]))).T  # columns: forward and left
        place = (np.array(goal.position) - robot.position) @ axes
        angle = goal.theta - pose.theta
        people, rows = snapshot.humans, np.zeros((PEOPLE, len(_PERSON)))
        offset = people.position - np.array(robot.position)
        nearest = np.argsort(lengths(offset), kind="stable")[:PEOPLE]
        rows[: len(nearest)] = np.column_stack(
            (offset[nearest] @ axes, people.velocity[nearest] @ axes, people.radius[nearest], np.ones(len(nearest)))
        )
        ranges = self._scan(snapshot, SensorNoise(self._scene, NAME, snapshot.tick)).ranges
        twist = robot.twist
        state = (twist.vx, twist.vy, twist.omega, *place, np.cos(angle), np.sin(angle))
        found = {
            "observation.state": state,
            "observation.environment_state": (*rows.ravel(), *np.minimum(ranges, RANGE)),
            "observation.pose": (pose.x, pose.y, pose.theta),
            "observation.goal": (goal.x, goal.y, goal.theta),
        }
        return {name: np.array(values, dtype=np.float32) for name, values in found.items()}


@dataclass(frozen=True, slots=True)
class _Packed:
    """An episode, as workers send it."""

    key: str
    outcome: str
    task: str
    fps: int
    robot: str
    features: dict[str, Array]
    statistics: Statistics
    film: bytes | None

    def __len__(self) -> int:
        return len(self.features["action"])


def pack(record: EpisodeRecord, key: str, options: Options) -> _Packed:
    """The features of an episode, and their statistics.

    Args:
        record: the episode.
        key: its name in the columns of episodes.
        options: `pictures` adds the film.

    Raises:
        UnsuitableEpisode: robot, commands or goal were not recorded, the episode has no frame, its times are uneven, or
            it has no whole number of frames per second.
    """
    require_task(record, NAME)
    require_even_times(record, NAME)
    scene, dt = record.scene(), record.scene().rules.dt
    if not len(record):
        raise UnsuitableEpisode(record.path, "the episode has no frame", "leave out such episodes")
    if abs(1.0 / dt - round(1.0 / dt)) > 1e-6:
        raise UnsuitableEpisode(
            record.path,
            f"a frame lasts {dt} s, and {NAME} needs whole frames per second",
            "generate with a tick such as 0.1 s",
        )
    snapshots = [record.snapshot(t) for t in range(len(record))]
    observe = Observer(scene)
    rows = [observe(snapshot) for snapshot in snapshots]
    features = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    features["action"] = record.command.astype(np.float32)
    statistics, film = {name: _statistics(values) for name, values in features.items()}, None
    if options.pictures:
        pictures = _pictures(snapshots)
        few = pictures[:: max(1, len(pictures) // 20)].reshape(-1, 3) / 255.0  # statistics of some are enough
        statistics[_PICTURES] = {
            name: values if name == "count" else values.reshape(3, 1, 1) for name, values in _statistics(few).items()
        } | {"count": np.array([len(pictures)])}
        film = _film(pictures, round(1.0 / dt))
    task = instruction(scene).text
    return _Packed(
        key, record.outcome.status, task, round(1.0 / dt), scene.robot.kinematics, features, statistics, film
    )


def _statistics(values: Array) -> dict[str, Array]:
    found = {name: getattr(np, name)(values, axis=0).astype(float) for name in ("min", "max", "mean", "std")}
    quantiles = np.quantile(values, list(_QUANTILES.values()), axis=0)
    return found | dict(zip(_QUANTILES, quantiles, strict=True)) | {"count": np.array([len(values)])}


def _combined(*parts: dict[str, Array]) -> dict[str, Array]:
    """The statistics of several parts together; quantiles are weighted means, as LeRobot combines them."""
    counts = np.array([part["count"][0] for part in parts], dtype=float)
    weights = (counts / counts.sum()).reshape(-1, *[1] * parts[0]["mean"].ndim)
    means = np.stack([part["mean"] for part in parts])
    mean = (weights * means).sum(axis=0)
    variance = (weights * (np.stack([part["std"] for part in parts]) ** 2 + (means - mean) ** 2)).sum(axis=0)
    quantiles = {name: (weights * np.stack([part[name] for part in parts])).sum(axis=0) for name in _QUANTILES}
    return {
        "min": np.min([part["min"] for part in parts], axis=0), "max": np.max([part["max"] for part in parts], axis=0),
        "mean": mean, "std": np.sqrt(variance), "count": np.array([int(counts.sum())]), **quantiles,
    }  # fmt: skip


def _pictures(snapshots: Sequence[Snapshot]) -> Any:
    """(T, H, W, 3) of uint8."""
    from ..view.painter import image_of

    return np.stack([image_of(snapshot, IMAGE) for snapshot in snapshots])


def _film(pictures: Any, fps: int) -> bytes:
    """An MP4 film, with a key frame at every second picture, as LeRobot encodes it for random access.

    Raises:
        RecordError: imageio-ffmpeg is not installed.
    """
    import tempfile

    from ..view.film import encode_mp4

    optional("imageio_ffmpeg", RecordError, extra="video")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        encode_mp4(path, map(np.ascontiguousarray, pictures), (IMAGE.width, IMAGE.height), fps, "rgb24", "-g 2 -crf 23")
        return path.read_bytes()


def write(episodes: Iterator[_Packed], out: Path, number: int | None) -> list[Path]:
    """Write a data set; the last file, `meta/info.json`, makes it complete. Only a file of rows is held in memory.

    Args:
        episodes: see `pack`.
        out: the folder; created if needed.
        number: not used; the indices of the frames count over all episodes.

    Returns:
        The files.

    Raises:
        RecordError: pyarrow is not installed, the folder holds a data set, the episodes differ in frames per second or
            in what they have, or a file cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise RecordError(f"{out} is a file; a data set needs a folder, choose another name")
    if any((out / name).exists() for name in ("meta", "data", "videos")):
        raise RecordError(f"{out} holds a LeRobot data set, or the beginning of one; choose another folder")
    writer = _Writer(out)
    try:
        with ExitStack() as whole:
            for episode in episodes:
                writer.add(episode, whole)
            writer.close(whole)
        return writer.finish()
    except OSError as error:
        raise RecordError(f"{out} cannot be written: {error.strerror or error}") from error


class _Writer:
    """A data set that is being written.

    Args:
        out: its folder.

    Raises:
        RecordError: pyarrow is not installed.
    """

    def __init__(self, out: Path) -> None:
        self._out = out
        self._pa, self._pq = pyarrow()
        self._files: list[Path] = []
        self._tasks: dict[str, int] = {}
        self._waiting: list[dict[str, Any]] = []  # rows of the episodes in the open file
        self._statistics: Statistics = {}
        self._first: _Packed | None = None
        self._count = self._frames = 0
        self._rows: Any = None

    def add(self, episode: _Packed, whole: ExitStack) -> None:
        """Write the rows of an episode."""
        first = self._first = self._first or episode
        for name in ("fps", "robot"):
            if getattr(episode, name) != getattr(first, name):
                values = f"{getattr(first, name)} and {getattr(episode, name)}"
                raise RecordError(f"{episode.key}: a LeRobot data set has one {name}, got {values}; export them apart")
        number, count = self._count, len(episode)
        chunk, file = divmod(number // _CHUNK, _CHUNK)
        if number % _CHUNK == 0:
            self.close(whole)
            self._rows = whole.enter_context(
                self._pq.ParquetWriter(whole.enter_context(whole_file(self._file(_DATA, chunk, file))), self._schema())
            )
        task = self._tasks.setdefault(episode.task, len(self._tasks))
        columns: dict[str, Any] = {name: list(values) for name, values in episode.features.items()}
        columns["timestamp"] = (np.arange(count) / episode.fps).astype(np.float32)
        columns["frame_index"], columns["index"] = np.arange(count), np.arange(count) + self._frames
        columns["episode_index"], columns["task_index"] = np.full(count, number), np.full(count, task)
        self._rows.write_table(self._pa.table(columns, schema=self._schema()))
        row = {
            "episode_index": number, "tasks": [episode.task], "length": count, "data/chunk_index": chunk,
            "data/file_index": file, "dataset_from_index": self._frames, "dataset_to_index": self._frames + count,
        }  # fmt: skip
        if episode.film is not None:
            chunk, file = divmod(number, _CHUNK)
            write_atomically(self._file(_VIDEO, chunk, file), episode.film)
            row |= {
                f"videos/{_PICTURES}/chunk_index": chunk, f"videos/{_PICTURES}/file_index": file,
                f"videos/{_PICTURES}/from_timestamp": 0.0, f"videos/{_PICTURES}/to_timestamp": count / episode.fps,
            }  # fmt: skip
        for name, found in episode.statistics.items():
            row |= {f"stats/{name}/{kind}": values.tolist() for kind, values in found.items()}
            self._statistics[name] = _combined(*(part for part in (self._statistics.get(name), found) if part))
        place = {f"meta/episodes/{kind}": row[f"data/{kind}"] for kind in ("chunk_index", "file_index")}
        self._waiting.append(row | place | {"sonata2d/episode_id": episode.key, "sonata2d/outcome": episode.outcome})
        self._frames += count
        self._count += 1

    def close(self, whole: ExitStack) -> None:
        """Complete the file of frames that is open, and write the rows of its episodes."""
        whole.close()
        if self._waiting:
            chunk, file = (self._waiting[0][f"data/{kind}"] for kind in ("chunk_index", "file_index"))
            with whole_file(self._file(_EPISODES, chunk, file)) as place:
                self._pq.write_table(self._pa.Table.from_pylist(self._waiting), place)
            self._waiting.clear()

    def finish(self) -> list[Path]:
        """Write tasks, statistics and, at the end, what makes the data set complete."""
        if self._first is None:
            return []
        with whole_file(self._file("meta/tasks.parquet")) as place:
            self._pq.write_table(_tasks(self._pa, list(self._tasks)), place)
        content = {name: {kind: v.tolist() for kind, v in found.items()} for name, found in self._statistics.items()}
        self._json("meta/stats.json", content)
        self._json("meta/info.json", self._info(self._first))
        return self._files

    def _info(self, first: _Packed) -> dict[str, Any]:
        features: dict[str, Any] = {
            name: {"dtype": "float32", "shape": [len(names)], "names": list(names)} for name, names in _NAMES.items()
        }
        features |= {"timestamp": {"dtype": "float32", "shape": [1], "names": None}}
        features |= {name: {"dtype": "int64", "shape": [1], "names": None} for name in _INDICES}
        if first.film is not None:
            height, width = IMAGE.height, IMAGE.width
            features[_PICTURES] = {
                "dtype": "video", "shape": [height, width, 3], "names": ["height", "width", "channels"],
                "info": {
                    "video.height": height, "video.width": width, "video.codec": "h264", "video.pix_fmt": "yuv420p",
                    "video.is_depth_map": False, "video.fps": first.fps, "video.channels": 3, "has_audio": False,
                },
            }  # fmt: skip
        return {
            "codebase_version": _CODEBASE, "robot_type": f"sonata2d-{first.robot}", "total_episodes": self._count,
            "total_frames": self._frames, "total_tasks": len(self._tasks), "chunks_size": _CHUNK,
            "data_files_size_in_mb": 100, "video_files_size_in_mb": 200, "fps": first.fps,
            "splits": {"train": f"0:{self._count}"}, "data_path": _DATA,
            "video_path": None if first.film is None else _VIDEO, "features": features,
        }  # fmt: skip

    def _schema(self) -> Any:
        pa = self._pa
        lists = [(name, pa.list_(pa.float32(), len(names))) for name, names in _NAMES.items()]
        return pa.schema([*lists, ("timestamp", pa.float32()), *((name, pa.int64()) for name in _INDICES)])

    def _file(self, form: str, chunk: int = 0, file: int = 0) -> Path:
        path = self._out / form.format(video_key=_PICTURES, chunk_index=chunk, file_index=file)
        make_folder(path.parent)
        self._files.append(path)
        return path

    def _json(self, name: str, content: Mapping[str, Any]) -> None:
        write_atomically(self._file(name), orjson.dumps(content, option=orjson.OPT_INDENT_2))


def _tasks(pa: Any, tasks: list[str]) -> Any:
    """The table of tasks; its metadata make the sentence the index of the table in pandas."""
    table = pa.table({"task_index": list(range(len(tasks))), "task": tasks})
    kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_kind, "metadata": None}
        for name, (kind, numpy_kind) in kinds.items()
    ]
    index = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    return table.replace_schema_metadata({_PANDAS: json.dumps(index)})


def finish(out: Path, parts: int) -> list[Path]:
    """Nothing is left to be written."""
    return []


FORMAT = Format(
    "a data set of LeRobot 3.0, to train policies on",
    "",
    tables=Tables(pack, write, finish, is_divisible=False),
    options=frozenset({"pictures", "robot", "robots_as"}),
)
