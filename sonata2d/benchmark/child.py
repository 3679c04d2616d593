"""The process of a controller in the benchmark: it gets snapshots through a pipe, and answers with three numbers.

An audit hook (PEP 578) refuses what a controller of the benchmark must not do: start processes, use the network, read
or write files other than its own and the installed packages, generate scenes and simulate worlds. The hook is no
sandbox: code that is written to get around it can do so. No seed, no settings and no intentions of people are ever sent
to this process, so that little is to be found here.
"""

from __future__ import annotations

import io
import os
import pickle
import struct
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import orjson

from ..agents.controllers.base import Controller, Regenerate, Stop
from ..agents.controllers.loading import ControllerSource
from ..agents.sensors.base import Readings, definition_of, known_to, shown_to
from ..core.compiled.cache import cache_folder
from ..core.geometry import Twist
from ..core.humans import frozen
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.state import State
from ..core.wording import described

LENGTH = struct.Struct("<I")
ANSWER = struct.Struct("<cI3dI")  # kind, tick, command, length of a text that follows
READY, COMMAND, STOP, ERROR = b"R", b"C", b"S", b"E"

_REFUSED = {
    "start or stop processes": (
        "os.fork", "os.forkpty", "os.exec", "os.posix_spawn", "os.spawn", "os.system", "os.startfile", "os.kill",
        "os.killpg", "subprocess.Popen", "pty.spawn", "_winapi.CreateProcess", "_winapi.OpenProcess",
    ),
    "use the network": (
        "socket.connect", "socket.bind", "socket.sendto", "socket.sendmsg", "socket.getaddrinfo",
        "socket.gethostbyname",
    ),
    "run the simulator": ("sonata2d.generate", "sonata2d.simulate"),
    "change files": (
        "os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod",
        "os.chown", "os.utime", "os.setxattr", "os.removexattr", "shutil.rmtree", "shutil.move", "sqlite3.connect",
    ),
}  # fmt: skip
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CODE = (".py", ".pyc", ".so", ".pyd")
_METADATA = (".egg-info", ".dist-info")  # of installed packages, which may be anywhere
_OF_SYSTEM = (
    "/proc/cpuinfo",
    "/proc/meminfo",
    "/proc/stat",
    "/sys/",
    "/etc/",
    "/usr/",
    "/lib",
    "/dev/urandom",
    "/dev/random",
)
_OF_PROCESS = ("status", "stat", "cgroup", "mounts", "mountinfo", "task")  # in /proc/self, which libraries read
_SUITES = str(Path(__file__).resolve().parent / "suites")


def install_rules(files: Sequence[str]) -> list[str]:
    """Install the audit hook.

    Args:
        files: of the controller, which it may read.

    Returns:
        Descriptions of what is refused from now on, as it happens.
    """
    package = str(Path(__file__).resolve().parents[1])
    installed = [sys.prefix, sys.base_prefix, sys.exec_prefix, package]
    installed += [path for path in sys.path if path and Path(path).name in ("site-packages", "dist-packages")]
    own = {os.path.realpath(file) for file in files}
    folders = tuple(os.path.realpath(path) + os.sep for path in installed)
    own_process = tuple(f"/proc/{os.getpid()}/{name}" for name in _OF_PROCESS)
    cache = cache_folder()  # a copy of this process
    writable = () if cache is None else (os.path.realpath(cache) + os.sep,)
    reasons = {event: what for what, events in _REFUSED.items() for event in events}
    broken: list[str] = []

    def refuse(what: str) -> None:
        broken.append(what)
        raise PermissionError(f"a controller of the benchmark must not {what}")

    def is_writable(path: Any) -> bool:
        is_path = isinstance(path, str | bytes | os.PathLike)
        return is_path and (os.path.realpath(os.fsdecode(path)) + os.sep).startswith(writable)

    def check_file(path: Any, mode: Any, flags: int) -> None:
        place = os.path.realpath(os.fsdecode(path))
        if place == os.devnull or is_writable(place):
            return
        if flags & _WRITING or (mode and set(str(mode)) & set("wax+")):
            refuse(f"write {place}")
        may_read = place in own or place.startswith((*folders, *_OF_SYSTEM, *own_process))
        may_read = may_read or place.endswith(_CODE) or Path(place).parent.suffix in _METADATA
        is_nothing = os.path.isdir(place) or not os.path.lexists(place)
        if (place.startswith(_SUITES) or not may_read) and not is_nothing:
            refuse(f"read {place}")

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            if not isinstance(arguments[0], int):  # a descriptor is open already
                check_file(*arguments)
        elif event == "object.__setattr__" and arguments[1] == "__code__":
            refuse("replace the code of a function")
        elif (what := reasons.get(event)) is not None:
            places = arguments[:2] if event in ("os.rename", "os.link", "os.symlink", "shutil.move") else arguments[:1]
            if what != "change files" or not all(map(is_writable, places)):
                refuse(f"{what} ({event})")

    sys.addaudithook(hook)
    return broken


