"""The journal of a run in progress returns all complete ticks, whatever the state of its last line."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonata2d.collect.journal import Journal, read_journal
from sonata2d.errors import RecordError
from sonata2d.record.recorder import EpisodeRecorder
from sonata2d.sim.inputs import TickInput

from ..record.samples import run

HEADER = {"settings": {}, "seed": 1, "episode": 0, "physics": 1, "controller": {}, "contributor": "zoe"}


def test_a_journal_without_ticks_has_no_run(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "a.jsonl")
    assert read_journal(journal.path) is None
    journal.begin(HEADER)
    assert read_journal(journal.path) is None
    journal.shut()


def test_every_tick_is_written_before_the_next(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "deep" / "a.jsonl")
    journal.begin(HEADER)
    for count, frame in enumerate(run(EpisodeRecorder(), ticks=4, labels=lambda tick: tick), 1):
        journal.on_frame(frame)
        found = read_journal(journal.path)
        assert found is not None
        assert found.header == HEADER
        assert found.ticks[-1] == TickInput(frame.command, frame.label, frame.snapshot.events)
        assert len(found.ticks) == count
    journal.delete()
    assert read_journal(journal.path) is None


def test_a_damaged_line_in_the_middle_is_named_by_its_number(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    path.write_text('{"seed":1}\n{"comm\n{"command":[0,0,0],"events":[]}\n')
    with pytest.raises(RecordError, match="line 2"):
        read_journal(path)
    path.write_text('{"seed":1}\n{"command":[0],"events":[]}\n')
    with pytest.raises(RecordError, match="not the journal of a run"):
        read_journal(path)
