"""Data sets on the Hugging Face Hub: upload, reading and verification, with a server that stands for the Hub."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from sonata2d_cli import main

import sonata2d as s2
from sonata2d.core.files.locations import location
from sonata2d.datasets import mirror_dataset, push_dataset, verify
from sonata2d.datasets.transforms.split import split_dataset
from sonata2d.errors import DatasetWarning, RecordError

from .fake_hub import OWNER, TOKEN, FakeHub, contents, serving
from .test_generate import QUICK

pytest.importorskip("huggingface_hub", reason="huggingface-hub comes with the hub extra")
pytest.importorskip("pyarrow", reason="pyarrow comes with the hub extra")
pytest.importorskip("upath")

NAME = f"{OWNER}/demo"
SIZES: list[int | None] = [None, 2]  # of shards


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[int | None, Path]:
    """A data set as files and in shards, by size of the shards."""
    folders = {size: tmp_path_factory.mktemp("made") / "demo" for size in SIZES}
    for size, folder in folders.items():
        s2.generate_dataset(folder, QUICK, "straight-to-goal", episodes=5, seed=5, shard_size=size, progress=False)
    return folders


@pytest.fixture
def folder(made: dict[int | None, Path], tmp_path: Path) -> Path:
    """The data set as files, which a test may change."""
    return shutil.copytree(made[None], tmp_path / "demo")


@pytest.fixture
def hub(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeHub]:
    """A server that this process takes for the Hub, with a valid token."""
    import huggingface_hub
    from huggingface_hub import constants

    with serving() as server:
        values: dict[str, Any] = {
            "ENDPOINT": server.endpoint,
            "HUGGINGFACE_CO_URL_TEMPLATE": server.endpoint + "/{repo_id}/resolve/{revision}/{filename}",
            "HF_HUB_CACHE": str(tmp_path / "cache"),
            "HF_TOKEN_PATH": str(tmp_path / "token"),
            "HF_HUB_OFFLINE": False,
            "HF_HUB_DISABLE_XET": True,
            "HF_HUB_DISABLE_PROGRESS_BARS": True,
        }
        for name, value in values.items():
            monkeypatch.setattr(constants, name, value)
        monkeypatch.setenv("HF_TOKEN", TOKEN)
        huggingface_hub.close_session()
        yield server
        huggingface_hub.close_session()
        huggingface_hub.HfFileSystem.clear_instance_cache()


@pytest.mark.parametrize("size", SIZES)
def test_the_files_of_a_data_set_are_uploaded_without_private_ones(
    hub: FakeHub, made: dict[int | None, Path], tmp_path: Path, size: int | None
) -> None:
    folder = shutil.copytree(made[size], tmp_path / "demo")
    for private in ("ratings/zoe.jsonl", "failed/1.json", "study/answers/p1.jsonl", "notes.txt", ".sonata2d-x.tmp"):
        (folder / private).parent.mkdir(parents=True, exist_ok=True)
        (folder / private).write_text("{}")
    page = push_dataset(folder, NAME, message="Five runs")
    assert page == f"{hub.endpoint}/datasets/{NAME}"
    private_ones = ("ratings", "failed", "study", "notes.txt", ".sonata2d", "run.jsonl")
    kept = {name: data for name, data in contents(folder).items() if not name.startswith(private_ones)}
    assert hub.files(NAME) == kept
    assert {"manifest.json", "README.md", "croissant.json", "frames-00000.parquet"} <= set(kept)
    assert hub.repositories[NAME].messages == ["Five runs"]


def test_a_second_upload_deletes_what_the_data_set_has_no_more(hub: FakeHub, folder: Path) -> None:
    push_dataset(folder, NAME)
    split_dataset(folder)
    push_dataset(folder, NAME)
    names = set(hub.files(NAME))
    assert "frames-00000.parquet" not in names
    assert {"frames-train-00000.parquet", "episodes-test-00000.parquet"} <= names
    s2.generate_dataset(folder, QUICK, episodes=2, seed=6, overwrite=True, progress=False)
    push_dataset(folder, NAME)
    assert not {"000002.json", "frames-train-00000.parquet"} & set(hub.files(NAME))
    assert hub.files(NAME) == {name: data for name, data in contents(folder).items() if name != "run.jsonl"}


def test_card_and_tables_are_brought_up_to_date_and_an_edited_card_stays(hub: FakeHub, folder: Path) -> None:
    (folder / "README.md").unlink()
    (folder / "frames-00000.parquet").write_bytes(b"old")
    push_dataset(folder, NAME)
    assert hub.files(NAME)["README.md"].startswith(b"---\n")
    assert hub.files(NAME)["frames-00000.parquet"].startswith(b"PAR1")
    card = (folder / "README.md").read_text() + "\nSee our paper.\n"
    (folder / "README.md").write_text(card)
    (folder / "frames-00000.parquet").unlink()
    push_dataset(folder, NAME)
    assert (folder / "README.md").read_text() == hub.files(NAME)["README.md"].decode() == card
    assert "frames-00000.parquet" in hub.files(NAME)
    (folder / "README.md").write_text(card.replace("| timeout | 5 |", "| timeout | 6 |"))
    with pytest.raises(RecordError, match=r"README.md states the outcomes \{'timeout': 6\}.*edit it, or write a new"):
        push_dataset(folder, NAME)


def test_a_private_data_set_and_a_branch(hub: FakeHub, folder: Path) -> None:
    push_dataset(folder, f"{OWNER}/own", private=True, revision="draft")
    assert hub.repositories[f"{OWNER}/own"].private
    assert hub.files(f"{OWNER}/own") == {}
    assert "manifest.json" in hub.files(f"{OWNER}/own", "draft")
    assert len(s2.load(f"{OWNER}/own", revision="draft", replay=0)) == 5
    push_dataset(folder, NAME)
    with pytest.raises(RecordError, match="exists and is public"):
        push_dataset(folder, NAME, private=True)


def test_what_cannot_be_published_is_refused_before_the_upload(
    hub: FakeHub, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def changed(**values: Any) -> None:
        manifest = json.loads((folder / "manifest.json").read_text())
        (folder / "manifest.json").write_text(json.dumps(manifest | values))

    changed(complete=False, episodes=9)
    with pytest.raises(RecordError, match="is interrupted: it has 5 of 9 episodes; complete it with generate --resume"):
        push_dataset(folder, NAME)
    changed(complete=True, episodes=5, collected=True)
    with pytest.raises(RecordError, match=r"has runs that people drove.*--personal"):
        push_dataset(folder, NAME)
    stored = json.loads((folder / "manifest.json").read_text())["controller"]
    changed(collected=False, controller=stored | {"path": "/home/ann/a.py:A"})
    with pytest.raises(
        RecordError, match=r"by a path of this machine, /home/ann/a\.py:A; generate it again.*--personal"
    ):
        push_dataset(folder, NAME)
    changed(controller=stored)
    monkeypatch.setattr("sonata2d.datasets.hub._MAX_FILES", 5)
    with pytest.raises(RecordError, match=r"has 12 files, the Hub takes 5; generate it with --shard-size"):
        push_dataset(folder, NAME)
    (folder / "000001.json").write_bytes((folder / "000000.json").read_bytes())
    with pytest.raises(RecordError, match=r"000001\.json has the SHA-256 .* not that of the manifest"):
        push_dataset(folder, NAME)
    with pytest.raises(RecordError, match="memory://set is in a store; copy the data set"):
        push_dataset(location("memory://set"), NAME)
    assert hub.repositories == {}


@pytest.mark.parametrize("size", SIZES)
def test_a_data_set_is_read_at_its_url(hub: FakeHub, made: dict[int | None, Path], size: int | None) -> None:
    push_dataset(made[size], NAME)
    url, local = f"hf://datasets/{NAME}", s2.Dataset(made[size])
    remote = s2.Dataset(url)
    assert [record.document for record in remote] == [record.document for record in local]
    assert remote[3].document == s2.Dataset(f"{url}@main")["000003"].document == local[3].document
    assert remote.manifest == local.manifest or size is not None
    assert verify(url) == []
    inside = url + ("/000001.json" if size is None else "/shard-000000.tar/000001.json")
    for words in (
        ["describe", url],
        ["describe", inside],
        ["check", url, "--workers", "1"],
        ["evaluate", url, "--no-rerun", "--workers", "1"],
    ):
        result = CliRunner().invoke(main, words, prog_name="sonata2d")
        assert result.exit_code == 0, f"{words}: {result.output}"
    result = CliRunner().invoke(main, ["split", url], prog_name="sonata2d")
    assert result.exit_code == 1
    assert "cannot be written: it is in a repository, which is read only" in result.output


def test_a_url_shows_what_another_program_uploads_meanwhile(hub: FakeHub, folder: Path) -> None:
    url = f"hf://datasets/{NAME}"
    with pytest.raises(RecordError, match="does not exist"):
        s2.Dataset(url)
    push_dataset(folder, NAME)
    assert len(s2.Dataset(url)) == 5
    s2.generate_dataset(folder, QUICK, episodes=7, seed=6, overwrite=True, progress=False)
    push_dataset(folder, NAME)
    assert [record.document["seed"] for record in s2.Dataset(url)] == [6] * 7


@pytest.mark.parametrize("size", SIZES)
def test_a_data_set_is_loaded_and_verified(
    hub: FakeHub, made: dict[int | None, Path], size: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    push_dataset(made[size], NAME)
    replayed = []

    def recorded(file: Path, **options: Any) -> Any:
        replayed.append(file.name)
        return verify(file, **options)

    monkeypatch.setattr("sonata2d.datasets.hub.verify", recorded)
    dataset = s2.load(NAME, replay=2)
    assert [record.document for record in dataset] == [record.document for record in s2.Dataset(made[size])]
    assert replayed == ["000001.json", "000003.json"]
    s2.load(NAME, replay=0)
    assert len(replayed) == 2
    name = "000002.json" if size is None else "shard-000001.tar"
    data = bytearray(hub.files(NAME)[name])
    data[-2000 if size is None else 700] ^= 1
    hub.replace(NAME, name, bytes(data))
    with pytest.raises(RecordError, match=rf"{name}.*it was changed after its upload"):
        s2.load(NAME, replay=0)


def test_the_remedy_for_a_damaged_download_works(hub: FakeHub, folder: Path) -> None:
    push_dataset(folder, NAME)
    file = s2.load(NAME, replay=0).files[1]
    stored = file.resolve()  # the snapshot holds links
    data = bytearray(stored.read_bytes())
    data[-2000] ^= 1
    stored.chmod(0o644)
    stored.write_bytes(data)
    with pytest.raises(RecordError, match=r"the download is damaged: remove .* to load it again") as caught:
        s2.load(NAME, replay=0)
    found = re.search("remove (.*) to load", str(caught.value))
    assert found is not None
    shutil.rmtree(found[1])
    assert len(s2.load(NAME)) == 5


def test_an_episode_that_its_commands_do_not_make_is_refused(hub: FakeHub, folder: Path) -> None:
    """Its hash is that of the manifest, which was changed as well."""
    from hashlib import sha256

    push_dataset(folder, NAME)
    document = json.loads(hub.files(NAME)["000002.json"])
    document["frames"][20]["robot"][0] += 0.001
    manifest = json.loads(hub.files(NAME)["manifest.json"])
    data = json.dumps(document).encode()
    manifest["files"][2] |= {"sha256": sha256(data).hexdigest(), "bytes": len(data)}
    hub.replace(NAME, "000002.json", data)
    hub.replace(NAME, "manifest.json", json.dumps(manifest).encode())
    assert len(s2.load(NAME, replay=0)) == 5
    with pytest.raises(RecordError, match=r"000002.json is not as its commands make it"):
        s2.load(NAME)


def test_another_version_of_the_physics_is_a_warning(hub: FakeHub, folder: Path) -> None:
    push_dataset(folder, NAME)
    manifest = json.loads(hub.files(NAME)["manifest.json"])
    hub.replace(NAME, "manifest.json", json.dumps(manifest | {"physics": 3}).encode())
    with pytest.warns(DatasetWarning, match="is of physics version 3, .*only its hashes were compared"):
        assert len(s2.load(NAME)) == 5


def test_other_names_are_loaded_from_this_machine(folder: Path, tmp_path: Path) -> None:
    mirror_dataset(folder, tmp_path / "mirrored")
    assert len(s2.load(tmp_path / "mirrored")) == 5
    with pytest.raises(RecordError, match="does not exist"):
        s2.load("nowhere")
    with pytest.raises(ValueError, match="has no revisions"):
        s2.load(folder, revision="main")
    with pytest.raises(ValueError, match="replay"):
        s2.load(NAME, replay=-1)


def test_hugging_face_datasets_loads_the_repository_by_its_name(
    hub: FakeHub, made: dict[int | None, Path], tmp_path: Path
) -> None:
    pytest.importorskip("datasets", reason="datasets is not installed")
    push_dataset(made[None], NAME)
    code = (
        "import sys, datasets\n"
        "rows = datasets.load_dataset(sys.argv[1], 'episodes')['train']\n"
        "print(rows['episode_id'][:], rows['outcome'][:])"
    )
    own = {"HF_ENDPOINT": hub.endpoint, "HF_HOME": str(tmp_path / "home"), "HF_HUB_DISABLE_XET": "1"}
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("HF_", "HUGGINGFACE_"))}
    done = subprocess.run(
        [sys.executable, "-c", code, NAME], env=kept | own, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.split("\n")[0].startswith("['000000', '000001'")


def test_errors_of_the_hub_are_one_line_with_the_remedy(
    hub: FakeHub, made: dict[int | None, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = str(made[None])
    with pytest.raises(RecordError, match="check the owner's name"):
        push_dataset(folder, "others/demo")
    with pytest.raises(RecordError, match="is no name on the Hugging Face Hub; give OWNER/NAME"):
        push_dataset(folder, "a/b/c")
    with pytest.raises(RecordError, match=r"is not a folder here, and cannot be reached .*check the name"):
        s2.load(f"{OWNER}/missing")
    hub.create(NAME, private=False)
    with pytest.raises(RecordError, match=r"is no data set of sonata2d: it has no manifest\.json"):
        s2.load(NAME)
    with pytest.raises(RecordError, match="RevisionNotFoundError"):
        s2.load(NAME, revision="v9")
    monkeypatch.delenv("HF_TOKEN")
    result = CliRunner().invoke(main, ["push", folder, f"{OWNER}/other"], prog_name="sonata2d")
    assert result.exit_code == 1
    assert "log in with `hf auth login`, or set HF_TOKEN" in result.output
    assert len(result.output.splitlines()) == 1
    monkeypatch.setattr("huggingface_hub.constants.ENDPOINT", "http://127.0.0.1:1")
    with pytest.raises(RecordError, match="check the network, HF_ENDPOINT and HF_HUB_OFFLINE"):
        push_dataset(folder, NAME)


def test_without_the_package_the_error_names_the_extra(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "huggingface_hub", None)
    for action in (lambda: push_dataset(folder, NAME), lambda: s2.load(NAME)):
        with pytest.raises(RecordError, match=r"this needs huggingface_hub.*sonata2d\[hub\]"):
            action()


def test_the_command_prints_the_page(hub: FakeHub, folder: Path) -> None:
    result = CliRunner().invoke(main, ["push", str(folder), NAME, "--private", "--json"], prog_name="sonata2d")
    assert result.exit_code == 0, result.output
    assert json.loads(result.output) == {"page": f"{hub.endpoint}/datasets/{NAME}"}
    assert hub.repositories[NAME].private
