"""`examples/release/release.py`: the files of a release are whole, verified, and can be loaded."""

from __future__ import annotations

import json
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest

import sonata2d as s2

SCRIPT = Path(__file__).parents[2] / "examples" / "release" / "release.py"


def test_a_release_has_verified_data_sets_weights_and_checksums(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow comes with the parquet extra")
    line = [sys.executable, str(SCRIPT), "-o", str(tmp_path / "release"), "--episodes", "100", "--workers", "1"]
    done = subprocess.run([*line, "--creator", "Lab", "--date", "2026-12-01"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    out = tmp_path / "release"
    sums = dict(row.split("  ")[::-1] for row in (out / "SHA256SUMS").read_text().splitlines())
    assert all(sha256((out / name).read_bytes()).hexdigest() == value for name, value in sums.items())
    assert {"weights/graph-policy.npz", "rooms/croissant.json", ".zenodo.json"} <= set(sums)
    assert json.loads((out / ".zenodo.json").read_text())["upload_type"] == "dataset"
    counts = {name: len(s2.load(out / name)) for name in ("rooms", "lively", "crowded", "situations")}
    assert (counts["rooms"], counts["lively"], counts["crowded"]) == (50, 30, 10)
    assert counts["situations"] >= 2 * 25
    assert "frames-train-*.parquet" in (out / "rooms" / "README.md").read_text()
