"""Errors in settings, each as one line that names the key, the value and the remedy."""

from __future__ import annotations

import re
from dataclasses import is_dataclass
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from ...core.wording import one_line, shown
from ...errors import ConfigError
from ...registry import did_you_mean

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


_MESSAGES = {  # by type of the error, in place of messages that name types of Python
    "tuple_type": "Input should be a list: [first, second]",
    "model_type": "Input should have keys: {key: value}",
    "dict_type": "Input should have keys: {key: value}",
}


def setting_error(message: str, *path: int | str, kind: str = "setting") -> PydanticCustomError:
    """Create the error that a validator of settings raises.

    Args:
        message: of the error.
        path: keys that lead from the validated value to the setting that is wrong.
        kind: type of the error for pydantic.
    """
    return PydanticCustomError(kind, "{message}", {"message": message, "path": path})


class OneLineErrors(ModelMetaclass):
    """Metaclass of settings: their constructors raise ConfigError in place of pydantic's ValidationError."""

    if not TYPE_CHECKING:  # type checkers know the arguments of the constructors

        def __call__(cls, *values: Any, **settings: Any) -> Any:
            if values:
                raise ConfigError(f"the settings of a {cls.__name__} have names; write {cls.__name__}(name=value)")
            try:
                return super().__call__(**settings)
            except ValidationError as error:
                raise ConfigError(problem_of(settings, error)[1]) from None


def problem_of(settings: dict[str, Any], error: ValidationError) -> tuple[list[int | str], str]:
    """Describe the first validation error of settings.

    Returns:
        The keys of the wrong setting, and one line: key, message, value.
    """
    first, *others = error.errors(include_url=False)
    inner_path = first.get("ctx", {}).get("path", ())  # model validators put the key that is wrong there
    keys, value = _follow(settings, (*first["loc"], *inner_path))
    hint = ""
    if first["type"] == "literal_error":  # one of some words; the wrong one may be a key of a mapping
        value = first["input"]
        hint = did_you_mean(str(value), re.findall(r"'([^']*)'", first["ctx"]["expected"]))
    key_path = f"{one_line('.'.join(map(str, keys)), 200)}: " if keys else ""
    got = f" (got {shown(value)})" if first["type"] not in ("unknown_key", "missing") and keys else ""
    # further errors at the same place belong to the other members of a union
    places = (_follow(settings, other["loc"])[0] for other in others)
    further = sorted({".".join(map(str, place)) for place in places if place[: len(keys)] != keys})
    more = f" (and more in {one_line(', '.join(further), 100)})" if further else ""
    message = _MESSAGES.get(first["type"], first["msg"]).replace("Tuple should", "List should")
    return keys, f"{key_path}{one_line(message, 300)}{got}{hint}{more}"


def _follow(settings: Any, keys: tuple[int | str, ...]) -> tuple[list[int | str], Any]:
    """Follow the location that pydantic reports through the settings.

    Returns:
        The keys that exist in the settings, and the value there. pydantic's names of union members and validators are
        left out; a missing setting is kept as the last key.
    """
    known: list[int | str] = []
    for key in keys:
        if isinstance(settings, dict) and isinstance(key, int) and key not in settings and key < len(settings):
            key = list(settings)[key]  # a mapping that was converted to a list
        is_item = isinstance(settings, list | tuple) and isinstance(key, int) and key < len(settings)
        if is_item or (isinstance(settings, dict) and key in settings):
            known.append(key)
            settings = settings[key]
        elif is_dataclass(settings) and isinstance(key, str) and hasattr(settings, key):
            known.append(key)
            settings = getattr(settings, key)
        elif key == keys[-1] and isinstance(settings, dict):  # a missing setting
            known.append(key)
    return known, settings
