"""Compiled kernels: the fallback, and files of machine code that are never out of date.

Each `load` of a plug-in stands for a new process as far as kernels are concerned: it has to load or compile them again.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import pickle
import re
import subprocess
import sys
import threading
import time
import types
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonata2d
from sonata2d.core.compiled import kernel as compiled
from sonata2d.core.compiled.kernel import kernel, subroutine
from sonata2d.core.files import interruption
from sonata2d.core.files.ownership import foreign_access
from sonata2d.errors import KernelError

compiled_only = pytest.mark.skipif(not compiled.IS_COMPILED, reason="kernels are interpreted")
if compiled.IS_COMPILED:
    import numba

    from sonata2d.core.compiled import cache as kernel_cache, key as kernel_key

    CACHED = kernel_cache._location, kernel_cache._is_writable

PACKAGE = Path(sonata2d.__file__).parent
ONE_LINE = re.compile(
    r"sonata2d is compiled for this processor, once per version and feature; this may take a minute \.\.\.\n"
)
WAITING = "another process compiles sonata2d; waiting for it ...\n"

# A plug-in: a package whose kernel uses subroutines and constants of other files.
PLUGIN = {
    "__init__": "",
    "constants": "import numpy as np\nGAIN = 2.0\nLIMIT = 5.0\nTABLE = np.array([1.0, 2.0])\n",
    "parameters": (
        "from typing import NamedTuple\n"
        "class Parameters(NamedTuple):\n"
        "    factor: float\n"
        "    offset: float\n"
        "class Weights(NamedTuple):\n"
        "    near: float\n"
        "    far: float\n"
    ),
    "helpers": (
        "import math\n"
        "from sonata2d.core.compiled.kernel import subroutine\n"
        "from . import constants\n"
        "from .constants import GAIN\n"
        "@subroutine\n"
        "def inner(x, step=1.0):\n"
        "    return math.sqrt(x * x) * GAIN + step\n"
        "@subroutine\n"
        "def outer(x):\n"
        "    '''Docstring.'''\n"
        "    return min(inner(x), constants.LIMIT)\n"
    ),
    "laws": (
        "from sonata2d.core.compiled.kernel import kernel\n"
        "from .constants import TABLE\n"
        "from .helpers import outer\n"
        "from .parameters import Weights\n"
        "@kernel\n"
        "def law(values, parameters):\n"
        "    total = 0.0  # a comment\n"
        "    for k in range(values.shape[0]):\n"
        "        total += outer(values[k]) * parameters.factor + parameters.offset + Weights(TABLE[k], 0.0).near\n"
        "    return total\n"
    ),
}
VALUES = np.array([1.0, 4.0])  # the law gives (3 + 5) * 10 + 2 * 0.5 + 3 = 84


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty folder for kernels."""
    path = tmp_path / "cache"
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(path))
    monkeypatch.setattr(kernel_cache, "_is_announced", False)
    forget_folders()
    yield path / "sonata2d"
    forget_folders()


def forget_folders() -> None:
    for function in CACHED:
        function.cache_clear()


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of the plug-in package `mine`."""
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / "mine"
    path.mkdir()
    for name, text in PLUGIN.items():
        (path / f"{name}.py").write_text(text)
    yield path
    unload()


def unload() -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "mine"]:
        del sys.modules[name]


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))


def load() -> Any:
    """The kernel of the plug-in, as a new process would have it."""
    unload()
    importlib.invalidate_caches()
    sys.dont_write_bytecode, before = True, sys.dont_write_bytecode  # pyc files compare times in whole seconds
    try:
        return importlib.import_module("mine.laws").law
    finally:
        sys.dont_write_bytecode = before


def call(law: Any) -> float:
    parameters = sys.modules["mine.parameters"]
    return float(law(VALUES, parameters.Parameters(factor=10.0, offset=0.5)))


def was_loaded(law: Any) -> bool:
    """Whether a kernel's machine code comes from a file."""
    hits, misses = sum(law.stats.cache_hits.values()), sum(law.stats.cache_misses.values())
    assert hits + misses == 1
    return bool(hits)


