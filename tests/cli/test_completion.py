"""The Tab key in Bash, Zsh and Fish: the shells run in a terminal, with the lines of the documentation."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

pexpect = pytest.importorskip("pexpect", reason="needs pexpect")

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to" / "command-line.md"
SHELLS = {
    "bash": ["--noprofile", "--norc", "-i"],
    "zsh": ["-f", "-i"],
    "fish": ["--no-config", "-i"],
}
TAB, TO_BEGIN = "\t", "\x01"  # keys; the second is Ctrl-A
CASES = [  # what is typed before the Tab key, and what the line is then
    ("sonata2d gen", "sonata2d generate"),
    ("sonata2d scenarios li", "sonata2d scenarios list"),
    ("sonata2d generate out --contr", "sonata2d generate out --controller"),
    ("sonata2d generate out --compress zs", "sonata2d generate out --compress zst"),
    ("sonata2d export demo out --to soc", "sonata2d export demo out --to socnav3"),
]


def start_up_line(shell: str) -> str:
    """The line that the documentation gives for the start-up file of a shell."""
    for line in HOW_TO.read_text().splitlines():
        if line.startswith(f"| {shell.capitalize()}"):
            match = re.search(r"`([^`]*_SONATA2D_COMPLETE[^`]*)`", line)
            assert match is not None
            return match[1].replace("\\|", "|")
    raise AssertionError(f"{HOW_TO} has no line for {shell}")


@pytest.fixture(params=SHELLS)
def terminal(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """A shell that has read the start-up line; its prompt is `$$ `."""
    shell = request.param
    if shutil.which(shell) is None:
        assert not (os.environ.get("CI") and sys.platform == "linux"), f"the workflow installs no {shell}"
        pytest.skip(f"{shell} is not installed")
    if sys.platform == "win32":
        pytest.skip("pexpect needs a system with pseudo-terminals")
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "HOME": str(tmp_path), "XDG_CONFIG_HOME": str(tmp_path), "TERM": "dumb", "PS1": "$$ ",
    }  # fmt: skip
    process = pexpect.spawn(
        shell, SHELLS[shell], env=environment, encoding="utf-8", timeout=30, cwd=tmp_path, dimensions=(40, 200)
    )
    set_up = {"zsh": "autoload -Uz compinit && compinit -u -D; PROMPT='$$ '; unsetopt zle_bracketed_paste"}
    set_up["bash"] = "PS1='$$ '; bind 'set enable-bracketed-paste off' 2>/dev/null"
    set_up["fish"] = "function fish_prompt; echo -n '$$ '; end"
    process.sendline(set_up[shell])
    process.sendline(start_up_line(shell).removesuffix(" | source") + (" | source" if shell == "fish" else ""))
    process.sendline("echo re''ady")
    process.expect("ready")
    yield process
    process.close(force=True)


@pytest.mark.parametrize(("typed", "completed"), CASES)
def test_tab_completes(terminal: Any, typed: str, completed: str) -> None:
    terminal.send(typed + TAB)
    terminal.send(f"{TO_BEGIN}echo '<' ")  # prints the line instead of running it
    terminal.send("\r")
    terminal.expect(r"[^']< (sonata2d[^\r\n]*)")
    assert terminal.match[1].strip() == completed
