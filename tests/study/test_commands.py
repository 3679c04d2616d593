"""The commands about what a study has collected, and `collect --study`."""

from __future__ import annotations

import json
import os
import signal
import socket
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from sonata2d_cli.main import main

from sonata2d.study.folder import opened_folder
from sonata2d.study.load import Study, load_study
from sonata2d.study.participant import Participant

from .conftest import drive, prepare

Arrive = Callable[..., Participant]


def run(*words: str | Path, code: int = 0, **options: str) -> Result:
    result = CliRunner().invoke(main, [str(word) for word in words], **options)  # type: ignore[arg-type]
    assert result.exit_code == code, result.output
    return result


@pytest.fixture
def out(arrive: Arrive, tmp_path: Path) -> Path:
    """A study with one run."""
    participant = arrive()
    prepare(participant)
    drive(participant)
    participant.keep(0.5)
    participant.close()
    return tmp_path / "out"


def test_results(out: Path, tmp_path: Path) -> None:
    assert "runs.csv          1 row\n" in run("study", "results", out, tmp_path / "tables").output
    paths = json.loads(run("study", "results", out, tmp_path / "tables", "--personal", "--json").stdout)
    assert {Path(path).name for path in paths} == {
        "participants.csv", "runs.csv", "answers.csv", "scores.csv", "ratings.csv"
    }  # fmt: skip
    assert "left-handed" in (tmp_path / "tables" / "answers.csv").read_text()
    assert "is not the folder of a study" in run("study", "results", tmp_path, tmp_path / "t", code=1).output


def test_export(out: Path, tmp_path: Path) -> None:
    run("study", "export", out, tmp_path / "study.zip")
    with zipfile.ZipFile(tmp_path / "study.zip") as archive:
        assert not any(b"left-handed" in archive.read(name) for name in archive.namelist())
    assert not [*tmp_path.glob("*.partial")]
    assert "cannot be written" in run("study", "export", out, tmp_path, code=1).output
    for command in ("export", "results"):  # it would outlive the removal of a participant
        assert "choose a path outside" in run("study", command, out, out / "x", code=1).output


def test_remove(out: Path) -> None:
    kept = [*out.glob("p1__*.json")]
    run("study", "remove", out, "p1", code=1, input="n\n")
    assert kept
    assert all(path.exists() for path in kept)
    assert "files deleted" in run("study", "remove", out, "p1", input="y\n").output
    assert not [*out.rglob("p1*.json*")]
    assert "no participant 'p2'" in run("study", "remove", out, "p2", "--yes", code=1).output


def test_two_programs_do_not_use_a_study_at_once(out: Path, study_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Study, "warm_up", lambda self: pytest.fail("compiles before the folder is refused"))
    lines = (
        ["serve", study_file, out],
        ["collect", out, "--study", study_file],
        ["study", "remove", out, "p1", "--yes"],
    )
    with opened_folder(out, load_study(study_file)):
        for words in lines:
            assert f"another program uses {out}; stop it first" in run(*words, code=1).output


@pytest.mark.parametrize("words", [["serve"], ["study", "preview"]])
def test_an_address_is_refused_before_the_simulation_is_compiled(
    words: list[str], study_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Study, "warm_up", lambda self: pytest.fail("compiles before the address is refused"))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        out = [tmp_path / "out"] if words == ["serve"] else []
        assert f"port {port}, cannot be used" in run(*words, study_file, *out, "--port", str(port), code=1).output


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
@pytest.mark.parametrize("words", [["serve"], ["study", "preview"]])
def test_a_server_that_is_interrupted_before_it_serves_has_not_served(
    words: list[str], study_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def terminated(study: Study) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        for _ in range(1000):
            pass

    monkeypatch.setattr(Study, "warm_up", terminated)
    out = [tmp_path / "out"] if words == ["serve"] else []
    assert "terminated" in run(*words, study_file, *out, "--port", "0", code=128 + signal.SIGTERM).output


@pytest.mark.parametrize("option", [("--runs", "3"), ("--scenario", "empty"), ("--rate", "recorded"), ("--seed", "1")])
def test_options_that_the_study_sets(option: tuple[str, str], out: Path, study_file: Path) -> None:
    words = ["collect", "--study", study_file, *option] + ([] if option[0] == "--rate" else [out])
    assert f"{option[0]} is set by the study file" in run(*words, code=2).output
