"""The whole use case at its small size; on demand, as it needs PyTorch and minutes: SONATA2D_TEST_USE_CASE=1."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sonata2d.datasets import verify
from sonata2d.learning import read_weights

RUN = Path(__file__).parents[2] / "examples" / "use_case" / "run.py"


@pytest.mark.skipif(
    os.environ.get("SONATA2D_TEST_USE_CASE") != "1",
    reason="runs on demand: SONATA2D_TEST_USE_CASE=1, see CONTRIBUTING.md",
)
def test_every_stage_of_the_small_use_case_runs(tmp_path: Path) -> None:
    pytest.importorskip("torch_geometric", reason="the use case needs sonata2d[learn]")
    command = [sys.executable, str(RUN), "-o", str(tmp_path / "small")]
    result = subprocess.run([*command, "--small"], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr[-2000:]
    out = tmp_path / "small"
    report = (out / "report.md").read_text()
    assert "## 4 unseen scenes" in report
    assert "R-GCN-aggregated" in report
    results, _, run_times = report.partition("## Run times")
    assert "| paper |" not in results, "that row would look like the publication's"
    assert "| paper |" in run_times, "stages are named as their commands"
    for picture in ("bias.png", "best.png", "worst.png"):
        assert (out / picture).stat().st_size > 1000
    for name in ("paper", "paper-aggregated", "attention", "attention-aggregated", "graph-policy"):
        assert read_weights(out / name / "policy.npz").sha256
    assert verify(out / "data") == []
    again = subprocess.run(command, capture_output=True, text=True)
    assert "contains the use case of size small, not full" in again.stderr
