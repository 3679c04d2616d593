"""Writes docs/metrics.md from the definitions in sonata2d/metrics: `python docs/generate_metrics.py [--check]`."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from sonata2d.metrics.catalogue import FAMILIES
from sonata2d.metrics.definition import ARROWS, DEFINITIONS_VERSION, NEEDS, Metric
from sonata2d.metrics.interop import VARIANTS
from sonata2d.metrics.summary import LEVEL, RESAMPLES

HEAD = ("metric", "unit", "", "formula", "source")
PAGE = Path(__file__).parent / "metrics.md"

INTRO = f"""\
<!-- written by docs/generate_metrics.py from sonata2d/metrics -->
# Metrics, definitions version {DEFINITIONS_VERSION}

`sonata2d evaluate DIR` computes the metrics of recorded runs and stores them in `DIR/metrics.json`, with the version
of these definitions; `sonata2d evaluate --controller A --controller B --scenario S` generates the runs first. In
Python:

```python
from sonata2d import read_episode
from sonata2d.metrics import measure

values = measure(read_episode("demo/000000.json"))
```

Conventions:

- A run ends when the goal is first reached, or with the episode. It has L *states*: the snapshots of its frames and
  the final state. A *tick* lies between two states and lasts Δt.
- p, θ, v: position, heading and velocity of the robot; q: position of a person; g: the goal. World frame, SI. Distances
  are clearances (between outlines) unless stated otherwise: d = max(0, |p − q| − r_robot − r_person), where q is the
  nearest point of the person's shoulder line, which lies across the heading and is breadth − 2 r_person long; of a
  person without a breadth, as in imported files, it is the position. Variants of other projects keep their discs.
- A *collision* is an uninterrupted contact with one outline, however long: a person, an object, or a straight wall, in
  however many pieces it is drawn. It is determined from the recorded contacts, which are detected within ticks, and
  from the clearance at each state. A party is at fault if its own velocity closed the gap at any of these states: the
  robot, the person, both or neither.
- Intervals assume independent runs: of a data set with mirror images, evaluate only the originals. Three `hunavsim`
  variants differ between a run and its mirror image, as they do in that program.
- A metric that is not defined for a run is null and not counted in n: clearance in a room without people, time to goal
  of a failed run. Compare such means only together with n.
- *Needs* lists the data that a metric cannot do without: the robot, the goal, the outcome, the headings of people, the
  seed (to run it again without the robot), or a key of the [episode file](format.md). For an imported run whose source
  lacks one of them the metric is null too; tables and pages say "not measured" and name the data.
- Means have the {100 * LEVEL:.0f} % interval of a percentile bootstrap over runs ({RESAMPLES} resamples, fixed seed).
  If all values are equal the interval has zero width, which does not mean that other values are impossible. With
  fewer than about twenty runs intervals are too narrow; generate more runs.
- Controllers in the same scenes are compared run by run: `*` in the table, and `differences` in JSON, refer to the
  bootstrap interval of the difference to the first controller, over the scenes common to both. A `*` is shown only if
  the means differ in the same direction, and the page marks no mean as the best where n differs: such means are over
  different runs. Of twenty metrics without a difference, one gets a `*` by chance.
- `metrics.json` summarises all runs, the runs that reached the goal, and the runs of each scene family.
- ↑ more is better, ↓ less is better. Metrics in **bold** are part of the short table and the picture; `--page` adds
  every class of collision, and the fractions of outcomes with Wilson's interval, which has a positive width even if
  all outcomes are equal: [how to](how-to/evaluate.md).
"""

VARIANTS_INTRO = """\
## Variants of other programs

Other programs define metrics of the same names differently. These variants compute their numbers for our runs:
`sonata2d evaluate DIR --metric hunavsim`. SocNavGym's SPL and STL are not included: they compare with the path of a
second robot, driven by ORCA in the same room.
"""


def page() -> str:
    """docs/metrics.md."""
    parts = [INTRO]
    for family, metrics in FAMILIES.items():
        parts += [f"## {family}\n", *_rows((*HEAD, "needs"), map(_row, metrics)), ""]
    head = (HEAD[0], "compare with", *HEAD[1:], "needs")
    return "\n".join([*parts, VARIANTS_INTRO, *_rows(head, map(_variant_row, VARIANTS)), ""])


def _rows(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    return [_line(head), _line(("---",) * len(head)), *map(_line, rows)]


def _line(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|").strip() for cell in cells) + " |"


def _row(metric: Metric) -> tuple[str, ...]:
    name = f"**`{metric.name}`**" if metric.headline else f"`{metric.name}`"
    needs = ", ".join(need for need in NEEDS if need in metric.needs)
    return name, metric.unit, ARROWS[metric.better], metric.formula, metric.source, needs


def _variant_row(metric: Metric) -> tuple[str, ...]:
    name, *rest = _row(metric)
    return name, f"`{metric.variant_of}`", *rest


def main() -> int:
    """Write the page, or with --check report whether it is up to date."""
    is_old = not PAGE.exists() or PAGE.read_text("utf-8") != page()
    if "--check" in sys.argv[1:]:
        if is_old:
            sys.stderr.write(f"{PAGE} is not up to date; run python docs/generate_metrics.py\n")
        return int(is_old)
    PAGE.write_text(page(), "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
