"""The key of a compiled kernel: a hash of all that its machine code depends on."""

from __future__ import annotations

import dis
import hashlib
import sys
from collections.abc import Iterator
from enum import Enum, EnumType
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import llvmlite
import numba
import numpy as np
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic

_PLACES = ("CACHE_DIR", "NUMBA_NUM_THREADS", "NUMBA_DEFAULT_NUM_THREADS")  # settings that do not change machine code
_VERSIONED = ("numpy", "numba", "llvmlite")  # packages whose functions are identified by name and version


class NotCacheableError(Exception):
    """A kernel uses an object whose influence on the machine code is unknown."""


def key_of(kernel: Any, signature: Any) -> tuple[str, list[FunctionType]]:
    """The key of a kernel for some argument types, and the Python functions that become part of it.

    Args:
        kernel: a dispatcher of numba.
        signature: tuple of numba's types.

    Raises:
        NotCacheableError: the key would not be complete.
    """
    if not isinstance(signature, tuple):  # given as text
        raise NotCacheableError
    dependencies = _Dependencies()
    dependencies.parts += [*_versions(), str(kernel.__module__), kernel.py_func.__code__.co_qualname]
    dependencies.parts += map(repr, kernel.targetctx.codegen().magic_tuple())  # the processor
    for type_ in signature:
        dependencies.parts.append(repr(type_))
        for named_tuple in _named_tuples(type_):
            dependencies.add(named_tuple)
    dependencies.add(kernel)
    text = "\0".join(dependencies.parts)
    return hashlib.blake2b(text.encode(errors="surrogatepass"), digest_size=16).hexdigest(), dependencies.functions


def _versions() -> list[str]:
    """Versions and settings."""
    versions = [sys.version, numba.__version__, llvmlite.__version__, np.__version__]
    names = [name for name in sorted(vars(numba.config)) if name[0] != "_" and name.isupper() and name not in _PLACES]
    return versions + [f"{name}={getattr(numba.config, name)!r}" for name in names]


def _named_tuples(type_: Any) -> Iterator[type]:
    """The classes of the named tuples in an argument type, whose description lacks the names of their fields."""
    if hasattr(type_, "instance_class"):
        yield type_.instance_class
    for inner in getattr(type_, "types", None) or (getattr(type_, "dtype", None),):
        if inner is not None and inner is not type_:
            yield from _named_tuples(inner)


def _file_hash(file: str) -> str:
    """The hash of a Python file.

    Raises:
        NotCacheableError: there is no such file.
    """
    try:
        return hashlib.blake2b(Path(file).read_bytes()).hexdigest()
    except OSError:
        raise NotCacheableError from None


def _is_versioned(module: str | None) -> bool:
    return str(module).partition(".")[0] in _VERSIONED


