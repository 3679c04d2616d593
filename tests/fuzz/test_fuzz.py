"""A small share of the cases of `python -m tests.fuzz`, and damage that random cases seldom do."""

from __future__ import annotations

import json
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

from sonata2d.errors import ControllerError
from sonata2d.formats.tracks.observations import require_few
from sonata2d.learning.weights import read_weights

pytest.importorskip("resource", reason="needs the limits of POSIX systems")
pytest.importorskip("pyarrow", reason="pyarrow comes with the parquet extra")

from .runner import ALL, run_case
from .samples import make_samples
from .targets import KINDS, Refusal, imported, run, use_arguments

pytestmark = pytest.mark.usefixtures("kept_processes")

CASES = 8  # of each kind


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    make_samples(folder)
    return folder


@pytest.mark.parametrize("kind", ALL)
def test_damaged_input_is_accepted_or_refused_with_one_line(kind: str, samples: Path, tmp_path: Path) -> None:
    for index in range(CASES):
        (work := tmp_path / str(index)).mkdir()
        with warnings.catch_warnings(action="ignore"):
            warnings.simplefilter("error", RuntimeWarning)
            result = run_case(kind, 0, index, samples, work)
        assert result.status in ("accepted", "refused"), f"{result.detail} (case {index})"


@pytest.mark.parametrize("kind", KINDS)
def test_undamaged_input_is_accepted(kind: str, samples: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number, use in enumerate(dict.fromkeys(KINDS[kind].uses)):
        work = tmp_path / str(number)
        shutil.copytree(samples / (KINDS[kind].folder or kind), work)
        monkeypatch.chdir(work)
        with warnings.catch_warnings(action="ignore"):
            use(sorted(work.glob(KINDS[kind].damaged[0]))[0])


@pytest.mark.parametrize("name", ["sonata", "socnav3", "trajnet"])
@pytest.mark.parametrize("depth", [300, 2000, 100_000])
def test_deeply_nested_files_are_refused(name: str, depth: int, tmp_path: Path) -> None:
    path = tmp_path / ("deep.ndjson" if name == "trajnet" else "deep.json")
    for content in (b"[" * depth + b"]" * depth, b'{"sequence":' * depth + b"1" + b"}" * depth):
        path.write_bytes(content)
        with pytest.raises(Refusal, match=path.name):
            imported(name, path)


def test_sparse_tracks_are_refused_before_memory_is_allocated(tmp_path: Path) -> None:
    rows = [f"{2 * k + late},{k},0,{k % 9}" for k in range(3000) for late in (0, 1)]
    (tmp_path / "000000.csv").write_text("\n".join(rows))
    with pytest.raises(Refusal, match="6000 positions spread over 6000 frames of 3000 people"):
        imported("csv", tmp_path / "000000.csv")
    (tmp_path / "000000.csv").write_text("0,1,0,0\n1,1,0,0\n66998,2,0,0\n66999,2,0,0")
    with pytest.raises(Refusal, match="4 positions spread over 67000 frames of 2 people; the limit is 63636 frames"):
        imported("csv", tmp_path / "000000.csv")  # a frame takes memory by itself
    for frames, people, positions in ((1807, 390, 6544), (1934, 360, 8908), (63_000, 2, 4)):
        require_few(frames, people, positions)  # the first two are the recordings of ETH
    lines = [{"track": {"f": f, "p": 2**36, "x": 0, "y": 0}} for f in (0, 1, 10**10)]
    (tmp_path / "a.ndjson").write_text("\n".join(map(json.dumps, lines)))
    with pytest.raises(Refusal, match="frames of 2 people"):
        imported("trajnet", tmp_path / "a.ndjson")


def test_a_manifest_of_countless_episodes_is_checked(samples: Path, tmp_path: Path) -> None:
    shutil.copytree(samples / "dataset" / "set", tmp_path / "set")
    path = tmp_path / "set" / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_bytes()) | {"episodes": 10**18}))
    with pytest.raises(Refusal, match="must list the episodes 0 to 999999999999999999"):
        run("check D", path)


def test_weights_that_unpack_to_gigabytes_are_refused(tmp_path: Path) -> None:
    header = np.array(json.dumps({"graph": "modern", "kind": "rgcn", "note": {}}))
    np.savez_compressed(tmp_path / "w.npz", about=header, **{"layer0.weight": np.zeros(20_000_000, np.float32)})
    with pytest.raises(ControllerError, match=r"unpacks from \d+ to 80\d+ bytes; the limit is 67108864"):
        read_weights(tmp_path / "w.npz")


@pytest.mark.parametrize("word", ["a\0b", "x" * 5000, "\0"])
def test_impossible_paths_are_refused(word: str) -> None:
    for line in (["describe", word], ["generate", word], ["render", word, "-o", "x.svg"], ["mirror", "a", "-o", word]):
        with pytest.raises(Refusal, match="cannot be a path"):
            use_arguments(line)


def test_a_scenario_in_another_encoding_says_so(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    for encoding in ("utf-16", "latin-1"):
        path.write_bytes("name: Zoë\n".encode(encoding))
        with pytest.raises(Refusal, match="is not UTF-8 text"):
            run("scenarios show F", path)
    path.write_bytes("name: Zoë\n".encode("utf-8-sig"))
    run("scenarios show F", path)
