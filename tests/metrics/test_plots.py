"""The picture of an evaluation: reproducible where matplotlib is installed, refused in one line where it is not."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from sonata2d.errors import RenderError
from sonata2d.metrics.catalogue import headline_metrics
from sonata2d.metrics.evaluation import Evaluation
from sonata2d.metrics.plots import chart, check_picture_path

from .samples import measured

SIGNATURES = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}


def evaluation(label: str, shift: float) -> Evaluation:
    """Five episodes in which all headline metrics except SPL are defined."""
    names = [metric.name for metric in headline_metrics()]
    return Evaluation(
        label, [measured(k, {name: None if name == "spl" else k + shift for name in names}) for k in range(5)]
    )


@pytest.mark.parametrize("suffix", SIGNATURES)
def test_same_numbers_give_the_same_picture(suffix: str, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    evaluations = [evaluation("social-planner", 0.0), evaluation("mine", 0.5)]
    first, second = (tmp_path / f"{name}{suffix}" for name in ("first", "second"))
    for path in (first, second):
        chart(path, evaluations, headline_metrics(), title="sonata-2020")
    assert first.read_bytes().startswith(SIGNATURES[suffix])
    assert first.read_bytes() == second.read_bytes()
    chart(second, evaluations[:1], headline_metrics())
    assert first.read_bytes() != second.read_bytes()


def test_picture_without_defined_metrics_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    spl = [metric for metric in headline_metrics() if metric.name == "spl"]
    with pytest.raises(RenderError, match="nothing to draw"):
        chart(tmp_path / "a.png", [evaluation("a", 0.0)], spl)


def test_message_without_matplotlib_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sonata2d.metrics.plots.find_spec", lambda name: None)
    with pytest.raises(RenderError, match=r"pip install 'sonata2d\[plots\]'"):
        chart(tmp_path / "a.png", [evaluation("a", 0.0)], headline_metrics())


def test_other_suffixes_are_refused() -> None:
    with pytest.raises(RenderError, match=r"a\.bmp: the name of a picture of metrics must end in \.png, \.pdf, \.svg"):
        check_picture_path(Path("a.bmp"))
    if importlib.util.find_spec("matplotlib"):
        check_picture_path(Path("a.PNG"))
