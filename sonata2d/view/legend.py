"""The legend of a picture: symbols and their meaning, in rows below the room so that nothing is hidden."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from ..core.geometry import Disc, Point
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..core.relations import ACTIVITY
from ..core.snapshot import Snapshot
from .brush import Brush
from .canvas import Canvas
from .figures import draw_body, draw_chassis, draw_head, draw_plain_body, draw_target
from .fonts import width_of
from .landmarks import draw_door, draw_leaf, draw_place, draw_queue
from .layers import Layers, draw_fan, draw_link_between, draw_regard_between, draw_shared_space, draw_zones_of
from .palette import INK
from .projection import Camera
from .trails import MARK_INTERVAL, draw_mark_sample, draw_path_samples

_TEXT, _ROW, _EDGE = 16, 22, 14  # px: font size, height of a row, free space beside the rows
_BELOW = 8  # px, free space below the last row
_SYMBOL, _SPACE, _GAP = 18, 6, 20  # px: width of a symbol, and the space after it and after an entry
_RADIUS = 0.2  # m, of the robot and of discs in a symbol
_BODY = 0.14, 0.085  # m, of pedestrians in a symbol: half the depth, and half the length of the shoulder line
_MAXIMUM_FRACTION = 0.25  # of a picture's height
TEXTS = {  # English meaning of each symbol
    **{name.replace(" ", "_"): activity.text for name, activity in ACTIVITY.items()},
    "ignores": "ignores the robot",
    "gaze": "field of view",
    "robot": "robot",
    "other_robot": "other robot",
    "contact": "robot in contact",
    "goal": "goal",
    "door": "door",
    "interior_door": "door that opens",
    "queue": "queue",
    "place": "place of interest",
    "paths": "paths",
    "time_mark": "every {seconds} s",
    "interaction": "interaction of people",
    "regard": "looks at a thing, or works at it",
    "zones": "intimate space {intimate} m, personal {personal} m",
    "shared": "shared space",
}


_LINE: dict[str, Any] = {"start": (-0.3, 0.0), "end": (0.3, 0.0)}
_VALUES = {  # in the meanings
    "seconds": f"{MARK_INTERVAL:g}",
    "intimate": f"{INTIMATE_DISTANCE:g}",
    "personal": f"{PERSONAL_DISTANCE:g}",
}


def english(name: str, **values: object) -> str:
    """The English meaning of a symbol with its values filled in."""
    return TEXTS[name].format(**values)


_Wording = Callable[..., str]  # of a key of TEXTS, with values by keyword


@dataclass(frozen=True, slots=True)
class Entry:
    """A symbol and its meaning.

    Attributes:
        name: key of the meaning in `TEXTS`.
        text: the meaning.
        draw: draws the symbol centred on the brush.
        size: width of the symbol, m.
    """

    name: str
    text: str
    draw: Callable[[Brush], None]
    size: float

    def draw_at(self, canvas: Canvas, centre: Point, side: int) -> None:
        """Draw the symbol with a width in pixels around a point of the canvas."""
        scale = side / self.size
        self.draw(Brush(canvas, Camera(scale, -centre[0] / scale, centre[1] / scale, (side, side))))


@dataclass(frozen=True, slots=True)
class Legend:
    """The legend of a picture or a film; the one without entries takes no space.

    Attributes:
        entries: symbols and their meaning.
        scale: factor of all lengths in pixels.
    """

    entries: tuple[Entry, ...] = ()
    scale: float = 1.0

    @classmethod
    def of(
        cls,
        snapshots: Iterable[Snapshot],
        layers: Layers,
        *,
        paths: bool = False,
        time_marks: bool = False,
        scale: float = 1.0,
        wording: _Wording = english,
    ) -> Legend:
        """The legend of all symbols in any of the pictures; empty if the layers have no legend.

        Args:
            snapshots: of one scene, one or more.
            layers: of the pictures.
            paths: whether past paths are drawn.
            time_marks: whether the robot's path has time marks.
            scale: factor of all lengths in pixels.
            wording: the meaning of a symbol by its key in `TEXTS`.
        """
        return cls(tuple(_entries([*snapshots], layers, paths, time_marks, wording)), scale) if layers.legend else cls()

    def fitting(self, size: tuple[int, int] | None) -> Legend:
        """The legend for a picture of a given size, px; empty if it would take more than a quarter of the height."""
        is_too_high = size is not None and self.height(size[0]) > _MAXIMUM_FRACTION * size[1]
        return Legend() if is_too_high else self

    def height(self, width: int) -> int:
        """Height of the legend of a picture of this width, px."""
        rows = self._rows(width)
        return self._px(len(rows) * _ROW + _BELOW) if rows else 0

    def draw(self, canvas: Canvas, top: int, width: int) -> None:
        """Draw the legend from the pixel row `top` on, in a picture of this width, px."""
        if not self.entries:
            return
        with canvas.group("legend"):
            symbol, indent = self._px(_SYMBOL), self._px(_SYMBOL + _SPACE)
            for k, row in enumerate(self._rows(width)):
                x, y = float(self._px(_EDGE)), top + (k + 0.5) * self._px(_ROW)
                for entry in row:
                    entry.draw_at(canvas, (x + symbol / 2, y), symbol)
                    canvas.text(INK, entry.text, (x + indent, y), self._px(_TEXT), "midleft")
                    x += self._width_of(entry) + self._px(_GAP)

    def _rows(self, width: int) -> list[list[Entry]]:
        """The entries in rows that are not wider than the picture; a single entry may be."""
        rows: list[list[Entry]] = []
        end = 0
        for entry in self.entries:
            end += self._px(_GAP) + self._width_of(entry)
            if not rows or end > width - 2 * self._px(_EDGE):
                rows.append([])
                end = self._width_of(entry)
            rows[-1].append(entry)
        return rows

    def _width_of(self, entry: Entry) -> int:
        return self._px(_SYMBOL + _SPACE) + width_of(entry.text, self._px(_TEXT))

    def _px(self, length: float) -> int:
        return round(self.scale * length)


def _entries(
    snapshots: list[Snapshot], layers: Layers, paths: bool, time_marks: bool, wording: _Wording
) -> Iterator[Entry]:
    """The entries of all symbols in pictures of the snapshots, in the order of the rows."""
    scene, unmeasured = snapshots[0].scene, snapshots[0].scene.unmeasured
    present = {human.activity for snapshot in snapshots for human in snapshot.humans}
    has_robot, has_people = "robot" not in unmeasured, bool(present)
    has_links, has_contacts = (any(getattr(s, name) for s in snapshots) for name in ("interactions", "contacts"))
    things = {item.id for item in scene.furniture}
    is_regard = {link.dst in things for snapshot in snapshots for link in snapshot.interactions}
    has_ignoring = has_people and any(human.reacts_to_robot == 0.0 for human in scene.humans)
    chassis, ignoring = partial(draw_chassis, shape=Disc(_RADIUS)), partial(_draw_pedestrian, ignores_robot=True)
    zones_size = 2 * (sum(_BODY) + PERSONAL_DISTANCE)
    rows: list[tuple[str, object, Callable[[Brush], None], float]] = [  # name, whether it is shown, symbol, its width
        *((a.replace(" ", "_"), a in present, partial(_draw_pedestrian, a, unmeasured), 2 * _RADIUS) for a in ACTIVITY),
        ("ignores", has_ignoring and has_robot, partial(ignoring, "standing", unmeasured), 2 * _RADIUS),
        ("gaze", layers.gaze and has_people and "heads" not in unmeasured, _draw_view, 1.0),
        ("robot", has_robot, partial(_turned, chassis), 2 * _RADIUS),
        ("other_robot", scene.robots, partial(_turned, partial(chassis, is_other=True)), 2 * _RADIUS),
        ("contact", has_robot and has_contacts, partial(_turned, partial(chassis, touches=True)), 2 * _RADIUS),
        ("goal", layers.goal and "goal" not in unmeasured, partial(draw_target, radius=_RADIUS), 2 * _RADIUS),
        ("door", scene.doors, partial(draw_door, width=0.8), 0.8),
        ("interior_door", scene.interior_doors, draw_leaf, 1.0),
        ("queue", scene.queues, _draw_queue, 0.8),
        ("place", scene.places, partial(draw_place, radius=0.35), 0.8),
        ("paths", paths, partial(draw_path_samples, robot=has_robot), 0.4),
        ("time_mark", time_marks and has_robot, draw_mark_sample, 0.4),
        ("interaction", layers.links and False in is_regard, partial(draw_link_between, **_LINE), 0.6),
        ("regard", layers.links and True in is_regard, partial(draw_regard_between, **_LINE), 0.6),
        ("zones", layers.zones and present, partial(draw_zones_of, r=_BODY[0], shoulder=_BODY[1]), zones_size),
        ("shared", layers.zones and has_links, partial(draw_shared_space, half_length=0.5, half_width=0.35), 1.0),
    ]
    for name, is_shown, draw, size in rows:
        if is_shown:
            yield Entry(name, wording(name, **_VALUES), draw, size)


def _turned(draw: Callable[[Brush], None], brush: Brush) -> None:
    """Draw a symbol that points up."""
    draw(brush.at((brush.x, brush.y), (0.0, 1.0)))


def _draw_pedestrian(activity: str, unmeasured: Iterable[str], brush: Brush, *, ignores_robot: bool = False) -> None:
    up, radius = brush.at((brush.x, brush.y), (0.0, 1.0)), _RADIUS
    if (foot := ACTIVITY[activity].foot) is not None and foot[0] > 1.0:  # the legs reach out of the circle
        radius *= 0.65
        up = brush.at((brush.x, brush.y - 0.6 * radius), (0.0, 1.0))
    if "headings" in unmeasured:
        draw_plain_body(up, activity, radius, ignores_robot=ignores_robot)
        return
    scale = radius / _RADIUS
    draw_body(up, activity, _BODY[0] * scale, _BODY[1] * scale, 0.7, ignores_robot=ignores_robot)
    draw_head(up, scale * (_BODY[0] + _BODY[1] / 2), nose="heads" not in unmeasured)


def _draw_queue(brush: Brush) -> None:
    draw_queue(brush.at((brush.x + 0.13, brush.y)), 0.25, 3)


def _draw_view(brush: Brush) -> None:
    """Draw the field of view of a pedestrian who looks to the right."""
    draw_fan(brush.at((-0.45, 0.0)), "standing", 0.2)
