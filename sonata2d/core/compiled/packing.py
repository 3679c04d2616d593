"""Named tuples of arrays that are handed to kernels by their addresses.

Numba unpacks every array of an argument at every call, which takes longer than the work on a few pedestrians. `pack`
does it once: it returns one array of addresses, shapes and numbers, from which `unpack` makes the named tuple again,
inside the kernel and almost without cost. The interpreter passes the named tuple itself.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterator, Set
from functools import cache
from itertools import count
from operator import attrgetter
from typing import Annotated, Any, Generic, NamedTuple, TypeVar, get_args, get_origin, get_type_hints
from weakref import WeakValueDictionary

import _cffi_backend
import numpy as np
from numpy.typing import NDArray

from .kernel import IS_COMPILED

T = TypeVar("T", bound=tuple[Any, ...])

# Annotations of the fields of a named tuple that can be packed, besides `float`, `int` and `bool`: element type,
# dimensions.
Floats = Annotated[NDArray[np.float64], np.float64, 1]
Floats2 = Annotated[NDArray[np.float64], np.float64, 2]
Floats3 = Annotated[NDArray[np.float64], np.float64, 3]
Floats4 = Annotated[NDArray[np.float64], np.float64, 4]
Ints = Annotated[NDArray[np.int64], np.int64, 1]
Ints2 = Annotated[NDArray[np.int64], np.int64, 2]
ShortInts2 = Annotated[NDArray[np.int32], np.int32, 2]
Bools = Annotated[NDArray[np.bool_], np.bool_, 1]


_SCALARS: dict[Any, Any] = {float: np.float64, int: np.int64, bool: np.bool_}
# Four times as fast as `ndarray.ctypes`, and a world has some 500 arrays. `cffi.FFI` is a slower wrapper in Python.
_FFI = _cffi_backend.FFI()
_ADDRESS, _LARGEST = _FFI.typeof("uintptr_t"), 1 << 63
_interpreted: WeakValueDictionary[int, Packed[Any]] = WeakValueDictionary()  # of the interpreter, by address


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

    @property
    def address(self) -> int:
        """For `packed_at`, while this object lives."""
        if IS_COMPILED:
            return int(self.argument.ctypes.data)
        _interpreted[id(self)] = self
        return id(self)

    def __reduce__(self) -> tuple[type[Packed[T]], tuple[T]]:
        return Packed, (self.value,)


class Kept:
    """A copy of the arrays of a named tuple.

    Args:
        value: named tuple of arrays, numbers and such named tuples.
        constant: names of fields that never change.
    """

    def __init__(self, value: tuple[Any, ...], constant: Set[str]) -> None:
        self._pairs = [(array, array.copy()) for array in arrays_of(value, constant)]

    def restore(self) -> None:
        """Write the copies back."""
        for array, copy in self._pairs:
            array[...] = copy


def arrays_of(value: Any, constant: Set[str]) -> Iterator[NDArray[Any]]:
    """The writeable arrays of a named tuple in their order, without those of some fields, see `Kept`."""
    for name, item in zip(value._fields, value, strict=True):
        if name not in constant:
            if isinstance(item, np.ndarray) and item.flags.writeable:
                yield item
            elif hasattr(item, "_fields"):
                yield from arrays_of(item, constant)


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
            _, dtype, dimensions = get_args(hint)
            fields.append(_Field(name, np.dtype(dtype), dimensions))
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
    if not IS_COMPILED:
        return value
    kind = value.__class__
    plan, words, kinds = _plan(kind), [_layout_id(kind)], []
    try:
        for item, dimensions in zip(plan.items(value), plan.dimensions, strict=True):
            if dimensions:
                kinds.append((item.dtype, item.ndim))
                words.append(int(_FFI.cast(_ADDRESS, _FFI.from_buffer(item))))
                words += item.shape
            else:
                words.append(int(item) if isinstance(item, np.bool_) else item)
        if kinds != plan.kinds:
            raise ValueError
    except (AttributeError, TypeError, ValueError):  # also of an array that is not contiguous
        _require_arrays(value)
        raise
    packed = np.empty(plan.words.size // 8, dtype=np.int64)
    try:
        plan.words.pack_into(packed.data, 0, *words)
    except (struct.error, TypeError):
        _require_numbers(value)
        raise
    return packed


class _Plan(NamedTuple):
    """Places of the values of a packed named tuple.

    Attributes:
        items: gets all numbers and arrays of a named tuple, with those of its named tuples in their places.
        dimensions: of each; 0 for a number.
        kinds: element type and dimensions of each array.
        words: of the packed form: the layout, and of each item the number, or address and shape.
    """

    items: Callable[[Any], tuple[Any, ...]]
    dimensions: list[int]
    kinds: list[tuple[Any, int]]
    words: struct.Struct


@cache
def _plan(kind: type) -> _Plan:
    fields = _flat_layout(kind)
    dimensions = [field.dimensions for field in fields]
    kinds = [(field.dtype, field.dimensions) for field in fields if field.dimensions]
    formats = ["d" if field.dtype is np.float64 and not field.dimensions else "q" for field in fields]
    words = "".join(each + "q" * count for each, count in zip(formats, dimensions, strict=True))
    return _Plan(_getter([field.name for field in fields]), dimensions, kinds, struct.Struct(f"=q{words}"))


def _getter(names: list[str]) -> Callable[[Any], tuple[Any, ...]]:
    """A function that gets attributes of an object by dotted names, as a tuple also where there are fewer than two."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda value: tuple(attrgetter(name)(value) for name in names)


