"""Writes an episode as a film, drawn and encoded picture by picture: GIF with Pillow, MP4 with imageio-ffmpeg."""

from __future__ import annotations

import importlib
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

import pygame

from ..core.files.locations import location
from ..core.files.whole_file import whole_file
from ..core.notebook import Advance, ProgressBar
from ..core.relations import ACTIVITY
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..errors import RenderError
from .camera import DEFAULT_SIDE
from .draw import Layers
from .interpolation import between
from .legend import Legend
from .palette import FLOOR, GOAL, GRID, INK, PAPER, PATHS, ROBOT, WALL, mixed, time_colour
from .sequence import PictureSequence
from .trails import Trails, human_tones

_TAIL = 4.0  # s, duration that trails cover
_HOLD = 1.5  # s, duration of the last picture
_GIF_SIDE = 640  # px, default limit of the longer side of the room in a GIF
_GIF_COLOUR_STEP = 8  # Pillow matches colours in steps of 4, so that it may confuse colours that differ by this


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
    advance: Callable[[int], None] | None = None,
) -> None:
    """Write a film of an episode.

    Args:
        path: the file to write; the suffix `.gif` or `.mp4` selects the format.
        snapshots: in order; consumed one by one, so that they can be read lazily.
        fps: pictures per second; by default 10 for a GIF, 30 for an MP4.
        speed: seconds of the episode per second of the film.
        interpolate: interpolate between ticks; otherwise each picture shows the last tick.
        size, scale, layers, caption, outcome: as for `picture`; without size and scale, the longer side of a GIF's
            room has at most 640 px. The legend is that of the whole film, which is read before the first picture is
            drawn.
        advance: called with 1 for each snapshot that was drawn, as of a progress bar.

    Raises:
        RenderError: fps or speed is out of range, `snapshots` is empty, a package is missing, or the file cannot be
            written.
    """
    path = location(path)
    fps = _pace_of(path, fps, speed)
    if layers is not None and layers.legend:
        snapshots = [*snapshots]
        legend = Legend.of(snapshots, layers, paths=True) if snapshots else Legend()
    else:
        legend = Legend()
    make = partial(
        PictureSequence,
        size=size,
        scale=scale,
        side=_GIF_SIDE if path.suffix.lower() == ".gif" else DEFAULT_SIDE,
        layers=layers,
        legend=legend,
    )
    if advance is not None:
        snapshots = _counted(snapshots, advance)
    samples = _sampled(snapshots, speed / fps, interpolate=interpolate)
    _encode(path, _pictures(samples, round(fps * _HOLD), make, caption, outcome), fps)


def save_sheet_film(
    path: str | Path,
    episodes: Sequence[Sequence[Snapshot]],
    make: Callable[[Scene], PictureSequence],
    arrange: Callable[[Sequence[pygame.Surface]], pygame.Surface],
    *,
    fps: float | None = None,
    speed: float = 1.0,
    bar: ProgressBar,
) -> None:
    """Write a film in which several episodes begin together; those that have ended stay at their last picture.

    Args:
        path, fps, speed: as for `save_film`.
        episodes: the snapshots of each.
        make: what draws the pictures of an episode.
        arrange: one picture of those of all episodes; they change afterwards.
        bar: shows how many seconds of the longest episode are drawn.

    Raises:
        RenderError: as for `save_film`.
    """
    path = location(path)
    fps = _pace_of(path, fps, speed)
    films = [
        _pictures(_sampled(snapshots, speed / fps, interpolate=True), round(fps * _HOLD), make, None, None)
        for snapshots in episodes
    ]
    length = max(snapshots[-1].time - snapshots[0].time for snapshots in episodes)

    def together(advance: Advance) -> Iterator[pygame.Surface]:
        pictures: list[pygame.Surface] = []
        drawn = 0  # s
        for k, newer in enumerate(zip_longest(*films)):
            seconds = min(int(k * speed / fps), int(length))
            advance(seconds - drawn)
            drawn = seconds
            # an episode that has ended yields None
            pictures = [new or old for new, old in zip_longest(newer, pictures)]
            yield arrange(pictures)

    with bar(int(length), "seconds of the longest episode") as advance:
        _encode(path, together(advance), fps)


def _pace_of(path: Path, fps: float | None, speed: float) -> float:
    """Pictures per second of a film; by default those of its format.

    Raises:
        RenderError: fps or speed is out of range.
    """
    is_gif = path.suffix.lower() == ".gif"
    fps = (10.0 if is_gif else 30.0) if fps is None else fps
    if not (0.0 < fps <= 120.0 and 0.0 < speed < math.inf):
        raise RenderError(
            f"cannot film {fps:g} pictures per second at speed {speed:g}; "
            "use an fps above 0 and up to 120, and a speed above 0"
        )
    # a GIF's delays are multiples of 1/100 s; players slow down below 2
    return 100.0 / max(round(100.0 / fps), 2) if is_gif else fps


