"""The command `sonata2d doctor`."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import click

from .command import Command
from .common import examples, json_option, show_json

PACKAGES = (
    "pymunk", "numpy", "pydantic", "pygame-ce", "pygame-gui", "orjson", "lazy-loader", "click", "tqdm", "PyYAML",
    "jinja2", "zstandard", "platformdirs", "filelock",
)  # fmt: skip
COMPILER = ("numba", "llvmlite")  # the interpreter runs the simulation without them
DIGEST = "fa69ca01d021e9e09ab297d39f0ef070"  # of the frames of the trial episode, the same on every machine

Finding = tuple[bool | None, str]  # whether the check passed (None: an optional part is missing), and a description


@click.command(cls=Command, epilog=examples("doctor", "doctor --json"))
@json_option
def command(as_json: bool) -> None:
    """Check that the installation works: packages, engine, compiler, reproducibility, files, films, display, speed.

    The exit code is 1 if a required part fails; missing optional parts are only listed.
    """
    rows = [(name, ok, found) for name, (ok, found) in findings().items()]
    if as_json:
        show_json([{"check": name, "ok": ok, "found": found} for name, ok, found in rows])
    else:
        marks = {True: "ok", False: "FAIL", None: "-"}
        for name, ok, found in rows:
            click.echo(f"{marks[ok]:<5} {name:<14} {found}")
    if any(ok is False for _, ok, _ in rows):
        sys.exit(1)


def findings() -> dict[str, Finding]:
    """Run all checks."""
    has_film = all(importlib.util.find_spec(name) for name in ("imageio_ffmpeg", "PIL"))
    has_display = sys.platform in ("win32", "darwin") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    return {
        "python": (True, f"{platform.python_version()} on {platform.platform()}"),
        **{package: _package(package) for package in PACKAGES},
        **{package: _package(package, is_required=False) for package in COMPILER},
        "kernels": _run(_kernels),
        "trial episode": _run(_trial_episode),
        "writing": _run(_writing),
        "films": (True, "gif and mp4") if has_film else (None, "not available; pip install 'sonata2d[video]'"),
        "display": (True, "available") if has_display else (None, "not available; all commands without a window work"),
    }


def _package(name: str, *, is_required: bool = True) -> Finding:
    try:
        return True, version(name)
    except PackageNotFoundError:
        return (False if is_required else None), f"missing; pip install {name}"


def _run(check: Callable[[], Finding]) -> Finding:
    """The finding of a check; an exception is a failure."""
    try:
        return check()
    except Exception as error:
        return False, f"{type(error).__name__}: {error}"


def _kernels() -> Finding:
    """How the compiled part of the simulation runs, and where its machine code is kept."""
    from sonata2d.core import compiled

    if not compiled.IS_COMPILED:
        return None, compiled.BACKEND
    from sonata2d.core import kernel_cache

    folder = kernel_cache.writable_folder()
    if folder is None:
        tried = ", ".join(map(str, kernel_cache.folders()))
        return None, f"{compiled.BACKEND}, anew in each process: not writable: {tried}; set NUMBA_CACHE_DIR"
    return True, f"{compiled.BACKEND}; machine code in {folder}"


def _trial_episode() -> Finding:
    """Run an episode twice and compare its numbers with each other and with those of other machines."""
    digest, ticks = trial_digest()
    start = time.process_time()
    second, _ = trial_digest()
    speed = f"{ticks / (time.process_time() - start):.0f} frames per CPU second with social-planner"
    if second != digest:
        return False, "two runs of the same episode differ; please report this"
    if platform.machine() not in ("x86_64", "AMD64"):  # the digest is known for these only
        return True, f"two runs of the same episode are equal; {speed}"
    if digest != DIGEST:
        return False, f"numbers differ from those of other machines ({digest}); please report this with your processor"
    return True, f"the same numbers as on other machines; {speed}"


def trial_digest() -> tuple[str, int]:
    """First half of the SHA-256 of the frames of a crowded episode, and the number of frames."""
    import orjson

    import sonata2d as s2
    from sonata2d.record.recorder import EpisodeRecorder

    recorder = EpisodeRecorder()
    scene = s2.generate(s2.load_scenario("sonata-2020-crowded"), seed=3)
    s2.Episode(scene, s2.SocialPlanner(), observers=[recorder]).run()
    frames = orjson.loads(recorder.document())["frames"]
    return hashlib.sha256(orjson.dumps(frames)).hexdigest()[:32], len(frames)


def _writing() -> Finding:
    from sonata2d.record.files import write_atomically

    with tempfile.TemporaryDirectory() as folder:
        write_atomically(Path(folder) / "trial.json", b"{}")
    return True, "atomic, in the temporary folder"
