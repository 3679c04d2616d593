"""What every command does when all is well."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from sonata2d_cli import main
from sonata2d_cli.main import COMMANDS

from sonata2d.datasets.generate import KEEPABLE

from .conftest import Run


def test_generate_leaves_episodes_manifest_card_picture_and_the_next_command(sonata2d: Run, here: Path) -> None:
    told = sonata2d("generate out --scenario quick.yaml --episodes 3 --seed 4 --workers 1").output
    names = {path.name for path in (here / "out").iterdir()}
    assert names == {
        "000000.json",
        "000001.json",
        "000002.json",
        "manifest.json",
        "scenario.json",
        "README.md",
        "preview.png",
        "run.jsonl",
    }
    assert "next:  " in told
    assert "render out/000000.json" in told
    manifest = json.loads((here / "out/manifest.json").read_text())
    assert manifest["complete"]
    assert [file["episode"] for file in manifest["files"]] == [0, 1, 2]
    assert sum(manifest["counts"]["outcome"].values()) == 3


@pytest.mark.parametrize("keep", ["", " --keep goal --keep timeout"])
def test_a_data_set_is_made_again_by_the_command_on_its_card(sonata2d: Run, here: Path, keep: str) -> None:
    sonata2d(f"generate out --scenario quick.yaml --episodes 2 --seed 9 --workers 1 --no-picture{keep}")
    card = (here / "out/README.md").read_text()
    command = next(line for line in card.splitlines() if line.startswith("sonata2d generate"))
    sonata2d(command.removeprefix("sonata2d ").replace("scenario.json", "out/scenario.json") + " --no-picture")
    for path in (here / "AGAIN").iterdir():
        assert path.name == "run.jsonl" or path.read_bytes() == (here / "out" / path.name).read_bytes()


def test_only_what_ended_as_asked_is_kept(sonata2d: Run) -> None:
    told = sonata2d(
        "generate out --scenario quick.yaml --controller straight-to-goal --keep timeout --episodes 2 --workers 1"
    )
    assert "outcomes   2 timeout" in told.output
    assert "left out" in told.output
    assert "kept are         timeout" in sonata2d("describe out").output
    assert f"--keep [{'|'.join(KEEPABLE)}]" in sonata2d("generate --help").output


def test_a_made_data_set_passes_every_check(sonata2d: Run) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 2 --workers 1 --compress zst --no-picture")
    assert "no problems" in sonata2d("check out --replay --rerun --workers 1").output
    assert "no problems" in sonata2d("check out/000001.json.zst --replay").output


def test_a_controller_from_the_users_own_file_drives_and_labels(sonata2d: Run, here: Path) -> None:
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
    sonata2d("check out --rerun --workers 1")


def test_describe_tells_of_data_sets_and_episodes(sonata2d: Run) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 2 --workers 1 --no-picture")
    assert "episodes         2 of 2" in sonata2d("describe out").output
    told = json.loads(sonata2d("describe out/000000.json --json").output)
    assert told["people"] == "4, 2 of them walking"
    assert told["labels"] == "the command itself"


def test_render_makes_pictures_and_pages(sonata2d: Run, here: Path) -> None:
    sonata2d("generate out --scenario quick.yaml --episodes 1 --workers 1 --no-picture")
    for name, start in (("a.png", b"\x89PNG"), ("b.html", b"<!"), ("c.gif", b"GIF8")):
        sonata2d(f"render out/000000.json -o {name} --zones --ids")
        assert (here / name).read_bytes().startswith(start)


def test_a_situation_is_checked_and_a_wrong_one_is_found(sonata2d: Run) -> None:
    right = sonata2d("scenarios check overtaking --episodes 2 --controller straight-to-goal").output
    assert "overtaking took place in 2 of 2 episodes of overtaking" in right
    told = sonata2d("scenarios check overtaking --situation blind-corner --episodes 1 --json", code=1).output
    assert json.loads(told)["took_place"] == 0
    unnamed = sonata2d("scenarios check quick.yaml --episodes 1", code=1).output
    assert "no situation is named 'quick'; say which it is with --situation NAME" in unnamed
    misnamed = sonata2d("scenarios check quick.yaml --situation overtakin", code=1).output
    assert "did you mean 'overtaking'?" in misnamed


def test_scenarios_can_be_listed_shown_drawn_and_used_again(sonata2d: Run, here: Path) -> None:
    assert "sonata-2020-crowded" in sonata2d("scenarios list").output
    shown = sonata2d("scenarios show sonata-2020").output
    (here / "again.yaml").write_text(shown)
    again = json.loads(sonata2d("scenarios show again.yaml --json").output)
    assert again == json.loads(sonata2d("scenarios show sonata-2020 --json").output)
    sonata2d("scenarios draw quick.yaml --scenes 2 -o quick.png")
    assert (here / "quick.png").stat().st_size > 2000


def test_controllers_are_listed(sonata2d: Run) -> None:
    names = [row["name"] for row in json.loads(sonata2d("controllers list --json").output)]
    assert names[:3] == ["straight-to-goal", "social-force", "social-planner"]


def test_doctor_finds_this_installation_well(sonata2d: Run) -> None:
    rows = {row["check"]: row for row in json.loads(sonata2d("doctor --json").output)}
    assert rows["trial episode"]["ok"] is True, rows["trial episode"]["found"]
    assert rows["writing"]["ok"] is True


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_an_example_in_its_help(command: str) -> None:
    words = {"scenarios": [command, "draw"], "controllers": [command, "list"]}.get(command, [command])
    told = CliRunner().invoke(main, [*words, "--help"]).output
    assert "Example" in told
    assert "--json" in told


def test_help_is_quick_because_it_loads_no_simulation() -> None:
    code = (
        "import sys; from sonata2d_cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: print({'pymunk', 'pydantic', 'pygame', 'yaml'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("set()\n")


def test_tracks_become_a_scenario_that_everything_takes(sonata2d: Run, here: Path) -> None:
    rows = [f"{frame},{ped},{(-1) ** ped * (0.5 * frame - 3.0)},{ped}" for frame in range(12) for ped in (1, 2)]
    (here / "street.csv").write_text("\n".join(["frame,ped,x,y", *rows]))
    made = sonata2d(
        "scenarios from-tracks street.csv --frame-time 0.4 --seconds 3 --robot 3,0,3.1 -o street.yaml"
    ).output
    assert "2 people, 2 of them replayed" in made
    mixed = "scenarios from-tracks street.csv --frame-time 0.4 --replay 2 --goal -2,0 -o mixed.json --json"
    assert json.loads(sonata2d(mixed).output) == {"scenario": "mixed.json", "people": 2, "replayed": 1, "walls": 0}
    sonata2d("scenarios draw street.yaml --scenes 1 -o street.png")
    sonata2d("generate out --scenario street.yaml --episodes 1 --workers 1 --no-picture")
    sonata2d("check out --replay --rerun --workers 1")
    sonata2d("evaluate out --metric all")
    told = sonata2d("describe out/000000.json").output
    assert "recorded people" in told
    for suffix in ("png", "svg", "html"):
        sonata2d(f"render out/000000.json -o picture.{suffix}")
    sonata2d("mirror out -o image")
    sonata2d("check image --replay --workers 1")


@pytest.mark.parametrize("words", ["--robot 1,2", "--robot 1,2,x", "--goal 1", "--goal nan,0"])
def test_places_are_numbers_with_commas(sonata2d: Run, here: Path, words: str) -> None:
    told = sonata2d(f"scenarios from-tracks street.csv {words} -o street.yaml", code=2).output
    assert "numbers with commas between" in told