def _flat_layout(kind: type) -> list[_Field]:
    """The fields of a named tuple class, with those of its named tuples, by dotted names, in their places."""
    flat: list[_Field] = []
    for field in layout(kind):
        if field.dimensions < 0:
            flat += [each._replace(name=f"{field.name}.{each.name}") for each in _flat_layout(field.dtype)]
        else:
            flat.append(field)
    return flat


def _require_numbers(value: Any) -> None:
    """Require numbers as the fields of a named tuple declare them, and of its named tuples.

    Raises:
        TypeError: a field has something else.
    """
    for field in _flat_layout(value.__class__):
        item = attrgetter(field.name)(value)
        is_float = field.dtype is np.float64
        is_right = isinstance(item, (int, float, np.number) if is_float else (int, np.integer, np.bool_))
        if not field.dimensions and not (is_right and (is_float or -_LARGEST <= item < _LARGEST)):
            expected = "a number" if is_float else "a 64-bit whole number"
            raise TypeError(f"{type(value).__name__} must have {expected} in place of {item!r:.50}")


def _require_arrays(value: Any) -> None:
    """Require arrays as the fields of a named tuple declare them, and of its named tuples.

    Raises:
        TypeError: a field has something else.
    """
    for (name, dtype, dimensions), item in zip(layout(value.__class__), value, strict=True):
        if dimensions < 0:
            _require_arrays(item)
        elif dimensions:
            is_array = isinstance(item, np.ndarray)
            if not (is_array and item.dtype == dtype and item.ndim == dimensions and item.flags.c_contiguous):
                expected = f"a contiguous array of {np.dtype(dtype)} with {dimensions} dimensions"
                got = f"{item.dtype} {item.shape}" if is_array else f"{item!r:.50}"
                raise TypeError(f"{type(value).__name__}.{name} must be {expected}, got {got}")


