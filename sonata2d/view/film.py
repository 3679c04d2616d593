"""Writes an episode as a film, drawn and encoded picture by picture: GIF with Pillow, MP4 with imageio-ffmpeg."""

from __future__ import annotations

import importlib
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

import pygame

from ..core.files.locations import location
from ..core.notebook import ProgressBar
from ..core.relations import ACTIVITY
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import RenderError
from .canvas import PixelCanvas
from .draw import camera_for, draw_caption
from .interpolation import between
from .layers import Layers
from .legend import Legend
from .painter import Painter
from .palette import FLOOR, GOAL, GRID, INK, PAPER, PATHS, ROBOT, WALL, mixed, time_colour
from .projection import DEFAULT_SIDE, Camera
from .stills import written
from .trails import Trails, human_tones

FILM_SUFFIXES = (".gif", ".mp4")
_TAIL = 4.0  # s, duration that trails cover
_HOLD = 1.5  # s, duration of the last picture
_GIF_SIDE = 640  # px, default limit of the longer side of the room in a GIF
_GIF_AREAS = 64  # colours of the first picture that a GIF certainly has
_GIF_COLOUR_STEP = 8  # Pillow matches colours in steps of 4, so that it may confuse colours that differ by this


class FilmPainter:
    """Painter of a film of one scene.

    Args:
        scene: of all snapshots.
        camera: of the room in all pictures.
        layers: what to show.
        legend: of all pictures.
    """

    def __init__(self, scene: Scene, camera: Camera, layers: Layers, legend: Legend = Legend()) -> None:  # noqa: B008
        width, height = camera.size
        top = height + layers.strip
        self._camera, self._layers = camera, layers
        self._painter = Painter(scene, outside=PAPER, cut_zones=True)
        self._picture = PixelCanvas.blank((width, top + legend.height(width)))
        self._room = self._picture.surface.subsurface((0, 0, width, height))
        legend.draw(self._picture, top, width)

    def draw(
        self, snapshot: Snapshot, trails: Trails | None = None, caption: str | None = None, outcome: str | None = None
    ) -> PixelCanvas:
        """Draw a snapshot; arguments as for `picture`.

        Returns:
            The picture, which the next call changes.
        """
        self._painter.draw(self._room, snapshot, layers=self._layers, trails=trails, camera=self._camera)
        if self._layers.caption:
            width, height = self._camera.size
            self._picture.rectangle(PAPER, pygame.Rect(0, height, width, self._layers.strip))
            draw_caption(self._picture, self._camera, snapshot, trails, caption, outcome)
        return self._picture


def save_film(
    path: str | Path,
    snapshots: Sequence[Snapshot],
    *,
    fps: float | None = None,
    speed: float = 1.0,
    interpolate: bool = True,
    size: tuple[int, int] | None = None,
    scale: float | None = None,
    layers: Layers | None = None,
    caption: str | None = None,
    outcome: str | None = None,
    advance: Callable[[int], None] | None = None,
) -> None:
    """Write a film of an episode.

    Args:
        path: the file to write; the suffix `.gif` or `.mp4` selects the format.
        snapshots: of one episode, in order.
        fps: pictures per second; by default 10 for a GIF, 30 for an MP4.
        speed: seconds of the episode per second of the film.
        interpolate: interpolate between ticks; otherwise each picture shows the last tick, and a GIF is smaller.
        size, scale, layers, caption, outcome: as for `picture`; without size and scale, the longer side of a GIF's
            room has at most 640 px. The legend explains the whole film.
        advance: called with 1 for each snapshot that was drawn, as of a progress bar.

    Raises:
        RenderError: fps or speed is out of range, `snapshots` is empty, a package is missing, or the file cannot be
            written.
    """
    path, layers = location(path), layers or Layers()
    fps = _pace_of(path, fps, speed)
    if not snapshots:
        raise RenderError("there is nothing to film: the episode holds no frame")
    scene, legend = snapshots[0].scene, Legend.of(snapshots, layers, paths=True).fitting(size)
    below = layers.strip + legend.height(size[0]) if size else 0
    side = _GIF_SIDE if _is_gif(path) else DEFAULT_SIDE
    camera = camera_for(scene, size=size, scale=scale, side=side, below=below)
    shown = _counted(snapshots, advance) if advance is not None else snapshots
    samples = _sampled(shown, float(speed) / fps, interpolate=interpolate)
    painter = FilmPainter(scene, camera, layers, legend)
    _encode(path, _pictures(samples, painter, round(fps * _HOLD), caption, outcome), fps)


