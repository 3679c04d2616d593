"""Named tuples of arrays that are handed to kernels by their addresses.

Numba unpacks every array of an argument at every call, which takes longer than the work on a few pedestrians. `pack`
does it once: it returns one array of addresses, shapes and numbers, from which `unpack` makes the named tuple again,
inside the kernel and almost without cost. The interpreter passes the named tuple itself.
"""

from __future__ import annotations

import hashlib
import struct
from functools import cache
from itertools import count
from typing import Annotated, Any, Generic, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from .kernel import IS_COMPILED

T = TypeVar("T", bound=tuple[Any, ...])

# Annotations of the fields of a named tuple that can be packed, besides `float`, `int` and `bool`: element type,
# dimensions.
Floats = Annotated[NDArray[np.float64], np.float64, 1]
Floats2 = Annotated[NDArray[np.float64], np.float64, 2]
Floats3 = Annotated[NDArray[np.float64], np.float64, 3]
Ints = Annotated[NDArray[np.int64], np.int64, 1]
Ints2 = Annotated[NDArray[np.int64], np.int64, 2]
ShortInts2 = Annotated[NDArray[np.int32], np.int32, 2]
Bools = Annotated[NDArray[np.bool_], np.bool_, 1]


_SCALARS: dict[Any, Any] = {float: np.float64, int: np.int64, bool: np.bool_}
_FLOAT, _WORD = struct.Struct("=d"), struct.Struct("=q")


class Packed(Generic[T]):
    """A named tuple and its packed form, whose arrays live as long; a copy has arrays of its own.

    Args:
        value: see `pack`.

    Attributes:
        value: the named tuple.
        argument: of kernels.
    """

    def __init__(self, value: T) -> None:
        self.value, self.argument = value, pack(value)

    def __reduce__(self) -> tuple[type[Packed[T]], tuple[T]]:
        return Packed, (self.value,)


class _Field(NamedTuple):
    """A field of a named tuple.

    Attributes:
        name: of the field.
        dtype: element type; of a named tuple its class.
        dimensions: of an array; 0 for a number, -1 for a named tuple.
    """

    name: str
    dtype: Any
    dimensions: int


@cache
def layout(kind: type) -> tuple[_Field, ...]:
    """The fields of a named tuple class.

    Raises:
        TypeError: a field is neither a number or a bool, nor one of the arrays above, nor a named tuple of these.
    """
    hints = get_type_hints(kind, include_extras=True)
    fields = []
    for name in kind._fields:  # type: ignore[attr-defined]
        hint = hints[name]
        if hint in _SCALARS:
            fields.append(_Field(name, _SCALARS[hint], 0))
        elif get_origin(hint) is Annotated:
            fields.append(_Field(name, *get_args(hint)[1:]))
        elif isinstance(hint, type) and hasattr(hint, "_fields"):
            fields.append(_Field(name, hint, -1))
        else:
            raise TypeError(f"{kind.__name__}.{name} cannot be packed; annotate it as one of the types of core.packing")
    return tuple(fields)


def zeros(kind: type[T], count: int, /, **fields: Any) -> T:
    """A named tuple of arrays of zeros, with `count` rows (and 2 columns), except for the given fields."""
    others = [field for field in layout(kind) if field.name not in fields]
    arrays = {name: np.zeros((count, *(2,) * (dimensions - 1)), dtype) for name, dtype, dimensions in others}
    return kind(**arrays, **fields)


@cache
def _layout_id(kind: type) -> int:
    """A number that classes share only if their fields have the same names and types."""
    fields = [
        (field.name, _layout_id(field.dtype) if field.dimensions < 0 else np.dtype(field.dtype).str, field.dimensions)
        for field in layout(kind)
    ]
    return int.from_bytes(hashlib.blake2b(repr(fields).encode(), digest_size=7).digest())


