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

EPISODE = Path(__file__).parent / "record" / "golden.json"

TABLE = tomllib.loads((PACKAGE.parent / "docs" / "architecture.toml").read_text())
PACKAGES = {package["name"]: package for package in TABLE["package"]}


def imported(node: ast.AST, parts: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """What a node of a module imports.

    Args:
        node: any node of the syntax tree.
        parts: path of the module within sonata2d.

    Yields:
        ("inside", package of sonata2d) or ("outside", third-party package).
    """
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield "outside", alias.name.split(".")[0]
    elif isinstance(node, ast.ImportFrom) and node.level == 0 and (node.module or "").startswith("sonata2d."):
        yield "inside", (node.module or "").split(".")[1]
    elif isinstance(node, ast.ImportFrom) and node.level == 0:
        yield "outside", (node.module or "").split(".")[0]
    elif isinstance(node, ast.ImportFrom):
        base = parts[: len(parts) - node.level]
        for alias in node.names:
            target = (*base, *(node.module or alias.name).split("."))
            yield "inside", target[0]


def all_imports() -> set[tuple[str, str, str, str]]:
    """(package, module, "inside" or "outside", imported package), for all imports of sonata2d."""
    found = set()
    for path in [*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.pyi")]:
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        for node in ast.walk(ast.parse(path.read_text())):
            found |= {(parts[0], ".".join(parts), where, name) for where, name in imported(node, parts)}
    return found


IMPORTS = all_imports()


def test_the_table_lists_every_package() -> None:
    packages = {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"}
    packages |= {path.stem for path in PACKAGE.glob("*.py")} - {"__init__"}
    assert packages == set(PACKAGES)


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_go_down_only(package: str) -> None:
    entry = PACKAGES[package]
    allowed = {name for name, other in PACKAGES.items() if other["floor"] < entry["floor"]}
    allowed |= {package, *entry.get("beside", {})}
    wrong = {
        f"{module} imports {name}"
        for importer, module, where, name in IMPORTS
        if importer == package and where == "inside" and name not in allowed
    }
    assert not wrong


@pytest.mark.parametrize("third_party", TABLE["restricted"])
def test_restricted_third_party_packages_are_imported_where_the_table_allows_it(third_party: str) -> None:
    importers = {package for package, _, where, name in IMPORTS if where == "outside" and name == third_party}
    assert importers == {name for name, package in PACKAGES.items() if third_party in package.get("outside", ())}


def test_module_imports_have_no_cycle() -> None:
    """Considers imports at the top level of modules only."""
    order = TopologicalSorter(module_graph())
    order.prepare()  # raises CycleError and names the cycle


def module_graph() -> dict[str, set[str]]:
    """The modules of sonata2d that each module imports at its top level."""
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


def test_no_public_name_is_the_name_of_a_module() -> None:
    """Importing a module sets an attribute of its package, which would hide a lazily loaded public name."""
    for stub in PACKAGE.rglob("__init__.pyi"):
        names = {
            alias.asname
            for node in ast.walk(ast.parse(stub.read_text()))
            if isinstance(node, ast.ImportFrom) and node.module  # `from . import x` publishes the module itself
            for alias in node.names
        }
        assert not names & {path.stem for path in stub.parent.iterdir()}, stub


@pytest.mark.parametrize("stub", sorted(PACKAGE.rglob("__init__.pyi")), ids=lambda path: path.parent.name)
def test_every_public_name_loads(stub: Path) -> None:
    package = importlib.import_module(".".join(stub.parent.relative_to(PACKAGE.parent).parts))
    assert package.__all__
    for name in package.__all__:
        getattr(package, name)


# Modules that run within a tick.
IN_LOOP = ("core", "agents", "scenegen", "sim", "learning")
LOOP = [path for package in IN_LOOP for path in (PACKAGE / package).rglob("*.py")]
LOOP.append(PACKAGE / "datasets" / "reference_frames.py")  # used by learned controllers
FIXED_POINT = PACKAGE / "learning" / "fixed_point.py"  # fixed-point products and sums are exact in any order


def test_the_loop_uses_no_global_generator_and_no_wall_clock() -> None:
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
    for path in [*LOOP, *(PACKAGE / "record" / f"{name}.py" for name in ("canonical", "recorder"))]:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                banned = {"np": banned_numpy, "math": banned_math}.get(node.value.id, set())
                banned = banned - {"dot"} if path == FIXED_POINT else banned
                assert node.attr not in banned, f"{path.name}:{node.lineno} uses {node.value.id}.{node.attr}"
            if isinstance(node, ast.ImportFrom) and node.module == "math":
                names = {alias.name for alias in node.names}
                assert not names & banned_math, f"{path.name} imports {names} from math"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                is_fixed_point = path == FIXED_POINT and ast.unparse(node.func) == "np.dot"
                method = node.func.attr in ("mean", "std", "var", "dot", "cumsum") and not is_fixed_point
                assert not method, f"{path.name}:{node.lineno} calls .{node.func.attr}()"
            assert not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult | ast.Pow)), (
                f"{path.name}:{node.lineno} uses @ or **"
            )


def test_the_loop_sums_along_the_first_axis_only() -> None:
    """NumPy adds along the first axis in sequence, and along other axes pairwise in an order that can vary."""
    for path in LOOP:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "np.add.reduce":
                axes = [ast.unparse(word.value) for word in node.keywords if word.arg == "axis"]
                assert axes == ["0"], f"{path.name}:{node.lineno} sums along another axis than the first"


def test_only_one_module_rounds_to_fixed_point() -> None:
    """Weights with `np.rint`, values by adding and subtracting 3 * 2^51 units."""
    for path in LOOP:
        for rounding in ("np.rint", "<< 51"):
            assert (rounding in path.read_text()) == (path == FIXED_POINT), path


def test_wheels_contain_every_package_and_every_data_file() -> None:
    project = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text())["tool"]["setuptools"]
    folders = {path.parent for path in PACKAGE.rglob("__init__.py")}
    packages = {".".join(folder.relative_to(PACKAGE.parent).parts) for folder in folders} | {"sonata2d_cli"}
    assert set(project["packages"]) == packages
    listed = {path for glob in project["package-data"]["sonata2d"] for path in PACKAGE.glob(glob)}
    others = {
        path
        for path in PACKAGE.rglob("*")
        if path.is_file() and path.suffix != ".py" and "__pycache__" not in path.parts
    }
    assert listed == others


def test_import_is_silent_and_loads_no_heavy_package() -> None:
    heavy = {"numpy", "numba", "pymunk", "pygame", "pydantic", "yaml", "jinja2", "tqdm", "multiprocessing"}
    heavy |= {"sonata2d.core"}
    code = f"import sys, sonata2d; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert done.stderr == ""


def test_reading_a_data_set_loads_no_simulation() -> None:
    heavy = {"numba", "pymunk", "pygame", "multiprocessing", "sonata2d.sim", "sonata2d.agents", "sonata2d.scenegen"}
    code = "import sys; from sonata2d import read_episode; from sonata2d.datasets import read_manifest;"
    code += f"episode = read_episode({str(EPISODE)!r}); episode.scene; episode.states;"
    code += f"print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
