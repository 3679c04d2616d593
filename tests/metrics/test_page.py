"""The page: whole in one file, the same for the same numbers, true to the evaluations it shows."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path

import pytest

import sonata2d as s2
from sonata2d.datasets.generate import generate_dataset
from sonata2d.errors import RenderError
from sonata2d.metrics.catalogue import METRICS, headline
from sonata2d.metrics.measurement import Evaluation, Measured, episode_files, measure_files
from sonata2d.metrics.page import Axis, cells, page_metrics, panel, save_page, short_names
from sonata2d.metrics.table import endings, kinds_of

VOID = {"meta", "img"}


def evaluation(label: str, *values: float | None, name: str = "spl", outcome: str = "goal") -> Evaluation:
    """Runs in scenes 0, 1, …, of which one metric is known."""
    return Evaluation(
        label,
        [
            Measured(f"{k}.json", "0" * 64, "s", "s/l", 1, k, str(k), outcome, {name: value})
            for k, value in enumerate(values)
        ],
    )


class Tags(HTMLParser):
    """What a page opens, and whether all of it is closed."""

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
def measured(tmp_path_factory: pytest.TempPathFactory) -> tuple[Evaluation, list[Path]]:
    """Three short episodes among people."""
    out = tmp_path_factory.mktemp("sets") / "demo"
    config = s2.load_scenario("sonata-2020")
    config = config.model_copy(update={"rules": config.rules.model_copy(update={"time_limit": 3.0})})
    generate_dataset(out, config, "straight-to-goal", episodes=3, seed=4)
    files = episode_files(out)
    return Evaluation("demo", measure_files(files, rerun=False)), files


def test_a_page_needs_nothing_but_itself(measured: tuple[Evaluation, list[Path]], tmp_path: Path) -> None:
    one, files = measured
    save_page(tmp_path / "a.html", [one], [files])
    page = (tmp_path / "a.html").read_text("utf-8")
    tags = Tags(page)
    assert tags.open == []
    links = [(tag, value) for tag, told in tags.seen for key, value in told.items() if key in ("src", "href")]
    assert all((value or "").startswith("data:image/png;base64,") for tag, value in links if tag == "img")
    targets = {told["id"] for _, told in tags.seen if told.get("id")}
    assert {value for tag, value in links if tag == "a"} == {f"#{name}" for name in targets}
    assert not {"script", "link", "iframe"} & {tag for tag, _ in tags.seen}
    assert "url(" not in page
    assert page.count("<img") == 12  # best and worst, six moments each
    assert page.count("<figcaption>0.0 s") == 2


def test_the_same_runs_give_the_same_page(measured: tuple[Evaluation, list[Path]], tmp_path: Path) -> None:
    one, files = measured
    for name in ("a.html", "b.html"):
        save_page(tmp_path / name, [one], [files])
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_a_page_shows_the_main_metrics_and_every_class_of_collision(tmp_path: Path) -> None:
    names = {metric.name for metric in page_metrics()}
    assert {metric.name for metric in headline()} < names
    assert {name for name in METRICS if name.endswith("_collisions")} < names
    save_page(tmp_path / "a.html", [evaluation("a", 0.5, 0.7)])
    page = (tmp_path / "a.html").read_text("utf-8")
    assert all(f'id="{name}"' in page for name in names)
    assert "<img" not in page


def test_labels_are_text_and_not_markup(tmp_path: Path) -> None:
    save_page(tmp_path / "a.html", [evaluation("<script>x</script>", 0.5)])
    page = (tmp_path / "a.html").read_text("utf-8")
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_the_best_is_marked_and_whoever_cannot_be_told_from_it() -> None:
    many = range(12)
    best, alike = evaluation("best", *(0.9 for _ in many)), evaluation("alike", *(0.79 + 0.2 * (k % 2) for k in many))
    worse, gone = evaluation("worse", *(0.5 + 0.01 * k for k in many)), evaluation("gone", None, None)
    told = cells([worse, best, alike, gone], METRICS["spl"])
    assert [cell.mark for cell in told] == ["", "best", "alike", ""]
    assert [cell.differs for cell in told] == [False, True, True, False]
    assert [cell.n for cell in told] == [12, 12, 12, 0]


def test_less_is_best_where_less_is_better_and_nothing_where_neither_is() -> None:
    def marks(name: str) -> list[str]:
        pair = [evaluation(str(k), *(k + 0.01 * j for j in range(5)), name=name) for k in range(2)]
        return [cell.mark for cell in cells(pair, METRICS[name])]

    assert marks("jerk_mean") == ["best", ""]
    assert marks("spl") == ["", "best"]
    assert marks("speed_mean") == ["", ""]


def test_nothing_is_best_where_all_are_alike_or_there_is_but_one() -> None:
    assert [cell.mark for cell in cells([evaluation("a", 0.5), evaluation("b", 0.5)], METRICS["spl"])] == ["", ""]
    assert [cell.mark for cell in cells([evaluation("a", 0.5)], METRICS["spl"])] == [""]


def test_runs_in_other_scenes_are_never_told_to_be_alike() -> None:
    here = evaluation("here", *(0.5 + 0.1 * (k % 3) for k in range(6)))
    moved = [
        Measured(r.file, r.sha256, r.name, r.family, 2, r.episode, f"other {r.scene}", r.outcome, r.values)
        for r in evaluation("there", *(0.5 + 0.1 * ((k + 1) % 2) for k in range(6))).runs
    ]
    assert [cell.mark for cell in cells([here, Evaluation("there", moved)], METRICS["spl"])] == ["best", ""]


def test_shares_of_endings_fill_the_bar() -> None:
    touched = evaluation("a", 1.0, 0.0, 0.0, name="success_strict")
    late = evaluation("b", 0.0, name="success_strict", outcome="timeout")
    both = Evaluation("both", [*touched.runs, *late.runs])
    assert kinds_of([late, both]) == ["goal", "goal-touch", "timeout"]
    found = endings(both, ["goal", "goal-touch", "timeout"])
    assert [(e.count, e.share, e.before) for e in found] == [(1, 0.25, 0.0), (2, 0.5, 0.25), (1, 0.25, 0.75)]
    assert all(e.interval.low < e.share < e.interval.high for e in found)


@pytest.mark.parametrize("values", [(0.0, 1.0), (3.2, 19.7), (-0.04, 0.003), (0.0, 0.0), (7.0, 7.0), (-2.0, -2.0)])
def test_an_axis_holds_its_values_and_a_few_round_ticks(values: tuple[float, float]) -> None:
    axis = Axis.of(values)
    places = [axis.at(value) for value in values]
    assert all(0.0 < place < 100.0 for place in places)
    assert 2 <= len(axis.ticks) <= 5
    assert all(0.0 <= at <= 100.0 and len(text) <= 6 for at, text in axis.ticks)


def test_a_panel_leaves_out_what_is_not_known() -> None:
    assert panel([evaluation("a", None, None)], METRICS["spl"]) is None
    found = panel([evaluation("a", 0.2, 0.4), evaluation("b", None), evaluation("c", 0.3)], METRICS["spl"])
    assert found is not None
    assert [(row.mean is None, row.interval is None, row.middle is None) for row in found.rows] == [
        (False, False, False), (True, True, True), (False, True, False),
    ]  # fmt: skip


def test_names_are_as_short_as_they_can_be() -> None:
    assert short_names(["a/orca/x", "a/mine/x"]) == ["orca", "mine"]
    assert short_names(["runs/office"]) == ["runs/office"]
    assert short_names(["runs", "runs/office"]) == ["runs", "runs/office"]
    assert short_names(["./mine.py:Mine", "orca"]) == ["./mine.py:Mine", "orca"]


def test_few_runs_are_said_to_be_few(tmp_path: Path) -> None:
    for count, is_few in ((19, True), (20, False)):
        save_page(tmp_path / "a.html", [evaluation("a", *(0.1 for _ in range(count)))])
        assert ("Few runs" in (tmp_path / "a.html").read_text("utf-8")) is is_few


def test_a_set_without_runs_stands_beside_others(measured: tuple[Evaluation, list[Path]], tmp_path: Path) -> None:
    one, files = measured
    save_page(tmp_path / "a.html", [Evaluation("empty", []), one], [[], files])
    page = (tmp_path / "a.html").read_text("utf-8")
    assert page.count("<img") == 12
    assert Tags(page).open == []
    save_page(tmp_path / "b.html", [Evaluation("empty", [])], [[]])
    assert "<img" not in (tmp_path / "b.html").read_text("utf-8")


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RenderError, match=r"a\.txt: a page of metrics ends in \.html"):
        save_page(tmp_path / "a.txt", [evaluation("a", 0.5)])
