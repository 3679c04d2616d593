"""The house is as drawn in docs/architecture.md: imports go down only, rooms do not know each other."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "sonata2d"

# Each storey may import what is in it and below; a room only itself and the ground floor.
GROUND = [
    "version", "errors", "exact", "geometry", "chance", "entities", "scene", "labels", "topics", "humans", "frame",
    "corners", "navigation", "proxemics",
]  # fmt: skip
ROOMS = ["world", "agents", "scenegen", "record", "view"]
STAIRS = {"episode": ["world", "agents"]}
LANDING = [
    "plugins",
    "replay",
    "proof",
    "tally",
    "batch",
    "testing",
    "driving",
    "encounters",
    "situations",
    "session",
    "rating",
    "transforms",
    "graph",
    "learned",
    "metrics",
    "formats",
    "datacard",
]
ATTIC = ["window"]
OUTSIDE = {
    "pymunk": {"world"},
    "pygame": {"view", "window"},
    "pygame_gui": {"window"},
    "pydantic": {"scenegen", "record"},
    "yaml": {"scenegen"},
    "matplotlib": {"metrics", "datacard"},
}


def storey_modules() -> dict[str, list[tuple[str, ...]]]:
    """Every module's own path and what it imports, relative names resolved: {"agents.crowd": [("frame",), …]}."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        name = ".".join(parts)
        found[name] = [target for node in ast.walk(ast.parse(path.read_text())) for target in imports(node, parts)]
    return found


def imports(node: ast.AST, parts: tuple[str, ...]) -> list[tuple[str, ...]]:
    if isinstance(node, ast.Import):
        return [("outside", alias.name.split(".")[0]) for alias in node.names]
    if not isinstance(node, ast.ImportFrom):
        return []
    if node.level == 0:
        return [("outside", (node.module or "").split(".")[0])]
    base = parts[: len(parts) - node.level]
    if node.module:
        return [(*base, *node.module.split("."))]
    return [(*base, alias.name) for alias in node.names]


MODULES = storey_modules()


def room_of(name: str) -> str:
    first = name.split(".")[0]
    return "world" if first in ("bumper", "presence", "posture") else first


def may_import(room: str) -> set[str]:
    if room in GROUND:
        return set(GROUND[: GROUND.index(room)]) | {room}
    if room in ROOMS:
        return {room, *GROUND}
    if room in STAIRS:
        return {room, *STAIRS[room], *GROUND}
    if room in LANDING:
        return {*LANDING, *STAIRS, *ROOMS, *GROUND}
    if room in ATTIC:
        return {*ATTIC, *LANDING, *STAIRS, *ROOMS, *GROUND}
    assert room == "__init__", f"{room} has no place in the house: give it one here and in docs/architecture.md"
    return {*LANDING, *STAIRS, *ROOMS, *GROUND}


@pytest.mark.parametrize("module", sorted(MODULES))
def test_imports_go_down_only(module: str) -> None:
    allowed = may_import(room_of(module))
    inside = {room_of(target[0]) for target in MODULES[module] if target and target[0] != "outside"}
    assert inside <= allowed, f"{module} imports {sorted(inside - allowed)}"


@pytest.mark.parametrize("module", sorted(MODULES))
def test_each_outside_package_has_its_room(module: str) -> None:
    outside = {target[1] for target in MODULES[module] if target and target[0] == "outside"}
    for package, rooms in OUTSIDE.items():
        assert package not in outside or room_of(module) in rooms, f"{module} imports {package}"


LOOP = [
    *(path for room in ("agents", "scenegen", "learned") for path in (PACKAGE / room).rglob("*.py")),
    *(PACKAGE / f"{name}.py" for name in ("world", "bumper", "presence", "posture", "episode", *GROUND)),
    *(PACKAGE / "graph" / f"{name}.py" for name in ("graph", "looks", "modern", "paper")),  # graphs made live
    PACKAGE / "transforms" / "frames.py",
]
FIXED = PACKAGE / "learned" / "fixed.py"  # fixed point, where no product and no sum is ever rounded


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
    heavy = {"pygame", "yaml", "jinja2", "imageio", "tqdm", "sonata2d.learned", "sonata2d.graph"}
    code = f"import sys, sonata2d; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert done.stderr == ""