class Child:
    """Serves the requests of the benchmark.

    Args:
        requests, answers: ends of the pipes.
    """

    def __init__(self, requests: BinaryIO, answers: BinaryIO) -> None:
        self._requests, self._answers = requests, answers
        self._controller: Any = None
        self._scene: Any = None
        self._links: Any = ()
        self._broken: list[str] = []

    def serve(self) -> None:
        """Answer requests until the pipe is closed."""
        serve: dict[str, Callable[..., None]] = {"load": self._load, "reset": self._reset, "act": self._act}
        while (request := self._next()) is not None:
            tick = request[1] if request[0] == "act" else 0
            try:
                serve[request[0]](*request[1:])
            except BaseException as error:
                self._send(ERROR, tick, text=f"{described(error)}{_place_of(error)}")

    def _next(self) -> Any:
        header = self._requests.read(LENGTH.size)
        if len(header) < LENGTH.size:
            return None
        return pickle.loads(self._requests.read(LENGTH.unpack(header)[0]))

    def _send(self, kind: bytes, tick: int = 0, command: Twist | None = None, text: str = "") -> None:
        if self._broken:
            kind, text = ERROR, f"the controller tried to {self._broken[0]}"
        content = text.encode(errors="replace")[:4000]
        numbers = (0.0, 0.0, 0.0) if command is None else (float(command.vx), float(command.vy), float(command.omega))
        self._answers.write(ANSWER.pack(kind, tick, *numbers, len(content)) + content)
        self._answers.flush()

    def _load(self, source: ControllerSource, files: Sequence[str]) -> None:
        self._broken = install_rules([*files, *source.unpack()])
        controller: Controller = source.create()
        self._controller = controller
        about = {
            "partial": bool(controller.partial),
            "image": controller.image is not None,
            "deterministic": bool(controller.deterministic),
            "sensors": [definition_of(sensor) for sensor in controller.sensors],
        }
        self._send(READY, text=orjson.dumps(about).decode())

    def _reset(self, scene: Scene) -> None:
        self._scene, self._links = scene, scene.interactions
        self._controller.reset(known_to(self._controller, scene))
        self._send(READY)

    def _act(
        self, tick: int, row: bytes, activity: bytes, present: bytes | None, doors: int, links: Any, contacts: Any,
        goal: Any, readings: Any, held: Any,
    ) -> None:  # fmt: skip
        if links is not None:
            self._links = links
        scene = self._scene if goal is None else self._scene.with_goal(goal)
        is_present = None if present is None else frozen(np.frombuffer(present, dtype=np.bool_))
        state = State(
            frozen(np.frombuffer(row)), frozen(np.frombuffer(activity, dtype=np.int64)), is_present, doors
        )  # fmt: skip
        snapshot = Snapshot.of_state(tick, scene, state, self._links, contacts)
        if readings is not None:
            vars(snapshot)["sensors"] = Readings(readings)
        if held is not None:
            self._controller.command_overridden(Twist(*held))
        answer = self._controller.act(shown_to(self._controller, snapshot))
        if isinstance(answer, Stop | Regenerate):
            self._send(STOP, tick, text=answer.reason)
        elif isinstance(answer, Twist):
            self._send(COMMAND, tick, answer)
        else:
            self._send(ERROR, tick, text=f"act must return a Twist, got {answer!r:.100}")


def _place_of(error: BaseException) -> str:
    """File and line at which an error was raised; without folders, so that it is the same on every machine."""
    frames = traceback.extract_tb(error.__traceback__)
    return f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""


def main() -> None:
    """Serve through standard input and output; what the controller prints goes to standard error."""
    answers = os.fdopen(os.dup(1), "wb", buffering=io.DEFAULT_BUFFER_SIZE)
    os.dup2(2, 1)
    requests = os.fdopen(os.dup(0), "rb", buffering=1 << 16)
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    Child(requests, answers).serve()
