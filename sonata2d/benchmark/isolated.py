"""A controller that runs in a process of its own and gets no more than the rules of the benchmark allow."""

from __future__ import annotations

import contextlib
import glob
import math
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import orjson

from ..agents.controllers.base import Answer, Controller, Stop
from ..agents.controllers.loading import ControllerSource, file_in, split_pair
from ..agents.sensors.base import Sensor, definition_of, known_to
from ..agents.sensors.estimates import Odometry
from ..agents.sensors.lidar import Lidar
from ..core.compiled.cache import cache_folder
from ..core.geometry import Twist
from ..core.humans import BODY_X
from ..core.portable_math import Array
from ..core.scene import Rules, Scene
from ..core.snapshot import Snapshot
from ..core.state import EXECUTED_VX, ROBOT_SIZE
from ..core.wording import shown
from ..errors import BenchmarkError, ControllerError
from ..registry import CONTROLLERS
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..sim.episode import Episode
from .child import ANSWER, COMMAND, ERROR, LENGTH, READY, STOP
from .shown import Perception, Sensing
from .suite import SEES, Track

FAILED = "the controller failed"  # beginning of the reason of an episode that an error of the controller ended
BUDGET = 160  # calls of `fixed_work` in a tick: 0.1 s on the reference machine
_AT_START = 20  # times the budget, in the first tick of an episode
_MOST_WAITING = 20.0  # times the budget that an answer may take while its process waits
_MOST_SECONDS = 60.0  # for one answer, after which the process is ended
_LOAD_SECONDS = 300.0
LIDAR_SENSORS: tuple[Sensor, ...] = (Lidar(rays=180, distance=8.0, noise=0.01), Odometry())
"""The sensors of the benchmark: a controller has none or some of them, with these settings and names."""


_PRACTICE = (
    ScenarioConfig(humans=2, plants=1, tables=1, rules=Rules(guard=False)),
    "crowded-hall",  # with more people than policies observe
    ScenarioConfig(
        humans=2, robot={"kinematics": "unicycle", "body": {"shape": "rectangle", "length": 0.9, "width": 0.6}}
    ),
)


def fixed_work() -> int:
    """Run 10 000 steps of a linear congruential generator: the unit of the budget of time."""
    x = 1
    for _ in range(10_000):
        x = (x * 1103515245 + 12345) & 0x7FFFFFFF
    return x


def seconds_of_fixed_work() -> float:
    """Processor time of a call of `fixed_work` on this machine at this moment, the shortest of five, s."""
    durations = []
    for _ in range(5):
        start = time.process_time()
        fixed_work()
        durations.append(time.process_time() - start)
    return min(durations)