def save_sheet_film(
    path: str | Path,
    episodes: Sequence[Sequence[Snapshot]],
    painters: Sequence[FilmPainter],
    arrange: Callable[[Sequence[PixelCanvas]], PixelCanvas],
    *,
    fps: float | None = None,
    speed: float = 1.0,
    bar: ProgressBar,
) -> None:
    """Write a film in which several episodes begin together; those that have ended stay at their last picture.

    Args:
        path, fps, speed: as for `save_film`.
        episodes: the snapshots of each.
        painters: one for each episode.
        arrange: puts the pictures of all episodes together; they change afterwards.
        bar: shows how many states of all episodes are drawn.

    Raises:
        RenderError: as for `save_film`.
    """
    path = location(path)
    fps = _pace_of(path, fps, speed)
    with bar(sum(len(snapshots) for snapshots in episodes), "states") as advance:
        films = [
            _pictures(
                _sampled(_counted(snapshots, advance), speed / fps, interpolate=True), painter, round(fps * _HOLD)
            )
            for snapshots, painter in zip(episodes, painters, strict=True)
        ]
        _encode(path, _together(films, arrange), fps)


def _together(
    films: Sequence[Iterator[PixelCanvas]], arrange: Callable[[Sequence[PixelCanvas]], PixelCanvas]
) -> Iterator[PixelCanvas]:
    """The arranged pictures of several films, until the longest one has ended."""
    pictures: list[PixelCanvas] = []
    for newer in zip_longest(*films):
        # a film that has ended yields None
        pictures = [new or old for new, old in zip_longest(newer, pictures)]
        yield arrange(pictures)


def _is_gif(path: Path) -> bool:
    return path.suffix.lower() == ".gif"


def _pace_of(path: Path, fps: float | None, speed: float) -> float:
    """Pictures per second of a film; by default 10 for a GIF, 30 for an MP4.

    Raises:
        RenderError: fps or speed is out of range.
    """
    fps = (10.0 if _is_gif(path) else 30.0) if fps is None else float(fps)
    if not (0.0 < fps <= 120.0 and 0.0 < speed < math.inf):
        raise RenderError(
            f"cannot film {fps:g} pictures per second at speed {speed:g}; "
            "use an fps above 0 and up to 120, and a speed above 0"
        )
    # a GIF's delays are multiples of 1/100 s; players slow down below 2
    return 100.0 / max(round(100.0 / fps), 2) if _is_gif(path) else fps


def _encode(path: Path, pictures: Iterator[PixelCanvas], fps: float) -> None:
    """Write pictures as a GIF or an MP4.

    Raises:
        RenderError: a package is missing, or the file cannot be written.
    """
    shown = (drawn.surface for drawn in pictures)
    with written(path) as temporary:
        (_write_gif if _is_gif(path) else _write_mp4)(temporary, shown, fps)


def _counted(snapshots: Iterable[Snapshot], advance: Callable[[int], None]) -> Iterator[Snapshot]:
    """The snapshots; each is reported when the next one is requested."""
    for snapshot in snapshots:
        yield snapshot
        advance(1)


def _sampled(snapshots: Iterable[Snapshot], step: float, *, interpolate: bool) -> Iterator[tuple[Snapshot, Snapshot]]:
    """The episode sampled every `step` seconds, including its first and its last snapshot.

    Yields:
        The sample, and the snapshot of the last tick up to it.
    """
    before, count = None, 0
    for after in snapshots:
        if before is None:
            start = after.time
        while before is not None and start + count * step < after.time - 1e-9:
            fraction = (start + count * step - before.time) / (after.time - before.time)
            yield between(before, after, fraction) if interpolate and fraction > 1e-9 else before, before
            count += 1
        before = after
    if before is not None:
        yield before, before


def _pictures(
    samples: Iterable[tuple[Snapshot, Snapshot]],
    painter: FilmPainter,
    hold: int,
    caption: str | None = None,
    outcome: str | None = None,
) -> Iterator[PixelCanvas]:
    """The pictures of the film, each valid until the next one; the last one, with the outcome, is repeated."""
    ticks: deque[Snapshot] = deque()
    for last, tick in samples:
        if not ticks or ticks[-1] is not tick:
            ticks.append(tick)
        yield painter.draw(last, _tail(ticks, last), caption)
    ending = painter.draw(last, _tail(ticks, last), caption, outcome)
    for _ in range(max(hold, 1)):
        yield ending


def _tail(ticks: deque[Snapshot], shown: Snapshot) -> Trails:
    """The paths of the last seconds before a snapshot, through the positions at ticks; removes older ticks."""
    start = shown.time - _TAIL
    while len(ticks) > 1 and ticks[1].time <= start:
        ticks.popleft()
    snapshots = [*ticks] if ticks[-1] is shown else [*ticks, shown]
    if snapshots[0].time < start:  # the paths begin between two ticks
        first, second = snapshots[:2]
        snapshots[0] = between(first, second, (start - first.time) / (second.time - first.time))
    return Trails.of(snapshots, is_tail=True)


