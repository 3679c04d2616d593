"""Load controllers by name: built-in ones, plug-ins, classes in modules or files, policy files, `driver+labeller`."""

from __future__ import annotations

import atexit
import hashlib
import importlib
import importlib.util
import inspect
import json
import os
import pickle
import shutil
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import cloudpickle

from ...core.code_hash import code_sha256
from ...core.files import interruption
from ...core.files.archives import read_npz
from ...core.files.limits import MAX_WEIGHTS_BYTES
from ...core.files.reading import read_at_most
from ...core.files.whole_file import whole_file
from ...core.wording import described, one_line, shown
from ...errors import ControllerError
from ...registry import CONTROLLERS, GYM_POLICY, resolve
from .base import Controller, recorded_path
from .labelled import Labelled

_WEIGHTS_SUFFIX = ".npz"
_POLICY_SUFFIXES = (_WEIGHTS_SUFFIX, ".onnx")


@interruption.surroundings_kept()
def load_controller(name: str, settings: Mapping[str, Any] | None = None) -> Controller:
    """Create a controller from its name.

    Args:
        name: a built-in name or a plug-in's (`social-planner`), a class `package.module:Class` or `./file.py:Class`,
            a file `./file.py` that defines one controller class, a policy `./policy.npz` (of `learning.write_weights`
            or `gym.save_policy`) or `./policy.onnx`, or two of these, `driver+labeller` (see `agents.Labelled`).
        settings: as stored in an episode file; reconstructs the recorded controller. None: default settings.

    Raises:
        ControllerError: the name is unknown, the object is not a `Controller` class, it cannot be created without
            arguments, or it cannot be reconstructed from the settings.
    """
    driver_name, labeller_name = split_pair(name)
    if labeller_name:
        recorded = settings or {}
        try:
            driver = load_controller(driver_name, recorded.get("driver"))
            labeller = load_controller(labeller_name, recorded.get("labeller"))
        except ControllerError as error:
            error.add_note(f"in {name!r}, which is driver+labeller")
            raise
        if isinstance(driver, Labelled) or isinstance(labeller, Labelled):
            raise ControllerError(f"{name} names more than two controllers; give one driver and one labeller")
        return Labelled(driver, labeller)
    if name.endswith(".zip") and os.path.isfile(name):
        raise ControllerError(
            f"{name} does not say what the policy observes; if it is a model of Stable-Baselines3, write it with "
            "sonata2d.gym.save_policy as .npz or .onnx"
        )
    if name.endswith(_POLICY_SUFFIXES):
        policy: Any = _policy_class(Path(name))
        learned: Controller = policy(name) if settings is None else policy.from_settings(settings, weights=name)
        return learned
    return _created(find_controller(name), name, settings)


def _created(controller_class: type[Controller], name: str, settings: Mapping[str, Any] | None = None) -> Controller:
    """A controller of a class, with default or recorded settings; `name` is for messages."""
    try:
        return controller_class() if settings is None else controller_class.from_settings(settings)
    except ControllerError:
        raise
    except BaseException as error:
        interruption.reraise(error)
        how = "without arguments, which need defaults" if settings is None else "from its recorded settings"
        raise ControllerError(f"{name} cannot be created {how}: {described(error)}") from error


def _policy_class(path: Path) -> Any:
    """The class of controllers that drive with the policy of a file."""
    if path.suffix == _WEIGHTS_SUFFIX and not _is_perceptron(path):
        return CONTROLLERS.load("graph-policy")
    try:
        return resolve(GYM_POLICY)
    except ModuleNotFoundError as error:
        raise ControllerError(f"{path.name} was trained with Gymnasium: {error}") from error


def _is_perceptron(path: Path) -> bool:
    """Whether a file holds the weights of a multilayer perceptron; False if it cannot be read."""
    try:
        header = read_npz(read_at_most(path, MAX_WEIGHTS_BYTES), MAX_WEIGHTS_BYTES, ["about"])["about"]
        return bool(json.loads(str(header))["kind"] == "mlp")
    except (ArithmeticError, KeyError, OSError, RecursionError, TypeError, ValueError):
        return False


