"""Draws the pictures of results in the docs with the command line: the office, a comparison, and a graph.

python docs/draw_results.py [FOLDER]
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
OFFICE_SEED = 10
CONTROLLERS = ("straight-to-goal", "social-force", "social-planner")


def main(folder: Path) -> None:
    """Draw all pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        office, runs = Path(scratch) / "office", Path(scratch) / "runs"
        scenario = ROOT / "examples/scenarios/office.yaml"
        command("generate", office, "--scenario", scenario, "--episodes", 1, "--seed", OFFICE_SEED)
        command("render", office / "000000.json", "-o", folder / "office.png", "--size", 1000, 747)
        chosen = [word for name in CONTROLLERS for word in ("--controller", name)]
        command("evaluate", *chosen, "--picture", folder / "evaluate.png")
        command("generate", runs, "--scenario", "lively", "--episodes", 1)
        command("render", runs / "000000.json", "-o", folder / "graph.png", "--graph")


def command(*words: object) -> None:
    """Run a command of sonata2d."""
    subprocess.run([sys.executable, "-m", "cli", *map(str, words), "--quiet"], cwd=ROOT, check=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT / "docs" / "images")
