"""Scenarios from maps: walls where the map has them, rooms, doors and furniture; nobody starts outside."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image, ImageDraw
from sonata2d_cli import main

import sonata2d as s2
from sonata2d.core.geometry import inside_polygon
from sonata2d.core.portable_math import Array, BoolArray
from sonata2d.errors import ConfigError
from sonata2d.scenegen import MapScenario, generate, scenario_from_map

CELL = 0.05  # m


def grid(*rooms: tuple[int, int, int, int], size: tuple[int, int] = (120, 160)) -> BoolArray:
    """Floor of rooms, each from (row, column) to (row, column), the first row on top."""
    floor = np.zeros(size, dtype=bool)
    for top, left, bottom, right in rooms:
        floor[top:bottom, left:right] = True
    return floor


TWO_ROOMS = ((20, 20, 100, 80), (20, 84, 100, 140), (50, 80, 68, 84))  # connected by a door of 0.9 m


def write_ros(folder: Path, floor: BoolArray, *, unknown: BoolArray | None = None, **header: Any) -> Path:
    """Write a map of ROS: free 254, occupied 0, unknown 205."""
    grey = np.where(floor, 254, 0).astype(np.uint8)
    if unknown is not None:
        grey[unknown] = 205
    Image.fromarray(grey).save(folder / "map.pgm")
    values = {
        "image": "map.pgm",
        "resolution": CELL,
        "origin": [0.0, 0.0, 0.0],
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    path = folder / "map.yaml"
    path.write_text(json.dumps(values | header))
    return path


def is_floor(found: MapScenario, points: Array) -> BoolArray:
    """Whether points (N, 2) are on the floor of the scenario, outside of furniture."""
    room = found.config.room
    assert room.polygon is not None
    inside = inside_polygon(points, np.array(room.polygon))
    for hole in room.holes:
        inside &= ~inside_polygon(points, np.array(hole))
    scene = s2.generate(found.config)
    for piece in scene.furniture:
        corners = [start for start, _, _ in piece.shape.edges(piece.pose)]
        inside &= ~inside_polygon(points, np.array(corners))
    return np.asarray(inside)


def centres(floor: BoolArray, unit: float = CELL) -> tuple[Array, BoolArray]:
    """Centres of all cells, (N, 2), m, with y upwards, and whether they are floor."""
    rows, columns = np.indices(floor.shape)
    points = np.stack(((columns + 0.5) * unit, (len(floor) - rows - 0.5) * unit), axis=-1)
    return points.reshape(-1, 2), floor.ravel()


def test_walls_are_where_the_map_has_them(tmp_path: Path) -> None:
    floor = grid(*TWO_ROOMS)
    floor[60:64, 40:44] = False  # a pillar of 0.2 m
    found = scenario_from_map(write_ros(tmp_path, floor))
    points, expected = centres(floor)
    assert (is_floor(found, points) == expected).all()
    assert found.facts["walls"] == 12  # the corners of two rooms with a door between them
    assert [piece.size for piece in found.config.furniture] == [(0.2, 0.2)]
    assert set(found.config.room.polygon or ()) >= {
        (1.0, 1.0),
        (1.0, 5.0),
        (7.0, 1.0),
        (7.0, 5.0),
        (4.0, 2.6),
        (4.2, 3.5),
    }


def test_turned_walls_are_straight(tmp_path: Path) -> None:
    plan = Image.fromarray(np.where(grid(*TWO_ROOMS), 254, 0).astype(np.uint8))
    turned = np.asarray(plan.rotate(20.0, resample=Image.Resampling.NEAREST, expand=True)) > 200
    found = scenario_from_map(write_ros(tmp_path, turned))
    points, expected = centres(turned)
    both, either = is_floor(found, points) & expected, is_floor(found, points) | expected
    assert both.sum() > 0.98 * either.sum()
    assert found.facts["walls"] <= 32  # the map has steps at every third cell


def test_a_map_is_placed_by_its_origin(tmp_path: Path) -> None:
    floor = grid(*TWO_ROOMS)
    found = scenario_from_map(write_ros(tmp_path, floor, origin=[-3.0, 2.0, math.pi / 2]))
    points, expected = centres(floor)
    moved = np.stack((-3.0 - points[:, 1], 2.0 + points[:, 0]), axis=1)
    assert (is_floor(found, moved) == expected).all()
    pixels = np.stack((points[:, 0] / CELL, len(floor) - points[:, 1] / CELL), axis=1)
    assert found.picture.to_pixels(moved) == pytest.approx(pixels)


def test_unknown_cells_are_no_floor(tmp_path: Path) -> None:
    unknown = grid((20, 20, 60, 80))
    found = scenario_from_map(write_ros(tmp_path, grid(*TWO_ROOMS), unknown=unknown))
    points, _ = centres(unknown)
    assert not is_floor(found, points)[unknown.ravel()].any()


def test_scales_of_darkness(tmp_path: Path) -> None:
    floor = grid(*TWO_ROOMS)
    Image.fromarray(np.where(floor, 0, 254).astype(np.uint8)).save(tmp_path / "dark.png")
    Image.fromarray(np.where(floor, 0, 100).astype(np.uint8)).save(tmp_path / "raw.png")
    usual = scenario_from_map(write_ros(tmp_path, floor)).config.room
    for header in ({"image": "dark.png", "negate": 1}, {"image": "raw.png", "mode": "raw"}):
        assert scenario_from_map(write_ros(tmp_path, floor, **header)).config.room == usual


def test_the_floor_around_the_robot_is_chosen(tmp_path: Path) -> None:
    path = write_ros(tmp_path, grid((20, 20, 100, 80), (20, 84, 100, 120)))
    largest, other = scenario_from_map(path), scenario_from_map(path, robot_at=(5.0, 3.0))
    assert (largest.facts["floor"], other.facts["floor"]) == (12.0, 7.2)
    assert "1 separate floors are left out, 7 m²; --robot-at X Y chooses another one" in largest.notes
    with pytest.raises(ConfigError, match=r"\(0.2, 0.2\) is not on the floor; the largest floor is around \("):
        scenario_from_map(path, robot_at=(0.2, 0.2))


def test_specks_and_narrow_passages_are_left_out(tmp_path: Path) -> None:
    floor = grid(*TWO_ROOMS, (40, 140, 43, 158))  # a ray of 0.15 m through a window
    floor[30, 30] = floor[90, 60] = False
    found = scenario_from_map(write_ros(tmp_path, floor))
    assert found.config.furniture == ()
    assert max(x for x, _ in found.config.room.polygon or ()) < 7.2  # the ray goes to 7.9 m
    assert found.notes == ["2 obstacles smaller than 0.15 m are left out; --smallest changes the limit"]
    assert scenario_from_map(tmp_path / "map.yaml", smallest=0.01).facts["furniture"] == 2


def test_the_number_of_walls_is_bounded(tmp_path: Path) -> None:
    floor = grid(*TWO_ROOMS)
    rng = np.random.default_rng(1)
    for column in range(20, 140):
        floor[20 : 20 + 3 * rng.integers(0, 3), column] = False
    exact = scenario_from_map(write_ros(tmp_path, floor), narrowest=0.05)
    few = scenario_from_map(tmp_path / "map.yaml", narrowest=0.05, most_walls=40)
    assert few.facts["walls"] <= 40 < exact.facts["walls"]
    assert few.notes[-1].startswith("walls are straightened by up to 0.")
    assert few.notes[-1].endswith("m, not 0.025, to have at most 40")


def test_rooms_are_areas(tmp_path: Path) -> None:
    found = scenario_from_map(write_ros(tmp_path, grid(*TWO_ROOMS)))
    assert [area.name for area in found.config.areas] == ["room-1", "room-2"]
    left, right = (np.array(area.polygon) for area in found.config.areas)
    assert inside_polygon(np.array([(1.1, 1.1), (3.9, 4.9)]), left).all()
    assert inside_polygon(np.array([(4.3, 1.1), (6.9, 4.9)]), right).all()
    assert not inside_polygon(np.array([(4.5, 3.0)]), left).any()


def test_a_scanned_plan_has_no_walls_of_thin_lines_and_nothing_outside(tmp_path: Path) -> None:
    plan = Image.fromarray(np.where(grid(*TWO_ROOMS, size=(120, 160)), 255, 0).astype(np.uint8))
    page = Image.new("L", (300, 240), 255)
    walls = Image.new("L", (160, 120), 255)
    walls.paste(plan.crop((12, 12, 148, 108)), (12, 12))
    page.paste(walls, (70, 60))
    pen = ImageDraw.Draw(page)
    pen.text((110, 110), "OFFICE", fill=0)
    pen.arc((120, 80, 180, 140), 0, 90, fill=0)
    page.save(tmp_path / "scan.png")
    found = scenario_from_map(tmp_path / "scan.png", unit=CELL, thin=0.15)
    assert found.facts["floor"] == pytest.approx((60 * 80 + 56 * 80 + 4 * 18) * CELL * CELL, rel=0.01)
    assert found.facts["furniture"] == 0
    with pytest.raises(ConfigError, match=r"scan.png: an image does not say how large it is; give the size of a pixel"):
        scenario_from_map(tmp_path / "scan.png")


def test_more_walls_than_allowed_are_an_error(tmp_path: Path) -> None:
    floor = grid((5, 5, 235, 315), size=(240, 320))
    for row in range(20, 220, 50):
        for column in range(20, 300, 50):
            floor[row : row + 3, column : column + 30] = False
            floor[row : row + 30, column : column + 3] = False  # an L is no furniture
    path = write_ros(tmp_path, floor)
    assert scenario_from_map(path).facts["walls"] == 4 + 24 * 6
    with pytest.raises(
        ConfigError, match=r"the map has \d+ walls even if they are straightened by 0.2.* \(--most-walls"
    ):
        scenario_from_map(path, most_walls=40)


def test_a_room_that_is_open_to_the_border_is_said(tmp_path: Path) -> None:
    page = np.full((160, 200), 255, dtype=np.uint8)
    page[20:140, 20:180] = 0
    page[24:136, 24:100] = page[24:136, 104:176] = 255
    page[60:80, 10:24] = 255  # a gap in the outer wall of the larger room
    Image.fromarray(page).save(tmp_path / "gap.png")
    found = scenario_from_map(tmp_path / "gap.png", unit=CELL)
    assert found.facts["floor"] == pytest.approx(72 * 112 * CELL * CELL, rel=0.01)
    assert "reach the border of the image are taken for the outside; close gaps in outer walls" in found.notes[0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"walls": "walls"}, "walls is a list of names, got the text 'walls'"),
        ({"threshold": 3}, "threshold must be within 0 and 1, got 3"),
        ({"unit": -1}, "unit must be above 0 and below 10000 m, got -1"),
        ({"thin": -1.0}, "thin must be 0 or more, got -1"),
        ({"most_walls": 3}, "most_walls must be 10 or more, got 3"),
    ],
)
def test_options_are_checked(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        scenario_from_map(write_ros(tmp_path, grid(*TWO_ROOMS)), **options)


FLAT = """<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape">
<g transform="translate(100 50)">
  <g inkscape:label="Walls" fill="#222222">
    <rect width="800" height="20"/><rect y="380" width="800" height="20"/>
    <rect width="20" height="400"/><rect x="780" width="20" height="150"/>
    <rect x="780" y="250" width="20" height="150"/>
    <path d="M 400 20 h 10 v 150 h -10 z M 400 260 h 10 v 120 h -10 z"/>
  </g>
  <g inkscape:label="doors" fill="none" stroke="#f00">
    <path d="M 400 170 v 90 A 90 90 0 0 1 310 170"/>
    <rect x="780" y="150" width="20" height="100"/>
  </g>
  <g inkscape:label="furniture" style="fill:none;stroke:#000">
    <g><title>dining table</title><rect x="100" y="60" width="120" height="80"/></g>
    <circle id="plant-3" cx="700" cy="340" r="20"/>
    <rect id="sofa" x="-90" y="-40" width="180" height="80" transform="translate(600 120) rotate(90)"/>
    <rect id="rect12" x="900" y="0" width="50" height="50"/>
  </g>
  <text x="150" y="220">living room</text><text x="560" y="220">kitchen</text>
