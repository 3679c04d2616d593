"""Makes the fonts in sonata2d/view/typefaces: Noto Sans Thai, and a subset of Noto Emoji that has one colour.

    python docs/make_typefaces.py NotoSansThai-Regular.ttf noto-emoji-emoji-400-normal.woff2

All other scripts are drawn with the fonts that come with pygame_gui. Sources: https://notofonts.github.io (in Debian
the package `fonts-noto-core`) and the npm package `@fontsource/noto-emoji`. Needs `fonttools` and `brotli`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from fontTools import subset, ttLib  # type: ignore[import-not-found, import-untyped, unused-ignore]

FOLDER = Path(__file__).parent.parent / "sonata2d/view/typefaces"
# Letters and digits are left out: they are taken from Noto Sans. U+200D joins emoji, U+FE0F asks for their picture.
EMOJI = "U+200D,U+203C,U+2049,U+20E3,U+2139,U+2194-21AA,U+231A-23FF,U+24C2,U+25AA-27BF,U+2934-2B55,U+FE0F,U+1F000-1FAFF"
THAI = "U+0020,U+00A0,U+0E00-0E7F,U+200C,U+200D,U+25CC"


def main(thai: str, emoji: str) -> None:
    """Write both fonts."""
    FOLDER.mkdir(exist_ok=True)
    for source, name, characters in (
        (thai, "NotoSansThai-Regular.ttf", THAI),
        (emoji, "NotoEmoji-Regular.ttf", EMOJI),
    ):
        font = ttLib.TTFont(source)
        font.flavor = None  # not compressed
        subsetter = subset.Subsetter(subset.Options(layout_features=["*"], hinting=False))
        subsetter.populate(unicodes=subset.parse_unicodes(characters))
        subsetter.subset(font)
        font.save(FOLDER / name)


if __name__ == "__main__":
    main(*sys.argv[1:3])