class _Dependencies:
    """Descriptions of the code and the constants of a kernel.

    Attributes:
        parts: the descriptions.
        functions: the Python functions among them.
    """

    def __init__(self) -> None:
        self.parts: list[str] = []
        self.functions: list[FunctionType] = []
        self._named_tuples: list[type] = []

    def add(self, value: Any) -> None:
        """Add a value that a kernel uses."""
        if isinstance(value, Dispatcher):
            self.parts.append(repr(sorted(value.targetoptions.items())))
            value = value.py_func
        elif isinstance(value, _Intrinsic):
            # A Python function writes the machine code, by means of objects of numba that cannot be described.
            self.parts.append(f"{value._defn.__qualname__} {_file_hash(value._defn.__code__.co_filename)}")
            return
        kind = type(value)
        if isinstance(value, FunctionType):
            self._add_function(value)
        elif value is None or value is ... or kind in (bool, int, float, complex, str, bytes, range, slice):
            self.parts.append(f"{kind.__name__} {value!r}")
        elif isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
            order = value.flags.c_contiguous, value.flags.f_contiguous, value.flags.writeable
            content = hashlib.blake2b(value.tobytes()).hexdigest()
            self.parts.append(f"{kind.__name__} {value.dtype!r} {value.shape} {order} {content}")
        elif isinstance(value, tuple | list):
            self.parts.append(f"{kind.__module__} {kind.__qualname__} {len(value)} {getattr(value, '_fields', '')}")
            for item in value:
                self.add(item)
        elif isinstance(value, set | frozenset):
            self.parts.append(f"{kind.__name__} {sorted(map(repr, value))}")
        elif isinstance(value, ModuleType):
            self.parts.append(value.__name__)
        elif isinstance(value, type):
            self._add_class(value)
        elif isinstance(value, Enum):
            self.add((kind, value.name))
        elif isinstance(value, BuiltinFunctionType) or (kind.__module__ == "numpy" and hasattr(value, "__name__")):
            self.parts.append(f"{getattr(value, '__module__', '')} {value.__name__}")  # also ufuncs
        else:
            raise NotCacheableError

    def _add_class(self, value: type) -> None:
        self.parts.append(f"{value.__module__} {value.__qualname__}")
        if issubclass(value, tuple) and hasattr(value, "_fields"):
            self._add_fields(value)
        elif isinstance(value, EnumType):
            self.add([(name, value[name].value) for name in value.__members__])
        elif not _is_versioned(value.__module__) and value.__module__ != "builtins":
            raise NotCacheableError

    def _add_fields(self, named_tuple: Any) -> None:
        """Add the names and the types of the fields, from which `packing.unpack` makes offsets."""
        if named_tuple in self._named_tuples:
            return
        self._named_tuples.append(named_tuple)
        try:
            hints = get_type_hints(named_tuple, include_extras=True)
        except Exception:  # of whatever the annotations contain
            raise NotCacheableError from None
        for name in named_tuple._fields:
            hint = hints.get(name)
            if get_origin(hint) is Annotated:
                hint = get_args(hint)[1:]
            self.parts.append(f"{name} {hint!r}")
            if isinstance(hint, type) and hasattr(hint, "_fields"):
                self._add_fields(hint)

    def _add_function(self, function: FunctionType) -> None:
        """Add a function and the values of the names that it uses."""
        if function in self.functions:
            self.parts.append(f"function {self.functions.index(function)}")
            return
        if _is_versioned(function.__module__):
            self.parts.append(f"{function.__module__} {function.__qualname__}")
            return
        self.functions.append(function)
        self.add((function.__defaults__, *(function.__kwdefaults__ or {}).items()))
        for cell in function.__closure__ or ():
            try:
                self.add(cell.cell_contents)
            except ValueError:  # a name that has no value yet
                raise NotCacheableError from None
        self._add_code(function.__code__, function)

    def _add_code(self, code: CodeType, function: FunctionType) -> None:
        """Add the code of a function, or of one defined in it, except for its place and docstring."""
        self.parts += [code.co_code.hex(), code.co_exceptiontable.hex()]
        names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
        counts = code.co_flags, code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount
        self.parts.append(f"{names} {counts}")
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                self._add_code(constant, function)
            else:
                self.add(None if constant is function.__doc__ else constant)
        for name in code.co_names:  # global names and names of attributes
            if name in function.__globals__:
                lengths = len(self.parts), len(self.functions)
                try:
                    self._add_with_attributes(function.__globals__[name], code.co_names)
                except NotCacheableError:
                    if _loads(code, name):
                        raise
                    # Only an attribute has the name.
                    del self.parts[lengths[0] :], self.functions[lengths[1] :]

    def _add_with_attributes(self, value: Any, names: tuple[str, ...]) -> None:
        """Add a value; of a module also what it has under some names."""
        self.add(value)
        if isinstance(value, ModuleType) and not _is_versioned(value.__name__):
            for index, name in enumerate(names):
                if hasattr(value, name):
                    # Without the name itself, because modules may refer to each other.
                    self._add_with_attributes(getattr(value, name), (*names[:index], *names[index + 1 :]))


def _loads(code: CodeType, name: str) -> bool:
    """Whether code uses a global name."""
    loads = (step for step in dis.get_instructions(code) if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"))
    return any(step.argval == name for step in loads)
