"""The process of a controller in the benchmark: it gets snapshots through a pipe, and answers with three numbers.

An audit hook (PEP 578) refuses what a controller of the benchmark must not do: start processes, use the network, read
or write files other than its own and the installed packages, generate scenes and simulate worlds. The hook stops code
in Python; it is no sandbox against native code. No seed, no settings and no intentions of people are ever sent to this
process, so that little is to be found here.
"""

from __future__ import annotations

import io
import os
import pickle
import struct
import sys
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

_PROCESSES = frozenset(
    {"os.fork", "os.forkpty", "os.exec", "os.posix_spawn", "os.spawn", "os.system", "os.startfile", "os.kill",
     "os.killpg", "os.putenv", "subprocess.Popen", "pty.spawn", "_winapi.CreateProcess", "_winapi.OpenProcess"}
)  # fmt: skip
_NETWORK = frozenset(
    {"socket.connect", "socket.bind", "socket.sendto", "socket.sendmsg", "socket.getaddrinfo", "socket.gethostbyname"}
)
_CHANGES = frozenset(
    {"os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate", "os.chmod", "os.chown",
     "shutil.rmtree", "shutil.move"}
)  # fmt: skip
_SIMULATION = frozenset({"sonata2d.generate", "sonata2d.simulate"})
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_OF_SYSTEM = ("/proc/self/", "/proc/cpuinfo", "/proc/meminfo", "/proc/stat", "/sys/", "/etc/", "/usr/", "/lib",
              "/dev/urandom", "/dev/random")  # fmt: skip
_CODE = (".py", ".pyc", ".so", ".pyd")
_METADATA = (".egg-info", ".dist-info")  # of installed packages, which may be anywhere
_SECRET_OF_SYSTEM = ("/proc/self/mem", "/proc/self/environ", "/proc/self/fd", "/proc/self/root", "/proc/self/cwd")


class Rules:
    """The audit hook.

    Args:
        folders: of the controller's own files, which it may read.

    Attributes:
        broken: descriptions of what was refused.
    """

    def __init__(self, folders: Sequence[str]) -> None:
        package = Path(__file__).resolve().parent
        installed = [sys.prefix, sys.base_prefix, sys.exec_prefix, str(package.parent)]
        installed += [path for path in sys.path if path and Path(path).name in ("site-packages", "dist-packages")]
        self._may_read = tuple(os.path.realpath(path) + os.sep for path in (*installed, *folders)) + _OF_SYSTEM
        self._must_not_read = (str(package / "suites"), *_SECRET_OF_SYSTEM)
        cache = cache_folder()
        self._may_write = () if cache is None else (os.path.realpath(cache) + os.sep,)
        self.broken: list[str] = []

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Refuse an event.

        Raises:
            PermissionError: it is against the rules.
        """
        if event == "open":
            self._check_file(*arguments)
        elif event in _PROCESSES:
            self._refuse(f"start or stop processes ({event})")
        elif event in _NETWORK:
            self._refuse(f"use the network ({event})")
        elif event in _SIMULATION:
            self._refuse(f"run the simulator ({event})")
        elif event in _CHANGES and not self._is_in_cache(arguments[0]):
            self._refuse(f"change files ({event} {arguments[0]!r:.80})")

    def _check_file(self, path: Any, mode: Any, flags: int) -> None:
        if isinstance(path, int):  # a descriptor that is open already
            return
        place = os.path.realpath(os.fsdecode(path))
        is_written = bool(flags & _WRITING) or bool(mode and set(str(mode)) & set("wax+"))
        if place == os.devnull or (place + os.sep).startswith(self._may_write):
            return
        if is_written:
            self._refuse(f"write {place}")
        may_read = place.startswith(self._may_read) or place.endswith(_CODE) or Path(place).parent.suffix in _METADATA
        is_nothing = os.path.isdir(place) or not os.path.lexists(place)
        if (place.startswith(self._must_not_read) or not may_read) and not is_nothing:
            self._refuse(f"read {place}")

    def _is_in_cache(self, path: Any) -> bool:
        if not isinstance(path, str | bytes | os.PathLike):
            return False
        return (os.path.realpath(os.fsdecode(path)) + os.sep).startswith(self._may_write)

    def _refuse(self, what: str) -> None:
        self.broken.append(what)
        raise PermissionError(f"a controller of the benchmark must not {what}")


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
        self._rules = Rules(())

    def serve(self) -> None:
        """Answer requests until the pipe is closed."""
        serve: dict[str, Callable[..., None]] = {"load": self._load, "reset": self._reset, "act": self._act}
        while (request := self._next()) is not None:
            tick = request[1] if request[0] == "act" else 0
            try:
                serve[request[0]](*request[1:])
            except BaseException as error:
                self._send(ERROR, tick, text=described(error))

    def _next(self) -> Any:
        header = self._requests.read(LENGTH.size)
        if len(header) < LENGTH.size:
            return None
        return pickle.loads(self._requests.read(LENGTH.unpack(header)[0]))

    def _send(self, kind: bytes, tick: int = 0, command: Twist | None = None, text: str = "") -> None:
        if self._rules.broken:
            kind, text = ERROR, f"the controller tried to {self._rules.broken[0]}"
        content = text.encode(errors="replace")[:4000]
        numbers = (0.0, 0.0, 0.0) if command is None else (float(command.vx), float(command.vy), float(command.omega))
        self._answers.write(ANSWER.pack(kind, tick, *numbers, len(content)) + content)
        self._answers.flush()

    def _load(self, source: ControllerSource, folders: Sequence[str]) -> None:
        self._rules = Rules([*folders, *source.unpack()])
        sys.addaudithook(self._rules)
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


def main() -> None:
    """Serve through standard input and output; what the controller prints goes to standard error."""
    answers = os.fdopen(os.dup(1), "wb", buffering=io.DEFAULT_BUFFER_SIZE)
    os.dup2(2, 1)
    requests = os.fdopen(os.dup(0), "rb", buffering=1 << 16)
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    Child(requests, answers).serve()
