"""Named objects: built-in ones, and plug-ins that installed packages publish as entry points.

These kinds can be extended by other packages, each through an entry-point group: controllers (`sonata2d.controllers`),
pedestrian models (`sonata2d.pedestrian_models`), drives and sensors of robots (`sonata2d.drives`, `sonata2d.sensors`),
formats (`sonata2d.formats`), metrics (`sonata2d.metrics`), learned scores (`sonata2d.scorers`), room kinds
(`sonata2d.room_kinds`), map readers (`sonata2d.map_readers`), question kinds (`sonata2d.question_kinds`), parts of
observations (`sonata2d.observation_parts`) and types of furniture (`sonata2d.furniture_types`). CONTRIBUTING.md
describes the entry points of each group.

Listing names imports nothing; an object is imported when it is loaded.
"""

from __future__ import annotations

import importlib
import logging
import pickle
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import is_dataclass
from difflib import get_close_matches
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from .core.code_hash import code_sha256
from .core.files import interruption
from .core.furniture_types import BUILT_IN, FurnitureType
from .core.person_kinds import BUILT_IN as BUILT_IN_PERSONS, PersonKind
from .core.wording import described, shown
from .errors import ConfigError, ControllerError, MetricError, PluginWarning, RecordError, Sonata2dError

logger = logging.getLogger(__name__)

Check = Callable[[object], str | None]  # why an object is not of the registry's kind, or None


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """The closest known word as the end of an error message; empty if none is close.

    >>> did_you_mean("tabels", ["tables", "plants"])
    "; did you mean 'tables'?"
    """
    close = get_close_matches(word, known, n=1)
    return f"; did you mean {close[0]!r}?" if close else ""


_N = TypeVar("_N", FurnitureType, PersonKind)


class Registry:
    """The objects of one kind by name.

    Built-in names come first, and a plug-in cannot replace them.

    Args:
        kind: name of the kind in messages, e.g. `controller`.
        group: entry-point group of the plug-ins.
        built_in: location of each built-in object, as `module:attribute`.
        error: class of the errors for unknown names and for plug-ins that do not load.

    >>> "orca" in CONTROLLERS
    True
    """

    def __init__(
        self, kind: str, group: str, built_in: Mapping[str, str], error: type[Sonata2dError] = Sonata2dError
    ) -> None:
        self.kind, self.group, self.built_in, self.error = kind, group, dict(built_in), error
        self._loaded: dict[str, Any] = {}
        self.registered: dict[str, Any] = {}  # objects of this process, by name

    @cached_property
    def plugins(self) -> dict[str, EntryPoint]:
        """Entry points of other packages by name; those whose name is taken are skipped with a `PluginWarning`."""
        points: dict[str, EntryPoint] = {}
        for point in sorted(entry_points(group=self.group), key=lambda point: (point.name, point.value)):
            if point.name in self.built_in or point.name in points:
                warnings.warn(
                    f"{self.kind} plug-in {point.name!r} ({point.value}) is skipped: the name is taken; "
                    "rename the entry point",
                    PluginWarning,
                    stacklevel=2,
                )
            else:
                points[point.name] = point
        return points

    def __iter__(self) -> Iterator[str]:
        return iter((*self.built_in, *self.plugins, *self.registered))

    def __contains__(self, name: object) -> bool:
        return name in self.built_in or name in self.plugins or name in self.registered

    def register(self, name: str, item: Any) -> None:
        """Give an object of this program, as of a notebook, a name; a former object of that name is replaced.

        Worker processes of `generate_dataset` and `evaluate` get it with its code. Other programs do not know it: to
        replay a data set that names it, they register it too, or install it as a plug-in.

        Args:
            name: as in a scenario, `person: {model: NAME}`.
            item: what an entry point of a plug-in would name.

        Raises:
            ValueError: a built-in object or a plug-in has that name, or metrics are meant, of which functions take
                objects.
        """
        if not isinstance(name, str) or not name.strip():
            raise ValueError(f"the name of a {self.kind} is a text that is not empty, got {shown(name)}")
        if self.kind == "metric":  # tables of all metrics are made when `sonata2d.metrics` is imported
            raise ValueError("metrics cannot be registered; give them as objects: measure(record, [metric])")
        if name in self.built_in or name in self.plugins:
            raise ValueError(f"a {self.kind} named {name!r} exists already; choose another name")
        self.registered[name] = item

    def load(self, name: str, check: Check = lambda item: None) -> Any:
        """Import an object.

        Args:
            name: of a built-in object, a plug-in, or a registered object.
            check: called with an object that is not built in; returns why it is not of the registry's kind, or None.

        Returns:
            The object; the same one on every call, unless another one is registered.

        Raises:
            Sonata2dError: the name is unknown, or the plug-in does not load or fails the check; an instance of the
                registry's own error class.
        """
        if name in self.registered:
            reason = check(self.registered[name])
            if reason is not None:
                raise self.error(f"{self.kind} {name!r} {reason}")
            return self.registered[name]
        if name not in self._loaded:
            if name in self.built_in:
                item = resolve(self.built_in[name])
            elif name in self.plugins:
                item = self._load_plugin(self.plugins[name], check)
            else:
                raise self.error(self.unknown(name))
            self._loaded[name] = item
        return self._loaded[name]

    def load_all(self, check: Check = lambda item: None) -> dict[str, Any]:
        """All objects by name; a plug-in that does not load or fails the check is skipped with a `PluginWarning`."""
        items = {name: self.load(name) for name in self.built_in}
        for name in self.plugins:
            try:
                items[name] = self.load(name, check)
            except Sonata2dError as error:
                warnings.warn(f"{error}; skipped", PluginWarning, stacklevel=2)
        return items

    def unknown(self, name: str) -> str:
        """The error message for an unknown name: with the closest name, else with all names."""
        hint = f"; known are {', '.join(self)}; if it is a plug-in, install the package that provides it"
        hint += ", and if it is an object of a notebook or script, register it first"
        return f"no {self.kind} is named {name!r}{did_you_mean(name, self) or hint}"

    def _load_plugin(self, point: EntryPoint, check: Check) -> Any:
        plugin = f"{self.kind} plug-in {point.name!r} ({point.value})"
        try:
            item = point.load()
        except BaseException as error:  # importing another package can raise anything
            interruption.reraise(error)
            raise self.error(f"{plugin} does not load: {described(error)}") from error
        reason = check(item)
        if reason is not None:
            raise self.error(f"{plugin} {reason}")
        logger.info("loaded the %s", plugin)
        return item


