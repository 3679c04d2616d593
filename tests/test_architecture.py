"""The package structure is the one in docs/architecture.toml: imports go down only."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "sonata2d"

TABLE = tomllib.loads((PACKAGE.parent / "docs" / "architecture.toml").read_text())
ROOMS = {room["name"]: room for room in TABLE["package"]}


def imported(node: ast.AST, parts: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """("inside", package of sonata2d) or ("outside", third-party package) for each import of a module."""
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield "outside", alias.name.split(".")[0]
    elif isinstance(node, ast.ImportFrom) and node.level == 0:
        yield "outside", (node.module or "").split(".")[0]
    elif isinstance(node, ast.ImportFrom):
        base = parts[: len(parts) - node.level]
        for alias in node.names:
            target = (*base, *(node.module or alias.name).split("."))
            yield "inside", target[0]


def all_imports() -> set[tuple[str, str, str, str]]:
    """(package, module, "inside" or "outside", what it imports), for every module of sonata2d."""
    found = set()
    for path in [*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.pyi")]:
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        for node in ast.walk(ast.parse(path.read_text())):
            found |= {(parts[0], ".".join(parts), where, name) for where, name in imported(node, parts)}
    return found


IMPORTS = all_imports()


def test_every_package_has_a_place_in_the_table() -> None:
    there = {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"}
    there |= {path.stem for path in PACKAGE.glob("*.py")} - {"__init__"}
    assert there == set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_imports_go_down_only(room: str) -> None:
    here = ROOMS[room]
    allowed = {name for name, other in ROOMS.items() if other["floor"] < here["floor"]}
    allowed |= {room, *here.get("beside", {})}
    wrong = {
        f"{module} imports {name}"
        for r, module, where, name in IMPORTS
        if r == room and where == "inside" and name not in allowed
    }
    assert not wrong


@pytest.mark.parametrize("package", TABLE["restricted"])
def test_third_party_packages_stay_where_the_table_allows_them(package: str) -> None:
    rooms = {room for room, _, where, name in IMPORTS if where == "outside" and name == package}
    assert rooms == {name for name, room in ROOMS.items() if package in room.get("outside", ())}


def test_no_two_modules_import_each_other() -> None:
    """Modules import in a fixed order: the graph of imports at the top of modules has no cycle."""
    order = TopologicalSorter(module_graph())
    order.prepare()  # raises CycleError and names the cycle


def module_graph() -> dict[str, set[str]]:
    """Each module and the modules of sonata2d that it imports at its top level."""
    paths = {".".join(path.relative_to(PACKAGE).with_suffix("").parts): path for path in PACKAGE.rglob("*.py")}
    graph: dict[str, set[str]] = {}
    for module, path in paths.items():
        base = module.split(".")
        nodes = [node for node in ast.parse(path.read_text()).body if isinstance(node, ast.ImportFrom) and node.level]
        wanted = {
            ".".join([*base[: len(base) - node.level], *(node.module or "").split("."), alias.name]).replace("..", ".")
            for node in nodes
            for alias in node.names
        }
        graph[module] = {name if name in paths else name.rpartition(".")[0] for name in wanted} & set(paths)
    return graph


def test_public_names_are_not_names_of_modules() -> None:
    """Importing a module sets an attribute of its package, which would hide a public name that is loaded lazily."""
    for stub in PACKAGE.rglob("__init__.pyi"):
        names = {
            alias.asname
            for node in ast.walk(ast.parse(stub.read_text()))
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        assert not names & {path.stem for path in stub.parent.iterdir()}, stub


@pytest.mark.parametrize("stub", sorted(PACKAGE.rglob("__init__.pyi")), ids=lambda path: path.parent.name)
def test_every_public_name_loads(stub: Path) -> None:
    package = importlib.import_module(".".join(stub.parent.relative_to(PACKAGE.parent).parts))
    assert package.__all__
    for name in package.__all__:
        getattr(package, name)


LOOP = [
    *(path for room in ("core", "agents", "scenegen", "sim", "learning") for path in (PACKAGE / room).rglob("*.py")),
    PACKAGE / "datasets" / "reference_frames.py",  # frames of reference, which learned controllers use in the loop
]
LOOP = [path for path in LOOP if path.name not in ("pyg.py", "picture.py")]  # of recorded graphs only
FIXED = PACKAGE / "learning" / "fixed_point.py"  # fixed point, where no product and no sum is ever rounded


def test_no_global_generator_and_no_wall_clock_inside_the_loop() -> None:
    for path in LOOP:
        text = path.read_text()
        for banned in ("import random", "np.random.default_rng", "np.random.seed", "import time", "datetime"):
            assert banned not in text, f"{path} uses {banned}"


def test_the_loop_uses_no_function_that_differs_between_processors() -> None:
    """Only + - * / sqrt: no libm, no SIMD transcendentals, no BLAS, no pairwise sums."""
    banned_numpy = {
        "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "sin", "cos", "tan", "arcsin", "arccos", "arctan",
        "arctan2", "sinh", "cosh", "tanh", "hypot", "power", "cbrt", "dot", "vdot", "inner", "einsum", "matmul",
        "linalg", "sum", "mean", "std", "var", "average", "cumsum", "prod", "trapezoid",
    }  # fmt: skip
    banned_math = {"exp", "sin", "cos", "tan", "atan2", "atan", "hypot", "pow", "log", "dist", "fsum"}
    for path in [*LOOP, *(PACKAGE / "record" / f"{name}.py" for name in ("canonical", "frames", "recorder"))]:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                banned = {"np": banned_numpy, "math": banned_math}.get(node.value.id, set())
                assert node.attr not in banned, f"{path.name}:{node.lineno} uses {node.value.id}.{node.attr}"
            if isinstance(node, ast.ImportFrom) and node.module == "math":
                names = {alias.name for alias in node.names}
                assert not names & banned_math, f"{path.name} imports {names} from math"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                method = node.func.attr in ("mean", "std", "var", "dot", "cumsum")
                assert not method, f"{path.name}:{node.lineno} calls .{node.func.attr}()"
            refused = ast.Pow if path == FIXED else ast.MatMult | ast.Pow
            assert not (isinstance(node, ast.BinOp) and isinstance(node.op, refused)), (
                f"{path.name}:{node.lineno} uses @ or **"
            )


def test_sums_inside_the_loop_are_not_pairwise() -> None:
    """NumPy adds the first axis row by row, others pairwise in an order of its own: fit for fixed point only."""
    for path in LOOP:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "np.add.reduce" and path != FIXED:
                axes = [ast.unparse(word.value) for word in node.keywords if word.arg == "axis"]
                assert axes == ["0"], f"{path.name}:{node.lineno} adds along another axis than the first"


def test_values_are_rounded_to_fixed_point_in_one_place() -> None:
    for path in LOOP:
        assert ("np.rint" in path.read_text()) == (path == FIXED), path


def test_what_is_installed_is_all_there_is() -> None:
    """A wheel holds every package and every file that is no module."""
    project = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text())["tool"]["setuptools"]
    folders = {path.parent for path in PACKAGE.rglob("__init__.py")}
    packages = {".".join(folder.relative_to(PACKAGE.parent).parts) for folder in folders} | {"sonata2d_cli"}
    assert set(project["packages"]) == packages
    listed = {path for glob in project["package-data"]["sonata2d"] for path in PACKAGE.glob(glob)}
    others = {path for path in PACKAGE.rglob("*") if path.is_file() and path.suffix not in (".py", ".pyc")}
    assert listed == others


def test_import_is_silent_and_opens_no_window() -> None:
    heavy = {"numpy", "pymunk", "pygame", "pydantic", "yaml", "jinja2", "tqdm", "multiprocessing", "sonata2d.core"}
    code = f"import sys, sonata2d; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert done.stderr == ""


def test_reading_a_data_set_loads_no_engine() -> None:
    heavy = {"pymunk", "pygame", "multiprocessing", "sonata2d.sim", "sonata2d.agents", "sonata2d.scenegen"}
    code = "import sys; from sonata2d import read_episode; from sonata2d.datasets import read_manifest;"
    code += f"print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
