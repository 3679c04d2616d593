"""The template plug-in package works as its README says, in an environment of its own."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import sonata2d as s2

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "examples" / "plugin"
BLOCK = re.compile(r"^```(\w+)(?: file=(\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment variables of a process in which the template package is installed."""
    source, target = (tmp_path_factory.mktemp("plugin") / name for name in ("source", "target"))
    shutil.copytree(PLUGIN, source)  # setuptools builds inside the source folder
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--target", str(target), str(source)], check=True)
    paths = [str(target), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of two short episodes, which needs no plug-in."""
    folder = tmp_path_factory.mktemp("runs") / "out"
    s2.generate_dataset(folder, "empty", "straight-to-goal", episodes=2)
    return folder


def sonata2d(words: list[str], env: dict[str, str], cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sonata2d_cli", *words], env=env, cwd=cwd, capture_output=True, text=True, check=False
    )


def test_the_plug_ins_work_as_the_readme_says(installed: dict[str, str], tmp_path: Path) -> None:
    outputs = {}
    for language, file, text in BLOCK.findall((PLUGIN / "README.md").read_text()):
        if file:
            (tmp_path / file).write_text(text)
        for line in text.splitlines() if language == "sh" else ():
            program, *words = shlex.split(line)
            if program == "sonata2d":
                done = sonata2d(words, installed, tmp_path)
                assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
                outputs[words[0]] = done.stdout
    assert "cautious" in outputs["controllers"]
    assert "mean_speed" in outputs["evaluate"]
    assert "demographics  answers: first\n" in outputs["study"]
    episode = json.loads((tmp_path / "hexagons" / "000000.json").read_bytes())
    assert len(episode["room"]["polygon"]) == 6
    assert {human["model"] for human in episode["humans"]} == {"circular"}
    assert episode["controller"]["path"] == "cautious"
    assert episode["robot"]["kinematics"] == "gentle"
    assert episode["robot"]["drive"]["lateral_acceleration"] == 0.5
    assert episode["sensors"] == [{"name": "bumper", "type": "bumper", "settings": {"rate": None, "latency": 0.0}}]
    assert {type(frame["sensors"]["bumper"]) for frame in episode["frames"]} == {bool}
    settees = [thing for thing in episode["objects"] if thing["type"] == "settee"]
    assert settees
    assert all(thing["seat"] and thing["shape"]["length"] == 1.8 for thing in settees)
    seats = {human["seat"] for human in episode["humans"] if human["seat"] is not None}
    assert seats
    assert seats <= {thing["id"] for thing in settees}
    assert episode["settings"]["settees"] == [1, 2]
    assert (tmp_path / "hexagon.png").is_file()
    rows = (tmp_path / "paths" / "000000.robot.csv").read_text().splitlines()
    assert rows[0] == "time,x,y,theta"
    assert len(rows) == len(episode["frames"]) + 1


def test_the_observation_part_is_observed(installed: dict[str, str], tmp_path: Path) -> None:
    pytest.importorskip("gymnasium")
    code = (
        "import sonata2d.gym as g; e = g.SocialNavEnv('lively', parts=['crowding']); o, _ = e.reset(seed=2); "
        "rows = o['humans'][o['humans_mask'] > 0, :2]; "
        "assert o['crowding'].tolist() == [((rows ** 2).sum(axis=1) < 4.0).sum()], o['crowding']"
    )
    done = subprocess.run([sys.executable, "-c", code], env=installed, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_episodes_with_plug_ins_replay_and_rerun_to_the_bit(installed: dict[str, str], tmp_path: Path) -> None:
    scenario = "extends: sonata-2020\nroom: {kinds: hexagon}\nperson: {model: circular}\nrules: {time_limit: 4}\n"
    (tmp_path / "quick.yaml").write_text(scenario)
    words = ["generate", "out", "--scenario", "quick.yaml", "--controller", "cautious", "--episodes", "2"]
    assert sonata2d([*words, "--no-picture", "--workers", "2"], installed, tmp_path).returncode == 0
    done = sonata2d(["check", "out", "--replay", "--rerun", "--workers", "1"], installed, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert sonata2d(["mirror", "out", "-o", "mirrored"], installed, tmp_path).returncode == 0
    done = sonata2d(["check", "mirrored", "--replay", "--workers", "1"], installed, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


NUMPY_MODEL = """
import numpy as np
from sonata2d.core.portable_math import exp

def total(push, x, y):
    return np.stack((np.add.reduce(push * x, axis=0), np.add.reduce(push * y, axis=0)), axis=1)

class Circular:
    evaluations, headed = 1, False

    def __init__(self, scene):
        self.barriers = scene.barriers

    def acceleration(self, w):
        i = np.repeat(np.arange(len(w.position)), np.diff(w.neighbour_start))
        j, attention = w.neighbour[: len(i)], w.attention[: len(i)]
        offset = w.position[i] - w.position[j]
        distance = np.maximum(np.sqrt(offset[:, 0] * offset[:, 0] + offset[:, 1] * offset[:, 1]), 1e-6)
        gap = np.maximum(distance - (w.radius[i] + w.radius[j]), 0.0)
        push = 3.0 * exp(-gap / 0.3) / distance
        others = np.zeros_like(w.position)
        np.add.at(others, i, attention[:, None] * (push[:, None] * offset))  # one by one, in ascending order
        drive = (w.desired_direction * w.desired_speed[:, None] - w.velocity) / 0.5
        wall_x, wall_y = self.barriers.towards(w.position)
        distance = np.maximum(np.sqrt(wall_x * wall_x + wall_y * wall_y), 1e-6)
        gap = np.maximum(distance - self.barriers.radius[:, None] - w.radius, 0.0)
        is_near = np.zeros(gap.shape, dtype=bool)
        k = np.repeat(np.arange(len(w.position)), np.diff(w.wall_start))
        is_near[w.wall[: len(k)], k] = True
        wall = np.where(is_near, exp(gap * (-1.0 / 0.1)) * -3.0 / distance, 0.0)
        return others + drive + total(wall, wall_x, wall_y)
"""


def test_a_pedestrian_model_in_plain_numpy_moves_people_as_its_kernel_does(
    installed: dict[str, str], tmp_path: Path
) -> None:
    info = tmp_path / "numpy_model-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: numpy-model\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[sonata2d.pedestrian_models]\nplain = numpy_model:Circular\n")
    (tmp_path / "numpy_model.py").write_text(NUMPY_MODEL)
    env = installed | {"PYTHONPATH": os.pathsep.join([installed["PYTHONPATH"], str(tmp_path)])}
    frames = {}
    for name in ("plain", "circular"):
        scenario = f"extends: sonata-2020\nwandering: 4\nperson: {{model: {name}}}\nrules: {{time_limit: 4}}\n"
        (tmp_path / f"{name}.yaml").write_text(scenario)
        words = ["generate", name, "--scenario", f"{name}.yaml", "--controller", "cautious", "--episodes", "1"]
        done = sonata2d([*words, "--no-picture"], env, tmp_path)
        assert done.returncode == 0, done.stderr
        frames[name] = json.loads((tmp_path / name / "000000.json").read_bytes())["frames"]
    assert frames["plain"] == frames["circular"]


def test_a_broken_plug_in_is_named_and_skipped(installed: dict[str, str], tmp_path: Path) -> None:
    broken = tmp_path / "broken-1.0.dist-info"
    broken.mkdir()
    (broken / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    points = "[sonata2d.controllers]\nlost = no_such_module:Lost\norca = no_such_module:Orca\n"
    (broken / "entry_points.txt").write_text(points + "[sonata2d.metrics]\nwrong = math:pi\n")
    env = installed | {"PYTHONPATH": os.pathsep.join([installed["PYTHONPATH"], str(tmp_path)])}
    done = sonata2d(["controllers"], env, tmp_path)
    assert done.returncode == 0
    assert "cautious" in done.stdout
    assert "lost" not in done.stdout
    assert "Warning: controller plug-in 'lost' (no_such_module:Lost) does not load" in done.stderr
    assert "Warning: controller plug-in 'orca' (no_such_module:Orca) is skipped: the name is taken" in done.stderr
    done = sonata2d(["generate", "out", "--controller", "lost"], env, tmp_path)
    assert done.returncode == 1
    assert "Error: ControllerError: controller plug-in 'lost' (no_such_module:Lost) does not load" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_metric_plug_in_cannot_replace_a_built_in_metric(
    installed: dict[str, str], runs: Path, tmp_path: Path
) -> None:
    info = tmp_path / "metrics-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: metrics\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[sonata2d.metrics]\nsuccess = mine:success\nother = mine:success\n")
    source = "from sonata2d.metrics import metric\n@metric('m', 'less', needs=())\ndef success(t): return 7.0\n"
    (tmp_path / "mine.py").write_text(source)
    env = installed | {"PYTHONPATH": os.pathsep.join([installed["PYTHONPATH"], str(tmp_path)])}
    done = sonata2d(["evaluate", str(runs), "--metric", "success", "--workers", "1"], env, tmp_path)
    assert "7.0" not in done.stdout
    assert "metric plug-in 'success' is skipped: the name is taken" in done.stderr
    assert "metric plug-in 'other' is skipped: its metric is named 'success'" in done.stderr


def package(folder: Path, entry_points: str, source: str) -> None:
    """Write an installed package `mine`, with one module."""
    info = folder / "mine-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(entry_points)
    (folder / "mine.py").write_text(source)


def test_doctor_lists_each_plug_in_with_its_package_and_whether_it_loads(
    installed: dict[str, str], tmp_path: Path
) -> None:
    package(tmp_path, "[sonata2d.controllers]\nlost = no_such_module:Lost\norca = mine:Orca\n", "")
    env = installed | {"PYTHONPATH": os.pathsep.join([installed["PYTHONPATH"], str(tmp_path)])}
    done = sonata2d(["doctor", "--json"], env, tmp_path)
    assert done.returncode == 1
    rows = {row["check"]: row for row in json.loads(done.stdout)}
    for name in (
        "controller cautious",
        "pedestrian model circular",
        "drive gentle",
        "sensor bumper",
        "format robot-csv",
        "metric mean_speed",
        "observation part crowding",
        "furniture type settee",
    ):
        assert rows[name]["ok"] is True
        assert rows[name]["found"].startswith("plug-in of sonata2d-example-plugin 0.1.0: ")
    assert rows["controller lost"]["ok"] is False
    assert "plug-in of mine 1.0: " in rows["controller lost"]["found"]
    assert "ModuleNotFoundError" in rows["controller lost"]["found"]
    assert "the name is taken" in rows["controller orca"]["found"]


def test_episodes_of_a_plug_in_that_is_not_installed_say_what_to_install(
    installed: dict[str, str], tmp_path: Path
) -> None:
    scenario = "extends: sonata-2020\nperson: {model: circular}\nwandering: 3\nrules: {time_limit: 2}\n"
    (tmp_path / "quick.yaml").write_text(scenario)
    words = ["generate", "out", "--scenario", "quick.yaml", "--controller", "cautious", "--episodes", "1"]
    assert sonata2d([*words, "--no-picture"], installed, tmp_path).returncode == 0
    env = {name: value for name, value in installed.items() if name != "PYTHONPATH"}
    env |= {"PYTHONPATH": os.environ["PYTHONPATH"]} if "PYTHONPATH" in os.environ else {}
    done = sonata2d(["evaluate", "out", "--workers", "1"], env, tmp_path)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1
    assert line.startswith(
        "Error: MetricError: out/000000.json cannot be run without the robot: no pedestrian model is"
    )
    assert "install the package that provides it" in line
    assert sonata2d(["evaluate", "out", "--no-rerun", "--workers", "1"], env, tmp_path).returncode == 0
    problem, summary = sonata2d(["check", "out", "--replay", "--workers", "1"], env, tmp_path).stdout.splitlines()
    assert problem.startswith("000000.json: settings: they give no scene: person.model: no pedestrian model is named")
    assert summary == "out: 1 file checked, replayed, 1 problem"
    problem, _ = sonata2d(["check", "out", "--rerun", "--workers", "1"], env, tmp_path).stdout.splitlines()
    assert problem.endswith("nor a plug-in of an installed package; install the package that provides it")


@pytest.mark.parametrize("workers", ["1", "2"])
def test_a_metric_that_raises_is_named_with_the_file_and_a_broken_one_once(
    installed: dict[str, str], runs: Path, tmp_path: Path, workers: str
) -> None:
    source = "from sonata2d.metrics import Metric\ndef fail(t): raise KeyError('x')\n"
    source += "RAISING = Metric('raising', 'm', 'less', '', '', fail, needs=())\n"
    package(tmp_path, "[sonata2d.metrics]\nraising = mine:RAISING\nwrong = math:pi\n", source)
    env = installed | {"PYTHONPATH": os.pathsep.join([installed["PYTHONPATH"], str(tmp_path)])}
    done = sonata2d(["evaluate", str(runs), "--workers", workers], env, tmp_path)
    assert done.returncode == 1
    warning, error = done.stderr.splitlines()
    assert warning.startswith("Warning: metric plug-in 'wrong' (math:pi) is not a Metric")
    assert error == f"Error: MetricError: metric 'raising' of {runs}/000000.json: KeyError: 'x'"


DATE = """
from sonata2d.study.questions import question_kind
settings = {"kind": "calendar_date", "name": "first", "question": "Since"}
settings |= {"earliest": "2000-01-01", "latest": "2026-12-31"}
question = question_kind("calendar_date").model_validate(settings)
print(question.check("2026-05-17"), question.content("en")["latest"])
for answer in ("1999-12-31", "2027-01-01", "yesterday", 7):
    try:
        question.check(answer)
    except ValueError as error:
        print(error)
"""


def test_a_question_kind_of_a_plug_in_checks_answers(installed: dict[str, str], tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", DATE], env=installed, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [
        "2026-05-17 2026-12-31",
        "first is '1999-12-31'; a date from 2000-01-01 on is expected",
        "first is '2027-01-01'; a date up to 2026-12-31 is expected",
        "first is 'yesterday'; a date such as 2026-05-17 is expected",
        "first is 7; a date such as 2026-05-17 is expected",
    ]
    ratings = "ratings: [{name: seen, folder: ., question: {name: seen, kind: calendar_date, question: Since when}}]\n"
    (tmp_path / "study.yaml").write_text(f"title: Dates\n{ratings}")
    done = sonata2d(["study", "check", "study.yaml"], installed, tmp_path)
    assert done.returncode == 1
    message = "runs are rated with yes_no, classes, slider or text (got 'calendar_date')"
    assert f"ratings.0.question.kind: {message}" in done.stderr