def resolve(location: str) -> Any:
    """The object at `module:attribute`."""
    module, _, attribute = location.partition(":")
    return getattr(importlib.import_module(module), attribute)


_CONTROLLERS = "sonata2d.agents.controllers"
CONTROLLERS = Registry(
    "controller",
    "sonata2d.controllers",
    {
        "straight-to-goal": f"{_CONTROLLERS}.reactive:StraightToGoal",
        "social-force": f"{_CONTROLLERS}.reactive:SocialForce",
        "social-planner": f"{_CONTROLLERS}.planner:SocialPlanner",
        "orca": f"{_CONTROLLERS}.reactive:Orca",
        "dwa": f"{_CONTROLLERS}.local_planner:Dwa",
        "mppi": f"{_CONTROLLERS}.local_planner:Mppi",
        "human-like": f"{_CONTROLLERS}.human_like:HumanLike",
        "teleoperation": f"{_CONTROLLERS}.teleoperation:Teleoperation",
        "graph-policy": "sonata2d.learning.policy:GraphPolicy",
    },
    ControllerError,
)

GYM_POLICY = "sonata2d.gym.policy:PolicyController"
"""Location of the class of controllers that drive with a policy file of `sonata2d.gym`."""

_MODELS = "sonata2d.agents.pedestrians.models"
PEDESTRIAN_MODELS = Registry(
    "pedestrian model",
    "sonata2d.pedestrian_models",
    {
        "sonata2026": f"{_MODELS}.sonata2026:Sonata2026Model",
        "moussaid2009": f"{_MODELS}.moussaid2009:Moussaid2009Model",
        "helbing1995": f"{_MODELS}.helbing1995:Helbing1995Model",
        "helbing2000": f"{_MODELS}.helbing2000:Helbing2000Model",
        "farina2017": f"{_MODELS}.farina2017:Farina2017Model",
        "orca2011": f"{_MODELS}.orca2011:Orca2011Model",
    },
    ConfigError,
)

