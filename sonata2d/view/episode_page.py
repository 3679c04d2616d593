"""HTML pages that play episodes offline: the room as an image, the agents as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader

from ..core.snapshot import Snapshot
from ..errors import RenderError
from .annotations import origin, value_text
from .drawing import Drawing
from .layers import Layers
from .legend import Legend, english
from .scene_data import UNDRAWN, legend_data, scene_data, states_data
from .stills import filmstrip

_SWITCHES = {  # layers that have a check box on the page, and its text; the legend has the same words
    "trails": english("paths"),
    "gaze": english("gaze"),
    "links": english("interaction"),
    "goal": english("goal"),
    "zones": "intimate and personal space",
    "ids": "ids",
    "attributes": "attributes",
}
_LAYERS = {"gaze": "gaze", "interaction": "links", "goal": "goal", "paths": "trails", "zones": "zones"}  # of symbols


def page_of(
    drawings: Sequence[Drawing],
    labels: Sequence[str] = ("",),
    *,
    layers: Layers | None = None,
    caption: str | None = None,
) -> str:
    """A page that plays episodes: play, scrub, step, speed; the pointer shows the values of an entity.

    Args:
        drawings: of the episodes; several have a button each.
        labels: of the buttons.
        layers: layers that are visible at first; the page has a check box for most of them.
        caption: title; by default the scenario's name.

    Raises:
        RenderError: an episode has no snapshots.
    """
    if not all(drawing.snapshots for drawing in drawings):
        raise RenderError("there is nothing to draw: the episode holds no frame")
    environment = Environment(loader=PackageLoader(__package__, "."), autoescape=True)
    # the filter `tojson` escapes `<`, so that no text can end the script element
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    scenes, is_single = [drawing.snapshots[-1].scene for drawing in drawings], len(drawings) == 1
    episodes = [
        {
            "title": scene.name if caption is None else caption,
            "subtitle": origin(scene),
            "label": label,
            "picture": None if is_single else filmstrip(drawing.snapshots, [len(drawing.snapshots) - 1])[0],
            "legend": _legend(drawing.snapshots),
            "data": _episode_data(drawing, layers or Layers()),
        }
        for drawing, scene, label in zip(drawings, scenes, labels, strict=True)
    ]
    title = episodes[0]["title"] if is_single else f"{len(episodes)} episodes"
    page: str = environment.get_template("page.html").render(title=title, episodes=episodes)
    return page


def _episode_data(drawing: Drawing, layers: Layers) -> dict[str, Any]:
    """The scene, all states, commands and labels of an episode."""
    scene = drawing.snapshots[0].scene
    unknown = ({"gaze"} if "heads" in scene.unmeasured else set()) | ({"goal"} & scene.unmeasured)
    unknown |= set() if scene.attributes else {"attributes"}
    is_driven = "robot" not in scene.unmeasured
    rows = None if drawing.commands is None else np.asarray(drawing.commands, dtype=float).round(3).tolist()
    labels = None
    if is_driven and drawing.labels is not None:
        labels = ["" if label is None else value_text(label) for label in drawing.labels]
    return scene_data(scene, layers) | {
        "states": states_data(drawing.snapshots),
        "layerTexts": _SWITCHES,
        "layers": {name: name == "trails" or getattr(layers, name) for name in _SWITCHES if name not in unknown},
        "commands": rows if is_driven else None,
        "labels": labels,
        "outcome": None if "outcome" in scene.unmeasured else drawing.outcome,
    }


def _legend(snapshots: Sequence[Snapshot]) -> list[dict[str, str]]:
    """The symbols of all layers of the page: meaning, name of the layer (empty if always visible), and drawing."""
    legend = Legend.of(snapshots, Layers(zones=True, legend=True), paths=True)
    return [
        entry | {"layer": _LAYERS.get(entry["name"], "")}
        for entry in legend_data(legend)
        if entry["name"] not in UNDRAWN
    ]
