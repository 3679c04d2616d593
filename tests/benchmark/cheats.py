"""Controllers that try to cheat; docs/benchmark.md names them."""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import pickle
import socket
import sqlite3
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import sonata2d as s2
from sonata2d.agents.controllers.base import Answer

AHEAD = s2.Twist(vx=0.5)


class Honest(s2.Controller):
    def act(self, snapshot: s2.Snapshot) -> Answer:
        return AHEAD


class ReadsSuite(Honest):
    """Opens the file of the suite, to generate the scenes from it."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        json.loads((Path(s2.__file__).parent / "benchmark" / "suites" / "s2b-1.json").read_text())
        return AHEAD


class Generates(Honest):
    """Generates the scenes of the public test seed."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        s2.generate("sonata-2020", seed=271828)
        return AHEAD


class Simulates(Honest):
    """Runs the simulator ahead from what it sees."""

    def reset(self, scene: s2.Scene) -> None:
        self._scene = scene

    def act(self, snapshot: s2.Snapshot) -> Answer:
        importlib.import_module("sonata2d.sim.world").World(self._scene)
        return AHEAD


class Forks(Honest):
    """Starts a process that goes on after the answer."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        if os.fork() == 0:
            os._exit(0)
        return AHEAD


class StartsProgram(Honest):
    """Starts a program without the rules of this process."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        subprocess.run([sys.executable, "-c", "pass"], check=False)
        return AHEAD


class Connects(Honest):
    """Asks a server for commands."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        socket.create_connection(("127.0.0.1", 9), timeout=0.1)
        return AHEAD


class ReadsParent(Honest):
    """Reads the memory of the benchmark's process."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        Path(f"/proc/{os.getppid()}/maps").read_text()
        return AHEAD


class WritesNotes(Honest):
    """Keeps notes on the scenes in a file, for later runs."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        Path(__file__).with_name("notes.txt").write_text("scene 1")
        return AHEAD


class ReadsFolder(Honest):
    """Reads a file in its own folder that is none of its own, such as the secret of a keeper."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        Path(__file__).with_name("README.md").read_text()
        return AHEAD


class MovesKernel(Honest):
    """Makes a file in the folder of kernels, where it may write, and moves it elsewhere."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        file = Path(os.environ["NUMBA_CACHE_DIR"]) / "sonata2d" / "x.kernel"
        file.write_bytes(b"notes")
        file.rename(Path(__file__).with_name("notes.kernel"))
        return AHEAD


class UsesDatabase(Honest):
    """Keeps notes in a database, whose library opens files by itself."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        sqlite3.connect(Path(__file__).with_name("notes.db"))
        return AHEAD


class SetsEnvironment(Honest):
    """Sets a variable of its own process, which is allowed."""

    def reset(self, scene: s2.Scene) -> None:
        os.environ["MINE"] = "1"
        Path("/proc/self/status").read_text()


class HidesRefusal(Honest):
    """Catches what refuses it, and goes on."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        with contextlib.suppress(PermissionError):
            s2.generate("empty")
        return AHEAD


class Snoops(Honest):
    """Looks for scenes and secrets in the memory of its own process; its command says what it found."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        scenes = [each for each in gc.get_objects() if isinstance(each, s2.Scene)]
        found = [each for each in scenes if each.settings is not None or each.seed or each.episode]
        goals = [human for each in scenes for human in each.humans if human.goals or human.enters]
        text = " ".join(sys.argv) + "".join(f"{key}{value}" for key, value in os.environ.items())
        return s2.Twist(vx=0.1 * bool(found), vy=0.1 * bool(goals), omega=0.1 * ("271828" in text))


class _Bomb:
    def __reduce__(self) -> Any:
        return os.system, ("true",)


class SendsObject(Honest):
    """Answers with an object that runs code where it is unpickled."""

    def act(self, snapshot: s2.Snapshot) -> Any:
        return pickle.dumps(_Bomb())


class AnswersTwice(Honest):
    """Writes further answers into the pipe by itself."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        record = struct.pack("<cI3dI", b"C", snapshot.tick + 1, 9.0, 0.0, 0.0, 0)
        for descriptor in range(3, 20):
            try:
                os.write(descriptor, record)
            except OSError:
                continue
        return AHEAD


class ThinksLong(Honest):
    """Takes more time than its budget in every fifth tick."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        if snapshot.tick % 5 == 4:
            end = time.perf_counter() + 0.8
            while time.perf_counter() < end:
                pass
            return s2.Twist(vx=-0.5)
        return AHEAD


class NotFinite(Honest):
    """Answers with numbers that no file can hold."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        return s2.Twist(vx=float("nan"))


class Raises(Honest):
    """Fails in the middle of an episode."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        if snapshot.tick == 7:
            raise RuntimeError("no plan")
        return AHEAD


class ExitsAtOnce(Honest):
    """Ends its process in the first tick, also in practice."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        os._exit(3)


class Exits(Honest):
    """Ends its process."""

    def act(self, snapshot: s2.Snapshot) -> Answer:
        if snapshot.tick == 7:
            os._exit(3)
        return AHEAD
