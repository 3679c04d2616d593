"""The family of `view.fonts` in the widgets of pygame_gui, so that they draw all scripts as well."""

from __future__ import annotations

import pygame
import pygame_gui
from pygame_gui.core import UIFontDictionary
from pygame_gui.core.interfaces import IGUIFontInterface
from pygame_gui.core.utility import FontResource

from ..view.fonts import FAMILY, font, printable, rendered, width_of


def provide_fonts(ui: pygame_gui.UIManager, sizes: set[int]) -> None:
    """Make text sizes available to themes, under the name of the family; call it before a theme is loaded.

    Args:
        ui: manager of the widgets.
        sizes: px.
    """
    known = ui.get_theme().get_font_dictionary()
    assert isinstance(known, UIFontDictionary)
    for size in sizes:
        key = known.create_font_id(size, FAMILY, False, False)
        resource = FontResource(key, size, {}, ("", False))
        resource.loaded_font = _WidgetFont(size)
        known.loaded_fonts[key] = resource


class _WidgetFont(IGUIFontInterface):
    """Text of one size for pygame_gui.

    Args:
        size: px.
    """

    underline = False
    underline_adjustment = 0.0

    def __init__(self, size: int) -> None:
        self._size = size

    def size(self, text: str) -> tuple[int, int]:
        return self.get_rect(text).size

    def get_rect(self, text: str) -> pygame.Rect:
        if not text:
            return pygame.Rect(0, 0, 0, 0)
        return pygame.Rect(0, font(self._size).get_ascent(), width_of(text, self._size), font(self._size).get_height())

    def render_premul(self, text: str, text_color: pygame.Color) -> pygame.Surface:
        line = rendered(text, self._size, (text_color.r, text_color.g, text_color.b)).convert_alpha()
        return line.premul_alpha() if line.get_width() else line

    def render_premul_to(
        self, text: str, text_colour: pygame.Color, surf_size: tuple[int, int], surf_position: tuple[int, int]
    ) -> pygame.Surface:
        surface = pygame.Surface(surf_size, pygame.SRCALPHA, 32)
        line, latin = self.render_premul(text, text_colour), font(self._size)
        excess = (line.get_height() - latin.get_height()) // 2  # of glyphs above and below the letters of `font`
        top = surf_position[1] - latin.get_ascent() - excess
        surface.blit(line, (surf_position[0], top), special_flags=pygame.BLEND_PREMULTIPLIED)
        return surface

    def get_metrics(self, text: str) -> list[tuple[int, int, int, int, int] | None]:
        """Extents of each character; characters that cannot be drawn have none, so that text fields refuse them."""
        widths = [width_of(character, self._size) if printable(character) else None for character in text]
        return [None if width is None else (0, width, 0, self._size, width) for width in widths]

    def get_point_size(self) -> int:
        return self._size

    def get_padding_height(self) -> int:
        return 1 - font(self._size).get_descent()

    def get_direction(self) -> int:
        return pygame.DIRECTION_LTR
