"""Worlds that kernels run without the interpreter: the members of a batch, and episodes of compiled controllers."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..agents.controllers.compiled import controller_address
from ..agents.pedestrians.crowd import Crowd
from ..core.at_goal import goal_row
from ..core.compiled.kernel import kernel
from ..core.compiled.packing import Floats2, Packed, unpack
from ..core.geometry import Twist
from ..core.portable_math import Array, BoolArray, IntArray
from ..core.snapshot import Frames, Snapshot
from .kernel.batch import MEASURED_SIZE, NO_COMMAND, Member, run_member
from .kernel.tick import DONE, LONGER_LISTS, SEATS, run_tick_address
from .world import World

_BLOCK = 256  # ticks that are run at once, or fewer in a large scene
_BLOCK_SIZE = 1 << 20  # numbers
_NOTHING = np.zeros(2, dtype=np.int64)


def member_of(
    world: World, crowd: Crowd, outcome: IntArray, measured: Array, *, write: IntArray = _NOTHING,
    sight: Any = _NOTHING,
) -> Packed[Member]:  # fmt: skip
    """A world and its crowd as kernels run them.

    Args:
        world, crowd: in the same tick.
        outcome, measured, write, sight: see `Member`.
    """
    scene, count = world.scene, len(world.scene.humans)
    return Packed(
        Member(
            world=world.argument,
            crowd=crowd.argument,
            calls=world.calls,
            run_tick=run_tick_address(),
            write=write,
            sight=sight,
            row=world.row,
            activity=np.zeros(count, dtype=np.int64),
            is_present=np.ones(count, dtype=bool),
            is_wall=np.array([kind != "object" for kind, _ in scene.barrier_owner], dtype=bool),
            goal=goal_row(scene.goal),
            ends_on=np.array(["goal" in scene.rules.ends_on, "contact" in scene.rules.ends_on]),
            clock=np.array([world.tick, scene.rules.last_tick], dtype=np.int64),
            outcome=outcome,
            measured=measured,
        )
    )


def provided(member: Packed[Member], world: World, crowd: Crowd, need: int) -> Packed[Member]:
    """Give a world what its tick needs to go on, see `run_tick`; the member that goes on."""
    if need == LONGER_LISTS:
        crowd.extend_lists()
        return Packed(member.value._replace(crowd=crowd.argument))
    world.set_seats(crowd.state.tasks.sits_on)
    return member


class _Commands(NamedTuple):
    """Memory of the kernel that repeats commands; (T, 3), by tick."""

    commands: Floats2


@kernel
def _repeat(packed_memory: Any, tick: int, robot: Array, humans: Array, is_present: BoolArray, command: Array) -> None:
    """The command of a tick, 0 after the last one; see `KernelController`."""
    commands = unpack(packed_memory, _Commands).commands
    for axis in range(3):
        command[axis] = commands[tick, axis] if tick < len(commands) else 0.0


class CompiledRun:
    """An episode under a compiled controller, many ticks in one call.

    Args:
        world, crowd: of the episode, with a pedestrian model that is a kernel.
        address, memory: of the controller, see `KernelController`.

    Attributes:
        refused: the last command, if no file can hold it.
    """

    def __init__(self, world: World, crowd: Crowd, address: IntArray, memory: Packed[Any]) -> None:
        self._world, self._crowd, self._address, self._memory = world, crowd, address, memory
        self._member = member_of(world, crowd, np.zeros(1, dtype=np.int64), np.zeros(MEASURED_SIZE))
        length = min(_BLOCK, max(_BLOCK_SIZE // len(world.row), 8))
        self.refused: Twist | None = None
        self._rows, self._commands = np.empty((length, len(world.row))), np.empty((length, 3))

    @classmethod
    def of_commands(cls, world: World, crowd: Crowd, commands: Array) -> CompiledRun:
        """A run that repeats commands, (T, 3), by tick; after them the robot stands."""
        return cls(world, crowd, controller_address(_repeat), Packed(_Commands(commands)))

    def frames(self, first: Snapshot, limit: int | None = None) -> Frames:
        """Run some ticks.

        Args:
            first: snapshot of the present tick.
            limit: maximum number of ticks.

        Returns:
            Their frames; none if the controller's command cannot be recorded, which is then `refused`.
        """
        clock, company = self._member.value.clock, self._crowd.state.company
        clock[0] = self._world.tick  # which may have moved by single ticks in between
        count = np.array([0, company.version[0]])
        arrays = self._address, self._memory.argument, self._rows[:limit], self._commands, count
        need = run_member(self._member.argument, *arrays, DONE)
        while need in (LONGER_LISTS, SEATS):
            self._member = provided(self._member, self._world, self._crowd, need)
            need = run_member(self._member.argument, *arrays, need)
        self.refused = Twist(*self._commands[count[0]].tolist()) if need == NO_COMMAND else None
        if count[0]:
            self._world.note(int(clock[0]), self._crowd)
        rows = self._rows[: count[0]].copy()
        rows.flags.writeable = False
        return Frames(first, rows, self._commands[: count[0]].copy())
