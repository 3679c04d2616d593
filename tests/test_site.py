"""The documentation site: it builds without a warning, its links have targets, and it lists every public name."""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from urllib.parse import urljoin

import pytest
from filelock import FileLock

ROOT = Path(__file__).parent.parent

pytestmark = pytest.mark.docs


def script(name: str) -> ModuleType:
    """A script of docs/."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("sphinx", reason="needs the extra `docs`")
    pytest.importorskip("myst_nb", reason="needs the extra `docs`")
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "site"
    with FileLock(f"{folder}.lock"):  # processes of one run share the site: each build writes docs/api
        if not (folder / "built").exists():
            build(folder)
            (folder / "built").touch()
    return folder / "html"


def build(folder: Path) -> None:
    words = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", str(ROOT / "docs"), str(folder / "html")]
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("GITHUB_", "SONATA2D_"))}
    done = subprocess.run(
        [*words, "-d", str(folder / "trees")], capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stderr[-5000:]


def test_no_link_is_broken(site: Path) -> None:
    count, broken = script("check_links").broken_links(site)
    assert count > 40_000  # 50 900 when this was written
    assert not broken


def test_the_link_checker_finds_broken_links(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<a href="b.html#x">1</a> <a href="c.html">2</a> <img src="d.png"> <a href="#y">')
    (tmp_path / "b.html").write_text('<p id="y">')
    assert script("check_links").broken_links(tmp_path) == (
        4,
        [
            "a.html: b.html#x has no such anchor",
            "a.html: c.html does not exist",
            "a.html: d.png does not exist",
            "a.html: #y has no such anchor",
        ],
    )


def test_the_search_finds_names_and_words(site: Path) -> None:
    index = (site / "searchindex.js").read_text("utf-8")
    for word in ("generate_dataset", "anticip", "troubleshoot"):
        assert word in index


def test_the_command_line_reference_has_every_command_and_its_examples(site: Path) -> None:
    from sonata2d_cli.main import COMMANDS

    text = (site / "cli.html").read_text("utf-8")
    for name in COMMANDS:
        assert f'id="sonata2d-{name}"' in text
    assert "sonata2d generate demo" in re.sub("<[^>]*>", "", text)


def test_the_api_reference_lists_every_public_name() -> None:
    page = (ROOT / "docs" / "api.md").read_text()
    listed = re.findall(r"^   (sonata2d\S*)$", page, re.MULTILINE)
    assert len(listed) == len(set(listed))
    objects = [
        id(getattr(importlib.import_module(name.rpartition(".")[0]), name.rpartition(".")[2])) for name in listed
    ]
    packages = re.findall(r"^`(sonata2d\S*)`:", page, re.MULTILINE)
    for package in ["sonata2d", *packages]:
        module = importlib.import_module(package)
        missing = [name for name in module.__all__ if id(getattr(module, name)) not in objects]
        assert set(missing) <= {"__version__", "Sonata2dError"}  # the page of `sonata2d.errors` has it, package


def test_versions_are_published_beside_each_other(tmp_path: Path) -> None:
    built, pages = tmp_path / "built", tmp_path / "pages"
    built.mkdir()
    (built / "index.html").write_text("page")
    pages.mkdir()
    publish = script("publish").publish
    publish(built, pages, "dev", "/site/")
    assert 'url=/site/dev/"' in (pages / "index.html").read_text()
    for version in ("0.9.0", "0.10.0", "1.0.0rc1", "dev"):
        publish(built, pages, version, "/site/")
    menu = json.loads((pages / "versions.json").read_text())
    assert [one["version"] for one in menu] == ["dev", "1.0.0rc1", "0.10.0", "0.9.0"]
    assert [one["name"] for one in menu] == ["dev", "1.0.0rc1", "0.10.0 (stable)", "0.9.0"]
    assert 'url=/site/0.10.0/"' in (pages / "index.html").read_text()
    for one in menu:  # whatever page it is on
        address = urljoin("https://example.org/site/dev/how-to/people.html", one["url"] + "how-to/people.html")
        assert address == f"https://example.org/site/{one['version']}/how-to/people.html"
        assert (pages / one["version"] / "index.html").exists()
