"""What the rows of a frame mean: name, unit and frame of reference of each column."""

from __future__ import annotations

ROBOT = (
    ("x", "m", "world"),
    ("y", "m", "world"),
    ("theta", "rad", "world"),
    ("vx", "m/s", "world"),
    ("vy", "m/s", "world"),
    ("omega", "rad/s", "world"),
)
HUMANS = (*ROBOT, ("head", "rad", "world"))
COMMAND = (("vx", "m/s", "body"), ("vy", "m/s", "body"), ("omega", "rad/s", "body"))

ROBOT_NAMES, HUMAN_NAMES, COMMAND_NAMES = (tuple(name for name, _, _ in table) for table in (ROBOT, HUMANS, COMMAND))
ROBOT_ANGLES, HUMAN_ANGLES = [2], [2, 6]  # columns
ABSENT = -1  # activity of a person who is not present


def columns() -> dict[str, list[dict[str, str]]]:
    """The tables as the file holds them, under `columns`."""
    tables = {"robot": ROBOT, "humans": HUMANS, "command": COMMAND}
    return {
        key: [{"name": name, "unit": unit, "frame": frame} for name, unit, frame in table]
        for key, table in tables.items()
    }
