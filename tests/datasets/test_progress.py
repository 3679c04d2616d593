"""With `keep`, the first episodes with the requested outcomes are kept, for any number of workers or interruptions."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import orjson
import pytest

import sonata2d as s2
from sonata2d.core.snapshot import ControllerInfo
from sonata2d.datasets import merge_datasets, mirror_dataset, split_dataset, verify
from sonata2d.datasets.card.text import card_text
from sonata2d.datasets.generate import batches
from sonata2d.datasets.generate.progress import Batch, FailedEpisode, Progress
from sonata2d.datasets.generate.run import KEEPABLE, generate_dataset
from sonata2d.datasets.generate.specification import DatasetSpec
from sonata2d.datasets.manifest import read_manifest
from sonata2d.datasets.manifest.write import counts_of, sum_of
from sonata2d.errors import ControllerError, RecordError

from .test_generate import contents

pytestmark = pytest.mark.usefixtures("kept_processes")

QUICK = s2.ScenarioConfig(name="quick", standing=2, wandering=3, tables=1, rules={"time_limit": 6.0})


def generate(out: Path, **changes: Any) -> dict[str, Any]:
    arguments = {"controller": "straight-to-goal", "episodes": 8, "keep": ["goal"]}
    return read_manifest(generate_dataset(out, QUICK, **(arguments | changes)).path)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of eight episodes that reached the goal, generated without interruption."""
    out = tmp_path_factory.mktemp("kept") / "reference"
    generate(out)
    return out


def spec(episodes: int = 3) -> DatasetSpec:
    return DatasetSpec("by-hand", None, 0, episodes, ControllerInfo("x"), keep=("goal",))


def kept(episode: int) -> Batch:
    row = {"name": f"{episode:06d}.json", "episode": episode, "family": "", "outcome": "goal"}
    return Batch(episode, episode + 1, row, counts_of([row]), {})


def excluded(episode: int, outcome: str = "timeout") -> Batch:
    return Batch(episode, episode + 1, None, counts_of(()), {outcome: 1})


RESULTS: list[Batch] = [kept(0), excluded(1), kept(2), excluded(3, "contact"), kept(4), kept(5)]


def test_results_are_counted_by_number_in_any_order_of_arrival() -> None:
    for seed in range(20):
        progress = Progress(spec())
        for result in random.Random(seed).sample(RESULTS, len(RESULTS)):
            progress.add(result)
        assert [batch.number for batch in progress.batches if batch.row is not None] == [0, 2, 4]
        assert sum_of(batch.left_out for batch in progress.batches) == {"timeout": 1, "contact": 1}
        assert progress.is_finished


def test_a_failed_episode_ends_the_run_only_if_it_is_needed() -> None:
    error = FailedEpisode(6, ControllerError, "broken", None)
    progress = Progress(spec(3), [kept(0), kept(2)])
    assert [progress.add(result) for result in (error, excluded(1), kept(3))] == [0, 1, 1]
    assert (progress.is_finished, progress.failure, list(progress.pending())) == (True, None, [])
    progress = Progress(spec(4), [kept(k) for k in (0, 1, 2)])
    for result in (error, excluded(3), excluded(4)):
        progress.add(result)
    assert not progress.is_finished
    assert next(progress.pending()) == 5
    progress.add(excluded(5))
    assert progress.failure == error


def test_a_run_with_a_rare_outcome_is_aborted() -> None:
    progress = Progress(spec(100))
    for episode in range(199):
        progress.add(excluded(episode))
    with pytest.raises(RecordError, match=r"only 0 of the first 200 episodes ended in goal \(200 timeout\)"):
        progress.add(excluded(199))
    with pytest.raises(RecordError, match="only 6 of the first 301"):
        Progress(spec(100), [*map(kept, range(6)), *map(excluded, range(6, 400))])


def test_kept_episodes_have_the_numbers_and_bytes_of_a_run_without_keep(reference: Path, tmp_path: Path) -> None:
    manifest = read_manifest(reference)
    numbers = [file["episode"] for file in manifest["files"]]
    unfiltered = generate_dataset(tmp_path / "all", QUICK, "straight-to-goal", episodes=numbers[-1] + 1)
    assert numbers == [record.episode for record in unfiltered.filter(outcome="goal")]
    assert len(numbers) == 8 < numbers[-1] + 1
    for file in manifest["files"]:
        assert (reference / file["name"]).read_bytes() == (tmp_path / "all" / file["name"]).read_bytes()
    others = {key: count for key, count in read_manifest(unfiltered.path)["counts"]["outcome"].items() if key != "goal"}
    assert (manifest["keep"], manifest["left_out"], manifest["complete"]) == (["goal"], others, True)
    assert "keep" not in unfiltered
    assert "left_out" not in unfiltered


def test_the_number_of_workers_changes_no_byte_of_kept_episodes(reference: Path, tmp_path: Path) -> None:
    generate(tmp_path / "two", workers=2)
    assert contents(tmp_path / "two") == contents(reference)


