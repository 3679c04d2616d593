"""`sonata2d export` and `sonata2d import`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sonata2d.formats.api import format_named
from sonata2d.registry import FORMATS

from .conftest import Run


@pytest.fixture
def made(sonata2d: Run, here: Path) -> Path:
    """A data set of two episodes of four seconds."""
    sonata2d("generate out --scenario quick.yaml --episodes 2 --seed 4 --workers 1 --no-picture")
    return here / "out"


def test_the_commands_know_all_formats(sonata2d: Run) -> None:
    for name in ("export", "import"):
        told = sonata2d(f"{name} --help").output
        assert "Examples:" in told
        assert all(format in told for format in FORMATS.built_in)


@pytest.mark.parametrize("format", ["sonata", "socnav3", "npz", "csv"])
def test_out_and_in_again(sonata2d: Run, made: Path, here: Path, format: str) -> None:
    told = json.loads(sonata2d(f"export out --to {format} -o there --json").output)
    suffix = format_named(format).suffix
    assert told == {"format": format, "files": [f"there/00000{k}{suffix}" for k in (0, 1)], "refused": []}
    assert (
        f"back: 2 episodes from {format}" in sonata2d(f"import there --from {format} -o back --frame-time 0.1").output
    )
    assert "no problems" in sonata2d("check back").output
    foreign = "imported" in sonata2d("describe back/000000.json").output
    assert foreign == (format in ("sonata", "csv")), "socnav3 and npz carry the whole episode"
    sonata2d("render back/000001.json -o one.png --strip 2")
    assert (here / "one.png").stat().st_size > 1000


def test_one_episode_goes_to_the_file_that_is_named(sonata2d: Run, made: Path, here: Path) -> None:
    assert "one.json: 1 socnav3 files" in sonata2d("export out/000001.json --to socnav3 -o one.json").output
    sonata2d("import one.json --from socnav3 -o again.json.zst")
    sonata2d("check again.json.zst --replay")
    steps = json.loads((here / "one.json").read_text())["sequence"]
    frames = json.loads((made / "000001.json").read_text())["frames"]
    assert len(steps) == len(frames) + 1


def test_an_import_that_cannot_be_proven_is_not_said_to_be(sonata2d: Run, made: Path) -> None:
    sonata2d("export out --to sonata -o there")
    sonata2d("import there --from sonata -o back")
    told = sonata2d("check back --replay --workers 1", code=1).output
    assert "made by physics version 0" in told
    assert "cannot be replayed" in told


def test_what_is_refused_is_told_and_the_rest_goes_on(sonata2d: Run, made: Path, here: Path) -> None:
    (here / "mixed").mkdir()
    (here / "mixed/000000.json").write_bytes((made / "000000.json").read_bytes())
    (here / "mixed/000001.json").write_text("{")
    result = sonata2d("export mixed --to npz -o there", code=1)
    assert "there: 1 npz files, 1 refused" in result.output
    assert "refused: mixed/000001.json is not whole JSON" in result.output
    told = sonata2d("export mixed --to npz -o there --json", code=1)
    assert len(json.loads(told.stdout)["refused"]) == 1
    assert [path.name for path in (here / "there").iterdir()] == ["000000.npz"]


def test_quirks_are_for_the_format_that_has_them(sonata2d: Run, made: Path, here: Path) -> None:
    sonata2d("export out --to sonata --quirks original -o there")
    names = {path.name for path in (here / "there").iterdir()}
    assert names == {"default__2020-07-17__15:33:20.json", "default__2020-07-17__16:33:20.json"}
    assert "npz has no quirks" in sonata2d("export out --to npz --quirks original -o x", code=1).output


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("export nowhere --to csv -o x", "nowhere does not exist"),
        ("import nowhere --from csv -o x", "nowhere does not exist"),
        ("import . --from npz -o x", "holds no .npz files"),
    ],
)
def test_bad_places_are_one_line(sonata2d: Run, here: Path, line: str, said: str) -> None:
    (told,) = sonata2d(line, code=1).output.strip().splitlines()
    assert said in told
