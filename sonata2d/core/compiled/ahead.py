"""Kernels that a first data set needs, which a process compiles while it waits for another one.

The first run on a machine compiles some forty kernels. Of several workers that come to the same kernel, one compiles
it; the others use the time for those that come later and take longest.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

# Module and name, and the types of the arguments: f, i and b are numbers and flags; F, I and B arrays of them, and R
# read-only arrays of floats, with their dimensions. Those that take longest are first. A test compares the list with
# what the first example of README needs.
KERNELS = """
agents.pedestrians.crowd.prepare I1 i F2
agents.pedestrians.decisions.destinations.choose_destination I1 i i
sim.kernel.step.advance I1 f f f b i i
agents.controllers.planner._plan I1 i F1 F2 B1 F1
agents.pedestrians.decisions.tasks.advance_tasks I1 i
sim.kernel.tick.run_tick I1 I1 I1 i f f f b
agents.pedestrians.models.sonata2026._accelerations I1 I1 F2 f f F2
core.path_search.find_path I1 I1 f f f f F2 F1
core.visibility.find_row I1 I1 i f f I1
agents.pedestrians.decisions.tasks.find_obstacles I1 b
agents.controllers.cost_field._fill_field F3 F1 R2 R2 R2 R2 F2 I2 f f f
agents.pedestrians.decisions.congestion.avoid_queues I1 i
agents.pedestrians.decisions.tasks.start_stay I1 i f f f i
agents.pedestrians.decisions.destinations.start_straight I1
agents.pedestrians.passages._find_frames I1 F2 F2 F2
sim.kernel.batch.run_member I1 I1 I1 F2 F2 I1 i
core.visibility.find_nodes I1
agents.pedestrians.decisions.stops.start_stops I1 i
agents.pedestrians.passages._find_ends I1 F2
agents.pedestrians.decisions.destinations.find_new_paths I1 i
core.visibility.complete I1 I1
agents.pedestrians.decisions.tasks.leave I1 i i
agents.pedestrians.decisions.acts.send I1 i f f
agents.pedestrians.decisions.acts.plan_path I1 i f f f f F2
agents.pedestrians.decisions.tasks.begin I1 I1 I1
agents.pedestrians.decisions.acts.stand I1 i f f f f i b
sim.kernel.step.begin I1
agents.pedestrians.crowd.accelerate I1
agents.drives.built_in._limit_to_limits F1 F1 F1 F1 F1 f
sim.kernel.step.read_state I1
core.free_space.check_place I1 f f f f
core.free_space.check_line I1 f f f f
core.philox._fill_words I1 i i
agents.pedestrians.decisions.tasks.update_partners I1
core.barrier_grid._fill R2 f f f i i I1 I1
core.outlines.has_space_at f f f F2 R2 F2 F2 f
"""
_lines = KERNELS.strip().splitlines()


def is_listed(kernel: Any) -> bool:
    """Whether a kernel is in the list."""
    name = f"{kernel.__module__.partition('.')[2]}.{kernel.__name__} "
    return any(line.startswith(name) for line in _lines)


def compile_one() -> bool:
    """Compile the first kernel of the list that is not there and not being compiled; False if there is none."""
    for line in _lines:
        name, types = types_of(line)
        module, _, function = name.rpartition(".")
        if getattr(import_module(f"sonata2d.{module}"), function)._cache.compile_if_free(types):
            return True
    return False


def types_of(line: str) -> tuple[str, tuple[Any, ...]]:
    """The dotted name of a kernel of the list, and the types of its arguments."""
    from numba import types

    number = {"f": types.float64, "i": types.int64, "b": types.boolean}
    name, *kinds = line.split()
    arguments = [
        number[kind]
        if len(kind) == 1
        else types.Array(number.get(kind[0].lower(), types.float64), int(kind[1]), "C", readonly=kind[0] == "R")
        for kind in kinds
    ]
    return name, tuple(arguments)
