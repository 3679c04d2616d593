"""Base class of all scenario settings, and the types of their fields: ranges, distributions, weights, sections."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Generic, Self, TypeVar, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    NonNegativeInt,
    SerializerFunctionWrapHandler,
    create_model,
    model_serializer,
    model_validator,
)
from pydantic.dataclasses import dataclass
from pydantic_core import ArgsKwargs, CoreSchema, core_schema

from ...core.bounds import NotNegative, Number, Positive
from ...core.files.limits import MAX_COUNT
from ...core.wording import shown
from ...errors import ConfigError
from ...registry import Registry, did_you_mean
from .problems import OneLineErrors, setting_error

if TYPE_CHECKING:  # settings are also read where nothing is generated, and random streams load the compiler
    from ...core.rng import RandomStream

Jitter = tuple[NotNegative, NotNegative, NotNegative]  # m, m, rad
_MINIMUM_SHARE = 0.01  # of a truncated distribution that must lie within its bounds, which draws are repeated for

T = TypeVar("T")
# Checking ends at the first faulty entry: 1 MB may hold a hundred thousand faults, which would take gigabytes.
TupleOf = Annotated[tuple[T, ...], Field(fail_fast=True)]
Entities = Annotated[tuple[T, ...], Field(fail_fast=True, max_length=MAX_COUNT)]


def _parse_weights(value: Any) -> Any:
    """Convert a name, or a list of names, to a mapping with weight 1 for each name; other values are returned as is."""
    names = [value] if isinstance(value, str) else value
    is_names = isinstance(names, list | tuple) and all(isinstance(name, str) for name in names)
    return dict.fromkeys(names, 1.0) if is_names else names


def weights_of(kind: str) -> tuple[BeforeValidator, AfterValidator]:
    """Validators of weights by name: a name, or a list of names, gives equal weights; one weight must be above 0.

    Args:
        kind: what the names stand for, in the message.
    """

    def require_weight(weights: dict[str, float]) -> dict[str, float]:
        if not sum(weights.values()) > 0.0:
            raise setting_error(f"at least one {kind} needs a weight above 0")
        return weights

    return BeforeValidator(_parse_weights), AfterValidator(require_weight)


def require_registered(registry: Registry, name: str) -> str:
    """Return `name` if the registry contains it.

    Raises:
        PydanticCustomError: it does not; the message suggests similar names.
    """
    if name in registry:
        return name
    if ":" in name or name.endswith(".py"):  # as users name controllers
        raise setting_error(
            f"a {registry.kind} cannot be a file or a class, because a scenario must not run code; "
            "publish it as a plug-in (entry point), as in examples/plugin"
        )
    raise setting_error(registry.unknown(name))


class _Difference:
    """A value whose text, if it is a dataclass of `core`, has only the fields that differ from the default."""

    def __init__(self, value: Any, default: Any) -> None:
        self._value, self._default = value, default

    def __repr__(self) -> str:
        value = self._value
        if not is_section(type(value)) or isinstance(value, Settings):
            return repr(value)
        keys = (field.name for field in fields(value))
        changed = ((key, getattr(value, key)) for key in keys if getattr(value, key) != getattr(self._default, key))
        return f"{type(value).__name__}({', '.join(f'{key}={item!r}' for key, item in changed)})"


class Settings(BaseModel, metaclass=OneLineErrors):
    """Base class of scenario settings: immutable; unknown keys are errors with a suggestion; numbers are finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, serialize_by_alias=True)
    _optional: ClassVar[frozenset[str]] = frozenset()  # keys that are left out where they have their default

    @model_serializer(mode="wrap")
    def _serialise(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        values: dict[str, Any] = handler(self)
        for name in self._optional:
            field = type(self).model_fields[name]
            if getattr(self, name) == field.get_default(call_default_factory=True):
                values.pop(field.alias or name, None)
        return values

    @classmethod
    def _keys(cls) -> list[str]:
        """All keys of the settings."""
        names = (field.alias or name for name, field in cls.model_fields.items())
        return list(dict.fromkeys((*names, *cls._further_keys())))

    def __repr_args__(self) -> Iterator[tuple[str | None, Any]]:
        """The settings that differ from their defaults."""
        for name, field in type(self).model_fields.items():
            value, default = getattr(self, name), field.get_default(call_default_factory=True)
            if name == "name" or (value != default and value is not None):
                yield name, _Difference(value, default)
        yield from (self.model_extra or {}).items()

    def __setattr__(self, name: str, value: Any) -> None:
        raise ConfigError(f"settings are fixed; changed({name}={shown(value)}) returns others")

    @classmethod
    def _further_keys(cls) -> Collection[str]:
        """Keys that are no fields of the class."""
        return ()

    @model_validator(mode="before")
    @classmethod
    def _reject_unknown_keys(cls, values: Any) -> Any:
        # pydantic's own check (extra="forbid") runs later and has no suggestions
        known = cls._keys()
        for key in values if isinstance(values, dict) else ():
            if key not in known:
                if not (hint := did_you_mean(str(key), known)):
                    remedy = "; install the package, if a plug-in defines it" if cls._further_keys() else ""
                    hint = f"{remedy}; keys are {', '.join(known)}"
                if "attributes" in known and not cls._further_keys():  # not of the scenario, which declares them
                    hint += f"; a declared attribute is given as attributes: {{{key}: …}}"
                raise setting_error(f"unknown key '{key}'{hint}", key, kind="unknown_key")
        return values


_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True, config=_STRICT)
class _Interval:
    """The interval min..max, written as `[2, 6]`, `{min: 2, max: 6}` or one number; in Python `Range(2, 6)`."""

    @model_validator(mode="before")
    @classmethod
    def _normalise(cls, value: Any) -> Any:
        """Convert each accepted form to a mapping of fields."""
        if isinstance(value, ArgsKwargs):
            return dict(zip(("min", "max", "step"), value.args, strict=False)) | (value.kwargs or {})
        value = value.tolist() if hasattr(value, "tolist") else value  # of NumPy
        if isinstance(value, list | tuple) and len(value) == 2:
            return {"min": value[0], "max": value[1]}
        if isinstance(value, int | float) and not isinstance(value, bool):
            return {"min": value, "max": value}
        if not isinstance(value, dict | cls):
            raise setting_error("a range is a number, [min, max] or {min: …, max: …}")
        return value

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        low, high = vars(self)["min"], vars(self)["max"]
        if low > high:
            raise setting_error(f"min {low:g} is above max {high:g}")
        return self

    @model_serializer
    def _serialise(self) -> Any:
        """Write the shortest form that reads back equal."""
        values = vars(self)
        low, high, step = values["min"], values["max"], values.get("step")
        if step is not None:
            return {"min": low, "max": high, "step": step}
        return low if low == high else [low, high]

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        number = {"type": "number" if cls is Range else "integer"}
        keys = {"min": number, "max": number} | ({"step": {"type": "number"}} if cls is Range else {})
        pair = {"type": "array", "items": number, "minItems": 2, "maxItems": 2}
        mapping = {"type": "object", "properties": keys, "required": ["min", "max"], "additionalProperties": False}
        return {"title": cls.__name__, "anyOf": [number, pair, mapping]}


