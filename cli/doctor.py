"""The command `sonata2d doctor`."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import os
import platform
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import partial
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, version
from pathlib import Path

import click

from sonata2d import registry
from sonata2d.core.files import interruption
from sonata2d.core.wording import one_line
from sonata2d.errors import PluginWarning, Sonata2dError

from .command import Command
from .options import examples, json_option
from .output import show_json, wants_json

_PACKAGES = (
    "pymunk", "numpy", "pydantic", "pygame-ce", "pygame-gui", "orjson", "lazy-loader", "click", "tqdm", "PyYAML",
    "jinja2", "zstandard", "platformdirs", "filelock",
)  # fmt: skip
_COMPILER = ("numba", "llvmlite")  # the interpreter runs the simulation without them
_MODULES = {"pygame-ce": "pygame", "PyYAML": "yaml"}  # where the module is not named as the package
_EXTRAS = {  # name of the extra, what it adds, its modules
    "films": ("video", "gif and mp4", "imageio_ffmpeg", "PIL"),
    "plots": ("plots", "plots of notebooks and examples", "matplotlib"),
    "studies": ("serve", "studies in a browser", "starlette", "uvicorn", "websockets"),
    "parquet": ("parquet", "tables, export to parquet and lerobot", "pyarrow"),
    "hub": ("hub", "data sets on the Hugging Face Hub", "huggingface_hub", "upath"),
    "mcap": ("mcap", "export to mcap", "mcap", "rosbags"),
}
DIGEST = "be973641e150eb787270262275105798"  # of the frames of the trial episode, the same on every machine

Finding = tuple[bool | None, str]  # whether the check passed (None: an optional part is missing), and a description


@click.command(cls=Command, epilog=examples("doctor", "doctor --json"))
@json_option
def command() -> None:
    """Check that the installation works: packages, compiler, plug-ins, reproducibility, files, films, display, speed.

    The exit code is 1 if a required part is missing or anything fails; missing optional parts are only listed.
    """
    rows = [(name, ok, description) for name, (ok, description) in findings().items()]
    if wants_json():
        show_json([{"check": name, "ok": ok, "found": description} for name, ok, description in rows])
    else:
        marks = {True: "ok", False: "FAIL", None: "-"}
        width = max(len(name) for name, _, _ in rows)
        for name, ok, description in rows:
            click.echo(f"{marks[ok]:<5} {name:<{width}} {description}")
    if any(ok is False for _, ok, _ in rows):
        raise click.exceptions.Exit(1)


def findings() -> dict[str, Finding]:
    """Run all checks."""
    has_display = sys.platform in ("win32", "darwin") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    return {
        "python": (True, f"{platform.python_version()} on {platform.platform()}"),
        **{package: _package(package) for package in _PACKAGES},
        **{package: _package(package, is_required=False) for package in _COMPILER},
        "kernels": _run(_kernels),
        **_plugins(),
        "trial episode": _run(_trial_episode),
        "writing": _run(_writing),
        **{kind: _extra(*extra) for kind, extra in _EXTRAS.items()},
        "display": (True, "available") if has_display else (None, "not available; all commands without a window work"),
    }


def _package(name: str, *, is_required: bool = True) -> Finding:
    """The version of a package that can be imported."""
    try:
        installed = version(name)
    except PackageNotFoundError:
        return (False if is_required else None), f"missing; pip install {name}"
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        importlib.import_module(_MODULES.get(name, name.replace("-", "_")))
    except Exception as error:  # a missing library of the system, a version of NumPy that is too new, ...
        return False, f"{installed} cannot be imported ({_reason(error)}); pip install -U {name}"
    return True, installed


def _extra(extra: str, use: str, *modules: str) -> Finding:
    """Whether the packages of an extra are installed."""
    if all(importlib.util.find_spec(module) for module in modules):
        return True, use
    return None, f"not available; pip install 'sonata2d[{extra}]'"


def _plugins() -> dict[str, Finding]:
    """Each plug-in, with the package that it belongs to, and whether it can be used."""
    loaders = (
        (registry.CONTROLLERS, "sonata2d.agents.controllers.loading:find_controller"),
        (registry.PEDESTRIAN_MODELS, "sonata2d.agents.pedestrians.models.base:pedestrian_model"),
        (registry.DRIVES, "sonata2d.registry:drive_class"),
        (registry.SENSORS, "sonata2d.agents.sensors.base:sensor_class"),
        (registry.FORMATS, "sonata2d.formats.api:format_named"),
        (registry.METRICS, f"{__name__}:_load_metric"),
        (registry.ROOM_KINDS, "sonata2d.scenegen.floor_plans:load_room_kind"),
        (registry.QUESTION_KINDS, "sonata2d.study.questions:question_kind"),
        (registry.OBSERVATION_PARTS, "sonata2d.gym.parts:part_named"),
        (registry.FURNITURE_TYPES, "sonata2d.registry:furniture_type"),
        (registry.PERSON_KINDS, "sonata2d.registry:person_kind"),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PluginWarning)  # the findings say the same
        return {
            f"{kind.kind} {point.name}": _run(partial(_plugin, kind, loader, point))
            for kind, loader in loaders
            for point in entry_points(group=kind.group)
        }


def _plugin(kind: registry.Registry, loader: str, point: EntryPoint) -> Finding:
    """Whether a plug-in can be loaded by a function, `module:function`."""
    package = f"plug-in of {point.dist.name} {point.dist.version}" if point.dist else "plug-in"
    kept = kind.plugins.get(point.name)
    if kept is None or kept != point:
        return False, f"{package}: the name is taken; rename the entry point ({point.value})"
    try:
        registry.resolve(loader)(point.name)
    except Sonata2dError as error:
        return False, f"{package}: {' '.join(str(error).split())}"
    return True, f"{package}: {point.value}"


def _load_metric(name: str) -> None:
    from sonata2d.metrics.catalogue import plugin_problem, select_metrics

    registry.METRICS.load(name, plugin_problem)
    select_metrics([name])  # fails if the metric has another name than the entry point


def _run(check: Callable[[], Finding]) -> Finding:
    """The finding of a check; an exception is a failure."""
    try:
        return check()
    except Exception as error:
        interruption.reraise(error)
        return False, _reason(error)


def _reason(error: Exception) -> str:
    return one_line(f"{type(error).__name__}: {error}")


def _kernels() -> Finding:
    """Whether the simulation runs compiled or interpreted, and the folder of the machine code."""
    from sonata2d.core.compiled import kernel as compiled

    if not compiled.IS_COMPILED:
        return None, compiled.BACKEND
    from sonata2d.core.compiled import cache as kernel_cache

    folder = kernel_cache.writable_folder()
    if folder is None:
        return None, f"{compiled.BACKEND}, anew in each process: {kernel_cache.reason_without_folder()}"
    return True, f"{compiled.BACKEND}; machine code in {folder}"


def _trial_episode() -> Finding:
    """Run an episode twice, and compare the numbers of both runs and of other machines."""
    digest, ticks = trial_digest()
    start = time.process_time()
    second, _ = trial_digest()
    speed = f"{ticks / (time.process_time() - start):.0f} frames per CPU second with social-planner"
    if second != digest:
        return False, "two runs of the same episode differ; please report this"
    if platform.machine() not in ("x86_64", "AMD64"):  # the digest is known for these only
        return True, f"two runs of the same episode are equal; {speed}"
    if digest != DIGEST:
        return False, f"numbers differ from other machines ({digest}); please report this with your processor"
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
