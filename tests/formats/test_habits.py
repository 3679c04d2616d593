"""Stops and detours of recorded people, which simulated ones get."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sonata2d.core.portable_math import Array
from sonata2d.core.scene import Social
from sonata2d.formats.from_tracks import scenario_from_tracks
from sonata2d.formats.tracks.habits import NONE, habits_of, stands_at_ends
from sonata2d.formats.tracks.observations import Track
from sonata2d.scenegen.generator import generate

NO_WALLS = np.zeros((0, 4))
STEP = 0.4  # s


def track(id: int, position: Array) -> Track:
    return Track(id, STEP * np.arange(len(position)), position)


def way(y: float = 0.0, bow: float = 0.0, stop: int = 0, length: float = 12.0) -> Array:
    """A way along x at 1.2 m/s, with a bow in its middle, m, and a stop of some steps."""
    x = np.arange(0.0, length + 0.24, 0.48)
    position = np.stack([x, y + bow * np.sin(np.pi * x / length)], axis=1)
    middle = len(x) // 2
    return np.concatenate(
        [position[:middle], np.repeat(position[middle : middle + 1], stop, axis=0), position[middle:]]
    )


def test_stops_are_counted_in_a_minute_of_walking_with_their_mean_time() -> None:
    people = [track(k, way(3.0 * k, stop=10 if k < 4 else 0)) for k in range(1, 13)]
    found = habits_of(people, NO_WALLS)
    walked = 12 * 12.0 / 1.2
    assert found.stops == pytest.approx(60.0 * 3 / walked, rel=0.1)
    low, high = found.stop_time
    assert (low, low + (high - low) / 4.0) == pytest.approx((1.2, 4.0), abs=0.5)
    assert found.mean_stop == pytest.approx(4.0, abs=0.5)


def test_detours_are_the_deviation_of_the_largest_distance_from_the_straight_way() -> None:
    bows = np.random.default_rng(1).normal(0.0, 0.15, 400) * 12.0
    found = habits_of([track(k, way(bow=float(bow))) for k, bow in enumerate(bows, 1)], NO_WALLS)
    assert found.detours == pytest.approx(0.15, rel=0.15)
    assert found.stops == 0.0


def test_the_usual_deviations_from_the_course_are_no_detours() -> None:
    bows = np.random.default_rng(1).normal(0.0, 0.03, 400) * 12.0
    assert habits_of([track(k, way(bow=float(bow))) for k, bow in enumerate(bows, 1)], NO_WALLS).detours == 0.0


def test_ways_round_a_wall_are_no_detours() -> None:
    people = [track(k, way(bow=4.0)) for k in range(1, 13)]
    assert habits_of(people, NO_WALLS).detours > 0.3
    assert habits_of(people, np.array([[6.0, -1.0, 6.0, 1.0]])) == NONE


def test_few_people_have_no_habits() -> None:
    assert habits_of([track(k, way(bow=3.0, stop=10)) for k in range(1, 10)], NO_WALLS) == NONE
    assert habits_of([], NO_WALLS) == NONE
    assert habits_of([track(1, np.zeros((1, 2)))], NO_WALLS) == NONE


def test_people_who_stand_at_the_ends_of_their_track_are_known() -> None:
    standing = np.zeros((5, 2))
    assert stands_at_ends(track(1, way())) == (False, False)
    assert stands_at_ends(track(1, np.concatenate([standing, way()]))) == (True, False)
    assert stands_at_ends(track(1, np.concatenate([way(), standing + way()[-1]]))) == (False, True)
    assert stands_at_ends(track(1, np.zeros((20, 2)))) == (False, False)


def csv_of(folder: Path, positions: dict[int, Array], robot: int | None = None) -> Path:
    path = folder / "square.csv"
    rows = [
        f"{k},{ped},{x},{y},{'robot' if ped == robot else 'person'}"
        for ped, own in positions.items()
        for k, (x, y) in enumerate(own.tolist())
    ]
    path.write_text("\n".join(["frame,ped,x,y,type", *rows, ""]))
    return path


def test_simulated_people_have_the_habits_of_the_recording(tmp_path: Path) -> None:
    positions = {k: way(6.0 * k, bow=1.5 if k % 2 else -1.5, stop=8 if k < 7 else 0) for k in range(1, 13)}
    positions[12] = np.concatenate([np.repeat(positions[12][:1], 6, axis=0), positions[12]])
    positions[11] = np.concatenate([positions[11], np.repeat(positions[11][-1:], 30, axis=0)])
    file = csv_of(tmp_path, positions)
    config = scenario_from_tracks(file, people="simulated", frame_time=STEP, seconds=15.0)
    assert config.social.stops > 0.5
    assert config.social.detours > 0.1
    humans = {human.id: human for human in generate(config, seed=1).humans}
    assert humans[12].pre_movement >= config.social.stop_time[0]
    assert humans[1].pre_movement == 0.0
    assert [humans[k].exits for k in (10, 11, 12)] == [True, False, True]  # 11 stands when the window ends
    replayed = scenario_from_tracks(file, people="replayed", frame_time=STEP, seconds=15.0)
    assert replayed.social == Social(pause=(1.0, 6.0))


def test_people_who_meet_a_robot_tell_nothing_of_their_habits(tmp_path: Path) -> None:
    positions = {k: way(6.0 * k, bow=1.5 if k % 2 else -1.5, stop=8) for k in range(1, 13)}
    file = csv_of(tmp_path, positions | {20: way(0.0)}, robot=20)
    config = scenario_from_tracks(file, people="simulated", frame_time=STEP, seconds=15.0)
    assert (config.social.stops, config.social.detours) == (0.0, 0.0)


def test_two_people_one_of_whom_stands_first_become_a_scenario(tmp_path: Path) -> None:
    positions = {1: way(), 2: np.concatenate([np.repeat(way(5.0)[:1], 8, axis=0), way(5.0)])}
    config = scenario_from_tracks(csv_of(tmp_path, positions), people="simulated", frame_time=STEP, seconds=15.0)
    assert generate(config, seed=0).humans[1].pre_movement == 1.2


def test_a_person_that_is_lost_before_the_window_ends_leaves(tmp_path: Path) -> None:
    standing = np.concatenate([way(), np.repeat(way()[-1:], 10, axis=0)])
    positions = {1: standing, 2: np.concatenate([way(5.0)] * 1 + [np.repeat(way(5.0)[-1:], 80, axis=0)])}
    file = csv_of(tmp_path, positions)
    for start, seconds in ((0.0, 20.0), (4.0, 13.0)):
        config = scenario_from_tracks(file, people="simulated", frame_time=STEP, start=start, seconds=seconds)
        assert [human.exits for human in generate(config, seed=0).humans] == [True, False]
