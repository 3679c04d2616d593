"""Text of all scripts is drawn, in its reading direction, and breaks into lines that fit."""

from pathlib import Path

import numpy as np
import pygame
import pygame_gui
import pytest

from sonata2d.errors import RenderError
from sonata2d.view import fonts
from sonata2d.view.fonts import EM, font, printable, rendered, shortened, width_of, wrapped

INK = (0, 0, 0)
CHINESE = "机器人在走廊里的行为有多礼貌？请根据整个过程来评价，不要只看最后一刻。"
MIXED = f"{CHINESE} Then some English words follow, and then one {'very' * 30}long word."


def shades(text, size=40):
    """The opacity of each pixel of a line without its empty sides, (width, height)."""
    alpha = pygame.surfarray.array_alpha(rendered(text, size, INK)).astype(int)
    inked = np.flatnonzero(alpha.any(axis=1))
    return alpha[inked[0] : inked[-1] + 1] if len(inked) else alpha[:0]


@pytest.mark.parametrize(
    "letters",
    ["éß", "Ωμ", "Жш", "机器", "ロボ", "로봇", "هك", "אב", "कम", "หุ", "გა", "ếữ", "😀🤖", "🇩🇪", "✓→", "≥½", "★☺"],
)
def test_characters_of_all_scripts_have_pictures_of_their_own(letters):
    first, second = (shades(letter) for letter in letters)
    assert first.size
    assert first.shape != second.shape or (first != second).any(), "missing glyphs are identical boxes"


def test_right_to_left_words_are_drawn_from_right_to_left():
    whole, last = shades("אב"), shades("ב")
    assert (whole[: len(last)] == last).all()
    sentence, word = shades("אב 12"), shades("12")
    assert (sentence[: len(word)] == word).all(), "digits keep their order, to the left of the word before them"


def test_brackets_are_mirrored_in_right_to_left_text():
    closing = shades("(")
    assert (shades("(אב)")[: len(closing)] == closing).all()


def test_arabic_letters_join_and_indian_letters_form_conjuncts():
    assert width_of("ببب", 40) < 3 * width_of("ب", 40)
    assert width_of("क्ष", 40) < width_of("क", 40) + width_of("ष", 40)


def test_a_joined_emoji_is_one_picture():
    assert width_of("👩\u200d🚀", 40) == width_of("👩", 40)


def test_the_drawn_width_is_the_measured_width():
    for text in ("Anna", MIXED, "Zoë 😀 אב 12 हिन्दी", ""):
        assert rendered(text, 20, INK).get_width() == width_of(text, 20)


def test_glyphs_above_the_latin_letters_are_not_cut_off():
    pygame.font.init()
    for text, file, script in (
        ("ฎู่ปิ๊ญฺู", "typefaces/NotoSansThai-Regular.ttf", "Thai"),
        ("بِّۗۖ", "data/NotoSansArabic-Regular.ttf", "Arab"),
        ("Ẫ", "data/NotoSans-Regular.ttf", "Latn"),
    ):
        package = fonts if file.startswith("typefaces") else pygame_gui
        face = pygame.font.Font(str(Path(str(package.__file__)).parent / file), round(60 * EM))
        face.set_script(script)
        whole = face.render(f"\n{text}\n", True, INK)  # empty lines above and below leave space for all of it
        assert rendered(text, 60, INK).get_bounding_rect().size == whole.get_bounding_rect().size


def test_characters_that_cannot_be_drawn_are_removed():
    assert printable("a\0b\u200bc\n") == "abc "


def test_fonts_work_after_pygame_was_closed():
    before = width_of("Anna 机器", 20)
    pygame.font.quit()
    pygame.font.init()
    assert font(20).size("Anna")[0] == width_of("Anna", 20)
    assert rendered("Anna 机器", 20, (1, 2, 3)).get_width() == before


def test_a_text_is_shortened_to_a_width():
    assert shortened("Anna", 500, 20) == "Anna"
    assert shortened("Anna" * 50, 100, 20).endswith("…")
    assert width_of(shortened("Anna" * 50, 100, 20), 20) <= 100
    assert shortened("Anna", 0, 20) == ""


@pytest.mark.parametrize("width", [60, 200, 555])
def test_a_wrapped_text_is_whole_and_fits(width):
    lines = wrapped(MIXED, width, 20)
    assert "".join(lines).replace(" ", "") == MIXED.replace(" ", "")
    assert max(width_of(line, 20) for line in lines) <= width
    assert not any(line.startswith(("，", "。", "？")) for line in lines)


def test_wrapping_marks_what_does_not_fit_into_the_lines():
    lines = wrapped(MIXED, 200, 20, max_lines=2)
    assert len(lines) == 2
    assert lines[-1].endswith("…")
    assert wrapped("Anna", 200, 20, max_lines=2) == ["Anna"]


def test_a_font_that_is_missing_is_named_with_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fonts, "_library", lambda: tmp_path)
    with pytest.raises(RenderError, match=r"the font Missing\.ttf is not in .*; install pygame-gui>=0\.6\.13,<0\.7"):
        _ = fonts._Face("Missing.ttf", "Latn").path
