"""Draws the pictures of results in the docs: the office, plots of a comparison (needs Chromium), and a graph.

python docs/draw_results.py [FOLDER]
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parent.parent
OFFICE_SEED = 26
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
        page = Path(scratch) / "page.html"
        command("evaluate", *chosen, "--page", page)
        photograph(page, folder / "evaluate.png")
        command("generate", runs, "--scenario", "lively", "--episodes", 1)
        command("render", runs / "000000.json", "-o", folder / "graph.png", "--graph")


def photograph(page: Path, picture: Path) -> None:
    """Save the plots of measures of an evaluation page as a picture."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 860, "height": 800})
        tab.goto(page.as_uri())
        tab.locator(".panels").last.screenshot(path=picture)
        browser.close()


def command(*words: object) -> None:
    """Run a command of sonata2d."""
    subprocess.run([sys.executable, "-m", "cli", *map(str, words), "--quiet"], cwd=ROOT, check=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT / "docs" / "images")