def kernels(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.kernel"))


# ---- what is compiled, and what is interpreted


def test_the_interpreter_runs_kernels_where_numba_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    found, backend = compiled._load_numba()
    assert found is None
    assert backend == "interpreted, some 30 times slower than compiled; pip install numba"


@pytest.mark.parametrize(
    ("setting", "platform", "says"), [("0", "linux", True), ("1", "linux", False), ("0", "emscripten", False)]
)
def test_a_missing_numba_is_said_once_where_it_could_be_there(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, setting: str, platform: str, says: bool
) -> None:
    monkeypatch.setenv("NUMBA_DISABLE_JIT", setting)
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(compiled, "IS_COMPILED", False)
    monkeypatch.setattr(compiled, "BACKEND", "interpreted")
    compiled.say_if_slow.cache_clear()
    compiled.say_if_slow()
    compiled.say_if_slow()
    assert caplog.messages == (["the simulation is interpreted"] if says else [])


@pytest.mark.parametrize(
    "error", [ImportError("Numba needs NumPy 2.4 or less"), OSError("libllvmlite.so"), ModuleNotFoundError("llvmlite")]
)
def test_the_interpreter_runs_kernels_where_numba_is_broken(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fail(name: str) -> Any:
        raise error

    monkeypatch.setattr(compiled, "import_module", fail)
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    found, backend = compiled._load_numba()
    assert found is None
    assert str(error) in backend


def test_numba_is_not_imported_where_it_is_disabled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "import_module", None)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert compiled._load_numba() == (None, "interpreted, because NUMBA_DISABLE_JIT is set")


def test_an_interpreted_kernel_is_the_function_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "_numba", None)
    assert kernel(call) is call
    assert subroutine(call) is call


@compiled_only
def test_the_settings_of_numba_can_disable_compilation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    assert compiled._load_numba()[0] is None


@kernel
def factorial(n: int) -> int:
    return 1 if n < 2 else n * factorial(n - 1)


@kernel
def ratio(n: int, k: int) -> float:
    """A kernel that calls another."""
    return factorial(n) / factorial(k)


def test_kernels_call_kernels_and_themselves() -> None:
    assert ratio(5, 3) == 20.0


def test_a_kernel_is_pickled_by_its_name() -> None:
    data = pickle.dumps(ratio)
    assert len(data) < 100
    assert pickle.loads(data) is ratio


@compiled_only
def test_a_kernel_without_a_name_is_pickled_as_a_whole() -> None:
    gain = 3.0

    @kernel
    def scaled(x: float) -> float:
        return gain * x

    assert pickle.loads(pickle.dumps(scaled))(2.0) == 6.0