if IS_COMPILED:
    from llvmlite import ir
    from numba import from_dtype, types
    from numba.core import cgutils
    from numba.core.datamodel import models, register_default
    from numba.core.typing.templates import AttributeTemplate
    from numba.extending import infer_getattr, intrinsic, lower_getattr_generic
    from numba.np.arrayobj import make_array, populate_array

    class View(types.Type):  # type: ignore[misc]
        """A packed named tuple inside a kernel: the address of its first field. Attributes are read where they stand.

        Numba's own named tuples hold all their arrays as values, which every call and assignment copies one by one:
        kernels took three times as long to compile.

        Args:
            kind: class of the named tuple.
        """

        def __init__(self, kind: type) -> None:
            self.kind = kind
            super().__init__(f"View_{kind.__name__}_{_layout_id(kind):x}")

        @property
        def key(self) -> Any:
            return self.kind

    @register_default(View)
    class _ViewModel(models.PrimitiveModel):  # type: ignore[misc]
        def __init__(self, manager: Any, kind: Any) -> None:
            super().__init__(manager, kind, ir.IntType(64).as_pointer())

    @infer_getattr
    class _ViewAttributes(AttributeTemplate):  # type: ignore[misc]
        key = View

        def generic_resolve(self, view: Any, name: str) -> Any:
            return next((_type_of(field) for field in layout(view.kind) if field.name == name), None)

    @lower_getattr_generic(View)  # type: ignore[untyped-decorator]
    def _read_attribute(context: Any, builder: Any, view: Any, words: Any, name: str) -> Any:
        position = 0
        for field in layout(view.kind):
            if field.name == name:
                return _read(context, builder, words, position, _type_of(field))
            position += _words(field)
        raise AttributeError(name)

    def _type_of(field: _Field) -> Any:
        """Numba's type of a field."""
        if field.dimensions < 0:
            return View(field.dtype)
        kind = from_dtype(np.dtype(field.dtype))
        return kind if field.dimensions == 0 else types.Array(kind, field.dimensions, "C")

    def _words(field: _Field) -> int:
        """Number of words of a field in a packed named tuple."""
        return sum(map(_words, layout(field.dtype))) if field.dimensions < 0 else 1 + field.dimensions

    def _read(context: Any, builder: Any, words: Any, position: int, kind: Any) -> Any:
        """Machine code that reads a value of some type from a position on."""
        places = (builder.gep(words, [context.get_constant(types.intp, n)]) for n in count(position))

        def read() -> Any:
            value = builder.load(next(places))
            # Packed words never change, so that the compiler reads them once before a loop.
            value.set_metadata("invariant.load", builder.module.add_metadata([]))
            return value

        if isinstance(kind, View):
            return next(places)
        if kind is types.boolean:
            return builder.icmp_signed("!=", read(), context.get_constant(types.intp, 0))
        if kind is types.float64:
            return builder.bitcast(read(), context.get_value_type(kind))
        if kind is types.int64:
            return read()
        data, shape = read(), [read() for _ in range(kind.ndim)]
        return _borrow(context, builder, kind, data, shape)

    def _borrow(context: Any, builder: Any, kind: Any, data: Any, shape: list[Any]) -> Any:
        """An array at an address, whose memory belongs to the caller."""
        array, word = make_array(kind)(context, builder), context.get_value_type(types.intp)
        strides = [word(context.get_abi_sizeof(context.get_data_type(kind.dtype)))]
        for length in reversed(shape[1:]):
            strides.insert(0, builder.mul(strides[0], length))
        populate_array(
            array,
            data=builder.inttoptr(data, array.data.type),
            shape=cgutils.pack_array(builder, shape, word),
            strides=cgutils.pack_array(builder, strides, word),
            itemsize=strides[-1],
            meminfo=None,
        )
        return array._getvalue()

    def packed_again(context: Any, builder: Any, words: Any, view: Any) -> Any:
        """The packed argument of which `words` are a view; kernels refuse that of a field, by the layout's identity."""
        size = context.get_constant(types.intp, 1 + sum(map(_words, layout(view.kind))))
        first = builder.gep(words, [context.get_constant(types.intp, -1)])
        address = builder.ptrtoint(first, context.get_value_type(types.intp))
        return _borrow(context, builder, types.Array(types.int64, 1, "C"), address, [size])

    @intrinsic  # type: ignore[untyped-decorator]
    def _compiled_unpack(typing_context: Any, packed: Any, kind: Any) -> Any:
        view = View(kind.instance_class)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            words = make_array(signature.args[0])(context, builder, arguments[0]).data
            identity = builder.load(words)
            expected = context.get_constant(types.intp, _layout_id(view.kind))
            with cgutils.if_unlikely(builder, builder.icmp_signed("!=", identity, expected)):
                message = f"the packed argument is not a {view.kind.__name__}, or one of another layout"
                context.call_conv.return_user_exc(builder, TypeError, (message,))
            return builder.gep(words, [context.get_constant(types.intp, 1)])

        return view(packed, kind), generate

    @intrinsic  # type: ignore[untyped-decorator]
    def packed_at(typing_context: Any, address: Any) -> Any:
        """The packed argument at an address, in kernels that work on many of them."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            size = context.get_constant(types.intp, 1 << 32)  # not known; the identity is checked when it is unpacked
            return _borrow(context, builder, signature.return_type, arguments[0], [size])

        return types.Array(types.int64, 1, "C")(types.int64), generate

    unpack: Any = _compiled_unpack

else:

    def packed_at(address: int) -> Any:
        """The packed argument with an address."""
        return _interpreted[int(address)].argument

    def unpack(packed: T, kind: type[T]) -> T:
        """The named tuple that `pack` stands for, inside a kernel.

        Args:
            packed: argument of the kernel.
            kind: class of the named tuple.

        Raises:
            TypeError: another class was packed, with other fields (compiled kernels only).
        """
        return packed
