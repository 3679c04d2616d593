"""The commands that write files, the material that they read, and what may lie in a folder after a fault."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from sonata2d.core.files.whole_file import TEMPORARY_PREFIX

TIME_LIMIT = 120  # s, of one command; a command that takes longer hangs
PROGRAM = (sys.executable, "-m", "cli")
# Written while a data set grows: their content tells how far it got.
GROWING = ("manifest.json", "run.jsonl", "excluded.jsonl", "README.md", "scenario.json")


@dataclass(frozen=True)
class Command:
    """A command that writes files.

    Attributes:
        name: for the table.
        arguments: `{m}` is the folder of the material, `{o}` the folder of the output.
        copied: data set of the material that the command changes in place, in a copy in the output folder.
        resumed: whether the command continues after a fault with `--resume`.
    """

    name: str
    arguments: str
    copied: str = ""
    resumed: bool = False

    def line(self, material: Path, output: Path) -> list[str]:
        """The command line."""
        return [*PROGRAM, *self.arguments.format(m=material, o=output).split()]

    def prepare(self, material: Path, output: Path) -> None:
        """Copy what the command changes."""
        if self.copied:
            shutil.copytree(material / self.copied, output / self.copied)


GENERATE = Command(
    "generate",
    "generate {o}/out --scenario {m}/scenario.yaml --episodes 60 --seed 3 --workers 2 --no-picture",
    resumed=True,
)
COMMANDS = (
    GENERATE,
    Command("generate --picture", "generate {o}/out --scenario {m}/scenario.yaml --episodes 3 --workers 1 --picture"),
    Command(
        "evaluate",
        "evaluate --controller straight-to-goal --controller orca --scenario {m}/scenario.yaml --episodes 3 --workers 2"
        " -o {o}/runs --page {o}/page.html",
    ),
    Command("render .png", "render {m}/demo/000000.json -o {o}/a.png"),
    Command("render .svg", "render {m}/demo/000000.json -o {o}/a.svg"),
    Command("render .gif", "render {m}/demo/000000.json -o {o}/a.gif --size 320 240"),
    Command("render .mp4", "render {m}/demo/000000.json -o {o}/a.mp4 --size 320 240"),
    Command("render .html", "render {m}/demo/000000.json -o {o}/a.html"),
    Command("mirror", "mirror {m}/demo -o {o}/mirrored"),
    Command("merge", "merge {m}/demo {m}/other -o {o}/merged"),
    Command("split", "split {o}/demo", copied="demo"),
    Command("card", "card {o}/demo", copied="demo"),
    *(Command(f"export {name}", f"export {{m}}/demo --to {name} -o {{o}}/{name}") for name in ("sonata", "socnav3")),
    *(Command(f"export {name}", f"export {{m}}/demo --to {name} -o {{o}}/{name}") for name in ("csv", "npz")),
    *(Command(f"export {name}", f"export {{m}}/demo --to {name} -o {{o}}/{name}") for name in ("trajnet", "parquet")),
    Command("import", "import {m}/sonata --from sonata -o {o}/imported"),
    Command(
        "scenarios from-tracks", "scenarios from-tracks {m}/tracks.csv --frame-time 0.1 --seconds 5 -o {o}/place.yaml"
    ),
    Command("scenarios draw", "scenarios draw {m}/scenario.yaml -o {o}/scenes.png"),
)


@dataclass(frozen=True)
class Result:
    """How a command ended."""

    code: int
    errors: str

    @property
    def fault(self) -> str:
        """What is wrong with the way it ended; empty if nothing is."""
        if "Traceback" in self.errors or "Exception ignored" in self.errors:
            return f"a traceback: {self.errors[-300:]!r}"
        return "an error code without a message" if self.code > 0 and not self.errors.strip() else ""


def create_material(folder: Path) -> None:
    """Create the data sets and files that the commands read."""
    folder.mkdir(parents=True)
    (folder / "scenario.yaml").write_text(
        "extends: sonata-2020\nname: trial\nrules: {time_limit: 10, ends_on: [time]}\nwandering: [3, 5]\n"
    )
    for name, seed in (("demo", 1), ("other", 2)):
        line = f"generate {folder}/{name} --scenario {folder}/scenario.yaml --episodes 4 --seed {seed} --no-picture"
        _require([*PROGRAM, *line.split()])
    _require([*PROGRAM, "export", f"{folder}/demo", "--to", "sonata", "-o", f"{folder}/sonata"])
    _require([*PROGRAM, "export", f"{folder}/demo/000000.json", "--to", "csv", "-o", f"{folder}/tracks.csv"])


def run(line: list[str], *, before_start: Callable[[], None] | None = None, cwd: Path | None = None) -> Result:
    """Run a command line to its end.

    Args:
        line: the command line.
        before_start: called in the new process.
        cwd: working directory.

    Raises:
        subprocess.TimeoutExpired: it hangs.
    """
    found = subprocess.run(
        line,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        timeout=TIME_LIMIT,
        preexec_fn=before_start,
        cwd=cwd,
    )
    return Result(found.returncode, found.stderr)


def contents(folder: Path) -> dict[str, str]:
    """SHA-256 of each file of a folder, by its path; the run log, which tells the time, is left out."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "run.jsonl"
    }


def unexpected_files(
    folder: Path, before: dict[str, str], whole: dict[str, str], *, partial_allowed: bool = False
) -> str:
    """Files that are neither as before the command, nor as after a complete run, nor in growth; empty if none is.

    Args:
        folder: of the output.
        before: contents of the folder before the command.
        whole: contents after a complete run.
        partial_allowed: whether files with a temporary name may be left, as after `kill -9`.
    """
    for name, content in contents(folder).items():
        path = Path(name)
        if path.name.startswith(TEMPORARY_PREFIX) or any(p.startswith(TEMPORARY_PREFIX) for p in path.parts):
            if not partial_allowed:
                return f"{name} is left"
        elif content not in (before.get(name), whole.get(name)) and path.name not in GROWING:
            return f"{name} is neither old nor complete"
    missing = sorted(set(before) - set(contents(folder)))
    return f"{missing[0]} is gone" if missing else ""


def is_root() -> bool:
    """Whether this process may mount file systems, and is not held by permissions."""
    return hasattr(os, "geteuid") and os.geteuid() == 0


def _require(line: list[str]) -> None:
    result = run(line)
    assert result.code == 0, result