@dataclass(frozen=True, config=_STRICT)
class Range(_Interval):
    """A uniformly distributed number from min to max, both included; with a `step`: min plus a multiple of step.

    >>> Range(6, 10, step=1)
    Range(min=6.0, max=10.0, step=1.0)
    """

    min: Number
    max: Number
    step: Positive | None = None

    def draw(self, rng: RandomStream) -> float:
        """Draw a number."""
        if self.step is None:
            return rng.uniform(self.min, self.max)
        return self.min + self.step * rng.integer(0, int((self.max - self.min) / self.step + 1e-9))

    def at_least(self, low: float) -> Range:
        """Return the part of the range from `low` up, or `low` alone where the whole range lies below it."""
        start = max(low, self.min)
        return Range(start, max(start, self.max), self.step)

    def shifted(self, by: float) -> Range:
        """Return the range with both ends, and the numbers between them, larger by an amount."""
        return Range(self.min + by, self.max + by, self.step)


@dataclass(frozen=True, config=_STRICT)
class IntRange(_Interval):
    """A uniformly distributed count: an integer from min to max, both included.

    >>> IntRange(2, 6)
    IntRange(min=2, max=6)
    """

    min: NonNegativeInt
    max: Annotated[int, Field(ge=0, le=MAX_COUNT)]

    def draw(self, rng: RandomStream) -> int:
        """Draw a count; a single possible one takes no random number."""
        return self.min if self.min == self.max else rng.integer(self.min, self.max)


