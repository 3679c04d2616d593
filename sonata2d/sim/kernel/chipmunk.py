"""Calls of the physics engine from kernels: the C functions behind `pymunk.Space.step` and `pymunk.batch`.

Compiled kernels call them by their addresses, the interpreter calls them through pymunk.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
import pymunk
from numpy.typing import NDArray
from pymunk import batch
from pymunk._chipmunk_cffi import ffi, lib

from ...core.compiled.kernel import IS_COMPILED, subroutine
from ...core.compiled.packing import Floats, Floats2, Ints
from ...core.compiled.scalar import half_line

# Items of `Engine.handle`, addresses: of C functions, of the space, and of the requests for reading and writing.
_STEP, _EACH_BODY, _GET, _SET, _SET_ENDS, _SET_OFFSET, _REINDEX, _SPACE, _READ, _WRITE, _PLACE = range(11)
# Positions in `Engine.counts` of the field `num` of each buffer: its header has 4 integers on 64-bit systems, else 3.
_READ_COUNT, _WRITE_COUNT, _PLACE_COUNT = (k * ffi.sizeof("pmFloatArray") // 4 for k in range(3))


# The C functions; their addresses are the first items of `Engine.handle`.
_POINTERS = [
    ffi.addressof(lib, name)
    for name in (
        "cpSpaceStep",
        "cpSpaceEachBody",
        "pmSpaceBodyGetIteratorFuncBatched",
        "pmSpaceBodySetIteratorFuncBatched",
        "cpSegmentShapeSetEndpoints",
        "cpCircleShapeSetOffset",
        "cpSpaceReindexShape",
    )
]
_KINDS = {int(ffi.cast("intptr_t", pointer)): ffi.typeof(pointer) for pointer in _POINTERS}  # types by address

Counts = Annotated[NDArray[np.int32], np.int32, 1]


class Engine(NamedTuple):
    """A physics space for kernels. Bodies come in the order in which they were added to the space.

    Attributes:
        handle: addresses.
        counts: memory of the engine's buffer headers.
        bodies: (M, 4), x, y, vx, vy, m and m/s: what `read_bodies` reads.
        forces: (M, 2), N: what `apply_forces` writes.
        torsos: (N,), addresses of the pedestrians' shapes.
        shoulder: (N,), half the length of their shoulder lines, m.
        addresses: (M,), of the bodies.
        placed: (4,), x, y, vx, vy, m and m/s: what `place` writes.
        outline: (2 K,), addresses of the robot's shapes if it is no disc: its sides, then its corners.
        corners: (K, 2), in the body frame, m; side k begins at corner k.
    """

    handle: Ints
    counts: Counts
    bodies: Floats2
    forces: Floats2
    torsos: Ints
    shoulder: Floats
    addresses: Ints
    placed: Floats
    outline: Ints
    corners: Floats2


class EngineMemory:
    """The memory behind an `Engine`; it must live as long as the engine is used.

    Args:
        space: with all its bodies.
        bodies: of the space, in its order, objects of the engine.
        torsos: segments, the shapes of the pedestrians.
        shoulder: (N,), half the length of their shoulder lines, m.

    Attributes:
        engine: the space for kernels, without the outline of a robot.
    """

    def __init__(
        self,
        space: pymunk.Space,
        bodies: Sequence[Any],
        torsos: Sequence[Any],
        shoulder: NDArray[Any],
    ) -> None:
        count = len(bodies)
        # The engine would move a buffer with fewer than two free places, so that all are longer than needed.
        numbers = np.zeros(4 * count + 8), np.zeros(2 * count + 8), np.zeros(4 + 8)
        self._headers = ffi.new("pmFloatArray[3]")
        self._requests = [ffi.new("pmBatchedData *") for _ in numbers]
        motion = batch.BodyFields.POSITION | batch.BodyFields.VELOCITY
        fields = motion, batch.BodyFields.FORCE, motion
        self._no_integers = ffi.new("pmIntArray *")
        self._buffers = [ffi.from_buffer("cpFloat[]", array) for array in numbers]
        for header, request, buffer, wanted in zip(self._headers, self._requests, self._buffers, fields, strict=True):
            header.arr, header.max = buffer, len(buffer)
            request.floatArray, request.intArray = ffi.addressof(header), self._no_integers
            request.fields = wanted.value
        self._space = space  # pymunk frees the C space with it
        addresses = [*_KINDS, *map(address_in_engine, (space._space, *self._requests))]
        counts = np.frombuffer(ffi.buffer(self._headers), dtype=np.int32)
        motions, forces = numbers[0][: 4 * count].reshape(count, 4), numbers[1][: 2 * count].reshape(count, 2)
        shapes = np.array([address_in_engine(torso) for torso in torsos], dtype=np.int64)
        of_bodies = np.array([address_in_engine(body) for body in bodies], dtype=np.int64)
        handle = np.array(addresses, dtype=np.int64)
        self.engine = Engine(
            handle, counts, motions, forces, shapes, shoulder, of_bodies, numbers[2][:4],
            outline=np.zeros(0, dtype=np.int64), corners=np.zeros((0, 2)),
        )  # fmt: skip

    def engine_with(self, outline: Sequence[Any], corners: Sequence[tuple[float, float]]) -> Engine:
        """The space for kernels of a robot.

        Args:
            outline: its shapes if it is no disc, see `Engine`.
            corners: in the body frame, m.
        """
        addresses = np.array([address_in_engine(shape) for shape in outline], dtype=np.int64)
        return self.engine._replace(outline=addresses, corners=np.array(corners, dtype=float).reshape(-1, 2))

    def use(self, space: pymunk.Space) -> None:
        """Work on another space with the same bodies."""
        self._space = space
        self.engine.handle[_SPACE] = address_in_engine(space._space)


def address_in_engine(item: Any) -> int:
    """The address of an object of the engine."""
    return int(ffi.cast("intptr_t", item))


def _interpreted_call(function: int, numbers: tuple[Any, ...]) -> None:
    """Call the C function at an address with addresses and numbers; a vector is two of them."""
    kind, items = _KINDS[int(function)], iter(numbers)
    passed: list[Any] = []
    for argument in kind.args:
        if argument.kind == "struct":
            passed.append((float(next(items)), float(next(items))))
        else:
            passed.append(float(next(items)) if argument.kind == "primitive" else ffi.cast(argument, int(next(items))))
    ffi.cast(kind, int(function))(*passed)


if IS_COMPILED:
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic

    @intrinsic  # type: ignore[untyped-decorator]
    def _compiled_call(typing_context: Any, function: Any, numbers: Any) -> Any:
        """Call as `_interpreted_call`."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            passed = cgutils.unpack_tuple(builder, arguments[1])
            if sys.platform == "win32" and len(passed) > 2 and isinstance(passed[1].type, ir.DoubleType):
                # It passes the addresses of the vectors, others pass their numbers.
                count = len(passed) // 2
                places = [cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), 2)) for _ in range(count)]
                for n, number in enumerate(passed[1:]):
                    builder.store(number, cgutils.gep_inbounds(builder, places[n // 2], 0, n % 2))
                passed = [passed[0], *places]
            function_type = ir.FunctionType(ir.VoidType(), [value.type for value in passed])
            builder.call(builder.inttoptr(arguments[0], function_type.as_pointer()), passed)
            return context.get_dummy_value()

        return types.void(types.int64, numbers), generate


_call: Any = _compiled_call if IS_COMPILED else _interpreted_call


@subroutine
def step_space(engine: Engine, h: float) -> None:
    """Move all bodies by h seconds."""
    _call(engine.handle[_STEP], (engine.handle[_SPACE], h))


@subroutine
def read_bodies(engine: Engine) -> None:
    """Copy positions and velocities from the engine to `Engine.bodies`."""
    handle = engine.handle
    engine.counts[_READ_COUNT] = 0
    _call(handle[_EACH_BODY], (handle[_SPACE], handle[_GET], handle[_READ]))


@subroutine
def apply_forces(engine: Engine) -> None:
    """Set the forces of all bodies from `Engine.forces`; they act in the next step only."""
    handle = engine.handle
    engine.counts[_WRITE_COUNT] = 0
    _call(handle[_EACH_BODY], (handle[_SPACE], handle[_SET], handle[_WRITE]))


@subroutine
def turn_torso(engine: Engine, k: int, x: float, y: float) -> None:
    """Turn the shoulder line of pedestrian k to its heading, a unit vector.

    The engine's bodies do not rotate: it would compute sines and cosines, whose last bits depend on the C library.
    """
    dx, dy = half_line(x, y, engine.shoulder[k])
    _call(engine.handle[_SET_ENDS], (engine.torsos[k], dx, dy, -dx, -dy))


@subroutine
def turn_outline(engine: Engine, c: float, s: float) -> None:
    """Turn the shapes of the robot to a heading, cosine and sine."""
    corners, count = engine.corners, len(engine.corners)
    for k in range(count):
        following = (k + 1) % count
        ax, ay = corners[k, 0] * c - corners[k, 1] * s, corners[k, 0] * s + corners[k, 1] * c
        bx = corners[following, 0] * c - corners[following, 1] * s
        by = corners[following, 0] * s + corners[following, 1] * c
        _call(engine.handle[_SET_ENDS], (engine.outline[k], ax, ay, bx, by))
        _call(engine.handle[_SET_OFFSET], (engine.outline[count + k], ax, ay))


@subroutine
def move_leaf(engine: Engine, shapes: Ints, x: float, y: float, end_x: float, end_y: float) -> None:
    """Move the leaf of a door, a segment and the circles at its ends; m."""
    _call(engine.handle[_SET_ENDS], (shapes[0], x, y, end_x, end_y))
    _call(engine.handle[_SET_OFFSET], (shapes[1], x, y))
    _call(engine.handle[_SET_OFFSET], (shapes[2], end_x, end_y))
    for k in range(len(shapes)):  # the engine does not look for static shapes that have moved
        _call(engine.handle[_REINDEX], (engine.handle[_SPACE], shapes[k]))


@subroutine
def place(engine: Engine, k: int, x: float, y: float, vx: float, vy: float) -> None:
    """Set position and velocity of body k, m and m/s."""
    placed = engine.placed
    placed[0], placed[1], placed[2], placed[3] = x, y, vx, vy
    engine.counts[_PLACE_COUNT] = 0
    _call(engine.handle[_SET], (engine.addresses[k], engine.handle[_PLACE]))