_DRIVES = "sonata2d.agents.drives.built_in"
DRIVES = Registry(
    "drive",
    "sonata2d.drives",
    {
        "holonomic": f"{_DRIVES}:Holonomic",
        "unicycle": f"{_DRIVES}:Unicycle",
        "differential": f"{_DRIVES}:Differential",
        "omni": f"{_DRIVES}:Omni",
        "bicycle": f"{_DRIVES}:Bicycle",
    },
    ConfigError,
)

_SENSORS = "sonata2d.agents.sensors"
SENSORS = Registry(
    "sensor",
    "sonata2d.sensors",
    {
        "lidar": f"{_SENSORS}.lidar:Lidar",
        "odometry": f"{_SENSORS}.estimates:Odometry",
        "people-detector": f"{_SENSORS}.estimates:PeopleDetector",
        "field-of-view": f"{_SENSORS}.estimates:FieldOfView",
    },
    ControllerError,
)

FORMATS = Registry(
    "format",
    "sonata2d.formats",
    {
        "sonata": "sonata2d.formats.sonata:FORMAT",
        "socnav3": "sonata2d.formats.socnav3:FORMAT",
        "csv": "sonata2d.formats.csv_tracks:FORMAT",
        "tracks": "sonata2d.formats.tracks.document:FORMAT",
        "trajnet": "sonata2d.formats.trajnet:FORMAT",
        "npz": "sonata2d.formats.npz:FORMAT",
        "chat": "sonata2d.formats.chat.export:FORMAT",
        "mcap": "sonata2d.formats.mcap:FORMAT",
        "parquet": "sonata2d.formats.parquet:FORMAT",
        "lerobot": "sonata2d.formats.lerobot:FORMAT",
        "webdataset": "sonata2d.formats.webdataset:FORMAT",
    },
    RecordError,
)

SCORERS = Registry("learned score", "sonata2d.scorers", {}, ConfigError)
"""Functions of an `EpisodeRecord` that return a number or None: advisory columns of the benchmark."""

METRICS = Registry("metric", "sonata2d.metrics", {}, MetricError)  # built-in ones: sonata2d.metrics.catalogue

_MAPS = "sonata2d.scenegen.maps"
MAP_READERS = Registry(
    "map reader",
    "sonata2d.map_readers",
    {
        "ros": f"{_MAPS}.raster:RosMap",
        "image": f"{_MAPS}.raster:ImageMap",
        "svg": f"{_MAPS}.svg:SvgDrawing",
        "dxf": f"{_MAPS}.dxf:DxfDrawing",
    },
    ConfigError,
)

_ROOMS = "sonata2d.scenegen.floor_plans"
ROOM_KINDS = Registry(
    "room kind",
    "sonata2d.room_kinds",
    {
        "square": f"{_ROOMS}:SQUARE",
        "rectangle": f"{_ROOMS}:RECTANGLE",
        "l": f"{_ROOMS}:L",
        "t": f"{_ROOMS}:T",
        "u": f"{_ROOMS}:U",
        "corridor": f"{_ROOMS}:CORRIDOR",
        "doorway": f"{_ROOMS}:DOORWAY",
        "crossing": f"{_ROOMS}:CROSSING",
        "hall": f"{_ROOMS}:HALL",
    },
    ConfigError,
)

QUESTION_KINDS = Registry("question kind", "sonata2d.question_kinds", {}, ConfigError)
"""`sonata2d.study.questions` adds the built-in ones."""

OBSERVATION_PARTS = Registry("observation part", "sonata2d.observation_parts", {}, ConfigError)
"""`sonata2d.gym.parts` adds the built-in ones."""

FURNITURE_TYPES = Registry(
    "furniture type",
    "sonata2d.furniture_types",
    {kind.name: f"sonata2d.core.furniture_types:{kind.name.upper()}" for kind in BUILT_IN},
    ConfigError,
)


PERSON_KINDS = Registry(
    "person kind",
    "sonata2d.person_kinds",
    {kind.name: f"sonata2d.core.person_kinds:{kind.name.upper()}" for kind in BUILT_IN_PERSONS},
    ConfigError,
)


