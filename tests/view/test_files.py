import base64
import io
import json
import math
import re
import sys
from collections import deque
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pygame
import pytest
from PIL import Image

from sonata2d.core.proxemics import clearance
from sonata2d.core.snapshot import Contact
from sonata2d.errors import RenderError
from sonata2d.view.episode_files import render
from sonata2d.view.film import _sampled, _tail, save_film
from sonata2d.view.interpolation import between
from sonata2d.view.layers import Layers
from sonata2d.view.palette import PURPLE
from sonata2d.view.stills import _MOMENT_SIDE, filmstrip, picture, save_moment
from sonata2d.view.trails import Trails

from .conftest import pixels, snapshot_at

SIZE = (240, 220)


@pytest.mark.parametrize("suffix", ["png", "gif", "mp4", "html", "PNG"])
def test_every_suffix_gives_a_reproducible_file(tmp_path, episode, suffix):
    first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    for path in (first, second):
        render(episode, path, size=None if suffix == "html" else SIZE, outcome="goal")
    assert first.stat().st_size > 1000
    assert first.read_bytes() == second.read_bytes()


def test_pictures_can_be_opened(tmp_path, episode):
    render(episode, tmp_path / "a.png", size=SIZE)
    render(episode, tmp_path / "strip.png", strip=3)
    with Image.open(tmp_path / "a.png") as single, Image.open(tmp_path / "strip.png") as strip:
        assert single.size == SIZE
        assert strip.width > 2 * strip.height


def test_a_gif_shows_every_tick_at_the_given_rate(tmp_path, episode):
    render(episode, tmp_path / "a.gif", size=SIZE)
    with Image.open(tmp_path / "a.gif") as film:
        assert film.size == SIZE
        assert film.n_frames >= len(episode)
        assert film.info["duration"] == 100
        assert film.convert("RGB").getpixel((0, 0)) == (255, 255, 255)


def test_a_gif_has_the_shape_of_the_room(tmp_path, episode):
    save_film(tmp_path / "a.gif", episode[:2], layers=Layers(caption=False))
    with Image.open(tmp_path / "a.gif") as film:
        width, height = film.size
        assert (width, height) == (6.6 * 80, 5.6 * 80)  # the room of 6 by 5 m with a margin, 80 px/m
        dark = np.asarray(film.convert("L")) < 120
    columns, rows = dark.any(axis=0).nonzero()[0], dark.any(axis=1).nonzero()[0]
    assert max(columns[0], width - 1 - columns[-1], rows[0], height - 1 - rows[-1]) < 0.3 * 80
    wide = [
        replace(s, scene=replace(s.scene, polygon=((0, 0), (20, 0), (20, 4), (0, 4)), walls=())) for s in episode[:2]
    ]
    save_film(tmp_path / "b.gif", wide, layers=Layers(caption=False))
    with Image.open(tmp_path / "b.gif") as film:
        assert film.size == (640, math.ceil(4.6 * 640 / 20.6))


def test_an_mp4_has_even_sides_and_the_length_of_the_episode(tmp_path, episode):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    render(episode, tmp_path / "a.mp4", size=(241, 219), fps=20)
    assert next(ffmpeg.read_frames(str(tmp_path / "a.mp4")))["size"] == (240, 218)
    frames, _ = ffmpeg.count_frames_and_secs(str(tmp_path / "a.mp4"))
    assert frames == 22 + 1 + 30  # every half tick, the last snapshot, and the hold at the end


@pytest.mark.parametrize("settings", [{"speed": 3.0}, {"fps": 50.0}, {"layers": Layers(legend=True)}])
def test_a_film_reports_each_snapshot_once(tmp_path, episode, settings):
    steps = []
    render(episode, tmp_path / "a.gif", size=SIZE, advance=steps.append, **settings)
    assert steps == [1] * len(episode)


def test_pictures_between_ticks_are_interpolated(episode):
    fine = [shown for shown, _ in _sampled(episode, 0.05, interpolate=True)]
    assert [round(s.time, 6) for s in fine] == [round(0.05 * k, 6) for k in range(23)]
    assert fine[3].robot.position[0] == pytest.approx(1.15)
    assert np.hypot(*fine[3].humans.direction.T) == pytest.approx(1.0)
    coarse = [shown for shown, _ in _sampled(episode, 0.05, interpolate=False)]
    assert coarse[3].robot.position == episode[1].robot.position


