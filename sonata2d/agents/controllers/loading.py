"""Controllers by name: stock ones, a module's, a file's, or those that other packages publish."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from ...errors import ControllerError
from ...registry import CONTROLLERS
from .base import Controller, current_path
from .labelled import Labelled

WEIGHTS = ".npz"


def load_controller(name: str, settings: Mapping[str, Any] | None = None) -> Controller:
    """Make the controller that a name stands for.

    Args:
        name: a stock or published name (`social-planner`), `package.module:Class`, a file `./mine.py:Class`, weights
            of a graph policy `./policy.npz`, or two of these, `driver+labeller` (see `agents.Labelled`).
        settings: as a file tells them, to have the one that made it.

    Raises:
        ControllerError: there is no such thing, it is no `Controller`, it cannot be made without arguments, or it
            cannot be had as the settings tell.
    """
    driver, labeller = _two(name)
    if labeller:
        told = settings or {}
        with _naming(name):
            halves = load_controller(driver, told.get("driver")), load_controller(labeller, told.get("labeller"))
        if any(isinstance(half, Labelled) for half in halves):
            raise ControllerError(f"{name}: one drives and one labels, driver+labeller; there is no third")
        return Labelled(*halves)
    if name.endswith(WEIGHTS):
        policy: Any = CONTROLLERS.load("graph-policy")
        learned: Controller = policy(name) if settings is None else policy.from_settings(settings, found=name)
        return learned
    kind = find_controller(name)
    try:
        return kind() if settings is None else kind.from_settings(settings)
    except ControllerError:
        raise
    except Exception as error:
        raise ControllerError(f"{name} cannot be made without arguments: {type(error).__name__}: {error}") from error


def named_controllers() -> dict[str, type[Controller]]:
    """The stock controllers and those of installed packages, by name."""
    return CONTROLLERS.load_all(_problem)


def find_controller(name: str) -> type[Controller]:
    """The class that a name stands for; see `load_controller`."""
    if name in CONTROLLERS.built_in:
        kind: type[Controller] = CONTROLLERS.load(name)
        return kind
    place, colon, attribute = current_path(name).rpartition(":")
    if not colon or (len(place) == 1 and place.isalpha()):  # a Windows drive is not a module
        return _published(name)
    return _class_in(_module(place), attribute, name)


def _two(name: str) -> tuple[str, str]:
    """The driver and the labeller that a name tells of; no labeller if it tells of one.

    A file may have a plus in its path: parted is where a file is left to the right, or else at the last plus.
    """
    pluses = [k for k, letter in enumerate(name) if letter == "+" and 0 < k < len(name) - 1]
    if not pluses or _is_file(name):
        return name, ""
    at = next((k for k in reversed(pluses) if _is_file(name[k + 1 :])), pluses[-1])
    return name[:at], name[at + 1 :]


def _is_file(name: str) -> bool:
    """Whether a name is a file, or one and a class in it."""
    place, _, attribute = name.rpartition(":")
    return Path(name).is_file() or (Path(place).is_file() and "+" not in attribute)


@contextmanager
def _naming(name: str) -> Iterator[None]:
    """Tell with an error which name it is a part of."""
    try:
        yield
    except ControllerError as error:
        error.add_note(f"in {name!r}, which is driver+labeller")
        raise


def _published(name: str) -> type[Controller]:
    if name not in CONTROLLERS:
        raise ControllerError(f"{CONTROLLERS.unknown(name)}; a class is named module:Class or ./file.py:Class")
    kind: type[Controller] = CONTROLLERS.load(name, _problem)
    return kind


def _module(place: str) -> ModuleType:
    """Import a module by its name or from its file."""
    try:
        if not place.endswith(".py"):
            return importlib.import_module(place)
        path = Path(place)
        if not path.is_file():
            raise ControllerError(f"controller file {place} does not exist")
        return _module_from(path)
    except ControllerError:
        raise
    except Exception as error:
        raise ControllerError(f"{place} cannot be imported: {type(error).__name__}: {error}") from error


def _module_from(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module, folder = importlib.util.module_from_spec(spec), str(path.parent.resolve())
    is_new = sys.modules.setdefault(path.stem, module) is module  # dataclasses and pickles look it up there
    sys.path.insert(0, folder)  # so that it may import its neighbours
    try:
        spec.loader.exec_module(module)
    except BaseException:
        if is_new:
            del sys.modules[path.stem]
        raise
    finally:
        sys.path.remove(folder)
    return module


def _class_in(module: ModuleType, attribute: str, name: str) -> type[Controller]:
    found = getattr(module, attribute, None)
    if found is None:
        there = [k for k, v in vars(module).items() if _is_controller(v)]
        hint = f"it has {', '.join(there)}" if there else "it has no Controller at all"
        raise ControllerError(f"{name}: no {attribute!r} in {module.__name__}; {hint}")
    return _checked(found, name)


def _checked(found: object, name: str) -> type[Controller]:
    problem = _problem(found)
    if problem is not None:
        raise ControllerError(f"{name} {problem}")
    assert isinstance(found, type)
    return found


def _problem(found: object) -> str | None:
    """Why an object cannot be used as a controller class."""
    return None if _is_controller(found) else "is no Controller; write class X(sonata2d.Controller) with a method act"


def _is_controller(thing: object) -> bool:
    """Whether a thing is a controller class that can be made."""
    return isinstance(thing, type) and issubclass(thing, Controller) and not inspect.isabstract(thing)
