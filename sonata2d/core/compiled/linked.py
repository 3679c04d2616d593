"""Functions that numba compiles only as parts of kernels, in less time than functions that Python calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba.core.codegen import JITCodeLibrary
from numba.core.dispatcher import _FunctionCompiler  # type: ignore[attr-defined]
from numba.core.registry import CPUDispatcher
from numba.core.types import unliteral  # type: ignore[attr-defined]

F = TypeVar("F", bound=Callable[..., Any])


class _Library(JITCodeLibrary):  # type: ignore[misc]
    """Code of a subroutine. It is optimised, and translated to machine code, only with the kernels that use it."""

    def finalize(self) -> None:
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True


class _Compiler(_FunctionCompiler):  # type: ignore[misc]
    def _customize_flags(self, flags: Any) -> Any:
        flags.no_compile = True
        return flags


class _Function:
    """Stands for a subroutine for some argument types where numba wants a function of the interpreter."""


class _Subroutine(CPUDispatcher):  # type: ignore[misc]
    """A function that numba compiles as a part of kernels; it cannot be called from ordinary Python when compiled."""

    def __call__(self, *arguments: Any) -> Any:
        return self.py_func(*arguments)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        # Once for all ints, not anew for every number that a caller gives as a literal.
        return super().get_call_template(tuple(map(unliteral, args)), {k: unliteral(kind) for k, kind in kws.items()})

    def add_overload(self, result: Any) -> None:
        function = _Function()
        result.library.__class__ = _Library
        result.target_context.insert_user_function(function, result.fndesc, [result.library])
        self.overloads[tuple(result.signature.args)] = result._replace(entry_point=function)


def as_subroutine(function: F) -> F:
    """Make a function compiled by numba a part of kernels; ordinary Python that calls it runs it uncompiled."""
    dispatcher: Any = function
    dispatcher.__class__, dispatcher._compiler.__class__ = _Subroutine, _Compiler
    return function