@compiled_only
def test_kernels_of_sonata2d_can_be_kept() -> None:
    for path in PACKAGE.rglob("*.py"):
        if "@kernel" in path.read_text(encoding="utf-8") and path.name != "compiled.py":
            module = importlib.import_module(".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts))
            for value in vars(module).values():
                if isinstance(getattr(value, "_cache", None), kernel_cache._KernelFiles):
                    kernel_key.key_of(value, ())  # raises NotCacheableError


# ---- which file is used


@compiled_only
def test_a_kernel_is_compiled_once(plugin: Path, folder: Path) -> None:
    law = load()
    assert call(law) == 84.0
    assert not was_loaded(law)
    assert len(kernels(folder)) == 1
    law = load()
    assert call(law) == 84.0
    assert was_loaded(law)
    assert not [path for path in folder.iterdir() if path.suffix in (".tmp", ".lock")]


EDITS = {
    "the kernel": ("laws", "total = 0.0", "total = 6.0", 90.0),
    "a subroutine": ("helpers", "math.sqrt(x * x)", "math.sqrt(x)", 84.0),
    "a default": ("helpers", "step=1.0", "step=0.5", 79.0),
    "a constant": ("constants", "GAIN = 2.0", "GAIN = 1.0", 74.0),
    "an attribute of a module": ("constants", "LIMIT = 5.0", "LIMIT = 6.0", 94.0),
    "an array": ("constants", "[1.0, 2.0]", "[1.0, 3.0]", 85.0),
    "the fields of an argument": (
        "parameters",
        "factor: float\n    offset: float",
        "offset: float\n    factor: float",
        84,
    ),
    "the fields of a named tuple": ("parameters", "near: float\n    far", "far: float\n    near", 81.0),
    "a type": ("constants", "GAIN = 2.0", "GAIN = 2", 84.0),
}


@compiled_only
@pytest.mark.parametrize("edited", EDITS)
def test_an_edited_part_is_compiled_again(plugin: Path, folder: Path, edited: str) -> None:
    name, old, new, expected = EDITS[edited]
    assert call(load()) == 84.0
    edit(plugin / f"{name}.py", old, new)
    law = load()
    assert call(law) == expected
    assert not was_loaded(law)
    edit(plugin / f"{name}.py", new, old)
    law = load()
    assert call(law) == 84.0
    assert was_loaded(law)  # the file of the old version is still there


PACKED = """
from typing import Annotated, Any, NamedTuple
import numpy as np
from numpy.typing import NDArray
from sonata2d.core.compiled.kernel import kernel
from sonata2d.core.compiled.packing import pack, unpack
Column = Annotated[NDArray[np.float64], np.float64, 1]
class Inner(NamedTuple):
    near: Column
    far: Column
class Outer(NamedTuple):
    offset: float
    inner: Inner
@kernel
def law(packed: Any) -> float:
    return unpack(packed, Outer).inner.far[0]
def call() -> float:
    kind = Inner.__annotations__["far"].__metadata__[0]
    near, far = np.array([1], dtype=kind), np.array([2], dtype=kind)
    return float(law(pack(Outer(offset=0.5, inner=Inner(near=near, far=far)))))
"""


@compiled_only
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("near: Column\n    far: Column", "far: Column\n    near: Column"),
        ("np.float64, 1", "np.int64, 1"),
        ("offset: float\n    inner: Inner", "inner: Inner\n    offset: float"),
    ],
    ids=["nested fields", "alias of an array", "fields"],
)
def test_a_packed_argument_of_another_layout_is_compiled_again(plugin: Path, folder: Path, old: str, new: str) -> None:
    def call() -> float:
        return float(sys.modules["mine.laws"].call())

    (plugin / "laws.py").write_text(PACKED)
    law = load()
    assert call() == 2.0
    edit(plugin / "laws.py", old, new)
    law = load()
    assert call() == 2.0
    assert not was_loaded(law)
    edit(plugin / "laws.py", new, old)
    law = load()
    assert call() == 2.0
    assert was_loaded(law)


@compiled_only
def test_comments_docstrings_and_the_place_do_not_matter(plugin: Path, folder: Path) -> None:
    call(load())
    edit(plugin / "laws.py", "  # a comment", "")
    edit(plugin / "helpers.py", "'''Docstring.'''", "'''Another docstring.'''")
    edit(plugin / "helpers.py", "import math\n", "import math\n\n\nUNUSED = 3.0\n")
    law = load()
    assert call(law) == 84.0
    assert was_loaded(law)


@compiled_only
def test_a_constant_replaced_in_one_process_does_not_reach_others(plugin: Path, folder: Path) -> None:
    law = load()
    sys.modules["mine.helpers"].GAIN = 1.0  # type: ignore[attr-defined]
    assert call(law) == 74.0
    assert call(load()) == 84.0


@compiled_only
@pytest.mark.parametrize("setting", ["BOUNDSCHECK", "OPT"])
def test_settings_of_numba_have_their_own_files(
    plugin: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, setting: str
) -> None:
    monkeypatch.setattr(numba.config, setting, type(numba.config.OPT)(2) if setting == "OPT" else 0)
    call(load())
    monkeypatch.setattr(numba.config, setting, type(numba.config.OPT)(1) if setting == "OPT" else 1)
    law = load()
    if setting == "BOUNDSCHECK":
        with pytest.raises(IndexError):
            law(np.zeros(3), sys.modules["mine.parameters"].Parameters(1.0, 1.0))  # the table has two rows
    else:
        call(law)
    assert not was_loaded(law)


