"""The default pedestrian model passes the standard tests at small size; the tests notice models that do not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from cli.main import main
from sonata2d.testing import STANDARD_TESTS, run_standard_tests


@pytest.mark.parametrize("name", STANDARD_TESTS)
def test_the_default_model_passes(name: str) -> None:
    [finding] = run_standard_tests(only=[name])
    assert finding.name == name
    assert finding.passed, f"{finding.found}; required: {finding.required}"


def test_a_model_that_stops_before_doors_fails() -> None:
    [finding] = run_standard_tests("helbing1995", only=["choice of exit"])
    assert not finding.passed


def test_an_unknown_test_is_named() -> None:
    with pytest.raises(ValueError, match=r"'stairs' is no standard test; there are speed in a corridor, "):
        next(run_standard_tests(only=["stairs"]))


def test_the_command_prints_findings_and_writes_a_page(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    given = ["standard-tests", "--only", "speed in a corridor", "--only", "corner", "-o", str(page)]
    result = CliRunner().invoke(main, given)
    assert result.exit_code == 0
    assert [line[:25] for line in result.output.splitlines()] == [
        "pass  speed in a corridor",
        "pass  corner (RiMEA 6, NIS"[:25],
    ]
    assert "| corner | RiMEA 6, NIST 2.3 |" in page.read_text(encoding="utf-8")
    rows = json.loads(CliRunner().invoke(main, ["standard-tests", "--only", "corner", "--json"]).stdout)
    assert rows[0]["passed"] is True
    failed = CliRunner().invoke(main, ["standard-tests", "--only", "stairs"])
    assert failed.exit_code == 2
    assert "'stairs' is no test; there are speed in a corridor, " in failed.output


def test_the_exit_code_is_1_if_a_test_fails() -> None:
    result = CliRunner().invoke(main, ["standard-tests", "--model", "helbing1995", "--only", "choice of exit"])
    assert result.exit_code == 1
    assert "FAIL  choice of exit" in result.output
    assert "required: most by the nearer one" in result.output
