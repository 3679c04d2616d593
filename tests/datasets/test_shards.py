"""Data sets in shards have the same episodes as those in files, and every command reads them."""

from __future__ import annotations

import gzip
import io
import json
import os
import signal
import subprocess
import sys
import tarfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import orjson
import pytest
from click.testing import CliRunner
from sonata2d_cli import main

import sonata2d as s2
from sonata2d.datasets import merge_datasets, mirror_dataset, read_manifest, split_dataset, verify, write_card
from sonata2d.datasets.generate import batches
from sonata2d.errors import RecordError
from sonata2d.formats.api import export_to, import_from
from sonata2d.record.files import read_bytes, read_stored
from sonata2d.record.shard_file import ShardWriter

from .test_generate import QUICK, contents

pytestmark = pytest.mark.usefixtures("kept_processes")

SETTINGS: dict[str, Any] = {"episodes": 25, "seed": 5}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data set as files."""
    out = tmp_path_factory.mktemp("sets") / "plain"
    s2.generate_dataset(out, QUICK, "straight-to-goal", **SETTINGS)
    return out


@pytest.fixture(scope="module")
def sharded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same data set in shards of ten episodes."""
    out = tmp_path_factory.mktemp("sets") / "sharded"
    s2.generate_dataset(out, QUICK, "straight-to-goal", shard_size=10, **SETTINGS)
    return out


def members(folder: Path) -> dict[str, bytes]:
    """The episodes in the shards of a folder by name, as any program reads them."""
    found = {}
    for path in sorted(folder.glob("*.tar")):
        with tarfile.open(path) as archive:
            for member in archive:
                file = archive.extractfile(member)
                assert file is not None
                found[member.name] = file.read()
    return found


def test_shards_hold_the_same_bytes_as_files(plain: Path, sharded: Path) -> None:
    expected = {name: data for name, data in contents(plain).items() if name.startswith("0")}
    assert members(sharded) == expected
    names = [path.name for path in sorted(sharded.glob("shard-*"))]
    assert names[:3] == ["shard-000000.README.md", "shard-000000.manifest.json", "shard-000000.tar"]
    assert len(names) == 9
    manifest = json.loads((sharded / "manifest.json").read_text())
    assert [shard["episodes"] for shard in manifest["shards"]] == [10, 10, 5]
    assert manifest["counts"] == read_manifest(plain)["counts"]
    assert "files" not in manifest
    rows = [{key: row[key] for key in row if key != "offset"} for row in read_manifest(sharded)["files"]]
    for row in rows:
        row["name"] = row["name"].partition("/")[2]
    assert rows == read_manifest(plain)["files"]


def test_the_number_of_workers_changes_no_byte_of_shards(sharded: Path, tmp_path: Path) -> None:
    s2.generate_dataset(tmp_path / "two", QUICK, "straight-to-goal", shard_size=10, workers=2, **SETTINGS)
    assert contents(tmp_path / "two") == contents(sharded)


def test_the_members_of_a_shard_are_samples_of_webdataset(sharded: Path) -> None:
    """Each sample is a key with the files of that name, which the format calls extensions."""
    with tarfile.open(sharded / "shard-000001.tar") as archive:
        samples = [name.partition(".") for name in archive.getnames()]
    assert [(key, extension) for key, _, extension in samples] == [(f"{k:06d}", "json") for k in range(10, 20)]


