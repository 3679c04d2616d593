"""Every example in the documentation runs: Python blocks, `sonata2d` commands, and the files they use."""

from __future__ import annotations

import doctest
import importlib
import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from sonata2d_cli import main

from sonata2d.version import __version__

ROOT = Path(__file__).parent.parent
SOURCES = [path for path in sorted((ROOT / "docs").rglob("*.md")) if (ROOT / "docs" / "api") not in path.parents]
# pages whose commands wait for a person, or need policies that take long to train: their options are checked; other
# tests do what they describe: tests/window, tests/gym (which runs the Python blocks) and tests/examples
PARSED = ["docs/gym.md", "docs/use-case.md", "docs/window.md"]
PAGES = ["README.md", *(path.relative_to(ROOT).as_posix() for path in SOURCES)]
BLOCK = re.compile(r"^```(\w+)(?: file=(\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)#:]*)(?:#([^)]*))?\)")
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)


def text_of(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def test_extras_are_installed_by_one_form_of_command() -> None:
    """In a clone with `-e`; an image of a container holds an installation of its own."""
    paths = [ROOT / "CONTRIBUTING.md", ROOT / "README.md"]
    for pattern in ("docs/**/*.md", "docs/**/*.ipynb", "examples/**/*.md", "examples/**/*.ipynb", "examples/**/*.py"):
        paths += ROOT.glob(pattern)
    lines = [line for path in paths for line in path.read_text("utf-8").splitlines()]
    hints = [line for line in lines if re.search(r"pip install( -e)? ('?(\.|sonata2d)\[|\.( |$|`))", line)]
    assert len(hints) > 20
    assert [line for line in hints if "pip install -e" not in line and not line.startswith(("Error: ", "RUN "))] == []


def test_the_citation_names_the_version() -> None:
    assert f"\nversion: {__version__}\n" in text_of("CITATION.cff")


@pytest.mark.docs
@pytest.mark.parametrize("page", [page for page in PAGES if page not in PARSED and BLOCK.search(text_of(page))])
def test_every_example_runs_in_the_order_of_the_page(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "polite", raising=False)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    makes_demo = re.search(r"^sonata2d generate demo(?!.*--resume)", text_of(page), re.MULTILINE)
    if page != "README.md" and "demo" in text_of(page) and not makes_demo:  # begins where the first command ends
        run(first_command())
    for language, file, text in BLOCK.findall(text_of(page))[2 if page == "README.md" else 0 :]:
        if file:
            (tmp_path / file).write_text(text)
        elif language == "python":
            code = compile(text, page, "exec", dont_inherit=True)
            exec(code, {"__name__": "example"})  # each block is complete by itself
        elif language == "sh":
            for line in text.splitlines():
                run(line)


@pytest.mark.parametrize("page", PARSED)
def test_every_command_has_the_options_that_the_page_says(page: str) -> None:
    lines = [
        line for language, _, text in BLOCK.findall(text_of(page)) if language == "sh" for line in text.splitlines()
    ]
    for line in lines:
        program, name, *words = shlex.split(line)
        assert program in ("sonata2d", "python"), line
        if program == "python":
            assert (ROOT / name).exists()
            continue
        command = main.get_command(main.make_context("sonata2d", [name]), name)
        assert command is not None
        command.make_context(name, words)  # raises an error for an unknown option


def first_command() -> str:
    """What the README's first command runs after the installation."""
    _, _, text = BLOCK.findall((ROOT / "README.md").read_text())[0]
    return text.strip().rpartition("&& .venv/bin/")[2]


def run(line: str) -> None:
    program, *words = shlex.split(line)
    assert program == "sonata2d", line
    result = CliRunner().invoke(main, words, prog_name="sonata2d")
    assert result.exit_code == 0, f"{line}\n{result.output}"


@pytest.mark.parametrize(
    "page",
    [
        "README.md",
        "CONTRIBUTING.md",
        "examples/plugin/README.md",
        *PAGES[1:],
    ],
)
def test_every_link_has_a_target(page: str) -> None:
    for file, anchor in LINK.findall(text_of(page)):
        target = (ROOT / page).parent / file if file else ROOT / page
        assert target.exists(), f"{page}: {file}"
        assert not anchor or anchor in anchors_of(target), f"{page}: {file}#{anchor}"


def anchors_of(page: Path) -> set[str]:
    """The anchors of the headings of a page, as code hosts derive them."""
    headings = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in HEADING.findall(page.read_text()))
    return {heading.replace(" ", "-") for heading in headings}


def test_readme_gives_two_commands_and_the_gate_runs_the_second() -> None:
    blocks = BLOCK.findall((ROOT / "README.md").read_text().partition("\n## ")[0])
    commands = [text.strip() for _, _, text in blocks]
    assert len(commands) == 2
    gate = (ROOT / ".ci/run").read_text()
    assert "'.[test]'" in commands[1]
    assert "'.[test]'" in gate
    assert commands[1].endswith(".venv/bin/python -m pytest -n 2")
    *_, documentation, last = gate.strip().splitlines()
    assert last == ".venv/bin/python -m pytest -n 2"
    assert documentation == f"{last} -m docs"


@pytest.mark.docs
@pytest.mark.parametrize("name", ["home", "office", "clinic_corridor"])
def test_example_scenarios_can_be_solved_by_the_expert(name: str, tmp_path: Path) -> None:
    import sonata2d as s2

    config = s2.load_scenario(ROOT / f"examples/scenarios/{name}.yaml")
    outcomes = [s2.Episode(s2.generate(config, seed), s2.SocialPlanner()).run().status for seed in range(3)]
    assert outcomes.count("goal") >= 2


def modules_with_examples() -> list[str]:
    paths = (path for path in (ROOT / "sonata2d").rglob("*.py") if ">>> " in path.read_text())
    return sorted(".".join(path.relative_to(ROOT).with_suffix("").parts) for path in paths)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that contains a small data set `demo`."""
    import sonata2d as s2

    folder = tmp_path_factory.mktemp("docstrings")
    s2.generate_dataset(folder / "demo", s2.load_scenario("sonata-2020"), "straight-to-goal", episodes=2)
    return folder


@pytest.mark.parametrize("module", modules_with_examples())
def test_examples_in_docstrings_are_right(module: str, demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sonata2d as s2
    from sonata2d.metrics import episode_files

    monkeypatch.chdir(demo)
    names = {"Path": Path, "read_episode": s2.read_episode, "episode_files": episode_files}
    result = doctest.testmod(importlib.import_module(module), extraglobs=names, optionflags=doctest.ELLIPSIS)
    assert result.attempted
    assert not result.failed
