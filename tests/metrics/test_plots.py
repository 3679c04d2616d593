"""The picture: drawn where matplotlib is, refused in one line where it is not."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from sonata2d.errors import RenderError
from sonata2d.metrics.catalogue import headline
from sonata2d.metrics.measurement import Evaluation, Measured
from sonata2d.metrics.plots import chart, refuse_picture

SIGNATURES = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}


def evaluation(label: str, shift: float) -> Evaluation:
    return Evaluation(
        label,
        [
            Measured(
                f"{k}.json", "0" * 64, "s", "s/l", 1, k, str(k), "goal",
                {metric.name: (None if metric.name == "spl" else k + shift) for metric in headline()},
            )
            for k in range(5)
        ],
    )  # fmt: skip


@pytest.mark.parametrize("suffix", SIGNATURES)
def test_the_same_numbers_give_the_same_picture(suffix: str, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    told = [evaluation("social-planner", 0.0), evaluation("mine", 0.5)]
    for name in ("one", "two"):
        chart(tmp_path / f"{name}{suffix}", told, headline(), title="sonata-2020")
    one, two = (tmp_path / f"{name}{suffix}" for name in ("one", "two"))
    assert one.read_bytes().startswith(SIGNATURES[suffix])
    assert one.read_bytes() == two.read_bytes()
    chart(two, told[:1], headline())
    assert one.read_bytes() != two.read_bytes()


def test_a_picture_of_nothing_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    spl = [metric for metric in headline() if metric.name == "spl"]
    with pytest.raises(RenderError, match="nothing to draw"):
        chart(tmp_path / "a.png", [evaluation("a", 0.0)], spl)


def test_without_matplotlib_one_line_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sonata2d.metrics.plots.find_spec", lambda name: None)
    with pytest.raises(RenderError, match=r"pip install 'sonata2d\[plots\]'"):
        chart(tmp_path / "a.png", [evaluation("a", 0.0)], headline())


def test_other_suffixes_are_refused() -> None:
    with pytest.raises(RenderError, match=r"a\.bmp: a picture of metrics ends in \.png, \.pdf, \.svg"):
        refuse_picture(Path("a.bmp"))
    if importlib.util.find_spec("matplotlib"):
        refuse_picture(Path("a.PNG"))
