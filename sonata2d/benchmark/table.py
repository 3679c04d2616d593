"""Tables of rows: the scores of several controllers, the Pareto front, and gaps between public and hidden seeds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from ..errors import BenchmarkError
from ..metrics.templates import render
from ..record.files import write_atomically
from .baselines import BASELINES
from .row import Plan, public_name, read_row
from .scoring import FRONT, SCORES
from .suite import TRACKS, Suite, load_suite

_COLUMNS = (
    "success", "stl", "safe", "contact_at_fault", "obstacle_contact", "time_to_collision", "polite", "psc",
    "interaction_intrusion", "human_slowing", "human_deviation",
)  # fmt: skip
_SUFFIXES = (".html", ".md", ".json")
_Z = 1.959964  # of an interval of 95 %


@dataclass(frozen=True, slots=True)
class Line:
    """A controller in a table.

    Attributes:
        controller: its name.
        track: what it observes.
        rows: its rows by the name of their seeds.
        is_on_front: whether no other controller with the same track, seeds and scenes is at least as good in all scores
            of `FRONT`, and better in one.
    """

    controller: str
    track: str
    rows: Mapping[str, Any]
    is_on_front: bool = False

    @property
    def label(self) -> str:
        """The name of the baseline, or of another controller."""
        names = (name for name, each in BASELINES.items() if public_name(each.controller) == self.controller)
        return next(names, self.controller)

    @property
    def seeds(self) -> str:
        """The seeds whose scores count: `test`, or else the first ones."""
        return "test" if "test" in self.rows else next(iter(self.rows))

    @property
    def scores(self) -> Any:
        """The scores of all scenes together."""
        return self.rows[self.seeds]["all"]

    @property
    def advisory(self) -> list[str]:
        """Names of the advisory columns."""
        return list(self.scores["advisory"])

    @property
    def is_complete(self) -> bool:
        """Whether the row has all scenes of the suite."""
        return bool(self.rows[self.seeds]["complete"])

    @property
    def strict(self) -> float:
        """Share of the scenes that are solved without fault."""
        return float(self.scores["strict"]["value"])

    def value(self, name: str, part: str | None = None) -> float | None:
        """A score of all scenes, or of a part; None where it is not defined."""
        row = self.rows[self.seeds]
        scores = row["all"] if part is None else row["parts"].get(part)
        if scores is None:
            return None
        found = scores["strict"] if name == "strict" else scores[SCORES[name].group][name]
        return None if found["value"] is None else float(found["value"])

    @property
    def gaps(self) -> dict[str, tuple[float, bool]]:
        """Of other seeds against hidden ones: difference of the shares of strict scenes, and whether it is too large.

        It is too large if it exceeds the 95 % interval of a difference of two shares.
        """
        hidden = self.rows.get("hidden")
        found = {}
        for seeds, row in self.rows.items():
            if hidden is not None and row is not hidden and _scenes_of(row) == _scenes_of(hidden):
                shares = ((each["all"]["strict"]["value"], each["all"]["strict"]["n"]) for each in (row, hidden))
                (p, n), (q, m) = shares
                spread = math.sqrt(p * (1.0 - p) / n + q * (1.0 - q) / m)
                found[seeds] = (p - q, p - q > _Z * spread)
        return found


def _scenes_of(row: Mapping[str, Any]) -> Any:
    """The part of a suite that a row has: rows of other parts are not compared."""
    return row["plan"]["parts"], row["plan"]["scenes"]


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of one suite.

    Attributes:
        suite: the suite.
        lines: by track, those on the front first, and then by the share of strict scenes.
    """

    suite: Suite
    lines: tuple[Line, ...]

    def to_json(self) -> dict[str, Any]:
        """The table as JSON values."""
        return {
            "suite": self.suite.name,
            "suite_sha256": self.suite.sha256,
            "lines": [
                {
                    "controller": line.controller,
                    "label": line.label,
                    "track": line.track,
                    "is_on_front": line.is_on_front,
                    "gaps": {seeds: {"gap": round(gap, 6), "flag": flag} for seeds, (gap, flag) in line.gaps.items()},
                    "rows": line.rows,
                }
                for line in self.lines
            ],
        }

    def markdown(self) -> str:
        """The table in Markdown."""
        texts = []
        for track in dict.fromkeys(line.track for line in self.lines):
            names = ["strict", *_COLUMNS]
            head = f"| {track} | " + " | ".join(name.replace("_", " ") for name in names) + " |"
            texts += [head, "| --- |" + " ---: |" * len(names)]
            for line in (each for each in self.lines if each.track == track):
                mark = "**" if line.is_on_front else ""
                cells = [shown_number(line.value(name)) for name in names]
                texts.append(f"| {mark}{line.label}{mark}{_notes(line)} | " + " | ".join(cells) + " |")
            texts.append("")
        return "\n".join(texts)

    def html(self) -> str:
        """The table as a page that needs no other file."""
        groups: dict[str, list[str]] = {}
        for name in _COLUMNS:
            groups.setdefault(SCORES[name].group, []).append(name)
        return render(
            "page.html",
            package=str(__package__),
            number=shown_number,
            suite=self.suite,
            lines=self.lines,
            tracks=TRACKS,
            groups=groups,
            scores=SCORES,
            front=FRONT,
            best=self.best(),
        )

    def best(self) -> dict[tuple[str, str], float]:
        """The best value of each score in each track, among complete rows."""
        found: dict[tuple[str, str], float] = {}
        for line in self.lines:
            for name in ("strict", *_COLUMNS):
                value = line.value(name)
                if value is not None and line.is_complete:
                    choose = max if name == "strict" or SCORES[name].better == "more" else min
                    found[line.track, name] = choose(value, found.get((line.track, name), value))
        return found

    def save(self, path: str | Path) -> None:
        """Write a page (.html), a table in Markdown (.md) or JSON (.json).

        Raises:
            BenchmarkError: the path ends otherwise.
        """
        check_path(path)
        place = Path(path)
        contents = {
            ".html": lambda: self.html().encode(),
            ".md": lambda: self.markdown().encode(),
            ".json": lambda: orjson.dumps(self.to_json(), option=orjson.OPT_INDENT_2) + b"\n",
        }
        write_atomically(place, contents[place.suffix.lower()]())


