"""Options of all commands, help texts, and how errors are reported."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import click
import pytest
from sonata2d_cli import main
from sonata2d_cli.main import COMMANDS

from sonata2d.core.compiled import kernel as compiled

from .conftest import Run, one_line

GENERATE = "generate out --scenario quick.yaml --episodes 2 --workers 1 --no-picture"
FAILING = "import sonata2d as s2\nclass Mine(s2.Controller):\n    def act(self, snapshot):\n        return 1 / 0\n"


def commands() -> list[list[str]]:
    """The words of every command, with those of groups."""
    root = click.Context(main)
    found = {name: main.get_command(root, name) for name in COMMANDS}
    groups = {name: one.commands if isinstance(one, click.Group) else None for name, one in found.items()}
    return [[name, *word] for name, inner in groups.items() for word in ([[part] for part in inner] if inner else [[]])]


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_help_of_every_command_has_the_common_options_and_one_example_a_line(sonata2d: Run, words: list[str]) -> None:
    output = sonata2d(" ".join([*words, "--help"])).output
    for option in ("-q, --quiet", "-v, --verbose", "--traceback", "-h, --help"):
        assert option in output
    examples = output.partition("\nExamples:\n")[2].splitlines()
    assert examples
    assert all(line.startswith("  sonata2d " + " ".join(words)) for line in examples)


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_an_output_is_named_alike_in_every_command(sonata2d: Run, words: list[str]) -> None:
    output = sonata2d(" ".join([*words, "--help"])).output
    assert "--out " not in output
    assert ("-o, --output" in output) == ("--output" in output)


@pytest.mark.parametrize("line", ["-q {}", "{} --quiet"])
def test_quiet_prints_results_only(sonata2d: Run, line: str) -> None:
    assert sonata2d(line.format(GENERATE)).output == ""
    assert sonata2d(line.format("check out")).output == ""
    assert sonata2d(line.format("render out/000000.json -o x.png")).output == ""
    assert "episodes         2 of 2" in sonata2d(line.format("describe out")).output


@pytest.mark.parametrize("line", ["-v {}", "{} --verbose"])
@pytest.mark.parametrize("workers", [1, 2])
def test_verbose_prints_each_step_of_all_processes(here: Path, line: str, workers: int) -> None:
    words = line.format(GENERATE.replace("--workers 1", f"--workers {workers}")).split()
    done = subprocess.run([sys.executable, "-m", "sonata2d_cli", *words], capture_output=True, text=True, check=True)
    for episode in (0, 1):
        assert f"INFO:sonata2d.datasets.generate.episodes:episode {episode}: " in done.stderr


def test_quiet_and_verbose_exclude_each_other(sonata2d: Run) -> None:
    assert "--quiet and --verbose exclude each other" in sonata2d("-q describe out -v", code=2).output


@pytest.mark.parametrize("line", ["--traceback {}", "{} --traceback"])
def test_traceback_shows_where_an_error_was_raised(sonata2d: Run, here: Path, line: str) -> None:
    (here / "mine.py").write_text(FAILING)
    command = f"{GENERATE} --controller ./mine.py"
    assert "mine.py, line 4" in one_line(sonata2d(command, code=1).output)
    output = sonata2d(line.format(f"{command} --resume"), code=1).output
    assert 'mine.py", line 4, in act' in output
    assert output.splitlines()[-1].startswith("Error: ControllerError: episode 0 of seed 0: ZeroDivisionError")


def test_an_error_of_a_users_file_is_not_called_a_bug(sonata2d: Run, here: Path) -> None:
    (here / "mine.py").write_text(FAILING)
    output = one_line(sonata2d("scenarios check overtaking --controller ./mine.py --episodes 1", code=1).output)
    assert output.startswith(
        "Error: ZeroDivisionError: division by zero; at tick 0 of episode 0, seed 0 (mine.py, line 4)"
    )


def test_a_bug_is_reported_in_one_line_with_its_own_exit_code(sonata2d: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(path: Path) -> None:
        raise KeyError("lost\nkey")

    monkeypatch.setattr("sonata2d.record.reader.read_episode", fail)
    monkeypatch.setattr(sys.modules["sonata2d_cli.main"], "__file__", __file__)  # this file counts as the package's
    output = one_line(sonata2d("describe x.json", code=70).output)
    assert output.startswith("Error: unexpected KeyError: 'lost\\nkey' (test_options.py, line ")
    assert "please report it" in output
    assert "Traceback" in sonata2d("describe x.json --traceback", code=70).output


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
@pytest.mark.skipif(not compiled.IS_COMPILED, reason="kernels are interpreted")
def test_ctrl_c_during_the_compilation_is_answered_at_once_and_ends_after_one_kernel(
    here: Path, tmp_path: Path
) -> None:
    words = ["generate", "out", "--scenario", "quick.yaml", "--workers", "2", "--no-picture"]
    process = subprocess.Popen(
        [sys.executable, "-m", "sonata2d_cli", *words],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        start_new_session=True,
    )
    assert process.stderr is not None
    assert "sonata2d is compiled for this processor" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    assert "stopping: the worker processes have 5 s to finish their episodes" in process.stderr.readline()
    assert process.communicate()[1].splitlines()[-1].startswith("interrupted; no episode is complete")
    assert process.returncode == 130
    assert len([*(tmp_path / "cache").rglob("*.kernel")]) <= 2  # an episode needs a dozen


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX pipes")
def test_a_reader_that_has_ended_gives_the_code_of_a_broken_pipe(here: Path) -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    words = ["scenarios", "show", "sonata-2020"]
    done = subprocess.run([sys.executable, "-m", "sonata2d_cli", *words], stdout=write_end, stderr=subprocess.PIPE)
    os.close(write_end)
    assert (done.returncode, done.stderr) == (141, b"")
