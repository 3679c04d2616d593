"""What every group of settings shares: frozen, no unknown keys; and ranges, one field each."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import (
    BaseModel,
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

from ...core.rng import RandomStream
from ...registry import Registry, did_you_mean

Jitter = tuple[NonNegativeFloat, NonNegativeFloat, NonNegativeFloat]  # m, m, rad
Share = Annotated[float, Field(ge=0.0, le=1.0)]


def weighed(given: Any) -> Any:
    """Weights by name; a list of names, or one name, weighs them alike."""
    names = [given] if isinstance(given, str) else given
    return dict.fromkeys(names, 1.0) if isinstance(names, list | tuple) else names


def registered(registry: Registry, name: str) -> str:
    """The name, if the registry knows it."""
    if name not in registry:
        raise PydanticCustomError("unknown_name", "{said}", {"said": registry.unknown(name)})
    return name


class Settings(BaseModel):
    """A group of settings."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _know_every_key(cls, given: Any) -> Any:
        for key in given if isinstance(given, dict) else ():
            if key not in cls.model_fields:
                hint = did_you_mean(str(key), cls.model_fields)
                said = {"key": str(key), "hint": hint, "path": (key,)}
                raise PydanticCustomError("unknown_key", "unknown key '{key}'{hint}", said)
        return given


_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True, config=_STRICT)
class _Span:
    """min..max, in any of its forms: `[2, 6]`, `{min: 2, max: 6}`, one number for both; `Range(2, 6)` in Python."""

    @model_validator(mode="before")
    @classmethod
    def _spell_out(cls, given: Any) -> Any:
        if isinstance(given, ArgsKwargs):
            return dict(zip(("min", "max", "step"), given.args, strict=False)) | (given.kwargs or {})
        if isinstance(given, list | tuple) and len(given) == 2:
            return {"min": given[0], "max": given[1]}
        if isinstance(given, int | float) and not isinstance(given, bool):
            return {"min": given, "max": given}
        if not isinstance(given, dict | cls):
            raise PydanticCustomError("range", "a range is a number, [min, max] or {min: …, max: …}")
        return given

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        low, high = vars(self)["min"], vars(self)["max"]
        if low > high:
            raise PydanticCustomError(
                "range", "min {low} is above max {high}", {"low": f"{low:g}", "high": f"{high:g}"}
            )
        return self

    @model_serializer
    def _shortest_form(self) -> Any:
        given = {key: value for key, value in vars(self).items() if key in ("min", "max", "step") and value is not None}
        if "step" in given:
            return given
        return given["min"] if given["min"] == given["max"] else [given["min"], given["max"]]

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        number = {"type": "number" if cls is Range else "integer"}
        keys = {"min": number, "max": number} | ({"step": {"type": "number"}} if cls is Range else {})
        pair = {"type": "array", "items": number, "minItems": 2, "maxItems": 2}
        spelled = {"type": "object", "properties": keys, "required": ["min", "max"], "additionalProperties": False}
        return {"title": cls.__name__, "anyOf": [number, pair, spelled]}


@dataclass(frozen=True, config=_STRICT)
class Range(_Span):
    """A number from min to max, both included; with a `step`, min plus whole steps.

    >>> Range(6, 10, step=1)
    Range(min=6.0, max=10.0, step=1.0)
    """

    min: float
    max: float
    step: PositiveFloat | None = None

    def draw(self, rng: RandomStream) -> float:
        """A value, all alike."""
        if self.step is None:
            return rng.uniform(self.min, self.max)
        return self.min + self.step * rng.integer(0, int((self.max - self.min) / self.step + 1e-9))

    def at_least(self, low: float) -> Range:
        """The part of the range from `low` up; `low` itself if there is none."""
        start = max(low, self.min)
        return Range(start, max(start, self.max), self.step)


@dataclass(frozen=True, config=_STRICT)
class IntRange(_Span):
    """How many: a whole number from min to max, both included.

    >>> IntRange(2, 6)
    IntRange(min=2, max=6)
    """

    min: NonNegativeInt
    max: NonNegativeInt

    def draw(self, rng: RandomStream) -> int:
        """A value, all alike."""
        return rng.integer(self.min, self.max)


class Normal(Settings):
    """A normal distribution cut off at both ends."""

    mean: PositiveFloat
    sd: PositiveFloat
    min: NonNegativeFloat
    max: PositiveFloat

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if not self.min < self.max:
            raise PydanticCustomError("range", "min {low} is not below max {high}", {"low": self.min, "high": self.max})
        if not self.min <= self.mean <= self.max:
            told = {"mean": self.mean, "low": self.min, "high": self.max}
            raise PydanticCustomError("range", "mean {mean} is not within {low}..{high}", told)
        return self

    def draw(self, rng: RandomStream) -> float:
        """A number from it."""
        return rng.normal(self.mean, self.sd, self.min, self.max)
