"""Colours of the pictures: Okabe and Ito's palette, which the colour-blind tell apart, on a quiet floor.

Activities differ in pose as well (see `people`), so that a picture printed in grey still tells them apart.

Source: M. Okabe & K. Ito, Color Universal Design (2008), https://jfly.uni-koeln.de/color/.
"""

from __future__ import annotations

Colour = tuple[int, int, int]

ORANGE: Colour = (230, 159, 0)
SKY: Colour = (86, 180, 233)
GREEN: Colour = (0, 158, 115)
YELLOW: Colour = (240, 228, 66)
BLUE: Colour = (0, 114, 178)
VERMILLION: Colour = (213, 94, 0)
PURPLE: Colour = (204, 121, 167)
GREY: Colour = (150, 155, 163)

ACTIVITY: dict[str, Colour] = {
    "standing": GREY,
    "walking": BLUE,
    "walking together": SKY,
    "talking": PURPLE,
    "using": ORANGE,
    "looking": YELLOW,
}
ROBOT, GOAL = VERMILLION, GREEN
HAIR: Colour = (72, 60, 54)

PAPER: Colour = (255, 255, 255)
OUTSIDE: Colour = (226, 229, 233)  # round the room, on screens
FLOOR: Colour = (247, 245, 240)
GRID: Colour = (235, 232, 225)
WALL: Colour = (62, 67, 77)
INK: Colour = (43, 47, 54)
FAINT: Colour = (118, 124, 134)

WOOD: Colour = (222, 196, 158)
WOOD_EDGE: Colour = (158, 124, 82)
LEAF: Colour = (122, 160, 104)
LEAF_EDGE: Colour = (78, 116, 66)
POT: Colour = (176, 128, 100)
METAL: Colour = (196, 200, 206)
DARK: Colour = (52, 56, 64)
SCREEN: Colour = (150, 190, 220)
CLOTH: Colour = (178, 186, 196)
CLOTH_EDGE: Colour = (122, 132, 146)
BLOCK: Colour = (205, 199, 190)
BLOCK_EDGE: Colour = (138, 130, 120)


def mixed(colour: Colour, other: Colour, share: float) -> Colour:
    """`colour` with a share (0..1) of `other` in it.

    >>> mixed((0, 0, 0), (100, 200, 50), 0.5)
    (50, 100, 25)
    """
    r, g, b = (round(a + (b - a) * share) for a, b in zip(colour, other, strict=True))
    return r, g, b


def shaded(colour: Colour, share: float = 0.45) -> Colour:
    """A darker tone for outlines."""
    return mixed(colour, (0, 0, 0), share)


def time_colour(share: float) -> Colour:
    """Colour of the robot's trail from start (0, pale) to end (1, dark); lightness falls all the way."""
    stops: tuple[Colour, ...] = ((250, 205, 150), VERMILLION, (110, 30, 10))
    place = min(max(share, 0.0), 1.0) * (len(stops) - 1)
    k = min(int(place), len(stops) - 2)
    return mixed(stops[k], stops[k + 1], place - k)