@pytest.mark.parametrize("without_log", [False, True])
def test_interrupting_and_resuming_gives_the_same_bytes(reference: Path, tmp_path: Path, without_log: bool) -> None:
    class Interruption(Exception): ...

    steps = []

    def stop(step: int) -> None:
        steps.append(step)
        if sum(steps) == 5:
            raise Interruption

    with pytest.raises(Interruption):
        generate(tmp_path / "out", advance=stop)
    manifest = read_manifest(tmp_path / "out")
    assert not manifest["complete"]
    assert len(manifest["files"]) == 5, "other commands see the episodes"
    (tmp_path / "out/000099.json").write_bytes(b"cut short")
    log = tmp_path / "out/run.jsonl"
    if without_log:
        log.unlink()
    else:
        log.write_bytes(log.read_bytes() + b'{"left_out":9')
    steps = [100]
    generate(tmp_path / "out", resume=True, advance=steps.append)
    assert steps[:2] == [100, 5] if not without_log else sum(steps) == 108
    assert contents(tmp_path / "out") == contents(reference)


def test_excluded_episodes_are_not_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    episodes_run: list[int] = []
    run = batches.run_episode

    def counted(job: Any, controller: Any, episode: int, store: Any) -> FailedEpisode | None:
        episodes_run.append(episode)
        return run(job, controller, episode, store)

    monkeypatch.setattr(batches, "run_episode", counted)
    generate(tmp_path / "out", episodes=5)
    generate(tmp_path / "out", episodes=8, resume=True)
    assert episodes_run == list(range(len(episodes_run)))


def test_resumption_can_add_episodes_but_not_change_the_kept_outcomes(reference: Path, tmp_path: Path) -> None:
    generate(tmp_path / "out", episodes=3)
    for other in ({"keep": []}, {"keep": ["timeout"]}, {"keep": ["goal", "timeout"]}):
        with pytest.raises(RecordError, match=r"keep \['goal'\] stored"):
            generate(tmp_path / "out", resume=True, **other)
    generate(tmp_path / "out", resume=True)
    assert contents(tmp_path / "out") == contents(reference)
    generate(tmp_path / "all", keep=[], episodes=1)
    with pytest.raises(RecordError, match="keep None stored"):
        generate(tmp_path / "all", episodes=1, resume=True)


def test_the_order_of_the_kept_outcomes_changes_no_byte(tmp_path: Path) -> None:
    for name, keep in (("a", ["timeout", "goal"]), ("b", ["goal", "timeout", "goal"])):
        generate(tmp_path / name, keep=keep, episodes=3)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    with pytest.raises(ValueError, match="keep accepts goal, timeout, contact, stopped, regenerate; got 'error'"):
        generate(tmp_path / "c", keep=["error"])
    assert "error" not in KEEPABLE


def test_kept_episodes_can_be_verified_split_mirrored_and_merged(reference: Path, tmp_path: Path) -> None:
    assert verify(reference, replay=True, rerun=True) == []
    mirror_dataset(reference, tmp_path / "mirror")
    merged = merge_datasets([reference, tmp_path / "mirror"], tmp_path / "both")
    split_dataset(tmp_path / "both", {"train": 0.5, "test": 0.5})
    assert verify(tmp_path / "mirror", replay=True) == []
    assert verify(tmp_path / "both") == []
    assert [source["keep"] for source in merged["sources"]] == [["goal"], ["goal"]]
    assert [source["left_out"] for source in merged["sources"]] == [read_manifest(reference)["left_out"]] * 2


def test_the_card_states_kept_and_omitted_outcomes(reference: Path, tmp_path: Path) -> None:
    manifest = read_manifest(reference)
    text = (reference / "README.md").read_text()
    left_out = manifest["left_out"]["timeout"]
    assert "--controller straight-to-goal --keep goal" in text
    assert f"Only episodes with these outcomes are kept: goal. Left out: {left_out} timeout." in text
    source = {"name": "made", "scenario": "quick", "files": [], **{k: manifest[k] for k in ("keep", "left_out")}}
    assert "goal (files `made__…`)" in card_text(manifest | {"sources": [source | {"settings": {}, "seed": 0}]})
    assert "Left out" not in card_text({k: v for k, v in manifest.items() if k not in ("keep", "left_out")})


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"left_out": {"timeout": 1000}}, "left_out"),
        ({"keep": ["timeout"]}, "keep"),
        ({"episodes": 9}, "files"),
    ],
)
def test_a_manifest_with_wrong_counts_is_found(
    reference: Path, tmp_path: Path, change: dict[str, Any], place: str
) -> None:
    mirror_dataset(reference, tmp_path / "image")
    path = tmp_path / "image/manifest.json"
    path.write_bytes(orjson.dumps(orjson.loads(path.read_bytes()) | change))
    assert place in {problem.place for problem in verify(tmp_path / "image")}


class Broken(s2.Controller):
    """Raises in episode 3; asks for another scene in even episodes and never moves in odd ones."""

    def reset(self, scene: s2.Scene) -> None:
        self._episode = scene.episode

    def act(self, snapshot: s2.Snapshot) -> Any:
        if self._episode == 3:
            raise ArithmeticError("cannot go on")
        return s2.Twist() if self._episode % 2 else s2.Regenerate()


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_beyond_the_last_requested_episode_is_ignored(tmp_path: Path, workers: int) -> None:
    manifest = generate(
        tmp_path / "out", controller=f"{__name__}:Broken", keep=["regenerate"], episodes=2, workers=workers
    )
    assert [file["episode"] for file in manifest["files"]] == [0, 2]
    assert not (tmp_path / "out/failed").exists()
    with pytest.raises(ControllerError, match=r"episode 3 of seed 0: .*cannot go on"):
        generate(tmp_path / "more", controller=f"{__name__}:Broken", keep=["regenerate"], episodes=3, workers=workers)
