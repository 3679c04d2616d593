"""The whole use case, from nothing to the report: stages in order, two at a time where they do not need each other.

    pip install 'sonata2d[learn]'
    python examples/use_case/run.py -o runs

A stage that is done is not done again; one that was interrupted goes on.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import click
from data import run_cleanly

HERE = Path(__file__).parent
STAGES = (  # each a group of stages that run beside each other
    {"data": "data.py"},
    {name: f"train.py --network {name} --data {{out}}/data" for name in ("paper", "attention")},
    {f"{name}-aggregated": f"aggregate.py --network {name}" for name in ("paper", "attention")},
    {"graph-policy": "ship.py"},
    {"evaluation of 60": "evaluate.py --scenes few"},
    {"evaluation of 1000": "evaluate.py --scenes many"},
    {"bias": "bias.py"},
    {"evaluation everywhere": "evaluate.py --scenes everywhere"},
    {"report": "report.py"},
)
OWN_FOLDER = ("paper", "attention")  # of these stages `-o` names the network's folder


def main_of(name: str, words: str, out: Path) -> None:
    """Run a stage, unless it is done; note what it took, of CPU only where the system tells it."""
    done = out / "stages" / f"{name.replace(' ', '-')}.json"
    if done.exists() and name != "report":
        return
    place = out / name if name in OWN_FOLDER else out
    script, *options = (word.format(out=out) for word in words.split())
    start = time.perf_counter()
    process = subprocess.Popen([sys.executable, str(HERE / script), *options, "-o", str(place)])
    cpu, wall = ended(process), time.perf_counter() - start
    if process.returncode:
        raise click.ClickException(f"{script} failed; what is whole stays, and the same command goes on")
    done.parent.mkdir(exist_ok=True)
    done.write_text(json.dumps({"stage": name, "wall": round(wall, 1), "cpu": cpu}))


def ended(process: subprocess.Popen[bytes]) -> float | None:
    """Wait for a process; the CPU time of it and its workers, s. None on Windows, which does not tell."""
    if sys.platform == "win32":
        process.wait()
        return None
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return round(usage.ru_utime + usage.ru_stime, 1)


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("runs"), show_default=True)
@click.option("--until", type=click.Choice([name for group in STAGES for name in group]), help="Stop after it.")
def main(out: Path, until: str | None) -> None:
    """Make the data, train, aggregate, evaluate, and tell the story in OUT/report.md."""
    out.mkdir(parents=True, exist_ok=True)
    for group in STAGES:
        with ThreadPoolExecutor(len(group)) as pool:
            for finished in [pool.submit(main_of, name, words, out) for name, words in group.items()]:
                finished.result()
        if until in group:
            return
    click.echo(out / "report.md")


if __name__ == "__main__":
    run_cleanly(main)