class ControllerSource:
    """Recipe from which each process of a batch creates the controller.

    Args:
        controller: a name as for `load_controller`, a class derived from `Controller`, or an object of one.

    Attributes:
        name: under which files record the controller.

    Raises:
        TypeError: it is something else.
    """

    def __init__(self, controller: str | Controller | type[Controller]) -> None:
        if isinstance(controller, type) and (problem := _problem(controller)):
            raise TypeError(f"{controller.__name__} {problem}")
        if not isinstance(controller, str | Controller | type):
            raise TypeError(
                "a controller is a name, a class derived from sonata2d.Controller or an object of one, got "
                f"{shown(controller)}"
            )
        self._controller: Any = controller
        self._pickled = b""
        self._files: dict[str, bytes] = {}
        if isinstance(controller, str):
            self.name = controller
        else:
            self.name = recorded_path(controller if isinstance(controller, type) else type(controller))

    def create(self) -> Controller:
        """The controller: a new one of a name or class, or the object itself; in another process a copy of it.

        Raises:
            ControllerError: it cannot be created, or its class is not known in this process.
        """
        if self._controller is None:
            try:
                self._controller = pickle.loads(self._pickled)
            except Exception as error:  # whatever the classes of the object do
                raise ControllerError(f"{self.name} is unknown in another process: {described(error)}") from error
        if isinstance(self._controller, str):
            self._controller = self._with_copies(self._controller)
            return load_controller(self._controller)
        if isinstance(self._controller, type):
            return _created(self._controller, self.name)
        controller: Controller = self._controller
        return controller

    def unpack(self) -> list[str]:
        """Write the files of the controller that this machine lacks; returns the paths of all its files."""
        if not isinstance(self._controller, str):
            return []
        self._controller = self._with_copies(self._controller)
        files = map(file_in, split_pair(self._controller))
        return sorted({os.path.abspath(file) for file in files if file is not None})

    def _with_copies(self, name: str) -> str:
        """The name, in which files that this machine lacks, or has with another content, are copies of those sent."""
        for place, content in self._files.items():
            if not (os.path.isfile(place) and Path(place).read_bytes() == content):
                copy = _copies() / hashlib.sha256(content).hexdigest() / os.path.basename(place)
                if not copy.exists():
                    copy.parent.mkdir(exist_ok=True)
                    with whole_file(copy) as temporary:
                        temporary.write_bytes(content)
                name = name.replace(place, str(copy))
        return name

    def __getstate__(self) -> dict[str, Any]:
        """State for other processes; classes of a notebook or script, and files, are sent with their content."""
        if not self._pickled:
            try:
                self._pickled = cloudpickle.dumps(self._controller)
            except Exception as error:  # whatever the classes of the object do
                raise ControllerError(
                    f"{self.name} cannot be sent to other processes: {described(error)}; use one worker"
                ) from error
        files = {}
        for part in split_pair(self.name) if isinstance(self._controller, str) else ():
            place = file_in(part)
            if place is not None:
                files[place] = Path(place).read_bytes()
        name = self._controller if isinstance(self._controller, str) else None
        return {"name": self.name, "_pickled": self._pickled, "_controller": name, "_files": files or self._files}


