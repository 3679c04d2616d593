"""Scenes, snapshots, episodes and records show themselves: one line, a table with a picture, files, pages."""

from __future__ import annotations

import base64
import html
import io
import re
import subprocess
import sys
import types
import webbrowser
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import sonata2d as s2
from sonata2d.core.drawable import Drawable
from sonata2d.core.snapshot import ControllerInfo
from sonata2d.errors import RenderError

KINDS = ("scene", "snapshot", "episode", "record")


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """An object of each kind, all of the same episode."""
    path = tmp_path_factory.mktemp("shown") / "run.json"
    config = s2.load_scenario("lively").changed(rules={"time_limit": 3.0})
    episode = s2.Episode(s2.generate(config, 5), s2.SocialPlanner(), observers=[s2.JsonRecorder(path)])
    episode.run()
    return {
        "scene": episode.scene,
        "snapshot": episode.snapshot(),
        "episode": episode,
        "record": s2.read_episode(path),
    }


def picture_of(text: str) -> Image.Image:
    """The picture that a table of a notebook holds."""
    found = re.search(r'src="data:image/png;base64,([^"]+)"', text)
    assert found is not None
    return Image.open(io.BytesIO(base64.b64decode(found[1])))


def test_what_is_printed_fits_one_line(shown: dict[str, Any]) -> None:
    assert repr(shown["scene"]) == "<Scene lively/square, seed 5, episode 0: 4 people, 5 objects>"
    assert repr(shown["snapshot"]) == "<Snapshot of lively/square, seed 5, episode 0: tick 30, 3 s, 4 people>"
    assert repr(shown["episode"]) == "<Episode of lively/square, seed 5, episode 0: SocialPlanner, 30 ticks, timeout>"
    assert repr(shown["record"]) == "<EpisodeRecord run of lively/square: 30 frames, 3 s, 4 people, timeout>"
    assert repr(shown["snapshot"].humans) == "<Humans: 4 people>"
    assert repr(shown["record"].states) == "<States: 31 ticks, 4 people>"
    own = "ScenarioConfig(name='custom', humans=IntRange(min=3, max=3))"
    assert repr(s2.ScenarioConfig(humans=3)) == own
    settings = s2.load_scenario("empty").changed(rules={"time_limit": 5.0, "guard": False})
    assert "rules=Rules(time_limit=5.0, guard=False)" in repr(settings)
    assert len(repr(settings)) < 600  # 3900 characters with all settings
    assert "running>" in repr(s2.Episode(shown["scene"]))
    assert repr(s2.Orca()) == "Orca(speed=0.9, gain=2.0, model='orca2011')"
    assert repr(s2.SocialPlanner()).startswith("SocialPlanner(ahead=0.4, ")
    assert len(repr(s2.HumanLike())) <= 200
    recorder = s2.EpisodeRecorder()
    assert repr(recorder) == "<EpisodeRecorder: empty>"
    recorder.open(shown["scene"], ControllerInfo("x"))
    assert repr(recorder) == "<EpisodeRecorder: lively/square, 0 frames>"


@pytest.mark.parametrize("kind", KINDS)
def test_a_table_of_a_notebook_has_facts_and_a_picture(shown: dict[str, Any], kind: str) -> None:
    text = shown[kind]._repr_html_()
    HTMLParser().feed(text)
    assert f"<strong>{type(shown[kind]).__name__}</strong>" in text
    assert "lively/square" in text
    assert len(text) < 100_000
    with picture_of(text) as picture:
        assert max(picture.size) > 200
        assert len(np.unique(np.asarray(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 50


def test_the_picture_of_an_episode_shows_its_paths(shown: dict[str, Any]) -> None:
    first, last = (picture_of(shown[kind]._repr_html_()) for kind in ("scene", "record"))
    orange = [  # the path of the robot, among the colours of nothing else
        int(((pixels[..., 0] > 200) & (abs(pixels[..., 1] - 120) < 60) & (pixels[..., 2] < 100)).sum())
        for pixels in (np.asarray(picture.convert("RGB")).astype(int) for picture in (first, last))
    ]
    assert orange[1] > orange[0] + 50


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("suffix", [".png", ".svg", ".html"])
def test_every_kind_can_be_saved(shown: dict[str, Any], kind: str, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    shown[kind].save(path)
    assert path.stat().st_size > 1000


def test_an_episode_is_saved_as_its_record_is(shown: dict[str, Any], tmp_path: Path) -> None:
    """The recorded numbers are rounded, so a few pixels may differ; the frames and texts of the page are the same."""
    sizes = []
    for kind in ("episode", "record"):
        shown[kind].save(tmp_path / f"{kind}.gif", size=(200, 200), fps=5)
        with Image.open(tmp_path / f"{kind}.gif") as film:
            sizes.append((film.size, film.n_frames))
    assert sizes[0] == sizes[1]
    for kind in ("episode", "record"):
        shown[kind].save(tmp_path / f"{kind}.png", size=(300, 300))
    pictures = [
        np.asarray(Image.open(tmp_path / f"{kind}.png").convert("RGB")).astype(int) for kind in ("episode", "record")
    ]
    assert (abs(pictures[0] - pictures[1]).max(axis=2) > 8).mean() < 0.01


def test_a_single_state_makes_no_film(shown: dict[str, Any], tmp_path: Path) -> None:
    for kind in ("scene", "snapshot"):
        with pytest.raises(RenderError, match="a single state makes no film"):
            shown[kind].save(tmp_path / "a.gif")
    with pytest.raises(RenderError, match="end the name in one of"):
        shown["record"].save(tmp_path / "a.jpg")
    with pytest.raises(RenderError, match="strip has no effect"):
        shown["record"].save(tmp_path / "a.svg", strip=3)


def test_in_a_notebook_pictures_and_pages_appear_below_the_cell(
    shown: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    displayed: list[dict[str, Any]] = []
    display = types.SimpleNamespace(display=lambda data, raw: displayed.append(data))
    ipython = types.SimpleNamespace(get_ipython=lambda: types.SimpleNamespace(kernel=object()), display=display)
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    shown["record"].show(size=(320, 320))
    shown["episode"].animate()
    with Image.open(io.BytesIO(displayed[0]["image/png"])) as picture:
        assert picture.size == (320, 320)
    frame = displayed[1]["text/html"]
    found = re.search(r'srcdoc="([^"]*)"', frame)
    assert found is not None
    assert html.unescape(found[1]).lstrip().lower().startswith("<!doctype html>")
    assert 'sandbox="allow-scripts"' in frame


def test_without_a_notebook_the_browser_is_opened(shown: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda url: bool(opened.append(url)) or True)
    shown["snapshot"].show()
    shown["record"].animate()
    assert [url.rpartition(".")[2] for url in opened] == ["png", "html"]
    monkeypatch.setattr(webbrowser, "open", lambda url: False)
    with pytest.raises(RenderError, match=r"neither a notebook nor a browser; save\(\"episode.png\"\)"):
        shown["scene"].show()


def test_printing_imports_no_pygame() -> None:
    code = "import sys, sonata2d as s2; print(s2.generate(s2.load_scenario('empty'), 1)); "
    code += "sys.exit('pygame' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_every_kind_is_drawable(shown: dict[str, Any]) -> None:
    assert all(isinstance(shown[kind], Drawable) for kind in KINDS)
    assert shown["episode"].outcome.status == "timeout"  # drawing has not continued it
