"""Pictures and pages in notebooks, and in a browser without one; `core.drawable` calls these functions."""

from __future__ import annotations

import html
import importlib
import tempfile
import webbrowser
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.files.locations import location
from ..core.notebook import notebook_shell
from ..errors import RenderError
from .drawing import drawing_of
from .episode_files import render
from .episode_page import page_of
from .film import FILM_SUFFIXES
from .layers import Layers
from .sheets import Sheet
from .stills import Still, filmstrip, write_file
from .trails import Trails

_CARD_SIDE = 320  # px, longer side of the picture beside a table
_PAGE_HEIGHT = 640  # px, of a page below a cell


def save(subject: object, path: str | Path, **options: Any) -> None:
    """See `Drawable.save`."""
    drawing = drawing_of(subject)
    is_still = len(drawing.snapshots) == 1
    if is_still and location(path).suffix.lower() in FILM_SUFFIXES:
        raise RenderError(f"{path}: a single state makes no film; end the name in .png, .svg or .html")
    render(
        drawing.snapshots, path, outcome=drawing.outcome, commands=drawing.commands, labels=drawing.labels, **options
    )


def show(
    subject: object,
    *,
    size: tuple[int, int] | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
) -> None:
    """See `Drawable.show`."""
    drawing = drawing_of(subject)
    still = Still(
        drawing.snapshots[-1],
        size=size,
        layers=layers or Layers(legend=True),
        trails=Trails.of(drawing.snapshots) if len(drawing.snapshots) > 1 else None,
        caption=caption,
        outcome=drawing.outcome,
    )
    _show_picture(still.pixels().content())


def animate(subject: object, *, layers: Layers | None = None, caption: str | None = None) -> None:
    """See `Drawable.animate`."""
    show_page(page_of([drawing_of(subject)], layers=layers, caption=caption))


def show_page(page: str, *, height: int = _PAGE_HEIGHT) -> None:
    """Show a page below the cell of a notebook, in a frame of its own, else in a browser.

    Args:
        page: HTML, with everything that it needs.
        height: of the frame, px.

    Raises:
        RenderError: there is neither a notebook nor a browser.
    """
    frame = (
        f'<iframe srcdoc="{html.escape(page)}" style="width: 100%; height: {height}px; border: 0" '
        'sandbox="allow-scripts"></iframe>'
    )
    _show("text/html", frame, page.encode(), ".html")


def save_sheet(subjects: Iterable[object], titles: Sequence[str], path: str | Path, **options: Any) -> None:
    """See `Dataset.save`."""
    _sheet(subjects, titles).save(path, **options)


def show_sheet(subjects: Iterable[object], titles: Sequence[str]) -> None:
    """See `Dataset.show`."""
    _show_picture(_sheet(subjects, titles).pixels().content())


def animate_sheet(subjects: Iterable[object], titles: Sequence[str]) -> None:
    """See `Dataset.animate`."""
    show_page(_sheet(subjects, titles).page(), height=_PAGE_HEIGHT + 200)


def _sheet(subjects: Iterable[object], titles: Sequence[str]) -> Sheet:
    return Sheet([drawing_of(subject) for subject in subjects], titles)


def card(title: str, facts: Mapping[str, object], subjects: Iterable[object], titles: Sequence[str] = ()) -> str:
    """A table of facts beside pictures, as HTML that fits light and dark notebooks.

    Args:
        title: above the table.
        facts: text by name.
        subjects: of each the last state is drawn, with paths, and without caption and legend.
        titles: below the pictures, if there are several; the outcomes are added.
    """
    drawings = [drawing_of(subject) for subject in subjects]
    side = _CARD_SIDE if len(drawings) == 1 else _CARD_SIDE // 2
    captions = [html.escape(f"{text}: {drawing.outcome}") for text, drawing in zip(titles, drawings, strict=False)]
    pictures = "".join(
        '<div style="display: inline-block; text-align: center; margin: 0 8px 8px 0">'
        f'<img src="{filmstrip(drawing.snapshots, [len(drawing.snapshots) - 1])[0]}" alt="{html.escape(title)}" '
        f'style="max-width: {side}px; max-height: {side}px"/>'
        f"{f'<br><small>{captions[k]}</small>' if k < len(captions) else ''}</div>"
        for k, drawing in enumerate(drawings)
    )
    rows = "".join(
        f'<tr><th style="text-align: left; white-space: nowrap; vertical-align: top">{html.escape(name)}</th>'
        f'<td style="text-align: left">{html.escape(str(value))}</td></tr>'
        for name, value in facts.items()
    )
    return (
        '<div style="display: flex; flex-wrap: wrap; gap: 1.5em; align-items: flex-start">'
        f'<div style="flex: 0 1 {_CARD_SIDE + 24}px">{pictures}</div>'
        f'<div style="flex: 1 1 16em; min-width: 0; overflow-wrap: anywhere"><strong>{html.escape(title)}</strong>'
        f"<table>{rows}</table></div></div>"
    )


def _show_picture(content: bytes) -> None:
    _show("image/png", content, content, ".png")


def _show(media_type: str, below_cell: object, content: bytes, suffix: str) -> None:
    """Show data below the cell of a notebook, or the content of a file in the browser.

    Raises:
        RenderError: there is neither a notebook nor a browser.
    """
    if notebook_shell() is not None:
        importlib.import_module("IPython.display").display({media_type: below_cell}, raw=True)
        return
    path = Path(tempfile.mkdtemp(prefix="sonata2d-")) / f"episode{suffix}"
    write_file(path, content)
    if not webbrowser.open(path.as_uri()):
        raise RenderError(f'there is neither a notebook nor a browser; save("episode{suffix}") writes a file')
