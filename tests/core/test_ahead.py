"""Kernels that a process compiles while it waits for another one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sonata2d.core.compiled import ahead
from sonata2d.core.compiled.kernel import IS_COMPILED, kernel

pytestmark = pytest.mark.skipif(not IS_COMPILED, reason="kernels are interpreted")

USED = """
import sys
from pathlib import Path
from sonata2d.core.compiled import ahead, cache

ahead.is_listed = lambda kernel: False  # a kernel that was compiled ahead is called without `compile`
used, compile = set(), cache._KernelFiles.compile


def noted(self, signature):
    used.add((f"{self._kernel.__module__}.{self._kernel.__name__}".removeprefix("sonata2d."), str(signature)))
    return compile(self, signature)


cache._KernelFiles.compile = noted
import sonata2d as s2

s2.generate_dataset(Path(sys.argv[1]), "sonata-2020", "social-planner", episodes=3)
for name, signature in sorted(used):
    print(name, signature, sep="|")
"""


def test_the_list_names_what_a_first_data_set_needs(tmp_path: Path) -> None:
    arguments = [sys.executable, "-c", USED, str(tmp_path / "data")]
    run = subprocess.run(arguments, capture_output=True, text=True, check=True)
    used = dict(line.split("|") for line in run.stdout.splitlines() if "|" in line)
    listed = dict(map(ahead.types_of, ahead.KERNELS.strip().splitlines()))
    assert {name: str(types) for name, types in listed.items()} == {name: used.get(name) for name in listed}
    assert len(listed) > 0.8 * len(used)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder of kernels."""
    (folder := tmp_path / "kernels").mkdir(mode=0o700)
    monkeypatch.setattr("sonata2d.core.compiled.cache._location", lambda: folder)
    return folder


@pytest.fixture
def kernels(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Two small kernels in a list of their own."""

    def double(values):  # type: ignore[no-untyped-def]
        return 2.0 * values[0]

    def triple(values):  # type: ignore[no-untyped-def]
        return 3.0 * values[0]

    module = SimpleNamespace(double=kernel(double), triple=kernel(triple))
    monkeypatch.setattr(ahead, "_lines", ["numbers.double F1", "numbers.triple F1"])
    monkeypatch.setattr(ahead, "import_module", {"sonata2d.numbers": module}.__getitem__)
    monkeypatch.setattr(ahead, "is_listed", lambda _: True)
    return module


def test_the_time_of_waiting_is_used_for_other_kernels(
    folder: Path, kernels: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    filelock, values = pytest.importorskip("filelock"), np.ones(1)
    files = kernels.double._cache
    other = filelock.FileLock(folder / f"{files._name(ahead.types_of('x F1')[1])}.lock")  # of another process
    other.acquire()
    compile_one, results = ahead.compile_one, list[bool]()

    def compiled_one() -> bool:
        results.append(compile_one())
        other.release()
        return results[-1]

    monkeypatch.setattr(ahead, "compile_one", compiled_one)
    assert kernels.double(values) == 2.0
    assert results == [True]
    names = sorted(path.name for path in folder.glob("*.kernel"))
    assert ["double" in names[0], "triple" in names[1]] == [True, True]
    assert compile_one() is False  # all are there
    assert not [*folder.glob("*.lock")]


def test_a_kernel_that_another_process_compiles_is_left_to_it(folder: Path, kernels: SimpleNamespace) -> None:
    filelock, (_, types) = pytest.importorskip("filelock"), ahead.types_of("x F1")
    with filelock.FileLock(folder / f"{kernels.double._cache._name(types)}.lock"):
        assert not kernels.double._cache.compile_if_free(types)
    assert kernels.double._cache.compile_if_free(types)
    assert not kernels.double._cache.compile_if_free(types)
