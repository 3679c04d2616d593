"""Kinds of persons: one instance of `PersonKind` each, with its outline, its pace, its way of moving and its drawing.

Packages add kinds through the entry-point group `sonata2d.person_kinds`; `registry.person_kind` finds them all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .entities import DEFAULT_KIND
from .floats import make_floats
from .furniture_types import METAL, WOOD, WOOD_EDGE, Pen
from .relations import Colour

Interval = tuple[float, float]  # smallest and largest value
SpeedDistribution = tuple[float, float, float, float]  # mean, standard deviation, smallest and largest value, m/s
KitDrawing = Callable[[Pen, float, float], None]


@dataclass(frozen=True, slots=True)
class PersonKind:
    """A kind of person: its outline, its desired speed, its way of moving, and its drawing.

    Sizes are drawn uniformly from their intervals, the desired speed from a normal distribution truncated at its ends.
    What is None comes from the section `person` of the scenario.

    Attributes:
        name: in scenarios and files; the same as of the entry point.
        breadth: of the outline, from side to side, m.
        depth: of the outline, from back to front, m; of a kind with a length, it is not used.
        length: of an outline that is longer than broad, m: all within half the breadth of a line along the heading.
        desired_speed: mean, standard deviation, smallest and largest value, m/s.
        headway: factor of the time gap that the person keeps to those ahead.
        side_steps: whether the person can move sideways; one that cannot moves along its heading, turns on the spot,
            and does not sit down on seats.
        place: of the person's own body in the outline, m ahead of its centre.
        figure: half the depth of the person's own body and half the length of its shoulder line, m, for its drawing;
            None: the outline is the body.
        limbs: activity whose limbs are drawn, such as sitting; None: the one that the person has.
        draw: draws what the person sits in, pushes or carries, below its body, given a pen with the origin at the
            centre of the outline, and half the length and half the breadth of the outline, m; None: nothing.
        source: of the numbers.

    >>> PersonKind("runner", desired_speed=(3.0, 0.5, 2.0, 4.0), source="own measurement").side_steps
    True
    """

    name: str
    breadth: Interval | None = None
    depth: Interval | None = None
    length: Interval | None = None
    desired_speed: SpeedDistribution | None = None
    headway: float = 1.0
    side_steps: bool = True
    place: float = 0.0
    figure: Interval | None = None
    limbs: str | None = None
    draw: KitDrawing | None = None
    source: str = ""

    def __post_init__(self) -> None:
        make_floats(self)
        for name in ("breadth", "depth", "length"):
            interval = getattr(self, name)
            if interval is not None and not 0.1 <= interval[0] <= interval[1] <= _LARGEST:
                raise ValueError(
                    f"{name} of person kind {self.name!r} must be two numbers from 0.1 to {_LARGEST:g} m, the smaller "
                    f"one first, got {interval}"
                )
        if self.length is not None and (self.breadth is None or self.length[0] < self.breadth[1]):
            raise ValueError(f"person kind {self.name!r} has a length; it needs a breadth that is never larger")
        if self.desired_speed is not None:
            mean, sd, low, high = self.desired_speed
            if not (0.0 < low <= mean <= high and low < high and sd > 0.0):
                raise ValueError(
                    f"desired_speed of person kind {self.name!r} must be mean, standard deviation, smallest and "
                    f"largest value, got {self.desired_speed}"
                )
        if not self.headway > 0.0:
            raise ValueError(f"headway of person kind {self.name!r} must be above 0, got {self.headway}")

    @property
    def widest(self) -> float:
        """Largest radius of the circle around the outline, m; 0 if the section `person` gives the sizes."""
        return max((interval[1] for interval in (self.breadth, self.depth, self.length) if interval), default=0.0) / 2


_LARGEST = 3.0  # m

# Drawings. a and b are half the length and half the breadth of the outline, m.

_LINE = 0.02  # m, outlines
_TYRE: Colour = (60, 64, 72)
_FRAME: Colour = (120, 128, 140)
_SEAT: Colour = (92, 116, 150)
_VEST: Colour = (238, 196, 72)


def _draw_wheelchair(pen: Pen, a: float, b: float) -> None:
    """Draw large wheels beside a seat, castors and a foot rest ahead, and handles behind."""
    pen.box(_SEAT, (-0.42 * a, -0.68 * b), (0.3 * a, 0.68 * b), _FRAME, _LINE)
    pen.stroke(_FRAME, [(-0.42 * a, -0.62 * b), (-0.42 * a, 0.62 * b)], 0.05)
    for side in (-1.0, 1.0):
        pen.box(_TYRE, (-0.55 * a, side * 0.86 * b - 0.035), (0.5 * a, side * 0.86 * b + 0.035))
        pen.box(_TYRE, (0.5 * a, side * 0.6 * b - 0.025), (0.72 * a, side * 0.6 * b + 0.025))
        pen.stroke(_FRAME, [(-0.42 * a, side * 0.55 * b), (-0.72 * a, side * 0.55 * b)], 0.035)
        pen.box(_FRAME, (0.66 * a, side * 0.3 * b - 0.07), (0.92 * a, side * 0.3 * b + 0.07))


def _draw_walking_frame(pen: Pen, a: float, b: float) -> None:
    """Draw a frame with four wheels ahead, open to the person."""
    pen.stroke(_FRAME, [(-0.1 * a, 0.8 * b), (0.75 * a, 0.6 * b), (0.75 * a, -0.6 * b), (-0.1 * a, -0.8 * b)], 0.045)
    pen.box(_SEAT, (0.35 * a, -0.6 * b), (0.6 * a, 0.6 * b))
    for x, y in ((0.0, 0.82), (0.66, 0.64)):
        for side in (-1.0, 1.0):
            pen.box(_TYRE, (x * a - 0.07, side * y * b - 0.025), (x * a + 0.07, side * y * b + 0.025))


def _draw_cart(pen: Pen, a: float, b: float) -> None:
    """Draw a basket of bars ahead, and a handle before the person."""
    low, high = -0.22 * a, 0.9 * a
    half = [(low, 0.84 * b), (0.72 * a, 0.84 * b), (high, 0.5 * b)]
    pen.polygon((232, 235, 239), [*half, *((x, -y) for x, y in half[::-1])], _FRAME, 0.03)
    for k in range(1, 6):
        x = low + (high - low) * k / 6
        pen.stroke(METAL, [(x, -0.78 * b), (x, 0.78 * b)] if k < 5 else [(x, -0.66 * b), (x, 0.66 * b)], 0.012)
    for y in (-0.4, 0.0, 0.4):
        pen.stroke(METAL, [(low, y * b), (high, y * b)], 0.012)
    pen.stroke(_TYRE, [(-0.32 * a, -0.84 * b), (-0.32 * a, 0.84 * b)], 0.04)


def _draw_box(pen: Pen, a: float, b: float) -> None:
    """Draw a box in the arms, ahead."""
    pen.box(WOOD, (0.22 * a, -0.56 * b), (0.8 * a, 0.56 * b), WOOD_EDGE, _LINE)
    pen.stroke(WOOD_EDGE, [(0.51 * a, -0.56 * b), (0.51 * a, 0.56 * b)], 0.02)


def _draw_vest(pen: Pen, a: float, b: float) -> None:
    """Draw the shoulders of a bright vest."""
    pen.ellipse(_VEST, (0.0, 0.0), (0.85 * a, 0.97 * b), (176, 138, 30), _LINE)


def _draw_stick(pen: Pen, a: float, b: float) -> None:
    """Draw a walking stick at the right hand."""
    pen.stroke(WOOD_EDGE, [(0.2 * a, -0.95 * b), (0.95 * a, -0.78 * b)], 0.03)


ADULT = PersonKind(DEFAULT_KIND, source="the section `person` of the scenario")
OLDER = PersonKind(
    "older", desired_speed=(1.08, 0.2, 0.5, 1.5), draw=_draw_stick,
    source="speed: mean of women and men of 70-79 and 80-99 years, Bohannon & Williams Andrews, Physiotherapy 97 "
    "(2011) 182; its standard deviation as of adults; body as of adults",
)  # fmt: skip
CHILD = PersonKind(
    "child", breadth=(0.28, 0.34), depth=(0.2, 0.22), desired_speed=(1.26, 0.2, 0.8, 1.8),
    source="speed: 170 pupils of 7-12 years, Surabaya Physical Medicine and Rehabilitation Journal 4 (2022), 24186; "
    "sizes are our estimate",
)  # fmt: skip
WHEELCHAIR = PersonKind(
    "wheelchair", breadth=(0.62, 0.7), length=(1.05, 1.2), desired_speed=(0.69, 0.35, 0.13, 1.35), headway=1.2,
    side_steps=False, figure=(0.15, 0.1), limbs="sitting", draw=_draw_wheelchair,
    source="sizes: up to the largest ones of ISO 7193; speed: manual wheelchairs on the level, Boyce, Shields & "
    "Silcock, Fire Technology 35 (1999) 51; headway: J. Stat. Mech. (2021), 10.1088/1742-5468/abe93f, assisted users",
)  # fmt: skip
WALKING_FRAME = PersonKind(
    "walking_frame", breadth=(0.56, 0.62), length=(0.8, 0.95), desired_speed=(0.57, 0.29, 0.1, 1.02),
    side_steps=False, place=-0.16, figure=(0.14, 0.08), draw=_draw_walking_frame,
    source="speed: walking frames on the level, Boyce, Shields & Silcock, Fire Technology 35 (1999) 51; sizes are our "
    "estimate",
)  # fmt: skip
CART = PersonKind(
    "cart", breadth=(0.55, 0.6), length=(1.45, 1.65), side_steps=False, place=-0.52, figure=(0.14, 0.085),
    draw=_draw_cart, source="sizes: our estimate of a shopping trolley or pram and the person behind it; speed as of "
    "adults, since no measurement was found",
)  # fmt: skip
CARRYING = PersonKind(
    "carrying", breadth=(0.5, 0.55), depth=(0.48, 0.5), place=-0.08, figure=(0.14, 0.085), draw=_draw_box,
    source="sizes: our estimate of a box held before the body; speed as of adults, since no measurement was found",
)  # fmt: skip
STAFF = PersonKind(
    "staff", desired_speed=(1.49, 0.2, 1.0, 2.0), draw=_draw_vest,
    source="speed: commuters, Weidmann, Transporttechnik der Fussgänger, ETH Zürich (1993); body as of adults",
)  # fmt: skip
BUILT_IN = (ADULT, OLDER, CHILD, WHEELCHAIR, WALKING_FRAME, CART, CARRYING, STAFF)
