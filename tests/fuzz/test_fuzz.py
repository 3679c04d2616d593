"""A small share of the cases of `python -m tests.fuzz`, and damage that random cases seldom do."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path

import pytest

from .runner import ALL, run_case
from .samples import make_samples
from .targets import KINDS

pytest.importorskip("pyarrow", reason="pyarrow comes with the parquet extra")

CASES = 12  # of each kind


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    make_samples(folder)
    return folder


@pytest.mark.parametrize("kind", ALL)
def test_damaged_input_is_accepted_or_refused_with_one_line(kind: str, samples: Path, tmp_path: Path) -> None:
    for index in range(CASES):
        (work := tmp_path / str(index)).mkdir()
        with warnings.catch_warnings(action="ignore"):
            warnings.simplefilter("error", RuntimeWarning)
            result = run_case(kind, 0, index, samples, work)
        assert result.status in ("accepted", "refused"), f"{result.detail} (case {index})"


@pytest.mark.parametrize("kind", KINDS)
def test_undamaged_input_is_accepted(kind: str, samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number, use in enumerate(dict.fromkeys(KINDS[kind].uses)):
        work = tmp_path / str(number)
        shutil.copytree(samples / (KINDS[kind].folder or kind), work)
        monkeypatch.chdir(work)
        with warnings.catch_warnings(action="ignore"):
            use(sorted(work.glob(KINDS[kind].damaged[0]))[0])