@cache
def _copies() -> Path:
    """A folder for copies of files of another machine; it is removed when this process ends."""
    folder = tempfile.mkdtemp(prefix="sonata2d-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def is_installed(name: str, settings: Mapping[str, Any]) -> bool:
    """Whether a recorded controller is a built-in one or a plug-in's, with the weights that belong to it; likewise its
    inner controller.

    Only such a controller may be created because a file names it: another name would let a file run any code.

    Args:
        name, settings: as stored in an episode file.
    """
    driver, labeller = split_pair(name)
    if labeller:
        pair = (driver, settings.get("driver")), (labeller, settings.get("labeller"))
        return all(is_installed(part, weights or {}) for part, weights in pair)
    is_known = name in CONTROLLERS or name in CONTROLLERS.built_in.values()
    is_known = is_known or any(name == point.value for point in CONTROLLERS.plugins.values())
    inner = inner_of(settings)
    return is_known and settings.get("weights") is None and (inner is None or is_installed(*inner))


def inner_of(settings: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]] | None:
    """Name and settings of the inner controller in the recorded settings of `HumanLike`; None if there is none."""
    inner = settings.get("inner")
    if inner is None:
        return None
    path, values = (inner.get("path"), inner.get("settings")) if isinstance(inner, Mapping) else (None, None)
    return str(path), values if isinstance(values, Mapping) else {}  # other values are no name that is known


def is_built_in(controller: Controller) -> bool:
    """Whether a controller, or the driver of a pair, is part of sonata2d."""
    driver = controller.driver if isinstance(controller, Labelled) else controller
    return _is_own_module(type(driver).__module__)


def source_hashes(name: str, controller: Controller) -> dict[str, str]:
    """SHA-256 of the source file that defines a controller, by its name; of `driver+labeller` both.

    Modules that the file imports are not included. Controllers of sonata2d are left out, because its version covers
    them. A class without a file, as in a notebook, has the hash of its code (`core.code_hash`).

    Args:
        name: with which the controller was loaded.
        controller: as `load_controller` returns it.
    """
    if isinstance(controller, Labelled):
        driver, labeller = split_pair(name)
        return source_hashes(driver, controller.driver) | source_hashes(labeller, controller.labeller)
    module = type(controller).__module__
    path = Path(name.rpartition(":")[0] or name)
    if path.suffix != ".py" or path.stem != module:  # a module, or a file that imports the class from another module
        path = Path(getattr(sys.modules.get(module), "__file__", None) or "")
    if _is_own_module(module):
        return {}
    if not path.is_file():
        return {name: code_sha256(type(controller))}
    return {name: hashlib.sha256(path.read_bytes()).hexdigest()}


def _is_own_module(module: str) -> bool:
    return module.split(".")[0] == __name__.split(".")[0]


def named_controllers() -> dict[str, type[Controller]]:
    """The controller classes, built in and of installed plug-ins, by name."""
    return CONTROLLERS.load_all(_problem)


def find_controller(name: str) -> type[Controller]:
    """The controller class of a name; see `load_controller` for names and errors."""
    if name in CONTROLLERS.built_in:
        controller_class: type[Controller] = CONTROLLERS.load(name)
        return controller_class
    module, colon, attribute = name.rpartition(":")
    if not colon or (len(module) == 1 and module.isalpha()):  # the colon of a Windows drive separates no class
        return _only_class(_import_module(name), name) if name.endswith(".py") else _find_plugin(name)
    return _find_class(_import_module(module), attribute, name)


def split_pair(name: str) -> tuple[str, str]:
    """Split `driver+labeller`; the labeller is empty if the name stands for one controller.

    Paths may contain a plus. The name is split at the last plus that has a file on its right, else at the last plus.
    """
    pluses = [k for k, letter in enumerate(name) if letter == "+" and 0 < k < len(name) - 1]
    if not pluses or _is_file(name):
        return name, ""
    at = next((k for k in reversed(pluses) if _is_file(name[k + 1 :])), pluses[-1])
    return name[:at], name[at + 1 :]


def file_in(name: str) -> str | None:
    """The file that the name of one controller contains, `file` or `file:Class`; None if there is none."""
    return next((place for place in (name, name.rpartition(":")[0]) if place and os.path.isfile(place)), None)


