"""The commands `sonata2d benchmark list|run|baselines|verify|table|rating|commit|reveal`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .command import Group
from .controllers import CONTROLLER_NAMES
from .options import PATH, examples, json_option
from .output import echo, progress, require_new, show_json, show_result, show_table, wants_json
from .workers import WorkerOptions, workers_options

_SUITE = click.option("--suite", default="s2b-1", help="Name of the suite.")
_TRACK = click.option("--track", default="state", help="What the controller observes: `state`, `sees` or `lidar`.")
_SEEDS = (
    click.option(
        "--seeds", default="test", help="`dev`, `test`, `hidden`, or the name of a quarter that has been revealed."
    ),
    click.option("--seed", type=click.IntRange(1), default=1, help="Seed of the dev scenes."),
    click.option("--secret", type=PATH, metavar="FILE", help="Secret of the hidden seeds."),
)
_RECORDINGS = click.option(
    "--recordings", type=PATH, metavar="DIR", help="Folder with the recordings of a suite that needs some."
)
_TRIAL = (
    click.option(
        "--part", "parts", multiple=True, metavar="NAME", help="Only this part or entry, for a trial; may be repeated."
    ),
    click.option("--scenes", type=click.IntRange(1), metavar="N", help="At most N scenes of an entry, for a trial."),
)


def _seeds_options(function: Any) -> Any:
    for option in reversed((*_SEEDS, _RECORDINGS, *_TRIAL)):
        function = option(function)
    return function


@click.group(
    cls=Group,
    epilog=examples(
        "benchmark run --controller social-planner -o row --scenes 1",
        "benchmark verify row",
        "benchmark table row -o table.html",
    ),
)
def command() -> None:
    """Run controllers in a frozen suite of scenes, and verify and compare the results.

    The result of a controller is a row: a folder with its scores, and the hashes and commands of all episodes, from
    which anybody can replay them. docs/benchmark.md has the rules.
    """


@command.command("list", epilog=examples("benchmark list", "benchmark list --json"))
@_SUITE
@json_option
def list_(suite: str) -> None:
    """Show the parts, entries, tracks and baselines of a suite."""
    from dataclasses import asdict

    from sonata2d.benchmark.baselines import baselines_of
    from sonata2d.benchmark.suite import TRACKS, load_suite, quarters_of

    chosen = load_suite(suite)
    if wants_json():
        entries = [{"part": e.part, "name": e.name, "scenes": e.scenes} for e in chosen.entries]
        show_json(
            {
                "suite": chosen.name, "sha256": chosen.sha256, "scenes": chosen.count, "entries": entries,
                "tracks": TRACKS, "quarters": quarters_of(suite),
                "baselines": {name: asdict(baseline) for name, baseline in baselines_of(chosen).items()},
            }
        )  # fmt: skip
        return
    echo(f"{chosen.name}: {chosen.count} scenes, physics version {chosen.physics}, until {chosen.ends}")
    for part, question in chosen.questions.items():
        own = [entry for entry in chosen.entries if entry.part == part]
        echo(f"\n{part} ({sum(entry.scenes for entry in own)} scenes): {question}")
        echo(", ".join(f"{entry.name} {entry.scenes}" for entry in own))
    echo("\ntracks")
    show_table(TRACKS.items(), "  ")
    echo("baselines")
    show_table(((name, f"{each.track}: {each.shows}") for name, each in baselines_of(chosen).items()), "  ")


@command.command(
    "run",
    epilog=examples(
        "benchmark run --controller ./mine.py:Mine -o row --scenes 1",
        "benchmark run --controller policy.npz -o row-sees --track sees --seeds dev",
    ),
)
@click.option("--controller", required=True, metavar="NAME", help=f"The controller. {CONTROLLER_NAMES}")
@click.option("out", "-o", "--output", type=PATH, required=True, metavar="DIR", help="Folder of the row.")
@_SUITE
@_TRACK
@_seeds_options
@click.option(
    "--scorer",
    "scorers",
    multiple=True,
    metavar="NAME",
    help="A learned score, or a file of `benchmark rating`, for an advisory column; may be repeated.",
)
@workers_options
@json_option
def run(controller: str, out: Path, workers: WorkerOptions, secret: Path | None, **options: Any) -> None:
    """Run a controller in all scenes of a suite, in a process of its own, and write a row.

    The same command continues a run that was interrupted.
    """
    from sonata2d.benchmark.row import read_row, run_benchmark

    with workers.started() as pool:
        path = run_benchmark(
            controller, out, secret=_secret_in(secret), workers=pool, progress=progress, **options
        )  # fmt: skip
    _show_row(read_row(out), path)


@command.command(
    "baselines", epilog=examples("benchmark baselines rows --scenes 1", "benchmark baselines rows --only orca")
)
@click.argument("folder", type=PATH)
@click.option("--only", multiple=True, metavar="NAME", help="Only this baseline; may be repeated.")
@_SUITE
@_seeds_options
@workers_options
@json_option
def baselines(folder: Path, only: tuple[str, ...], workers: WorkerOptions, secret: Path | None, **options: Any) -> None:
    """Run the baselines of sonata2d, and write a row for each into FOLDER; rows that are there stay.

    `benchmark list` shows them.
    """
    from sonata2d.benchmark.baselines import baselines_of
    from sonata2d.benchmark.row import ROW, read_row, run_benchmark
    from sonata2d.benchmark.suite import load_suite
    from sonata2d.registry import did_you_mean

    known = baselines_of(load_suite(options["suite"]))
    for name in only:
        if name not in known:
            raise click.UsageError(f"no baseline of {options['suite']} is named {name!r}{did_you_mean(name, known)}")
    with workers.started() as pool:
        for name in only or known:
            controller, track = known[name].controller, known[name].track
            if not (folder / name / ROW).exists():
                run_benchmark(
                    controller, folder / name, track=track, secret=_secret_in(secret), workers=pool,
                    progress=progress, **options,
                )  # fmt: skip
            row = read_row(folder / name)
            for key in ("suite", "seeds", "parts", "scenes"):
                asked = list(options[key]) if key == "parts" else options[key]
                if row["plan"][key] != asked or (asked == "dev" and row["plan"]["seed"] != options["seed"]):
                    raise click.UsageError(f"{folder / name} is a row of other {key}; choose another folder")
            if not wants_json():
                echo(f"{name}: {row['all']['strict']['value']:.3f} of {row['all']['scenes']} scenes strict")
    if wants_json():
        show_json({name: read_row(folder / name) for name in only or known})


@command.command("verify", epilog=examples("benchmark verify row", "benchmark verify row --rerun"))
@click.argument("row", type=PATH)
@click.option(
    "--rerun",
    is_flag=True,
    help="Also run the controller of the row again. This runs its code: only for rows that you trust so far.",
)
@click.option("--secret", type=PATH, metavar="FILE", help="Secret of the hidden seeds.")
@_RECORDINGS
@workers_options
@json_option
def verify(row: Path, rerun: bool, secret: Path | None, recordings: Path | None, workers: WorkerOptions) -> None:
    """Verify a row: replay the commands of all its episodes, and compute its scores again.

    Exit status 1: the row does not hold what it claims.
    """
    from sonata2d.benchmark.row import verify_row

    with workers.started() as pool:
        found = verify_row(
            row, rerun=rerun, secret=_secret_in(secret), recordings=recordings, workers=pool, progress=progress
        )
    text = f"{row}: {found.scenes} scenes; {', '.join(found.badges) or 'not verified'}"
    show_result({"badges": found.badges, "problems": found.problems, "scenes": found.scenes}, text)
    if found.problems:
        for problem in found.problems if not wants_json() else ():
            echo(problem, err=True)
        click.get_current_context().exit(1)


@command.command("table", epilog=examples("benchmark table row -o table.html", "benchmark table rows/* -o table.md"))
@click.argument("rows", nargs=-1, required=True, type=PATH, metavar="ROW...")
@click.option("out", "-o", "--output", type=PATH, metavar="FILE", help="Page (.html), Markdown (.md) or JSON (.json).")
@json_option
def table(rows: tuple[Path, ...], out: Path | None) -> None:
    """Compare rows: scores, Pareto front, and gaps between public and hidden seeds."""
    from sonata2d.benchmark.table import check_path, table_of

    if out is not None:
        check_path(out)
    found = table_of(rows)
    if out is not None:
        found.save(out)
    if wants_json():
        show_json(found.to_json())
        return
    click.echo(found.markdown().rstrip())
    if out is not None:
        echo(f"written to {out}")


@command.command(
    "rating",
    epilog=examples(
        "benchmark rating rated -o rating.json", "benchmark rating imported -o alt.npz --contexts contexts.json"
    ),
)
@click.argument("folders", nargs=-1, required=True, type=PATH, metavar="DIR...")
@click.option(
    "out", "-o", "--output", type=PATH, required=True, metavar="FILE", help="Model (.json) or network (.npz)."
)
@click.option("--contexts", type=PATH, metavar="FILE", help="Numbers of contexts, for a network; docs/benchmark.md.")
@json_option
def rating(folders: tuple[Path, ...], out: Path, contexts: Path | None) -> None:
    """Learn people's ratings from rated episodes, for advisory columns (`run --scorer FILE`).

    FILE.json: a ridge regression on the scores. FILE.npz: a recurrent network, `alt`, which needs PyTorch. The rank
    correlation is of ratings with predictions for episodes that were left out.
    """
    from sonata2d.benchmark import alt, rating

    require_new(out)
    if out.suffix not in (rating.SUFFIX, alt.SUFFIX):
        raise click.UsageError(f"a model is written to a {rating.SUFFIX} or {alt.SUFFIX} file, got {out}")
    if contexts is not None and out.suffix != alt.SUFFIX:
        raise click.UsageError(f"--contexts is for a network, whose file ends in {alt.SUFFIX}, got {out}")
    model: Any
    if out.suffix == alt.SUFFIX:
        model = alt.fit_alt_model(folders, contexts=contexts)
    else:
        model = rating.fit_rating_model(folders)
    model.save(out)
    values = {key: getattr(model, key) for key in ("question", "episodes", "raters", "correlation")}
    people = f"{model.episodes} episodes" + (f", {model.raters} raters" if model.raters else "")
    show_result(values, f"{out}: {people}, rank correlation {model.correlation:.2f}: {model.question}")


@command.command("commit", epilog=examples("benchmark commit secret.txt"))
@click.argument("file", type=PATH)
@json_option
def commit(file: Path) -> None:
    """Make the secret of a quarter for its keeper: write it to FILE, and print the commitment to publish."""
    from sonata2d.benchmark.suite import commitment, new_secret
    from sonata2d.record.files import write_atomically

    require_new(file)
    secret = new_secret()
    write_atomically(file, f"{secret.hex()}\n".encode())
    file.chmod(0o600)
    show_result({"commitment": commitment(secret)}, f"commitment {commitment(secret)}")


@command.command("reveal", epilog=examples("benchmark reveal secret.txt"))
@click.argument("file", type=PATH)
@_SUITE
@json_option
def reveal(file: Path, suite: str) -> None:
    """Show the secret of a quarter that is over, its commitment and its seed, for publication.

    With an entry in the file of quarters of the package, its name is a name of seeds: everybody can run its scenes.
    """
    from sonata2d.benchmark.suite import commitment, load_suite, quarters_of, read_secret

    secret = read_secret(file.read_text())
    found = commitment(secret)
    quarter = next((name for name, each in quarters_of(suite).items() if each["commitment"] == found), None)
    values = {
        "quarter": quarter,
        "commitment": found,
        "secret": secret.hex(),
        "seed": load_suite(suite).hidden_seed(secret),
    }
    if wants_json():
        show_json(values)
    else:
        show_table((key, value if value is not None else "not announced") for key, value in values.items())


def _secret_in(file: Path | None) -> bytes | None:
    from sonata2d.benchmark.suite import read_secret

    return None if file is None else read_secret(file.read_text())


def _show_row(row: dict[str, Any], path: Path) -> None:
    if wants_json():
        show_json(row)
        return
    show_table(
        (part, f"{scores['strict']['value']:.3f} of {scores['scenes']} scenes strict")
        for part, scores in {**row["parts"], "all": row["all"]}.items()
    )
    if row["late"]:
        echo(f"{row['late']} answers came late; the last command was held")
    if row["failed"]:
        echo(f"{row['failed']} scenes ended with an error of the controller")
    echo(f"row  {path}")
