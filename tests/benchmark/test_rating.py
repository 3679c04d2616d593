"""Rating models: what they learn from ratings, and how rows keep them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import orjson
import pytest

import sonata2d as s2
from sonata2d.benchmark import fit_rating_model, read_row, run_benchmark, table_of, verify_row
from sonata2d.benchmark.rating import RatingModel
from sonata2d.benchmark.scoring import SCORES, values_of
from sonata2d.collect.rating import Rating, append_rating, path_for
from sonata2d.core.labels import LabelSpec
from sonata2d.errors import BenchmarkError, RecordError
from sonata2d.record.files import sha256_of

SPEC = LabelSpec("slider", question="How polite was the robot?")
MODEL = RatingModel("How?", 30, 2, 0.5, ("psc", "stl"), (0.8, 0.5), (0.1, 0.2), (0.05, -0.02), 0.6)


def _rate(folder: Path, rater: str, spec: LabelSpec, label: float, file: Path) -> None:
    path = path_for(folder, rater)
    path.parent.mkdir(exist_ok=True)
    rating = Rating(rater, file.name, "x", sha256_of(file), label, 1, "2026-01-02T03:04:05Z", 5.0, True, spec)
    append_rating(path, rating)


@pytest.fixture(scope="module")
def rated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty episodes, whose ratings follow personal space, with noise."""
    folder = tmp_path_factory.mktemp("rated") / "runs"
    config = s2.ScenarioConfig(standing=(1, 4), wandering=(0, 3), tables=0, plants=0, rules={"time_limit": 15.0})
    dataset = s2.generate_dataset(folder, config, "straight-to-goal", episodes=40, seed=4, progress=False)
    rng = np.random.default_rng(1)
    for file in dataset.files:
        psc = values_of(s2.read_episode(file), None)["psc"]
        assert psc is not None
        for rater in ("a", "b"):
            label = float(np.clip(0.2 + 0.7 * psc + 0.05 * rng.standard_normal(), 0.0, 1.0).round(4))
            _rate(folder, rater, SPEC, label, file)
    return folder


def test_a_model_learns_what_ratings_follow(rated: Path) -> None:
    model = fit_rating_model([rated])
    assert (model.episodes, model.raters, model.question) == (40, 2, "How polite was the robot?")
    assert model.correlation > 0.6
    weights = dict(zip(model.features, model.weights, strict=True))
    assert weights["psc"] == max(weights.values(), key=abs) > 0.0
    assert fit_rating_model([rated]) == model


def test_a_prediction_is_a_rating_between_0_and_1() -> None:
    assert MODEL({"psc": 0.9, "stl": 0.5}) == pytest.approx(0.65)
    assert MODEL({"psc": None, "stl": None}) == 0.6
    assert MODEL({"psc": 1e6, "stl": 0.5}) == 1.0


def test_a_row_keeps_the_model_of_its_advisory_column(tmp_path: Path) -> None:
    MODEL.save(tmp_path / "kindness.json")
    assert RatingModel.load(tmp_path / "kindness.json") == MODEL
    folder = tmp_path / "row"
    arguments = {"parts": ["frontal-approach"], "scenes": 2, "scorers": [str(tmp_path / "kindness.json")]}
    run_benchmark("orca", folder, **arguments)  # type: ignore[arg-type]
    assert 0.0 < read_row(folder)["all"]["advisory"]["learned.kindness"]["value"] < 1.0
    assert "kindness" in table_of([folder]).html()
    (tmp_path / "kindness.json").unlink()
    assert verify_row(folder, rerun=True).badges == ("replayed", "re-run")
    content = orjson.loads((folder / "controller" / "kindness.json").read_bytes())
    (folder / "controller" / "kindness.json").write_bytes(orjson.dumps(content | {"bias": 0.9}))
    assert verify_row(folder).problems == ("controller/kindness.json is another file than the one that was run",)


def test_ratings_that_teach_nothing_are_refused(tmp_path: Path, rated: Path) -> None:
    with pytest.raises(RecordError, match="holds no episode files"):
        fit_rating_model([tmp_path])
    config = s2.load_scenario("empty")
    dataset = s2.generate_dataset(tmp_path / "runs", config, "straight-to-goal", episodes=1, progress=False)
    with pytest.raises(BenchmarkError, match="needs 30 rated episodes or more, got 0"):
        fit_rating_model([tmp_path / "runs"])
    _rate(tmp_path / "runs", "a", LabelSpec("text"), "good", dataset.files[0])  # type: ignore[arg-type]
    with pytest.raises(BenchmarkError, match="of the kind text are no numbers"):
        fit_rating_model([tmp_path / "runs"])
    _rate(tmp_path / "runs", "b", SPEC, 0.5, dataset.files[0])
    (tmp_path / "runs" / "ratings" / "a.jsonl").unlink()
    _rate(tmp_path / "runs", "c", LabelSpec("yes_no"), True, dataset.files[0])
    with pytest.raises(BenchmarkError, match="2 questions; give folders with one"):
        fit_rating_model([tmp_path / "runs"])


@pytest.mark.parametrize(
    "content",
    [b"[]", b"{}", b'{"format":"sonata2d-rating-model","version":2}',
     orjson.dumps({"format": "sonata2d-rating-model", "version": 1, "features": ["psc"], "mean": []})],
)  # fmt: skip
def test_files_that_are_no_models_are_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "model.json").write_bytes(content)
    with pytest.raises(BenchmarkError, match="is no rating model"):
        RatingModel.load(tmp_path / "model.json")
    with pytest.raises(BenchmarkError, match=r"is written to a \.json file"):
        MODEL.save(tmp_path / "model.npz")
    assert set(MODEL.features) <= set(SCORES)