def _encode(path: Path, shown: Iterator[pygame.Surface], fps: float) -> None:
    """Write pictures as a GIF or an MP4.

    Raises:
        RenderError: a package is missing, or the file cannot be written.
    """
    is_gif = path.suffix.lower() == ".gif"
    try:
        with whole_file(path) as temporary:
            (_write_gif if is_gif else _write_mp4)(temporary, shown, fps)
    except OSError as error:
        raise RenderError(f"cannot write {path}: {error.strerror or error}") from error


def _counted(snapshots: Iterable[Snapshot], advance: Callable[[int], None]) -> Iterator[Snapshot]:
    """The snapshots; each is reported when the next one is requested."""
    for snapshot in snapshots:
        yield snapshot
        advance(1)


def paced(snapshots: Iterable[Snapshot], step: float, *, interpolate: bool = True) -> Iterator[Snapshot]:
    """The episode sampled every `step` seconds, including its first and its last snapshot."""
    return (shown for shown, _ in _sampled(snapshots, step, interpolate=interpolate))


def _sampled(snapshots: Iterable[Snapshot], step: float, *, interpolate: bool) -> Iterator[tuple[Snapshot, Snapshot]]:
    """The snapshots that `paced` returns, each with the snapshot of the last tick up to it."""
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
    hold: int,
    make: Callable[[Scene], PictureSequence],
    caption: str | None,
    outcome: str | None,
) -> Iterator[pygame.Surface]:
    """The pictures of the film, each valid until the next one; the last one, with the outcome, is repeated."""
    pictures, last = None, None
    ticks: deque[Snapshot] = deque()
    for last, tick in samples:
        if pictures is None:
            pictures = make(last.scene)
        if not ticks or ticks[-1] is not tick:
            ticks.append(tick)
        yield pictures.draw(last, trails=_tail(ticks, last), caption=caption)
    if pictures is None or last is None:
        raise RenderError("there is nothing to film: the episode holds no frame")
    ending = pictures.draw(last, trails=_tail(ticks, last), caption=caption, outcome=outcome)
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
    """An image that holds the film's 256 colours: the palette's, which may appear later, and the first picture's."""
    people = [activity.colour for activity in ACTIVITY.values()]
    pale = [mixed(FLOOR, colour, 0.28) for colour in people]
    ramp = [time_colour(k / 15) for k in range(16)]
    paths = [tone for k in range(len(PATHS)) for tone in human_tones(k)[::3]]
    own = [FLOOR, PAPER, GRID, WALL, INK, ROBOT, GOAL, *people, *pale, *ramp, *paths]
    flat = first.quantize(256 - len(own), dither=image.Dither.NONE).getpalette()[: 3 * (256 - len(own))]
    candidates = [flat[k : k + 3] for k in range(0, len(flat) - 2, 3)]
    others = [other for other in candidates if all(_is_distinct(other, colour) for colour in own)]
    palette = image.new("P", (1, 1))
    palette.putpalette([value for colour in [*own, *others] for value in colour])
    return palette


def _is_distinct(colour: Sequence[int], other: Sequence[int]) -> bool:
    """Whether Pillow never matches one of two colours to the other."""
    return max(abs(a - b) for a, b in zip(colour, other, strict=True)) > _GIF_COLOUR_STEP


def _write_mp4(path: Path, shown: Iterator[pygame.Surface], fps: float) -> None:
    """Write H.264 in the colour format that all players support, which requires sides of even length."""
    ffmpeg = _import("imageio_ffmpeg")
    first = next(shown)
    path.open("wb").close()  # raises an OSError here if the file cannot be written; ffmpeg's error is less clear
    size = tuple(side - side % 2 for side in first.get_size())
    writer = ffmpeg.write_frames(
        str(path), size, fps=fps, codec="libx264", quality=None, macro_block_size=2, pix_fmt_in="bgr0",
        output_params=["-crf", "17", "-preset", "veryfast", "-movflags", "+faststart"], ffmpeg_log_level="quiet",
    )  # fmt: skip
    writer.send(None)
    even, count = pygame.Surface(size, 0, 32), 0  # of pictures
    try:
        for drawn in chain([first], shown):
            count += 1
            if drawn.get_size() != size:
                even.blit(drawn, (0, 0))
                drawn = even
            with _pixels(drawn) as pixels:
                writer.send(pixels)
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
