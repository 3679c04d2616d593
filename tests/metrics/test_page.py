"""The evaluation page: self-contained, reproducible, with the numbers of the evaluations and well chosen episodes."""

from __future__ import annotations

from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

import sonata2d as s2
from sonata2d.datasets import generate_dataset
from sonata2d.errors import RenderError
from sonata2d.metrics.catalogue import METRICS, headline_metrics
from sonata2d.metrics.evaluation import Evaluation, Measured
from sonata2d.metrics.evaluation_page import (
    Axis,
    axis_of,
    check_page_path,
    constant_of,
    marks,
    outcome_kinds,
    outcome_shares,
    page_metrics,
    page_of,
    short_names,
)
from sonata2d.metrics.exemplars import COMPLIANCE, best_of, why_best, why_worst, worst_of
from sonata2d.metrics.measurement import episode_files, measure_files

from .samples import evaluation, measured

VOID = {"meta", "img"}


class Tags(HTMLParser):
    """The tags of a page, and those that are not closed."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Evaluation, list[Path]]:
    """Three short episodes among people, and their files."""
    out = tmp_path_factory.mktemp("sets") / "demo"
    config = s2.load_scenario("sonata-2020")
    config = config.model_copy(update={"rules": replace(config.rules, time_limit=3.0)})
    generate_dataset(out, config, "straight-to-goal", episodes=3, seed=4)
    files = episode_files(out)
    return Evaluation("demo", measure_files(files, rerun=False)), files


def test_page_is_self_contained(demo: tuple[Evaluation, list[Path]]) -> None:
    one, files = demo
    drawn: list[int] = []
    page = page_of([one], [files], advance=drawn.append)
    assert drawn == [1]
    tags = Tags(page)
    assert tags.open == []
    links = [(tag, value) for tag, attrs in tags.seen for key, value in attrs.items() if key in ("src", "href")]
    assert all((value or "").startswith("data:image/png;base64,") for tag, value in links if tag == "img")
    targets = {attrs["id"] for _, attrs in tags.seen if attrs.get("id")}
    assert {value for tag, value in links if tag == "a"} == {f"#{name}" for name in targets}
    assert not {"script", "link", "iframe"} & {tag for tag, _ in tags.seen}
    assert "url(" not in page
    assert page.count("<img") == 12  # best and worst, six moments each
    assert page.count("<figcaption>0.0 s") == 2


def test_same_episodes_give_the_same_page(demo: tuple[Evaluation, list[Path]]) -> None:
    one, files = demo
    assert page_of([one], [files]) == page_of([one], [files])


def test_page_shows_headline_metrics_and_every_class_of_collision() -> None:
    names = {metric.name for metric in page_metrics()}
    assert {metric.name for metric in headline_metrics()} < names
    assert {name for name in METRICS if name.endswith("_collisions")} - {"robot_collisions"} < names
    page = page_of([evaluation("a", 0.5, 0.7)])
    assert all(f'id="{name}"' in page for name in names)
    assert "<img" not in page


def test_labels_are_escaped() -> None:
    page = page_of([evaluation("<script>x</script>", 0.5)])
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_best_mean_and_means_equal_to_it_are_marked() -> None:
    many = range(12)
    best, equal = evaluation("best", *(0.9 for _ in many)), evaluation("equal", *(0.79 + 0.2 * (k % 2) for k in many))
    worse, empty = evaluation("worse", *(0.5 + 0.01 * k for k in many)), evaluation("empty", None, None)
    row = [worse, best, equal, empty]
    assert marks(row, METRICS["spl"]) == ["", "best", "equal", ""]
    assert [each.differs(worse, "spl") for each in row] == [False, True, True, False]
    assert [each.summary("spl").n for each in row] == [12, 12, 12, 0]


@pytest.mark.parametrize(
    ("name", "expected"), [("jerk_mean", ["best", ""]), ("spl", ["", "best"]), ("speed_mean", ["", ""])]
)
def test_best_is_least_most_or_none_by_metric(name: str, expected: list[str]) -> None:
    pair = [evaluation(str(k), *(k + 0.01 * j for j in range(5)), name=name) for k in range(2)]
    assert marks(pair, METRICS[name]) == expected


def test_no_mean_is_best_among_equals() -> None:
    assert marks([evaluation("a", 0.5), evaluation("b", 0.5)], METRICS["spl"]) == ["", ""]
    assert marks([evaluation("a", 0.5)], METRICS["spl"]) == [""]


def test_episodes_in_different_scenes_are_never_equal() -> None:
    here = evaluation("here", *(0.5 + 0.1 * (k % 3) for k in range(6)))
    there = evaluation("there", *(0.5 + 0.1 * ((k + 1) % 2) for k in range(6)))
    moved = Evaluation("there", [replace(one, seed=2, scene=f"other {one.scene}") for one in there.episodes])
    assert marks([here, moved], METRICS["spl"]) == ["best", ""]


def test_means_over_other_episodes_are_not_compared() -> None:
    """In each common scene the second is slower by 1, but it is undefined in the scenes that are slow for both."""
    first = evaluation("first", *(10.0 + k for k in range(5)), *(50.0 + k for k in range(3)), name="time_to_goal")
    second = evaluation("second", *(11.0 + k for k in range(5)), None, None, None, name="time_to_goal")
    assert [each.summary("time_to_goal").n for each in (first, second)] == [8, 5]
    assert marks([first, second], METRICS["time_to_goal"]) == ["", ""], "the lower mean is not that of the better one"
    assert second.difference(first, "time_to_goal").mean == 1.0
    assert not second.differs(first, "time_to_goal"), "the means differ in the other direction"


def test_outcomes_fill_the_bar() -> None:
    collided = evaluation("a", 1.0, 0.0, 0.0, name="success_strict")
    late = evaluation("b", 0.0, name="success_strict", outcome="timeout")
    both = Evaluation("both", [*collided.episodes, *late.episodes])
    assert outcome_kinds([late, both]) == ["goal", "goal-collision", "timeout"]
    shares = outcome_shares(both, ["goal", "goal-collision", "timeout"])
    assert [(kind, share.count, share.fraction) for kind, share in shares.items()] == [
        ("goal", 1, 0.25), ("goal-collision", 2, 0.5), ("timeout", 1, 0.25),
    ]  # fmt: skip
    assert all(share.interval.low < share.fraction < share.interval.high for share in shares.values())
    page = page_of([both])
    for kind, start, width in (("goal", "0.00", "25.00"), ("goal-collision", "25.00", "50.00"),
                               ("timeout", "75.00", "25.00")):  # fmt: skip
        assert f'<rect class="k-{kind}" x="{start}%" y="0" width="{width}%"' in page


@pytest.mark.parametrize("values", [(0.0, 1.0), (3.2, 19.7), (-0.04, 0.003), (0.0, 0.0), (7.0, 7.0), (-2.0, -2.0)])
def test_axis_holds_its_values_and_a_few_round_ticks(values: tuple[float, float]) -> None:
    axis = Axis.of(values)
    positions = [axis.at(value) for value in values]
    assert all(0.0 < position < 100.0 for position in positions)
    assert 2 <= len(axis.ticks) <= 5
    assert all(0.0 <= position <= 100.0 and len(text) <= 6 for position, text in axis.ticks)


def test_plot_omits_undefined_values() -> None:
    assert '<section class="panel">' not in page_of([evaluation("a", None, None)], metrics=[METRICS["spl"]])
    several = [evaluation("a", 0.2, 0.4), evaluation("b", None), evaluation("c", 0.3)]
    page = page_of(several, metrics=[METRICS["spl"]])
    assert page.count('<circle cx="') == 2
    assert page.count('stroke-width="5"') == 1, "an interval needs two values"
    assert page.count('stroke-width="1.5"></line>') == 2, "quartiles"
    axis = axis_of(several, METRICS["spl"])
    assert axis.low < 0.2 < 0.4 < axis.high


def test_names_are_shortened_by_common_folders() -> None:
    assert short_names(["a/orca/x", "a/mine/x"]) == ["orca", "mine"]
    assert short_names(["runs/office"]) == ["runs/office"]
    assert short_names(["runs", "runs/office"]) == ["runs", "runs/office"]


def test_a_class_is_named_without_its_file_and_a_long_name_without_its_middle() -> None:
    assert short_names(["./folder/mine.py:Mine", "orca"]) == ["Mine", "orca"]
    assert short_names(["./folder/mine.py:Mine"]) == ["Mine"]
    assert short_names(["package.mine:Mine+./other.py:Other"]) == ["Mine+Other"]
    assert short_names(["one.py:Mine", "two.py:Mine"]) == ["one.py:Mine", "two.py:Mine"]
    (name,) = short_names(["an-evaluation-with-a-name-of-many-words"])
    assert (name[:10], name[-10:], len(name)) == ("an-evaluat", "many-words", 25)


def test_metrics_of_events_are_shares_and_have_no_plot_of_means() -> None:
    reached = evaluation("a", 1.0, 1.0, 0.0, None, name="success")
    share = reached.share("success")
    assert share is not None
    assert (share.count, share.total, evaluation("b", 1.0).share("success")) == (2, 3, None)
    assert share.interval.low < 2 / 3 < share.interval.high
    page = page_of([reached, evaluation("b", 1.0)], metrics=[METRICS["success"]])
    assert "2 of 3 <small>" in page
    assert "<circle" not in page
    hit = evaluation("a", 0.0, 3.0, name="wall_collisions").share("wall_collisions")
    assert hit is not None
    assert (hit.count, hit.total) == (1, 2)


def test_what_is_the_same_in_all_episodes_is_written_instead_of_drawn() -> None:
    page = page_of([evaluation(name, 0.0, 0.0, name="wall_collisions") for name in "ab"])
    assert "In no episode: wall collisions." in page
    assert '<section class="panel">' not in page
    assert constant_of([evaluation("a", 0.5, 0.5), evaluation("b", 0.5)], METRICS["spl"]) == 0.5
    assert constant_of([evaluation("a", 0.5, 0.5), evaluation("b", 0.6)], METRICS["spl"]) is None


@pytest.mark.parametrize(("count", "has_warning"), [(19, True), (20, False)])
def test_page_warns_of_few_episodes(count: int, has_warning: bool) -> None:
    assert ("Few episodes" in page_of([evaluation("a", *(0.1 for _ in range(count)))])) is has_warning


def test_page_shows_an_evaluation_without_episodes(demo: tuple[Evaluation, list[Path]]) -> None:
    one, files = demo
    page = page_of([Evaluation("empty", []), one], [[], files])
    assert page.count("<img") == 12
    assert Tags(page).open == []
    assert "<img" not in page_of([Evaluation("empty", [])], [[]])


def test_other_suffix_is_refused() -> None:
    with pytest.raises(RenderError, match=r"a\.txt: the name of an evaluation page must end in \.html"):
        check_page_path(Path("a.txt"))


GOOD = {
    "success": 1.0, "collisions": 0.0, "robot_on_person": 0.0, "wall_collisions": 0.0, "object_collisions": 0.0,
    "group_intrusion": None, "interaction_intrusion": 0.0, "human_clearance_min": 0.8, "spl": 0.9, COMPLIANCE: 1.0,
}  # fmt: skip


def good(episode: int, **values: float | None) -> Measured:
    """A good episode, apart from some values."""
    return measured(episode, GOOD | values)


def test_best_episode_passes_a_person_without_intrusion() -> None:
    episodes = [
        good(0, spl=1.0, human_clearance_min=None),
        good(1, spl=1.0, interaction_intrusion=0.1),
        good(2, spl=1.0, collisions=1.0),
        good(3, spl=0.7),
        good(4, spl=0.95),
    ]
    assert best_of(episodes).episode == 4
    expected = "goal reached past people, without collision or intrusion into personal space; SPL 0.95"
    assert why_best(episodes[4]) == expected
    assert "no person was within 1.2 m" in why_best(best_of(episodes[:3]))


def test_best_of_equally_short_paths_has_the_smallest_clearance() -> None:
    episodes = [good(0, spl=0.951), good(1, spl=0.949, human_clearance_min=0.5), good(2, spl=0.951)]
    assert best_of(episodes).episode == 1


def test_best_of_failed_episodes_is_explained() -> None:
    episodes = [good(0, success=0.0, spl=0.0, collisions=1.0), good(1, success=0.0, spl=0.0)]
    assert best_of(episodes).episode == 1
    assert "no episode reached the goal" in why_best(best_of(episodes))


def test_worst_episode_follows_the_order_of_the_criteria() -> None:
    episodes = [
        good(0, robot_on_person=1.0, collisions=1.0),
        good(1, robot_on_person=2.0, collisions=2.0),
        good(2, success=0.0, spl=0.0),
        good(3, wall_collisions=1.0, collisions=1.0),
        good(4, **{COMPLIANCE: 0.4}),
        good(5, spl=0.3),
        good(6),
    ]
    order, remaining = [], list(episodes)
    while remaining:
        worst = worst_of(remaining)
        order.append((worst.episode, why_worst(worst)))
        remaining.remove(worst)
    assert [episode for episode, _ in order] == [1, 0, 2, 3, 4, 5, 6]
    assert [why for _, why in order[:6]] == [
        "the robot caused 2 collisions with people",
        "the robot caused 1 collision with people",
        "the goal was not reached",
        "1 collision with walls or furniture",
        "nearer than 0.45 m to a person in 60 % of the states",
        "the lowest SPL, 0.30; goal reached without collision or intrusion",
    ]


def test_episodes_with_few_defined_metrics_have_a_best_and_a_worst() -> None:
    episodes = [measured(k, {"path_length": 1.0}, outcome="stopped") for k in range(2)]
    assert (best_of(episodes).episode, worst_of(episodes).episode) == (0, 0)
    assert why_best(episodes[0])
    assert why_worst(episodes[0])