@pytest.mark.parametrize("options", [{}, {"suffix": ".json.zst"}, {"keep": ["timeout"]}])  # most end so
def test_killing_and_resuming_gives_the_same_shards(tmp_path: Path, options: dict[str, Any]) -> None:
    settings = {"episodes": 40, "seed": 5, "shard_size": 16, **options}
    s2.generate_dataset(tmp_path / "whole", QUICK, "straight-to-goal", **settings)
    code = (
        "import sonata2d as s2\n"
        "q = s2.ScenarioConfig(name='quick', standing=2, wandering=3, tables=1, rules={'time_limit': 3.0})\n"
        f"s2.generate_dataset({str(tmp_path / 'out')!r}, q, 'straight-to-goal', **{settings!r}, resume=True)"
    )
    fifth = (tmp_path / "whole" / "shard-000000.tar").stat().st_size // 5
    killed, found_parts = 0, False
    for attempt in range(2):
        process = subprocess.Popen([sys.executable, "-c", code])
        parts: list[int] = []
        for _ in range(2000):
            with suppress(FileNotFoundError):  # it got its name meanwhile
                parts = [path.stat().st_size for path in (tmp_path / "out").glob(".part-*")]
            if process.poll() is not None or any(size > fifth * (2 * attempt + 1) for size in parts):
                break
            try:
                process.wait(timeout=0.01)
            except subprocess.TimeoutExpired:
                continue
        process.send_signal(signal.SIGKILL)
        killed += process.wait() == -signal.SIGKILL
        found_parts = found_parts or bool([*(tmp_path / "out").glob(".part-*")])
    assert killed
    assert found_parts
    s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", resume=True, **settings)
    assert contents(tmp_path / "out") == contents(tmp_path / "whole")


def test_finished_episodes_of_an_unfinished_shard_are_not_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_episodes: list[int] = []
    run = batches.run_episode

    def interrupted(job: Any, controller: Any, episode: int, store: Any) -> Any:
        if len(run_episodes) == 7:
            run_episodes.append(-1)
            raise KeyboardInterrupt
        run_episodes.append(episode)
        return run(job, controller, episode, store)

    monkeypatch.setattr(batches, "run_episode", interrupted)
    settings: dict[str, Any] = {"episodes": 12, "shard_size": 5}
    with pytest.raises(KeyboardInterrupt):
        s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", **settings)
    with pytest.warns(s2.errors.DatasetWarning, match="is interrupted: it has 5 of 12 episodes"):
        assert len(s2.Dataset(tmp_path / "out")) == 5
    s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", resume=True, **settings)
    assert run_episodes == [*range(7), -1, *range(7, 12)]
    assert not list((tmp_path / "out").glob(".part-*"))
    assert verify(tmp_path / "out", replay=True) == []


def test_a_killed_run_says_that_its_shards_are_not_listed(sharded: Path, tmp_path: Path) -> None:
    out = copied(sharded, tmp_path / "out")
    edit(out / "manifest.json", complete=False, shards=[], counts={"outcome": {}, "family": {}})
    result = CliRunner().invoke(main, ["describe", str(out)], prog_name="sonata2d")
    assert "3 shards are not listed until `generate` with --resume" in result.output
    s2.generate_dataset(out, QUICK, "straight-to-goal", shard_size=10, resume=True, **SETTINGS)
    assert contents(out) == contents(sharded)


def test_resumption_can_add_episodes_to_the_last_shard(sharded: Path, tmp_path: Path) -> None:
    settings: dict[str, Any] = {"seed": 5, "shard_size": 10}
    s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=13, **settings)
    s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=25, resume=True, **settings)
    assert contents(tmp_path / "out") == contents(sharded)
    with pytest.raises(RecordError, match="shard_size 10 stored, 5 requested"):
        s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=25, seed=5, shard_size=5, resume=True)
    with pytest.raises(RecordError, match="shard_size 10 stored, None requested"):
        s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=25, seed=5, resume=True)
    s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", episodes=3, seed=5, overwrite=True)
    assert not list((tmp_path / "out").glob("shard-*"))


def test_kept_episodes_of_shards_are_those_of_files(tmp_path: Path) -> None:
    settings: dict[str, Any] = {"episodes": 30, "seed": 5, "keep": ["timeout"]}  # nearly all of them
    files = s2.generate_dataset(tmp_path / "files", QUICK, "straight-to-goal", **settings)
    shards = s2.generate_dataset(tmp_path / "shards", QUICK, "straight-to-goal", shard_size=9, **settings)
    assert [record.episode for record in shards] == [record.episode for record in files]
    assert files.manifest is not None
    assert shards.manifest is not None
    assert shards.manifest["left_out"] == files.manifest["left_out"] != {}
    assert verify(tmp_path / "shards") == []
    more = {**settings, "episodes": 40}
    s2.generate_dataset(tmp_path / "shards", QUICK, "straight-to-goal", shard_size=9, resume=True, **more)
    s2.generate_dataset(tmp_path / "again", QUICK, "straight-to-goal", shard_size=9, **more)
    assert contents(tmp_path / "shards") == contents(tmp_path / "again")