def check_path(path: str | Path) -> None:
    """Check that a table can be written to a path.

    Raises:
        BenchmarkError: its ending is unknown.
    """
    if Path(path).suffix.lower() not in _SUFFIXES:
        raise BenchmarkError(f"a table is written to {', '.join(_SUFFIXES)}, got {path}")


def table_of(folders: Sequence[str | Path]) -> Table:
    """The table of some rows.

    Args:
        folders: of the rows. Rows of one controller with other seeds stand in one line.

    Raises:
        BenchmarkError: there is no row, one cannot be read, they are of different suites, or two are of the same
            controller, track and seeds.
    """
    if not folders:
        raise BenchmarkError("a table needs rows: give their folders")
    found: dict[tuple[str, ...], dict[str, Any]] = {}
    suites = set()
    for folder in folders:
        row = read_row(folder)
        plan = Plan.from_json(row["plan"])
        suites.add(plan.suite)
        key = (plan.track, plan.controller, *sorted(plan.files.values()))
        seeds = plan.seeds if plan.seeds != "dev" else f"dev {plan.seed}"
        if seeds in found.setdefault(key, {}):
            raise BenchmarkError(
                f"two rows are of {plan.controller}, track {plan.track}, seeds {seeds}; make tables of one each, or "
                "give the files of the controllers different names"
            )
        found[key][seeds] = row
    if len(suites) > 1:
        raise BenchmarkError(f"a table has rows of one suite, got {', '.join(sorted(suites))}")
    lines = [Line(controller, track, rows) for (track, controller, *_), rows in found.items()]
    tracks: list[str] = list(TRACKS)
    lines = [Line(line.controller, line.track, line.rows, not any(_beats(o, line) for o in lines)) for line in lines]
    lines.sort(key=lambda line: (tracks.index(line.track), not line.is_on_front, -line.strict))
    return Table(load_suite(suites.pop()), tuple(lines))


def _beats(line: Line, other: Line) -> bool:
    """Whether a line is at least as good as another one in all scores of the front, and better in one."""
    scenes = [_scenes_of(each.rows[each.seeds]) for each in (line, other)]
    if (line.track, line.seeds) != (other.track, other.seeds) or scenes[0] != scenes[1]:
        return False
    pairs = [(line.value(name) or 0.0, other.value(name) or 0.0) for name in FRONT]
    return all(a >= b for a, b in pairs) and any(a > b for a, b in pairs)


def shown_number(value: float | None) -> str:
    """A number of a table.

    >>> shown_number(0.9467)
    '0.947'
    """
    if value is None:
        return "–"
    return f"{value:.3f}" if abs(value) < 10.0 else f"{value:.1f}"


def _notes(line: Line) -> str:
    notes = [] if line.is_complete else ["not complete"]
    notes += [] if line.seeds == "test" else [f"seeds {line.seeds}"]
    notes += [f"{seeds} {gap:+.3f} against hidden" for seeds, (gap, is_large) in line.gaps.items() if is_large]
    return f" ({', '.join(notes)})" if notes else ""
