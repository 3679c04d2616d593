"""`sonata2d export` and `sonata2d import`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sonata2d.formats.api import format_named
from sonata2d.registry import FORMATS

from .conftest import Run, one_line


@pytest.fixture
def dataset(sonata2d: Run, here: Path) -> Path:
    """A data set of two episodes of four seconds."""
    sonata2d("generate out --scenario quick.yaml --episodes 2 --seed 4 --workers 1 --no-picture")
    return here / "out"


def test_help_lists_all_formats(sonata2d: Run) -> None:
    for name in ("export", "import"):
        output = sonata2d(f"{name} --help").output
        assert "Examples:" in output
        assert all(format in output for format in FORMATS.built_in)


@pytest.mark.parametrize("format", ["sonata", "socnav3", "npz", "csv"])
def test_exported_files_can_be_imported(sonata2d: Run, dataset: Path, here: Path, format: str) -> None:
    output = json.loads(sonata2d(f"export out --to {format} -o exported --json").output)
    suffix = format_named(format).suffix
    assert output["files"] == [f"exported/00000{k}{suffix}" for k in (0, 1)]
    assert (output["skipped"], output["refused"]) == ([], [])
    assert f"back: 2 episodes from {format}" in sonata2d(f"import exported --from {format} -o back").output
    assert "no problems" in sonata2d("check back").output
    foreign = "imported" in sonata2d("describe back/000000.json").output
    assert foreign == (format in ("sonata", "csv")), "socnav3 and npz carry the whole episode"
    sonata2d("render back/000001.json -o one.png --strip 2")
    assert (here / "one.png").stat().st_size > 1000


def test_single_episode_is_exported_to_the_named_file(sonata2d: Run, dataset: Path, here: Path) -> None:
    assert "one.json: 1 socnav3 file" in sonata2d("export out/000001.json --to socnav3 -o one.json").output
    sonata2d("import one.json --from socnav3 -o again.json.zst")
    sonata2d("check again.json.zst --replay")
    steps = json.loads((here / "one.json").read_text())["sequence"]
    frames = json.loads((dataset / "000001.json").read_text())["frames"]
    assert len(steps) == len(frames) + 1


def test_imported_episode_cannot_be_replayed(sonata2d: Run, dataset: Path) -> None:
    sonata2d("export out --to sonata -o exported")
    sonata2d("import exported --from sonata -o back")
    lines = sonata2d("check back --replay --workers 1", code=1).output.splitlines()
    assert lines[0] == "000000.json and 1 other file: replay: imported: there is no simulation to replay"
    assert lines[1:] == ["back: 2 files checked, replayed, 2 problems"]


def test_imported_tracks_are_no_data_set_and_have_no_robot_to_evaluate(sonata2d: Run, dataset: Path) -> None:
    sonata2d("export out --to csv -o tracks")
    assert "a folder of episodes, not a data set" in sonata2d("import tracks --from csv -o back").output
    assert "not a data set" not in sonata2d("import tracks/000000.csv --from csv -o one.json").output
    reason = "no metric is defined, because imported tracks have no robot"
    assert f"back: {reason}" in sonata2d("evaluate back --workers 1").output
    assert reason not in sonata2d("evaluate out --workers 1 --no-rerun").output


def test_refused_episodes_are_listed_and_the_others_exported(sonata2d: Run, dataset: Path, here: Path) -> None:
    (here / "mixed").mkdir()
    (here / "mixed/000000.json").write_bytes((dataset / "000000.json").read_bytes())
    (here / "mixed/000001.json").write_text("{")
    result = sonata2d("export mixed --to npz -o exported", code=1)
    assert "exported: 1 npz file, 1 refused" in result.output
    assert "refused: mixed/000001.json is not valid JSON" in result.output
    output = sonata2d("export mixed --to npz -o exported --json", code=1)
    assert len(json.loads(output.stdout)["refused"]) == 1
    assert [path.name for path in (here / "exported").iterdir()] == ["000000.npz"]


def test_episodes_that_a_format_cannot_hold_are_skipped_and_counted(sonata2d: Run, dataset: Path, here: Path) -> None:
    result = sonata2d("export out --to trajnet -o none", code=1)
    assert "none: 0 trajnet files, 2 skipped" in result.output, "nothing was exported"
    (line,) = [line for line in result.stderr.splitlines() if line.startswith("skipped")]
    assert "out/000000.json: no pedestrian is present for 8 s" in line
    assert line.endswith("(and 1 more for this reason)")
    long = "generate long --scenario quick.yaml --episodes 1 --workers 1 --no-picture --seed 4"
    (here / "long.yaml").write_text((here / "quick.yaml").read_text().replace("time_limit: 4", "time_limit: 10"))
    sonata2d(long.replace("quick", "long"))
    (here / "out/000002.json").write_bytes((here / "long/000000.json").read_bytes())
    (here / "out/manifest.json").unlink()
    result = sonata2d("export out --to trajnet -o some", code=0)
    assert "some: 1 trajnet file, 2 skipped" in result.output
    assert len(json.loads(sonata2d("export out --to trajnet -o again --json").stdout)["skipped"]) == 2


def test_notes_and_options_of_a_format_are_told(sonata2d: Run, dataset: Path, here: Path) -> None:
    assert "note: no context is recorded" in sonata2d("export out --to socnav3 -o one").stderr
    result = sonata2d("export out --to socnav3 -o two --context Waiting. --as plant --as object=table")
    assert result.stderr == ""
    assert json.loads((here / "two/000000.json").read_text())["context_description"] == "Waiting."
    for line, message in (
        ("export out --to csv -o x --context none", "the format csv does not use --context"),
        ("export out --to socnav3 -o x --as object=", "is not of the form KNOWN or TYPE=KNOWN"),
        ("import two/000000.json --from npz -o x --renumber", "the format npz does not use --renumber"),
        ("import two --from sonata -o x --walls quick.yaml", "the format sonata does not use --walls"),
    ):
        assert message in sonata2d(line, code=2 if "=" in line else 1).output


def test_files_refused_for_one_reason_are_one_line(sonata2d: Run, here: Path) -> None:
    (here / "raw").mkdir()
    for name in "abc":
        (here / f"raw/{name}.json").write_text('{"sequence": []}')
    result = sonata2d("import raw --from socnav3 -o back", code=1)
    (line,) = result.stderr.splitlines()
    assert line.startswith("refused: raw/a.json is not a valid socnav3 file: it has no walls; pass a file of them")
    assert line.endswith("with --walls FILE (with the header only: no walls) (and 2 more for this reason)")


def test_quirks_are_refused_for_other_formats(sonata2d: Run, dataset: Path, here: Path) -> None:
    sonata2d("export out --to sonata --quirks original -o exported")
    names = {path.name for path in (here / "exported").iterdir()}
    assert names == {"default__2020-07-17__15:33:20.json", "default__2020-07-17__16:33:20.json"}
    assert (
        "the format npz does not use --quirks" in sonata2d("export out --to npz --quirks original -o x", code=1).output
    )


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("export nowhere --to csv -o x", "nowhere does not exist"),
        ("import nowhere --from csv -o x", "nowhere does not exist"),
        ("import . --from npz -o x", "holds no .npz files"),
    ],
)
def test_invalid_paths_give_a_one_line_message(sonata2d: Run, here: Path, line: str, message: str) -> None:
    assert message in one_line(sonata2d(line, code=1).output)


def test_a_data_set_is_not_overwritten_by_an_import_or_an_export(sonata2d: Run, dataset: Path, here: Path) -> None:
    before = {path: path.read_bytes() for path in dataset.iterdir()}
    sonata2d("export out --to csv -o tracks")
    for output in ("out", "out/000000.json"):
        refusal = one_line(sonata2d(f"import tracks/000000.csv --from csv -o {output}", code=1).output)
        assert "out holds a data set; choose another folder" in refusal
    sonata2d("generate other --scenario quick.yaml --episodes 2 --seed 5 --workers 1 --no-picture")
    assert "belongs to the data set out" in sonata2d("export other --to socnav3 -o out", code=1).output
    assert {path: path.read_bytes() for path in dataset.iterdir()} == before


def test_one_part_of_a_split_is_exported(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --workers 1 --no-picture --episodes 5")
    sonata2d("split out --parts train=3,test=2")
    result = sonata2d("export out --to npz -o all")
    assert "all parts of the split are in the export, train, test; --part NAME exports one" in result.output
    assert len(list((here / "all").iterdir())) == 5
    result = sonata2d("export out --to npz --part test -o test")
    assert "all parts" not in result.output
    assert len(list((here / "test").iterdir())) == 2
    result = sonata2d("export out --to npz --part dev -o dev", code=2)
    assert "has no part 'dev'; it has train, test" in result.output


def test_files_of_an_earlier_export_are_named(sonata2d: Run, dataset: Path, here: Path) -> None:
    assert "more of this kind" not in sonata2d("export out --to npz -o arrays").output
    (here / "arrays" / "000007.npz").write_bytes(b"earlier")
    assert (
        "arrays holds 1 file more of this kind, as of an earlier export"
        in sonata2d("export out --to npz -o arrays").output
    )