def test_a_data_set_in_shards_is_read_as_one_of_files(plain: Path, sharded: Path) -> None:
    files, shards = s2.Dataset(plain), s2.Dataset(sharded)
    assert len(shards) == 25
    assert [record.episode for record in shards] == list(range(25))
    assert shards[17].document == files[17].document
    assert shards["000017"].document == files[17].document
    assert shards["shard-000001.tar/000017.json"].document == files[17].document
    assert shards[-1].episode == 24
    assert [record.episode for record in shards[8:12]] == [8, 9, 10, 11]
    assert str(shards.files[12]) == f"{sharded}/shard-000001.tar/000012.json"
    for options in ({"outcome": "goal"}, {"contact": True}, {"family": "quick/square"}, {"condition": is_even}):
        expected = [record.episode for record in files.filter(**options)]  # type: ignore[arg-type]
        assert [record.episode for record in shards.filter(**options)] == expected  # type: ignore[arg-type]
    assert shards.to_pandas().equals(files.to_pandas())
    assert "25" in shards._repr_html_()
    with pytest.raises(IndexError, match="the numbers are 0 to 24"):
        shards[25]
    with pytest.raises(KeyError, match="has no episode 'x'"):
        shards["x"]


def is_even(record: s2.EpisodeRecord) -> bool:
    return record.episode % 2 == 0


def test_one_shard_is_a_data_set(sharded: Path) -> None:
    shard = s2.Dataset(sharded / "shard-000001.tar")
    assert [record.episode for record in shard] == list(range(10, 20))
    assert shard.manifest is not None
    assert shard.manifest["seed"] == 5
    assert verify(sharded / "shard-000001.tar") == []
    assert "10 episodes" in (sharded / "shard-000001.README.md").read_text()


def test_a_tar_file_without_manifest_is_searched(sharded: Path, tmp_path: Path) -> None:
    copy = tmp_path / "other.tar"
    copy.write_bytes((sharded / "shard-000001.tar").read_bytes())
    assert [record.episode for record in s2.Dataset(copy)] == list(range(10, 20))
    copy.write_bytes(copy.read_bytes()[:30_000])  # as a copy that was interrupted
    assert 1 <= len(s2.Dataset(copy)) < 10


EPISODE = "000000.json"


def tar_of(*entries: tarfile.TarInfo | str, data: bytes = b"", form: int = tarfile.USTAR_FORMAT) -> bytes:
    """A tar file of members with the same data, and of headers as they are given."""
    file = io.BytesIO()
    with tarfile.open(fileobj=file, mode="w", format=form) as archive:
        for entry in entries:
            info = tarfile.TarInfo(entry) if isinstance(entry, str) else entry
            info.size = len(data) if info.isreg() else 0
            archive.addfile(info, io.BytesIO(data))
    return file.getvalue()


