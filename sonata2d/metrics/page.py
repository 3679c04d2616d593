"""The evaluation page: one self-contained HTML file with outcomes, metrics, plots and film strips.

`save_page` computes what the page shows; the template page.html holds texts and layout.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader

from ..core.files.locations import location
from ..core.notebook import Advance
from ..core.proxemics import INTIMATE_DISTANCE, PERSONAL_DISTANCE
from ..errors import RenderError
from ..record.files import write_atomically
from ..record.layout import software_versions
from ..record.reader import read_episode
from ..version import PHYSICS_VERSION
from ..view.stills import filmstrip
from .catalogue import FAMILIES, METRICS
from .definition import ARROWS, DEFINITIONS_VERSION, Metric
from .measurement import MARK, Evaluation, Measured
from .page_panels import constant_of, panel, shares
from .plots import COLOURS, short_names
from .summary import FEW, LEVEL, Interval, Summary, format_number, wilson_interval
from .trajectory import Trajectory

OUTCOMES = {
    "goal": "goal reached without collision",
    "goal-collision": "goal reached after a collision",
    "timeout": "time limit reached",
    "contact": "ended by a contact",
    "stopped": "stopped by the controller or a person",
    "regenerate": "new scene requested",
    "error": "error in the controller",
}
_COLLISIONS = ("collisions", "object_collisions", "wall_collisions", "person_on_robot")  # beside the headline metrics


def page_metrics() -> tuple[Metric, ...]:
    """The metrics of a page by default: the headline metrics and every class of collision."""
    return tuple(metric for metric in METRICS.values() if metric.headline or metric.name in _COLLISIONS)


def check_page_path(path: Path) -> None:
    """Check the path of a page before any work is done.

    Raises:
        RenderError: the path does not end in .html or .htm.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise RenderError(f"{path}: the name of an evaluation page must end in .html")


def save_page(
    path: str | Path,
    evaluations: Sequence[Evaluation],
    files: Sequence[Sequence[Path]] | None = None,
    metrics: Sequence[Metric] | None = None,
    advance: Advance | None = None,
) -> None:
    """Write a page that shows evaluations side by side.

    Args:
        path: of the page, ending in .html.
        evaluations, files, metrics, advance: as for `page_of`.

    Raises:
        RenderError: the path does not end in .html or .htm.
        RecordError: an episode file cannot be read, or the page cannot be written.
    """
    path = location(path)
    check_page_path(path)
    write_atomically(path, page_of(evaluations, files, metrics, advance).encode())


