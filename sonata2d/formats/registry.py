"""All formats by name."""

from __future__ import annotations

from . import csv_tracks, npz, socnav3, socnav3_reader, sonata, sonata_reader, tables, trajnet
from .form import Format

FORMATS: dict[str, Format] = {
    "sonata": Format(
        "robot-frame frame lists of the 2020 toolkit, which SNGNN2D-v2 reads too",
        ".json",
        sonata_reader.import_,
        sonata.export,
    ),
    "socnav3": Format(
        "trajectory files of the SocNav3 data set, with an occupancy grid", ".json", socnav3_reader.import_,
        socnav3.export,
    ),
    "csv": Format("tracks of people: frame, ped, x, y", ".csv", csv_tracks.import_, csv_tracks.export),
    "trajnet": Format("tracks of people as TrajNet++ reads them, 2.5 frames a second", ".ndjson", trajnet.import_,
        trajnet.export),
    "npz": Format("NumPy arrays of the whole episode", ".npz", npz.import_, npz.export),
    "parquet": Format("four tables that join: episodes, frames, agents, interactions", ".parquet", tables.import_,
        gather=tables.gather),
}  # fmt: skip
