"""Mutation testing: a surviving mutant, a small change of the code that no test notices, is a missing test.

    pip install cosmic-ray
    python -m tests.mutants metrics --count 150 --seed 1

Cosmic Ray makes the changes (other operators, comparisons and numbers, negated conditions, loops without iterations);
each runs the tests of its subject in a copy of the repository. Changes of annotations, of decorators of classes
and of names of caught exceptions are left out.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import itertools
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from random import Random
from typing import NamedTuple

import click
import cosmic_ray.plugins
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code

ROOT = Path(__file__).parents[1]
TIMEOUT = 300  # s, of the tests of one mutant; one that never ends is noticed
_LEFT_OUT = ("core/RemoveDecorator", "core/ExceptionReplacer")  # the second fails on dotted names, cosmic-ray 8.7.0
_OF_BITS = ("LShift", "RShift", "BitOr", "BitAnd", "BitXor")  # on floats these fail in any test


class Subject(NamedTuple):
    """What is changed and tested.

    Attributes:
        modules: pattern of the files that are changed, from the folder of the package.
        tests: files and folders of tests, from the folder of the tests; those that notice most come first.
        left_out: files that match `modules` and are not changed, without suffix.
        interpreted: whether kernels run as Python code, which is sooner than to compile each mutant of a kernel.
    """

    modules: str
    tests: str
    left_out: str = ""
    interpreted: bool = False


SUBJECTS = {
    "check": Subject(
        "datasets/check/*.py",
        "datasets/test_plausibility.py datasets/test_check.py datasets/test_replay.py datasets/test_shards.py archive "
        "cli/test_bad_input.py::test_rerun_says_that_the_code_has_changed",
    ),
    "guard": Subject(
        "sim/kernel/safety.py", "sim/test_guard.py sim/test_world.py sim/test_episode.py", interpreted=True
    ),
    "metrics": Subject(
        "metrics/*.py", "metrics", "catalogue definition evaluating evaluation_page exemplars templates"
    ),
}


class Mutant(NamedTuple):
    """One change of one file."""

    path: str
    line: int
    operator: str
    code: str
    diff: str


def mutants_of(paths: list[Path], rng: Random) -> Iterator[Mutant]:
    """Mutants at all places that can be changed, one at each, in random order."""
    places: dict[tuple[Path, tuple[int, int]], list[tuple[str, int]]] = {}
    for path in paths:
        tree = get_ast(path.read_text("utf-8"))
        for name in sorted(set(cosmic_ray.plugins.operator_names()) - set(_LEFT_OUT)):
            kind, (*_, old, new) = cosmic_ray.plugins.get_operator(name), f"_{name}".split("_")
            if kind.arguments() or (new in _OF_BITS and old not in _OF_BITS):
                continue
            starts = [start for node in ast_nodes(tree) for start, _ in kind().mutation_positions(node)]
            for occurrence, start in enumerate(starts):
                places.setdefault((path, start), []).append((name, occurrence))
    for path, start in rng.sample(sorted(places), len(places)):
        name, occurrence = rng.choice(places[path, start])
        code = path.read_text("utf-8")
        changed = mutate_code(code, cosmic_ray.plugins.get_operator(name)(), occurrence)
        if changed is None or _meaning(changed) in (_meaning(code), None):
            continue
        diff = difflib.unified_diff(code.splitlines(), changed.splitlines(), lineterm="", n=0)
        yield Mutant(str(path.relative_to(ROOT)), start[0], name, changed, "\n".join([*diff][3:]))


def _meaning(code: str) -> str | None:
    """The syntax tree without annotations and decorators of classes; None if the code has none."""
    try:
        tree = ast.parse(code)
    except SyntaxError:
        return None
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            node.decorator_list = []
        for name in ("annotation", "returns"):
            if getattr(node, name, None) is not None:
                setattr(node, name, ast.Constant(None))
    return ast.dump(tree)


def survives(folder: Path, mutant: Mutant, subject: Subject) -> bool:
    """Whether all tests pass with a mutant in a copy of the repository."""
    path = folder / mutant.path
    original = path.read_bytes()
    path.write_text(mutant.code, "utf-8")
    try:
        return passes(folder, subject, path.stem)
    finally:
        path.write_bytes(original)


def passes(folder: Path, subject: Subject, module: str = "") -> bool:
    """Whether the tests of a subject pass in a copy of the repository; those that are named as `module` run first."""
    tests = [folder / "tests" / name for name in subject.tests.split()]
    files = [file for test in tests for file in (sorted(test.glob("test_*.py")) if test.is_dir() else [test])]
    files.sort(key=lambda file: not module or module not in file.name)
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["NUMBA_CACHE_DIR"] = str(folder / ".kernels")
    if subject.interpreted:
        environment["NUMBA_DISABLE_JIT"] = "1"
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-n", "0"]
    command += map(str, files)
    # A session of its own, so that the processes that a test started end with it.
    process = subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, process_group=0
    )
    try:
        return process.wait(TIMEOUT) == 0
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, 9)
        process.wait()
        return False


def main() -> int:
    """Test a sample of mutants; 1 if one survives."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("subject", choices=SUBJECTS)
    parser.add_argument("--count", type=int, default=150, help="mutants, at different places (default 150)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default 1)")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="copies of the repository (default: cores)")
    options = parser.parse_args()
    subject, rng = SUBJECTS[options.subject], Random(options.seed)
    paths = [p for p in sorted(ROOT.glob(f"sonata2d/{subject.modules}")) if p.stem not in subject.left_out.split()]
    chosen = [*itertools.islice(mutants_of(paths, rng), options.count)]
    survivors = []
    with tempfile.TemporaryDirectory(prefix="sonata2d-mutants-") as root:
        copies: Queue[Path] = Queue()
        for number in range(options.workers):
            folder = Path(root, str(number))
            shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(".*", "__pycache__", "*.egg-info"))
            copies.put(folder)
            if not passes(folder, subject):
                raise SystemExit(f"the tests fail without a mutant: {subject.tests}")

        def test(mutant: Mutant) -> tuple[Mutant, bool]:
            folder = copies.get()
            try:
                return mutant, survives(folder, mutant, subject)
            finally:
                copies.put(folder)

        with ThreadPoolExecutor(options.workers) as threads:
            for number, (mutant, survived) in enumerate(threads.map(test, chosen), 1):
                if survived:
                    survivors.append(mutant)
                    click.echo(f"{mutant.path}:{mutant.line}: survived, {mutant.operator}\n{mutant.diff}")
                if number % 10 == 0:
                    click.echo(f"{number - len(survivors)} of {number} killed")
    killed = len(chosen) - len(survivors)
    click.echo(f"{killed} of {len(chosen)} mutants killed ({killed / len(chosen):.0%})")
    return bool(survivors)


if __name__ == "__main__":
    sys.exit(main())