</g></svg>"""


def test_a_drawing_in_svg_has_rooms_doors_and_furniture(tmp_path: Path) -> None:
    path = tmp_path / "flat.svg"
    path.write_text(FLAT)
    found = scenario_from_map(path, unit=0.01)
    config = found.config
    assert found.facts["floor"] == pytest.approx(3.8 * 3.6 + 3.7 * 3.6 + 0.1 * 0.9, abs=0.1)
    assert [area.name for area in config.areas] == ["living room", "kitchen"]
    assert [(piece.type, piece.attracts) for piece in config.furniture] == [
        ("table", True), ("plant", True), ("sofa", True),
    ]  # fmt: skip
    table, plant, sofa = config.furniture
    assert (table.x, table.y, table.size) == (2.6, -1.5, (1.2, 0.8))
    assert plant.size == pytest.approx(0.2, abs=0.002)
    assert sofa.size == pytest.approx((1.8, 0.8))
    assert abs(sofa.theta) == pytest.approx(math.pi / 2, abs=1e-3)
    assert [(door.x, door.y) for door in config.doors] == [
        (pytest.approx(8.9, abs=0.05), pytest.approx(-2.5, abs=0.05))
    ]
    assert found.notes == ["furniture in walls or outside is left out: object at (10.25, -0.75)"]
    assert config.interior_doors == ()
    (leaf,) = scenario_from_map(path, unit=0.01, leaves="hinged").config.interior_doors
    assert (leaf.x, leaf.y, leaf.kind) == (pytest.approx(5.05, abs=0.05), pytest.approx(-2.65, abs=0.05), "hinged")
    (door,) = generate(scenario_from_map(path, unit=0.01, leaves="hinged").config, seed=1).interior_doors
    assert door.width == pytest.approx(0.9, abs=0.01)
    coloured = scenario_from_map(path, unit=0.01, walls=["#222222"], doors=["#ff0000"])
    assert coloured.config.room == config.room


def test_doors_that_close_no_gap_are_noted(tmp_path: Path) -> None:
    path = tmp_path / "flat.svg"
    path.write_text(FLAT.replace("M 400 170 v 90 A 90 90 0 0 1 310 170", "M 300 170 v 90"))
    found = scenario_from_map(path, unit=0.01)
    assert found.notes[0] == (
        "the door at (4.00, -2.65) is left out: it closes no gap between walls; draw it from wall to wall"
    )
    assert found.facts["rooms"] == 1


def test_photographs_are_turned_as_their_camera_says(tmp_path: Path) -> None:
    plan = Image.fromarray(np.where(grid(*TWO_ROOMS), 255, 0).astype(np.uint8))
    plan.save(tmp_path / "upright.png")
    exif = Image.Exif()
    exif[0x0112] = 6  # turned by 90 degrees when shown
    plan.transpose(Image.Transpose.ROTATE_90).save(tmp_path / "turned.png", exif=exif)
    upright, turned = (scenario_from_map(tmp_path / f"{name}.png", unit=0.05) for name in ("upright", "turned"))
    assert turned.config.room == upright.config.room


def test_layers_that_are_missing_are_named(tmp_path: Path) -> None:
    path = tmp_path / "flat.svg"
    path.write_text(FLAT.replace("Walls", "Mauern"))
    with pytest.raises(ConfigError, match=r"named like \*wall\*; the drawing has .*Mauern.*\(--walls NAME\)"):
        scenario_from_map(path, unit=0.01)
    assert scenario_from_map(path, unit=0.01, walls=["mauern"]).facts["rooms"] == 2
    path.write_text(FLAT.replace('<rect x="780" y="150" width="20" height="100"/>', ""))
    leaking = scenario_from_map(path, unit=0.01)
    assert leaking.facts["floor"] == pytest.approx(3.8 * 3.6, abs=0.1)
    assert leaking.notes[-1].startswith("these texts are not in an enclosed room: 'kitchen'; if they name rooms, close")
    for kind in ("doors", "furniture", "rooms"):
        with pytest.raises(ConfigError, match=rf"named like nope; the drawing has .*Walls.*\(--{kind} NAME\)"):
            scenario_from_map(path, unit=0.01, **{kind: ["nope"]})
    path.write_text(FLAT.replace("doors", "swings"))
    with pytest.raises(ConfigError, match="no floor is enclosed by walls; close gaps in the outer walls"):
        scenario_from_map(path, unit=0.01)
    with pytest.raises(ConfigError, match=r"give the length of its unit, m \(--unit\)"):
        scenario_from_map(path)


def drawing(*parts: str, head: str = "") -> str:
    """An SVG drawing of a room of 10 m by 8 m with a wall in the middle, in metres, and further parts."""
    walls = '<path fill-rule="evenodd" d="M0 0 H10 V8 H0 Z M.2 .2 H9.8 V7.8 H.2 Z"/><path d="M4.9 .2 H5.1 V3 H4.9 Z"/>'
    walls += '<path d="M4.9 4 H5.1 V7.8 H4.9 Z"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg">{head}<g id="walls">{walls}</g>{"".join(parts)}</svg>'


LEAF_AND_SWING = '<g id="doors" fill="none" stroke="red"><path d="M5 3 H6"/><path d="M6 3 A1 1 0 0 1 5 4"/></g>'


@pytest.mark.parametrize(
    ("content", "rooms", "furniture"),
    [
        (drawing(LEAF_AND_SWING, "<text x='2' y='4'>bath</text><text x='8' y='4'>hall</text>"), ["bath", "hall"], []),
        (drawing(LEAF_AND_SWING, *(f"<text x='{x}' y='2'>office</text>" for x in (2, 8))), ["office", "office 2"], []),
        (
            drawing(
                LEAF_AND_SWING, "<text x='2' y='4'>sleep</text><text x='2' y='2'>2.50 m</text>",
                "<g id='rooms'><rect x='.2' y='.2' width='4.7' height='7.6'/></g>",
            ),
            ["sleep"], [],
        ),
        (
            drawing(
                LEAF_AND_SWING,
                "<g id='furniture'><title>Furniture</title><rect id='sofa' x='1' y='1' width='2' height='1'/>"
                "<rect class='hidden' id='desk' x='7' y='1' width='1' height='1'/></g>",
                head="<title>My flat</title><style>.hidden{visibility:hidden}</style>",
            ),
            ["room-1", "room-2"], ["sofa"],
        ),
        (
            drawing(LEAF_AND_SWING, "<g id='furniture' fill='none'><path d=''/><rect id='table' class='t' "
                    "x='1' y='1' width='2' height='1'/></g>", head="<style>.t{fill:rgb(1,2,3)}</style>"),
            ["room-1", "room-2"], ["table"],
        ),
        (  # a group is one piece, but not what is apart from it; four loose lines that touch are one piece
            drawing(
                LEAF_AND_SWING, "<g id='furniture' fill='none'><g><title>sofa</title><rect x='1' y='1' width='2' "
                "height='1'/><rect x='1.2' y='1.2' width='.5' height='.5'/><rect x='1' y='4' width='2' height='1'/></g>"
                "<path d='M7 1 H8'/><path d='M8 1 V2'/><path d='M8 2 H7'/><path d='M7 2 V1'/></g>",
            ),
            ["room-1", "room-2"], ["sofa", "sofa", "object"],
        ),
        (
            drawing(
                LEAF_AND_SWING, "<g id='furniture' xmlns:i='http://www.inkscape.org/namespaces/inkscape' fill='none'>"
                "<g i:label='desk'><path id='path1' d='M1 1 H3'/><path d='M3 1 V2'/><path d='M1 1 L3 2'/></g></g>",
            ),
            ["room-1", "room-2"], ["table"],
        ),
    ],
)  # fmt: skip
def test_parts_of_drawings(tmp_path: Path, content: str, rooms: list[str], furniture: list[str]) -> None:
    (tmp_path / "a.svg").write_text(content)
    found = scenario_from_map(tmp_path / "a.svg", unit=1.0)
    assert found.facts["floor"] == pytest.approx(2 * 4.7 * 7.6 + 0.2, abs=0.1)
    assert [area.name for area in found.config.areas] == rooms
    assert [piece.type for piece in found.config.furniture] == furniture
    assert found.config.doors == ()


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ("<svg viewBox='0 0 1 1'/>", "has another <svg> in it; ungroup it"),
        ("<rect x='10%' width='1' height='1'/>", "the length '10%' of the drawing is not in user units"),
        (
            "<g transform='matrix(1 2)'><rect width='1' height='1'/></g>",
            r"the transform 'matrix\(1 2\)' of the drawing",
        ),
        ("<g>" * 2000 + "</g>" * 2000, "a.svg: groups are nested too deeply"),
    ],
)
def test_parts_that_cannot_be_read_are_refused(tmp_path: Path, part: str, message: str) -> None:
    (tmp_path / "a.svg").write_text(drawing(part))
    with pytest.raises(ConfigError, match=message):
        scenario_from_map(tmp_path / "a.svg", unit=1.0)


def test_clones_are_noted(tmp_path: Path) -> None:
    (tmp_path / "a.svg").write_text(drawing("<use href='#walls' x='20'/>"))
    assert scenario_from_map(tmp_path / "a.svg", unit=1.0).notes == [
        "1 clones (<use>) are left out; unlink them in the drawing"
    ]


def write_dxf(path: Path, *, units: int = 4) -> Path:
    """An office of two rooms and a lobby, drawn in millimetres with single lines for walls."""
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new(units=units)
    space = document.modelspace()

    def wall(*points: tuple[float, float]) -> None:
        space.add_lwpolyline(points, dxfattribs={"layer": "A-WALL"})

    wall((3000, 0), (0, 0), (0, 6000), (10000, 6000), (10000, 0), (4000, 0))
    for x in (0, 5000):
        wall((x, 3000), (x + 2000, 3000))
        wall((x + 2900, 3000), (x + 5000, 3000))
    wall((5000, 3000), (5000, 6000))
    swing = document.blocks.new("DOOR")
    swing.add_line((0, 0), (0, 900))
    swing.add_arc((0, 0), 900, 0, 90)
    for x in (2000, 7000):
        space.add_blockref("DOOR", (x, 3000), dxfattribs={"layer": "A-DOOR"})
    space.add_line((3000, 0), (4000, 0), dxfattribs={"layer": "A-DOOR"})
    desk = document.blocks.new("DESK_160")
    desk.add_lwpolyline([(0, 0), (1600, 0), (1600, 800), (0, 800)], close=True)
    space.add_blockref("DESK_160", (500, 4500), dxfattribs={"layer": "A-FURN"})
    space.add_blockref("DESK_160", (7500, 4300), dxfattribs={"layer": "A-FURN", "rotation": 30.0})
    for name, place in (("office 1", (1500, 4000)), ("office 2", (6500, 3600)), ("lobby", (5000, 1500))):
        space.add_text(name, dxfattribs={"layer": "A-ANNO", "insert": place, "height": 200})
    document.saveas(path)
    return path


def test_a_drawing_in_dxf_has_rooms_doors_and_furniture(tmp_path: Path) -> None:
    found = scenario_from_map(write_dxf(tmp_path / "office.dxf"))
    assert sorted(area.name for area in found.config.areas) == ["lobby", "office 1", "office 2"]
    assert found.facts["floor"] == pytest.approx(9.9 * 5.9 - 9.9 * 0.1 - 2.9 * 0.1 + 2 * 0.9 * 0.1, abs=0.2)
    assert [(piece.type, piece.size) for piece in found.config.furniture] == [("table", (1.6, 0.8))] * 2
    assert sorted(abs(piece.theta) for piece in found.config.furniture) == pytest.approx([0.0, math.pi / 6], abs=1e-3)
    assert [(door.x, door.width) for door in found.config.doors] == [(pytest.approx(3.5), pytest.approx(1.0, abs=0.11))]
    with pytest.raises(ConfigError, match=r"does not say its unit; give the length of its unit, m \(--unit\)"):
        scenario_from_map(write_dxf(tmp_path / "unitless.dxf", units=0))
    assert scenario_from_map(tmp_path / "unitless.dxf", unit=0.001).config.room == found.config.room


def test_entities_of_dxf(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new(units=6)
    space = document.modelspace()
    hatch = space.add_hatch(dxfattribs={"layer": "WALL"})
    for size, flags in ((0.0, 1), (0.2, 16)):
        corners = [(size, size), (10 - size, size), (10 - size, 8 - size), (size, 8 - size)]
        hatch.paths.add_polyline_path(corners, is_closed=True, flags=flags)
    space.add_lwpolyline([(5, 0), (5, 8)], dxfattribs={"layer": "OLD", "const_width": 0.4})
    document.layers.add("OLD").freeze()
    space.add_lwpolyline([(3, 0.2), (3, 2)], dxfattribs={"layer": "0", "color": 1, "const_width": 0.4})
    chair = document.blocks.new("CHAIR")
    chair.add_circle((0, 0), 0.25)
    rows = {"layer": "FURN", "row_count": 2, "column_count": 3, "row_spacing": 1.0, "column_spacing": 1.0}
    space.add_blockref("CHAIR", (6, 4), dxfattribs=rows)
    text = space.add_text("hall %%c", dxfattribs={"layer": "TEXT", "height": 0.2})
    text.set_placement((6, 6), align=ezdxf.enums.TextEntityAlignment.MIDDLE_CENTER)
    document.saveas(tmp_path / "a.dxf")
    found = scenario_from_map(tmp_path / "a.dxf")
    assert found.facts["floor"] == pytest.approx(9.6 * 7.6, abs=0.05)
    assert [piece.type for piece in found.config.furniture] == ["chair"] * 6
    assert found.config.areas[0].name.startswith("hall")
    with_red = scenario_from_map(tmp_path / "a.dxf", walls=["wall", "#ff0000"])
    assert with_red.facts["floor"] == pytest.approx(9.6 * 7.6 - 0.4 * 2.0, abs=0.05)


def test_people_and_robot_start_on_the_floor_and_reach_their_goals(tmp_path: Path) -> None:
    config = scenario_from_map(write_dxf(tmp_path / "office.dxf")).config.changed(standing=3, wandering=4)
    outline = np.array(config.room.polygon)
    for episode in range(4):
        scene = s2.generate(config, 1, episode)
        starts = np.array([scene.robot.pose.position, scene.goal.position, *(h.pose.position for h in scene.humans)])
        assert inside_polygon(starts, outline).all()
        assert not any(inside_polygon(starts, np.array(hole)).any() for hole in scene.holes)
    outcome = s2.Episode(s2.generate(config, 1, 0), s2.load_controller("social-planner")).run()
    assert outcome.status == "goal"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.yaml", "image: missing.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n", "missing.pgm cannot be read"),
        (
            "a.yaml",
            "resolution: 0.05\n",
            "a.yaml: image of the map of ROS: Field required",
        ),
        ("a.yaml", "[" * 100_000, "a.yaml, line 1: values are nested more than 32 deep"),
        (
            "a.yaml",
            "image: a.png\nresolution: -1\norigin: [0, 0, 0]\n",
            "a.yaml: resolution of the map of ROS: Input should be",
        ),
        ("a.svg", "<svg", "a.svg is not an SVG drawing"),
        ("a.svg", '<svg><g id="walls"><path d="M 0 0 L 1"/></g></svg>', "the path of the drawing cannot be read"),
        (
            "a.svg",
            '<svg id="wall"><rect width="1e9" height="2"/></svg>',
            "the drawing is 5e.07 m wide, at most 2000 m are read",
        ),
        ("a.svg", '<svg id="wall"/>', "a.svg: the drawing has no lines"),
        ("a.dxf", "nothing", "a.dxf is not a DXF drawing"),
        ("a.png", "nothing", "a.png cannot be read"),
        ("a.doc", "", r"a.doc: maps have one of the suffixes \.yaml, \.yml, \.png"),
    ],
)
def test_files_that_are_no_maps_are_refused(tmp_path: Path, name: str, content: str, message: str) -> None:
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(ConfigError, match=message):
        scenario_from_map(path, unit=0.05)


def test_the_command_writes_the_scenario_and_a_picture(tmp_path: Path) -> None:
    path = write_ros(tmp_path, grid(*TWO_ROOMS))
    out = tmp_path / "two.yaml"
    words = ["scenarios", "from-map", str(path), "-o", str(out)]
    done = CliRunner().invoke(main, words, standalone_mode=False)
    assert done.exception is None
    assert "floor of 23.4 m², 12 walls, 2 rooms, 0 furniture, 0 entrances" in done.output
    assert s2.load_scenario(out) == scenario_from_map(path).config
    with Image.open(tmp_path / "two-map.png") as picture:
        assert max(picture.size) == 1600
        red = np.asarray(picture)[..., :3] == (214, 39, 40)
    assert red.all(axis=-1).sum() > 1000
    again = CliRunner().invoke(main, words)
    assert again.exit_code == 2
    assert "already exists" in again.output
    out.write_text("of another time")
    assert CliRunner().invoke(main, [*words, "--overwrite"], standalone_mode=False).exception is None
    assert s2.load_scenario(out) == scenario_from_map(path).config
    over_map = CliRunner().invoke(main, [*words[:-1], str(path), "--overwrite"])
    assert "already exists" in over_map.output
    out.unlink()
    assert "two-map.png already exists" in CliRunner().invoke(main, [*words, "--overwrite"]).output
