"""An episode as a film, drawn and encoded frame by frame: GIF by Pillow, MP4 by imageio-ffmpeg."""

from __future__ import annotations

import importlib
import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pygame

from ..core.snapshot import Snapshot
from ..errors import RenderError
from .caption import STRIP
from .draw import QUICK, Layers, backdrop, camera_for, picture
from .interpolation import between
from .palette import ACTIVITY, FLOOR, GOAL, GRID, INK, PAPER, ROBOT, WALL, mixed, time_colour
from .trails import Trails

_TAIL = 4.0  # s, how long the trails in a film are
_HOLD = 1.5  # s, the last picture stands
_GIF_SIDE = 640  # pixels, the usual longest side of a GIF


def save_film(
    path: str | Path,
    snapshots: Iterable[Snapshot],
    *,
    fps: float | None = None,
    speed: float = 1.0,
    interpolate: bool = True,
    size: tuple[int, int] | None = None,
    scale: float | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
    outcome: str | None = None,
) -> None:
    """Write a film of an episode; `.gif` or `.mp4`, told by the name.

    Args:
        snapshots: in order; taken one by one, so they may come straight from a reader.
        fps: pictures a second; 10 for a GIF, 30 for an MP4 unless given.
        speed: seconds of the episode in a second of the film.
        interpolate: show people between ticks too; otherwise each picture shows the last tick.
        size, scale, layers, caption, outcome: as for `picture`.

    Raises:
        RenderError: nothing to draw, a package is missing, or the film cannot be written.
    """
    path = Path(path)
    is_gif = path.suffix.lower() == ".gif"
    fps = (10.0 if is_gif else 30.0) if fps is None else fps
    if not (0.0 < fps <= 120.0 and 0.0 < speed < math.inf):
        raise RenderError(f"cannot film {fps:g} pictures a second at speed {speed:g}; fps is 0 to 120, speed above 0")
    if is_gif:
        fps = 100.0 / max(round(100.0 / fps), 2)  # a GIF counts in 1/100 s, and players slow down below 2 of them
        size = (_GIF_SIDE, _GIF_SIDE) if size is None and scale is None else size
    times = paced(snapshots, speed / fps, interpolate=interpolate)
    shown = _pictures(times, round(fps * _HOLD), size, scale, layers or Layers(), caption, outcome)
    try:
        (_write_gif if is_gif else _write_mp4)(path, shown, fps)
    except OSError as error:
        raise RenderError(f"cannot write {path}: {error}") from error


def paced(snapshots: Iterable[Snapshot], step: float, *, interpolate: bool = True) -> Iterator[Snapshot]:
    """The episode every `step` seconds, the first and the last moment included."""
    before, count = None, 0
    for after in snapshots:
        if before is None:
            start = after.time
        while before is not None and start + count * step < after.time - 1e-9:
            share = (start + count * step - before.time) / (after.time - before.time)
            yield between(before, after, share) if interpolate and share > 1e-9 else before
            count += 1
        before = after
    if before is not None:
        yield before


def _pictures(
    snapshots: Iterable[Snapshot],
    hold: int,
    size: tuple[int, int] | None,
    scale: float | None,
    layers: Layers,
    caption: str | None,
    outcome: str | None,
) -> Iterator[pygame.Surface]:
    """Every picture of the film; the room is drawn once, the last picture repeated `hold` times with the outcome."""
    camera, room, last = None, None, None
    tail: deque[Snapshot] = deque()
    for snapshot in snapshots:
        if camera is None or room is None:
            camera = camera_for(snapshot.scene, size=size, scale=scale, strip=STRIP if layers.caption else 0)
            room = backdrop(snapshot.scene, camera, layers, fine=QUICK)
        tail.append(last := snapshot)
        while tail[0].time < snapshot.time - _TAIL:
            tail.popleft()
        trails = Trails.of(tail, is_tail=True)
        yield picture(snapshot, layers=layers, trails=trails, caption=caption, camera=camera, room=room)
    if last is None:
        raise RenderError("there is nothing to film: the episode holds no frame")
    ending = picture(last, layers=layers, trails=trails, caption=caption, outcome=outcome, camera=camera, room=room)
    for _ in range(max(hold, 1)):
        yield ending


def _write_gif(path: Path, shown: Iterable[pygame.Surface], fps: float) -> None:
    """All pictures share one palette, made from the first and the colours yet to come."""
    image = _needed("PIL.Image")
    pictures = (image.frombytes("RGB", one.get_size(), pygame.image.tobytes(one, "RGB")) for one in shown)
    first = next(iter(pictures))
    palette = _gif_palette(image, first)
    flat = (one.quantize(palette=palette, dither=image.Dither.NONE) for one in pictures)
    head = first.quantize(palette=palette, dither=image.Dither.NONE)
    head.save(path, save_all=True, append_images=flat, duration=round(1000.0 / fps), loop=0, disposal=1)


def _gif_palette(image: Any, first: Any) -> Any:
    """A picture that holds the film's 256 colours: the drawing's own, and others that suit the first picture."""
    pale = [mixed(FLOOR, colour, 0.28) for colour in ACTIVITY.values()]
    ramp = [time_colour(k / 15) for k in range(16)]
    own = [FLOOR, PAPER, GRID, WALL, INK, ROBOT, GOAL, *ACTIVITY.values(), *pale, *ramp]
    flat = first.quantize(256 - len(own), dither=image.Dither.NONE).getpalette()[: 3 * (256 - len(own))]
    suited = [flat[k : k + 3] for k in range(0, len(flat) - 2, 3)]
    apart = [one for one in suited if all(_differ(one, colour) for colour in own)]
    palette = image.new("P", (1, 1))
    palette.putpalette([value for colour in [*own, *apart] for value in colour])
    return palette


def _differ(one: Sequence[int], other: Sequence[int]) -> bool:
    """Whether Pillow, which looks for the nearest colour in steps of 4, would take one for the other."""
    return max(abs(a - b) for a, b in zip(one, other, strict=True)) > 8


def _write_mp4(path: Path, shown: Iterator[pygame.Surface], fps: float) -> None:
    """H.264 in the colour format that every player knows, which wants sides of even length."""
    ffmpeg = _needed("imageio_ffmpeg")
    first = next(shown)
    path.open("wb").close()  # what cannot be written is better told by the system than by ffmpeg
    size = tuple(side - side % 2 for side in first.get_size())
    writer = ffmpeg.write_frames(
        str(path), size, fps=fps, codec="libx264", quality=None, macro_block_size=2,
        output_params=["-crf", "18", "-preset", "medium", "-movflags", "+faststart"],
    )  # fmt: skip
    writer.send(None)
    try:
        writer.send(pygame.image.tobytes(first.subsurface((0, 0, *size)), "RGB"))
        for one in shown:
            writer.send(pygame.image.tobytes(one.subsurface((0, 0, *size)), "RGB"))
    finally:
        writer.close()


def _needed(module: str) -> Any:
    """A module of the video extra.

    Raises:
        RenderError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        package = "pillow" if module.startswith("PIL") else "imageio-ffmpeg"
        raise RenderError(f"films need {package}, which is missing; pip install 'sonata2d[video]'") from None