class Isolated(Controller):
    """Drives with a controller in another process.

    Args:
        source: of the controller.
        track: what it may observe.

    Attributes:
        sensing: of the scenes that follow; set before each episode.
        late: ticks of the present episode whose answer came after the budget, so that the last command was held.
        failure: description of the error that ended the episode; empty without an error.

    Raises:
        BenchmarkError: the controller cannot take part in the track, or broke a rule while it was loaded.
        ControllerError: it cannot be loaded.
    """

    robots_as_people = True

    def __init__(self, source: ControllerSource, track: Track = "state") -> None:
        self._source, self._track = source, track
        self.sensing: Sensing | None = None
        self.late: list[int] = []
        self.failure = ""
        self._held: tuple[float, float, float] | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._about: Mapping[str, Any] = {}
        self._deadline = [math.inf]
        self._cache: str | None = None
        self._start()

    def settings(self) -> dict[str, Any]:
        return {}

    @property
    def is_deterministic(self) -> bool:
        """Whether the controller says that equal snapshots always give equal answers."""
        return bool(self._about["deterministic"])

    def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with contextlib.suppress(OSError):
                        pipe.close()
            try:
                process.wait(timeout=2.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if self._cache is not None:
            shutil.rmtree(self._cache, ignore_errors=True)
            self._cache = None

    def __del__(self) -> None:
        with contextlib.suppress(Exception):
            self.close()

    def _start(self) -> None:
        self.close()
        if self._source.name in CONTROLLERS:  # its kernels are then in the cache of this process, which is copied
            self._practise(self._source.create())
        self._cache = _copied_cache()
        paths = [str(Path(__file__).resolve().parents[2]), *(path for path in sys.path if path)]
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        own = {"PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": self._cache}
        command = [sys.executable, "-c", "from sonata2d.benchmark.child import main; main()"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=os.environ | threads | own, close_fds=True
        )
        self._deadline = [math.inf]
        threading.Thread(target=_end_if_silent, args=(self._process, self._deadline), daemon=True).start()
        files = [str(path) for path in files_of(self._source.name, must_exist=False)]
        kind, _, _, text = self._ask(("load", self._source, files), _LOAD_SECONDS)
        if kind != READY:
            self._raise_if_broken(text)
            raise ControllerError(f"{self._source.name} cannot be loaded in a process of its own: {text}")
        self._about = orjson.loads(text)
        self.sensors = self._checked_sensors()
        self._second = math.inf
        self._practise(self)
        self._second = seconds_of_fixed_work()

    def _checked_sensors(self) -> list[Sensor]:
        """The sensors of the controller.

        Raises:
            BenchmarkError: they are none of the benchmark, or the track has none.
        """
        name, track = self._source.name, self._track
        if self._about["image"]:
            raise BenchmarkError(f"{name} requests camera images, which no track of the benchmark has")
        if track == "lidar" and not self._about["partial"]:
            raise BenchmarkError(f"the track lidar is for controllers with partial = True, which {name} has not")
        sensors = []
        allowed = {each.name: each for each in LIDAR_SENSORS}
        for definition in self._about["sensors"]:
            if definition["settings"] != _settings_of(allowed.get(definition["name"])):
                raise BenchmarkError(
                    f"the sensors of the benchmark are {', '.join(map(repr, LIDAR_SENSORS))}; {name} has "
                    f"{definition['type']} with {definition['settings']}"
                )
            sensors.append(allowed[definition["name"]])
        return sensors

    def _practise(self, controller: Controller) -> None:
        """Some ticks in scenes of practice without a budget, in which code is compiled; errors are of no interest."""
        self.sensing = None
        for config in _PRACTICE:
            if self._process is not None and self._process.poll() is not None:
                return  # it ends in practice; starting it again would not end
            with contextlib.suppress(ControllerError):
                episode = Episode(generate(config, 1), controller)
                for _ in range(3):
                    episode.step()

    def reset(self, scene: Scene) -> None:
        if self._process is None or self._process.poll() is not None:  # it ended in an earlier episode
            sensing = self.sensing
            self._start()
            self.sensing = sensing
        sensing = SEES if self._track == "sees" else self.sensing
        self._perception = Perception(scene, sensing)
        shown_scene = self._perception.scene
        self._links: Any = shown_scene.interactions
        if self._track == "lidar":
            shown_scene = known_to(_PARTIAL, shown_scene)
        self.late, self.failure, self._held = [], "", None
        self._last, self._goal = Twist(), scene.goal
        kind, _, _, text = self._ask(("reset", shown_scene), _MOST_SECONDS)
        if kind != READY:
            self._fail(text)

    def act(self, snapshot: Snapshot) -> Answer:
        if self.failure:
            return Stop(self.failure)
        request, start, clock = self._request(snapshot), time.perf_counter(), self._clock()
        kind, tick, command, text = self._ask(request, _MOST_SECONDS)
        waited = time.perf_counter() - start
        # on a busy machine the process waits for a processor, which is no fault of its own
        taken = waited if clock is None else max((self._clock() or math.inf) - clock, waited / _MOST_WAITING)
        self._held = None
        if kind == STOP:
            return Stop(text[:200])
        if kind == ERROR:
            self._fail(text)
            return Stop(self.failure)
        if kind != COMMAND or tick != snapshot.tick:
            raise BenchmarkError(f"{self._source.name} answered out of turn at tick {snapshot.tick}")
        if not all(map(math.isfinite, command)):
            self._fail(f"the command is not finite: {command}")
            return Stop(self.failure)
        budget = BUDGET * (_AT_START if snapshot.tick == 0 else 1)
        if taken > budget * self._second:
            self.late.append(snapshot.tick)
            self._held = (self._last.vx, self._last.vy, self._last.omega)
        else:
            self._last = Twist(*(min(max(value, -1e3), 1e3) for value in command))
        return self._last

    def _clock(self) -> float | None:
        """Time that the process has used of all processors, s; None where the system does not tell."""
        if sys.platform == "linux" and self._process is not None:
            with contextlib.suppress(OSError):
                return time.clock_gettime((~self._process.pid << 3) | 2)  # the process clock, see clock_getcpuclockid
        return None

    def _request(self, snapshot: Snapshot) -> tuple[Any, ...]:
        state, links = self._perception.state(snapshot)
        readings = None if snapshot.sensors is None else dict(snapshot.sensors)
        goal = None if snapshot.goal is self._goal else snapshot.goal
        row, activity, is_present, contacts = state.row, state.activity, state.is_present, snapshot.contacts
        if self._track == "lidar":
            row, activity, is_present, links, contacts = _own(row), activity[:0], None, (), ()
        is_same = links is self._links or links == self._links
        self._links = links
        present = None if is_present is None else is_present.tobytes()
        doors = 0 if self._track == "lidar" else state.door_count
        return (
            "act", snapshot.tick, row.tobytes(), activity.tobytes(), present, doors, None if is_same else links,
            contacts, goal, readings, self._held,
        )  # fmt: skip

    def _fail(self, text: str) -> None:
        self._raise_if_broken(text)
        self.failure = f"{FAILED}: {text}"[:200]

    def _raise_if_broken(self, text: str) -> None:
        if text.startswith("the controller tried to "):
            remedy = "; a file that goes with a script has its name, and another ending" if " to read " in text else ""
            raise BenchmarkError(f"{self._source.name} breaks the rules of the benchmark: {text}{remedy}")

    def _ask(self, request: tuple[Any, ...], seconds: float) -> tuple[bytes, int, tuple[float, ...], str]:
        """The answer to a request: its kind, tick, command and text."""
        process = self._process
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        content = pickle.dumps(request, protocol=5)
        self._deadline[0] = time.monotonic() + seconds
        try:
            process.stdin.write(LENGTH.pack(len(content)) + content)
            process.stdin.flush()
            header = process.stdout.read(ANSWER.size)
            if len(header) < ANSWER.size:
                raise EOFError
            kind, tick, vx, vy, omega, length = ANSWER.unpack(header)
            text = process.stdout.read(min(length, 4000)).decode(errors="replace")
        except (OSError, EOFError):
            is_late = time.monotonic() > self._deadline[0]
            process.kill()
            process.wait()
            reason = f"there was no answer in {seconds:g} s" if is_late else "its process ended"
            return ERROR, 0, (0.0, 0.0, 0.0), reason
        finally:
            self._deadline[0] = math.inf
        return kind, tick, (vx, vy, omega), text


class _Partial(Controller):
    partial = True

    def act(self, snapshot: Snapshot) -> Answer:
        return Twist()


_PARTIAL = _Partial()


def _own(row: Array) -> Array:
    """The robot's part of a state without its pose and velocity."""
    own = row[:ROBOT_SIZE].copy()
    own[:EXECUTED_VX] = 0.0
    own[BODY_X] = 1.0
    return own


def _settings_of(sensor: Sensor | None) -> Any:
    return None if sensor is None else orjson.loads(orjson.dumps(definition_of(sensor)["settings"]))


def _copied_cache() -> str:
    """A new folder for the kernels of a controller's process, with a copy of the kernels of this process.

    Loading a kernel runs what its file contains: this process never loads what the controller's process has written.
    """
    folder, present = tempfile.mkdtemp(prefix="sonata2d-controller-"), cache_folder()
    if present is not None and present.is_dir():
        shutil.copytree(present, Path(folder) / "sonata2d", ignore=shutil.ignore_patterns("*.tmp", "*.lock"))
    return folder


def _end_if_silent(process: subprocess.Popen[bytes], deadline: list[float]) -> None:
    """End a process that does not answer before the deadline, which its user sets."""
    while process.poll() is None:
        if time.monotonic() > deadline[0]:
            process.kill()
            return
        time.sleep(0.5)


def files_of(name: str, *, must_exist: bool = True) -> list[Path]:
    """The files that the name of a controller contains: a script, or a policy; of `driver+labeller`, of both.

    Files beside a script that have its name and another ending, such as its weights, go with it.

    Raises:
        BenchmarkError: the name contains a file that does not exist.
    """
    files = []
    for part in split_pair(name):
        place = file_in(part)
        if place is not None:
            path = Path(place)
            beside = sorted(path.parent.glob(f"{glob.escape(path.stem)}.*")) if path.suffix == ".py" else [path]
            files += [path, *(each for each in beside if each != path and each.is_file())]
        elif must_exist and part.endswith((".py", ".npz", ".onnx")):
            raise BenchmarkError(f"there is no file {shown(part)}")
    return files