@compiled_only
def test_versions_have_their_own_files_but_numbers_of_threads_have_not(
    plugin: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    call(load())
    monkeypatch.setattr(numba.config, "NUMBA_NUM_THREADS", 77)
    law = load()
    call(law)
    assert was_loaded(law)
    monkeypatch.setattr(kernel_key.np, "__version__", "9.9.9")
    law = load()
    call(law)
    assert not was_loaded(law)


@compiled_only
def test_an_edited_intrinsic_is_compiled_again(plugin: Path, folder: Path) -> None:
    (plugin / "helpers.py").write_text(
        "from numba import types\n"
        "from numba.extending import intrinsic\n"
        "@intrinsic\n"
        "def outer(typing_context, x):\n"
        "    def generate(context, builder, signature, arguments):\n"
        "        return builder.fmul(arguments[0], arguments[0])\n"
        "    return types.float64(types.float64), generate\n"
    )
    assert call(load()) == (1 + 16) * 10 + 1 + 3
    law = load()
    assert call(law) == (1 + 16) * 10 + 1 + 3
    assert was_loaded(law)
    edit(plugin / "helpers.py", "fmul", "fadd")
    assert call(load()) == (2 + 8) * 10 + 1 + 3


@compiled_only
def test_a_kernel_that_uses_an_unknown_object_is_not_kept(plugin: Path, folder: Path) -> None:
    (plugin / "helpers.py").write_text("from numba import vectorize\n@vectorize\ndef outer(x): return x * x\n")
    assert call(load()) == (1 + 16) * 10 + 1 + 3
    assert kernels(folder) == []


@compiled_only
def test_functions_typed_in_a_terminal_are_kept_by_their_content(folder: Path) -> None:
    text = (
        "from sonata2d.core.compiled.kernel import kernel, subroutine\n"
        "@subroutine\n"
        "def part(x): return x * GAIN\n"
        "@kernel\n"
        "def whole(x): return part(x) + 1.0\n"
    )
    for gain, expected in ((2.0, 7.0), (3.0, 10.0), (2.0, 7.0)):
        space = {"__name__": "__main__", "GAIN": gain}
        exec(compile(text, "<ipython-input-1>", "exec"), space)
        assert space["whole"](3.0) == expected  # type: ignore[operator]
    assert was_loaded(space["whole"])
    assert len(kernels(folder)) == 2


@compiled_only
def test_names_of_files_are_valid_on_every_system(folder: Path) -> None:
    @kernel
    def größe(x: float) -> float:
        return x

    größe.__module__ = größe.py_func.__module__ = "aux"  # type: ignore[attr-defined]
    assert größe(1.0) == 1.0
    (path,) = kernels(folder)
    assert re.fullmatch(r"[A-Za-z0-9_]{1,48}-[0-9a-f]{32}\.kernel", path.name)


# ---- folders


@compiled_only
def test_kernels_lie_in_the_cache_folder_of_the_user_and_never_in_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder that survives the uninstallation of the package would shadow an editable installation."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    forget_folders()
    folder = kernel_cache.cache_folder()
    assert folder is not None
    assert folder.is_absolute()
    assert not folder.is_relative_to(PACKAGE)
    assert "sonata2d" in folder.parts
    forget_folders()


@compiled_only
def test_kernels_are_loaded_from_a_folder_that_cannot_be_written(
    plugin: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    call(load())
    monkeypatch.setattr(kernel_cache, "writable_folder", lambda: None)
    law = load()
    assert call(law) == 84.0
    assert was_loaded(law)


@compiled_only
def test_kernels_work_without_a_folder(
    plugin: Path, tmp_path: Path, folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "cache").touch()  # a file in the way
    assert kernel_cache.writable_folder() is None
    assert call(load()) == 84.0
    assert call(load()) == 84.0
    (message,) = caplog.messages
    assert re.fullmatch("sonata2d is compiled for this processor, in every process; .*", message)


HARM = b"cos\nmkdir\n(S'harm'\ntR."  # a pickle that makes a folder


def plant(folder: Path) -> None:
    """Replace the files of kernels, with a digest that is right."""
    for path in kernels(folder):
        path.write_bytes(kernel_cache._digest(HARM) + HARM)


@compiled_only
@pytest.mark.skipif(os.name != "posix", reason="needs the modes of POSIX systems")
@pytest.mark.parametrize("place", ["cache", "cache/sonata2d"])
@pytest.mark.parametrize("mode", [0o777, 0o775, 0o1777, 0o757])
def test_files_that_other_users_could_have_written_are_not_loaded(
    plugin: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, place: str, mode: int
) -> None:
    monkeypatch.chdir(plugin.parent)
    call(load())
    plant(folder)
    shared = folder.parent.parent / place
    shared.chmod(mode)
    caplog.clear()
    monkeypatch.setattr(kernel_cache, "_is_announced", False)
    is_safe = mode == 0o1777 and shared != folder  # a parent with the sticky bit, as /tmp
    assert call(load()) == 84.0
    assert Path("harm").exists() == is_safe  # the file was loaded: this is what the check prevents
    if not is_safe:
        remedy = "empty it and run" if shared == folder else "use a folder of your own, or run"
        why = f"other users can write to {shared}; {remedy} chmod go-w {shared}"
        assert caplog.messages == [
            "sonata2d is compiled for this processor, in every process; this may take a minute "
            f"(machine code is not kept: {why}) ..."
        ]


@pytest.mark.skipif(os.name != "posix", reason="needs links and modes of POSIX systems")
def test_links_are_followed_step_by_step(tmp_path: Path) -> None:
    """A link in a folder that others can write to could lead elsewhere tomorrow."""
    (tmp_path / "own" / "kernels").mkdir(parents=True)
    shared = tmp_path / "shared"
    shared.mkdir()
    (shared / "second").symlink_to(tmp_path / "own")
    (tmp_path / "first").symlink_to("own/../shared/second")
    folder = tmp_path / "first" / "kernels"
    assert foreign_access(folder) is None
    shared.chmod(0o777)
    reason = f"other users can write to {shared}; use a folder of your own, or run chmod go-w {shared}"
    assert foreign_access(folder) == reason
    shared.chmod(0o1777)  # as /tmp: nobody can rename another user's entries
    assert foreign_access(folder) is None
    (tmp_path / "own" / "kernels").chmod(0o775)
    assert foreign_access(folder) == (
        f"other users can write to {tmp_path}/own/kernels; empty it and run chmod go-w {tmp_path}/own/kernels"
    )
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    assert "too many levels of symbolic links" in (foreign_access(tmp_path / "a") or "").lower()


@compiled_only
@pytest.mark.skipif(os.name != "posix", reason="needs the owners of POSIX systems")
def test_a_folder_or_a_link_of_another_user_is_not_used(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert kernel_cache.writable_folder() == folder
    assert folder.stat().st_mode & 0o777 == 0o700
    assert folder.parent.stat().st_mode & 0o777 == 0o700
    link = tmp_path / "link"
    link.symlink_to(folder.parent)
    assert foreign_access(link) is None
    stranger = os.geteuid() + 1
    real = Path.lstat

    def lstat(path: Path) -> os.stat_result:
        found = real(path)
        return os.stat_result((*found[:4], stranger, *found[5:])) if path == foreign else found

    monkeypatch.setattr(Path, "lstat", lstat)
    for foreign in (folder, folder.parent, tmp_path, link):
        reason = f"{foreign} belongs to another user ({stranger}); use a folder of your own"
        assert foreign_access(link / "sonata2d") == reason
        if foreign != link:
            assert kernel_cache.writable_folder() is None
            assert kernel_cache.reason_without_folder() == reason


@compiled_only
@pytest.mark.skipif(os.name != "posix", reason="needs links, pipes and modes of POSIX systems")
@pytest.mark.parametrize("kind", ["link", "pipe", "writable by others"])
def test_a_kernel_is_loaded_from_a_regular_file_of_the_user_only(
    plugin: Path, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.chdir(tmp_path)
    call(load())
    plant(folder)
    (path,) = kernels(folder)
    if kind == "writable by others":
        path.chmod(0o666)
    else:
        path.rename(tmp_path / "planted")
        path.symlink_to(tmp_path / "planted") if kind == "link" else os.mkfifo(path)
    assert call(load()) == 84.0
    assert not Path("harm").exists()
    law = load()
    assert call(law) == 84.0
    assert was_loaded(law)  # the file was replaced


@compiled_only
@pytest.mark.parametrize("damage", [b"", b"x", None])
def test_a_damaged_file_is_replaced(plugin: Path, folder: Path, damage: bytes | None) -> None:
    call(load())
    (path,) = kernels(folder)
    content = path.read_bytes()
    path.write_bytes(content[:-1] if damage is None else damage)
    law = load()
    assert call(law) == 84.0
    assert not was_loaded(law)
    law = load()
    call(law)
    assert was_loaded(law)


@compiled_only
def test_a_deleted_folder_is_made_again(plugin: Path, folder: Path) -> None:
    law = load()
    call(law)
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()
    assert call(law) == 84.0  # in memory
    assert call(load()) == 84.0
    assert len(kernels(folder)) == 1


@compiled_only
def test_old_files_are_deleted(plugin: Path, folder: Path) -> None:
    folder.mkdir(parents=True)
    now = time.time()
    ages = {f"mine_laws_law-{k:032x}.kernel": 60.0 * (k + 1) for k in range(30)}  # versions of the same kernel
    ages |= {f"other-{0:032x}.kernel": 86400.0 * 10, f"other-{1:032x}.kernel": 86400.0 * 100, "other-2.tmp": 1e8}
    for name, age in ages.items():
        (folder / name).touch()
        os.utime(folder / name, (now - age, now - age))
    call(load())
    names = {path.name for path in folder.iterdir()}
    assert {f"mine_laws_law-{k:032x}.kernel" for k in range(15)} < names
    assert {name for name in names if not name.startswith("mine")} == {kernel_cache.STAMP, f"other-{0:032x}.kernel"}
    assert len(names) == 16 + 2
    law = load()
    call(law)
    assert was_loaded(law)


@compiled_only
def test_nothing_is_compiled_after_a_request_to_stop(
    plugin: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(interruption, "_is_stop_requested", lambda: True)
    with pytest.raises(KeyboardInterrupt):
        call(load())
    assert not kernels(folder)


@compiled_only
def test_an_error_of_compilation_is_one_line_with_its_place(plugin: Path, folder: Path) -> None:
    helpers = plugin / "helpers.py"
    helpers.write_text(helpers.read_text().replace("return math.sqrt(x * x) * GAIN + step", "return x.lower()"))
    with pytest.raises(KernelError) as caught:
        call(load())
    assert str(caught.value) == (
        "mine.laws.law cannot be compiled: Unknown attribute 'lower' of type float64 (helpers.py, line 7); "
        "NUMBA_DISABLE_JIT=1 runs it as ordinary Python"
    )
    assert "nopython" in str(caught.value.__cause__)


# ---- threads and processes


@compiled_only
def test_threads_may_call_an_uncompiled_kernel_together(plugin: Path, folder: Path) -> None:
    law = load()
    start = threading.Barrier(6)

    @numba.njit
    def others(values: Any, parameters: Any) -> Any:  # of another user of numba: takes numba's lock first
        return law(values, parameters)

    def call_it(function: Any) -> float:
        start.wait()
        return call(function)

    with ThreadPoolExecutor(6) as pool:
        assert list(pool.map(call_it, [law, others] * 3)) == [84.0] * 6
    assert not was_loaded(law)


@compiled_only
def test_a_kernel_releases_the_lock_of_the_interpreter(folder: Path) -> None:
    @kernel
    def wait(started: Any, answer: Any, n: int) -> bool:
        for _ in range(n):
            started[0] += 1  # a write in each round, so that the answer is read anew in each
            if answer[0] != 0:
                return True
        return False

    started, answer = np.zeros(1, np.int64), np.ones(1, np.int64)
    assert wait(started, answer, 1)
    started[0] = answer[0] = 0
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(wait, started, answer, 5_000_000_000)
        while started[0] == 0:
            pass
        answer[0] = 1  # only while the kernel runs, which needs the lock
        assert waiting.result()


def run(script: Path, *arguments: str, cache: Path) -> subprocess.Popen[str]:
    """Start a script with an own cache folder."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-W", "error", str(script), *arguments]
    return subprocess.Popen(
        command, env=environment, cwd=script.parent, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@compiled_only
def test_processes_that_start_together_compile_once(plugin: Path, tmp_path: Path) -> None:
    script = tmp_path / "start.py"
    script.write_text(
        "import pathlib, sys, time\n"
        "import numpy as np\n"
        "from mine.laws import law\n"
        "from mine.parameters import Parameters\n"
        "pathlib.Path(f'ready{sys.argv[1]}').touch()\n"
        "while not pathlib.Path('go').exists(): time.sleep(0.001)\n"
        "print(law(np.array([1.0, 4.0]), Parameters(10.0, 0.5)), sum(law.stats.cache_hits.values()))\n"
    )
    processes = [run(script, str(k), cache=tmp_path / "cache") for k in range(3)]
    while len(list(tmp_path.glob("ready*"))) < 3 and all(process.poll() is None for process in processes):
        time.sleep(0.01)
    (tmp_path / "go").touch()
    results = [process.communicate() for process in processes]
    assert sorted(output for output, _ in results) == ["84.0 0\n", "84.0 1\n", "84.0 1\n"]
    said = "".join(errors for _, errors in results)
    assert ONE_LINE.fullmatch(said.replace(WAITING, "", 1))  # on a slow machine
    # A later process says nothing.
    assert run(script, "again", cache=tmp_path / "cache").communicate() == ("84.0 1\n", "")


@compiled_only
@pytest.mark.parametrize("method", sorted({"spawn", "fork"} & {*multiprocessing.get_all_start_methods()}))
def test_worker_processes_get_kernels_and_do_not_repeat_the_announcement(tmp_path: Path, method: str) -> None:
    if method == "fork" and sys.version_info >= (3, 12):
        pytest.skip("warns in processes with threads")
    script = tmp_path / "pool.py"
    script.write_text(
        "import multiprocessing, sys\n"
        "from sonata2d.core.compiled.kernel import kernel\n"
        "@kernel\n"
        "def square(x): return x * x\n"
        "if __name__ == '__main__':\n"
        "    with multiprocessing.get_context(sys.argv[1]).Pool(2) as pool:\n"
        "        print(pool.map(square, [1, 2, 3], chunksize=1))\n"
        "        print(square(4.0))\n"
    )
    output, errors = run(script, method, cache=tmp_path / "cache").communicate()
    assert output == "[1, 4, 9]\n16.0\n"
    assert ONE_LINE.fullmatch(errors)


@compiled_only
def test_plugins_of_the_same_name_do_not_share_subroutines(tmp_path: Path) -> None:
    """Numba gives the subroutines the same symbol, and the linker takes the first of them."""
    for name, gain in (("first", 2.0), ("second", 3.0)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "plug.py").write_text(
            "from sonata2d.core.compiled.kernel import kernel, subroutine\n"
            "@subroutine\n"
            "def part(x, n):  # recursive, so that it is not inlined\n"
            f"    return x if n == 0 else part(x, n - 1) * {gain}\n"
            "@kernel\n"
            f"def {name}(x, n): return part(x, n)\n"
        )
    script = tmp_path / "both.py"
    script.write_text(
        "import importlib, sys\n"
        "for name in sys.argv[1:]:\n"
        "    sys.path.insert(0, name)\n"
        "    law = getattr(importlib.import_module('plug'), name)\n"
        "    print(law(1.0, 5), sum(law.stats.cache_hits.values()))\n"
        "    del sys.path[0], sys.modules['plug']\n"
    )
    cache = tmp_path / "cache"
    assert run(script, "first", cache=cache).communicate()[0] == "32.0 0\n"
    assert run(script, "second", cache=cache).communicate()[0] == "243.0 0\n"
    assert run(script, "first", "second", cache=cache).communicate()[0] == "32.0 1\n243.0 1\n"


def test_each_cell_of_a_notebook_says_why_it_waits(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    shell = types.SimpleNamespace(kernel=object(), execution_count=1)
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: shell))
    for count in (1, 1, 2, 2, 3):
        shell.execution_count = count
        kernel_cache._announce(is_kept=True)
    said = [record for record in caplog.records if "is compiled for this processor" in record.message]
    assert len(said) == 3


@compiled_only
@pytest.mark.parametrize(("parent", "said"), [(None, [WAITING.strip()]), (object(), [])])
def test_workers_do_not_report_that_they_wait_for_one_another(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, parent: object, said: list[str]
) -> None:
    import filelock

    monkeypatch.setattr(multiprocessing, "parent_process", lambda: parent)
    monkeypatch.setattr(kernel_cache, "_SILENT_WAIT", 0.02)
    monkeypatch.setattr(kernel_cache, "_LOCK_TIMEOUT", 0.02)
    location = kernel_cache.writable_folder()
    assert location is not None
    with filelock.FileLock(location / "some.lock"), kernel_cache._locked("some"):
        pass
    assert caplog.messages == said
