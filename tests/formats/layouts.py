"""Writers of one set of tracks in every layout that is read."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

STEP = 0.4  # s
# frame, person, x, y in m: 1 walks along a curve, 2 comes later from the other side, 5 stands
ROWS = [
    (k, person, round(x, 3), round(y, 3))
    for k in range(20)
    for person, first, x, y in (
        (1, 0, -4.0 + 0.5 * k, 0.4 * np.sin(k / 4)),
        (2, 6, 4.0 - 0.45 * k, 1.5),
        (5, 0, 0.5, -2.0),
    )
    if k >= first
]
PEOPLE = {
    person: np.array([(STEP * k, x, y) for k, who, x, y in ROWS if who == person]) for person in (1, 2, 5)
}  # t, x, y


@dataclass(frozen=True)
class Layout:
    """A layout: how the rows are written, and what the reader must be told."""

    name: str
    write: Callable[[Path], None]
    options: dict[str, Any] = field(default_factory=dict)


def table(header: str, row: str, step: int = 10, unit: float = 1.0) -> Callable[[Path], None]:
    """Rows of text; `row` formats frame f, time t, person p, and x, y in units of `unit`."""

    def write(path: Path) -> None:
        lines = [row.format(f=step * k + 100, t=STEP * k, p=p, x=x / unit, y=y / unit) for k, p, x, y in ROWS]
        path.write_text("\n".join([*([header] if header else []), *lines, ""]))

    return write


def decimal_commas(path: Path) -> None:
    table("frame;id;x;y", "{f};{p};{x:.3f};{y:.3f}")(path)
    path.write_text(path.read_text().replace(".", ","))


def utf16(path: Path) -> None:
    table("frame,ped,x,y", "{f},{p},{x},{y}")(path)
    path.write_text(path.read_text().replace("\n", "\r\n"), "utf-16")


def trajnet(path: Path) -> None:
    tracks = [
        {"track": {"f": 10.0 * k, "p": float(p), "x": x, "y": y, "prediction_number": None}} for k, p, x, y in ROWS
    ]
    scene = {"scene": {"id": 0, "p": 1, "s": 0, "e": 190, "fps": 2.5, "tag": [3, [2, 3]]}}
    path.write_text("\n".join(map(json.dumps, [scene, *tracks])))


def vsp(path: Path) -> None:
    """Only the ends and the turning points: the reader draws lines between them."""
    lines = ["3 - the number of splines"]
    for rows in PEOPLE.values():
        lines.append(f"{len(rows)} - Num of control points")
        lines += [f"{x / 0.02:.6f} {y / 0.02:.6f} {round(t / STEP) * 10} 0.5 - (2D point, m_id)" for t, x, y in rows]
    path.write_text("\n".join(lines))


def sdd(path: Path) -> None:
    rows = [
        f'{p} {x / 0.05 - 7} {y / 0.05 - 9} {x / 0.05 + 7} {y / 0.05 + 9} {12 * k} 0 0 0 "Pedestrian"'
        for k, p, x, y in ROWS
    ]
    rows += [f'9 0 0 20 20 {12 * k} 0 0 0 "Biker"' for k in range(20)]
    rows += [f'1 0 0 1 1 {12 * k} 1 0 0 "Pedestrian"' for k in range(20, 23)]  # lost
    path.write_text("\n".join(rows) + "\n")


def jupedsim(path: Path) -> None:
    with closing(sqlite3.connect(path)) as base:
        base.execute(
            "CREATE TABLE trajectory_data (frame INTEGER, id INTEGER, pos_x REAL, pos_y REAL, ori_x REAL, ori_y REAL)"
        )
        base.execute("CREATE TABLE metadata (key TEXT, value TEXT)")
        base.execute("CREATE TABLE geometry (hash INTEGER, wkt TEXT)")
        base.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?, 0, 0)", ROWS)
        base.execute("INSERT INTO metadata VALUES ('fps', '2.5')")
        wkt = "POLYGON ((-6 -4, 8 -4, 8 4, -6 4, -6 -4), (2 -3, 3 -3, 3 -2, 2 -3))"
        base.execute("INSERT INTO geometry VALUES (1, ?)", (wkt,))
        base.commit()


def vadere(path: Path) -> None:
    lines = [
        "#IDXCOL=2,DATACOL=6,SEP=' '",
        "pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1",
    ]
    for person, rows in PEOPLE.items():
        for (t, x, y), (end, u, v) in pairwise(rows):
            lines.append(f"{person} {t} {end} {x} {y} {u} {v}")
    path.write_text("\n".join(lines))
    obstacle = {"shape": {"type": "RECTANGLE", "x": 2.0, "y": -3.0, "width": 1.0, "height": 0.5}, "id": 1}
    bounds = {"x": -6.0, "y": -4.0, "width": 14.0, "height": 8.0}
    topography = {"attributes": {"bounds": bounds}, "obstacles": [obstacle]}
    path.with_suffix(".scenario").write_text(json.dumps({"scenario": {"topography": topography}}))


def magni(path: Path) -> None:
    """Bodies side by side in mm, at 100 Hz; a row is there twice, one is late."""
    bodies = {"Helmet_1": 1, "Helmet_2": 2, "Helmet_5": 5}
    columns = [
        f"{body} {what}"
        for body in (*bodies, "DARKO_Robot", "LO1")
        for what in ("Centroid_X", "Centroid_Y", "Centroid_Z")
    ]
    places = {(k, p): (1000 * x, 1000 * y) for k, p, x, y in ROWS}
    rows = []
    for k in range(20):
        cells = list[str]()
        for person in bodies.values():
            place = places.get((k, person))
            cells += ["", "", ""] if place is None else [f"{place[0]:.1f}", f"{place[1]:.1f}", "1700.0"]
        rows.append([str(40 * k + 1), f"{0.4 * k:.2f}", *cells, f"{1000 + 200 * k}", "3000", "600", "0", "0", "0"])
    head = [["FILE_ID", "made_up"], ["N_FRAMES_QTM", "20"], ["BODY_NAMES", *bodies, "DARKO_Robot", "LO1"]]
    lines = [*head, ["Frame", "Time", *columns], *rows, rows[3]]
    path.write_text("\n".join(map(",".join, lines)))


JULICH = "#framerate: 25\n#X,Y,Z: the coordinates (in metres)\n\n#ID\tFR\tX\tY\tZ"
LAYOUTS = [
    Layout("named.csv", table("frame,ped,x,y", "{f},{p},{x},{y}"), {"frame_rate": 25}),
    Layout("frame_time.csv", table("frame,ped,x,y", "{f},{p},{x},{y}"), {"frame_time": 0.04}),
    Layout("pedpy.csv", table("id,frame,x,y", "{p},{f},{x},{y}"), {"frame_rate": 25}),
    Layout("quoted.csv", table('"frame","ped_id","pos_x","pos_y"', '{f},"{p}",{x},{y}'), {"frame_rate": 25}),
    Layout("names.csv", table("frame_id;agent_id;x [cm];y [cm]", "{f};P_{p};{x};{y}", unit=0.01), {"frame_rate": 25}),
    Layout("commas.csv", decimal_commas, {"frame_rate": 25}),
    Layout("utf16.csv", utf16, {"frame_rate": 25}),
    Layout("times.csv", table("t,id,x,y", "{t:.2f},{p},{x},{y}")),
    Layout("since-1970.csv", table("timestamp_ms,id,x,y", "170000000{t:.1f}e3,{p},{x},{y}")),
    Layout("millis.tsv", table("timestamp [ms]\tid\tx_mm\ty_mm", "{t:.1f}e3\t{p}\t{x:.1f}\t{y:.1f}", unit=0.001)),
    Layout("both.csv", table("frame, t, id, y, x, z", "{f}, {t:.1f}, {p}, {y}, {x}, 1.7")),
    Layout("units.csv", table('"t","id","x","y"\n"s","","m","m"', '{t:.1f},{p},{x},{y}')),
    Layout("petrack4.txt", table("# framerate: 25 fps\n# id frame x/m y/m", "{p} {f} {x} {y}")),
    Layout("petrack5.txt", table("#framerate: 25.00\n# id frame x/cm y/cm z/cm", "{p} {f} {x} {y} 176", unit=0.01)),
    Layout("julich.txt", table(JULICH, "{p}\t{f}\t{x}\t{y}\t1.7")),
    Layout("unnamed.txt", table("", "{f}.0\t{p}.0\t{x}\t{y}"), {"frame_rate": 25}),
    Layout("by_person.txt", table("", "{p} {f} {x} {y} 1.76"), {"frame_rate": 25}),
    Layout("given.txt", table("", "7 {y} {x} {p} {f}"), {"frame_rate": 25, "columns": ("-", "y", "x", "id", "frame")}),
    Layout("feet.csv", table("frame,ped,x,y", "{f},{p},{x},{y}", unit=0.3048), {"frame_rate": 25, "unit": "ft"}),
    Layout("obsmat.txt", table("", " {f:.7e}  {p:.7e}  {x:.7e}  0.0e+00  {y:.7e}  1.0  0.0  0.5 ", step=6)),
    Layout("trajnet.ndjson", trajnet),
    Layout("ucy.vsp", vsp, {"unit": "0.02"}),
    Layout("annotations.txt", sdd, {"unit": "0.05"}),
    Layout("jupedsim.sqlite", jupedsim),
    Layout("postvis.traj", vadere),
    Layout("magni.csv", magni),
]  # fmt: skip
