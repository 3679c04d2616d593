"""Invalid input gives a one-line message and a nonzero exit code, and complete episodes are never lost."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from sonata2d.errors import ControllerWarning

from .conftest import Run, one_line

CONTROLLER = """
import sonata2d as s2
class {name}(s2.Controller):
    def act(self, snapshot):
        {act}
"""


def write_controller(here: Path, act: str) -> None:
    """Write mine.py with a controller `Mine`; `act` is the body of its method."""
    (here / "mine.py").write_text(CONTROLLER.format(name="Mine", act=act))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("standin: 3\n", "line 1: standin: unknown key 'standin'; did you mean 'standing'?"),
        ("name: x\nroom: {sde: 4}\n", "line 2: room.sde: unknown key 'sde'; did you mean 'side'?"),
        ("tables: [4, 2]\n", "line 1: tables"),
        ("standing: many\n", "standing"),
        ("person: {desired_speed: {mean: 5}}\n", "mean 5.0 is not within 0.8..1.8"),
        ("person: {radius: -0.1}\n", "radius must be 0.1 m or more"),
        ("person: {model: foo}\n", "moussaid2009"),
        ("talking_distance: [-1, 2]\n", "must be above 0"),
        ("extends: sonata-2021\n", "did you mean 'sonata-2020'?"),
        ("person: {model: orca}\n", "no pedestrian model is named 'orca'; did you mean 'orca2011'?"),
        ("person: {model: ./law.py:Law}\n", "a scenario must not run code; publish it as a plug-in"),
        ("person: {reactions: {avoid: 2}}\n", "(got 'avoid'); did you mean 'avoids'?"),
        ("room: {kinds: [rectangl]}\n", "no room kind is named 'rectangl'; did you mean 'rectangle'?"),
        ("groups: {formations: circl}\n", "did you mean 'circle'?"),
        ("furniture: [{type: plnt, x: 1, y: 1}]\n", "did you mean 'plant'?"),
        ("furniture: [{type: televison, x: 1, y: 1}]\n", "known types are table, laptop, plant, chair, shelf, tv"),
        ("[1, 2]\n", "a scenario is a mapping"),
        ("a: [\n", "line"),
    ],
)
def test_invalid_scenario_file_is_refused(sonata2d: Run, here: Path, text: str, message: str) -> None:
    (here / "bad.yaml").write_text(text)
    output = one_line(sonata2d("generate out --scenario bad.yaml", code=1).output)
    assert "bad.yaml" in output
    assert message in output
    assert not (here / "out").exists()


def test_more_people_than_fit_are_refused(sonata2d: Run, here: Path) -> None:
    (here / "full.yaml").write_text("room: {kinds: square, side: 4}\nhumans: 40\nrelations: 0\n")
    output = one_line(sonata2d("generate out --scenario full.yaml --workers 1", code=1).output)
    assert "SceneError" in output
    assert "of 40" in output


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("./missing.py:Mine", "does not exist"),
        ("./mine.py:Yours", "mine has no attribute 'Yours'; its controllers are Mine"),
        ("./empty.py:Mine", "it defines no Controller class"),
        ("./broken.py:Mine", "SyntaxError"),
        ("no.such.module:Mine", "ModuleNotFoundError"),
        ("social-plannr", "did you mean 'social-planner'?"),
        ("json:dumps", "is not a Controller class"),
    ],
)
def test_controller_that_cannot_be_loaded_is_refused(sonata2d: Run, here: Path, name: str, message: str) -> None:
    write_controller(here, "return s2.Twist()")
    (here / "empty.py").write_text("x = 1\n")
    (here / "broken.py").write_text("def f(:\n")
    output = one_line(sonata2d(f"generate out --controller {name}", code=1).output)
    assert output.startswith("Error: ControllerError: ")
    assert message in output
    assert not (here / "out").exists()


@pytest.mark.parametrize(
    ("act", "message"),
    [
        ("return s2.Twist(1 / (57 - snapshot.tick))", "ZeroDivisionError"),
        ("return s2.Twist(float('nan') if snapshot.tick == 57 else 0.1)", "finite"),
        ("return [1.0, 0.0, 0.0] if snapshot.tick == 57 else s2.Twist()", "must return a Twist, got [1.0, 0.0, 0.0]"),
    ],
)
def test_failing_controller_is_reported_and_its_frames_are_stored(
    sonata2d: Run, here: Path, act: str, message: str
) -> None:
    (here / "long.yaml").write_text("extends: quick.yaml\nrules: {time_limit: 8, ends_on: [time]}\n")
    write_controller(here, act)
    output = one_line(
        sonata2d("generate out --scenario long.yaml --controller ./mine.py:Mine --workers 1", code=1).output
    )
    assert message in output
    assert "tick 57" in output
    assert "episode 0" in output
    kept = json.loads((here / "out/failed/000000.json").read_text())
    assert len(kept["frames"]) == 57
    assert kept["outcome"]["status"] == "error"
    sonata2d("render out/failed/000000.json -o failed.png")


def test_complete_episodes_survive_a_failure_and_resume_gives_the_same_bytes(sonata2d: Run, here: Path) -> None:
    line = "generate out --scenario quick.yaml --controller ./mine.py:Mine --episodes 4 --workers 1 --no-picture"
    act = "import os; assert snapshot.scene.episode < 2 or os.path.exists('weights'); return s2.Twist(vx=0.4)"
    write_controller(here, act)
    output = one_line(sonata2d(line, code=1).output)
    assert "2 of 4 episodes are complete in out" in output
    assert "AssertionError" in output
    (here / "weights").touch()
    sonata2d(f"{line} --resume")
    sonata2d(line.replace("out", "again"))
    for path in sorted((here / "again").glob("*.json")):
        assert path.read_bytes() == (here / "out" / path.name).read_bytes()
    assert not (here / "out/failed").exists()


def sha256_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_episodes_of_changed_code_are_not_mixed(sonata2d: Run, here: Path) -> None:
    line = "generate out --scenario quick.yaml --controller ./mine.py:Mine --workers 1 --no-picture"
    write_controller(here, "return s2.Twist(vx=0.4)")
    sonata2d(f"{line} --episodes 1")
    old, before = sha256_of(here / "mine.py"), (here / "out/000000.json").read_bytes()
    write_controller(here, "return s2.Twist(vx=0.5)")
    output = one_line(sonata2d(f"{line} --episodes 2 --resume", code=1).output)
    assert f"SHA-256 {old[:12]}" in output
    assert f"{sha256_of(here / 'mine.py')[:12]}" in output
    assert "--overwrite" in output
    assert (here / "out/000000.json").read_bytes() == before
    sonata2d(f"{line} --episodes 2 --overwrite")
    assert (here / "out/000000.json").read_bytes() != before
    assert sha256_of(here / "mine.py") in (here / "out/README.md").read_text()
    sonata2d("check out --controller ./mine.py:Mine")


def test_rerun_says_that_the_code_has_changed(sonata2d: Run, here: Path) -> None:
    write_controller(here, "return s2.Twist(vx=0.4)")
    sonata2d("generate out --scenario quick.yaml --controller ./mine.py:Mine --episodes 1 --workers 1 --no-picture")
    write_controller(here, "return s2.Twist(vx=0.4 + 0.0)")
    with pytest.warns(ControllerWarning, match=r"the code of \./mine\.py:Mine differs from the data set"):
        sonata2d("check out --controller ./mine.py:Mine --workers 1")
    write_controller(here, "return s2.Twist(vx=0.5)")
    output = sonata2d("check out --controller ./mine.py:Mine --workers 1", code=1).output
    assert "000000.json: rerun: line" in output
    assert "manifest.json: controller_sha256: the code of ./mine.py:Mine differs from the data set" in output


def test_a_failed_first_run_does_not_block_the_folder(sonata2d: Run, here: Path) -> None:
    write_controller(here, "raise ValueError('typo')")
    line = "generate out --controller ./mine.py:Mine --episodes 2 --workers 1 --no-picture"
    output = one_line(sonata2d(f"{line} --scenario quick.yaml", code=1).output)
    assert "run the same command again" in output
    assert (here / "out/failed/000000.json").exists()
    write_controller(here, "return s2.Twist()")
    (here / "other.yaml").write_text("extends: quick.yaml\nwandering: 1\n")
    sonata2d(f"{line} --scenario other.yaml")
    sonata2d("check out --replay")
    assert not (here / "out/failed").exists()


def test_overwrite_replaces_a_data_set_and_nothing_else(sonata2d: Run, here: Path) -> None:
    line = "generate out --scenario quick.yaml --workers 1 --no-picture"
    sonata2d(f"{line} --episodes 3 --compress gz")
    sonata2d("card out")
    (here / "out/notes.txt").write_text("mine")
    output = one_line(sonata2d(line, code=1).output)
    assert "--resume" in output
    assert "--overwrite" in output
    sonata2d(f"{line} --episodes 1 --seed 2 --overwrite")
    names = {"000000.json", "manifest.json", "scenario.json", "README.md", "run.jsonl", "notes.txt"}
    names |= {"episodes-00000.parquet", "frames-00000.parquet"}
    assert {path.name for path in (here / "out").iterdir()} == names
    sonata2d("check out")
    (here / "thesis").mkdir()
    (here / "thesis/chapter.tex").touch()
    assert "has no manifest.json" in sonata2d("generate thesis --overwrite", code=1).output
    assert "give one of them" in sonata2d(f"{line} --overwrite --resume", code=2).output


def test_resuming_with_other_settings_names_each_difference(sonata2d: Run, here: Path) -> None:
    line = "generate out --workers 1 --no-picture --episodes 1 --resume --scenario"
    sonata2d(f"{line} quick.yaml")
    (here / "other.yaml").write_text("extends: quick.yaml\nrobot: {radius: 0.25}\nrules: {time_limit: 9}\n")
    output = one_line(sonata2d(f"{line} other.yaml --seed 4", code=1).output)
    for difference in (
        "seed 0 stored, 4 requested",
        "settings.robot.radius 0.3 stored, 0.25 requested",
        "time_limit 4",
    ):
        assert difference in output
    assert "{" not in output


def test_folder_that_is_not_empty_is_not_changed(sonata2d: Run, here: Path) -> None:
    (here / "out").mkdir()
    (here / "out/thesis.tex").write_text("years of work")
    output = one_line(sonata2d("generate out", code=1).output)
    assert "not empty" in output
    assert [path.name for path in (here / "out").iterdir()] == ["thesis.tex"]


def test_file_as_folder_and_wrong_suffix_of_a_picture_are_refused(sonata2d: Run) -> None:
    assert "quick.yaml is a file" in one_line(sonata2d("generate quick.yaml", code=1).output)
    assert "end the name in .png" in one_line(sonata2d("scenarios draw quick.yaml -o x.jpg", code=1).output)


def test_empty_room_and_a_single_tick_are_valid(sonata2d: Run, here: Path) -> None:
    (here / "tiny.toml").write_text("humans = 0\nrelations = 0\n[rules]\ntime_limit = 0.1\nsubsteps = 1\n")
    sonata2d("generate out --scenario tiny.toml --episodes 1 --workers 1")
    sonata2d("check out --replay")
    for kind in ("png", "html", "gif"):
        sonata2d(f"render out/000000.json -o x.{kind}")


def test_existing_data_set_is_continued_only_with_resume_and_equal_settings(sonata2d: Run) -> None:
    line = "generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture"
    sonata2d(line)
    assert "resume" in one_line(sonata2d(line, code=1).output)
    sonata2d(f"{line} --resume")
    assert "seed" in one_line(sonata2d(f"{line} --resume --seed 3", code=1).output)


@pytest.mark.skipif(os.name != "posix", reason="needs /proc")
def test_folder_that_cannot_be_written_is_reported(sonata2d: Run) -> None:
    output = one_line(sonata2d("generate /proc/out", code=1).output)
    assert "/proc/out" in output


@pytest.mark.skipif(os.name != "posix", reason="needs a limit of the file size")
def test_full_disk_leaves_no_partial_file(here: Path) -> None:
    """A limit of the file size acts as a full disk: the second, longer episode does not fit."""
    import resource  # POSIX only

    (here / "long.yaml").write_text("extends: quick.yaml\nrules: {time_limit: 8, ends_on: [time]}\n")
    line = "generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture"
    subprocess.run([sys.executable, "-m", "sonata2d_cli", *line.split()], check=True, capture_output=True)
    size = (here / "out/000000.json").stat().st_size
    line = "generate big --scenario long.yaml --episodes 1 --workers 1 --no-picture"
    done = subprocess.run(
        [sys.executable, "-m", "sonata2d_cli", *line.split()],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
    )
    assert done.returncode == 1
    assert "cannot be written" in one_line(done.stderr)
    assert not list((here / "big").glob("*.tmp"))
    assert not (here / "big/000000.json").exists()


@pytest.mark.skipif(os.name != "posix", reason="needs a limit of the file size")
@pytest.mark.parametrize("name", ["x.png", "x.svg", "x.html", "x.gif", "x.mp4", "strip.png", "graph.png"])
@pytest.mark.parametrize("exists", [False, True])
def test_a_full_disk_leaves_the_old_picture_or_none(sonata2d: Run, here: Path, name: str, exists: bool) -> None:
    import resource  # POSIX only

    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    if exists:
        (here / name).write_bytes(b"old")
    before = sorted(path.name for path in here.iterdir())
    options = {"strip": ["--strip", "3"], "graph": ["--graph"]}.get(name.partition(".")[0], [])
    done = subprocess.run(
        [sys.executable, "-m", "sonata2d_cli", "render", "out/000000.json", "-o", name, *options],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000)),
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f"Error: RenderError: cannot write {name}: ")
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in here.iterdir()) == before
    assert not exists or (here / name).read_bytes() == b"old"


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: text[: len(text) // 2], "truncated"),
        (lambda text: text.replace('"version":1', '"version":9', 1), "upgrade sonata2d"),
        (lambda text: text.replace('"format":"sonata2d-episode"', '"format":"x"'), "format"),
    ],
)
def test_damaged_or_newer_file_is_refused(sonata2d: Run, here: Path, damage: object, message: str) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    path = here / "out/000000.json"
    path.write_text(damage(path.read_text()))  # type: ignore[operator]
    assert message in one_line(sonata2d("describe out/000000.json", code=1).output)
    assert message in one_line(sonata2d("render out/000000.json -o x.png", code=1).output)
    assert message in sonata2d("check out --replay --workers 1", code=1).output


@pytest.mark.skipif(os.name != "posix", reason="needs /dev/zero")
@pytest.mark.parametrize("name", ["000000.json", "scenario.json", "README.md"])
def test_a_data_set_with_a_link_to_a_device_is_not_read_without_end(sonata2d: Run, here: Path, name: str) -> None:
    sonata2d("generate d --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    (here / "d" / name).unlink(missing_ok=True)
    (here / "d" / name).symlink_to("/dev/zero")
    if name == "000000.json":
        for line in ("mirror d -o m", "split d", "evaluate d --no-rerun --workers 1"):
            assert "d/000000.json cannot be read: it is a device, not a file" in one_line(sonata2d(line, code=1).output)
    else:
        sonata2d("mirror d -o m")
        sonata2d("describe d")
        sonata2d("check d --workers 1")


def test_changed_number_is_found_by_hash_and_by_replay(sonata2d: Run, here: Path) -> None:
    quick = (here / "quick.yaml").read_text()
    (here / "quick.yaml").write_text(quick.replace("time_limit: 4", "time_limit: 4, ends_on: [time]"))
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    path = here / "out/000000.json"
    lines = path.read_text().splitlines(keepends=True)
    row = next(k for k, line in enumerate(lines) if line.startswith('{"tick":7,'))
    command = json.loads(lines[row].rstrip(",\n"))["command"]
    edited = [round(command[0] - 0.01, 4), 0.0, 0.0]
    old, new = (json.dumps(one, separators=(",", ":")) for one in (command, edited))
    lines[row] = lines[row].replace(old, new, 1)
    path.write_text("".join(lines))
    output = sonata2d("check out --replay --workers 1", code=1).output
    assert "sha256" in output
    assert "000000.json: replay: line" in output


def test_unknown_suffix_of_a_picture_is_refused(sonata2d: Run) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    output = one_line(sonata2d("render out/000000.json -o film.avi", code=1).output)
    assert ".mp4" in output


def test_missing_path_and_unknown_option_are_refused(sonata2d: Run) -> None:
    assert "does not exist" in one_line(sonata2d("check nowhere", code=1).output)
    assert "nowhere" in one_line(sonata2d("describe nowhere.json", code=1).output)
    assert "No such option" in sonata2d("generate out --episods 3", code=2).output


@pytest.mark.parametrize(
    ("line", "code", "hint"),
    [
        ("scenarios lst", 2, "'list'"),
        ("generate out --episods 3", 2, "--episodes"),
        ("generate out --scenario livly", 1, "'lively'"),
        ("generate out --controller social-planer", 1, "'social-planner'"),
        ("evaluate out --metric sucess", 1, "'success'"),
        ("evaluate out --metric hunavsm", 1, "'hunavsim'"),
        ("export out --to cvs -o tracks", 2, "'csv'"),
        ("import old --from trajnt -o episodes", 2, "'trajnet'"),
    ],
)
def test_a_misspelt_name_gets_a_suggestion(sonata2d: Run, line: str, code: int, hint: str) -> None:
    output = sonata2d(line, code=code).output.splitlines()[-1]
    assert "did you mean" in output.lower()
    assert hint in output


@pytest.mark.parametrize(
    ("place", "message"),
    [("[20, 0]", "the place (20, 0) of talking group 1 of 1 is outside the room"), ("[3.9, 0]", "does not fit at its")],
)
def test_a_group_without_space_at_its_place_is_told_to_move(
    sonata2d: Run, here: Path, place: str, message: str
) -> None:
    groups = f"{{talking_size: 3, places: [{place}]}}"
    (here / "groups.yaml").write_text(f"room: {{kinds: square, side: 8}}\ntalking_groups: 1\ngroups: {groups}\n")
    output = one_line(sonata2d("generate out --scenario groups.yaml --workers 1", code=1).output)
    assert message in output
    assert "groups.places" in output


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("generate out --episodes ten", "'ten' is not a valid whole number, 1 or more."),
        ("evaluate out --resamples 2e3", "'2e3' is not a valid whole number, from 100 to 100000."),
        ("render out -o x.gif --speed fast", "'fast' is not a valid number, from 0.05 to 50.0."),
    ],
)
def test_a_word_in_place_of_a_number_is_told_the_range(sonata2d: Run, line: str, message: str) -> None:
    assert message in sonata2d(line, code=2).output


def test_a_misspelt_command_gets_a_suggestion(sonata2d: Run) -> None:
    assert "No such command 'generat'; did you mean 'generate'?" in sonata2d("generat out", code=2).output
    assert "No such command 'zzz'" in sonata2d("zzz", code=2).output


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        ("x.gif --strip 2", 1, "strip has no effect on this format, only on .png"),
        ("x.png --fps 5", 1, "fps has no effect on this format, only on .gif, .mp4"),
        ("x.svg --speed 2", 1, "speed has no effect on this format"),
        ("x.html --size 300 200", 1, "size has no effect on this format"),
        ("x.png --strip 2 --size 300 200", 1, "size has no effect on moments side by side"),
        ("x.html --no-legend", 2, "--no-legend have no effect on a page"),
    ],
)
def test_options_without_effect_on_the_format_of_the_output_are_refused(
    sonata2d: Run, here: Path, options: str, code: int, message: str
) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    output = sonata2d(f"render out/000000.json -o {options}", code=code).output
    assert message in " ".join(output.split())
    assert not [*here.glob("x.*")]


def test_a_picture_has_a_legend_unless_it_is_omitted(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    sonata2d("render out/000000.json -o with.svg")
    sonata2d("render out/000000.json -o without.svg --no-legend")
    texts = [(here / name).read_text("utf-8") for name in ("with.svg", "without.svg")]
    assert [">goal</text>" in text for text in texts] == [True, False]


@pytest.mark.parametrize("columns", [5, [5], [{"name": 5}], "abc", {}, None])
def test_unknown_blocks_of_columns_are_not_described(sonata2d: Run, here: Path, columns: object) -> None:
    """Readers ignore keys that they do not know, whatever these hold."""
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    path = here / "out/000000.json"
    before = sonata2d(f"describe {path}").output
    document = json.loads(path.read_bytes())
    document["columns"]["mine"] = columns
    path.write_text(json.dumps(document))
    assert sonata2d(f"describe {path}").output == before
