"""Every example in the documentation runs: Python blocks, `sonata2d` commands, and the files they use."""

from __future__ import annotations

import doctest
import importlib
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from sonata2d_cli import main

ROOT = Path(__file__).parent.parent
PAGES = ["README.md", "docs/first-steps.md", "docs/how-to.md", "docs/scenarios.md"]
BLOCK = re.compile(r"^```(\w+)(?: file=(\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)#:]*)(?:#([^)]*))?\)")
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES)
def test_every_example_runs_in_the_order_of_the_page(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "polite", raising=False)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    if page == "docs/first-steps.md":  # begins where the README's first command ends
        run(first_command())
    for language, file, text in BLOCK.findall((ROOT / page).read_text())[2 if page == "README.md" else 0 :]:
        if file:
            (tmp_path / file).write_text(text)
        elif language == "python":
            exec(compile(text, page, "exec"), {"__name__": "example"})  # each block is complete by itself
        elif language == "sh":
            for line in text.splitlines():
                run(line)


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
        *(str(p.relative_to(ROOT)) for p in (ROOT / "docs").glob("*.md")),
    ],
)
def test_every_link_has_a_target(page: str) -> None:
    for file, anchor in LINK.findall((ROOT / page).read_text()):
        target = (ROOT / page).parent / file if file else ROOT / page
        assert target.exists(), f"{page}: {file}"
        assert not anchor or anchor in anchors_of(target), f"{page}: {file}#{anchor}"


def anchors_of(page: Path) -> set[str]:
    """The anchors of the headings of a page, as code hosts derive them."""
    headings = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in HEADING.findall(page.read_text()))
    return {heading.replace(" ", "-") for heading in headings}


def test_the_contents_of_how_to_link_each_section_once() -> None:
    contents, *sections = (ROOT / "docs/how-to.md").read_text().split("\n## ")
    headings = [section.partition("\n")[0] for section in sections]
    anchors = [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]
    assert sorted(anchor for file, anchor in LINK.findall(contents) if not file) == sorted(anchors)


def test_the_api_reference_is_up_to_date() -> None:
    script = str(ROOT / "docs/generate_api.py")
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_readme_gives_two_commands_and_the_gate_runs_the_second() -> None:
    blocks = BLOCK.findall((ROOT / "README.md").read_text().partition("\n## ")[0])
    commands = [text.strip() for _, _, text in blocks]
    assert len(commands) == 2
    gate = (ROOT / ".ci/run").read_text()
    assert "'.[test]'" in commands[1]
    assert "'.[test]'" in gate
    assert commands[1].endswith(".venv/bin/python -m pytest -n 2")
    assert gate.strip().splitlines()[-1].startswith(".venv/bin/python -m pytest -n 2")


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
