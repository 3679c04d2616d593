"""Every command with valid input."""

from __future__ import annotations

import importlib
import importlib.util
import json
import subprocess
import sys
import tarfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType

import pytest
from click.testing import CliRunner
from sonata2d_cli import doctor, main
from sonata2d_cli.main import COMMANDS

import sonata2d as s2
from sonata2d.core.compiled import kernel as compiled
from sonata2d.datasets.generate.run import KEEPABLE
from sonata2d.errors import ControllerWarning
from sonata2d.version import PHYSICS_VERSION

from .conftest import Run


def test_generate_writes_a_data_set_and_prints_the_next_command(sonata2d: Run, here: Path) -> None:
    output = sonata2d("generate out --scenario quick.yaml --episodes 3 --seed 4 --workers 1").output
    names = {path.name for path in (here / "out").iterdir()}
    assert names == {
        "000000.json",
        "000001.json",
        "000002.json",
        "episodes-00000.parquet",
        "frames-00000.parquet",
        "manifest.json",
        "scenario.json",
        "README.md",
        "preview.png",
        "run.jsonl",
    }
    assert "next:  " in output
    assert "render out/000000.json" in output
    manifest = json.loads((here / "out/manifest.json").read_text())
    assert manifest["complete"]
    assert [file["episode"] for file in manifest["files"]] == [0, 1, 2]
    assert sum(manifest["counts"]["outcome"].values()) == 3


def test_contacts_and_commands_beyond_the_limits_stand_beside_the_outcomes(sonata2d: Run, here: Path) -> None:
    fast = "import sonata2d as s2\nclass Fast(s2.Controller):\n    def act(self, snapshot): return s2.Twist(vx=9.0)\n"
    (here / "fast.py").write_text(fast)
    with pytest.warns(ControllerWarning, match="vx up to 9 m/s"):
        output = sonata2d("generate out --controller ./fast.py --episodes 2 --workers 1 --no-picture").output
    manifest = json.loads((here / "out/manifest.json").read_text())
    touching = sum("any" in file["contacts"] for file in manifest["files"])
    assert f"in {touching} of 2 episodes" in output
    assert "  with a wall" in output
    described = sonata2d("describe out").output
    assert f"in {touching} of 2 episodes" in described
    assert "vx up to 9 m/s (limit 1 m/s) in 100.0 % of the frames" in described
    facts = json.loads(sonata2d("describe out/000000.json --json").output)
    assert facts["contacts"]["by_kind"]["wall"]["frames"] == manifest["files"][0]["contacts"]["wall"]["frames"]
    table = sonata2d("evaluate out --no-rerun --workers 1").output
    assert all(f"{kind}_collisions" in table for kind in ("human", "object", "wall"))


@pytest.mark.parametrize("keep", ["", " --keep goal --keep timeout"])
def test_command_on_the_card_reproduces_the_data_set(sonata2d: Run, here: Path, keep: str) -> None:
    sonata2d(f"generate out --scenario quick.yaml --episodes 2 --seed 9 --workers 1 --no-picture{keep}")
    card = (here / "out/README.md").read_text()
    command = next(line for line in card.splitlines() if line.startswith("sonata2d generate"))
    sonata2d(command.removeprefix("sonata2d ").replace("scenario.json", "out/scenario.json") + " --no-picture")
    for path in (here / "AGAIN").iterdir():
        assert path.name == "run.jsonl" or path.read_bytes() == (here / "out" / path.name).read_bytes()


def test_keep_selects_episodes_by_outcome(sonata2d: Run) -> None:
    output = sonata2d(
        "generate out --scenario quick.yaml --controller straight-to-goal --keep timeout --episodes 2 --workers 1"
    ).output
    assert ["outcomes", "2", "timeout"] in [line.split() for line in output.splitlines()]
    assert "left out" in output
    assert ["kept", "are", "timeout"] in [line.split() for line in sonata2d("describe out").output.splitlines()]
    assert f"--keep [{'|'.join(KEEPABLE)}]" in sonata2d("generate --help").output


