from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pygame
import pytest

from sonata2d.errors import RenderError
from sonata2d.view.draw import Layers
from sonata2d.view.files import render
from sonata2d.view.trails import Trails
from sonata2d.view.vector import save_moment

from .conftest import look

SVG = "{http://www.w3.org/2000/svg}"


def of_kind(root, kind):
    return [group for group in root.iter(f"{SVG}g") if group.get("class") == kind]


@pytest.mark.parametrize("view", ["top", "follow"])
def test_an_svg_holds_every_person_and_thing_as_shapes(tmp_path, scene, view):
    snapshot = look(scene)
    snapshot = replace(snapshot, humans=snapshot.humans.only(np.delete(np.arange(len(scene.humans)), 4)))
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
    save_moment(tmp_path / "a.svg", look(scene), caption=nasty)
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    texts = [element.text for element in root.iter(f"{SVG}text")]
    assert nasty.replace("\0", "") in texts
    assert not list(root.iter(f"{SVG}script"))


def test_an_svg_looks_like_the_png(tmp_path, scene, episode):
    layers = Layers(caption=False, ids=False, legend=False)
    things = tuple(thing for thing in scene.furniture if thing.type != "crate")  # its name is a text, and they vary
    snapshot = replace(episode[-1], scene=replace(scene, furniture=things))
    for name in ("a.svg", "a.png"):
        save_moment(tmp_path / name, snapshot, size=(600, 500), layers=layers, trails=Trails.of(episode))
    try:
        vectors = pygame.image.load(tmp_path / "a.svg")
    except pygame.error:
        pytest.skip("this pygame reads no SVG")
    a, b = (pygame.surfarray.array3d(one).astype(int) for one in (vectors, pygame.image.load(tmp_path / "a.png")))
    assert a.shape == b.shape
    assert np.abs(a - b).mean() < 2.5
    assert np.abs(a[::-1] - b).mean() > 5.0


def test_an_episode_renders_as_svg_with_its_ways(tmp_path, episode):
    render(episode, tmp_path / "a.svg", size=(400, 300), outcome="goal")
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    texts = [element.text or "" for element in root.iter(f"{SVG}text")]
    assert any("goal" in text for text in texts)
    render(episode[-1:], tmp_path / "b.svg", size=(400, 300))
    other = ElementTree.parse(tmp_path / "b.svg").getroot()
    assert len(list(root.iter(f"{SVG}polyline"))) > len(list(other.iter(f"{SVG}polyline"))) + 5


def test_a_legend_names_what_occurs_once(tmp_path, scene):
    snapshot = look(scene)
    few = replace(snapshot, humans=replace(snapshot.humans, activity_index=np.array([1, 1, 1, 3, 3, 1])))
    save_moment(tmp_path / "a.svg", few, layers=Layers(legend=True))
    legend = of_kind(ElementTree.parse(tmp_path / "a.svg").getroot(), "legend")
    assert [element.text for element in legend[0].iter(f"{SVG}text")] == ["walking", "talking", "robot", "goal"]


def test_what_cannot_be_written_is_told(tmp_path, scene, episode):
    with pytest.raises(RenderError, match=r"end the name in \.png or \.svg"):
        save_moment(tmp_path / "a.gif", look(scene))
    with pytest.raises(RenderError, match="cannot write"):
        save_moment(tmp_path / "nowhere" / "a.svg", look(scene))
    with pytest.raises(RenderError, match="needs a size"):
        save_moment(tmp_path / "a.svg", look(scene), view="follow", size=None)
    with pytest.raises(RenderError, match="side by side"):
        render(episode, tmp_path / "a.svg", strip=3)
