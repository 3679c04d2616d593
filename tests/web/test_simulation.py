"""A few seeds of `python -m tests.web.simulation`, and some that once found a fault."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sonata2d.study.load import Study

from .simulation import Simulation, Violation, create_study, simulate

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="the simulated disk needs POSIX")

# A run was kept twice; a step never got its runs to rate; a file that could not be read once was never read again; a
# personal answer was lost.
FOUND = (50, 52, 72, 147)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return create_study(tmp_path_factory.mktemp("study"))


@pytest.mark.parametrize("seed", [*FOUND, *range(8)])
def test_nothing_that_was_shown_is_lost(seed: int, study: Study) -> None:
    assert simulate(seed, study) == ""


def test_a_server_that_forgets_an_answer_is_found(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The judge is no formality: answers that are shown as given, but not stored, are a violation."""
    monkeypatch.setattr("sonata2d.study.answers.AnswerLog.append", lambda log, **facts: log.lines.append(facts))
    with pytest.raises(Violation):
        Simulation(1, study, tmp_path).run()