def within(message: str, low: float, high: float = math.inf, *, above: bool = False) -> AfterValidator:
    """Validator of a range or count range that must lie within low..high.

    Args:
        message: of the error.
        low, high: both are included.
        above: whether `low` itself is excluded.
    """

    def check(interval: Range | IntRange) -> Range | IntRange:
        if not low <= interval.min <= interval.max <= high or (above and interval.min == low):
            raise setting_error(message)
        return interval

    return AfterValidator(check)


BodyRadius = Annotated[Range, within("a person's radius must be 0.1 m or more", 0.1)]
Breadth = Annotated[Range, within("a person's breadth must be above 0 and 1 m or less", 0.0, 1.0, above=True)]
Duration = Annotated[Range, within("a time must not be negative", 0.0)]
_PositiveDuration = Annotated[Range, within("a time must be above 0", 0.0, above=True)]
# types of settings in place of pairs in the dataclasses of `core`, which hold the shortest and the longest duration
_RANGES: dict[Any, Any] = {tuple[NotNegative, NotNegative]: Duration, tuple[Positive, Positive]: _PositiveDuration}


def is_section(kind: type) -> bool:
    """Whether a type of settings has keys of its own; a range is one value."""
    return issubclass(kind, Settings) or (is_dataclass(kind) and not issubclass(kind, _Interval))


class Section(Generic[T]):
    """Annotation of a dataclass of `core` that is a section of a scenario.

    A pair of durations is given as a range. The values are checked as all settings are, also the values of an object.

    Args:
        default: object with the values of keys that are not given.
        changed: types of settings by name, which replace the types of fields.
    """

    def __init__(self, default: T, **changed: Any) -> None:
        self._default, self._changed = default, changed

    def __get_pydantic_core_schema__(self, source: type, handler: GetCoreSchemaHandler) -> CoreSchema:
        hints = get_type_hints(source, include_extras=True)
        keys = sorted(hints, key=lambda key: hints[key] in _RANGES)  # single values come before ranges
        types = {key: self._changed.get(key, _RANGES.get(hints[key], hints[key])) for key in keys}
        settings: Any = {key: (kind, getattr(self._default, key)) for key, kind in types.items()}
        model = create_model(source.__name__, __base__=Settings, **settings)

        def values_of(section: Any) -> Any:
            return {key: getattr(section, key) for key in keys} if isinstance(section, source) else section

        def create(settings: Any) -> Any:
            values = {key: getattr(settings, key) for key in keys}
            ranges = {key: (value.min, value.max) for key, value in values.items() if isinstance(value, Range)}
            return source(**(values | ranges))

        def settings_of(section: Any) -> dict[str, Any]:
            values: dict[str, Any] = values_of(section)
            ranges = {key: value for key, value in values.items() if hints[key] in _RANGES}
            return values | {key: low for key, (low, high) in ranges.items() if low == high}

        schema = core_schema.no_info_before_validator_function(values_of, handler.generate_schema(model))
        serialization = core_schema.plain_serializer_function_ser_schema(settings_of)
        return core_schema.no_info_after_validator_function(create, schema, serialization=serialization)


class Normal(Settings):
    """A normal distribution truncated at min and max."""

    mean: Positive
    sd: Positive
    min: NotNegative
    max: Positive

    @model_validator(mode="before")
    @classmethod
    def _reject_numbers(cls, values: Any) -> Any:
        if isinstance(values, int | float | list | tuple):
            raise setting_error("a distribution is {mean: ..., sd: ..., min: ..., max: ...}, or some of these")
        return values

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if not self.min < self.max:
            raise setting_error(f"min {self.min} is not below max {self.max}")
        if not self.min <= self.mean <= self.max:
            raise setting_error(f"mean {self.mean} is not within {self.min}..{self.max}")
        scale = self.sd * math.sqrt(2.0)
        share = 0.5 * (math.erf((self.max - self.mean) / scale) - math.erf((self.min - self.mean) / scale))
        if share < _MINIMUM_SHARE:
            raise setting_error(
                f"only {share} of the distribution lies within {self.min}..{self.max}, "
                f"it must be {_MINIMUM_SHARE} or more; use a smaller sd"
            )
        return self

    def draw(self, rng: RandomStream) -> float:
        """Draw a number."""
        return rng.normal(self.mean, self.sd, self.min, self.max)