def without_end(data: bytes) -> bytes:
    """A tar file of one member without the blocks of zeros at the end."""
    return tar_of(EPISODE, data=data)[: 512 + 512 * -(-len(data) // 512)]


def with_size(size: int) -> bytes:
    """A tar file whose member declares a size, as the signed number of 12 bytes that GNU tar writes."""
    header = bytearray(tarfile.TarInfo(EPISODE).tobuf(tarfile.USTAR_FORMAT))
    header[124:136] = size.to_bytes(12, signed=True) if size < 0 else b"\x80" + size.to_bytes(11)
    header[148:156] = b" " * 8
    header[148:156] = b"%06o\0 " % sum(header)
    return bytes(header) + bytes(1024)


def of_type(kind: bytes, name: str = "000001.json") -> tarfile.TarInfo:
    info = tarfile.TarInfo(name)
    info.type, info.linkname = kind, EPISODE
    return info


END = "it has no end mark, two blocks of zeros: it was cut"
FOREIGN_NAME = "it holds a member with a name or size in a pax header, which is not read; pack"


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda data: b"", "it is empty"),
        (lambda data: data, "it is not a tar file"),
        (lambda data: bytes(512), "it is not a tar file"),
        (lambda data: gzip.compress(tar_of(EPISODE, data=data)), "it is not a tar file"),
        (lambda data: tar_of(EPISODE, data=data)[:600], f"it ends within '{EPISODE}'"),
        (lambda data: tar_of(EPISODE, "000001.json", data=data)[: len(data) + 1600], "it ends within '000001.json'"),
        (lambda data: without_end(data), END),
        (lambda data: without_end(data) + bytes(512), END),
        (lambda data: tar_of(EPISODE, data=data) * 2, "data follow its end mark"),
        (lambda data: without_end(data) + data, "it has no header of a tar file at byte "),
        (lambda data: with_size(-512), f"'{EPISODE}' has a negative size, -512"),
        (lambda data: without_end(data) + with_size(-1024), f"'{EPISODE}' has a negative size, -1024"),
        (lambda data: with_size(1 << 80), f"it ends within '{EPISODE}'"),
        (lambda data: tar_of(EPISODE, of_type(tarfile.SYMTYPE), data=data), "'000001.json' is a link"),
        (lambda data: tar_of(EPISODE, of_type(tarfile.LNKTYPE), data=data), "'000001.json' is a link"),
        (lambda data: tar_of(EPISODE, of_type(tarfile.FIFOTYPE), data=data), "'000001.json' is a member of type '6'"),
        (lambda data: tar_of(of_type(tarfile.GNUTYPE_SPARSE), data=data), "'000001.json' is a member of type 'S'"),
        (lambda data: tar_of(EPISODE, EPISODE, data=data), f"it holds '{EPISODE}' twice"),
        (lambda data: tar_of(f"demo/{EPISODE}", data=data), f"'demo/{EPISODE}' lies in a folder"),
        (lambda data: tar_of("a" * 120 + ".json", data=data, form=tarfile.GNU_FORMAT), "a long name of GNU tar"),
        (lambda data: tar_of("é" * 60 + ".json", data=data, form=tarfile.PAX_FORMAT), FOREIGN_NAME),
    ],
)  # fmt: skip
def test_check_names_what_hides_members_of_a_tar_file(sharded: Path, tmp_path: Path, make: Any, expected: str) -> None:
    data = members(sharded)["000003.json"]
    path = tmp_path / "own.tar"
    path.write_bytes(make(data))
    result = CliRunner().invoke(main, ["check", str(path)], prog_name="sonata2d")
    assert result.exit_code == 1
    assert expected in result.output.replace("\n", " ")
    beside = (sharded / "shard-000000.manifest.json").read_bytes()
    path.with_name("own.manifest.json").write_bytes(beside)  # of another file
    faults = [problem.message for problem in verify(path) if problem.place == "tar"]
    assert any(expected in fault for fault in faults), faults


def test_a_tar_file_without_episodes_is_refused(tmp_path: Path) -> None:
    (tmp_path / "own.tar").write_bytes(tar_of("README.md"))
    for use in (verify, s2.Dataset):
        with pytest.raises(RecordError, match=r"own\.tar holds no episode files"):
            use(tmp_path / "own.tar")


def test_headers_of_times_and_folders_in_a_tar_file_are_passed_over(sharded: Path, tmp_path: Path) -> None:
    (tmp_path / EPISODE).write_bytes(members(sharded)[EPISODE])
    with tarfile.open(tmp_path / "own.tar", "w", format=tarfile.PAX_FORMAT) as archive:  # with fractions of a second
        archive.add(tmp_path / EPISODE, EPISODE)
        archive.addfile(of_type(tarfile.DIRTYPE, "folder"))
    assert (tmp_path / "own.tar").read_bytes()[156:157] == tarfile.XHDTYPE
    assert verify(tmp_path / "own.tar") == []
    assert len(s2.Dataset(tmp_path / "own.tar")) == 1


