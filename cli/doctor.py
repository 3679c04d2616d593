"""`sonata2d doctor`."""

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

from .output import json_option, show_json

PACKAGES = (
    "pymunk",
    "numpy",
    "pydantic",
    "pygame-ce",
    "pygame-gui",
    "orjson",
    "click",
    "tqdm",
    "PyYAML",
    "jinja2",
    "zstandard",
    "platformdirs",
)
DIGEST = (
    "fa69ca01d021e9e09ab297d39f0ef070"  # of the trial episode's numbers: the same wherever sonata2d works as it should
)

Finding = tuple[bool | None, str]  # whether it holds (None: optional and absent), and what was found


@click.command(epilog="Example:  sonata2d doctor --json")
@json_option
def command(as_json: bool) -> None:
    """Check that this installation works: packages, engine, reproducibility, writing, films, display, speed.

    Exit code 1 if anything that data sets need is broken; what is only missing is told.
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
    """Everything that was checked."""
    trial = _tried(_trial)
    film = all(importlib.util.find_spec(name) for name in ("imageio_ffmpeg", "PIL"))
    screen = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")) or sys.platform in ("win32", "darwin")
    return {
        "python": (True, f"{platform.python_version()} on {platform.platform()}"),
        **{package: _installed(package) for package in PACKAGES},
        "trial episode": trial,
        "writing": _tried(_writing),
        "films": (True, "gif and mp4") if film else (None, "none; pip install 'sonata2d[video]'"),
        "display": (True, "yes") if screen else (None, "none; everything but a window works"),
    }


def _installed(package: str) -> Finding:
    try:
        return True, version(package)
    except PackageNotFoundError:
        return False, f"missing; pip install {package}"


def _tried(check: Callable[[], Finding]) -> Finding:
    try:
        return check()
    except Exception as error:
        return False, f"{type(error).__name__}: {error}"


def _trial() -> Finding:
    """Run an episode twice, and compare its numbers with each other and with those of other machines."""
    digest, ticks = trial_digest()
    start = time.process_time()
    again, _ = trial_digest()
    pace = f"{ticks / (time.process_time() - start):.0f} frames a CPU second with social-planner"
    if again != digest:
        return False, "two runs of one episode differ; please report this"
    if platform.machine() not in ("x86_64", "AMD64"):
        return True, f"two runs agree; {pace}"
    if digest != DIGEST:
        return False, f"numbers differ from those of other machines ({digest}); please report this with your processor"
    return True, f"the same numbers as on other machines; {pace}"


def trial_digest() -> tuple[str, int]:
    """First half of the SHA-256 of a crowded episode's frames, and how many there are."""
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
