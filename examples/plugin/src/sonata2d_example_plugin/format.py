"""A format: the robot's path as a table of comma-separated values."""

from __future__ import annotations

from sonata2d import EpisodeRecord
from sonata2d.formats import Format, Options


def export(record: EpisodeRecord, options: Options) -> bytes:
    """One line per tick: time (s), x, y (m), theta (rad)."""
    rows = zip(record.time.tolist(), record.robot[:, :3].tolist(), strict=True)
    lines = [f"{time:.4f},{x:.4f},{y:.4f},{theta:.4f}" for time, (x, y, theta) in rows]
    return "\n".join(["time,x,y,theta", *lines, ""]).encode()


FORMAT = Format("the robot's path: time, x, y, theta", ".robot.csv", export=export)