def test_check_finds_nothing_in_whole_shards(sharded: Path) -> None:
    assert verify(sharded, replay=True, rerun=True, workers=2) == []
    assert verify(sharded) == []


def damaged(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] = data[at] ^ 1
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        (lambda out: damaged(out / "shard-000001.tar", 3000), "shard-000001.tar: sha256: is "),
        (lambda out: (out / "shard-000001.tar").unlink(), "shard-000001.tar is listed but not in the folder"),
        (lambda out: (out / "shard-000002.manifest.json").unlink(), "it has no shard-000002.manifest"),
        (lambda out: (out / "shard-000007.tar").write_bytes(b""), "shard-000007.tar is in the folder but not listed"),
        (lambda out: edit(out / "manifest.json", episodes=26), "shards: have 25 episodes, and not 26"),
        (lambda out: edit(out / "shard-000001.manifest.json", seed=6), "shard-000001.manifest.json: seed: differs"),
        (
            lambda out: edit(out / "manifest.json", split={"train": 25}),
            "split: is {'train': 25}, but the shards give none; split the data set again",
        ),
        (
            lambda out: edit(out / "manifest.json", shards=[shards_of(out)[0], *shards_of(out)]),
            "shards: lists shard-000000.tar more than once",
        ),
        (lambda out: edit(out / "manifest.json", complete=False), "complete: 25 of 25 episodes exist; generate"),
        (
            lambda out: edit(out / "manifest.json", keep=["goal"], left_out={"timeout": 3}),
            "left_out: is {'timeout': 3}, but the shards give none",
        ),
        (lambda out: shortened(out / "shard-000001.manifest.json"), "lists 9 episodes, and the data set 10"),
        (lambda out: append(out / "shard-000001.tar"), "more.json is in the shard but not listed"),
    ],
)  # fmt: skip
def test_check_finds_damage_of_shards(sharded: Path, tmp_path: Path, damage: Any, expected: str) -> None:
    out = tmp_path / "out"
    out.mkdir()
    for path in sharded.iterdir():
        (out / path.name).write_bytes(path.read_bytes())
    damage(out)
    found = [str(problem) for problem in verify(out)]
    assert any(expected in problem for problem in found), found


def edit(path: Path, **values: Any) -> None:
    path.write_bytes(orjson.dumps(orjson.loads(path.read_bytes()) | values))


def shards_of(folder: Path) -> list[Any]:
    """The shards that a manifest lists."""
    shards: list[Any] = orjson.loads((folder / "manifest.json").read_bytes())["shards"]
    return shards


def shortened(path: Path) -> None:
    edit(path, files=orjson.loads(path.read_bytes())["files"][:-1])


def append(path: Path) -> None:
    with tarfile.open(path, "a") as archive:
        archive.addfile(tarfile.TarInfo("more.json"), io.BytesIO())


def test_a_split_of_shards_is_that_of_files(plain: Path, sharded: Path, tmp_path: Path) -> None:
    out = copied(sharded, tmp_path / "out")
    files = copied(plain, tmp_path / "files")
    names = split_dataset(out, seed=3, workers=2)
    expected = split_dataset(files, seed=3)
    assert {part: [name.partition("/")[2] for name in own] for part, own in names.items()} == expected
    parts = s2.Dataset(out).parts
    assert {part: [record.episode for record in own] for part, own in parts.items()} == {
        part: [record.episode for record in own] for part, own in s2.Dataset(files).parts.items()
    }
    assert json.loads((out / "manifest.json").read_text())["split"] == {part: len(own) for part, own in names.items()}
    assert verify(out) == []
    assert s2.Dataset(out).filter(outcome="goal").parts.keys() == parts.keys()
    s2.generate_dataset(out, QUICK, "straight-to-goal", shard_size=10, resume=True, **SETTINGS)
    assert s2.Dataset(out).parts.keys() == parts.keys()  # a resumption without new episodes keeps it
    more = SETTINGS | {"episodes": 31}
    s2.generate_dataset(out, QUICK, "straight-to-goal", shard_size=10, resume=True, **more)
    s2.generate_dataset(tmp_path / "new", QUICK, "straight-to-goal", shard_size=10, **more)
    assert contents(out) == contents(tmp_path / "new")  # another one removes it