def page_of(
    evaluations: Sequence[Evaluation],
    files: Sequence[Sequence[Path]] | None = None,
    metrics: Sequence[Metric] | None = None,
    advance: Advance | None = None,
) -> str:
    """A page that shows evaluations side by side, as HTML.

    Args:
        evaluations: one or more, each shown as one column and one colour.
        files: for each evaluation the files of its episodes, in the same order; without files the page has no film
            strips.
        metrics: the metrics to show; `page_metrics()` by default.
        advance: called with the number of evaluations whose film strips were drawn, as of a progress bar.

    Raises:
        RecordError: an episode file cannot be read.
    """
    shown = page_metrics() if metrics is None else metrics
    strips = []
    for one, own in zip(evaluations, files, strict=True) if files else ():
        strips.append(film_strips(one.episodes, own))
        if advance is not None:
            advance(1)
    kinds = outcome_kinds(evaluations)
    all_shares = [row for metric in shown if (row := shares(evaluations, metric))]
    environment = Environment(
        loader=PackageLoader(__package__, "."), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["number"] = format_number
    versions = {"metric definitions": DEFINITIONS_VERSION, "physics": PHYSICS_VERSION, **software_versions()}
    return environment.get_template("page.html").render(
        evaluations=evaluations,
        names=short_names([one.label for one in evaluations]),
        versions=", ".join(f"{name} {version}" for name, version in versions.items()),
        contents=[_contents(one) for one in evaluations],
        common_scenes=len(set.intersection(*(one.scenes for one in evaluations))),
        is_pooled=len({e.name for one in evaluations for e in one.episodes}) > 1,
        few=FEW if any(len(one.episodes) < FEW for one in evaluations) else None,
        level=f"{100 * LEVEL:.0f} %",
        resamples=max(one.resamples for one in evaluations),
        outcomes={kind: OUTCOMES[kind] for kind in kinds},
        outcome_counts=[outcome_counts(one, kinds) for one in evaluations],
        families=_families(evaluations, shown),
        shares=[each for each in all_shares if each.constant is None],
        constant_shares={
            word: [each.metric for each in all_shares if each.constant == word] for word in ("no", "every")
        },
        panels=[found for metric in shown if (found := panel(evaluations, metric))],
        constants=[(metric, value) for metric in shown if (value := constant_of(evaluations, metric)) is not None],
        strips=strips,
        rules=(BEST_RULE, WORST_RULE),
        arrows=ARROWS,
        mark=MARK,
        colours=COLOURS[:-1],  # the last one is black, for which the page uses its text colour
    )


# --- What was evaluated ---


def _contents(evaluation: Evaluation) -> tuple[str, str, str]:
    """Scenarios, seeds and episode numbers of an evaluation."""
    episodes = evaluation.episodes
    scenarios = ", ".join(sorted({episode.name for episode in episodes}))
    return scenarios, _number_range({e.seed for e in episodes}), _number_range({e.episode for e in episodes})


def _number_range(numbers: set[int]) -> str:
    """`0..19` for consecutive numbers, `1, 4, 9` for up to five others, else `6 of 0..19`."""
    order = sorted(numbers)
    if len(order) > 2 and order[-1] - order[0] == len(order) - 1:
        return f"{order[0]}..{order[-1]}"
    return ", ".join(map(str, order)) if len(order) <= 5 else f"{len(order)} of {order[0]}..{order[-1]}"


# --- Outcomes ---


@dataclass(frozen=True, slots=True)
class OutcomeCount:
    """How many episodes had one outcome.

    Attributes:
        kind: a key of `OUTCOMES`.
        count, fraction: of the episodes.
        before: sum of the fractions of the preceding kinds, where the segment of a stacked bar begins.
        interval: Wilson confidence interval of the fraction.
    """

    kind: str
    count: int
    fraction: float
    before: float
    interval: Interval


def outcome_kinds(evaluations: Sequence[Evaluation]) -> list[str]:
    """The outcomes that occur, in the order of `OUTCOMES`."""
    found = {_outcome_kind(episode) for one in evaluations for episode in one.episodes}
    return [kind for kind in OUTCOMES if kind in found]


def outcome_counts(evaluation: Evaluation, kinds: Sequence[str]) -> list[OutcomeCount]:
    """Count the episodes by outcome, in the order of `kinds`; empty for an evaluation without episodes."""
    total = len(evaluation.episodes)
    counts = Counter(map(_outcome_kind, evaluation.episodes))
    found: list[OutcomeCount] = []
    for kind in kinds if total else ():
        before = found[-1].before + found[-1].fraction if found else 0.0
        count = counts[kind]
        found.append(OutcomeCount(kind, count, count / total, before, wilson_interval(count, total)))
    return found


def _outcome_kind(episode: Measured) -> str:
    collided = episode.outcome == "goal" and episode.values.get("success_strict") == 0.0
    return "goal-collision" if collided else episode.outcome


# --- Table of metrics ---


@dataclass(frozen=True, slots=True)
class Cell:
    """One metric of one evaluation.

    Attributes:
        summary: over the episodes.
        mark: `best` for the best mean, `equal` if it does not differ significantly from the best, else empty; always
            empty if the metric is defined in different numbers of episodes, whose means cannot be compared.
        differs: whether it differs significantly from the first evaluation.
    """

    summary: Summary
    mark: str
    differs: bool


def cells(evaluations: Sequence[Evaluation], metric: Metric) -> list[Cell]:
    """The table row of a metric, one cell for each evaluation."""
    return [
        Cell(one.summary(metric.name), mark, one.differs(evaluations[0], metric.name))
        for one, mark in zip(evaluations, _marks(evaluations, metric), strict=True)
    ]


def _marks(evaluations: Sequence[Evaluation], metric: Metric) -> list[str]:
    """The mark of each evaluation; see `Cell`."""
    means = [one.summary(metric.name).mean for one in evaluations]
    defined = [mean for mean in means if mean is not None]
    counts = {summary.n for one in evaluations if (summary := one.summary(metric.name)).n}
    # no best without a preferred direction, if all are equal, or if the means are over different numbers of episodes
    if metric.better == "neither" or len(set(defined)) < 2 or len(counts) > 1:
        return [""] * len(means)
    best = max(defined) if metric.better == "more" else min(defined)
    leader = evaluations[means.index(best)]

    def mark(one: Evaluation, mean: float | None) -> str:
        if mean is None or mean == best:
            return "" if mean is None else "best"
        difference = one.difference(leader, metric.name)
        # without an interval there are too few common scenes to call them equal
        return "equal" if difference.interval is not None and not difference.excludes_zero else ""

    return [mark(one, mean) for one, mean in zip(evaluations, means, strict=True)]


def _families(
    evaluations: Sequence[Evaluation], metrics: Sequence[Metric]
) -> list[tuple[str, list[tuple[Metric, list[Cell]]]]]:
    """Table rows by family of metrics; variants of other projects come last."""
    families = {name: [metric for metric in metrics if metric in family] for name, family in FAMILIES.items()}
    families["Variants of other programs"] = [metric for metric in metrics if metric.variant_of]
    return [
        (name, [(metric, cells(evaluations, metric)) for metric in members])
        for name, members in families.items()
        if members
    ]


# --- Film strips of the best and the worst episode ---

MOMENTS = 6  # pictures of a film strip
COMPLIANCE = f"personal_space_compliance_{INTIMATE_DISTANCE:.2f}"

BEST_RULE = (
    "Best episode, by the following criteria in this order: the goal was reached; there was no collision; no person was"
    f" nearer than {INTIMATE_DISTANCE:g} m and no group or interaction was intruded upon; a person was nearer than"
    f" {PERSONAL_DISTANCE:g} m, so that the robot did pass people; the highest SPL, to 0.01; the smallest clearance to"
    " a person."
)
WORST_RULE = (
    "Worst episode, by the following criteria in this order: most collisions with people that the robot caused; goal"
    " not reached; most collisions with walls and furniture; lowest personal-space compliance; lowest SPL."
)


@dataclass(frozen=True, slots=True)
class Strip:
    """One episode in pictures.

    Attributes:
        title: what the episode is an example of.
        why: why it was chosen.
        facts: its outcome and metrics.
        origin: scenario, seed, episode number and file.
        controller: path of the controller, as in the file.
        moments: time and event of each picture, and the picture as a data URL.
    """

    title: str
    why: str
    facts: str
    origin: str
    controller: str
    moments: list[tuple[str, str]]


def film_strips(episodes: Sequence[Measured], files: Sequence[Path]) -> list[Strip]:
    """Film strips of the best and the worst episode; a single strip if they are the same.

    Args:
        episodes: the measured episodes.
        files: the file of each.

    Raises:
        RecordError: a file cannot be read.
    """
    if not episodes:
        return []
    path = dict(zip(map(id, episodes), files, strict=True))
    best, worst = best_of(episodes), worst_of(episodes)
    if best is worst:
        return [_strip("best and worst", why_best(best), best, path[id(best)])]
    return [
        _strip("best", why_best(best), best, path[id(best)]),
        _strip("worst", why_worst(worst), worst, path[id(worst)]),
    ]


def best_of(episodes: Sequence[Measured]) -> Measured:
    """The best episode by `BEST_RULE`; the first of equals."""
    return max(episodes, key=_best_key)


def worst_of(episodes: Sequence[Measured]) -> Measured:
    """The worst episode by `WORST_RULE`; the first of equals."""
    return max(episodes, key=_worst_key)


def why_best(episode: Measured) -> str:
    """Explain why `best_of` chose an episode, and which criteria even the best one misses."""
    reached, no_collision, no_intrusion, passed_person, *_ = _best_key(episode)
    if not reached:
        return "no episode reached the goal; this one comes first by the other criteria"
    missed = [
        text
        for is_met, text in (
            (no_collision, "there was a collision"),
            (no_intrusion, "the personal space of a person was intruded upon"),
            (passed_person, f"no person was within {PERSONAL_DISTANCE:g} m"),
        )
        if not is_met
    ]
    spl = f"SPL {_value(episode, 'spl'):.2f}"
    if missed:
        return f"goal reached, but {' and '.join(missed)}; no episode did better; {spl}"
    return f"goal reached past people, without collision or intrusion into personal space; {spl}"


def why_worst(episode: Measured) -> str:
    """Explain why `worst_of` chose an episode."""
    faulty, missed_goal, other, intrusion, _ = _worst_key(episode)
    if faulty:
        return f"the robot caused {_times(faulty)} with people"
    if missed_goal:
        return "the goal was not reached"
    if other:
        return f"{_times(other)} with walls or furniture"
    if intrusion:
        return f"nearer than {INTIMATE_DISTANCE:g} m to a person in {100.0 * intrusion:.0f} % of the states"
    return f"the lowest SPL, {_value(episode, 'spl'):.2f}; goal reached without collision or intrusion"


def _times(collisions: float) -> str:
    return f"{collisions:.0f} collision{'s' if collisions > 1 else ''}"


def _best_key(episode: Measured) -> tuple[bool, bool, bool, bool, float, float]:
    """The criteria of `BEST_RULE`; larger is better, and the first that differs decides."""
    clearance = _value(episode, "human_clearance_min", PERSONAL_DISTANCE)
    intrusion = _value(episode, "group_intrusion") + _value(episode, "interaction_intrusion")
    return (
        _value(episode, "success") > 0.0,
        _value(episode, "collisions") == 0.0,
        intrusion == 0.0 and _value(episode, COMPLIANCE, 1.0) == 1.0,
        clearance < PERSONAL_DISTANCE,
        round(_value(episode, "spl"), 2),
        -clearance,
    )


def _worst_key(episode: Measured) -> tuple[float, bool, float, float, float]:
    """The criteria of `WORST_RULE`; larger is worse, and the first that differs decides."""
    return (
        _value(episode, "robot_on_person"),
        _value(episode, "success", 1.0) == 0.0,
        _value(episode, "wall_collisions") + _value(episode, "object_collisions"),
        1.0 - _value(episode, COMPLIANCE, 1.0),
        -_value(episode, "spl"),
    )


def _value(episode: Measured, name: str, default: float = 0.0) -> float:
    """A metric of an episode; the default where it is not defined."""
    value = episode.values.get(name)
    return default if value is None else value


def _strip(title: str, why: str, measured: Measured, file: Path) -> Strip:
    record = read_episode(file)
    trajectory = Trajectory(record)
    event, event_text = _event(trajectory)
    indices = _moments(len(trajectory), event)
    pictures = filmstrip([record.snapshot(index) for index in range(len(trajectory))], indices)
    return Strip(
        title=title,
        why=why,
        facts=_facts(measured, record.outcome.time),
        origin=f"{measured.name}, seed {measured.seed} / episode {measured.episode}, {measured.file}",
        controller=record.controller_info.path,
        moments=[
            (f"{trajectory.time[index]:.1f} s" + (f", {event_text}" if index == event else ""), picture)
            for index, picture in zip(indices, pictures, strict=True)
        ],
    )


def _event(trajectory: Trajectory) -> tuple[int | None, str]:
    """Index and description of the most informative state.

    This is the first collision, those caused by the robot and those with humans first; without collisions the state
    of the smallest clearance to a human; None without humans.
    """
    if trajectory.collisions:
        first = min(trajectory.collisions, key=lambda c: (not c.robot_at_fault, c.kind != "human", c.first))
        other = {"human": "person", "object": "furniture", "wall": "wall"}[first.kind]
        return first.first, f"collision with {other}" + (", caused by the robot" if first.robot_at_fault else "")
    return (int(np.argmin(trajectory.clearance)), "nearest") if trajectory.has_humans else (None, "")


def _moments(count: int, event: int | None) -> list[int]:
    """Evenly spaced indices below `count`, at most `MOMENTS`; the inner one nearest to the event is moved there."""
    indices = [round(index) for index in np.linspace(0, count - 1, MOMENTS)]
    if event is not None and event not in indices:
        indices[min(range(1, MOMENTS - 1), key=lambda k: abs(indices[k] - event))] = event
    return sorted(set(indices))


def _facts(episode: Measured, time: float) -> str:
    """The outcome, and the metrics by which episodes are chosen."""
    texts = [f"outcome: {episode.outcome} at {time:.1f} s"]
    for name, text in (
        ("spl", "SPL {:.2f}"),
        ("human_clearance_min", "smallest clearance to a person {:.2f} m"),
        (COMPLIANCE, "personal-space compliance {:.2f}"),
        ("interaction_intrusion", "interaction intrusion {:.2f}"),
        ("robot_on_person", "collisions with people caused by the robot {:.0f}"),
    ):
        value = episode.values.get(name)
        texts += [] if value is None else [text.format(value)]
    return ", ".join(texts)
