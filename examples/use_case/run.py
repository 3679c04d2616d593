"""Runs the whole use case: stages in order, independent ones at the same time.

    pip install -e '.[learn]'
    python examples/use_case/run.py -o runs
    python examples/use_case/run.py --small -o small    # every stage, with few episodes: minutes instead of hours

Finished stages are skipped, and an interrupted stage is continued.
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
from data import run_command
from settings import SIZE, SIZE_VARIABLE

HERE = Path(__file__).parent
STAGES = (  # groups of stages; the stages of a group run at the same time
    {"data": "data.py"},
    {name: f"train.py --network {name} --data {{out}}/data" for name in ("paper", "attention")},
    {f"{name}-aggregated": f"aggregate.py --network {name}" for name in ("paper", "attention")},
    {"graph-policy": "ship.py"},
    {"evaluation of few": "evaluate.py --scenes few"},
    {"evaluation of many": "evaluate.py --scenes many"},
    {"bias": "bias.py"},
    {"evaluation everywhere": "evaluate.py --scenes everywhere"},
    {"report": "report.py"},
)
OWN_FOLDER = ("paper", "attention")  # stages whose option `-o` names the folder of the network


def run_stage(name: str, command: str, out: Path) -> None:
    """Run a stage unless it is finished, and record its run times in `out/stages`.

    Args:
        name: of the stage.
        command: script and options; `{out}` is replaced by the output folder.
        out: output folder of the use case.

    Raises:
        ClickException: the script failed.
    """
    done = out / "stages" / f"{name.replace(' ', '-')}.json"
    if done.exists() and name != "report":  # the report is always written anew
        return
    folder = out / name if name in OWN_FOLDER else out
    script, *options = (word.format(out=out) for word in command.split())
    start = time.perf_counter()
    process = subprocess.Popen([sys.executable, str(HERE / script), *options, "-o", str(folder)])
    cpu, wall = wait_for(process), time.perf_counter() - start
    if process.returncode:
        raise click.ClickException(f"{script} failed; finished work is kept, run the same command again to continue")
    done.parent.mkdir(exist_ok=True)
    done.write_text(json.dumps({"stage": name, "wall": round(wall, 1), "cpu": cpu}))


def wait_for(process: subprocess.Popen[bytes]) -> float | None:
    """Wait for a process; return the CPU time of it and its workers, s, or None on Windows, where it is not known."""
    if sys.platform == "win32":
        process.wait()
        return None
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return round(usage.ru_utime + usage.ru_stime, 1)


def require_size(out: Path, size: str) -> None:
    """Record the size of the use case in its folder; stages of two sizes must not be mixed.

    Raises:
        ClickException: the folder contains stages of another size.
    """
    path = out / "size.txt"
    stored = path.read_text().strip() if path.exists() else "full" if (out / "stages").exists() else size
    if stored != size:
        raise click.ClickException(f"{out} contains the use case of size {stored}, not {size}; choose another folder")
    path.write_text(f"{size}\n")


@click.command()
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Output folder.  [default: runs, or runs-small]")
@click.option("--small", is_flag=True, help="Run every stage with few episodes and epochs, to see that all works.")
@click.option(
    "--until", type=click.Choice([name for group in STAGES for name in group]), help="Stop after the group of a stage."
)
def main(out: Path | None, small: bool, until: str | None) -> None:
    """Make the data, train, aggregate, evaluate, and write OUT/report.md."""
    size = "small" if small else SIZE
    os.environ[SIZE_VARIABLE] = size  # of the scripts of the stages
    out = out or Path("runs" if size == "full" else f"runs-{size}")
    out.mkdir(parents=True, exist_ok=True)
    require_size(out, size)
    for group in STAGES:
        with ThreadPoolExecutor(len(group)) as pool:
            for finished in [pool.submit(run_stage, name, command, out) for name, command in group.items()]:
                finished.result()
        if until in group:
            return
    click.echo(out / "report.md")


if __name__ == "__main__":
    run_command(main)
