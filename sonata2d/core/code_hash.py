"""Hashes of classes that have no source file, such as classes of a notebook."""

from __future__ import annotations

import hashlib
from types import CodeType, FunctionType
from typing import Any

_NO_CODE = {"_abc_impl", "__annotate_func__"}
_OWN = __name__.split(".")[0]


def code_sha256(definition: Any) -> str:
    """SHA-256 of the code of a class and of its base classes outside sonata2d, or of the class of an object.

    It changes with the methods and with class attributes that are numbers, texts or tuples of them, and with the
    version of Python; not with comments, and not with functions that the methods call.
    """
    kind = definition if isinstance(definition, type) else type(definition)
    bases = [base for base in kind.__mro__ if base.__module__.split(".")[0] not in (_OWN, "builtins", "abc")]
    parts = [
        (name, _content(value))
        for base in bases
        for name, value in sorted(vars(base).items())
        if name not in _NO_CODE and (not name.startswith("__") or callable(value))
    ]
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _content(value: Any) -> Any:
    """A process-independent representation of a value's behaviour, for hashing."""
    value = getattr(value, "__func__", value)  # of class methods and static methods
    value = getattr(value, "fget", None) or getattr(value, "func", None) or getattr(value, "py_func", None) or value
    if isinstance(value, FunctionType):
        return _content(value.__code__), _content(value.__defaults__), _content(value.__kwdefaults__)
    if isinstance(value, CodeType):
        constants = tuple(_content(constant) for constant in value.co_consts)
        return value.co_code.hex(), constants, value.co_names, value.co_varnames, value.co_freevars
    if isinstance(value, tuple | list):
        return type(value).__name__, [_content(item) for item in value]
    if isinstance(value, dict):
        return [(str(key), _content(item)) for key, item in value.items()]
    if isinstance(value, set | frozenset):
        return sorted(map(repr, value))
    return repr(value) if isinstance(value, int | float | complex | str | bytes | type(None)) else type(value).__name__
