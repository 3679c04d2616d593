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


MODULES = {
    ".".join(part for part in path.relative_to(PACKAGE).with_suffix("").parts if part != "__init__") or "sonata2d"
    for path in PACKAGE.rglob("*.py")
}

LATE = {(entry["importer"], imported) for entry in TABLE["late"] for imported in entry["imported"]}


def imported(node: ast.AST, parts: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """The imports of a statement.

    Args:
        node: any node of the syntax tree.
        parts: path of the module within sonata2d.

    Yields:
        ("inside", module of sonata2d) or ("outside", third-party package).
    """
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield "outside", alias.name.split(".")[0]
    elif isinstance(node, ast.ImportFrom) and node.level == 0 and not (node.module or "").startswith("sonata2d."):
        yield "outside", (node.module or "").split(".")[0]
    elif isinstance(node, ast.ImportFrom):
        base = parts[: len(parts) - node.level] if node.level else ()
        package = ".".join([*base, *(node.module or "").removeprefix("sonata2d.").split(".")]).strip(".")
        for alias in node.names:
            module = f"{package}.{alias.name}".strip(".")
            yield "inside", module if module in MODULES else package


def imported_by_name(tree: ast.Module) -> Iterator[str]:
    """The modules of sonata2d that a module names in a text: an argument of `import_module`, or `"module:object"`.

    A text may be an f-string that begins with a constant of the module.
    """
    constants = {
        target.id: node.value.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name)
    }

    def text_of(node: ast.AST) -> str:
        if isinstance(node, ast.JoinedStr):
            return "".join(text_of(part) for part in node.values)
        if isinstance(node, ast.FormattedValue) and isinstance(node.value, ast.Name):
            return str(constants.get(node.value.id, ""))
        return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""

    for node in ast.walk(tree):
        names = [text_of(node).rpartition(":")[0]]
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            names += [text_of(argument) for argument in node.args]
        for name in names:
            if name.startswith("sonata2d.") and name.removeprefix("sonata2d.") in MODULES:
                yield name.removeprefix("sonata2d.")


def all_imports() -> set[tuple[str, str, str]]:
    """(module, "inside" or "outside", imported module or third-party package), for all imports of sonata2d.

    Imports inside functions, of types only and by name are included.
    """
    imports = set()
    for path in [*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.pyi")]:
        parts, tree = path.relative_to(PACKAGE).with_suffix("").parts, ast.parse(path.read_text())
        module = ".".join(part for part in parts if part != "__init__") or "sonata2d"
        imports |= {(module, *found) for node in ast.walk(tree) for found in imported(node, parts)}
        imports |= {(module, "inside", name) for name in imported_by_name(tree)}
    return imports


def is_late(importer: str, module: str) -> bool:
    """Whether the table lists an import, by the name of the imported module or of a package that contains it."""
    return any(entry == importer and (module == listed or module.startswith(f"{listed}.")) for entry, listed in LATE)


IMPORTS = all_imports()
INSIDE = {(importer, module) for importer, where, module in IMPORTS if where == "inside"}


def test_the_table_lists_every_package() -> None:
    packages = {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"}
    packages |= {path.stem for path in PACKAGE.glob("*.py")} - {"__init__"}
    assert packages == set(PACKAGES)


def goes_down(importer: str, module: str) -> bool:
    """Whether an import stays in its package, or leads to a package that the table allows."""
    package, other = importer.split(".")[0], module.split(".")[0]
    entry = PACKAGES[package]
    return other == package or other in entry.get("beside", {}) or PACKAGES[other]["floor"] < entry["floor"]


def test_imports_go_down_only() -> None:
    """Holds wherever an import stands, unless `late` in the table lists it."""
    wrong = {pair for pair in INSIDE if pair[0] != "sonata2d" and not goes_down(*pair)}
    assert not {f"{importer} imports {module}" for importer, module in wrong if not is_late(importer, module)}


def test_imports_have_no_cycle() -> None:
    """Considers all imports, also those inside functions and of types only, without the listed late ones."""
    order = TopologicalSorter(graph_of({pair for pair in INSIDE if not is_late(*pair)}))
    order.prepare()  # raises CycleError and names the cycle


def test_every_listed_late_import_goes_up_or_closes_a_cycle() -> None:
    for importer, listed in LATE:
        pairs = {(a, b) for a, b in INSIDE if a == importer and f"{b}.".startswith(f"{listed}.")}
        above = {pair for pair in pairs if not goes_down(*pair)}
        assert above or any(importer in reachable(module) for _, module in pairs), f"{importer} imports no {listed}"


def reachable(module: str) -> set[str]:
    """The modules that a module imports, directly or through others."""
    graph, reached, remaining = graph_of(INSIDE), set[str](), [module]
    while remaining:
        for following in graph.get(remaining.pop(), set()) - reached:
            reached.add(following)
            remaining.append(following)
    return reached


def graph_of(pairs: set[tuple[str, str]]) -> dict[str, set[str]]:
    """The imported modules of each module."""
    graph: dict[str, set[str]] = {}
    for importer, module in pairs:
        if importer != module:
            graph.setdefault(importer, set()).add(module)
    return graph


@pytest.mark.parametrize("third_party", TABLE["restricted"])
def test_restricted_third_party_packages_are_imported_where_the_table_allows_it(third_party: str) -> None:
    importers = {module.split(".")[0] for module, where, name in IMPORTS if where == "outside" and name == third_party}
    assert importers == {name for name, package in PACKAGES.items() if third_party in package.get("outside", ())}


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
LOOP = [path for path in LOOP if path.parent.name != "maps"]  # maps are read once: the scenario file holds the result
LOOP.append(PACKAGE / "record" / "reference_frames.py")  # used by learned controllers
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
    light = {"sonata2d", "sonata2d.core", "sonata2d.core.drawable"}
    code = f"import sys, sonata2d; loaded = set(sys.modules); print(sorted({heavy} & loaded))\n"
    code += f"assert {{name for name in loaded if name.startswith('sonata2d')}} == {light}"
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
