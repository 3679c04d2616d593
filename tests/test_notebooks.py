"""The notebooks of docs/notebooks run from top to bottom with small parameters, and are stored with their outputs."""

from __future__ import annotations

import ast
import importlib.util
import json
import re
import sys
from importlib.metadata import PackageNotFoundError, distribution, packages_distributions, requires
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from .test_docs import LINK, anchors_of

DOCS = Path(__file__).parent.parent / "docs"
NOTEBOOKS = {path.stem: path for path in sorted((DOCS / "notebooks").glob("*.ipynb"))}
LARGEST = 1_000_000  # bytes
INSTALLATION = re.compile(r"`pip install -e (.*?)`")
SMALL: dict[str, dict[str, int | float]] = {  # values with which each notebook takes some seconds
    "first-controller": {"TIME_LIMIT": 4.0, "SECONDS_OF_FILM": 1},
    "data-sets": {"EPISODES": 6, "SHOWN": 2},
    "compare-controllers": {"EPISODES": 2, "WORKERS": 1, "SHOWN": 2},
    "train-ppo": {"STEPS": 2048, "ENVIRONMENTS": 4, "EPISODES": 2, "WORKERS": 1},
    "imitate-the-expert": {"DEMONSTRATIONS": 4, "EPOCHS": 2, "EPISODES": 2, "WORKERS": 1},
    "pedestrian-model": {"TIME_LIMIT": 5.0, "EPISODES": 1},
    "graph-network": {"RUNS": 6, "AGGREGATED": 2, "EPOCHS": 1, "EPISODES": 3, "WORKERS": 1},
}

pytestmark = pytest.mark.docs

each_notebook = pytest.mark.parametrize("name", NOTEBOOKS)


def test_every_notebook_has_small_parameters() -> None:
    assert set(SMALL) == set(NOTEBOOKS)


@each_notebook
def test_a_notebook_runs_from_top_to_bottom(name: str, tmp_path: Path) -> None:
    for module in ("nbclient", "nbformat", "ipykernel"):
        pytest.importorskip(module, reason=f"{module} is not installed; pip install nbclient ipykernel")
    if missing := missing_packages(name):
        pytest.skip(f"{name} needs {', '.join(missing)}; its first cell says how to install them")
    import nbformat

    script = docs_script("run_notebooks")
    notebook = nbformat.read(NOTEBOOKS[name], as_version=4)
    values = "\n".join(f"{key} = {value!r}" for key, value in SMALL[name].items())
    place = next(k for k, cell in enumerate(notebook.cells) if is_parameters(cell))
    notebook.cells.insert(place + 1, nbformat.v4.new_code_cell(values))
    script.execute(notebook, tmp_path, timeout=300)  # raises the error of a cell


@each_notebook
def test_a_notebook_has_one_cell_of_parameters_with_the_names_of_this_test(name: str) -> None:
    cells = [cell for cell in code_cells(name) if is_parameters(cell)]
    assert len(cells) == 1
    assigned = {
        target.id
        for statement in ast.parse("".join(cells[0]["source"])).body
        if isinstance(statement, ast.Assign)
        for target in statement.targets
        if isinstance(target, ast.Name)
    }
    assert set(SMALL[name]) <= assigned


@each_notebook
def test_a_notebook_is_stored_with_its_outputs(name: str) -> None:
    text = NOTEBOOKS[name].read_text("utf-8")
    assert len(text.encode()) < LARGEST
    assert "widget" not in json.loads(text)["metadata"]
    cells = code_cells(name)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1)), "run docs/run_notebooks.py"
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert outputs
    for output in outputs:
        assert output["output_type"] != "error"
        assert output.get("name") != "stderr"
        assert "application/vnd.jupyter.widget-view+json" not in output.get("data", {})
        assert not re.search(r"(^|[\s\"'])(/tmp|/home|/root|/Users|[A-Z]:\\\\)", written(output)), "a path of a machine"


@each_notebook
def test_the_first_cell_installs_what_the_notebook_imports(name: str) -> None:
    installed = packages_of(name)
    owners = packages_distributions()
    for module in modules_of(name):
        if module in owners:  # else it is not installed, and its package not known
            assert {canonicalize_name(owner) for owner in owners[module]} & installed, f"{module} is not installed"


@each_notebook
def test_every_link_of_a_notebook_has_a_target(name: str) -> None:
    for cell in cells_of(name):
        if cell["cell_type"] == "markdown":
            for file, anchor in LINK.findall("".join(cell["source"])):
                target = NOTEBOOKS[name].parent / file
                assert target.exists(), file
                assert not anchor or anchor in anchors_of(target), f"{file}#{anchor}"


def docs_script(name: str) -> Any:
    """The module of a script in docs."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def cells_of(name: str) -> list[dict[str, Any]]:
    cells: list[dict[str, Any]] = json.loads(NOTEBOOKS[name].read_text("utf-8"))["cells"]
    return cells


def code_cells(name: str) -> list[dict[str, Any]]:
    return [cell for cell in cells_of(name) if cell["cell_type"] == "code"]


def is_parameters(cell: Any) -> bool:
    return "parameters" in cell["metadata"].get("tags", ())


def written(output: dict[str, Any]) -> str:
    """The text of an output, without pictures and pages."""
    data = output.get("data", {})
    return "".join(output.get("text", "")) + "".join(data.get("text/plain", ""))


def missing_packages(name: str) -> list[str]:
    """The packages that a notebook imports or installs, and that are not installed."""
    modules = {module for module in modules_of(name) if importlib.util.find_spec(module) is None}
    packages = {package for package in packages_of(name) if not is_installed(package)}
    return sorted(packages | {canonicalize_name(module) for module in modules})


def is_installed(package: str) -> bool:
    try:
        distribution(package)
    except PackageNotFoundError:
        return False
    return True


def modules_of(name: str) -> set[str]:
    """The top-level modules that a notebook imports, other than those of Python."""
    names: set[str] = set()
    for cell in code_cells(name):
        for node in ast.walk(ast.parse("".join(cell["source"]))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module or "")
    return {name.partition(".")[0] for name in names} - sys.stdlib_module_names


def packages_of(name: str) -> set[str]:
    """The packages that the first cell installs: by name, and those of sonata2d and its extras; without Jupyter."""
    found = INSTALLATION.search("".join(cells_of(name)[0]["source"]))
    assert found, "the first cell says how to install what the notebook needs"
    packages: set[str] = set()
    for word in found[1].replace("'", "").split():
        requirement = Requirement(f"sonata2d{word[1:]}" if word.startswith(".[") else word)
        packages.add(canonicalize_name(requirement.name))
        if requirement.name == "sonata2d":
            packages |= requirements_of({"", *requirement.extras})
    return packages - {"jupyter"}


def requirements_of(extras: set[str]) -> set[str]:
    """The packages that sonata2d requires with some extras on this platform."""
    packages: set[str] = set()
    for text in requires("sonata2d") or ():
        requirement = Requirement(text)
        if any(requirement.marker is None or requirement.marker.evaluate({"extra": extra}) for extra in extras):
            packages.add(canonicalize_name(requirement.name))
            if requirement.name == "sonata2d":
                packages |= requirements_of(set(requirement.extras))
    return packages