def _write_gif(path: Path, shown: Iterable[pygame.Surface], fps: float) -> None:
    """Write a GIF whose pictures share one palette, so that colours do not flicker."""
    image = _import("PIL.Image")
    pictures = (_pillow_image(image, drawn) for drawn in shown)
    first = next(iter(pictures))
    palette = _gif_palette(image, first)
    rest = (drawn.quantize(palette=palette, dither=image.Dither.NONE) for drawn in pictures)
    head = first.quantize(palette=palette, dither=image.Dither.NONE)
    head.save(path, save_all=True, append_images=rest, duration=round(1000.0 / fps), loop=0, disposal=1)


def _gif_palette(image: Any, first: Any) -> Any:
    """An image that holds the film's 256 colours: large areas of the first picture keep theirs."""
    frequent = [colour for _, colour in sorted(first.getcolors(first.width * first.height), reverse=True)]
    people = [activity.colour for activity in ACTIVITY.values()]
    pale = [mixed(FLOOR, colour, 0.28) for colour in people]  # these and the next may appear later
    ramp = [time_colour(k / 15) for k in range(16)]
    paths = [tone for k in range(len(PATHS)) for tone in human_tones(k)[::3]]
    colours = [FLOOR, PAPER, GRID, WALL, INK, ROBOT, GOAL, *people]
    for colour in [*frequent[:_GIF_AREAS], *pale, *ramp, *paths, *frequent[_GIF_AREAS:]]:
        if len(colours) < 256 and all(_is_distinct(colour, other) for other in colours):
            colours.append(colour)
    palette = image.new("P", (1, 1))
    palette.putpalette([value for colour in colours for value in colour])
    return palette


def _is_distinct(colour: Sequence[int], other: Sequence[int]) -> bool:
    """Whether Pillow never matches one of two colours to the other."""
    return max(abs(a - b) for a, b in zip(colour, other, strict=True)) > _GIF_COLOUR_STEP


def _write_mp4(path: Path, shown: Iterator[pygame.Surface], fps: float) -> None:
    """Write H.264 in the colour format that all players support, which requires sides of even length."""
    first = next(shown)

    def pixels() -> Iterator[memoryview]:
        for drawn in chain([first], shown):
            with _pixels(drawn) as each:
                yield each

    params = "-vf crop=trunc(iw/2)*2:trunc(ih/2)*2:0:0 -crf 17 -preset veryfast"
    encode_mp4(path, pixels(), first.get_size(), fps, "bgr0", params)


def encode_mp4(
    path: Path, pictures: Iterable[Any], size: tuple[int, int], fps: float, pixel_format: str, params: str
) -> None:
    """Write H.264, and check that all pictures are in the file.

    Args:
        path: of the file.
        pictures: bytes of each picture.
        size: width and height, px.
        fps: pictures per second.
        pixel_format: of the bytes, as ffmpeg names it, such as `rgb24`.
        params: for ffmpeg, such as `-crf 17`.

    Raises:
        OSError: the file cannot be written, or lacks pictures.
        RenderError: imageio-ffmpeg is not installed.
    """
    ffmpeg = _import("imageio_ffmpeg")
    path.open("wb").close()  # raises an OSError here if the file cannot be written; ffmpeg's error is less clear
    writer = ffmpeg.write_frames(
        str(path), size, fps=fps, codec="libx264", quality=None, macro_block_size=1, pix_fmt_in=pixel_format,
        output_params=[*params.split(), "-movflags", "+faststart"], ffmpeg_log_level="quiet",
    )  # fmt: skip
    writer.send(None)
    count = 0  # of pictures
    try:
        for picture in pictures:
            count += 1
            writer.send(picture)
    except OSError as error:  # its text has many lines
        _require_space(path)
        raise OSError(f"ffmpeg ended after {count} pictures") from error
    finally:
        writer.close()
    # ffmpeg ends as if nothing had happened if the disk is full at the end
    try:
        written, _ = ffmpeg.count_frames_and_secs(str(path))
    except RuntimeError:
        written = 0
    if written != count:
        _require_space(path)
        raise OSError(f"ffmpeg wrote {written} of {count} pictures")


def _require_space(path: Path) -> None:
    """Raise the error of the system, which ffmpeg does not pass on, if no more can be written to a file."""
    with path.open("ab") as file:
        file.write(bytes(1 << 20))


def _pillow_image(image: Any, drawn: pygame.Surface) -> Any:
    with _pixels(drawn) as pixels:
        return image.frombytes("RGB", drawn.get_size(), pixels, "raw", "BGRX")


def _pixels(surface: pygame.Surface) -> memoryview:
    """The pixels of a picture as they lie in memory: blue, green, red, unused; locks the picture until released."""
    return memoryview(surface.get_buffer())  # type: ignore[arg-type]


def _import(module: str) -> Any:
    """Import a module of the video extra.

    Raises:
        RenderError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        package = "pillow" if module.startswith("PIL") else "imageio-ffmpeg"
        raise RenderError(f"films need {package}, which is not installed; pip install 'sonata2d[video]'") from None
