"""Faults of the machine: `python -m tests.faults [--moments 50] [--seed 0] [KIND ...]`; Linux, better as root.

Each command that writes files is stopped at random moments, loses a worker, fills the disk, meets a read-only folder,
or runs out of file handles; each call of the functions behind them fails once, and meets a power cut once. It must end
with one line that tells why, leave each file whole or absent, and give the same bytes when it is resumed or repeated.
Prints a table; the exit code is 1 if something went wrong.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
from pathlib import Path

from .calls import create_sets, trials as calls
from .commands import create_material
from .resources import few_handles, full_disk, read_only
from .stops import killed_workers, stops
from .table import HEADER


def main() -> int:
    """Run the trials, and print the table."""
    kinds = ("stops", "workers", "disk", "read-only", "handles", "calls")
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"kinds of faults: {', '.join(kinds)}; default: all")
    parser.add_argument("--moments", type=int, default=50, help="number of moments at which each signal stops generate")
    parser.add_argument("--seed", type=int, default=0, help="seed of the moments")
    options = parser.parse_args()
    if unknown := set(options.kinds) - set(kinds):
        parser.error(f"unknown kinds {', '.join(sorted(unknown))}; there are {', '.join(kinds)}")
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs and their children ignore it
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        material, work = Path(folder, "material"), Path(folder, "work")
        create_material(material)
        trials = {
            "stops": lambda: stops(material, work, options.moments, options.seed),
            "workers": lambda: killed_workers(material, work, options.moments, options.seed),
            "disk": lambda: full_disk(material, work),
            "read-only": lambda: read_only(material, work),
            "handles": lambda: few_handles(material, work),
            "calls": lambda: calls(create_sets(Path(folder, "sets"))),
        }
        _write(HEADER)
        for kind in options.kinds or kinds:
            for row in trials[kind]():
                _write(str(row))
                wrong += len(row.faults)
    _write(f"\n{wrong or 'no'} faults")
    return int(wrong > 0)


def _write(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


sys.exit(main())
