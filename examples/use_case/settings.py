"""All settings of the use case: the sizes of its stages, the recipes of the trainings, the seeds of the scenes.

The environment variable `SONATA2D_USE_CASE` selects the size: `full` (default) or `small`, which runs every stage with
few episodes and epochs, to see that all works. `run.py --small` sets it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

SIZE_VARIABLE = "SONATA2D_USE_CASE"
PRESET = "sonata-2020"
EXPERT = "social-planner"
PARTS = {"train": 0.9, "dev": 0.05, "test": 0.05}
OURS = "R-GCN"  # title of the network `paper`, which has the layers of the published one, but other weights
TIME_LIMIT = 30.0  # s: a learner that has not reached the goal by then is stuck
THREADS = 1  # the order of sums, and so their bits, depend on it; two trainings at a time use two cores better

# Seeds of the scenes. Aggregation records scenes of seed + 1 in its first round, and so on.
DATA_SEED, AGGREGATION_SEED, BIAS_SEED, SHIPPING_SEED = 2020, 3000, 4000, 5000
EVALUATION_SEEDS = {"few": 60, "many": 1000, "everywhere": 30}


@dataclass(frozen=True)
class Recipe:
    """Settings of a training. The names are recorded in `state.pt`.

    Attributes:
        rate, decay: learning rate and weight decay of Adam.
        fading: whether the learning rate falls to zero along half a cosine.
        batch: graphs per step.
        epochs: maximum number of epochs.
        every: epochs between evaluations of the dev part.
        patience: evaluations without improvement after which the training ends.
    """

    rate: float
    decay: float
    fading: bool
    batch: int
    epochs: int
    every: int
    patience: int


@dataclass(frozen=True)
class Settings:
    """Sizes of the stages.

    Attributes:
        episodes: runs of the expert that reach the goal.
        recipes: of the trainings, by network.
        rounds, met, epochs: of data-set aggregation: rounds, runs of the learner per round, epochs per round.
        scenes: scenes of each evaluation; of `everywhere`, in each scenario.
        bias: scenes in which learner and expert are compared.
        fewest_runs: runs that a mean by clearance needs.
        careful: runs of the careful expert for the shipped weights, by scenario; `other` in every other scenario.
        shipped_met: runs of the learner in each round for the shipped weights, in the same form.
        shipped_rounds, shipped_epochs: rounds of data-set aggregation for the shipped weights, epochs per round.
    """

    episodes: int
    recipes: Mapping[str, Recipe]
    rounds: int
    met: int
    epochs: int
    scenes: Mapping[str, int]
    bias: int
    fewest_runs: int
    careful: Mapping[str, int]
    shipped_met: Mapping[str, int]
    shipped_rounds: int
    shipped_epochs: int

    def careful_episodes(self, scenario: str) -> int:
        """Runs of the careful expert in a scenario."""
        return self.careful.get(scenario, self.careful["other"])

    def shipped_episodes(self, scenario: str) -> int:
        """Runs of the learner in a scenario, for the shipped weights."""
        return self.shipped_met.get(scenario, self.shipped_met["other"])


SIZES = {
    "full": Settings(
        episodes=3092,  # as in the paper
        recipes={
            "paper": Recipe(5e-4, 1e-9, fading=False, batch=40, epochs=40, every=5, patience=5),
            "attention": Recipe(1e-3, 1e-9, fading=True, batch=64, epochs=30, every=5, patience=8),
        },
        rounds=2,
        met=300,
        epochs=8,
        scenes={"few": 60, "many": 1000, "everywhere": 20},
        bias=60,
        fewest_runs=10,
        careful={PRESET: 600, "sonata-2020-crowded": 500, "lively": 600, "other": 40},
        shipped_met={PRESET: 350, "sonata-2020-crowded": 300, "lively": 350, "other": 30},
        shipped_rounds=4,
        shipped_epochs=10,
    ),
    "small": Settings(
        episodes=40,
        recipes={
            "paper": Recipe(5e-4, 1e-9, fading=False, batch=40, epochs=4, every=2, patience=5),
            "attention": Recipe(1e-3, 1e-9, fading=True, batch=64, epochs=4, every=2, patience=8),
        },
        rounds=1,
        met=4,
        epochs=1,
        scenes={"few": 3, "many": 4, "everywhere": 1},
        bias=3,
        fewest_runs=2,
        careful={PRESET: 4, "sonata-2020-crowded": 1, "other": 1},
        shipped_met={PRESET: 2, "sonata-2020-crowded": 1, "other": 1},
        shipped_rounds=1,
        shipped_epochs=1,
    ),
}


def title_of(name: str) -> str:
    """The name of a controller or a network in tables and figures."""
    return name.replace("paper", OURS, 1) if name.startswith("paper") else name


SIZE = os.environ.get(SIZE_VARIABLE, "full")
if SIZE not in SIZES:
    raise ValueError(f"{SIZE_VARIABLE} is {SIZE!r}; it must be one of {', '.join(SIZES)}")
SETTINGS = SIZES[SIZE]
