"""Profiles and choices persist between sessions, and damaged files are set aside."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sonata2d.agents.controllers.teleoperation import DeviceMapping
from sonata2d.window.actions import Action
from sonata2d.window.profiles import FOLDER_VARIABLE, Profile, Profiles, config_folder

MINE = Profile(DeviceMapping({"axis4": ("ahead", -0.5)}, 0.2, 0.7), {"button9": Action.UNDO, "-axis1": Action.LABEL_3})


def test_profiles_read_back_as_they_were_saved(tmp_path: Path) -> None:
    profiles = Profiles(tmp_path / "new" / "folder")
    profiles.put("guid", MINE)
    assert profiles.save()
    again = Profiles(tmp_path / "new" / "folder")
    assert again.of("guid") == MINE
    assert again.of("keyboard") == Profile.default("keyboard")


def test_a_file_of_version_0_1_0_is_read(tmp_path: Path) -> None:
    (tmp_path / "devices.json").write_text(
        '{"devices": {"guid": {"actions": {"-axis1": "label_3", "button9": "undo"},'
        ' "hand": {"controls": {"axis4": ["ahead", -0.5]}, "curve": 0.7, "dead_zone": 0.2}}}}'
    )
    profiles = Profiles(tmp_path)
    assert (profiles.of("guid"), profiles.notice) == (MINE, "")


def test_saving_replaces_the_file_and_leaves_no_other(tmp_path: Path) -> None:
    for _ in range(2):
        Profiles(tmp_path).save()
    assert [path.name for path in tmp_path.iterdir()] == ["devices.json"]


UNKNOWN_AXIS = {
    "devices": {"guid": {"hand": {"controls": {"a": ["fly", 1]}, "dead_zone": 0, "curve": 0}, "actions": {}}}
}


@pytest.mark.parametrize(
    "content",
    [
        b"", b"{", b"\xff\xfe\x00", b"[1, 2]", b'{"devices": 3}', b'{"devices": {"guid": 3}}',
        b'{"devices": {"guid": {"hand": {}, "actions": {}}}}', json.dumps(UNKNOWN_AXIS).encode(),
        b'{"devices": {"guid": {"hand": {"controls": {}, "dead_zone": "x", "curve": 0}, "actions": {}}}}',
        b'{"devices": {"guid": {"hand": {"controls": {}, "dead_zone": 0, "curve": 0}, "actions": {"a": "dance"}}}}',
        b"[" * 100_000,
    ],
)  # fmt: skip
def test_a_damaged_file_is_set_aside_and_gives_defaults(
    content: bytes, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "devices.json").write_bytes(content)
    profiles = Profiles(tmp_path)
    assert profiles.of("guid") == Profile.default("guid")
    assert (tmp_path / "devices.json.damaged").read_bytes() == content
    assert "devices.json" in caplog.text
    assert profiles.save()
    assert profiles.notice == ""


def test_a_folder_that_cannot_be_written_gives_a_notice(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    profiles = Profiles(tmp_path / "file" / "folder")
    assert not profiles.save()
    assert "cannot be written" in profiles.notice
    assert FOLDER_VARIABLE in profiles.notice


def test_a_variable_names_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    assert config_folder() == tmp_path


def test_the_users_own_folder_is_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)
    assert config_folder().name == "sonata2d"
