"""Episodes of settings far beyond what is usual pass their own check; `random_settings` runs more of them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from .random_settings import draw, run


def test_episodes_of_random_settings_pass_their_own_check(tmp_path: Path) -> None:
    counts: Counter[str] = Counter()
    for case in range(25):
        status, why = run(case, tmp_path)
        assert status != "failed", f"case {case}: {why}\n{draw(case)}"
        counts[status] += 1
    assert counts["passed"] > 10
