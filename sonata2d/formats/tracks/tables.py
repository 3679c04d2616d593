"""Tables of tracks as text: separators, header rows, comments and units as the programs of the field write them."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.portable_math import Array
from .observations import LENGTHS, Observations, ids_of, people_and_robot, require_bounded

# Names of columns in lower case, without blanks, `_`, `-` and `.`; of two columns of one kind, the first name counts.
_ALIASES = {
    "frame": ("frame", "frameid", "frameno", "framenumber", "framenum", "frameindex", "frames", "fr", "f"),
    "ped": (
        "ped", "pedid", "pedestrian", "pedestrianid", "person", "personid", "persid", "persnr", "id", "pid", "agent",
        "agentid", "agid", "human", "humanid", "track", "trackid", "object", "objectid", "objid", "name", "p",
    ),
    "x": ("x", "posx", "xpos", "positionx", "px", "worldx", "xworld", "xest", "centerx", "xcenter", "centrex"),
    "y": ("y", "posy", "ypos", "positiony", "py", "worldy", "yworld", "yest", "centery", "ycenter", "centrey"),
    "z": ("z", "posz", "zpos", "positionz", "pz", "worldz", "height"),
    "t": ("t", "time", "timestamp", "seconds", "secs", "sec", "simtime", "elapsed"),
    "group": ("group", "groupid", "groupnumber"),
    "kind": ("type", "kind", "class", "agenttype", "objecttype", "category", "label"),
}  # fmt: skip
_ROLE_OF = {alias: role for role, aliases in _ALIASES.items() for alias in aliases}
_TIMES = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}  # s
_UNITS = LENGTHS | _TIMES
_IGNORED = ("-", "_")  # names of columns that `columns` leaves out
_ABSENT = frozenset({"", "na", "n/a", "nan", "null", "none", "-", "?"})  # cells that hold no number
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
_NUMBER = re.compile(r"[+-]?\d+(?:[.,]\d*)?(?:[eE][+-]?\d+)?")
_UNIT_IN_NAME = re.compile(r"\s*(?:/\s*|[\[(]\s*(?:in\s+)?|\s+in\s+|_)([a-zµ]+)\s*[\])]?$")
_UNIT_IN_COMMENT = re.compile(r"(?:\bin\s+|\bunits?\s*[:=]?\s*(?:is\s+|are\s+|in\s+)?|\b[xy]\s*/\s*)([a-zµ]+)\b")
_OF_OTHERS = re.compile(r"\b(?:z|height|time|t|duration|radius)\s*$")  # before `in cm`: no unit of x and y
_RATE = re.compile(
    r"(?:frame\s*[-_]?\s*rate|fps|frames\s+per\s+second)\W*(?:(?:is|in|hz|fps|of)\W*)*(\d+(?:[.,]\d+)?)"
    r"|(\d+(?:[.,]\d+)?)\s*(?:fps|frames?\s*(?:per|/)\s*s)"
)
_CLEARER = 1.5  # factor by which one order of unnamed columns must be more plausible than the other
HEADER = ("frame", "ped", "x", "y")


@dataclass(frozen=True, slots=True)
class _Table:
    """Rows of a file, and what it says about them.

    Attributes:
        rows: cells of each row, without the header.
        names: of the columns; None without a header.
        comments: lines that begin with `#` or `//`, in lower case.
    """

    rows: list[list[str]]
    names: list[str] | None
    comments: list[str]


def read_observations(text: str, columns: Sequence[str] | None) -> Observations:
    """Read a table of tracks: one row per person and frame.

    The columns are named by `columns`, the header row or the last comment that lists them. Without any of these, the
    order `frame, ped, x, y` or `ped, frame, x, y` is taken if it is clearly the more plausible one.

    Args:
        text: the content of the file.
        columns: names of the columns in the order of the file, `-` for a column that is left out.

    Raises:
        ValueError: the file holds no table of tracks, or does not show which column is which.
    """
    table = _parsed(text)
    if not table.rows:
        raise ValueError("it has no rows" if table.names or table.comments else "it is empty")
    places, units, notes, layout = _places(table, columns)
    width = len(table.rows[0])
    for number, row in enumerate(table.rows, 1):
        if len(row) != width:
            shown = ", ".join(columns or table.names or HEADER)
            raise ValueError(f"row {number} has {len(row)} cells, not the {width} of {shown}")
    cells = {role: [row[place] for row in table.rows] for role, place in places.items()}
    numbers = {role: _numbers(cells[role], role) for role in ("frame", "x", "y", "t") if role in cells}
    if "t" in numbers and np.isfinite(first := np.nanmin(numbers["t"], initial=np.inf)):
        numbers["t"] = numbers["t"] - first  # milliseconds since 1970 are large numbers
    require_bounded(np.stack([*numbers.values()]), ", ".join(numbers))
    for number, name in enumerate(cells["ped"], 1):
        if name.lower() in _ABSENT:
            raise ValueError(f"row {number} has no id of a person")
    ped, names = ids_of(cells["ped"])
    kept, robot, left_out = np.ones(len(ped), dtype=bool), None, tuple[str, ...]()
    if "kind" in cells:
        kept, robot, left_out = people_and_robot(cells["kind"], ped)
    group = _numbers(cells["group"], "group")[kept] if "group" in cells else None
    is_per_step = layout == "obsmat" and units.get("rate") is None
    return Observations(
        ped=ped[kept],
        position=np.stack((numbers["x"], numbers["y"]), axis=1)[kept],
        frame=numbers["frame"][kept] if "frame" in numbers else None,
        time=numbers["t"][kept] * units.get("t", 1.0) if "t" in numbers else None,
        layout=layout,
        unit=units.get("x"),
        frame_rate=units.get("rate"),
        interval=0.4 if is_per_step else None,  # ETH and UCY are annotated at 2.5 Hz, whatever their frame numbers
        group=None if group is None or np.isnan(group).all() else group,
        robot=robot,
        notes=(*notes, *names, *left_out),
    )


def read_numbers(text: str, names: tuple[str, ...]) -> Array:
    """Read a table of numbers whose header row has exactly these names; (rows, names).

    Raises:
        ValueError: the header is another one, or a cell is not a finite number below 1e11.
    """
    table = _parsed(text)
    values = [_numbers(row, "a cell") for row in table.rows]
    if [name.lower() for name in table.names or ()] != list(names) or any(len(row) != len(names) for row in values):
        raise ValueError(f"it must begin with the line {','.join(names)!r}, and hold numbers in these columns")
    array = np.array(values, dtype=float).reshape(-1, len(names))
    require_bounded(np.where(np.isnan(array), np.inf, array), ", ".join(names))
    return array


def _parsed(text: str) -> _Table:
    lines = [line for line in text.splitlines() if line.strip()]
    comments = [line.strip().lstrip("#/% ").lower() for line in lines if _is_comment(line)]
    lines = [line for line in lines if not _is_comment(line)]
    if lines and re.fullmatch(r"sep=.", lines[0].strip()):  # the first line of spreadsheets
        del lines[0]
    if not lines:
        return _Table([], None, comments)
    stripped = [line.strip() for line in lines]
    separator = _separator(stripped)
    if separator != "\t":  # else empty cells at the ends would be gone
        lines = [line.replace("\t", " ") for line in stripped] if separator == " " else stripped
    try:
        rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=separator, skipinitialspace=True)]
    except csv.Error as error:
        raise ValueError(f"it is not a table of text: {error}") from error
    if separator != "," and any(_DECIMAL_COMMA.fullmatch(cell) for row in rows for cell in row):
        rows = [[cell.replace(",", ".") for cell in row] for row in rows]
    is_header = not any(_is_number(cell) for cell in rows[0])
    names = rows.pop(0) if is_header else None
    if (
        names
        and rows
        and len(rows[0]) == len(names)
        and {cell.lower() for cell in rows[0]} <= _UNITS.keys() | {"", "m/s"}
    ):
        units = rows.pop(0)  # a second header row
        names = [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]
    return _Table(rows, names, comments)


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(("#", "//", "%"))


def _separator(lines: list[str]) -> str:
    """The separator of the cells; a blank stands for any number of blanks and tabs."""
    first, sample = lines[0], lines[min(1, len(lines) - 1)]
    if ";" in first or "\t" in first:
        return ";" if ";" in first else "\t"
    words = sample.split()
    with_decimal_commas = len(words) > 1 and all(_NUMBER.fullmatch(word) for word in words) and "," in sample
    return "," if "," in first + sample and not with_decimal_commas else " "


def _is_number(cell: str) -> bool:
    """Whether a cell holds a number, or `nan`."""
    try:
        _number(cell)
    except ValueError:
        return False
    return True


def _number(cell: str) -> float:
    if "_" in cell:  # a number in Python only
        raise ValueError(cell)
    return float(cell)


def _numbers(cells: list[str], name: str) -> Array:
    """(M,) numbers of a column; NaN where a cell holds none."""
    try:
        return np.array(list(map(_number, cells)))
    except ValueError:
        pass
    values = np.full(len(cells), np.nan)
    for k, cell in enumerate(cells):
        if cell.lower() in _ABSENT:
            continue
        try:
            values[k] = _number(cell)
        except ValueError:
            raise ValueError(f"row {k + 1} has {cell!r} in the column {name}, which must hold numbers") from None
    return values


def _places(table: _Table, columns: Sequence[str] | None) -> tuple[dict[str, int], dict[str, float], list[str], str]:
    """Column of each role, units of x (m) and t (s) and the frame rate (`rate`, Hz), remarks, and the layout's name."""
    width, notes, layout, units = len(table.rows[0]), list[str](), "csv", dict[str, float]()
    if columns is not None:
        if len(columns) != width:
            raise ValueError(f"its rows have {width} cells, but {len(columns)} columns are named: {', '.join(columns)}")
        for name in columns:
            if name not in _IGNORED and _role(name)[0] is None:
                raise ValueError(f"the column {name!r} is unknown; name {', '.join(_ALIASES)}, or - to leave one out")
        names: Sequence[str] = columns
    elif table.names is not None:
        names = table.names
    elif found := _listed_in_comments(table.comments, width):
        names = found
    else:
        names, layout = _guessed(table, width)
        if tuple(names[:4]) != HEADER and layout == "csv":
            notes.append(f"the file does not name its columns; they are read as {', '.join(names)}")
    places = dict[str, int]()
    roles = [_role(name) for name in names]
    for role, aliases in _ALIASES.items():
        found_at = [
            (aliases.index(_plain(name)), k)
            for k, (name, (of, _)) in enumerate(zip(names, roles, strict=True))
            if of == role
        ]
        if found_at:
            places[role] = min(found_at)[1]
    for role in ("ped", "x", "y"):
        if role not in places:
            raise ValueError(f"it has no column {role}; its columns are {', '.join(names)}; name them with --columns")
    if "frame" not in places and "t" not in places:
        raise ValueError(f"it has no column frame or t; its columns are {', '.join(names)}; name them with --columns")
    for role in ("x", "t"):
        unit = roles[places[role]][1] if role in places else None
        if unit is None and role in places and table.names is not None:  # columns that the user names
            unit = _role(table.names[places[role]])[1]
        if unit in (LENGTHS if role == "x" else _TIMES):
            units[role] = _UNITS[str(unit)]
    for comment in table.comments:
        if (rate := _RATE.search(comment)) and (number := float((rate[1] or rate[2]).replace(",", "."))) > 0.0:
            units.setdefault("rate", number)
        for found_unit in _UNIT_IN_COMMENT.finditer(comment):
            if found_unit[1] in LENGTHS and not _OF_OTHERS.search(comment[: found_unit.start()]):
                units.setdefault("x", LENGTHS[found_unit[1]])
    return places, units, notes, layout


