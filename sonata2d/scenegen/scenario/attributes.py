"""The section `attributes` of a scenario: attributes of people, objects, areas and the episode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from ...core.attributes import HOLDERS, Attributes, AttributeSpec, AttributeType, AttributeValue, Holder
from ...core.bounds import Fraction, NotNegative
from ...core.files.limits import MAX_NAME
from ...core.geometry import quantised
from ...core.rng import RandomStream
from ...registry import did_you_mean
from .base import Range, Settings, weights_of
from .problems import setting_error

_MOST_CLASSES = 100
_Name = Annotated[str, Field(min_length=1, max_length=MAX_NAME)]
_Weights = Annotated[dict[_Name, NotNegative], *weights_of("class"), Field(max_length=_MOST_CLASSES)]


_TYPES: Mapping[str, AttributeType] = {"weights": "classes", "share": "yes_no", "range": "number"}  # by key


class AttributeConfig(Settings):
    """An attribute: its type, and the distribution from which values that are not given are drawn.

    Short forms: a list of names, or weights by name, for classes; `bool`, or a probability, for yes_no; two numbers for
    a number; `number` and `text`. `weights`, `share` and `range` imply the type.

    Attributes:
        type: classes, yes_no, number or text.
        weights: of the classes, by name.
        share: probability that a yes_no attribute is true.
        range: from which a number is drawn.
        value: of the episode, instead of a distribution.
    """

    _optional = frozenset({"weights", "share", "range", "value"})

    type: AttributeType
    weights: _Weights | None = None
    share: Fraction | None = None
    range: Range | None = None
    value: Any = None

    @model_validator(mode="before")
    @classmethod
    def _expand_short_form(cls, value: Any) -> Any:
        if isinstance(value, Mapping) and ("type" in value or not value):
            return value
        if isinstance(value, str):
            return {"type": {"bool": "yes_no"}.get(value, value)}
        if isinstance(value, bool) or value is None:
            raise setting_error("an attribute is a type, or the values that it is drawn from")
        if isinstance(value, int | float):
            return {"type": "yes_no", "share": value}
        if isinstance(value, list | tuple) and any(isinstance(each, bool) for each in value):
            raise setting_error('names that YAML reads as true or false need quotes: ["yes", "no"]')
        if isinstance(value, list | tuple) and any(isinstance(each, int | float) for each in value):
            return {"type": "number", "range": value}
        if isinstance(value, Mapping) and set(value) == {"value"}:
            return value  # without the type, which is an error
        if isinstance(value, Mapping) and set(value) <= {*_TYPES, "value"}:
            return {"type": next(type for key, type in _TYPES.items() if key in value), **value}
        if isinstance(value, Mapping) and {"min", "max"} <= set(value) <= {"min", "max", "step"}:
            return {"type": "number", "range": value}
        if isinstance(value, Mapping) and not all(isinstance(each, int | float) for each in value.values()):
            raise setting_error(
                "an attribute is {type: ..., weights | share | range: ...}, or a short form: a list of names, "
                "weights by name, [min, max], a probability, or a type"
            )
        return {"type": "classes", "weights": value}

    @model_validator(mode="after")
    def _check_keys(self) -> Self:
        for key, type in _TYPES.items():
            if getattr(self, key) is not None and self.type != type:
                raise setting_error(f"only an attribute of type {type} has {key}", key)
        if self.type == "classes" and len(self.weights or {}) < 2:
            raise setting_error("an attribute of type classes needs two names or more", "weights")
        return self

    def draw(self, rng: RandomStream) -> AttributeValue | None:
        """Draw a value, or return the given one; None where nothing says what to draw from."""
        if self.value is not None:
            return self.value if isinstance(self.value, bool | str) else float(self.value)
        if self.weights is not None:
            return rng.choice(list(self.weights), list(self.weights.values()))
        if self.type == "yes_no":
            is_true = rng.uniform() < (self.share or 0.0)
            return None if self.share is None else is_true
        return None if self.range is None else quantised(self.range.draw(rng))

    def spec(self, of: Holder, name: str) -> AttributeSpec:
        """The declaration that scenes and files hold."""
        return AttributeSpec(of, name, self.type, tuple(self.weights or ()))


_Declared = Annotated[dict[_Name, AttributeConfig], Field(default={})]


class AttributesConfig(Settings):
    """Attributes, by name, of the people, objects and areas of a scene, and of the episode.

    Attributes:
        people: of all pedestrians; `attributes` of one of `people` gives values.
        objects: of all pieces of furniture; `attributes` of one of `furniture` gives values.
        areas: of the areas; `attributes` of an area gives values.
        episode: of the whole episode.
    """

    _optional = frozenset({"people", "objects", "areas", "episode"})

    people: _Declared
    objects: _Declared
    areas: _Declared
    episode: _Declared

    @model_validator(mode="after")
    def _check_values(self) -> Self:
        for of in HOLDERS:
            for name, attribute in getattr(self, of).items():
                given = [attribute.weights, attribute.share, attribute.range, attribute.value]
                if of != "episode" and attribute.value is not None:
                    message = f"a value in a declaration is of the episode; give those of {of} at each of them"
                    raise setting_error(message, of, name, "value")
                if of == "episode" and given == [None] * 4:
                    message = "the attribute has no value in any episode; give value, or what it is drawn from"
                    raise setting_error(message, of, name)
                if attribute.value is not None and (problem := attribute.spec(of, name).problem(attribute.value)):
                    raise setting_error(problem, of, name, "value")
        return self

    @property
    def specs(self) -> tuple[AttributeSpec, ...]:
        """The declarations."""
        return tuple(attribute.spec(of, name) for of in HOLDERS for name, attribute in getattr(self, of).items())

    def problem(self, of: Holder, given: Attributes | None) -> tuple[str, str] | None:
        """The first given value that is not as declared: its name, and why; None if all are."""
        declared: dict[str, AttributeConfig] = getattr(self, of)
        for name, value in (given or {}).items():
            if name not in declared:
                hint = did_you_mean(name, declared) or f"; declared are {', '.join(declared) or 'none'}"
                return name, f"there is no attribute {name!r} of {of}{hint} (attributes.{of})"
            if problem := declared[name].spec(of, name).problem(value):
                return name, problem
        return None

    def draw(self, of: Holder, given: Attributes | None, rng: RandomStream) -> Attributes | None:
        """The values of a person, object, area or the episode: given ones, and others drawn; None without any."""
        values: Attributes = {}
        for name, attribute in getattr(self, of).items():
            drawn = attribute.draw(rng)  # also where it is given, so that the others stay the same
            value = (given or {}).get(name, drawn)
            if value is not None:
                values[name] = value if isinstance(value, bool | str) else quantised(value)
        return values or None


def _check_values(values: Any) -> Any:
    if not isinstance(values, Mapping):
        return values
    for name, value in values.items():
        if not isinstance(value, bool | int | float | str):
            raise setting_error("a value is true, false, a number or a text", name)
    return dict(values)


GivenAttributes = Annotated[dict[_Name, Any], BeforeValidator(_check_values)]
"""Values of attributes by name; the scenario checks them against the declarations."""