def copied(folder: Path, out: Path) -> Path:
    out.mkdir()
    for path in folder.iterdir():
        (out / path.name).write_bytes(path.read_bytes())
    return out


def test_shards_are_mirrored_and_back(plain: Path, sharded: Path, tmp_path: Path) -> None:
    split_dataset(copied(sharded, tmp_path / "split"))
    for workers in (1, 2):
        mirror_dataset(tmp_path / "split", tmp_path / f"image{workers}", workers=workers)
    assert contents(tmp_path / "image1") == contents(tmp_path / "image2")
    assert verify(tmp_path / "image1") == []
    mirror_dataset(plain, tmp_path / "plain")
    expected = {name: data for name, data in contents(tmp_path / "plain").items() if name.startswith("0")}
    assert members(tmp_path / "image1") == expected
    mirror_dataset(tmp_path / "image1", tmp_path / "back")
    assert contents(tmp_path / "back") == contents(tmp_path / "split")


def test_shards_and_files_are_merged(plain: Path, sharded: Path, tmp_path: Path) -> None:
    mirror_dataset(plain, tmp_path / "mirrored")
    merge_datasets([sharded, tmp_path / "mirrored"], tmp_path / "both")
    assert verify(tmp_path / "both", replay=True) == []
    both = s2.Dataset(tmp_path / "both")
    assert len(both) == 50
    assert {path.name for path in (tmp_path / "both").glob("*.tar")} == {
        *(f"sharded__shard-00000{number}.tar" for number in range(3)),
        *(f"mirrored__shard-00000{number}.tar" for number in range(3)),
    }
    split_dataset(tmp_path / "both")  # episodes and their images stay together
    parts = {part: {record.episode for record in own} for part, own in s2.Dataset(tmp_path / "both").parts.items()}
    assert sum(map(len, parts.values())) == 25
    s2.generate_dataset(tmp_path / "more", QUICK, "straight-to-goal", episodes=4, seed=6)
    s2.generate_dataset(tmp_path / "others", QUICK, "straight-to-goal", episodes=4, seed=7)
    merge_datasets([tmp_path / "more", tmp_path / "others"], tmp_path / "files")
    merge_datasets([tmp_path / "both", tmp_path / "files"], tmp_path / "all")
    assert verify(tmp_path / "all") == []
    manifest = read_manifest(tmp_path / "all")
    assert [source["name"] for source in manifest["sources"]] == [
        "both__sharded", "both__mirrored", "files__more", "files__others"
    ]  # fmt: skip
    assert [len(source["files"]) for source in manifest["sources"]] == [25, 25, 4, 4]
    with pytest.raises(RecordError, match="is the same episode as"):
        merge_datasets([plain, sharded], tmp_path / "twice")


def test_kept_and_mirrored_files_are_merged_into_shards(sharded: Path, tmp_path: Path) -> None:
    kept = s2.generate_dataset(tmp_path / "kept", QUICK, "straight-to-goal", episodes=5, seed=8, keep=["goal"])
    mirror_dataset(kept.path, tmp_path / "image")
    merge_datasets([kept.path, tmp_path / "image"], tmp_path / "files")
    mirror_dataset(tmp_path / "files", tmp_path / "mirrored")
    merge_datasets([tmp_path / "mirrored", sharded], tmp_path / "all")
    assert verify(tmp_path / "all") == []
    mirrored = [bool(source.get("mirrored")) for source in read_manifest(tmp_path / "all")["sources"]]
    shards = sorted((tmp_path / "all").glob("mirrored__*.manifest.json"))
    assert mirrored == [True, False, False]
    assert [bool(json.loads(path.read_text()).get("mirrored")) for path in shards] == [False, True]


