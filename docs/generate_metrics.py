"""Writes docs/metrics.md from the definitions in sonata2d/metrics: `python docs/generate_metrics.py [--check]`."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from sonata2d.metrics.catalogue import FAMILIES
from sonata2d.metrics.definition import DEFINITIONS_VERSION, Metric
from sonata2d.metrics.interop import VARIANTS
from sonata2d.metrics.summary import LEVEL, RESAMPLES
from sonata2d.metrics.table import ARROWS

PAGE = Path(__file__).parent / "metrics.md"

INTRO = f"""\
<!-- written by docs/generate_metrics.py from sonata2d/metrics -->
# Metrics, definitions version {DEFINITIONS_VERSION}

`sonata2d evaluate DIR` measures recorded runs and keeps every number in `DIR/metrics.json`, with the version of these
definitions; `sonata2d evaluate --controller A --controller B --scenario S` makes the runs first. In Python:

```python
from sonata2d.metrics import measure
from sonata2d.record import read_episode

values = measure(read_episode("demo/000000.json"))
```

How they are taken:

- A run is what happened until the goal was first reached, or to the end. *Looks* are its frames and the final look, L
  of them; a *tick* lies between two looks and lasts Δt.
- p, θ, v: the robot's place, heading, velocity; q: a person's place; g: the goal. World frame, SI. Distances are
  between outlines unless said: a person's own radius counts, and the robot's. d = max(0, |p − q| − r_robot −
  r_person).
- *touches*: an outline touched without a break is one touch, however long. It is told by the contacts in the file,
  which feel within a tick, and by the gap at each look. A touch is by the fault of whoever's own velocity closed the
  gap at any of its looks: of the robot, of the person, of both, of neither.
- Intervals take runs for independent: of a set with mirror images, evaluate the originals alone. Three `hunavsim`
  variants are not the same for a run and its mirror image, as in the program that they are from.
- What is not defined in a run, or rests on what an imported run does not tell, is null, and is left out of n:
  clearance in a room without people, time to goal of a run that failed. Compare such means only beside n.
- Means come with the {100 * LEVEL:.0f} % interval of a percentile bootstrap over runs ({RESAMPLES} resamples, fixed
  seed). Values all alike give an interval of no width: nothing else was seen, which is not that nothing else can be.
  With fewer than twenty runs or so intervals are too narrow; make more runs.
- Controllers in the same scenes are compared run by run: a `*` in the table, and `differences` in JSON, tell of the
  bootstrap interval of the difference to the first. Of twenty metrics that do not differ, one gets a `*` by chance.
- `metrics.json` sums up all runs, those that reached the goal, and those of each family of scenes.
- ↑ more is better, ↓ less is better. Metrics in **bold** are those of the short table and of the picture; `--page`
  shows every class of collision besides, and shares of outcomes with Wilson's interval, which has a width even where
  all runs ended alike: [how to](how-to.md#measure-runs-compare-controllers).
"""

VARIANTS_INTRO = """\
## The same names elsewhere

Other programs mean something else by the same names. These variants give their number on our runs:
`sonata2d evaluate DIR --metric hunavsim`. SocNavGym's SPL and STL are not among them: they compare with the way of a
second robot that is driven by ORCA in the same room.
"""


def page() -> str:
    """docs/metrics.md."""
    parts = [INTRO]
    for family, metrics in FAMILIES.items():
        parts += [f"## {family}\n", *_rows(("metric", "unit", "", "formula", "source"), map(_row, metrics)), ""]
    head = ("metric", "compare with", "unit", "", "formula", "source")
    return "\n".join([*parts, VARIANTS_INTRO, *_rows(head, map(_variant_row, VARIANTS)), ""])


def _rows(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    return [_line(head), _line(("---",) * len(head)), *map(_line, rows)]


def _line(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|").strip() for cell in cells) + " |"


def _row(metric: Metric) -> tuple[str, ...]:
    name = f"**`{metric.name}`**" if metric.headline else f"`{metric.name}`"
    return name, metric.unit, ARROWS[metric.better], metric.formula, metric.source


def _variant_row(metric: Metric) -> tuple[str, ...]:
    _, *rest, source = _row(metric)
    return f"`{metric.name}`", f"`{metric.variant_of}`", *rest, source


def main() -> int:
    """Write the page, or with --check say if it is old."""
    is_old = not PAGE.exists() or PAGE.read_text("utf-8") != page()
    if "--check" in sys.argv[1:]:
        if is_old:
            sys.stderr.write(f"{PAGE} is old; run python docs/generate_metrics.py\n")
        return int(is_old)
    PAGE.write_text(page(), "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
