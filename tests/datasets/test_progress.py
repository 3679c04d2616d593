"""Only runs that ended as asked are kept: the first by number, whoever makes them and however often interrupted."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import orjson
import pytest

import sonata2d as s2
from sonata2d.core.snapshot import Author
from sonata2d.datasets.card import card
from sonata2d.datasets.generate import KEEPABLE, generate_dataset
from sonata2d.datasets.manifest import DatasetSpec, Entry, read_manifest
from sonata2d.datasets.merge import merge_datasets
from sonata2d.datasets.mirror import mirror_dataset
from sonata2d.datasets.progress import Failure, LeftOut, Result, Tally
from sonata2d.datasets.split import split_dataset
from sonata2d.datasets.verification import verify
from sonata2d.errors import ControllerError, RecordError

from .test_generate import content

QUICK = s2.ScenarioConfig(name="quick", standing=2, wandering=3, tables=1, rules={"time_limit": 6.0})


def make(out: Path, **changes: Any) -> dict[str, Any]:
    asked = {"controller": "straight-to-goal", "episodes": 8, "keep": ["goal"]}
    return generate_dataset(out, QUICK, **(asked | changes))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("kept") / "made"
    make(out)
    return out


def plan(episodes: int = 3) -> DatasetSpec:
    return DatasetSpec("by-hand", None, 0, episodes, Author("x"), keep=("goal",))


def kept(episode: int) -> Entry:
    return Entry(f"{episode:06d}.json", "", 1, episode, "", "goal", 1)


RESULTS: list[Result] = [kept(0), LeftOut(1, "timeout"), kept(2), LeftOut(3, "contact"), kept(4), kept(5)]


def test_results_count_by_number_in_whatever_order_they_come() -> None:
    for seed in range(20):
        tally = Tally(plan())
        for result in random.Random(seed).sample(RESULTS, len(RESULTS)):
            tally.take(result)
        assert [entry.episode for entry in tally.kept] == [0, 2, 4]
        assert tally.left_out == {"timeout": 1, "contact": 1}
        assert tally.is_over


def test_an_error_ends_it_only_where_it_is_needed() -> None:
    error = Failure(6, ControllerError, "broken", None)
    tally = Tally(plan(3), [kept(0), kept(2)])
    assert [tally.take(result) for result in (error, LeftOut(1, "timeout"), kept(3))] == [0, 1, 1]
    assert (tally.is_over, tally.failure, list(tally.missing())) == (True, None, [])
    tally = Tally(plan(4), [kept(k) for k in (0, 1, 2)])
    for result in (error, LeftOut(3, "timeout"), LeftOut(4, "timeout")):
        tally.take(result)
    assert not tally.is_over
    assert next(tally.missing()) == 5
    tally.take(LeftOut(5, "timeout"))
    assert tally.failure == error


def test_an_outcome_that_hardly_ever_comes_is_refused() -> None:
    tally = Tally(plan(100))
    for episode in range(199):
        tally.take(LeftOut(episode, "timeout"))
    with pytest.raises(RecordError, match=r"only 0 of the first 200 episodes ended in goal \(200 timeout\)"):
        tally.take(LeftOut(199, "timeout"))
    with pytest.raises(RecordError, match="only 6 of the first 301"):
        Tally(plan(100), [*map(kept, range(6)), *(LeftOut(k, "timeout") for k in range(6, 400))])


def test_kept_are_the_first_that_ended_so_with_the_numbers_and_bytes_that_they_have_anyway(
    made: Path, tmp_path: Path
) -> None:
    manifest = read_manifest(made)
    numbers = [file["episode"] for file in manifest["files"]]
    every = generate_dataset(tmp_path / "all", QUICK, "straight-to-goal", episodes=numbers[-1] + 1)
    assert numbers == [file["episode"] for file in every["files"] if file["outcome"] == "goal"]
    assert len(numbers) == 8 < numbers[-1] + 1
    for file in manifest["files"]:
        assert (made / file["name"]).read_bytes() == (tmp_path / "all" / file["name"]).read_bytes()
    others = {key: count for key, count in every["counts"]["outcome"].items() if key != "goal"}
    assert (manifest["keep"], manifest["left_out"], manifest["complete"]) == (["goal"], others, True)
    assert "keep" not in every
    assert "left_out" not in every


def test_workers_change_no_byte_of_what_is_kept(made: Path, tmp_path: Path) -> None:
    make(tmp_path / "two", workers=2)
    assert content(tmp_path / "two") == content(made)


@pytest.mark.parametrize("forgets", [False, True])
def test_interrupted_anywhere_and_resumed_it_is_the_same_bytes(made: Path, tmp_path: Path, forgets: bool) -> None:
    class Enough(Exception): ...

    steps = []

    def stop(step: int) -> None:
        steps.append(step)
        if sum(steps) == 5:
            raise Enough

    with pytest.raises(Enough):
        make(tmp_path / "out", advance=stop)
    assert not read_manifest(tmp_path / "out")["complete"]
    (tmp_path / "out/000099.json").write_bytes(b"cut short")
    log = tmp_path / "out/run.jsonl"
    if forgets:
        log.unlink()
    else:
        log.write_bytes(log.read_bytes() + b'{"left_out":9')
    steps = [100]
    make(tmp_path / "out", resume=True, advance=steps.append)
    assert steps[:2] == [100, 5] if not forgets else sum(steps) == 108
    assert content(tmp_path / "out") == content(made)


def test_what_was_left_out_is_not_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from sonata2d.datasets import generate as batch

    asked: list[int] = []
    run = batch._made
    monkeypatch.setattr(batch, "_made", lambda job, mind, k: (asked.append(k), run(job, mind, k))[1])
    make(tmp_path / "out", episodes=5)
    make(tmp_path / "out", episodes=8, resume=True)
    assert asked == list(range(len(asked)))


def test_more_may_be_asked_for_later_but_nothing_else_may_be_kept(made: Path, tmp_path: Path) -> None:
    make(tmp_path / "out", episodes=3)
    for other in ({"keep": []}, {"keep": ["timeout"]}, {"keep": ["goal", "timeout"]}):
        with pytest.raises(RecordError, match=r"keep \['goal'\] there"):
            make(tmp_path / "out", resume=True, **other)
    make(tmp_path / "out", resume=True)
    assert content(tmp_path / "out") == content(made)
    make(tmp_path / "all", keep=[], episodes=1)
    with pytest.raises(RecordError, match="keep None there"):
        make(tmp_path / "all", episodes=1, resume=True)


def test_outcomes_are_kept_in_whichever_order_they_are_named(tmp_path: Path) -> None:
    for name, keep in (("a", ["timeout", "goal"]), ("b", ["goal", "timeout", "goal"])):
        make(tmp_path / name, keep=keep, episodes=3)
    assert content(tmp_path / "a") == content(tmp_path / "b")
    with pytest.raises(ValueError, match="keep must be of goal, timeout, contact, stopped, regenerate; got 'error'"):
        make(tmp_path / "c", keep=["error"])
    assert "error" not in KEEPABLE


def test_a_set_of_kept_runs_can_be_proven_split_mirrored_and_merged(made: Path, tmp_path: Path) -> None:
    assert verify(made, replay=True, rerun=True) == []
    mirror_dataset(made, tmp_path / "mirror")
    merged = merge_datasets([made, tmp_path / "mirror"], tmp_path / "both")
    split_dataset(tmp_path / "both", {"train": 0.5, "test": 0.5})
    assert verify(tmp_path / "mirror", replay=True) == []
    assert verify(tmp_path / "both") == []
    assert [source["keep"] for source in merged["sources"]] == [["goal"], ["goal"]]
    assert [source["left_out"] for source in merged["sources"]] == [read_manifest(made)["left_out"]] * 2


def test_the_card_tells_what_was_left_out(made: Path, tmp_path: Path) -> None:
    manifest = read_manifest(made)
    text = (made / "README.md").read_text()
    left_out = manifest["left_out"]["timeout"]
    assert "--controller straight-to-goal --keep goal" in text
    assert f"Kept are runs that ended so: goal. Left out were {left_out} timeout." in text
    source = {"name": "made", "scenario": "quick", "files": [], **{k: manifest[k] for k in ("keep", "left_out")}}
    assert "goal (files `made__…`)" in card(manifest | {"sources": [source | {"settings": {}, "seed": 0}]})
    assert "left out" not in card({k: v for k, v in manifest.items() if k not in ("keep", "left_out")})


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"left_out": {"timeout": 1000}}, "left_out"),
        ({"keep": ["timeout"]}, "keep"),
        ({"episodes": 9}, "files"),
    ],
)
def test_a_manifest_that_does_not_add_up_is_found(
    made: Path, tmp_path: Path, change: dict[str, Any], place: str
) -> None:
    mirror_dataset(made, tmp_path / "twin")
    path = tmp_path / "twin/manifest.json"
    path.write_bytes(orjson.dumps(orjson.loads(path.read_bytes()) | change))
    assert place in {problem.place for problem in verify(tmp_path / "twin")}


class Broken(s2.Controller):
    """Fails in the fourth episode, and is at the goal at once or never."""

    def reset(self, scene: s2.Scene) -> None:
        self._episode = scene.episode

    def act(self, snapshot: s2.Snapshot) -> Any:
        if self._episode == 3:
            raise ArithmeticError("cannot go on")
        return s2.Twist() if self._episode % 2 else s2.Regenerate()


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_beyond_the_last_episode_asked_for_ends_nothing(tmp_path: Path, workers: int) -> None:
    manifest = make(tmp_path / "out", controller=f"{__name__}:Broken", keep=["regenerate"], episodes=2, workers=workers)
    assert [file["episode"] for file in manifest["files"]] == [0, 2]
    assert not (tmp_path / "out/failed").exists()
    with pytest.raises(ControllerError, match=r"episode 3: .*cannot go on"):
        make(tmp_path / "more", controller=f"{__name__}:Broken", keep=["regenerate"], episodes=3, workers=workers)
