"""Calls of kernels from kernels by address.

Numba compiles a kernel that another kernel calls as a part of it, again for each caller. Called by its address, it is
compiled once; and a plug-in's kernel can be called by kernels that do not know it.

The address is data of the caller: `address_of` finds it, a named tuple holds it as `Ints`, and `call` and its variants
take it. With the address comes a number that stands for the types of arguments and result; other types raise an error.
"""

from __future__ import annotations

import hashlib
from functools import cache
from typing import Any

import numpy as np

from ..portable_math import IntArray
from .kernel import IS_COMPILED

PACKED, FLOATS, FLOATS2, INTS, INTS2, INT, FLOAT, FLAG, FLAGS = range(9)  # types of arguments
_functions: list[Any] = [None]  # of the interpreter, by address; 0 is none


class _Address(np.ndarray[Any, Any]):
    """An address that is found anew where it is unpickled, since it is valid in one process only."""

    origin: tuple[Any, ...]  # arguments of `address_of`

    def __reduce__(self) -> tuple[Any, ...]:
        return address_of, self.origin

    def __deepcopy__(self, memo: Any) -> _Address:
        return self


def _address(address: int, signature: int, origin: tuple[Any, ...]) -> IntArray:
    found = np.array([address, signature], dtype=np.int64).view(_Address)
    found.origin = origin
    return found


if IS_COMPILED:
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic

    from .packing import View, packed_again

    _TYPES = {
        PACKED: types.Array(types.int64, 1, "C"),
        FLOATS: types.Array(types.float64, 1, "C"),
        FLOATS2: types.Array(types.float64, 2, "C"),
        INTS: types.Array(types.int64, 1, "C"),
        INTS2: types.Array(types.int64, 2, "C"),
        INT: types.int64,
        FLOAT: types.float64,
        FLAG: types.boolean,
        FLAGS: types.Array(types.boolean, 1, "C"),
    }

    def _signature_id(arguments: Any, result: Any) -> int:
        """A number that stands for the types of arguments and result."""
        text = repr((tuple(map(str, arguments)), str(result)))
        return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=7).digest())

    @cache
    def address_of(kernel: Any, *arguments: int) -> IntArray:
        """The address of a kernel for arguments of some types, for `call` and its variants.

        Args:
            kernel: it is compiled, or loaded, if it was not used before.
            arguments: types, as above.

        Returns:
            (2,) of int.
        """
        signature = tuple(_TYPES[argument] for argument in arguments)
        if signature not in kernel.overloads:
            kernel.compile(signature)
        result = kernel.overloads[signature]
        address = result.library.get_pointer_to_function(result.fndesc.llvm_func_name)
        return _address(address, _signature_id(signature, result.signature.return_type), (kernel, *arguments))

    def _converted(kind: Any) -> Any:
        """The type of an argument as kernels are compiled for it."""
        if isinstance(kind, types.Boolean):
            return types.boolean
        if isinstance(kind, View):
            return _TYPES[PACKED]
        if isinstance(kind, types.Integer):
            return types.int64
        if isinstance(kind, types.Float):
            return types.float64
        return types.Array(kind.dtype, kind.ndim, "C") if isinstance(kind, types.Array) else kind

    def _cast(context: Any, builder: Any, value: Any, kind: Any, wanted: Any) -> Any:
        """An argument as kernels take it."""
        if isinstance(kind, View):
            return packed_again(context, builder, value, kind)
        return context.cast(builder, value, kind, wanted)

    def _write_call(arguments: Any, result: Any) -> Any:
        """Typing and machine code of a call with a result of some type."""
        kinds = [_converted(kind) for kind in arguments]

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            address = context.make_array(signature.args[0])(context, builder, values[0])
            place, number = (
                builder.load(builder.gep(address.data, [context.get_constant(types.intp, n)])) for n in range(2)
            )
            expected = context.get_constant(types.intp, _signature_id(kinds, result))
            with cgutils.if_unlikely(builder, builder.icmp_signed("!=", number, expected)):
                message = "a kernel is called by address with other types than it was compiled for"
                context.call_conv.return_user_exc(builder, TypeError, (message,))
            given = cgutils.unpack_tuple(builder, values[1])
            pairs = zip(given, arguments, kinds, strict=True)
            passed = [_cast(context, builder, value, kind, wanted) for value, kind, wanted in pairs]
            function_type = context.call_conv.get_function_type(result, kinds)
            slot, error = (cgutils.alloca_once(builder, kind.pointee) for kind in function_type.args[:2])
            builder.store(cgutils.get_null_value(slot.type.pointee), slot)
            packer = context.get_arg_packer(kinds)
            callee = builder.inttoptr(place, function_type.as_pointer())
            code = builder.call(callee, [slot, error, *packer.as_arguments(builder, passed)])
            status = context.call_conv._get_return_status(builder, code, builder.load(error))
            with cgutils.if_unlikely(builder, status.is_error):
                context.call_conv.return_status_propagate(builder, status)
            return context.get_returned_value(builder, result, builder.load(slot))

        return generate

    @intrinsic  # type: ignore[untyped-decorator]
    def call(typing_context: Any, address: Any, arguments: Any) -> Any:
        """Call a kernel without a result."""
        return types.none(address, arguments), _write_call(arguments, types.none)

    @intrinsic  # type: ignore[untyped-decorator]
    def call_for_int(typing_context: Any, address: Any, arguments: Any) -> Any:
        """Call a kernel whose result is an int."""
        return types.int64(address, arguments), _write_call(arguments, types.int64)

    @intrinsic  # type: ignore[untyped-decorator]
    def call_for_flag(typing_context: Any, address: Any, arguments: Any) -> Any:
        """Call a kernel whose result is a bool."""
        return types.boolean(address, arguments), _write_call(arguments, types.boolean)

else:

    @cache
    def address_of(kernel: Any, *arguments: int) -> IntArray:
        """The number of a function in `_functions`."""
        if kernel not in _functions:
            _functions.append(kernel)
        return _address(_functions.index(kernel), 0, (kernel, *arguments))

    def call(address: IntArray, arguments: tuple[Any, ...]) -> Any:
        """Call a function by its number."""
        return _functions[address[0]](*arguments)

    call_for_int = call_for_flag = call