def test_generated_data_set_passes_all_checks(sonata2d: Run) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 2 --workers 1 --compress zst --no-picture")
    assert "no problems" in sonata2d("check out --replay --rerun --workers 1").output
    assert "no problems" in sonata2d("check out/000001.json.zst --replay").output


def test_check_says_how_many_files_it_could_replay(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    text = (here / "out/000000.json").read_text()
    (here / "other.json").write_text(text.replace(f'"physics":{PHYSICS_VERSION}', '"physics":99'))
    output = sonata2d("check other.json --replay", code=1).output
    assert "physics version 99, which this sonata2d" in output
    assert "1 file checked, 0 of them replayed, 1 problem" in output
    assert "1 file checked, replayed, no problems" in sonata2d("check out/000000.json --replay").output


def test_controller_from_a_file_drives_and_labels(sonata2d: Run, here: Path) -> None:
    (here / "polite.py").write_text(
        "import sonata2d as s2\n"
        "class Polite(s2.Controller):\n"
        "    labels = {'near': 'a person is nearer than 1.2 m'}\n"
        "    def act(self, snapshot):\n"
        "        return s2.Twist(vx=0.5)\n"
        "    def label(self, snapshot, twist):\n"
        "        return {'near': s2.clearance(snapshot) < s2.PERSONAL_DISTANCE}\n"
    )
    sonata2d("generate out --controller ./polite.py:Polite --scenario quick.yaml --episodes 4 --workers 2 --no-picture")
    episode = json.loads((here / "out/000003.json").read_text())
    assert episode["controller"]["path"] == "./polite.py:Polite"
    assert episode["labels"] == {"near": "a person is nearer than 1.2 m"}
    assert all(isinstance(frame["label"]["near"], bool) for frame in episode["frames"])
    assert "code that a file names is not run; if you trust it, give --controller ./polite.py:Polite" in (
        sonata2d("check out --rerun --workers 1", code=1).output
    )
    sonata2d("check out --rerun --controller ./polite.py:Polite --workers 1")


def test_describe_summarises_what_check_reads(sonata2d: Run) -> None:
    sonata2d("generate out --scenario empty --controller straight-to-goal --episodes 3 --seed 4 --shard-size 3")
    Path("loose").mkdir()
    with tarfile.open("out/shard-000000.tar") as shard:
        shard.extractall("loose", filter="data")
    Path("out/shard-000000.tar").rename("x.tar")
    for name in ("x.tar", "loose"):
        assert "3 files checked, no problems" in sonata2d(f"check {name}").output
        values = json.loads(sonata2d(f"describe {name} --json").output)
        expected = {"scenario": "empty", "controller": "straight-to-goal", "seed": 4, "episodes": 3}
        assert {key: values[key] for key in expected} == expected
        assert sum(values["outcomes"].values()) == sum(values["families"].values()) == 3
        frames = [len(s2.read_episode(path)) for path in sorted(Path("loose").iterdir())]
        assert values["frames"] == sum(frames)
    sonata2d("generate other --scenario lively --controller straight-to-goal --episodes 1")
    Path("other/000000.json").rename("loose/other.json")
    values = json.loads(sonata2d("describe loose --json").output)
    assert (values["scenario"], values["seed"]) == (["empty", "lively"], [0, 4])


def test_describe_summarises_data_sets_and_episodes(sonata2d: Run) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 2 --workers 1 --no-picture")
    assert "episodes         2 of 2" in sonata2d("describe out").output
    values = json.loads(sonata2d("describe out/000000.json --json").output)
    assert values["people"] == "4, 2 of them walking at the start"
    assert values["labels"] == "the command itself"


def test_render_writes_pictures_films_and_pages(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    for name, start in (("a.png", b"\x89PNG"), ("b.html", b"<!"), ("c.gif", b"GIF8")):
        sonata2d(f"render out/000000.json -o {name} --zones --ids")
        assert (here / name).read_bytes().startswith(start)


def test_scenarios_check_accepts_the_right_situation_only(sonata2d: Run) -> None:
    output = sonata2d("scenarios check overtaking --episodes 2 --controller straight-to-goal").output
    assert "overtaking took place in 2 of 2 episodes of overtaking" in output
    output = sonata2d("scenarios check overtaking --situation blind-corner --episodes 1 --json", code=1).output
    assert json.loads(output)["took_place"] == 0
    unnamed = sonata2d("scenarios check quick.yaml --episodes 1", code=1).output
    assert "the scenario's name 'quick' is not a situation; give one with --situation NAME" in unnamed
    misnamed = sonata2d("scenarios check quick.yaml --situation overtakin", code=1).output
    assert "did you mean 'overtaking'?" in misnamed


def test_scenarios_are_listed_shown_and_drawn(sonata2d: Run, here: Path) -> None:
    assert "sonata-2020-crowded" in sonata2d("scenarios list").output
    shown = sonata2d("scenarios show sonata-2020").output
    (here / "again.yaml").write_text(shown)
    again = json.loads(sonata2d("scenarios show again.yaml --json").output)
    assert again == json.loads(sonata2d("scenarios show sonata-2020 --json").output)
    sonata2d("scenarios draw quick.yaml --scenes 2 -o quick.png")
    assert (here / "quick.png").stat().st_size > 2000


def test_controllers_are_listed(sonata2d: Run) -> None:
    names = [row["name"] for row in json.loads(sonata2d("controllers --json").output)]
    assert names[:3] == ["straight-to-goal", "social-force", "social-planner"]


def test_doctor_passes(sonata2d: Run) -> None:
    rows = {row["check"]: row for row in json.loads(sonata2d("doctor --json").output)}
    assert rows["trial episode"]["ok"] is True, rows["trial episode"]["found"]
    assert rows["writing"]["ok"] is True
    assert rows["filelock"]["ok"] is True
    assert rows["kernels"]["ok"] is (True if compiled.IS_COMPILED else None)
    assert rows["kernels"]["found"].startswith(compiled.BACKEND)


def test_doctor_passes_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    def find_version(name: str) -> str:
        if name in ("numba", "llvmlite"):
            raise PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(compiled, "IS_COMPILED", False)
    monkeypatch.setattr(compiled, "BACKEND", "interpreted, some 30 times slower than compiled; pip install numba")
    monkeypatch.setattr(doctor, "version", find_version)
    monkeypatch.setattr(doctor, "trial_digest", lambda: (doctor.DIGEST, 1))
    found = doctor.findings()
    assert found["numba"] == (None, "missing; pip install numba")
    assert found["kernels"] == (None, compiled.BACKEND)
    assert False not in {ok for ok, _ in found.values()}


def test_doctor_fails_where_an_installed_package_cannot_be_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    import_module = importlib.import_module

    def find_module(name: str) -> ModuleType:
        if name == "numba":
            raise ImportError("Numba needs NumPy 2.4 or less")
        return import_module(name)

    monkeypatch.setattr(importlib, "import_module", find_module)
    monkeypatch.setattr(doctor, "trial_digest", lambda: (doctor.DIGEST, 1))
    rows = doctor.findings()
    ok, found = rows["numba"]
    assert ok is False
    assert "cannot be imported (ImportError: Numba needs NumPy 2.4 or less); pip install -U numba" in found
    assert rows["llvmlite"][0]


@pytest.mark.skipif(not compiled.IS_COMPILED, reason="kernels are interpreted")
def test_doctor_says_where_machine_code_is_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from sonata2d.core.compiled import cache as kernel_cache

    monkeypatch.setattr(kernel_cache, "writable_folder", lambda: tmp_path)
    monkeypatch.setattr(doctor, "trial_digest", lambda: (doctor.DIGEST, 1))
    assert doctor.findings()["kernels"] == (True, f"{compiled.BACKEND}; machine code in {tmp_path}")
    monkeypatch.setattr(kernel_cache, "writable_folder", lambda: None)
    ok, text = doctor._kernels()
    assert ok is None
    assert "anew in each process: not writable: " in text


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(command: str) -> None:
    words = {
        "scenarios": [command, "draw"],
        "controllers": [command, "list"],
        "study": [command, "check"],
        "benchmark": [command, "list"],
    }.get(command, [command])
    output = CliRunner().invoke(main, [*words, "--help"]).output
    assert "Example" in output
    assert "--json" in output


def test_help_loads_no_simulation() -> None:
    code = (
        "import sys; from sonata2d_cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: print({'numba', 'pymunk', 'pydantic', 'pygame', 'yaml'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("set()\n")


def test_scenario_from_tracks_works_with_all_commands(sonata2d: Run, here: Path) -> None:
    rows = [f"{frame},{ped},{(-1) ** ped * (0.5 * frame - 3.0)},{ped}" for frame in range(12) for ped in (1, 2)]
    (here / "street.csv").write_text("\n".join(["frame,ped,x,y", *rows]))
    made = sonata2d(
        "scenarios from-tracks street.csv --frame-time 0.4 --seconds 3 --robot 3 0 3.1 -o street.yaml"
    ).output
    assert "2 people, 2 of them replayed" in made
    mixed = "scenarios from-tracks street.csv --frame-time 0.4 --replay 2 --goal -2 0 -o mixed.json --json"
    facts = json.loads(sonata2d(mixed).output)
    tracks = facts.pop("tracks")
    assert facts == {"scenario": "mixed.json", "people": 2, "replayed": 1, "walls": 0}
    assert (tracks["persons"], tracks["frames"], tracks["interval"], tracks["doubts"]) == (2, 12, 0.4, [])
    assert "already exists" in sonata2d("scenarios from-tracks street.csv -o street.yaml", code=2).output
    sonata2d("scenarios draw street.yaml --scenes 1 -o street.png")
    sonata2d("generate out --scenario street.yaml --episodes 1 --workers 1 --no-picture")
    sonata2d("check out --replay --rerun --workers 1")
    sonata2d("evaluate out --metric all")
    output = sonata2d("describe out/000000.json").output
    assert "recorded people" in output
    for suffix in ("png", "svg", "html"):
        sonata2d(f"render out/000000.json -o picture.{suffix}")
    sonata2d("mirror out -o image")
    sonata2d("check image --replay --workers 1")


@pytest.mark.parametrize("option", ["--robot 1 2", "--robot 1 2 x", "--goal 1"])
def test_positions_are_numbers(sonata2d: Run, here: Path, option: str) -> None:
    output = sonata2d(f"scenarios from-tracks street.csv -o street.yaml {option}", code=2).output
    assert "is not a valid float" in output or "requires" in output


@pytest.mark.parametrize("option", ["--robot 1 2 inf", "--goal nan 0"])
def test_positions_are_finite(sonata2d: Run, here: Path, option: str) -> None:
    (here / "street.csv").write_text("frame,ped,x,y\n0,1,0,0\n1,1,1,0\n2,1,2,0\n3,1,3,0\n")
    output = sonata2d(f"scenarios from-tracks street.csv --frame-time 0.4 -o street.yaml {option}", code=1).output
    assert "finite number" in output


def test_quiet_prints_the_result_of_a_split(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 2 --workers 1 --no-picture")
    output = sonata2d("split out --parts train=0.5,test=0.5 --quiet").output
    assert [line.split() for line in output.splitlines()] == [
        [f"{part}:", "1", "episode"] for part in ("train", "test")
    ]