def test_a_film_shows_the_paths_of_the_last_four_seconds(scene):
    ticks = deque(snapshot_at(scene, tick) for tick in range(60))
    shown = between(ticks[57], ticks[58], 0.25)
    while ticks[-1].tick > 57:
        ticks.pop()
    trails = _tail(ticks, shown)
    assert (trails.time[0], trails.time[-1]) == pytest.approx((1.725, 5.725))
    assert trails.time[1:-1] == pytest.approx(np.arange(18, 58) / 10)  # through the positions at ticks
    assert trails.robot[0].tolist() == pytest.approx([2.725, 0.5])
    assert ticks[0].tick == 17  # earlier ones are not needed any more
    assert _tail(deque([ticks[-1]]), ticks[-1]).time.tolist() == [5.7]


class ScriptParser(HTMLParser):
    """Collects the scripts and all attributes of a page."""

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


def test_a_page_needs_no_network_and_escapes_texts(tmp_path, scene, episode):
    nasty = "</script><script>alert(1)</script>\u2028&\"'"
    named = [replace(snapshot, scene=replace(scene, name=nasty)) for snapshot in episode]
    labels = [{"note": nasty}, None, *["calm"] * 10]
    render(named, tmp_path / "a.html", outcome=nasty, labels=labels, commands=np.full((12, 3), 0.5))
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert not re.search(r"https?:|//[a-z0-9.]+\.[a-z]{2}|@import|\bfetch\(|XMLHttpRequest", text)
    parser = ScriptParser()
    parser.feed(text)
    assert not {"src", "href"} & {name for name, _ in parser.attributes}
    assert len(parser.scripts) == 2
    data = json.loads(parser.scripts[0])
    assert data["outcome"] == nasty
    assert data["labels"] == [f"note {nasty}", "", *["calm"] * 10]


def test_a_page_holds_the_episode(tmp_path, episode):
    changed = list(episode)
    others = np.delete(np.arange(len(episode[5].humans)), 1)
    changed[5] = replace(changed[5], humans=changed[5].humans.select(others))
    changed[7] = replace(changed[7], interactions=())
    render(changed, tmp_path / "a.html", commands=[(1.0, 0.0, 0.1)] * 12)
    parser = ScriptParser()
    parser.feed((tmp_path / "a.html").read_text(encoding="utf-8"))
    data = json.loads(parser.scripts[0])
    states = data["states"]
    assert states[5]["people"][1] is None
    assert states[5]["people"][0][:2] == [1.2, 1.6]
    assert [state["robot"][0] for state in states] == pytest.approx([1.0 + 0.1 * k for k in range(12)])
    assert [tick for tick, state in enumerate(states) if "links" in state] == [0, 7, 8]
    assert data["commands"][3] == [1.0, 0.0, 0.1]
    assert states[0]["clearance"] == pytest.approx(clearance(episode[0]), abs=1e-3)


def test_a_page_explains_its_symbols_in_the_words_of_the_pictures(tmp_path, scene, episode):
    everything = Layers(legend=True, zones=True)
    save_moment(tmp_path / "a.svg", snapshot_at(scene), layers=everything, trails=Trails.of(episode), size=(1200, 900))
    render([snapshot_at(scene)], tmp_path / "a.html")
    keys = re.findall(r'<span data-layer="(\w*)"><svg .*?</svg>(.*?)</span>', (tmp_path / "a.html").read_text())
    assert [words for _, words in keys] == [words for words in legend_of(tmp_path / "a.svg") if words != "shared space"]
    assert ("gaze", "field of view") in keys
    assert ("", "using an object") in keys


def test_an_unknown_suffix_lists_the_known_ones(tmp_path, episode):
    with pytest.raises(RenderError, match=r"\.png, \.gif, \.mp4, \.html"):
        render(episode, tmp_path / "a.jpeg")


@pytest.mark.parametrize("suffix", ["png", "gif", "mp4", "html"])
def test_an_empty_episode_and_a_missing_folder_are_rejected(tmp_path, episode, suffix):
    with pytest.raises(RenderError, match="no frame"):
        render([], tmp_path / f"a.{suffix}")
    with pytest.raises(RenderError, match="cannot write"):
        render(episode[:2], tmp_path / "nowhere" / f"a.{suffix}")