def test_merged_shards_are_exported_whole(sharded: Path, tmp_path: Path) -> None:
    """Their episodes have the same names."""
    s2.generate_dataset(tmp_path / "more", QUICK, "straight-to-goal", episodes=25, seed=6, shard_size=10)
    merge_datasets([sharded, tmp_path / "more"], tmp_path / "both")
    assert len(export_to(tmp_path / "both", "npz", tmp_path / "arrays").files) == 50
    for size in (None, 20):
        export_to(tmp_path / "both", "parquet", tmp_path / f"tables{size}", shard_size=size)
        imported = import_from(tmp_path / f"tables{size}", "parquet", tmp_path / f"back{size}")
        assert len(imported.files) == 50
        seeds = [s2.read_episode(path).document["seed"] for path in imported.files]
        assert sorted(seeds) == [5] * 25 + [6] * 25
    export_to(sharded, "parquet", tmp_path / "tables20", shard_size=None)  # in place of the parts
    assert len(import_from(tmp_path / "tables20", "parquet", tmp_path / "again").files) == 25


def test_a_second_worker_on_the_same_shard_changes_nothing(
    sharded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a lost connection, Dask lets another worker run a task that the first one still runs."""
    run, batch, runs_inside = batches.run_episode, batches._run_batch, []

    def twice(job: Any, controller: Any, episode: int, store: Any) -> Any:
        if episode == 13 and not runs_inside:
            runs_inside.append(episode)
            assert isinstance(batch(job, controller, 1), batches.Batch)
        return run(job, controller, episode, store)

    monkeypatch.setattr(batches, "run_episode", twice)
    s2.generate_dataset(tmp_path / "out", QUICK, "straight-to-goal", shard_size=10, **SETTINGS)
    assert runs_inside
    assert contents(tmp_path / "out") == contents(sharded)


def test_a_resumed_run_of_a_split_data_set_leaves_no_split(
    sharded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, settings = tmp_path / "out", {"seed": 5, "shard_size": 10, "resume": True}
    s2.generate_dataset(out, QUICK, "straight-to-goal", episodes=20, **settings)
    split_dataset(out)
    monkeypatch.setattr(batches, "run_episode", interrupted)
    with pytest.raises(KeyboardInterrupt):
        s2.generate_dataset(out, QUICK, "straight-to-goal", episodes=25, **settings)
    assert any("split" in str(problem) for problem in verify(out))
    monkeypatch.undo()
    s2.generate_dataset(out, QUICK, "straight-to-goal", episodes=25, **settings)
    assert contents(out) == contents(sharded)


def interrupted(*_: Any) -> Any:
    raise KeyboardInterrupt


def test_resumption_with_another_compression_is_refused(sharded: Path, tmp_path: Path) -> None:
    out = copied(sharded, tmp_path / "out")
    manifest = json.loads((out / "manifest.json").read_text())
    (out / "manifest.json").write_text(json.dumps(manifest | {"shards": [], "complete": False}))  # as after a kill
    with pytest.raises(RecordError, match=r"holds files like 000000\.json; resume with the same --compress"):
        s2.generate_dataset(out, QUICK, "straight-to-goal", shard_size=10, suffix=".json.gz", resume=True, **SETTINGS)


@pytest.mark.parametrize("place", [600, 90_000])  # in an episode, and in its numbers or a header
def test_resumption_repairs_a_changed_shard(place: int, sharded: Path, tmp_path: Path) -> None:
    out = copied(sharded, tmp_path / "out")
    data = bytearray((out / "shard-000001.tar").read_bytes())
    data[place] ^= 1
    (out / "shard-000001.tar").write_bytes(data)
    s2.generate_dataset(out, QUICK, "straight-to-goal", shard_size=10, resume=True, **SETTINGS)
    assert contents(out) == contents(sharded)


def test_croissant_metadata_describe_shards(sharded: Path, tmp_path: Path) -> None:
    out = copied(sharded, tmp_path / "out")
    write_card(out)
    document = json.loads((out / "croissant.json").read_text())
    sets = {entry["@id"]: entry for entry in document["distribution"]}
    assert sets["episodes"]["containedIn"] == {"@id": "shards"}
    matched = {
        name: {path.name for path in out.glob(sets[name]["includes"][0])} for name in ("shards", "shard-manifests")
    }
    assert [len(names) for names in matched.values()] == [3, 3]
    sources = {json.dumps(field["source"]["fileSet"]) for field in document["recordSet"][0]["field"]}
    assert sources == {'{"@id": "shard-manifests"}'}
    assert verify(out) == []


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("render {} -o x.svg", "is a shard; name an episode in it"),
        ("mirror {} -o image", "is a shard"),
        ("card {}", "is a shard, whose manifest and card stay; name the folder of its data set"),
        ("split {}", "is a shard, whose manifest and card stay; name the folder of its data set"),
    ],
)
def test_what_a_single_shard_is_not_for_is_one_error(
    line: str, message: str, sharded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = copied(sharded, tmp_path / "out")
    monkeypatch.chdir(tmp_path)
    before = contents(out)
    result = CliRunner().invoke(main, line.format(out / "shard-000000.tar").split())
    assert result.exit_code != 0
    assert message in result.output
    assert contents(out) == before


def test_names_that_a_tar_file_cannot_hold_are_one_error(tmp_path: Path) -> None:
    message = pytest.raises(RecordError, match="give the file a shorter name")
    with ShardWriter(tmp_path / "a.tar", tmp_path / ".part") as writer, message:
        writer.add("n" * 101 + ".json", b"{}")


def test_tar_files_of_other_programs_are_read(sharded: Path, tmp_path: Path) -> None:
    with tarfile.open(tmp_path / "own.tar", "w") as archive:
        for name, data in members(sharded).items():
            info = tarfile.TarInfo(f"./{name}")
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    assert s2.Dataset(tmp_path / "own.tar")[3].episode == 3


def test_shards_are_evaluated_as_files(plain: Path, sharded: Path) -> None:
    values = [
        [episode.values for episode in s2.evaluate(s2.Dataset(folder), resamples=100, rerun=False)[0].episodes]
        for folder in (plain, sharded)
    ]
    assert values[0] == values[1]


COMMANDS = """
check {sharded} --replay
describe {sharded}
describe {sharded}/shard-000001.tar
describe {sharded}/shard-000001.tar/000012.json
render {sharded} -o sheet.png
render {sharded}/shard-000001.tar/000012.json -o one.svg
export {sharded} --to npz -o arrays --workers 1
export {sharded} --to parquet -o tables --workers 1
evaluate {sharded} --no-rerun --resamples 100 --workers 1
mirror {sharded} -o mirrored --workers 2
check mirrored --workers 1
merge {sharded} mirrored -o both
split both
card both
check both --workers 1
generate out --scenario empty --episodes 5 --shard-size 2 --compress zst --json --workers 1
check out --engine dask --workers 1 --replay
"""


def test_commands_read_shards(sharded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copied(sharded, tmp_path / "set")
    monkeypatch.chdir(tmp_path)
    for line in COMMANDS.strip().splitlines():
        result = CliRunner().invoke(main, line.format(sharded="set").split(), prog_name="sonata2d")
        assert result.exit_code == 0, f"{line}: {result.output}"
    assert len(list(Path("arrays").glob("*.npz"))) == 25
    assert sum(path.stat().st_size for path in Path("tables").glob("*.parquet")) > 10_000


def test_an_interrupted_writer_leaves_what_is_whole(tmp_path: Path) -> None:
    path, part = tmp_path / "a.tar", tmp_path / ".part-a.tar"
    with ShardWriter(path, part) as writer:
        writer.add("000000.json", b"{}")
    assert not path.exists()
    assert read_bytes(part / "000000.json") == b"{}"
    with pytest.raises(RecordError, match=r"cannot be read: \.part-a\.tar has no member 000001\.json"):
        read_stored(part / "000001.json")
    with ShardWriter(path, tmp_path / ".part-b.tar"):
        pass
    assert not (tmp_path / ".part-b.tar").exists()


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_one_error(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(RecordError, match="cannot be written"):
        ShardWriter(tmp_path / "a.tar", tmp_path / ".part-a.tar")
