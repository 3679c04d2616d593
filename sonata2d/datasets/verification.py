"""All that can be proven of a file or a data set, on as many processors as asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from ..errors import RecordError
from .check import Listed, Problem, check_episode, check_listed, check_manifest, listed_files
from .manifest import CROISSANT, MANIFEST, METRICS
from .replay import check_replay, check_rerun

Advance = Callable[[int], None]


def files_of(path: Path) -> Sequence[Path | Listed]:
    """The one episode file, those that a data set's manifest lists, or those in a folder without a manifest.

    Raises:
        RecordError: there is no such file or folder, no episode in it, or its manifest is damaged.
    """
    if path.is_file():
        return [path]
    if (path / MANIFEST).exists():
        return listed_files(path)
    files = sorted(
        file
        for file in path.glob("*.json*")
        if file.is_file() and file.name not in (METRICS, CROISSANT, "evaluation.json")
    )
    if not files:
        raise RecordError(f"{path} holds no episode files" if path.is_dir() else f"{path} does not exist")
    return files


def verify(
    path: Path,
    *,
    replay: bool = False,
    rerun: bool = False,
    controller: str | None = None,
    workers: int = 1,
    advance: Advance = lambda step: None,
) -> list[Problem]:
    """What is wrong with an episode file or a data set; nothing, if all is well.

    Args:
        path: a file or a folder.
        replay: also run the recorded commands again and compare every byte.
        rerun: also ask the controller again.
        controller: its name, if it is no longer found by what the files say.
        workers: processes.
        advance: is told how many files are done, as they are.

    Raises:
        RecordError: there is no such file or folder, no episode in it, or its manifest is damaged.
    """
    files = files_of(path)
    problems = check_manifest(path) if (path / MANIFEST).exists() else []
    one = partial(_prove_file, replay=replay, rerun=rerun, controller=controller)
    with _mapper(workers if len(files) > 1 else 1) as each:
        for found in each(one, files):
            problems += found
            advance(1)
    return problems


def _prove_file(file: Path | Listed, *, replay: bool, rerun: bool, controller: str | None) -> list[Problem]:
    """What is wrong with one file; it is run again only if it can be read."""
    path = file.path if isinstance(file, Listed) else file
    problems = check_listed(file) if isinstance(file, Listed) else check_episode(file)
    if any(problem.place in ("file", "files") for problem in problems):
        return problems
    checks = {
        "replay": check_replay if replay else None,
        "rerun": partial(check_rerun, name=controller) if rerun else None,
    }
    for place, check in checks.items():
        try:
            problems += check(path) if check else []
        except Exception as error:  # whatever a changed file, or a controller, makes go wrong is a finding
            problems.append(Problem(path.name, place, f"{type(error).__name__}: {error}"))
    return problems


@contextmanager
def _mapper(workers: int) -> Iterator[Callable[..., Iterator[list[Problem]]]]:
    """`map`, here or in other processes."""
    if workers <= 1:
        yield map
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield partial(pool.map, chunksize=4)
