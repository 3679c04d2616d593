"""The commands about what a study has collected, and `collect --study`."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from urllib.request import urlopen

import pytest
from click.testing import CliRunner, Result
from sonata2d_cli import collect
from sonata2d_cli.main import main

from sonata2d.study.folder import opened_folder, read_state
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
        "participants.csv", "runs.csv", "pages.csv", "answers.csv", "scores.csv", "ratings.csv"
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


@pytest.mark.parametrize(
    ("option", "reason"),
    [
        (("--runs", "3"), "is set by the study file"),
        (("--scenario", "empty"), "is set by the study file"),
        (("--rate", "recorded"), "is set by the study file"),
        (("--seed", "1"), "is set by the study file"),
        (("--size", "800", "600"), "is for the window, and a browser shows the study"),
        (("--language", "de"), "is for the window, and a browser shows the study"),
    ],
)
def test_options_that_do_not_apply_to_a_study(
    option: tuple[str, ...], reason: str, out: Path, study_file: Path
) -> None:
    words = ["collect", "--study", study_file, *option] + ([] if option[0] == "--rate" else [out])
    assert f"{option[0]} {reason}" in run(*words, code=2).output


@pytest.mark.skipif(os.name != "posix", reason="the browser is a shell script")
@pytest.mark.parametrize("contributor", ["zoe", None])
def test_collect_serves_a_study_and_opens_its_page(contributor: str | None, study_file: Path, tmp_path: Path) -> None:
    browser, opened, out = tmp_path / "browser", tmp_path / "opened", tmp_path / "out"
    # It ends when the test ends, like a browser that was started by this command.
    browser.write_text(f'#!/bin/sh\nprintf %s "$1" > {opened}.partial\nmv {opened}.partial {opened}\nexec sleep 300\n')
    browser.chmod(0o755)
    words = ["collect", str(out), "--study", str(study_file), *(["--contributor", contributor] if contributor else [])]
    program = subprocess.Popen(
        [sys.executable, "-m", "sonata2d_cli", *words],
        env=os.environ | {"BROWSER": str(browser)},
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        while not opened.exists():
            assert program.poll() is None
            time.sleep(0.05)
        link = opened.read_text()
        assert link.split("/")[3] == ("s" if contributor else "j")
        with urlopen(link) as page:
            assert "Passing people" in page.read().decode()
        program.send_signal(signal.SIGINT)
        assert program.wait() == 0
    finally:
        os.killpg(program.pid, signal.SIGKILL)  # with the browser
        output, _ = program.communicate()
    assert f"{contributor or 'open link'}:  {link}\n" in output
    assert f"next:  sonata2d study results {out} tables" in output
    assert read_state(out)["participants"] == ([contributor] if contributor else [])


def test_collect_says_how_to_open_a_study_without_a_browser(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("webbrowser.open", lambda link: False)
    collect._open_page("http://127.0.0.1:1/s/token")
    message = capsys.readouterr().err
    assert "open http://127.0.0.1:1/s/token in a browser of this machine" in message
    assert "use `sonata2d serve`" in message


def test_collect_names_the_extra_that_serves_studies(
    study_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    output = run("collect", tmp_path / "out", "--study", study_file, code=1).output
    assert "uvicorn is not installed: pip install 'sonata2d[serve]'" in output


def test_a_withdrawn_participant_is_refused(out: Path, study_file: Path) -> None:
    run("study", "remove", out, "p1", "--yes")
    output = run("collect", out, "--study", study_file, "--contributor", "p1", code=1).output
    assert "p1 has withdrawn from the study; choose another id" in output
