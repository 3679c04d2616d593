"""Playback of a recorded run: position, speed, and whether the whole run was watched."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sonata2d.record.reader import read_episode
from sonata2d.record.record import EpisodeRecord
from sonata2d.record.recorder import JsonRecorder
from sonata2d.window.playback import Player

from ..record.samples import run

TICKS, DT = 6, 0.1


@pytest.fixture
def record(tmp_path: Path) -> EpisodeRecord:
    with JsonRecorder(tmp_path / "by-hand.json") as recorder:
        run(recorder, ticks=TICKS)
    return read_episode(tmp_path / "by-hand.json")


def test_it_plays_in_real_time_to_the_final_snapshot_and_stops(record: EpisodeRecord) -> None:
    player = Player(record)
    assert (player.last, player.dt) == (TICKS, DT)
    player.advance(0.25)
    assert (player.index, player.fraction) == (2, pytest.approx(2.5 / TICKS))
    before, after = record.snapshot(2).robot.position, record.snapshot(3).robot.position
    assert player.moment.robot.position == pytest.approx((np.array(before) + after) / 2)
    player.advance(10.0)
    assert (player.index, player.at_end, player.playing, player.fraction) == (TICKS, True, False, 1.0)
    assert player.moment.robot == record.snapshot(TICKS).robot


def test_snapshots_are_those_of_the_file(record: EpisodeRecord) -> None:
    player = Player(record)
    for snapshot in record.snapshots():
        assert player.snapshot.tick == snapshot.tick
        np.testing.assert_array_equal(player.snapshot.humans.state, snapshot.humans.state)
        player.step(1)


def test_speed_scales_time_and_is_limited(record: EpisodeRecord) -> None:
    player = Player(record)
    player.faster()
    player.advance(0.1)
    assert (player.speed, player.index) == (2.0, 2)
    for _ in range(10):
        player.faster()
    assert player.speed == 8.0
    for _ in range(10):
        player.slower()
    assert player.speed == 0.25
    with pytest.raises(ValueError, match="speed is 0"):
        Player(record, speed=0)


def test_steps_move_by_snapshots_while_paused(record: EpisodeRecord) -> None:
    player = Player(record)
    player.advance(0.25)
    player.toggle()
    player.advance(1.0)
    assert player.index == 2
    player.step(1)
    assert (player.index, player.moment.time) == (3, pytest.approx(3 * DT))
    player.advance(0.1)
    player.step(-5)
    assert player.index == 0
    player.step(99)
    assert player.at_end
    player.step_seconds(-0.3)
    assert player.index == 3


def test_a_step_back_between_snapshots_moves_to_the_previous_one(record: EpisodeRecord) -> None:
    player = Player(record)
    player.advance(0.25)
    player.step(-1)
    assert (player.index, player.playing) == (2, False)


def test_seeking_moves_to_a_snapshot_within_the_run(record: EpisodeRecord) -> None:
    player = Player(record)
    for fraction, index in ((0.5, 3), (0.55, 3), (-1.0, 0), (2.0, TICKS)):
        player.seek(fraction)
        assert (player.index, player.moment.time) == (index, pytest.approx(index * DT))


def test_play_at_the_end_starts_again(record: EpisodeRecord) -> None:
    player = Player(record)
    player.advance(1.0)
    player.toggle()
    assert (player.index, player.playing) == (0, True)


@pytest.mark.parametrize("jump", ["seek", "step"])
def test_watched_means_played_from_start_to_end_without_a_gap(jump: str, record: EpisodeRecord) -> None:
    player = Player(record)
    player.advance(0.2)
    if jump == "seek":
        player.seek(0.9)
    else:
        player.step(3)
        player.playing = True
    player.advance(1.0)
    assert player.at_end
    assert not player.watched
    player.seek(0.1)  # back into the part that was played, and on from there
    player.playing = True
    player.advance(1.0)
    assert player.watched
    player.restart()
    assert player.watched


def test_contacts_are_reported_at_their_starts(record: EpisodeRecord) -> None:
    """The sample has a contact at tick 2 only; here it lasts, ends, and starts again at the final snapshot."""
    assert Player(record).contacts() == [pytest.approx(2 / TICKS)]
    states = [*record.document["frames"], record.document["final"]]
    states[3]["contacts"] = states[6]["contacts"] = states[2]["contacts"]
    assert Player(record).contacts() == [pytest.approx(2 / TICKS), 1.0]


def test_a_run_without_frames_is_over_at_once(tmp_path: Path) -> None:
    with JsonRecorder(tmp_path / "none.json") as recorder:
        run(recorder, ticks=0)
    player = Player(read_episode(tmp_path / "none.json"))
    player.advance(0.0)
    assert (player.at_end, player.watched, player.fraction, player.snapshot.tick) == (True, True, 1.0, 0)
