"""Executes the notebooks of docs/notebooks in a temporary folder, and stores their cleaned outputs.

python docs/run_notebooks.py [NAME ...]

It needs `pip install nbclient ipykernel`, and what the notebooks say in their first cells. The kernel is the
interpreter that runs this script.
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import nbformat
from ipykernel.kernelspec import get_kernel_dict
from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient

FOLDER = Path(__file__).parent / "notebooks"
WIDGET = "application/vnd.jupyter.widget-view+json"
MEMORY_ADDRESS = re.compile(r" at 0x[0-9a-f]{6,}")


class Kernel(AsyncKernelManager):
    """A kernel of the interpreter that runs this script, whichever kernels are installed."""

    @property
    def kernel_spec(self) -> KernelSpec:
        """How ipykernel starts this interpreter."""
        return KernelSpec(**get_kernel_dict())


def execute(notebook: Any, folder: Path, *, timeout: int | None = None) -> None:
    """Run all cells of a notebook.

    Args:
        notebook: of `nbformat.read`; gets the outputs.
        folder: the current folder of its cells.
        timeout: of a cell, s.

    Raises:
        nbclient.exceptions.CellExecutionError: a cell raises.
        nbclient.exceptions.CellTimeoutError: a cell takes too long.
    """
    place = {"metadata": {"path": str(folder)}}
    NotebookClient(notebook, timeout=timeout, kernel_manager_class=Kernel, resources=place).execute()


def clean(notebook: Any, folder: Path) -> None:
    """Remove what differs between machines: widgets, standard error, times of cells, addresses, the folder.

    Args:
        notebook: executed.
        folder: its path is removed from outputs.
    """
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    for cell in notebook.cells:
        cell.metadata = {"tags": cell.metadata.tags} if cell.metadata.get("tags") else {}
        if cell.cell_type != "code":
            continue
        cell.outputs = [output for output in cell.outputs if not is_transient(output)]
        for output in cell.outputs:
            output.pop("transient", None)
            texts = output.data if "data" in output else output
            for key, value in texts.items():
                if isinstance(value, str):
                    texts[key] = MEMORY_ADDRESS.sub("", value.replace(f"{folder}/", ""))


def is_transient(output: Any) -> bool:
    """Whether an output is a widget, which is empty in a stored notebook, or text on standard error."""
    return output.get("name") == "stderr" or WIDGET in output.get("data", {})


def main(names: list[str]) -> None:
    """Run the named notebooks, or all of them."""
    for path in [FOLDER / f"{Path(name).stem}.ipynb" for name in names] or sorted(FOLDER.glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        with tempfile.TemporaryDirectory(prefix="notebook-") as folder:
            start = time.perf_counter()
            execute(notebook, Path(folder))
            seconds = time.perf_counter() - start
            clean(notebook, Path(folder))
        text = nbformat.writes(notebook, indent=1) + "\n"
        path.write_text(text, encoding="utf-8")
        print(f"{path.name}: {seconds:.0f} s, {len(text) / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
