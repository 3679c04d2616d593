"""Colours of the pictures: Okabe and Ito's palette, which colour-blind readers can distinguish, on a pale floor.

The colours of people are part of `core.relations.ACTIVITY`. Activities differ in pose as well (see `figures`), so that
they can be distinguished in a greyscale print.

Source: M. Okabe & K. Ito, Color Universal Design (2008), https://jfly.uni-koeln.de/color/.
"""

from __future__ import annotations

Colour = tuple[int, int, int]

ORANGE: Colour = (230, 159, 0)
GREEN: Colour = (0, 158, 115)
BLUE: Colour = (0, 114, 178)
VERMILLION: Colour = (213, 94, 0)
PURPLE: Colour = (204, 121, 167)
GREY: Colour = (150, 155, 163)
ROBOT, GOAL = VERMILLION, GREEN
OTHER_ROBOT: Colour = (232, 160, 110)  # of the robots besides the first one, a lighter tone
HAIR: Colour = (72, 60, 54)

# Paths of pedestrians: P. Tol's muted palette, Colour Schemes (SRON technical note, 2021), without the tones that
# resemble the robot's path. The k-th pedestrian of a scene has the k-th colour, from the first again after the last.
PATHS: tuple[Colour, ...] = (
    (51, 34, 136),  # indigo
    (68, 170, 153),  # teal
    (170, 68, 153),  # purple
    (153, 153, 51),  # olive
    (0, 114, 178),  # blue
    (136, 34, 85),  # wine
    (136, 204, 238),  # cyan
    (17, 119, 51),  # green
)

PAPER: Colour = (255, 255, 255)
OUTSIDE: Colour = (226, 229, 233)  # around the room, in the window
FLOOR: Colour = (247, 245, 240)
GRID: Colour = (235, 232, 225)
WALL: Colour = (62, 67, 77)
INK: Colour = (43, 47, 54)
FAINT: Colour = (118, 124, 134)
REGARD: Colour = (180, 183, 188)

DARK: Colour = (52, 56, 64)
BLOCK: Colour = (205, 199, 190)
BLOCK_EDGE: Colour = (138, 130, 120)


def mixed(colour: Colour, other: Colour, fraction: float) -> Colour:
    """Interpolate linearly from `colour` (fraction 0) to `other` (fraction 1).

    >>> mixed((0, 0, 0), (100, 200, 50), 0.5)
    (50, 100, 25)
    """
    r, g, b = (round(a + (b - a) * fraction) for a, b in zip(colour, other, strict=True))
    return r, g, b


def shaded(colour: Colour, fraction: float = 0.45) -> Colour:
    """A darker tone of a colour, for outlines; fraction 1 is black."""
    return mixed(colour, (0, 0, 0), fraction)


def time_colour(fraction: float) -> Colour:
    """Colour of the robot's trail from its start (0, pale) to its end (1, dark); lightness decreases monotonically."""
    stops: tuple[Colour, ...] = ((250, 205, 150), VERMILLION, (110, 30, 10))
    position = min(max(fraction, 0.0), 1.0) * (len(stops) - 1)
    k = min(int(position), len(stops) - 2)
    return mixed(stops[k], stops[k + 1], position - k)


def hex_colour(colour: Colour) -> str:
    """The colour as in SVG and CSS.

    >>> hex_colour((0, 114, 178))
    '#0072b2'
    """
    return "#{:02x}{:02x}{:02x}".format(*colour)
