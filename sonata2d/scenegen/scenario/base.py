"""Base class of all scenario settings, and the types of their fields: ranges, distributions, fractions, weights."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    model_serializer,
    model_validator,
)
from pydantic.dataclasses import dataclass
from pydantic_core import ArgsKwargs, CoreSchema, PydanticCustomError

from ...core.files.limits import MAX_COUNT
from ...core.geometry import MAX_MAGNITUDE
from ...core.wording import shown
from ...errors import ConfigError
from ...registry import Registry, did_you_mean
from .problems import OneLineErrors

if TYPE_CHECKING:  # settings are also read where nothing is generated, and random streams load the compiler
    from ...core.rng import RandomStream

Jitter = tuple[NonNegativeFloat, NonNegativeFloat, NonNegativeFloat]  # m, m, rad
_MINIMUM_SHARE = 0.01  # of a truncated distribution that must lie within its bounds, which draws are repeated for
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Coordinate = Annotated[float, Field(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]  # m

T = TypeVar("T")
# Checking ends at the first faulty entry: 1 MB may hold a hundred thousand faults, which would take gigabytes.
TupleOf = Annotated[tuple[T, ...], Field(fail_fast=True)]
Entities = Annotated[tuple[T, ...], Field(fail_fast=True, max_length=MAX_COUNT)]


def _parse_weights(value: Any) -> Any:
    """Convert a name, or a list of names, to a mapping with weight 1 for each name; other values are returned as is."""
    names = [value] if isinstance(value, str) else value
    is_names = isinstance(names, list | tuple) and all(isinstance(name, str) for name in names)
    return dict.fromkeys(names, 1.0) if is_names else names


_Name = TypeVar("_Name")
# Weights by name; a name, or a list of names, stands for equal weights.
Weights = Annotated[dict[_Name, NonNegativeFloat], BeforeValidator(_parse_weights)]


def require_weight(weights: dict[_Name, float], item: str) -> dict[_Name, float]:
    """Return the weights if at least one of them is above 0.

    Raises:
        PydanticCustomError: none is.
    """
    if not sum(weights.values()) > 0.0:
        raise PydanticCustomError("weights", "at least one {item} needs a weight above 0", {"item": item})
    return weights


def require_registered(registry: Registry, name: str) -> str:
    """Return `name` if the registry contains it.

    Raises:
        PydanticCustomError: it does not; the message suggests similar names.
    """
    if name not in registry:
        message = registry.unknown(name)
        if ":" in name or name.endswith(".py"):  # as controllers are named, but those are named by the user only
            message = f"a {registry.kind} cannot be a file or a class, because a scenario must not run code; "
            message += "publish it as a plug-in (entry point), as in examples/plugin"
        raise PydanticCustomError("unknown_name", "{message}", {"message": message})
    return name


class Settings(BaseModel, metaclass=OneLineErrors):
    """Base class of scenario settings: immutable; unknown keys are errors with a suggestion; numbers are finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __repr_args__(self) -> Iterator[tuple[str | None, Any]]:
        """The settings that differ from their defaults."""
        for name, field in type(self).model_fields.items():
            value = getattr(self, name)
            is_default = value == field.get_default(call_default_factory=True)
            if name == "name" or (not is_default and value is not None):
                yield name, value
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
        for key in values if isinstance(values, dict) else ():
            if key not in cls.model_fields and key not in cls._further_keys():
                known = [*cls.model_fields, *cls._further_keys()]
                hint = did_you_mean(str(key), known) or f"; keys are {', '.join(dict.fromkeys(known))}"
                context = {"key": str(key), "hint": hint, "path": (key,)}
                raise PydanticCustomError("unknown_key", "unknown key '{key}'{hint}", context)
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
        if isinstance(value, list | tuple) and len(value) == 2:
            return {"min": value[0], "max": value[1]}
        if isinstance(value, int | float) and not isinstance(value, bool):
            return {"min": value, "max": value}
        if not isinstance(value, dict | cls):
            raise PydanticCustomError("range", "a range is a number, [min, max] or {min: …, max: …}")
        return value

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        low, high = vars(self)["min"], vars(self)["max"]
        if low > high:
            raise PydanticCustomError(
                "range", "min {low} is above max {high}", {"low": f"{low:g}", "high": f"{high:g}"}
            )
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

    min: float
    max: float
    step: PositiveFloat | None = None

    def draw(self, rng: RandomStream) -> float:
        """Draw a number."""
        if self.step is None:
            return rng.uniform(self.min, self.max)
        return self.min + self.step * rng.integer(0, int((self.max - self.min) / self.step + 1e-9))

    def at_least(self, low: float) -> Range:
        """Return the part of the range from `low` up, or `low` alone where the whole range lies below it."""
        start = max(low, self.min)
        return Range(start, max(start, self.max), self.step)


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


def bounded(problem: str, *, low: float = -math.inf, above: float = -math.inf, high: float = math.inf) -> Any:
    """A validator of ranges for `Annotated`, which raises an error with the text `problem`.

    Args:
        problem: says what the bounds are.
        low, above, high: min must be `low` or more and exceed `above`, and max must be `high` or less.
    """

    def check(interval: _Interval) -> _Interval:
        ends = vars(interval)
        if not (ends["min"] >= low and ends["min"] > above and ends["max"] <= high):
            raise PydanticCustomError("range", "{problem}", {"problem": problem})
        return interval

    return AfterValidator(check)


Distance = Annotated[Range, bounded("a distance must be above 0", above=0.0)]
Pause = Annotated[Range, bounded("a time must not be negative", low=0.0)]


class Normal(Settings):
    """A normal distribution truncated at min and max."""

    mean: PositiveFloat
    sd: PositiveFloat
    min: NonNegativeFloat
    max: PositiveFloat

    @model_validator(mode="before")
    @classmethod
    def _reject_numbers(cls, values: Any) -> Any:
        if isinstance(values, int | float | list | tuple):
            keys = "{mean: ..., sd: ..., min: ..., max: ...}"
            raise PydanticCustomError("distribution", "a distribution is {keys}, or some of these", {"keys": keys})
        return values

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if not self.min < self.max:
            raise PydanticCustomError("range", "min {low} is not below max {high}", {"low": self.min, "high": self.max})
        if not self.min <= self.mean <= self.max:
            context = {"mean": self.mean, "low": self.min, "high": self.max}
            raise PydanticCustomError("range", "mean {mean} is not within {low}..{high}", context)
        scale = self.sd * math.sqrt(2.0)
        share = 0.5 * (math.erf((self.max - self.mean) / scale) - math.erf((self.min - self.mean) / scale))
        if share < _MINIMUM_SHARE:
            message = (
                "only {share} of the distribution lies within {low}..{high}, "
                "it must be {least} or more; use a smaller sd"
            )
            context = {"share": share, "low": self.min, "high": self.max, "least": _MINIMUM_SHARE}
            raise PydanticCustomError("range", message, context)
        return self

    def draw(self, rng: RandomStream) -> float:
        """Draw a number."""
        return rng.normal(self.mean, self.sd, self.min, self.max)