def pack(value: T) -> Any:
    """The argument of a kernel that stands for a named tuple of arrays and numbers.

    The kernel works on the memory of the arrays, which must live as long as the packed argument is used.

    Args:
        value: named tuple whose class has a `layout`.

    Raises:
        TypeError: an array has another element type or other dimensions than its field, or is not contiguous.
    """
    return np.array([_layout_id(value.__class__), *_numbers(value)], dtype=np.int64) if IS_COMPILED else value


def _numbers(value: Any) -> list[int]:
    """Addresses and shapes of the arrays of a named tuple, and the bits of its numbers."""
    numbers: list[int] = []
    for (name, dtype, dimensions), item in zip(layout(value.__class__), value, strict=True):
        if dimensions < 0:
            numbers += _numbers(item)
        elif dimensions == 0:
            numbers.append(_WORD.unpack(_FLOAT.pack(item))[0] if dtype is np.float64 else int(item))
        elif item.dtype == dtype and item.ndim == dimensions and item.flags.c_contiguous:
            numbers += (item.ctypes.data, *item.shape)
        else:
            expected = f"a contiguous array of {np.dtype(dtype)} with {dimensions} dimensions"
            raise TypeError(f"{type(value).__name__}.{name} must be {expected}, got {item.dtype} {item.shape}")
    return numbers


if IS_COMPILED:
    from numba import from_dtype, types
    from numba.core import cgutils
    from numba.extending import intrinsic
    from numba.np.arrayobj import make_array, populate_array

    def _numba_type(kind: type) -> Any:
        """Numba's type of a named tuple class."""
        items = []
        for field in layout(kind):
            if field.dimensions < 0:
                items.append(_numba_type(field.dtype))
            elif field.dimensions == 0:
                items.append(from_dtype(np.dtype(field.dtype)))
            else:
                items.append(types.Array(from_dtype(np.dtype(field.dtype)), field.dimensions, "C"))
        return types.NamedTuple(items, kind)

    @intrinsic  # type: ignore[untyped-decorator]
    def _compiled_unpack(typing_context: Any, packed: Any, kind: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            source = make_array(signature.args[0])(context, builder, arguments[0])
            word = context.get_value_type(types.intp)
            positions = count()
            named_tuple = kind.instance_class

            def read() -> Any:
                place = context.get_constant(types.intp, next(positions))
                return builder.load(builder.gep(source.data, [place]))

            def build(kind: Any) -> Any:
                if isinstance(kind, types.NamedTuple):
                    return context.make_tuple(builder, kind, [build(item) for item in kind.types])
                if kind is types.boolean:
                    return builder.icmp_signed("!=", read(), context.get_constant(types.intp, 0))
                if kind is types.float64:
                    return builder.bitcast(read(), context.get_value_type(kind))
                if kind is types.int64:
                    return read()
                array = make_array(kind)(context, builder)
                data = builder.inttoptr(read(), array.data.type)
                shape = [read() for _ in range(kind.ndim)]
                strides = [word(context.get_abi_sizeof(context.get_data_type(kind.dtype)))]
                for length in reversed(shape[1:]):
                    strides.insert(0, builder.mul(strides[0], length))
                populate_array(
                    array,
                    data=data,
                    shape=cgutils.pack_array(builder, shape, word),
                    strides=cgutils.pack_array(builder, strides, word),
                    itemsize=strides[-1],
                    meminfo=None,  # the memory belongs to the caller
                )
                return array._getvalue()

            expected = context.get_constant(types.intp, _layout_id(named_tuple))
            with cgutils.if_unlikely(builder, builder.icmp_signed("!=", read(), expected)):
                message = f"the packed argument is not a {named_tuple.__name__}, or one of another layout"
                context.call_conv.return_user_exc(builder, TypeError, (message,))
            return build(signature.return_type)

        return _numba_type(kind.instance_class)(packed, kind), generate

    unpack: Any = _compiled_unpack

else:

    def unpack(packed: T, kind: type[T]) -> T:
        """The named tuple that `pack` stands for, inside a kernel.

        Args:
            packed: argument of the kernel.
            kind: class of the named tuple.

        Raises:
            TypeError: another class was packed, with other fields (compiled kernels only).
        """
        return packed