def drive_class(name: str) -> Any:
    """Load the class of a drive by name, a subclass of `sonata2d.agents.Drive`.

    Raises:
        ConfigError: the name is unknown, or the plug-in does not load or is no such class.
    """

    def check(item: object) -> str | None:
        is_drive = isinstance(item, type) and is_dataclass(item) and hasattr(item, "is_coupled")
        return None if is_drive else "is not a dataclass derived from sonata2d.agents.Drive"

    return DRIVES.load(name, check)


def furniture_type(name: str) -> FurnitureType:
    """Load a type of furniture by name.

    Returns:
        The type; for a name that is not registered, such as of a piece that a scenario gives a size, one without rules
        of its own.

    Raises:
        ConfigError: the plug-in does not load, or its type has another name.
    """
    return _named(FURNITURE_TYPES, FurnitureType, name) if name in FURNITURE_TYPES else FurnitureType(name)


def person_kind(name: str) -> PersonKind:
    """Load a kind of person by name.

    Returns:
        The kind; for a name that is not registered, as of a file from elsewhere, one without properties of its own.

    Raises:
        ConfigError: the plug-in does not load, or its kind has another name.
    """
    return _named(PERSON_KINDS, PersonKind, name) if name in PERSON_KINDS else PersonKind(name)


def _named(registry: Registry, kind: type[_N], name: str) -> _N:
    """Load an object that knows its name.

    Raises:
        ConfigError: the plug-in does not load, or its object is of another class or has another name.
    """
    found: _N = registry.load(
        name, lambda item: None if isinstance(item, kind) else f"is not a sonata2d.{kind.__name__}(...)"
    )
    if found.name != name:
        raise ConfigError(f"{registry.kind} {name!r} is named {found.name!r}; give the entry point the same name")
    return found


def furniture_types() -> dict[str, FurnitureType]:
    """All types of furniture by name; a plug-in that does not load is skipped with a `PluginWarning`."""
    kinds = {kind.name: kind for kind in BUILT_IN}
    for name in (*FURNITURE_TYPES.plugins, *FURNITURE_TYPES.registered):
        try:
            kinds[name] = furniture_type(name)
        except ConfigError as error:
            warnings.warn(f"{error}; skipped", PluginWarning, stacklevel=2)
    return kinds


_REGISTRIES = {
    registry.kind: registry
    for registry in (
        *(CONTROLLERS, PEDESTRIAN_MODELS, DRIVES, SENSORS, FORMATS, METRICS, ROOM_KINDS),
        *(QUESTION_KINDS, OBSERVATION_PARTS, FURNITURE_TYPES, PERSON_KINDS),
    )
}


def registered_objects() -> bytes:
    """The registered objects, pickled for other processes; empty without any.

    Raises:
        Sonata2dError: an object cannot be sent to them.
    """
    pickled: dict[str, dict[str, bytes]] = {}
    for kind, registry in _REGISTRIES.items():
        for name, item in registry.registered.items():
            import cloudpickle  # sends classes of a notebook with their code

            try:
                pickled.setdefault(kind, {})[name] = cloudpickle.dumps(item)
            except Exception as error:  # whatever the object does
                raise registry.error(
                    f"{kind} {name!r} cannot be sent to other processes: {described(error)}; use one worker"
                ) from error
    return pickle.dumps(pickled) if pickled else b""


_restored = b""


def restore_registered(content: bytes) -> None:
    """Register the objects of another process.

    Args:
        content: as `registered_objects` returns it there.
    """
    global _restored
    if content == _restored:  # as for the former item
        return
    objects = pickle.loads(content) if content else {}
    for kind, registry in _REGISTRIES.items():  # those of a former call go
        registry.registered = {name: pickle.loads(item) for name, item in objects.get(kind, {}).items()}
    _restored = content


def registered_hashes(settings: Any) -> dict[str, str]:
    """SHA-256 of the code of the registered objects that settings name, by kind and name.

    Args:
        settings: JSON values.
    """
    words = set(_texts(settings))
    return {
        f"{kind} {name}": code_sha256(item)
        for kind, registry in _REGISTRIES.items()
        for name, item in registry.registered.items()
        if not words.isdisjoint((name, getattr(item, "count", name)))  # furniture may be named by its count only
    }


def _texts(value: Any) -> Iterator[str]:
    """All texts in JSON values, keys included."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from (*_texts(key), *_texts(item))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _texts(item)
