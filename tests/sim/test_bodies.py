"""Bodies and shapes leave their space before they are freed, however their world ends; if not, the process ends."""

from __future__ import annotations

import subprocess
import sys

import pytest

IN_CYCLES = """
import dataclasses, gc
import sonata2d as s2
from sonata2d.sim.world import World

scene = s2.generate("sonata-2020", seed=5)
person = dataclasses.replace(scene.humans[0], behaviour="wandering", seat=scene.furniture[0].id)  # no seat
wrong = dataclasses.replace(scene, humans=(person, *scene.humans[1:]))


class Owner:
    pass


def make(scene):
    owner = Owner()
    owner.itself = owner
    try:
        owner.world = World(scene)
    except ValueError as error:
        owner.error = error  # whose traceback refers to this frame, and so to the world


for k in range(60):
    make(wrong if k % 2 else scene)
gc.collect()
print("done")
"""

INTERRUPTED = """
import gc, sys
import sonata2d as s2
from sonata2d.sim.bodies import Bodies

scene = s2.generate("sonata-2020", seed=3)


def interrupted_at(number, function):
    lines = 0

    def in_lines(frame, event, argument):
        nonlocal lines
        lines += event == "line"
        if lines == number:
            sys.settrace(None)
            raise KeyboardInterrupt
        return in_lines

    bodies = Bodies(scene)
    bodies.new_space()
    sys.settrace(lambda frame, event, argument: in_lines if frame.f_code.co_name == function else None)
    try:
        bodies.new_space()
    except KeyboardInterrupt:
        bodies.new_space()
        return True
    finally:
        sys.settrace(None)
    return False


for function in ("new_space", "leave"):
    number = 1
    while interrupted_at(number, function):
        number += 1
    assert number > 20, function
gc.collect()
print("done")
"""


@pytest.mark.parametrize("program", [IN_CYCLES, INTERRUPTED], ids=["garbage in cycles", "interruptions"])
def test_worlds_end_without_a_fault(program: str) -> None:
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout.strip()) == (0, "done"), run.stderr[-2000:]
