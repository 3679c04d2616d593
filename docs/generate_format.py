"""Writes docs/format.md and docs/schema/*.json from the pydantic models: `python docs/generate_format.py [--check]`."""

from __future__ import annotations

import inspect
import json
import sys
from pathlib import Path
from typing import Any

from sonata2d.core.humans import ACTIVITIES
from sonata2d.datasets import manifest as manifest_models
from sonata2d.datasets.plausibility import DEEPEST
from sonata2d.record import models
from sonata2d.record import models as scene_models
from sonata2d.scenegen.scenario import sections, social
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.people import PersonSpec
from sonata2d.scenegen.scenario.ranges import Normal, Settings
from sonata2d.version import FORMAT, FORMAT_VERSION

DOCS = Path(__file__).parent
BASE = "https://json-schema.org/draft/2020-12/schema"

INTRO = f"""\
<!-- written by docs/generate_format.py from sonata2d/record/models.py and scene_models.py -->
# The episode file, version {FORMAT_VERSION}

One JSON document per episode, `.json`, `.json.gz` or `.json.zst`; [JSON Schema](schema/episode-v1.schema.json). Every
top-level key and every frame stands on a line of its own. `json` alone reads it:

```python
import json
import numpy as np

episode = json.load(open("polite.json"))
humans = np.array([frame["humans"] for frame in episode["frames"]])  # (T, N, 7), where all are present throughout
```

`sonata2d.record.read_episode` reads it too, with a mask of who is present, the scene, snapshots and frames.

- SI: m, s, rad. World frame: x right, y up, theta counter-clockwise. Body frame: x ahead, y left.
- Numbers in frames, in labels and in the outcome are rounded to `precision`; they are finite, never -0.0, and angles
  lie in (-3.1416, 3.1416]. Scene and settings keep every digit that was used; generated scenes are rounded before.
- Ids are unique in an episode; 0 is the robot.
- `robot`, `humans`, `activity`, `interactions` and `contacts` of a frame are what was seen at its tick; `command` is
  the answer, `executed` and `guarded` what came of it until the next frame. `final` is the look after the last frame.
- `contacts` and `events` are always there, mostly empty. `label` is left out where the command itself is the label.
- A reader refuses a newer version and passes over keys it does not know. `format` is `{FORMAT}`.
- Activities: {", ".join(f"{number} {name}" for number, name in enumerate(ACTIVITIES))}; -1 not present.
- `sonata2d check` also wants people and robot within the room, and outlines that overlap by {1000 * DEEPEST:.0f} mm
  at most; its other tolerances stand in `sonata2d/record/sense.py`.

A data set is a folder of these, named `{{episode:06d}}.json`, with a `manifest.json` (see [Manifest](#manifest);
[JSON Schema](schema/manifest-v1.schema.json)), `scenario.json` with its settings, a data card
`README.md`, and `run.jsonl`, the log of its runs.
"""


def schema_of(model: type[scene_models.Part], name: str) -> dict[str, Any]:
    """The JSON Schema of a model."""
    return {"$schema": BASE, "$id": f"{name}.schema.json", **model.model_json_schema()}


def format_page() -> str:
    """docs/format.md."""
    parts = [models.Episode, *_parts(models.Episode), manifest_models.Manifest, *_parts(manifest_models.Manifest)]
    unique = dict.fromkeys(parts)
    return "\n".join([INTRO, *(_section(part) for part in unique)])


def _parts(model: type[scene_models.Part]) -> list[type[scene_models.Part]]:
    """The models that a model is made of, in the order of the code."""
    names = model.model_json_schema()["$defs"]
    return [
        kind for name, kind in {**vars(scene_models), **vars(models), **vars(manifest_models)}.items() if name in names
    ]


def _section(model: type[scene_models.Part]) -> str:
    schema = model.model_json_schema()
    rows = [
        f"| `{key}` | {_kind(told)} | {told.get('description', '')} |" for key, told in schema["properties"].items()
    ]
    return "\n".join(
        [f"## {model.__name__}", model.__doc__ or "", "", "| key | is | |", "| --- | --- | --- |", *rows, ""]
    )


def _kind(told: dict[str, Any]) -> str:
    """A word or two for the type of a key."""
    if "$ref" in told:
        name = told["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "const" in told:
        return f"`{json.dumps(told['const'])}`"
    if "enum" in told:
        return " or ".join(f"`{json.dumps(value)}`" for value in told["enum"])
    for key in ("anyOf", "oneOf"):
        if key in told:
            return " or ".join(_kind(one) for one in told[key])
    if told.get("type") == "array" and "prefixItems" in told:
        return f"{len(told['prefixItems'])} values"
    if told.get("type") == "array":
        return f"list of {_kind(told['items'])}"
    return str(told.get("type", "anything"))


SCENARIO_INTRO = """\
<!-- written by docs/generate_format.py from sonata2d/scenegen -->
# The scenario file

Every key, by section, with its default. A range is `[min, max]`, `{min: 2, max: 6}` or one number; a `step` makes it
whole multiples. Lengths in m, angles in rad, times in s. The front of a thing, where whoever attends to it stands, is
its right side (-y at theta 0). What a file leaves out keeps its default: for none, write `tables: 0`.

Fixed furniture has a type of `sizes`, or a size of its own. Doors are gaps between inner `walls`.
"""


def scenario_page() -> str:
    """docs/scenario.md."""
    kinds = {**vars(sections), **vars(social)}.values()
    parts = [ScenarioConfig, *dict.fromkeys(filter(_is_section, kinds)), PersonSpec]
    return "\n".join([SCENARIO_INTRO, *(_settings(part) for part in parts)])


def _is_section(kind: object) -> bool:
    return isinstance(kind, type) and issubclass(kind, Settings) and kind not in (Settings, Normal)


def _settings(model: type[Settings]) -> str:
    """What a section says of itself, and the defaults of its plain keys."""
    plain = {k: f.get_default(call_default_factory=True) for k, f in model.model_fields.items() if not f.is_required()}
    given = model.model_construct(**plain).model_dump(mode="json")
    shown = {key: value for key, value in given.items() if not isinstance(plain[key], Settings)}
    rows = [f"{key}: {json.dumps(value)}" for key, value in shown.items()]
    told = inspect.cleandoc(model.__doc__ or "")
    return "\n".join([f"## {model.__name__}", "```text", told, "```", "```yaml", *rows, "```", ""])


def pages() -> dict[Path, str]:
    """What is to stand in which file."""
    schemas = {"episode-v1": models.Episode, "manifest-v1": manifest_models.Manifest}
    texts = {
        DOCS / "schema" / f"{name}.schema.json": json.dumps(schema_of(model, name), indent=2, ensure_ascii=False) + "\n"
        for name, model in schemas.items()
    }
    return {DOCS / "format.md": format_page(), DOCS / "scenario.md": scenario_page(), **texts}


def main() -> int:
    """Write the pages, or with --check say which are old."""
    old = [path for path, text in pages().items() if not path.exists() or path.read_text("utf-8") != text]
    if "--check" in sys.argv[1:]:
        for path in old:
            sys.stderr.write(f"{path} is old; run python docs/generate_format.py\n")
        return 1 if old else 0
    for path in old:
        path.parent.mkdir(exist_ok=True)
        path.write_text(pages()[path], "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
