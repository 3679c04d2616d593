"""Loading scenarios from presets and files; errors name file, line, key and value."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import nullcontext
from itertools import pairwise
from pathlib import Path

import pytest

import sonata2d as s2
from sonata2d.errors import ConfigError
from sonata2d.scenegen.generator import generate
from sonata2d.scenegen.scenario import parse
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.load import load_scenario, scenario_names


@pytest.fixture
def write_scenario(tmp_path):
    """A function that writes a scenario file and returns its path."""

    def write(text: str, name: str = "office.yaml") -> str:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


def test_the_preset_sonata_2020_equals_the_defaults():
    assert load_scenario("sonata-2020").model_copy(update={"description": ""}) == ScenarioConfig()


@pytest.mark.parametrize("name", scenario_names())
def test_every_preset_has_a_description_and_generates_scenes(name):
    assert scenario_names()[name]
    assert load_scenario(name).name == name
    assert [generate(load_scenario(name), seed).name for seed in range(5)] == [name] * 5


def test_the_crowded_preset_has_the_counts_of_the_original_dialog():
    settings = load_scenario("sonata-2020-crowded").settings()
    counts = {key: settings[key] for key in ("standing", "wandering", "plants", "tables", "relations", "drop")}
    assert counts == {
        "standing": [0, 10], "wandering": [0, 8], "plants": [0, 6], "tables": [0, 5], "relations": [0, 8], "drop": True
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("lab.yaml", "tables: [1, 2]\nroom: {kinds: square}\n"),
        ("lab.yml", "tables: {min: 1, max: 2}\nroom:\n  kinds: {square: 2}\n"),
        ("lab.json", '{"tables": [1, 2],\n\t"room": {"kinds": ["square"]}}'),
        ("lab.toml", 'tables = [1, 2]\n[room]\nkinds = "square"\n'),
    ],
)
def test_a_scenario_may_be_yaml_json_or_toml(write_scenario, name, text):
    config = load_scenario(write_scenario(text, name))
    assert config.name == "lab"
    assert config.settings()["tables"] == [1, 2]
    assert list(config.room.kinds) == ["square"]


def test_a_file_changes_only_some_settings_of_the_scenario_it_extends(write_scenario):
    write_scenario("extends: sonata-2020-crowded\nrobot: {radius: 0.4}\nplants: 1\n", "base.yaml")
    config = load_scenario(write_scenario("extends: base.yaml\nrobot: {kinematics: unicycle}\nhumans: 3\n"))
    assert (config.name, config.description) == ("office", "")
    assert (config.robot.radius, config.robot.kinematics, config.drop) == (0.4, "unicycle", True)
    assert (config.settings()["plants"], config.settings()["humans"], config.standing) == (1, 3, None)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("drop: true\n\ntabels: 3\n", "office.yaml, line 3: tabels: unknown key 'tabels'; did you mean 'tables'?"),
        ("room:\n  sidee: 5\n", "office.yaml, line 2: room.sidee: unknown key 'sidee'; did you mean 'side'?"),
        ("room:\n  side: [9, 5]\n", "office.yaml, line 2: room.side: min 9 is above max 5 (got [9, 5])"),
        ("drop: perhaps\n", "office.yaml, line 1: drop: Input should be a valid boolean, unable to interpret input"
         " (got 'perhaps')"),
        ("furniture:\n- {type: tv, x: 1, y: 2}\n- type: tabel\n  x: 1\n  y: 2\n",
         "office.yaml, line 3: furniture.1.type: furniture of unknown type needs a size; did you mean 'table'?"
         " (got 'tabel')"),
        ("furniture:\n- type: table\n  x: 1\n", "office.yaml, line 2: furniture.0.y: Field required"),
        ("standing: 1\nhumans: 3\n", "office.yaml, line 2: humans: give humans, or standing and wandering, not both"
         " (got 3)"),
        ("sizes:\n  sofa: [1, -2]\n", "office.yaml, line 2: sizes.sofa: Input should be a valid number (got [1, -2])"),
        ("room: {side: 5\n", "office.yaml, line 2: expected ',' or '}', but got '<stream end>'"),
        ("- 1\n", "office.yaml: a scenario is a mapping of settings, not list"),
        ("", "office.yaml: a scenario is a mapping of settings, not NoneType"),
        ("tables: 1\nextends: sonata-2021\n", "office.yaml, line 2: extends: no scenario file or preset 'sonata-2021'; "
         "did you mean 'sonata-2020'?"),
        ("extends: office.yaml\n", "office.yaml, line 1: extends: office.yaml extends itself"),
    ],
)  # fmt: skip
def test_an_error_is_one_line_that_names_file_line_key_and_value(write_scenario, text, message):
    with pytest.raises(ConfigError) as error:
        load_scenario(write_scenario(text))
    assert str(error.value) == message


def test_errors_in_json_and_toml_name_line_and_key_where_known(write_scenario):
    with pytest.raises(ConfigError, match=r"^a\.json, line 2: room\.kinds\.sqare: "):
        load_scenario(write_scenario('{"room": {"kinds":\n {"sqare": 1}}}', "a.json"))
    with pytest.raises(ConfigError, match=r"^a\.json, line 2: Expecting ',' delimiter"):
        load_scenario(write_scenario('{"room": {"kinds":\n {"square": 1}', "a.json"))
    with pytest.raises(ConfigError, match=r"^b\.toml: room\.side: "):
        load_scenario(write_scenario('[room]\nside = "x"', "b.toml"))
    with pytest.raises(ConfigError, match=r"^b\.toml: Invalid value"):
        load_scenario(write_scenario("[room]\nside = ", "b.toml"))


def test_an_unknown_preset_or_file_is_an_error_with_a_suggestion(write_scenario):
    with pytest.raises(ConfigError, match="no scenario file or preset 'sonata2020'; did you mean 'sonata-2020'"):
        load_scenario("sonata2020")
    with pytest.raises(ConfigError, match=r"presets are accompanying, .*, empty, .*, sonata-2020, sonata-2020-crowded"):
        load_scenario("xyz")
    path = write_scenario("tables: 1\n")
    with pytest.raises(ConfigError, match=r"did you mean '.*office\.yaml'"):
        load_scenario(path[:-5] + ".yml")


def test_yaml_is_loaded_only_when_a_scenario_is_read():
    code = "import sys, sonata2d.scenegen; sys.exit('yaml' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{this}: &{this} [{', '.join([f'*{last}'] * 10)}]\n" for last, this in pairwise("abcdefgh")
)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("x.yaml", BOMB, "aliases repeat more than 1000000 values"),
        ("x.yaml", "a: &a [*a]\n", "aliases repeat more than 1000000 values"),
        ("x.yaml", "a: " + "[" * 3000, "line 1: values are nested more than 32 deep"),
        ("x.yaml", "a:" + "".join(f"\n{' ' * k}b:" for k in range(1, 60)) + " 1", "nested more than 32 deep"),
        ("x.yaml", "standing: 1\ntables: 2\nstanding: 3\n", "line 3: the key 'standing' is given twice"),
        ("x.yaml", "rules:\n  time_limit: 1\n  time_limit: 2\n", "line 3: the key 'time_limit' is given twice"),
        ("x.yaml", "a: \x07\n", "special characters are not allowed"),
        ("x.json", '{"a": ' + "[" * 3000 + "]" * 3000 + "}", "nested"),
        ("x.json", '{"a": ' + "[" * 300_000, "nested too deeply"),
        ("x.json", '{"rules": {"time_limit": 1, "time_limit": 2}}', "the key 'time_limit' is given twice"),
        ("x.toml", "a = " + "[" * 3000 + "]" * 3000, "nested"),
        ("x.yaml", f"extends: {'a' * 5000}", "no scenario file or preset 'aaa.*: File name too long"),
        ("x.toml", "a = 1\na = 2", "Cannot overwrite a value"),
        ("x.toml", ".".join("a" * 10_000) + " = 1", "nested more than 32 deep"),
        ("x.toml", ".".join("a" * 100_000) + " = 1", r"has more than 50000 bytes, the limit .* write it as \.json"),
        ("x.toml", "\n".join(f"a{k} = 1" for k in range(2000)), "a mapping has more than 1000 keys"),
        ("x.yaml", "\n".join(f"a{k}: 1" for k in range(100_000)), "line 1002: a mapping has more than 1000 keys"),
        ("x.json", json.dumps(dict.fromkeys(map(str, range(500_000)))), "a mapping has more than 1000 keys"),
        (
            "x.yaml",
            "# " + "x" * 2_000_000,
            r"has more than 2000000 bytes, the limit for such files; write it as \.json",
        ),
        ("x.yaml", "name: " + "x" * 100_000, "line 1: name: String should have at most 255 characters"),
    ],
)
def test_a_file_beyond_the_limits_is_one_clear_error(write_scenario, name, text, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load_scenario(write_scenario(text, name))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(("groups", "is_valid"), [(0, False), (1, False), (2, True)])
def test_places_without_a_group_are_an_error(write_scenario, groups, is_valid):
    path = write_scenario(f"talking_groups: {groups}\ngroups:\n  places: [[2, 1], [-2, 1]]\n", "x.yaml")
    with nullcontext() if is_valid else pytest.raises(ConfigError, match=f"line 3: .* 2 places for at most {groups}"):
        load_scenario(path)


def test_a_rectangle_that_cannot_be_as_long_as_broad_is_an_error(write_scenario):
    with pytest.raises(ConfigError, match=r"line 3: room\.length: no length up to 8 m is at least the breadth, 9 m"):
        load_scenario(write_scenario("room:\n  kinds: rectangle\n  length: 8\n  breadth: 9\n"))
    load_scenario(write_scenario("room: {kinds: l, length: 8, breadth: 9}"))


def test_further_mistakes_are_named_by_their_keys(write_scenario):
    with pytest.raises(ConfigError, match=r"min 9 is above max 5 \(got \[9, 5\]\) \(and more in rules, standing\)"):
        load_scenario(write_scenario("standing: [4, 1]\nrules: {time_limi: 3}\nroom: {side: [9, 5]}"))


@pytest.mark.skipif(not Path("/dev/fd").exists(), reason="needs the pipes of a shell")
def test_a_scenario_is_read_from_the_pipe_of_a_shell():
    reader, writer = os.pipe()
    os.write(writer, b"wandering: 7")
    os.close(writer)
    assert load_scenario(f"/dev/fd/{reader}").wandering.max == 7
    os.close(reader)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_named_pipe_is_no_scenario_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "x.yaml")
    with pytest.raises(ConfigError, match=r"x\.yaml is a device or a named pipe, not a scenario file"):
        load_scenario(tmp_path / "x.yaml")


def test_a_file_that_is_too_large_is_not_parsed(write_scenario, monkeypatch):
    monkeypatch.setattr(parse, "MAX_YAML_BYTES", 100)
    with pytest.raises(ConfigError, match="it has more than 100 bytes"):
        load_scenario(write_scenario("#" * 200 + "\n\n"))


def test_aliases_and_merge_keys_within_the_limits_are_read(write_scenario):
    text = "name: &n kept\ndescription: *n\nrules: {<<: {time_limit: 7, substeps: 4}, substeps: 5}\n"
    loaded = load_scenario(write_scenario(text))
    assert (loaded.description, loaded.rules.time_limit, loaded.rules.substeps) == ("kept", 7.0, 5)


@pytest.mark.parametrize("name", ["half.json", "half.yaml"])
def test_text_that_is_no_unicode_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text('{"room": {"kinds": "\\ud800"}}')
    with pytest.raises(ConfigError, match=f"{name}: .*surrogates not allowed"):
        load_scenario(tmp_path / name)


@pytest.mark.parametrize(
    "text", ["furniture: [{}]", "people: [{}]", "room: {{walls: [{}]}}", "groups: {{places: [{}]}}"]
)
def test_of_a_list_with_many_faults_the_first_is_reported(write_scenario, text):
    faults = ", ".join(["{zz: 1}"] * 100)
    with pytest.raises(ConfigError) as caught:
        load_scenario(write_scenario(text.format(faults)))
    assert ".0" in str(caught.value)
    assert "more)" not in str(caught.value)


def test_lists_have_a_maximum_length():
    with pytest.raises(ConfigError, match="at most 10000"):
        ScenarioConfig(room={"walls": [(0.0, 0.0, 1.0, 1.0)] * 10_001})


def test_a_controller_in_the_place_of_the_scenario_is_pointed_out(tmp_path):
    with pytest.raises(TypeError, match=r"a scenario is .*; write controller=\.\.\."):
        s2.generate_dataset(tmp_path / "out", s2.Orca)