@pytest.mark.parametrize(("suffix", "module"), [("gif", "PIL.Image"), ("mp4", "imageio_ffmpeg")])
def test_a_missing_package_gives_a_message_of_one_line(tmp_path, episode, monkeypatch, suffix, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(RenderError, match=r"pip install 'sonata2d\[video\]'") as error:
        render(episode, tmp_path / f"a.{suffix}", size=SIZE)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("strip", [0, -1, 13])
def test_a_strip_has_at_most_as_many_moments_as_snapshots(tmp_path, episode, strip):
    with pytest.raises(RenderError, match="ask for 1 to 12"):
        render(episode, tmp_path / "a.png", strip=strip)


@pytest.mark.parametrize("settings", [{"fps": 0.0}, {"speed": -1.0}, {"fps": 500.0}, {"speed": 0.0}])
def test_fps_and_speed_out_of_range_are_rejected(tmp_path, episode, settings):
    with pytest.raises(RenderError, match="cannot film"):
        render(episode, tmp_path / "a.gif", **settings)


SVG = "{http://www.w3.org/2000/svg}"


def of_kind(root, kind):
    return [group for group in root.iter(f"{SVG}g") if group.get("class") == kind]


@pytest.mark.parametrize("view", ["top", "follow"])
def test_an_svg_holds_every_entity_as_shapes(tmp_path, scene, view):
    snapshot = snapshot_at(scene)
    snapshot = replace(snapshot, humans=snapshot.humans.select(np.delete(np.arange(len(scene.humans)), 4)))
    layers = Layers(zones=True, velocities=True, ids=True)
    save_moment(tmp_path / "a.svg", snapshot, view=view, size=(500, 400), layers=layers)
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    assert (root.tag, root.get("width"), root.get("height")) == (f"{SVG}svg", "500", "400")
    assert root.get("viewBox") == "0 0 500 400"
    assert len(of_kind(root, "person")) == 5
    assert len(of_kind(root, "thing")) == len(scene.furniture)
    assert len(of_kind(root, "robot")) == len(of_kind(root, "goal")) == 1
    assert not list(root.iter(f"{SVG}image"))


def test_text_in_an_svg_is_text(tmp_path, scene):
    nasty = "</text> & \"<script>\" \0 'x'"
    save_moment(tmp_path / "a.svg", snapshot_at(scene), caption=nasty)
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    texts = [element.text for element in root.iter(f"{SVG}text")]
    assert nasty.replace("\0", "") in texts
    assert not list(root.iter(f"{SVG}script"))


def test_svg_and_png_are_nearly_equal(tmp_path, scene, episode):
    layers = Layers(caption=False, ids=False, legend=False)
    furniture = tuple(item for item in scene.furniture if item.type != "crate")  # its name is text; fonts differ
    snapshot = replace(episode[-1], scene=replace(scene, furniture=furniture))
    for name in ("a.svg", "a.png"):
        save_moment(tmp_path / name, snapshot, size=(600, 500), layers=layers, trails=Trails.of(episode))
    try:
        vectors = pygame.image.load(tmp_path / "a.svg")
    except pygame.error:
        pytest.skip("this pygame reads no SVG")
    a, b = (pixels(drawn) for drawn in (vectors, pygame.image.load(tmp_path / "a.png")))
    assert a.shape == b.shape
    assert np.abs(a - b).mean() < 2.5
    assert np.abs(a[::-1] - b).mean() > 5.0


def test_an_svg_of_an_episode_holds_outcome_and_paths(tmp_path, episode):
    render(episode, tmp_path / "a.svg", size=(400, 300), outcome="goal")
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    texts = [element.text or "" for element in root.iter(f"{SVG}text")]
    assert any("goal" in text for text in texts)
    render(episode[-1:], tmp_path / "b.svg", size=(400, 300))
    other = ElementTree.parse(tmp_path / "b.svg").getroot()
    assert len(list(root.iter(f"{SVG}polyline"))) > len(list(other.iter(f"{SVG}polyline"))) + 5


def test_a_legend_lists_each_activity_that_occurs_once(tmp_path, scene):
    snapshot = snapshot_at(scene)
    few = replace(snapshot, humans=replace(snapshot.humans, activity_index=np.array([1, 1, 1, 3, 3, 1])))
    save_moment(tmp_path / "a.svg", few, layers=Layers(legend=True))
    assert legend_of(tmp_path / "a.svg") == [
        "walking", "talking", "ignores the robot", "field of view", "robot", "goal", "interaction of people",
        "looks at a thing, or works at it",
    ]  # fmt: skip


def legend_of(path):
    """The texts of the legend of an SVG."""
    (legend,) = of_kind(ElementTree.parse(path).getroot(), "legend")
    return [element.text for element in legend.iter(f"{SVG}text")]


def test_a_legend_explains_the_layers_that_are_drawn(tmp_path, scene, episode):
    layers = Layers(legend=True, zones=True, gaze=False, links=False)
    save_moment(tmp_path / "a.svg", snapshot_at(scene), layers=layers, trails=Trails.of(episode))
    texts = legend_of(tmp_path / "a.svg")
    assert texts[-3:] == ["paths", "intimate space 0.45 m, personal 1.2 m", "shared space"]
    assert not {"field of view", "interaction of people", "looks at a thing, or works at it"} & {*texts}


def test_a_legend_explains_the_rings_on_the_path_and_the_rim_during_a_contact(tmp_path, scene, episode):
    layers, trails = Layers(legend=True), Trails.of(episode)
    long = replace(trails, time=np.linspace(0.0, 12.0, len(trails.time)))
    touching = replace(snapshot_at(scene), contacts=(Contact("wall", 0, robot_at_fault=True, other_at_fault=False),))
    save_moment(tmp_path / "a.svg", touching, layers=layers, trails=long, size=(1200, 900))
    assert {"every 5 s", "robot in contact"} <= {*legend_of(tmp_path / "a.svg")}
    save_moment(tmp_path / "b.svg", snapshot_at(scene), layers=layers, trails=replace(long, is_tail=True))
    assert not {"every 5 s", "robot in contact"} & {*legend_of(tmp_path / "b.svg")}


def test_a_legend_is_below_the_room_and_within_the_size(scene):
    with_legend, without = (
        picture(snapshot_at(scene), scale=60.0, layers=Layers(legend=legend)) for legend in (True, False)
    )
    assert with_legend.get_height() > without.get_height()
    assert (pixels(with_legend)[:, : without.get_height()] == pixels(without)).all()
    assert picture(snapshot_at(scene), size=(640, 480), layers=Layers(legend=True)).get_size() == (640, 480)
    tiny = [pixels(picture(snapshot_at(scene), size=SIZE, layers=Layers(legend=legend))) for legend in (True, False)]
    assert (tiny[0] == tiny[1]).all()  # it would take more than a quarter of the height


def test_the_legend_of_a_film_is_that_of_all_its_pictures(tmp_path, episode):
    walking, talking = (replace(episode[0].humans, activity_index=np.full(6, kind)) for kind in (1, 3))
    layers = Layers(legend=True, caption=False, links=False)
    first, last = replace(episode[0], humans=walking), replace(episode[1], humans=talking)
    for name, snapshots in {"walking": [first], "both": [first, last]}.items():
        save_film(tmp_path / f"{name}.gif", snapshots, scale=100.0, layers=layers)
    with Image.open(tmp_path / "walking.gif") as one, Image.open(tmp_path / "both.gif") as both:
        legends = [np.asarray(film.convert("RGB").crop((0, 560, 660, 582))).astype(int) for film in (one, both)]
        # of the first picture, in which nobody talks
        assert (np.abs(legends[0] - PURPLE).sum(axis=2) < 30).sum() == 0
        assert (np.abs(legends[1] - PURPLE).sum(axis=2) < 30).sum() > 5


def test_pictures_that_cannot_be_written_are_rejected(tmp_path, scene, episode):
    with pytest.raises(RenderError, match=r"end the name in \.png or \.svg"):
        save_moment(tmp_path / "a.gif", snapshot_at(scene))
    with pytest.raises(RenderError, match="cannot write"):
        save_moment(tmp_path / "nowhere" / "a.svg", snapshot_at(scene))
    with pytest.raises(RenderError, match="needs a size"):
        save_moment(tmp_path / "a.svg", snapshot_at(scene), view="follow", size=None)


@pytest.mark.parametrize(
    ("suffix", "settings"),
    [
        ("gif", {"strip": 3}), ("svg", {"strip": 3}), ("png", {"fps": 5.0}), ("png", {"speed": 2.0}),
        ("html", {"size": SIZE}), ("html", {"scale": 40.0}), ("png", {"strip": 3, "size": SIZE}),
    ],
)  # fmt: skip
def test_an_argument_without_effect_on_the_format_is_rejected(tmp_path, episode, suffix, settings):
    with pytest.raises(RenderError, match="has no effect"):
        render(episode, tmp_path / f"a.{suffix}", **settings)
    assert not [*tmp_path.iterdir()]


def url_pixels(url):
    """(height, width, 4) of int, from a data URL."""
    kind, data = url.split(",")
    assert kind == "data:image/png;base64"
    with Image.open(io.BytesIO(base64.b64decode(data))) as image:
        return np.asarray(image.convert("RGBA")).astype(int)


def test_moments_show_the_whole_room_and_differ_only_where_agents_move(episode):
    first, again, last = (url_pixels(url) for url in filmstrip(episode, [0, 0, 11]))
    assert first.shape == (math.ceil(5.6 * _MOMENT_SIDE / 6.6), _MOMENT_SIDE, 4)
    assert (first == again).all()
    changed = (first != last).any(axis=2)
    assert 0.002 < changed.mean() < 0.1  # only the robot and its path


def test_moments_are_transparent_outside_the_room(episode):
    (only,) = (url_pixels(url) for url in filmstrip(episode, [3]))
    assert only[5, -5, 3] == 0  # beyond the corner of the L
    assert (only[-200:-40, 40:-40, 3] == 255).all()  # the foot of the L


@pytest.mark.parametrize("indices", [[], [12], [0, -1]])
def test_indices_out_of_range_are_rejected(episode, indices):
    with pytest.raises(RenderError, match=r"ask for some of 0\.\.11"):
        filmstrip(episode, indices)
