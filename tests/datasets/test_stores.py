"""Data sets at URLs: in memory, and in a server that speaks the protocol of S3."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import uuid
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from sonata2d_cli import main

import sonata2d as s2
from sonata2d.core.files.locations import file_names, location
from sonata2d.datasets import merge_datasets, mirror_dataset, split_dataset, verify
from sonata2d.errors import RecordError, WorkerError
from sonata2d.formats.api import export_to, import_from
from sonata2d.record.files import read_stored, write_atomically
from sonata2d.workers.dask_executor import DaskExecutor

from .cluster import Cluster
from .test_generate import QUICK

pytest.importorskip("upath")
SETTINGS: dict[str, Any] = {"episodes": 7, "seed": 5}
SHARD = 3


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """The address of a server with a bucket `sets`; processes that are started meanwhile use it."""
    server_module = pytest.importorskip("moto.server")
    boto3 = pytest.importorskip("boto3")
    pytest.importorskip("s3fs")
    server = server_module.ThreadedMotoServer(port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    address = f"http://{host}:{port}"
    own = {
        "AWS_ACCESS_KEY_ID": "testing",
        "AWS_SECRET_ACCESS_KEY": "testing",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": address,
    }
    before = {name: os.environ.get(name) for name in own}
    os.environ.update(own)
    boto3.client("s3", endpoint_url=address).create_bucket(Bucket="sets")
    yield address
    for name, value in before.items():
        if value is None:
            del os.environ[name]
        else:
            os.environ[name] = value
    server.stop()
    pytest.importorskip("s3fs").S3FileSystem.clear_instance_cache()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # connections that the store's client keeps open
        gc.collect()


@pytest.fixture(scope="module")
def two(endpoint: str) -> Iterator[s2.Workers]:
    """Two processes that know the address of the server."""
    with s2.Workers(2) as workers:
        yield workers


@pytest.fixture(params=["memory", "s3"])
def store(request: pytest.FixtureRequest) -> str:
    """The URL of an empty folder."""
    if request.param == "s3":
        request.getfixturevalue("endpoint")
        return f"s3://sets/{uuid.uuid4().hex}"
    return f"memory://{uuid.uuid4().hex}"


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> dict[int | None, Path]:
    """The data set on this machine, as files and in shards, by size of the shards."""
    folders: dict[int | None, Path] = {}
    for size in (None, SHARD):
        folders[size] = tmp_path_factory.mktemp("local") / "set"
        s2.generate_dataset(folders[size], QUICK, "straight-to-goal", shard_size=size, **SETTINGS)
    return folders


@pytest.fixture(autouse=True)
def quick_claims(monkeypatch: pytest.MonkeyPatch) -> None:
    """Programs of most tests are alone."""
    monkeypatch.setattr("sonata2d.record.claims._SETTLE_S", 0.0)
    monkeypatch.setattr("sonata2d.record.claims._CHECK_S", 0.0)


def contents(folder: str | Path) -> dict[str, bytes]:
    """All files but the run log."""
    place = location(folder)
    return {name: read_stored(place / name) for name in sorted(file_names(place)) if name != "run.jsonl"}


@pytest.mark.parametrize("size", [None, SHARD])
def test_a_data_set_in_a_store_has_the_same_bytes(store: str, local: dict[int | None, Path], size: int | None) -> None:
    dataset = s2.generate_dataset(f"{store}/set", QUICK, "straight-to-goal", shard_size=size, **SETTINGS)
    assert contents(f"{store}/set") == contents(local[size])
    assert [record.episode for record in dataset] == list(range(7))
    again = s2.Dataset(f"{store}/set")
    assert again[5].document == s2.Dataset(local[size])[5].document
    assert [one.episode for one in again.filter(outcome="goal")] == [
        one.episode for one in s2.Dataset(local[size]).filter(outcome="goal")
    ]
    assert verify(f"{store}/set", replay=True) == []
    with pytest.raises(RecordError, match="already holds a data set"):
        s2.generate_dataset(f"{store}/set", QUICK, "straight-to-goal", shard_size=size, **SETTINGS)
    s2.generate_dataset(f"{store}/set", QUICK, "straight-to-goal", shard_size=size, overwrite=True, **SETTINGS)
    assert contents(f"{store}/set") == contents(local[size])


@pytest.mark.parametrize("size", [None, SHARD])
def test_processes_write_to_a_store(two: s2.Workers, local: dict[int | None, Path], size: int | None) -> None:
    url = f"s3://sets/{uuid.uuid4().hex}"
    s2.generate_dataset(url, QUICK, "straight-to-goal", shard_size=size, workers=two, **SETTINGS)
    assert contents(url) == contents(local[size])
    assert verify(url, workers=two) == []
    assert not [name for name in file_names(location(url)) if name.startswith(".")]


def test_an_interrupted_run_in_a_store_is_continued(
    store: str, local: dict[int | None, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    from sonata2d.datasets.generate import batches

    run, count = batches.run_episode, 0

    def interrupted(job: Any, controller: Any, episode: int, store: Any) -> Any:
        nonlocal count
        count += 1
        if count == 5:
            raise KeyboardInterrupt
        return run(job, controller, episode, store)

    monkeypatch.setattr(batches, "run_episode", interrupted)
    for size in (None, SHARD):
        count = 0
        with pytest.raises(KeyboardInterrupt):
            s2.generate_dataset(f"{store}/{size}", QUICK, "straight-to-goal", shard_size=size, **SETTINGS)
        s2.generate_dataset(f"{store}/{size}", QUICK, "straight-to-goal", shard_size=size, resume=True, **SETTINGS)
        assert contents(f"{store}/{size}") == contents(local[size])


def test_a_run_whose_folder_another_one_takes_stops_with_an_error(store: str, local: dict[int | None, Path]) -> None:
    """The second run begins and ends while the first one is between two episodes."""
    url, begun = f"{store}/set", []

    def advance(_: int) -> None:
        if not begun:
            begun.append(True)
            s2.generate_dataset(url, QUICK, "straight-to-goal", overwrite=True, **SETTINGS)

    with pytest.raises(RecordError, match=r"another program writes to .*set, so this one has stopped"):
        s2.generate_dataset(url, QUICK, "straight-to-goal", episodes=7, seed=6, advance=advance)
    assert contents(url) == contents(local[None])
    with pytest.raises(RecordError, match="already holds a data set"):
        s2.generate_dataset(url, QUICK, "straight-to-goal", episodes=7, seed=6)
    assert contents(url) == contents(local[None])


def test_of_two_programs_that_begin_together_one_stops_with_an_error(endpoint: str) -> None:
    url = f"s3://sets/{uuid.uuid4().hex}"
    code = (
        "import sys, time, sonata2d as s2; seed = int(sys.argv[2]); print(seed, flush=True); sys.stdin.readline()\n"
        "s2.generate_dataset(sys.argv[1], 'empty', 'straight-to-goal', episodes=30, seed=seed)"
    )
    pipe = subprocess.PIPE
    programs = [
        subprocess.Popen([sys.executable, "-c", code, url, str(seed)], stdin=pipe, stdout=pipe, stderr=pipe, text=True)
        for seed in (1, 2)
    ]
    for program in programs:  # both have imported the package
        assert program.stdout is not None
        assert program.stdout.readline().strip() in ("1", "2")
    for program in programs:
        assert program.stdin is not None
        program.stdin.write("\n")
        program.stdin.flush()
    errors = [program.communicate()[1] for program in programs]
    codes = [program.returncode for program in programs]
    assert sorted(codes) == [0, 1], errors
    assert "another program writes to" in errors[codes.index(1)].splitlines()[-1]
    assert {record.document["seed"] for record in s2.Dataset(url)} == {codes.index(0) + 1}
    assert verify(url) == []
    assert not [name for name in file_names(location(url)) if name.startswith(".")]


def test_a_mirror_image_that_another_program_replaces_is_an_error(
    store: str, local: dict[int | None, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def taken(folder: Path, work: Path, *rest: Any) -> Any:
        write_atomically(work / ".sonata2d-lock", b"another")
        write_atomically(work / "000000-mirror.json", b"{}")
        raise RecordError("no image")

    monkeypatch.setattr("sonata2d.datasets.transforms.mirror._listed_image", taken)
    with pytest.raises(RecordError, match="no image"):
        mirror_dataset(local[None], f"{store}/mirrored")
    assert sorted(file_names(location(f"{store}/mirrored"))) == [".sonata2d-lock", "000000-mirror.json"]


def test_data_sets_are_transformed_into_a_store(store: str, local: dict[int | None, Path], tmp_path: Path) -> None:
    for size, folder in local.items():
        mirror_dataset(folder, f"{store}/mirrored{size}")
        mirror_dataset(folder, tmp_path / f"mirrored{size}")
        assert contents(f"{store}/mirrored{size}") == contents(tmp_path / f"mirrored{size}")
        assert {*split_dataset(f"{store}/mirrored{size}")} == {"train", "dev", "test"}
        assert sum(map(len, s2.Dataset(f"{store}/mirrored{size}").parts.values())) == 7
        merge_datasets([folder, f"{store}/mirrored{size}"], f"{store}/both{size}")
        assert verify(f"{store}/both{size}") == []
        result = export_to(f"{store}/both{size}", "npz", f"{store}/arrays{size}")
        assert len(result.files) == len(file_names(location(f"{store}/arrays{size}"))) == 14
    result = export_to(local[SHARD], "parquet", f"{store}/tables", shard_size=SHARD)
    assert len(result.files) == 3 * 2 + 1
    assert len(import_from(f"{store}/tables", "parquet", f"{store}/back").files) == 7
    with pytest.raises(RecordError, match="already exists and is not empty"):
        mirror_dataset(local[None], f"{store}/mirroredNone")


def test_a_shard_that_is_replaced_by_one_of_the_same_size_is_read_anew(store: str) -> None:
    """Tar files are padded, so that many have the same size."""
    sizes, first = set(), {}
    for seed in range(3):
        settings: dict[str, Any] = {"episodes": 2, "shard_size": 2, "suffix": ".json.zst", "overwrite": True}
        s2.generate_dataset(f"{store}/set", QUICK, "straight-to-goal", seed=seed, **settings)
        dataset = s2.Dataset(f"{store}/set")
        assert [record.document["seed"] for record in dataset] == [seed, seed]
        sizes.add(location(f"{store}/set/shard-000000.tar").stat().st_size)
        first[seed] = dataset[0].time
    assert len(sizes) < len(first)


def test_a_second_export_replaces_the_first(store: str, local: dict[int | None, Path]) -> None:
    for _ in range(2):
        assert len(export_to(local[SHARD], "npz", f"{store}/arrays").files) == 7


def test_a_store_that_does_not_answer_is_one_error(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    s3fs = pytest.importorskip("s3fs")
    s3fs.S3FileSystem.clear_instance_cache()  # they keep the address
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:1")
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")  # else some seconds pass
    result = CliRunner().invoke(main, ["check", "s3://elsewhere/set"])
    s3fs.S3FileSystem.clear_instance_cache()
    assert result.exit_code == 2, result.output
    assert "s3://elsewhere cannot be reached (EndpointConnectionError" in result.output


def test_a_failed_transformation_leaves_nothing_in_a_store(
    store: str, local: dict[int | None, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def odd(folder: Path, work: Path, *rest: Any) -> Any:
        write_atomically(work / "000000-mirror.json", b"{}")
        raise RecordError("no image")

    monkeypatch.setattr("sonata2d.datasets.transforms.mirror._listed_image", odd)
    with pytest.raises(RecordError, match="no image"):
        mirror_dataset(local[None], f"{store}/mirrored")
    assert file_names(location(f"{store}/mirrored")) == []


def test_commands_take_urls(store: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quick.json").write_text(QUICK.model_dump_json())
    lines = f"""
    generate {store}/set --scenario quick.json --episodes 4 --shard-size 2 --workers 1
    check {store}/set --replay --workers 1
    describe {store}/set
    describe {store}/set/shard-000001.tar
    describe {store}/set/shard-000001.tar/000003.json
    render {store}/set -o sheet.png
    evaluate {store}/set --no-rerun --resamples 100 --workers 1 --page {store}/page.html
    evaluate --controller orca --scenario quick.json --episodes 2 --resamples 100 --workers 1 -o {store}/runs
    export {store}/set --to csv -o {store}/tracks --workers 1
    mirror {store}/set -o {store}/mirrored --workers 1
    split {store}/mirrored
    card {store}/mirrored
    merge {store}/set {store}/mirrored -o both
    check both
    """
    for line in lines.strip().splitlines():
        result = CliRunner().invoke(main, line.split(), prog_name="sonata2d")
        assert result.exit_code == 0, f"{line}: {result.output}"


def test_memory_belongs_to_one_process() -> None:
    with pytest.raises(WorkerError, match=r"memory://.* belongs to this process; use one worker"):
        s2.generate_dataset(f"memory://{uuid.uuid4().hex}/set", QUICK, "straight-to-goal", workers=2, **SETTINGS)


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("nonsense://bucket/set", "fsspec knows no protocol 'nonsense'"),
        ("s3://bucket-that-does-not-exist-anywhere/set", "cannot be read|cannot be written|does not exist"),
    ],
)
def test_a_wrong_url_is_one_error(endpoint: str, url: str, message: str) -> None:
    with pytest.raises((RecordError, ValueError, WorkerError), match=message):
        s2.generate_dataset(url, QUICK, "straight-to-goal", **SETTINGS)
    result = CliRunner().invoke(main, ["check", url], prog_name="sonata2d")
    assert result.exit_code in (1, 2)
    assert "Traceback" not in result.output


def test_files_of_a_server_are_renamed_into_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sonata2d.core.files.locations._OBJECT_STORES", set())  # memory stands for a file server
    path = location(f"memory://{uuid.uuid4().hex}/folder/a.json")
    write_atomically(path, b"{}")
    assert read_stored(path) == b"{}"
    write_atomically(path, b"[]")
    assert read_stored(path) == b"[]"
    assert file_names(path.parent) == ["a.json"]


def test_a_cluster_writes_to_a_store(endpoint: str, local: dict[int | None, Path], tmp_path: Path) -> None:
    url = f"s3://sets/{uuid.uuid4().hex}"
    with Cluster(tmp_path, workers=2) as cluster, DaskExecutor(cluster.address, patience=60.0) as executor:
        s2.generate_dataset(url, QUICK, "straight-to-goal", shard_size=SHARD, workers=executor, **SETTINGS)
        assert verify(url, workers=executor) == []
    assert contents(url) == contents(local[SHARD])


def test_a_url_of_this_machine_is_a_path(tmp_path: Path) -> None:
    path = location(f"file://{tmp_path}/a.json")
    write_atomically(path, b"{}")
    assert read_stored(path) == b"{}"
    assert isinstance(path, Path)
