import json
import re
import sys
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from sonata2d.errors import RenderError
from sonata2d.view.files import render
from sonata2d.view.film import paced, save_film

SIZE = (240, 220)


@pytest.mark.parametrize("suffix", ["png", "gif", "mp4", "html", "PNG"])
def test_every_suffix_gives_a_file_and_the_same_one_again(tmp_path, episode, suffix):
    first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    for path in (first, second):
        render(episode, path, size=SIZE, outcome="goal")
    assert first.stat().st_size > 1000
    assert first.read_bytes() == second.read_bytes()


def test_pictures_open_again(tmp_path, episode):
    render(episode, tmp_path / "a.png", size=SIZE)
    render(episode, tmp_path / "strip.png", strip=3)
    with Image.open(tmp_path / "a.png") as one, Image.open(tmp_path / "strip.png") as strip:
        assert one.size == SIZE
        assert strip.width > 2 * strip.height


def test_a_gif_shows_every_tick_at_its_pace(tmp_path, episode):
    render(episode, tmp_path / "a.gif", size=SIZE)
    with Image.open(tmp_path / "a.gif") as film:
        assert film.size == SIZE
        assert film.n_frames >= len(episode)
        assert film.info["duration"] == 100
        assert film.convert("RGB").getpixel((0, 0)) == (255, 255, 255)


def test_an_mp4_has_even_sides_and_the_length_of_the_episode(tmp_path, episode):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    render(episode, tmp_path / "a.mp4", size=(241, 219), fps=20)
    assert next(ffmpeg.read_frames(str(tmp_path / "a.mp4")))["size"] == (240, 218)
    frames, _ = ffmpeg.count_frames_and_secs(str(tmp_path / "a.mp4"))
    assert frames == 22 + 1 + 30  # every half tick, the last moment, and the wait at the end


def test_a_film_takes_snapshots_one_by_one(tmp_path, episode):
    save_film(tmp_path / "a.gif", iter(episode), size=SIZE, speed=3.0)
    with Image.open(tmp_path / "a.gif") as film:
        assert 4 <= film.n_frames <= 6


def test_between_ticks_everything_is_on_its_way(episode):
    fine = list(paced(episode, 0.05))
    assert [round(s.time, 6) for s in fine] == [round(0.05 * k, 6) for k in range(23)]
    assert fine[3].robot.position[0] == pytest.approx(1.15)
    assert np.hypot(*fine[3].humans.direction.T) == pytest.approx(1.0)
    coarse = list(paced(episode, 0.05, interpolate=False))
    assert coarse[3].robot.position == episode[1].robot.position


class Reader(HTMLParser):
    def __init__(self):
        super().__init__()
        self.scripts, self.attributes, self.inside = [], [], False

    def handle_starttag(self, tag, attrs):
        self.attributes += attrs
        self.inside = tag == "script"
        self.scripts += [""] if self.inside else []

    def handle_data(self, data):
        if self.inside:
            self.scripts[-1] += data

    def handle_endtag(self, tag):
        self.inside = False


def test_a_page_needs_no_network_and_no_text_ends_its_script(tmp_path, scene, episode):
    nasty = "</script><script>alert(1)</script>\u2028&\"'"
    named = [replace(snapshot, scene=replace(scene, name=nasty)) for snapshot in episode]
    labels = [{"note": nasty}, None, *["calm"] * 10]
    render(named, tmp_path / "a.html", outcome=nasty, labels=labels, commands=np.full((12, 3), 0.5))
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert not re.search(r"https?:|//[a-z0-9.]+\.[a-z]{2}|@import|\bfetch\(|XMLHttpRequest", text)
    reader = Reader()
    reader.feed(text)
    assert not {"src", "href"} & {name for name, _ in reader.attributes}
    assert len(reader.scripts) == 2
    data = json.loads(reader.scripts[0])
    assert data["outcome"] == nasty
    assert data["labelTexts"] == [f"note {nasty}", "", "calm"]
    assert data["labels"] == [0, 1, *[2] * 10]


def test_a_page_holds_the_episode(tmp_path, episode):
    gone = list(episode)
    others = np.delete(np.arange(len(episode[5].humans)), 1)
    gone[5] = replace(gone[5], humans=gone[5].humans.only(others))
    gone[7] = replace(gone[7], interactions=())
    render(gone, tmp_path / "a.html", commands=[(1.0, 0.0, 0.1)] * 12)
    reader = Reader()
    reader.feed((tmp_path / "a.html").read_text(encoding="utf-8"))
    data = json.loads(reader.scripts[0])
    assert data["people"][1][5] is None
    assert data["people"][0][5][:2] == [1.2, 1.6]
    assert [row[0] for row in data["robot"]] == pytest.approx([1.0 + 0.1 * k for k in range(12)])
    assert [tick for tick, _ in data["links"]] == [0, 7, 8]
    assert data["commands"][3] == [1.0, 0.0, 0.1]
    assert data["clearance"][0] == pytest.approx(np.hypot(0.2, 1.1) - 0.5, abs=1e-3)


def test_an_unknown_suffix_names_the_four(tmp_path, episode):
    with pytest.raises(RenderError, match=r"\.png, \.gif, \.mp4, \.html"):
        render(episode, tmp_path / "a.jpeg")


@pytest.mark.parametrize("suffix", ["png", "gif", "mp4", "html"])
def test_an_empty_episode_and_a_missing_folder_are_told(tmp_path, episode, suffix):
    with pytest.raises(RenderError, match="no frame"):
        render([], tmp_path / f"a.{suffix}")
    with pytest.raises(RenderError, match="cannot write"):
        render(episode[:2], tmp_path / "nowhere" / f"a.{suffix}", size=SIZE)


@pytest.mark.parametrize(("suffix", "module"), [("gif", "PIL.Image"), ("mp4", "imageio_ffmpeg")])
def test_a_missing_package_is_told_in_one_line(tmp_path, episode, monkeypatch, suffix, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(RenderError, match=r"pip install 'sonata2d\[video\]'") as told:
        render(episode, tmp_path / f"a.{suffix}", size=SIZE)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("strip", [0, -1, 13])
def test_a_strip_has_no_more_moments_than_the_episode(tmp_path, episode, strip):
    with pytest.raises(RenderError, match="ask for 1 to 12"):
        render(episode, tmp_path / "a.png", strip=strip)


@pytest.mark.parametrize("asked", [{"fps": 0.0}, {"speed": -1.0}, {"fps": 500.0}, {"speed": 0.0}])
def test_a_film_has_a_sensible_pace(tmp_path, episode, asked):
    with pytest.raises(RenderError, match="cannot film"):
        render(episode, tmp_path / "a.gif", **asked)
