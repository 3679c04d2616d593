"""Writes an episode as one HTML file that plays it offline: the room as an image, the agents as numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader

from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import RenderError
from .annotations import origin, value_text
from .layers import Layers
from .legend import Legend, english
from .scene_data import UNDRAWN, legend_data, scene_data, states_data
from .stills import write_file

_SWITCHES = {  # layers that have a check box on the page, and its text; the legend has the same words
    "trails": english("paths"),
    "gaze": english("gaze"),
    "links": english("interaction"),
    "goal": english("goal"),
    "zones": "intimate and personal space",
    "ids": "ids",
}
_LAYERS = {"gaze": "gaze", "interaction": "links", "goal": "goal", "paths": "trails", "zones": "zones"}  # of symbols


def save_page(
    path: str | Path,
    snapshots: Iterable[Snapshot],
    *,
    commands: Any = None,
    labels: Sequence[Any] | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
    outcome: str | None = None,
) -> None:
    """Write a page that plays an episode: play, scrub, step, speed; the pointer shows the values of an entity.

    Args:
        path: the file to write.
        snapshots: of one episode, in order.
        commands: (T, 3) or (T - 1, 3), as the last snapshot has no command: m/s, m/s, rad/s; body frame.
        labels: (T,) or (T - 1,): texts or JSON values.
        layers: layers that are visible at first; the page has a check box for most of them.
        caption: title; by default the scenario's name.
        outcome: how the episode ended, shown at its last tick.

    Raises:
        RenderError: `snapshots` is empty, or the file cannot be written.
    """
    page = page_of(snapshots, commands=commands, labels=labels, layers=layers, caption=caption, outcome=outcome)
    write_file(path, page.encode())


def page_of(
    snapshots: Iterable[Snapshot],
    *,
    commands: Any = None,
    labels: Sequence[Any] | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
    outcome: str | None = None,
) -> str:
    """The page that `save_page` writes, with the same arguments.

    Raises:
        RenderError: `snapshots` is empty.
    """
    snapshots = list(snapshots)
    if not snapshots:
        raise RenderError("there is nothing to draw: the episode holds no frame")
    scene = snapshots[0].scene
    layers = layers or Layers()
    data = scene_data(scene, layers) | {"states": states_data(snapshots), "layerTexts": _SWITCHES}
    data["layers"] = {name: name == "trails" or getattr(layers, name) for name in _switches(scene)}
    is_driven = "robot" not in scene.unmeasured
    data |= _controller_data(commands if is_driven else None, labels if is_driven else None)
    data["outcome"] = None if "outcome" in scene.unmeasured else outcome
    title = scene.name if caption is None else caption
    page: str = _template().render(title=title, subtitle=origin(scene), data=data, legend=_legend(snapshots))
    return page


def _template() -> Any:
    """The page's template; its `tojson` filter escapes `<`, so that no text can end the script element."""
    environment = Environment(loader=PackageLoader(__package__, "."), autoescape=True)
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment.get_template("page.html")


def _legend(snapshots: Sequence[Snapshot]) -> list[dict[str, str]]:
    """The symbols of all layers of the page: meaning, name of the layer (empty if always visible), and drawing."""
    legend = Legend.of(snapshots, Layers(zones=True, legend=True), paths=True)
    entries = legend_data(legend)
    return [entry | {"layer": _LAYERS.get(entry["name"], "")} for entry in entries if entry["name"] not in UNDRAWN]


def _switches(scene: Scene) -> list[str]:
    """The layers that have a check box on the page of a scene: those of which something is known."""
    unknown = {"gaze"} if "heads" in scene.unmeasured else set()
    unknown |= {"goal"} & scene.unmeasured
    return [name for name in _SWITCHES if name not in unknown]


def _controller_data(commands: Any, labels: Sequence[Any] | None) -> dict[str, Any]:
    """Commands and labels; each distinct label text is stored once."""
    rows = None if commands is None else np.asarray(commands, dtype=float).round(3).tolist()
    if labels is None:
        return {"commands": rows, "labels": None}
    texts = ["" if label is None else value_text(label) for label in labels]
    distinct = list(dict.fromkeys(texts))
    index = {text: k for k, text in enumerate(distinct)}
    return {"commands": rows, "labels": [index[text] for text in texts], "labelTexts": distinct}
