"""Controls: the defaults, the file in which a user changes them, and what the window shows of them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sonata2d.agents.controllers.teleoperation import DEFAULT_MAPPINGS, DeviceMapping
from sonata2d.collect.texts import choose_language, languages, table, text
from sonata2d.errors import ConfigError
from sonata2d.window.actions import Action
from sonata2d.window.key_texts import _KEYS, help_rows, keys_of
from sonata2d.window.profiles import (
    DEFAULT_PROFILES,
    FOLDER_VARIABLE,
    controls_file,
    read_profiles,
    write_default_controls,
)
from sonata2d.window.view_screen import _HELP

NOBODY: frozenset[Action] = frozenset()


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "new"))
    (tmp_path / "new").mkdir()
    return controls_file()


def test_the_defaults_read_back_as_they_were_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "new" / "folder"))
    assert read_profiles() == DEFAULT_PROFILES
    assert write_default_controls() == controls_file() == tmp_path / "new" / "folder" / "controls.toml"
    assert read_profiles() == DEFAULT_PROFILES


AHEAD, BACK, LEFT, RIGHT, BRAKE = ("ahead", 1.0), ("ahead", -1.0), ("turn", 1.0), ("turn", -1.0), ("brake", 1.0)
KEYS = {
    "w": AHEAD, "up": AHEAD, "s": BACK, "down": BACK, "a": LEFT, "left": LEFT, "d": RIGHT, "right": RIGHT,
    "q": ("left", 1.0), "e": ("left", -1.0), "space": BRAKE,
}  # fmt: skip
STICKS = {
    "left_y": BACK, "left_x": RIGHT, "right_x": ("left", -1.0), "axis1": BACK, "axis0": RIGHT, "left_shoulder": BRAKE,
}  # fmt: skip


def test_the_default_file_drives_as_recorded_runs_without_mappings_do() -> None:
    """Another value would change the replay of these runs, and another order the bytes of new ones."""
    assert {device: profile.mapping for device, profile in DEFAULT_PROFILES.items()} == DEFAULT_MAPPINGS
    assert [*DEFAULT_MAPPINGS] == ["keyboard", "mouse", "pad"]
    controls = {device: [*mapping.controls.items()] for device, mapping in DEFAULT_MAPPINGS.items()}
    assert controls == {
        "keyboard": [*KEYS.items()],
        "mouse": [("drag_y", BACK), ("drag_x", RIGHT)],
        "pad": [*STICKS.items()],
    }
    numbers = [(mapping.dead_zone, mapping.curve) for mapping in DEFAULT_MAPPINGS.values()]
    assert numbers == [(0.0, 0.0), (0.08, 0.0), (0.1, 0.3)]


def test_a_file_of_the_user_is_not_replaced(file: Path) -> None:
    file.write_text("# mine")
    with pytest.raises(ConfigError, match=r"controls\.toml exists; edit it, or delete it first"):
        write_default_controls()
    assert file.read_text() == "# mine"


def test_the_users_own_folder_is_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)
    assert (controls_file().name, controls_file().parent.name) == ("controls.toml", "sonata2d")


def test_a_table_replaces_the_default_one_and_others_stay(file: Path) -> None:
    file.write_text(
        """
        [keyboard.drive]
        i = "ahead"
        "page up" = "turn_left"
        [pad]
        dead_zone = 0.25
        [pads."Flight Stick"]
        curve = 0.5
        [pads."Flight Stick".drive]
        axis1 = "back"
        [pads."Flight Stick".actions]
        button9 = "undo"
        "-axis4" = "label_3"
        """
        '[keyboard.actions]\n"ctrl+k" = "pause"\n'
    )
    profiles = read_profiles()
    assert profiles["keyboard"].mapping == DeviceMapping({"i": ("ahead", 1.0), "page up": ("turn", 1.0)})
    assert profiles["keyboard"].actions == {"escape": Action.MENU, "ctrl+k": Action.PAUSE}
    assert profiles["mouse"] == DEFAULT_PROFILES["mouse"]
    default = DEFAULT_PROFILES["pad"]
    assert profiles["pad"].mapping == DeviceMapping(default.mapping.controls, 0.25, default.mapping.curve)
    assert profiles["pad"].actions == default.actions
    stick = profiles["pads.Flight Stick"]
    assert stick.mapping == DeviceMapping({"axis1": ("ahead", -1.0)}, 0.25, 0.5)
    assert stick.actions == {"button9": Action.UNDO, "-axis4": Action.LABEL_3}


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("[keyboard", "Expected ']'"),
        ("x = 3", "unknown key 'x'; keys are keyboard, mouse, pad, pads"),
        ("[keybord.drive]", "unknown key 'keybord'; did you mean 'keyboard'?"),
        ("[pad]\ndead_zone = 2", r"pad\.dead_zone: Input should be less than or equal to 1 \(got 2\)"),
        ('[keyboard.drive]\nw = "ahed"', r"keyboard\.drive\.w: .* \(got 'ahed'\); did you mean 'ahead'\?"),
        ('[keyboard.drive]\nuparrow = "ahead"', r"keyboard\.drive\.uparrow: no key has this name"),
        ('[keyboard.drive]\nW = "ahead"', r"keyboard\.drive\.W: no key has this name"),
        ('[keyboard.actions]\nescape = "quit"', "this key has a fixed use"),
        ('[mouse.actions]\nwheelup = "redo"', "no such control; did you mean 'wheel_up'"),
        ('[pad.actions]\n"-left_z" = "redo"', "no such control; did you mean 'left_y'"),
        ('[pad.actions]\na = "unddo"', r"pad\.actions\.a: Input should be 'confirm', .* \(got 'unddo'\)"),
        ('[pads.Stick.drive]\nbutton = "brake"', r"pads\.Stick\.drive\.button: there is no such control"),
        ('[keyboard.drive]\nn = "ahead"', r"keyboard: 'n' drives \(ahead\) and requests 'next'; list it in one"),
        ("[[pads]]", "pads"),
    ],
)
def test_a_wrong_file_is_refused_with_file_key_and_remedy(content: str, problem: str, file: Path) -> None:
    file.write_text(content)
    with pytest.raises(ConfigError, match=problem) as error:
        read_profiles()
    assert str(error.value).startswith(f"{file}: ")
    assert str(error.value).endswith("(correct the file, or delete it to use the default controls)")


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"a = " + b"[" * 100_000])
def test_a_damaged_file_is_an_error(content: bytes, file: Path) -> None:
    file.write_bytes(content)
    with pytest.raises(ConfigError, match=r"controls\.toml"):
        read_profiles()


def test_the_window_names_changed_controls_as_the_file_does(file: Path) -> None:
    defaults = help_rows(DEFAULT_PROFILES, NOBODY)
    assert {("P, pad Start", "pause"), ("Space", "brake"), ("W S or up, down", "drive ahead, back")} <= {*defaults}
    file.write_text('[keyboard.drive]\ni = "ahead"\nk = "back"\n[pad.actions]\nguide = "pause"\n')
    profiles = read_profiles()
    changed = {("i, k", "drive ahead, back"), ("–", "turn"), ("–", "brake"), ("p, pad guide", "pause")}
    assert changed | {("Z", "personal space"), ("Left stick", "drive and turn")} <= {*help_rows(profiles, NOBODY)}
    assert keys_of("driving", profiles, NOBODY)[:3] == (("i, k", "drive"), ("Enter", "end the run"), ("P", "pause"))


@pytest.mark.parametrize("language", languages())
def test_every_key_and_its_meaning_have_words_in_every_language(language: str) -> None:
    """The help of runs and of recordings, and the keys along the lower edge, show no name of a text."""
    choose_language(language)
    try:
        rows = [*help_rows(DEFAULT_PROFILES, NOBODY), *((text_of(key), text_of(meaning)) for key, meaning in _HELP)]
        for state in _KEYS:
            rows += keys_of(state, DEFAULT_PROFILES, NOBODY)
    finally:
        choose_language("en")
    names = table(language)
    assert [word for row in rows for word in row if not word or re.fullmatch(r"[a-z]+\.\w+", word)] == []
    missing = {name for name in table("en") if not names.get(name)}
    assert missing == set()


def text_of(key: str) -> str:
    return text(key) if re.fullmatch(r"[a-z]+\.\w+", key) else key


def test_hidden_actions_have_no_row() -> None:
    hidden = frozenset({Action.SCENE})
    assert len(help_rows(DEFAULT_PROFILES, hidden)) == len(help_rows(DEFAULT_PROFILES, NOBODY)) - 1
    assert ("G", "scene") not in keys_of("waiting", DEFAULT_PROFILES, hidden)
