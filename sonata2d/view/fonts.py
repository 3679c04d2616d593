"""Fonts and lines of text; strings of all scripts can be drawn.

One family, Noto Sans, is used by the window and by pictures. A line is split into runs: each run has one script, whose
face has its characters, and one direction. HarfBuzz, which is part of pygame-ce, shapes the runs. Most faces are data
files of pygame_gui; two small ones come with sonata2d.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.util import find_spec
from itertools import accumulate, groupby
from pathlib import Path

import pygame
from pygame import freetype

from ..errors import RenderError
from .palette import Colour

FAMILY = "Noto Sans"
EM = 0.7  # px of the em square for a text of size 1, so that a line of text is about as high as its size
_MEAN_WIDTH = 0.6  # of a character, as a multiple of the size of the text
_MAX_LENGTH = 4000  # characters of a line; the rest is cut off


@dataclass(frozen=True, slots=True)
class _Face:
    """One font file, used for one script.

    Attributes:
        file: name of the file.
        script: ISO 15924 code, for shaping.
        limits: first and last character that the face is used for.
    """

    file: str
    script: str
    limits: tuple[int, int] = (0, 0x10FFFF)

    @property
    def path(self) -> Path:
        """The file, in one of the two folders of fonts.

        Raises:
            RenderError: neither folder has it.
        """
        path = Path(__file__).with_name("typefaces") / self.file
        path = path if path.exists() else _library() / self.file
        if not path.exists():
            raise RenderError(f"the font {self.file} is not in {path.parent}; install pygame-gui>=0.6.13,<0.7 again")
        return path


_SANS = _Face("NotoSans-Regular.ttf", "Latn")
_JAPANESE = _Face("NotoSansJP-Regular.otf", "Hani")
# Each character is drawn with the first face that contains it. Devanagari is listed first because HarfBuzz must know
# its script.
_FACES = (
    _Face("NotoSans-Regular.ttf", "Deva", (0x900, 0x97F)),
    _SANS,
    _Face("NotoSansArabic-Regular.ttf", "Arab"),
    _Face("NotoSansHebrew-Regular.ttf", "Hebr"),
    _Face("NotoSansThai-Regular.ttf", "Thai"),
    _Face("NotoSansGeorgian-Regular.ttf", "Geor"),
    _Face("NotoEmoji-Regular.ttf", "Zsye"),
    _Face("NotoSansSC-Regular.otf", "Hani"),
    _Face("NotoSansKR-Regular.ttf", "Hang"),
    _JAPANESE,
    _Face("FiraCode-Regular.ttf", "Zsym"),
)
_RTL_SCRIPTS = ("Arab", "Hebr")
_MIRRORED = str.maketrans("()[]{}<>«»", ")(][}{><»«")
_JOINERS = "\u200c\u200d\ufe0e\ufe0f"  # part of how their neighbours look, although they are not printable


def font(size: int) -> pygame.font.Font:
    """Noto Sans at a text size in pixels, which draws Latin, Greek and Cyrillic letters."""
    return _font(size, _SANS, False)


def _font(size: int, face: _Face, rtl: bool) -> pygame.font.Font:
    """A face at a text size, for left-to-right or right-to-left runs."""
    pygame.font.init()
    try:
        _opened(size, face, rtl).get_height()
    except pygame.error:  # pygame was closed, which invalidates its fonts
        _opened.cache_clear()
    return _opened(size, face, rtl)


@cache
def _opened(size: int, face: _Face, rtl: bool) -> pygame.font.Font:
    opened = pygame.font.Font(str(face.path), max(round(size * EM), 1))
    opened.set_script(face.script)
    opened.set_direction(pygame.DIRECTION_RTL if rtl else pygame.DIRECTION_LTR)
    return opened


def printable(text: str) -> str:
    """The text as one line, without characters that fonts cannot draw (control characters, surrogates).

    >>> printable("A\\0nna\\n")
    'Anna '
    """
    return "".join(
        " " if c in "\n\t" else c for c in text[:_MAX_LENGTH] if c.isprintable() or c in "\n\t" or c in _JOINERS
    )


@lru_cache(maxsize=512)
def rendered(text: str, size: int, colour: Colour) -> pygame.Surface:
    """One antialiased line of text on a transparent surface; cached, so callers must not draw on it.

    The height equals the height of `font(size)`, unless glyphs of another script are higher or lower.
    """
    runs = _runs(printable(text))
    if all(face is _SANS for face, _, _ in runs):
        return font(size).render("".join(part for _, _, part in runs), True, colour)
    ascent, height = font(size).get_ascent(), font(size).get_height()
    images, excess = [], 0
    for face, rtl, part in runs:
        drawn = _font(size, face, rtl)
        image, top = drawn.render(part, True, colour), ascent - drawn.get_ascent()
        ink = image.get_bounding_rect().move(0, top)
        excess = max(excess, -ink.top, ink.bottom - height) if ink.height else excess
        images.append((image, top))
    line = pygame.Surface((sum(image.get_width() for image, _ in images), height + 2 * excess), pygame.SRCALPHA, 32)
    left = 0
    for image, top in images:
        line.blit(image, (left, top + excess), special_flags=pygame.BLEND_RGBA_MAX)
        left += image.get_width()
    return line


@lru_cache(maxsize=4096)
def width_of(text: str, size: int) -> int:
    """Width of a line of text, px; where there is no pygame, as in a page (`web.in_page`), about this width."""
    if not hasattr(pygame, "font"):
        return round(_MEAN_WIDTH * size * len(text))
    return sum(_font(size, face, rtl).size(part)[0] for face, rtl, part in _runs(printable(text)))


def shortened(text: str, max_width: float, size: int) -> str:
    """The text, or its longest beginning that fits into `max_width` pixels with an ellipsis."""
    text = printable(text)
    if width_of(text, size) <= max_width:
        return text
    low = _fitting(text, max_width, size, "…")
    return text[:low].rstrip() + "…" if low else ""


def wrapped(text: str, max_width: float, size: int, *, max_lines: int | None = None) -> list[str]:
    """Break a text into lines of at most `max_width` pixels.

    Lines break at spaces, and between the characters of scripts without spaces; a longer word is broken anywhere.

    Args:
        text: the text.
        max_width: px.
        size: of the text, px.
        max_lines: an ellipsis replaces what does not fit into this number of lines; None for any number of lines.
    """
    lines, rest = [""], list(_breakable(printable(text)))
    while rest:
        part = rest.pop(0)
        longer = lines[-1] + part
        if width_of(longer.rstrip(), size) <= max_width:
            lines[-1] = longer if lines[-1] else part.lstrip()
        elif not lines[-1].strip():  # a single word that is too long
            count = max(_fitting(part, max_width, size, ""), 1)
            lines[-1] = part[:count]
            if part[count:]:
                rest.insert(0, part[count:])
                lines.append("")
        else:
            lines.append("")
            rest.insert(0, part)
        if max_lines is not None and len(lines) > max_lines:
            lines = lines[:max_lines]
            lines[-1] = shortened("".join([lines[-1], *rest]) + "…", max_width, size)
            break
    return [line.rstrip() for line in lines if line.strip()]


def _fitting(text: str, max_width: float, size: int, ending: str) -> int:
    """Number of characters from the start that fit into a width together with an ending."""
    low, high = 0, len(text)
    while low < high:  # bisection over the number of characters
        middle = (low + high + 1) // 2
        low, high = (middle, high) if width_of(text[:middle] + ending, size) <= max_width else (low, middle - 1)
    return low


def _breakable(text: str) -> Iterator[str]:
    """Parts of a text between which a line may break, each with the spaces after it."""
    part = ""
    for before, character in zip(f" {text}", text, strict=False):
        is_wide = unicodedata.east_asian_width(character) in "WF" or unicodedata.east_asian_width(before) in "WF"
        starts_line = unicodedata.category(character) not in ("Po", "Pe", "Pf", "Zs", "Mn")  # closing marks do not
        if part and starts_line and (before == " " or is_wide):
            yield part
            part = ""
        part += character
    if part:
        yield part


# Runs


@lru_cache(maxsize=4096)
def _runs(text: str) -> tuple[tuple[_Face, bool, str], ...]:
    """Split a line into runs of one face and direction, in the order in which they are drawn from left to right."""
    if text.isascii():
        return ((_SANS, False, text),) if text else ()
    faces = _faces_of(text)
    runs: list[tuple[int, _Face, bool, str]] = []
    start = 0
    for (level, face), group in groupby(zip(_levels(text), faces, strict=True)):
        end = start + sum(1 for _ in group)
        part, start = text[start:end], end
        rtl = level % 2 == 1
        if rtl and face.script not in _RTL_SCRIPTS:  # spaces and punctuation, drawn with a left-to-right face
            part, rtl = part[::-1].translate(_MIRRORED), False
        runs.append((level, face, rtl, part))
    for level in range(max(level for level, *_ in runs), 0, -1):  # rule L2 of Unicode's annex 9
        ordered: list[tuple[int, _Face, bool, str]] = []
        for is_deep, neighbours in groupby(runs, key=lambda run: run[0] >= level):
            part_of_line = list(neighbours)
            ordered += part_of_line[::-1] if is_deep else part_of_line
        runs = ordered
    return tuple((face, rtl, part) for _, face, rtl, part in runs)


def _faces_of(text: str) -> list[_Face]:
    """The face of each character; marks, joiners and spaces get the face of the character before."""
    is_japanese = any("\u3040" <= c <= "\u30ff" for c in text)  # kana: Chinese characters in their Japanese forms
    faces: list[_Face] = []
    for character in text:
        is_skin = "\U0001f3fb" <= character <= "\U0001f3ff"  # the colour of the emoji before it
        is_mark = unicodedata.category(character)[0] == "M" or character == " " or is_skin
        if faces and (character in _JOINERS or (is_mark and _has(faces[-1], character))):
            faces.append(faces[-1])
        else:
            face = _face_of(character)
            is_han = face.script in ("Hani", "Hang")
            faces.append(_JAPANESE if is_japanese and is_han and _has(_JAPANESE, character) else face)
    return faces


@lru_cache(maxsize=8192)
def _face_of(character: str) -> _Face:
    """The first face that has a character; Noto Sans, which draws a box, if there is none."""
    return next((face for face in _FACES if _has(face, character)), _SANS)


def _has(face: _Face, character: str) -> bool:
    """Whether a face is used for a character and has a glyph for it."""
    if not face.limits[0] <= ord(character) <= face.limits[1]:
        return False
    try:
        return _glyphs(face).get_metrics(character)[0] is not None
    except pygame.error:  # pygame was closed, which invalidates its fonts
        _glyphs.cache_clear()
        return _glyphs(face).get_metrics(character)[0] is not None


def _levels(text: str) -> list[int]:
    """Embedding level of each character, odd for right-to-left text: Unicode's annex 9 without explicit embeddings."""
    kinds = [unicodedata.bidirectional(character) for character in text]
    if not {"R", "AL", "AN"} & set(kinds):
        return [0] * len(text)
    base = next((int(kind != "L") for kind in kinds if kind in ("L", "R", "AL")), 0)
    sides: list[int | None] = []  # 0: left to right, 1: right to left, None: as its neighbours
    digits = []  # whether a character is a digit, or the separator in 3.5
    strong = base
    for k, kind in enumerate(kinds):
        is_separator = kind in ("CS", "ES") and 0 < k < len(kinds) - 1 and kinds[k - 1] == kinds[k + 1] == "EN"
        digits.append(kind in ("EN", "AN") or is_separator)
        if kind in ("L", "R", "AL"):
            strong = int(kind != "L")
            sides.append(strong)
        elif digits[-1]:
            sides.append(strong)
        else:
            sides.append(sides[-1] if kind == "NSM" and k else None)

    def latest(known: int, side: int | None) -> int:
        return known if side is None else side

    # a neutral character has the direction of both neighbours if these agree, otherwise the direction of the line
    before = list(accumulate(sides, latest, initial=base))[1:]
    after = list(accumulate(sides[::-1], latest, initial=base))[:0:-1]
    resolved = [side if side == other else base for side, other in zip(before, after, strict=True)]
    # digits keep their order within right-to-left text
    return [
        2 * (side | base) if is_digit else side or 2 * base for side, is_digit in zip(resolved, digits, strict=True)
    ]


# Font files


@cache
def _library() -> Path:
    """Folder of pygame_gui's fonts; it is found without importing the package."""
    spec = find_spec("pygame_gui")
    folders = spec.submodule_search_locations if spec is not None else None
    return Path(folders[0] if folders else ".") / "data"


@cache
def _glyphs(face: _Face) -> freetype.Font:
    """A face for `get_metrics`, which reports missing glyphs; fonts of `pygame.font`, which shape text, do not."""
    freetype.init()
    return freetype.Font(str(face.path), 20)
