"""Which run is shown as the best, and which as the worst."""

from __future__ import annotations

from sonata2d.metrics.measurement import Measured
from sonata2d.metrics.page import COMPLIANCE, best_of, why_best, why_worst, worst_of

GOOD = {
    "success": 1.0, "collisions": 0.0, "robot_on_person": 0.0, "wall_collisions": 0.0, "object_collisions": 0.0,
    "group_intrusion": None, "interaction_intrusion": 0.0, "human_clearance_min": 0.8, "spl": 0.9, COMPLIANCE: 1.0,
}  # fmt: skip


def run(episode: int, **values: float | None) -> Measured:
    return Measured(f"{episode}.json", "0" * 64, "s", "s/l", 1, episode, str(episode), "goal", GOOD | values)


def test_the_best_run_met_somebody_and_intruded_upon_nobody() -> None:
    runs = [
        run(0, spl=1.0, human_clearance_min=None),
        run(1, spl=1.0, interaction_intrusion=0.1),
        run(2, spl=1.0, collisions=1.0),
        run(3, spl=0.7),
        run(4, spl=0.95),
    ]
    assert best_of(runs).episode == 4
    assert why_best(runs[4]) == "goal reached past people, nothing touched, nobody's space intruded upon; SPL 0.95"
    assert "nobody was met within 1.2 m" in why_best(best_of(runs[:3]))


def test_of_equally_short_ways_the_one_past_the_nearest_person_is_best() -> None:
    runs = [run(0, spl=0.951), run(1, spl=0.949, human_clearance_min=0.5), run(2, spl=0.951)]
    assert best_of(runs).episode == 1


def test_the_best_of_runs_that_all_failed_says_so() -> None:
    runs = [run(0, success=0.0, spl=0.0, collisions=1.0), run(1, success=0.0, spl=0.0)]
    assert best_of(runs).episode == 1
    assert "no run reached the goal" in why_best(best_of(runs))


def test_the_worst_run_touched_people_then_failed_then_touched_things_then_came_near() -> None:
    runs = [
        run(0, robot_on_person=1.0, collisions=1.0),
        run(1, robot_on_person=2.0, collisions=2.0),
        run(2, success=0.0, spl=0.0),
        run(3, wall_collisions=1.0, collisions=1.0),
        run(4, **{COMPLIANCE: 0.4}),
        run(5, spl=0.3),
        run(6),
    ]
    order, left = [], list(runs)
    while left:
        worst = worst_of(left)
        order.append((worst.episode, why_worst(worst)))
        left.remove(worst)
    assert [episode for episode, _ in order] == [1, 0, 2, 3, 4, 5, 6]
    assert [why for _, why in order[:6]] == [
        "touched people by its own fault: 2 times",
        "touched people by its own fault: 1 time",
        "did not reach the goal",
        "touched walls or furniture: 1 time",
        "nearer than 0.45 m to somebody in 60 % of its looks",
        "the lowest SPL, 0.30; it reached the goal, touched nothing and kept its distance",
    ]


def test_runs_of_which_little_is_known_have_a_best_and_a_worst() -> None:
    runs = [Measured("a.json", "0" * 64, "s", "s/l", 1, k, str(k), "stopped", {"path_length": 1.0}) for k in range(2)]
    assert (best_of(runs).episode, worst_of(runs).episode) == (0, 0)
    assert why_best(runs[0])
    assert why_worst(runs[0])
