"""The steps of a participant, and the order of the runs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from .config import StudyConfig
from .questions import Entry
from .texts import Text

PRACTICE_TEXT = "practice-text"  # id of the page before the practice
PRACTICE_CHECK = "practice-check"  # id of that page if it has questions
_StepKind = Literal["page", "consent", "questions", "practice", "run", "ratings", "thanks", "screened"]


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a study.

    Attributes:
        id: unique in the study, such as `page-1`.
        kind: activity of the participant.
        title, text: of a page; of questions, what is above them.
        statements: of the consent.
        entries: questions.
        run: number of a run or a practice run, from 0, or of the run that questions are about.
        block: number of the block of runs or ratings.
        scene: number of the scene within its block.
        is_personal: whether answers are personal by default.
    """

    id: str
    kind: _StepKind
    title: Text = ""
    text: Text = ""
    statements: tuple[Text, ...] = ()
    entries: tuple[Entry, ...] = ()
    run: int | None = None
    block: int = 0
    scene: int = 0
    is_personal: bool = False


SCREENED_OUT = Step("screened-out", "screened")  # in place of all others, after a wrong answer that ends the study


def steps_of(config: StudyConfig, index: int, row: int | None = None) -> list[Step]:
    """The steps of a participant.

    Args:
        config: settings of the study.
        index: number of the participant, from 0.
        row: as of `run_order`.
    """
    steps = [
        Step(f"page-{k}", "page", title=page.title, text=page.text) for k, page in enumerate(config.pages, start=1)
    ]
    if config.consent is not None:
        consent = config.consent
        steps.append(Step("consent", "consent", title=consent.title, text=consent.text, statements=consent.statements))
    if config.demographics:
        steps.append(Step("demographics", "questions", entries=config.demographics, is_personal=True))
    practice = config.practice
    if practice is not None:
        if practice.check:
            steps.append(Step(PRACTICE_CHECK, "questions", text=practice.text or "", entries=practice.check))
        elif practice.text is not None:
            steps.append(Step(PRACTICE_TEXT, "page", text=practice.text))
        steps += [
            Step(f"practice-{k + 1}", "practice", run=k, block=len(config.runs), scene=k) for k in range(practice.runs)
        ]
    steps += _driving_steps(config, index, row)
    for k, block in enumerate(config.ratings):
        if block.text is not None:
            steps.append(Step(f"ratings-{block.name}-text", "page", text=block.text))
        steps.append(Step(f"ratings-{block.name}", "ratings", block=k))
    if config.end:
        steps.append(Step("end", "questions", entries=config.end))
    thanks = config.thanks
    steps.append(Step("thanks", "thanks", title=thanks.title, text=thanks.text) if thanks else Step("thanks", "thanks"))
    return steps


def _driving_steps(config: StudyConfig, index: int, row: int | None) -> list[Step]:
    """The runs, each followed by its questions."""
    steps: list[Step] = []
    previous = None
    for number, (block, scene) in enumerate(run_order(config, index, row)):
        text = config.runs[block].text
        if text is not None and block != previous:
            steps.append(Step(f"block-{block + 1}-text", "page", text=text))
        previous = block
        steps.append(Step(f"run-{number + 1}", "run", run=number, block=block, scene=scene))
        if config.after_run:
            steps.append(Step(f"after-run-{number + 1}", "questions", entries=config.after_run, run=number))
    return steps


def run_order(config: StudyConfig, index: int, row: int | None = None) -> list[tuple[int, int]]:
    """The runs of a participant: for each the number of its block, and of its scene within the block.

    Args:
        config: settings of the study.
        index: number of the participant, from 0.
        row: of the Latin square, or number of the only block; None: that of the index.
    """
    blocks = _blocks(config.order, len(config.runs), index if row is None else row)
    runs = [(block, scene) for block in blocks for scene in range(config.runs[block].runs)]
    if config.order == "shuffled":
        runs.sort(key=lambda run: order_key(config.seed, "runs", index, *run))
    return runs


def _blocks(order: str, count: int, row: int) -> Sequence[int]:
    """The blocks of a row, in their order."""
    if count and order == "between":
        return [row % count]
    return latin_square_row(count, row) if count and order == "latin-square" else range(count)


def rows_of(config: StudyConfig) -> int:
    """Number of different rows of the Latin square, or of blocks of which each participant drives one; else 1."""
    count = len(config.runs)
    rows = {"latin-square": count * (1 + count % 2), "between": count}
    return max(rows.get(config.order, 1), 1)


def condition_of(order: str, scenarios: Sequence[str], row: int) -> str:
    """The condition of a participant: the only block, or the blocks in the order of a Latin square; else empty.

    A block has its number, from 0, and its scenario, such as `0: doorway → 1: corridor`.

    Args:
        order: of the blocks of runs.
        scenarios: of the blocks.
        row: of the participant, as of `run_order`.
    """
    if order not in ("between", "latin-square"):
        return ""
    blocks = _blocks(order, len(scenarios), row)
    return " → ".join(f"{block}: {Path(scenarios[block]).stem}" for block in blocks)


def latin_square_row(n: int, index: int) -> list[int]:
    """A row of a Latin square in which each condition follows each other one equally often.

    For an odd number of conditions, this needs two squares, the second with reversed rows.

    Source: Williams, Experimental Designs Balanced for the Estimation of Residual Effects of Treatments, Australian
    Journal of Scientific Research A 2, 1949.

    Args:
        n: number of conditions.
        index: number of the row; rows repeat after n, or 2 n for an odd n.

    >>> [latin_square_row(4, k) for k in range(4)]
    [[0, 1, 3, 2], [1, 2, 0, 3], [2, 3, 1, 0], [3, 0, 2, 1]]
    """
    first = [(column + 1) // 2 if column % 2 else -(column // 2) for column in range(n)]
    row = [(condition + index) % n for condition in first]
    return row[::-1] if n % 2 and index % (2 * n) >= n else row


def order_key(*parts: object) -> bytes:
    """A key that sorts pseudo-randomly, and is the same on every machine."""
    return hashlib.sha256("/".join(map(str, parts)).encode()).digest()
