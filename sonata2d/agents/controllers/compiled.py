"""Compiled controllers, with which whole episodes run without Python between ticks."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property
from inspect import signature
from typing import Any

import numpy as np

from ...core.compiled.calls import FLAGS, FLOATS, FLOATS2, INT, PACKED, address_of
from ...core.compiled.kernel import IS_COMPILED
from ...core.compiled.packing import Packed
from ...core.geometry import Twist
from ...core.portable_math import Array, IntArray
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...core.state import HUMAN_SIZE, ROBOT_SIZE
from ...core.wording import shown
from ...errors import ControllerError
from .base import Controller


class KernelController(Controller):
    """Base class of controllers that are kernels: `Episode.run` calls them without the interpreter.

    Subclasses set `kernel` and define `memory`, which reads the settings when an episode begins: attributes that change
    later have no effect. In `Episode.step`, and where a subclass overrides `act` or `label` or requests images, `act`
    calls the same kernel, with the same bits.

    Attributes:
        kernel: a function with the decorator `kernel`. Its arguments are the packed memory, the number of the tick, the
            robot (13,) and the humans of the scene (N, 9), in the columns of `State.row`, whether each human is present
            (N,), and the command (3,), all of which it writes: vx, vy (m/s), omega (rad/s), body frame. Other robots of
            the scene follow the humans, as people that walk.
    """

    kernel: Callable[..., None]
    robots_as_people = True

    @abstractmethod
    def memory(self, scene: Scene) -> tuple[Any, ...]:
        """The knowledge of the kernel, and what it remembers in an episode: a named tuple, see `packing.pack`."""

    def move_doors(self, memory: Any, openings: Array) -> None:
        """Note in the memory how far the interior doors that move are open; called before the kernel.

        Args:
            memory: of the kernel.
            openings: (D,), of `scene.moving_doors`.
        """

    def reset(self, scene: Scene) -> None:
        if self.partial:
            raise ControllerError(f"{type(self).__name__} is compiled and reads the whole state: it cannot be partial")
        memory = self.memory(scene.with_robots_as_people)
        if not hasattr(memory, "_fields"):
            raise TypeError(f"{type(self).__name__}.memory must return a NamedTuple, got {shown(memory)}")
        self._scene, self._memory = scene, Packed[Any](memory)
        self._everybody = np.ones(len(scene.with_robots_as_people.humans), dtype=bool)

    def act(self, snapshot: Snapshot) -> Twist:
        memory, command = self._memory_for(snapshot.scene), np.empty(3)
        state = (snapshot.with_robots_as_people() if snapshot.scene.robots else snapshot).state
        row = state.row.copy()  # kernels take writeable arrays
        is_present = (self._everybody if state.is_present is None else state.is_present).copy()
        humans = row[ROBOT_SIZE : len(row) - state.door_count].reshape(-1, HUMAN_SIZE)
        if state.door_count:
            self.move_doors(memory.value, state.doors)
        self._kernel(memory.argument, snapshot.tick, row[:ROBOT_SIZE], humans, is_present, command)
        return Twist(*command.tolist())

    @cached_property
    def _kernel(self) -> Any:
        """The kernel.

        Raises:
            TypeError: there is none, or it is a function of another kind.
        """
        kind = type(self)
        kernel = getattr(kind, "kernel", None)  # of the class: not as a method
        name = f"{kind.__name__}.kernel"
        if kernel is None:
            raise TypeError(f"{kind.__name__} needs a kernel: kernel = ..., a function with the decorator `kernel`")
        if IS_COMPILED and not hasattr(kernel, "overloads"):
            raise TypeError(f"{name} is an ordinary function; write @kernel of sonata2d.core.compiled.kernel before it")
        count = len(signature(getattr(kernel, "py_func", kernel)).parameters)
        if count != len(_ARGUMENTS):
            expected = "packed_memory, tick, robot, humans, is_present, command"
            raise TypeError(f"{name} takes {count} arguments; it must take {expected}")
        return kernel

    def _memory_for(self, scene: Scene) -> Packed[Any]:
        """The memory of the episode; made now if a subclass has a `reset` of its own, or there was none."""
        if getattr(self, "_scene", None) is not scene:
            KernelController.reset(self, scene)
        return self._memory

    def compiled(self, scene: Scene) -> tuple[IntArray, Packed[Any]] | None:
        """The address of the kernel and the memory; None if an overridden method or images need the interpreter.

        Args:
            scene: of the episode, for which the controller was reset.
        """
        kind, own = type(self), vars(self)
        is_plain = kind.act is KernelController.act and kind.label is Controller.label and self.image is None
        is_plain = is_plain and not self.sensors and not self.partial and not scene.moving_doors
        if not is_plain or "act" in own or "label" in own:
            return None
        return controller_address(self._kernel), self._memory_for(scene)


_ARGUMENTS = (PACKED, INT, FLOATS, FLOATS2, FLAGS, FLOATS)


def controller_address(kernel: Any) -> IntArray:
    """The address of a `KernelController.kernel`."""
    return address_of(kernel, *_ARGUMENTS)
