"""The network `alt`: its features, its equations, its file, and what it learns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest

import sonata2d as s2
from sonata2d.benchmark import AltModel, fit_alt_model, read_row, run_benchmark, verify_row
from sonata2d.benchmark.alt import CONTEXT, FEATURES, features_of, read_contexts
from sonata2d.benchmark.rating import rated_episodes
from sonata2d.datasets.transforms.mirror import mirrored
from sonata2d.errors import BenchmarkError, ConfigError
from sonata2d.formats import export_to, import_from
from sonata2d.metrics.catalogue import METRICS
from sonata2d.metrics.trajectory import Trajectory
from tests.running import record_of

CROSSING = s2.ScenarioConfig(standing=(1, 3), wandering=2, tables=1, plants=1, rules={"time_limit": 20.0})
MIRRORED = [1, 3, 5, 6, 8]


def _record(controller: str = "straight-to-goal", seed: int = 0) -> s2.EpisodeRecord:
    return record_of(s2.generate(CROSSING, seed), s2.load_controller(controller))


def _model(hidden: int = 4, dense: int = 3) -> AltModel:
    """A network with random weights."""
    rng, inputs = np.random.default_rng(3), FEATURES + len(CONTEXT)
    shapes: dict[str, tuple[int, ...]] = {
        "mean": (inputs,), "deviation": (inputs,), "typical": (len(CONTEXT),), "weight_ih": (3 * hidden, inputs),
        "weight_hh": (3 * hidden, hidden), "bias_ih": (3 * hidden,), "bias_hh": (3 * hidden,),
        "dense0.weight": (dense, hidden + len(CONTEXT)), "dense0.bias": (dense,), "dense1.weight": (1, dense),
        "dense1.bias": (1,),
    }  # fmt: skip
    arrays = {name: rng.normal(size=shape).astype(np.float32).astype(float) for name, shape in shapes.items()}
    arrays["deviation"] = np.abs(arrays["deviation"]) + 0.5
    return AltModel("How?", 100, 2, 0.5, {"a ward at night": tuple(np.linspace(0.0, 1.0, 10).tolist())}, arrays)


def test_features_say_how_near_and_how_far() -> None:
    record = _record()
    rows = features_of(record)
    assert rows.shape[1] == FEATURES
    assert np.abs(rows).max() <= 1.0
    whole = record.until_arrival()
    assert len(rows) == pytest.approx((whole.states.time[-1] - whole.states.time[0]) / 0.2 + 1, abs=1)
    goal = record.scene().goal
    before = np.hypot(*(record.states.robot[0, :2] - (goal.x, goal.y))) / 10.0
    assert np.hypot(rows[0, 0], rows[0, 1]) == pytest.approx(before, abs=0.05)
    distance, reached, elapsed, end = rows[:, 12], rows[:, 14], rows[:, 16], rows[:, 17]
    assert distance[-1] < distance[0]
    assert reached[-1] == float(record.outcome.status == "goal")
    assert (np.diff(elapsed) > 0.0).all()
    assert elapsed[-1] == 1.0
    assert end.sum() == end[-1] == 1.0
    nearest = METRICS["human_clearance_min"].of(Trajectory(record))
    assert nearest is not None
    assert rows[-1, 32] == pytest.approx(nearest / 10.0, abs=1e-6)


def test_a_mirrored_episode_has_the_same_features_but_for_signs() -> None:
    record = _record(seed=2)
    signs = np.ones(FEATURES)
    signs[MIRRORED] = -1.0
    assert features_of(mirrored(record)) == pytest.approx(features_of(record) * signs, abs=2e-5)


def test_the_rating_depends_on_the_context_and_is_kept_in_the_file(tmp_path: Path) -> None:
    model, record = _model(), _record()
    model.save(tmp_path / "alt.npz")
    again = AltModel.load(tmp_path / "alt.npz")
    assert 0.0 < again(record) == model(record) < 1.0
    assert (again.question, again.contexts) == (model.question, dict(model.contexts))
    scene = s2.generate(CROSSING.model_copy(update={"context": "a ward at night"}), 0)
    changed = record_of(scene, s2.load_controller("straight-to-goal"))
    assert model(changed) != model(record)


def test_the_equations_are_those_of_pytorch() -> None:
    torch = pytest.importorskip("torch")
    model, record, hidden = _model(), _record(), 4
    weights = {name: torch.as_tensor(array, dtype=torch.float64) for name, array in model.arrays.items()}
    gru = torch.nn.GRU(FEATURES + len(CONTEXT), hidden).double()
    gru.load_state_dict({f"{name}_l0": weights[name] for name in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")})
    rows = torch.as_tensor(features_of(record))
    x = torch.cat((rows, weights["typical"].expand(len(rows), -1)), dim=1)
    _, last = gru(((x - weights["mean"]) / weights["deviation"]).clip(-5.0, 5.0))
    first = torch.cat((last[0], weights["typical"])) @ weights["dense0.weight"].T + weights["dense0.bias"]
    output = torch.nn.functional.leaky_relu(first) @ weights["dense1.weight"].T + weights["dense1.bias"]
    assert model(record) == pytest.approx(torch.sigmoid(output).item(), abs=1e-4)


def _labelled(folder: Path, episodes: int) -> None:
    """Imported episodes with labels that follow the clearance of people."""
    for k, controller in enumerate(("straight-to-goal", "social-force", "orca")):
        s2.generate_dataset(
            folder / controller, CROSSING, controller, episodes=episodes // 3, seed=k + 1, progress=False
        )
        export_to(folder / controller, "socnav3", folder / "raw" / controller)
    for k, file in enumerate(sorted((folder / "raw").glob("*/*.json"))):
        content = orjson.loads(file.read_bytes())
        record = s2.read_episode(folder / file.parent.name / file.name)
        nearest = METRICS["human_clearance_min"].of(Trajectory(record))
        assert nearest is not None
        del content["sonata2d"]
        for step in content["sequence"]:
            step.pop("sonata2d", None)
        content["label"] = round(min(1.0, 0.2 + 0.8 * nearest), 3)
        (folder / "foreign").mkdir(exist_ok=True)
        (folder / "foreign" / f"{k:06d}.json").write_bytes(orjson.dumps(content))
    import_from(folder / "foreign", "socnav3", folder / "runs")


@pytest.fixture(scope="module")
def labelled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("labelled") / "data"
    _labelled(folder, 120)
    return folder / "runs"


def test_labels_of_imported_files_are_ratings(labelled: Path) -> None:
    rated = rated_episodes([labelled], fewest=100, model="an alt model")
    assert len(rated.files) == 120
    assert rated.raters == 0
    assert min(rated.ratings) < 0.4 < 0.8 < max(rated.ratings)


def test_a_network_learns_what_labels_follow(labelled: Path, tmp_path: Path) -> None:
    pytest.importorskip("torch")
    table = {"a ward": dict.fromkeys(CONTEXT, 50)}
    (tmp_path / "contexts.json").write_bytes(orjson.dumps(table))
    model = fit_alt_model([labelled], contexts=tmp_path / "contexts.json")
    assert (model.episodes, model.raters) == (120, 0)
    assert model.correlation > 0.6
    records = [s2.read_episode(file) for file in sorted(labelled.glob("*.json"))[:40]]
    labels = [record.label for record in records]
    assert np.corrcoef([model(record) for record in records], labels)[0, 1] > 0.7


def test_a_row_has_a_column_of_the_network(tmp_path: Path) -> None:
    _model().save(tmp_path / "alt.npz")
    arguments: dict[str, Any] = {"parts": ["frontal-approach"], "scenes": 2, "scorers": [str(tmp_path / "alt.npz")]}
    run_benchmark("orca", tmp_path / "row", **arguments)
    assert 0.0 < read_row(tmp_path / "row")["all"]["advisory"]["learned.alt"]["value"] < 1.0
    (tmp_path / "alt.npz").unlink()
    assert verify_row(tmp_path / "row", rerun=True).badges == ("replayed", "re-run")


def test_two_files_of_the_same_name_are_refused(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    _model().save(tmp_path / "mine.npz")
    code = "import sonata2d as s2\n\nclass Mine(s2.StraightToGoal):\n    pass\n"
    (tmp_path / "mine" / "mine.py").write_text(code)
    (tmp_path / "mine" / "mine.npz").write_bytes(b"weights")
    with pytest.raises(ConfigError, match=r"are both named mine\.npz; rename one"):
        run_benchmark(
            f"{tmp_path / 'mine' / 'mine.py'}:Mine", tmp_path / "row", scenes=1, scorers=[str(tmp_path / "mine.npz")]
        )


@pytest.mark.parametrize(
    ("content", "reason"),
    [("[]", "no table of contexts"), ('{"a": {"urgency": 5}}', "'importance' is missing"), ("{", "no table"),
     (str({"a": dict.fromkeys(CONTEXT, 101)}).replace("'", '"'), "is not from 0 to 100")],
)  # fmt: skip
def test_damaged_tables_of_contexts_are_refused(content: str, reason: str, tmp_path: Path) -> None:
    (tmp_path / "contexts.json").write_text(content)
    with pytest.raises(BenchmarkError, match=reason):
        read_contexts(tmp_path / "contexts.json")


def test_files_that_are_no_networks_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BenchmarkError, match=r"is written to a \.npz file"):
        _model().save(tmp_path / "alt.json")
    (tmp_path / "alt.npz").write_bytes(b"PK")
    with pytest.raises(BenchmarkError, match="is no alt model"):
        AltModel.load(tmp_path / "alt.npz")
    model = _model()
    for name, array in (("weight_hh", np.zeros((3, 4))), ("deviation", np.zeros(FEATURES + 10)),
                        ("mean", np.full(FEATURES + 10, np.nan))):  # fmt: skip
        replace(model, arrays={**model.arrays, name: array}).save(tmp_path / "alt.npz")
        with pytest.raises(BenchmarkError, match=name):
            AltModel.load(tmp_path / "alt.npz")
    with pytest.raises(BenchmarkError, match=r"there is no model .*none\.npz"):
        run_benchmark("orca", tmp_path / "row", scenes=1, scorers=[str(tmp_path / "none.npz")])
