"""All that can be proven of a file or a data set, on as many processors as asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from .errors import RecordError, Sonata2dError
from .record import MANIFEST, Problem, check_dataset, check_episode, read_manifest
from .replay import check_replay, check_rerun

Advance = Callable[[int], None]


def files_of(path: Path) -> list[Path]:
    """The one episode file, those that a data set's manifest lists, or those in a folder without a manifest.

    Raises:
        RecordError: there is no such file or folder, or no episode in it.
    """
    if path.is_file():
        return [path]
    if (path / MANIFEST).exists():
        return [path / str(told["name"]) for told in read_manifest(path)["files"]]
    files = sorted(file for file in path.glob("*.json*") if file.is_file())
    if not files:
        raise RecordError(f"{path} holds no episode files" if path.is_dir() else f"{path} does not exist")
    return files


def prove(
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
        RecordError: there is no such file or folder, or no episode in it.
    """
    files = files_of(path)
    is_dataset = path.is_dir() and (path / MANIFEST).exists()
    problems = check_dataset(path) if is_dataset else []
    one = partial(_prove_file, alone=not is_dataset, replay=replay, rerun=rerun, controller=controller)
    with _mapper(workers if len(files) > 1 else 1) as each:
        for found in each(one, files):
            problems += found
            advance(1)
    return problems


def _prove_file(path: Path, *, alone: bool, replay: bool, rerun: bool, controller: str | None) -> list[Problem]:
    """What is wrong with one file; replayed only if it can be read."""
    problems = check_episode(path) if alone else []
    try:
        problems += check_replay(path) if replay else []
        problems += check_rerun(path, controller) if rerun else []
    except RecordError:
        pass  # the check above has told
    except Sonata2dError as error:
        problems.append(Problem(path.name, "rerun", str(error)))
    return problems


@contextmanager
def _mapper(workers: int) -> Iterator[Callable[..., Iterator[list[Problem]]]]:
    """`map`, here or in other processes."""
    if workers <= 1:
        yield map
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield partial(pool.map, chunksize=4)