def _plain(name: str) -> str:
    """Name of a column without its unit, in lower case, without blanks, `_`, `-` and `.`."""
    name = name.strip().strip("\"'").lower()
    match = _UNIT_IN_NAME.search(name)
    if match and match[1] in _UNITS:
        name = name[: match.start()]
    return re.sub(r"[\s_.\-]+", "", name)


def _role(name: str) -> tuple[str | None, str | None]:
    """Role of a column and the unit in its name; None without."""
    match = _UNIT_IN_NAME.search(name.strip().strip("\"'").lower())
    return _ROLE_OF.get(_plain(name)), match[1] if match and match[1] in _UNITS else None


def _listed_in_comments(comments: list[str], width: int) -> list[str] | None:
    """Names of the columns, if a comment lists one for each; the last such comment counts."""
    for comment in reversed(comments):
        joined = re.sub(r"\s*[\[(]\s*(?:in\s+)?([a-zµ]+)\s*[\])]", r"/\1", comment)
        names = [name for name in re.split(r"[\s,;]+", joined) if name]
        roles = {_role(name)[0] for name in names}
        if len(names) == width and {"ped", "x", "y"} <= roles and roles & {"frame", "t"}:
            return names
    return None


def _guessed(table: _Table, width: int) -> tuple[list[str], str]:
    """Names of unnamed columns, and the name of the layout.

    Raises:
        ValueError: no order, or both orders of frame and id are plausible.
    """
    try:
        values = np.array([[_number(cell) for cell in row] for row in table.rows if len(row) == width])
    except ValueError:
        values = np.zeros((0, width))  # names of people
    if width == 8 and len(values) and not values[:, (3, 6)].any():
        return ["frame", "ped", "x", "z", "y", "-", "-", "-"], "obsmat"  # position and velocity, height in between
    values = values[np.isfinite(values).all(axis=1)]
    names = ", ".join(HEADER)
    if width not in (4, 5):
        raise ValueError(f"it has {width} columns without names; name them, e.g. --columns {names.replace(' ', '')}")
    if not len(values):
        is_first = not _is_number(table.rows[0][0])  # a name of a person
        return (["ped", "frame", "x", "y", "z"] if is_first else [*HEADER, "z"])[:width], "csv"
    first, second = _cost(values[:, 0], values[:, 1], values[:, 2:4]), _cost(values[:, 1], values[:, 0], values[:, 2:4])
    if not max(first, second) > _CLEARER * min(first, second):
        raise ValueError(
            "its first two columns may be frame and id or id and frame; say which, e.g. --columns id,frame,x,y"
        )
    order = list(HEADER) if first < second else ["ped", "frame", "x", "y"]
    fifth = ["t" if _is_proportional(values[:, order.index("frame")], values[:, 4]) else "z"] if width == 5 else []
    return order + fifth, "csv"


def _cost(frame: Array, ped: Array, position: Array) -> float:
    """Measure of how little a table looks like tracks: how far people move, and how abruptly, from row to row.

    Returns:
        m; infinite if nobody is observed twice, or somebody is in two places in one frame.
    """
    if (ped != np.rint(ped)).any():
        return np.inf
    order = np.lexsort((frame, ped))
    ped, frame, position = ped[order], frame[order], position[order]
    same = ped[1:] == ped[:-1]
    step = np.diff(position, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    if not same.any() or (same & (np.diff(frame) == 0) & (length > 0)).any():
        return np.inf
    change = np.diff(step, axis=0)
    bend = np.hypot(change[:, 0], change[:, 1])[same[1:] & same[:-1]]
    return float(np.median(length[same])) + (2 * float(np.median(bend)) if len(bend) else 0.0)


def _is_proportional(frame: Array, t: Array) -> bool:
    """Whether a column rises with the frame numbers as times do."""
    span = np.ptp(frame)
    return bool(span > 0 and np.ptp(t) > 0 and np.corrcoef(frame, t)[0, 1] > 0.9999)