def _is_file(name: str) -> bool:
    """Whether a name is the path of a file, or `file:Class`."""
    path, _, attribute = name.rpartition(":")
    # os.path.isfile is False for an impossible name, for which Path.is_file raises an exception
    return os.path.isfile(name) or (os.path.isfile(path) and "+" not in attribute)


def _find_plugin(name: str) -> type[Controller]:
    if name not in CONTROLLERS:
        message = CONTROLLERS.unknown(name)
        how = "" if "did you mean" in message else "; a class is named module:Class or ./file.py:Class"
        raise ControllerError(message + how)
    controller_class: type[Controller] = CONTROLLERS.load(name, _problem)
    return controller_class


def _import_module(place: str) -> ModuleType:
    """Import a module by its name, or from its path if that ends in .py."""
    try:
        if not place.endswith(".py"):
            return importlib.import_module(place)
        if not os.path.isfile(place):
            raise ControllerError(f"controller file {one_line(place, 300)} does not exist")
        return _import_file(Path(place))
    except ControllerError:
        raise
    except BaseException as error:  # whatever the user's module raises
        interruption.reraise(error)
        raise ControllerError(f"{place} cannot be imported: {described(error)}") from error


class _SourceLoader(SourceFileLoader):
    """Compiles the file itself: its byte code can be that of a file of the same second and size, with another hash."""

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


def _import_file(path: Path) -> ModuleType:
    loader = _SourceLoader(path.stem, str(path))
    spec = importlib.util.spec_from_loader(path.stem, loader)
    assert spec is not None
    module, folder = importlib.util.module_from_spec(spec), str(path.parent.resolve())
    is_new = sys.modules.setdefault(path.stem, module) is module  # dataclasses and pickle look modules up there
    sys.path.insert(0, folder)  # the file may import modules beside it
    try:
        loader.exec_module(module)
    except BaseException:
        if is_new:
            del sys.modules[path.stem]
        raise
    finally:
        sys.path.remove(folder)
    return module


def _find_class(module: ModuleType, attribute: str, name: str) -> type[Controller]:
    """The controller class `attribute` of a module; `name` is the full name, for messages."""
    item = getattr(module, attribute, None)
    if item is None:
        classes = [k for k, v in vars(module).items() if _is_controller_class(v)]
        hint = f"its controllers are {', '.join(classes)}" if classes else "it defines no Controller class"
        raise ControllerError(f"{name}: {module.__name__} has no attribute {attribute!r}; {hint}")
    problem = _problem(item)
    if problem is not None:
        raise ControllerError(f"{name} {problem}")
    assert isinstance(item, type)
    return item


def _only_class(module: ModuleType, name: str) -> type[Controller]:
    """The controller class that a file defines, if it defines just one; `name` is the path of the file."""
    kinds = [v for v in vars(module).values() if isinstance(v, type) and v.__module__ == module.__name__]
    classes = [kind for kind in kinds if _is_controller_class(kind)]
    if len(classes) != 1:
        if not classes and len(kinds) == 1 and (problem := _problem(kinds[0])):
            raise ControllerError(f"{name}:{kinds[0].__name__} {problem}")
        names = ", ".join(kind.__name__ for kind in classes) or "no Controller class"
        raise ControllerError(f"{name} defines {names}; name one Controller class, as in {name}:Name")
    controller_class: type[Controller] = classes[0]
    return controller_class


def _problem(item: object) -> str | None:
    """Why an object cannot be used as a controller class, or None."""
    if _is_controller_class(item):
        return None
    if isinstance(item, type) and issubclass(item, Controller):
        missing = ", ".join(sorted(item.__abstractmethods__))
        return f"is a Controller class without the method {missing}; write def act(self, snapshot)"
    return "is not a Controller class; write class X(sonata2d.Controller) with a method act"


def _is_controller_class(item: object) -> bool:
    """Whether an object is a subclass of `Controller` without abstract methods."""
    return isinstance(item, type) and issubclass(item, Controller) and not inspect.isabstract(item)
