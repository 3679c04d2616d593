"""Writes format.md, scenario.md, study.md and schemas from the models: `python docs/generate_format.py [--check]`."""

from __future__ import annotations

import inspect
import json
import re
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

from sonata2d.core.entities import Limits
from sonata2d.core.furniture_types import BUILT_IN, FurnitureType
from sonata2d.core.labels import LabelSpec
from sonata2d.core.relations import ACTIVITIES, ACTIVITY, RELATION
from sonata2d.core.scene import Rules, Social
from sonata2d.datasets.check.plausibility import MAXIMUM_OVERLAP
from sonata2d.datasets.manifest import models as manifest_models
from sonata2d.record import models
from sonata2d.registry import QUESTION_KINDS
from sonata2d.scenegen.scenario import sections
from sonata2d.scenegen.scenario.attributes import AttributeConfig, AttributesConfig
from sonata2d.scenegen.scenario.base import Normal, Settings, is_section
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.scenegen.scenario.people import PersonSpec
from sonata2d.study import config as study
from sonata2d.study.config import StudyConfig
from sonata2d.study.questions import Question, ScaleConfig, question_kind
from sonata2d.study.report import TABLES
from sonata2d.study.scales import Item, scale_named, scale_names
from sonata2d.version import FORMAT, FORMAT_VERSION

DOCS = Path(__file__).parent
BASE = "https://json-schema.org/draft/2020-12/schema"

INTRO = f"""\
<!-- written by docs/generate_format.py from sonata2d/core, sonata2d/record and sonata2d/datasets -->
# The episode file, versions 1 and {FORMAT_VERSION}

One JSON document per episode, `.json`, `.json.gz` or `.json.zst`; [JSON Schema](schema/episode-v2.schema.json). Every
top-level key and every frame is on a line of its own. `json` alone reads it:

```python
import json
import numpy as np

with open("demo/000000.json") as file:
    episode = json.load(file)
humans = np.array([frame["humans"] for frame in episode["frames"]])  # (T, N, 7), if everybody is always present
```

`sonata2d.read_episode` returns the same data as arrays with a mask of the people present, the scene, snapshots and
frames.

- SI: m, s, rad. World frame: x right, y up, theta counter-clockwise. Body frame: x ahead, y left.
- Numbers in frames, labels and the outcome are rounded to `precision`; they are finite, never -0.0, and angles lie in
  (-3.1416, 3.1416]. Scene and settings keep every digit that was used; generated scenes are rounded before use.
- Ids of robots, people and objects are unique together, and those of groups, doors, interior doors, queues and places
  among their kind; the first robot has id 0.
- `robot`, `humans`, `activity`, `interactions` and `contacts` of a frame are the state at its tick; `command` is the
  controller's answer, `executed` and `guarded` describe the motion until the next frame. `final` is the state after the
  last frame.
- Nothing but its drive moves the robot: `executed` times the tick, turned with the body, is its displacement, and the
  velocity in `robot` is the velocity of the drive at the end of the last tick. A unicycle has no velocity across its
  heading: `executed` has `vy` 0, (vx, vy) of `robot` is along theta, and the displacement in a tick is along the mean
  heading, or, where guard or wall slow it, between its headings at the start and at the end. `sonata2d check` tests
  this up to rounding.
- `contacts` and `events` are always present and usually empty. `label` is omitted if the command itself is the label.
- Readers refuse a newer version and ignore unknown keys. `format` is `{FORMAT}`.
- A file is validated once, when it is read: the schema, and what a schema cannot say (ids and references, activities,
  columns, answers to the question, a row for each person). `read_episode` refuses an invalid file with one line;
  `sonata2d check` lists what is wrong, of each list the first entry. `sonata2d/core/files/limits.py` holds the limits
  on sizes and counts.
- Activities: {", ".join(f"{number} {name}" for number, name in enumerate(ACTIVITIES))}; -1 not present.
  The activity for which a person stops, such as `standing`, begins when it starts to brake, up to 1 s before it is at
  rest.
- `sonata2d check` also requires people and robot to be inside the room, and outlines to overlap by {
    1000 * MAXIMUM_OVERLAP:.0f} mm at most, or by
  the distance by which two people approach each other in a physics step if that is longer (more without safety guard);
  `sonata2d/datasets/check/plausibility.py` defines its other tolerances.

A data set is a folder of episode files named `{{episode:06d}}.json`, with a `manifest.json` (see
[Manifest](#manifest); [JSON Schema](schema/manifest-v1.schema.json)), `scenario.json` with its settings, a data card
`README.md`, and the run log `run.jsonl`.

With `generate --shard-size N` the episodes are in shards, tar files `shard-000000.tar` of N episodes in the layout of
WebDataset. The manifest of the data set lists the shards ([ShardedManifest](#shardedmanifest);
[JSON Schema](schema/manifest-v2.schema.json)), and `shard-000000.manifest.json` beside each shard is the manifest of
its episodes: the same as of a folder of files, with the offset of each file in the tar file and the hash of the whole.
A path such as `demo/shard-000000.tar/000007.json` names an episode for every command and for `read_episode`; a shard
with its manifest is a data set of its own. Tar files of other programs are read without a manifest if their members are
regular files at the top level with short names, as `tar --format=ustar` packs them; `check` names others.
"""


def schema_of(model: type[models.Part], name: str) -> dict[str, Any]:
    """The JSON Schema of a model."""
    return {"$schema": BASE, "$id": f"{name}.schema.json", **model.model_json_schema()}


def format_page() -> str:
    """docs/format.md."""
    sections: dict[str, str] = {}
    for model in (models.Episode, manifest_models.Manifest, manifest_models.ShardedManifest):
        _add_sections(sections, model.__name__, model.model_json_schema())
    return "\n".join([INTRO, *sections.values()])


def _add_sections(sections: dict[str, str], name: str, tree: dict[str, Any]) -> None:
    """Add the section of a model, then the sections of the models that it refers to, in the order of its keys.

    Args:
        sections: text by name of the model.
        name: of the model.
        tree: its JSON Schema, with `$defs` of the models that it refers to.
    """
    keys = tree["properties"].items()
    rows = [f"| `{key}` | {_kind(schema)} | {schema.get('description', '')} |" for key, schema in keys]
    sections[name] = "\n".join(
        [f"## {name}", tree["description"], "", "| key | type | |", "| --- | --- | --- |", *rows, ""]
    )
    for inner in re.findall(r"#/\$defs/(\w+)", json.dumps(tree["properties"])):
        if inner not in sections:
            _add_sections(sections, inner, tree["$defs"][inner] | {"$defs": tree["$defs"]})


def _kind(schema: dict[str, Any]) -> str:
    """The type of a key in a word or two."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return " or ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
    for key in ("anyOf", "oneOf"):
        if key in schema:
            return " or ".join(_kind(one) for one in schema[key])
    if schema.get("type") == "array" and "prefixItems" in schema:
        return f"{len(schema['prefixItems'])} values"
    if schema.get("type") == "array":
        return f"list of {_kind(schema['items'])}"
    return str(schema.get("type", "anything"))


SCENARIO_INTRO = """\
<!-- written by docs/generate_format.py from sonata2d/scenegen -->
# The scenario file

Every key, by section, with its default. A range is `[min, max]`, `{min: 2, max: 6}` or a single number; with a `step`
its values are `min` plus multiples of the step. Lengths in m, angles in rad, times in s. Omitted keys keep their
defaults: write `tables: 0` for no tables.

These words have one meaning in all pages, keys and messages:

- **Door**: a place in the outline of the room where people enter and leave, an entry of `doors`. The wall is solid
  there.
- **Doorway**: a gap in a wall inside the room, which people and robot pass: between inner `walls`, or in the room kind
  `doorway`, where `room.door` is its width and `room.door_offset` its place.
- **Relation**: what a person and another one, or an object, do with each other: talking, walking together, using a
  laptop, looking at an object. `relations` is the number that is drawn at the start; the kind of each is drawn too, and
  one for which no person or object is free becomes a relation of the next kind. `interactions` in files are the
  relations at one time.
- **Access side** of a piece of furniture: the side at which a person stands who attends to it, -y in the axes of the
  piece, so below it at theta 0. People who come to a disc stand on any side of it.
- **Front** of a piece of furniture: the side to which it faces in pictures, and a person who sits on it. It is
  the access side of a piece that is longer (x) than wide (y), such as a laptop, a shelf or a TV, and else +x, as of a
  chair. A table and a plant have no front.

Fixed furniture has one of the types below, or any other name and a size of its own.

![Each type of furniture at theta 0 with its axes and where a person attends to it](images/furniture.png)

| type | key of the number | size, m | people |
| --- | --- | --- | --- |"""


def _furniture_row(kind: FurnitureType) -> str:
    """The row of a type of furniture in the table of docs/scenario.md."""
    activity = "sitting" if kind.is_seat else kind.relation and RELATION[kind.relation].activity
    use = ACTIVITY[activity].text if activity else ""
    key = f"`{kind.count}`" if kind.count else f"lies on a {kind.on}"
    size = kind.size if isinstance(kind.size, tuple) else (kind.size,)
    return f"| `{kind.name}` | {key} | {' × '.join(map(str, size))} | {use} |"


SCENARIO_TYPES = """
[Add a type of furniture](how-to/scenarios.md#add-a-type-of-furniture) explains how a program or a package adds others.
"""


def scenario_page() -> str:
    """docs/scenario.md."""
    models = [
        ScenarioConfig,
        *dict.fromkeys(filter(_is_section, vars(sections).values())),
        PersonSpec,
        AttributesConfig,
        AttributeConfig,
    ]
    types = [*map(_furniture_row, BUILT_IN), SCENARIO_TYPES]
    defaults = ScenarioConfig().settings()
    of_core = {Limits: defaults["robot"]["limits"]}
    of_core |= {Rules: defaults["rules"], Social: defaults["social"], LabelSpec: defaults["label"]}
    tables = [*map(_settings, models), *(_listed(*section) for section in of_core.items())]
    return "\n".join([SCENARIO_INTRO, *types, *tables])


STUDY_INTRO = """\
<!-- written by docs/generate_format.py from sonata2d/study -->
# The study file

Every key, by section, with its default. [Run a study in a day](how-to/studies.md) explains how to use it.

A text is one text, or one for each language of the study: `{en: Welcome, de: Willkommen}`. Within braces, a text with
a comma, a colon or a question mark needs quotes. Texts that are Markdown may have headings, lists, tables, links and
emphasis; HTML in them is shown as text. A picture is a PNG, JPEG, GIF, WebP or SVG file of up to 5 MB, relative to the
study file, and is copied into the folder of the study; a picture of another server becomes a link:

```yaml
pages: [{title: The room, text: "![Plan of the room](images/waiting-room.png)"}]
```
"""


STUDY_SCALES = """\
## Published questionnaires

Write `{scale: rosas}` where questions are asked; with `subscales`, the parts to ask. Items are in English, and a study
translates them under `texts`, by the names below:

```yaml
after_run:
  - scale: rosas
    subscales: [warmth]
    texts:
      de: {question: …, first: …, last: …, happy: …, feeling: …, social: …, organic: …, compassionate: …, emotional: …}
```

`question` stands above the table, `first` and `last` are the meanings of its ends. An item that is a pair of opposites
is a list of two texts. Where a validated translation is published, use it.

| name | | parts and numbers of items | points | source |
| --- | --- | --- | --- | --- |"""


STUDY_TABLES = """\
## Tables of results

`sonata2d study results` writes these columns. A cell without a value is empty; a text that a spreadsheet would take for
a formula (it begins with `=`, `+`, `-`, `@`, a tab or a new line), or that begins with an apostrophe, is preceded by an
apostrophe: remove the first character of each text that begins with one to restore the answers.
"""


def _items_of(name: str) -> str:
    """Names and texts of the items of a questionnaire."""
    scale = scale_named(name)
    frame = [("question", scale.question), *zip(("first", "last"), scale.ends or (), strict=False)]
    rows = [f"| `{key}` | | {text} |" for key, text in frame]
    for item in scale.items:
        text = " – ".join(map(str, item.ends)) if item.ends else item.text
        rows.append(f"| `{item.name}` | `{item.subscale}` | {text}{' (reversed)' if item.reversed else ''} |")
    return "\n".join([f"### {name}", "| key | part | text |", "| --- | --- | --- |", *rows, ""])


def study_page() -> str:
    """docs/study.md."""
    sections = [section for section in vars(study).values() if _is_section(section)]
    parts = [section for section in sections if section.__module__ == study.__name__ and section is not StudyConfig]
    kinds = {name: question_kind(name) for name in QUESTION_KINDS.built_in}
    rows = []
    for name in scale_names():
        scale = scale_named(name)
        subscales = ", ".join(f"`{part}` ({len(scale.part([part]).items)})" for part in scale.subscales)
        rows.append(f"| `{name}` | {scale.title} | {subscales} | 1 to {scale.points} | {scale.source} |")
    items = [_items_of(name) for name in scale_names()]
    settings = [_settings(part) for part in [StudyConfig, *parts, Question]]
    settings += [_settings(kind, f"kind: {name}", set(Question.model_fields)) for name, kind in kinds.items()]
    settings += [_settings(part) for part in (Item, ScaleConfig)]
    return "\n".join([STUDY_INTRO, *settings, STUDY_SCALES, *rows, "", *items, STUDY_TABLES, *map(_columns_of, TABLES)])


def _columns_of(table: str) -> str:
    rows = [f"| `{column}` | {meaning} |" for column, meaning in TABLES[table].items()]
    return "\n".join([f"### {table}.csv", "| column | |", "| --- | --- |", *rows, ""])


def _is_section(kind: object) -> bool:
    is_settings = isinstance(kind, type) and issubclass(kind, Settings) and kind not in (Settings, Normal)
    return is_settings and not kind.__name__.startswith("_")


def _settings(model: type[Settings], title: str = "", hidden: Collection[str] = ()) -> str:
    """The docstring of a section, and the defaults of its plain keys but the hidden ones."""
    plain = {k: f.get_default(call_default_factory=True) for k, f in model.model_fields.items() if not f.is_required()}
    given = model.model_construct(**plain).model_dump(mode="json")
    shown = {k: value for k, value in given.items() if k not in hidden and not is_section(type(plain[k]))}
    return _listed(model, shown, title)


def _listed(section: type, defaults: dict[str, Any], title: str = "") -> str:
    """The docstring of a section, and its defaults."""
    rows = [f"{key}: {json.dumps(value)}" for key, value in defaults.items()]
    block = ["```yaml", *rows, "```"] if rows else []
    text = inspect.cleandoc(section.__doc__ or "")
    return "\n".join([f"## {title or section.__name__}", "```text", text, "```", *block, ""])


def pages() -> dict[Path, str]:
    """The text of every generated file."""
    schemas = {
        "episode-v2": models.Episode,
        "manifest-v1": manifest_models.Manifest,
        "manifest-v2": manifest_models.ShardedManifest,
    }
    texts = {
        DOCS / "schema" / f"{name}.schema.json": json.dumps(schema_of(model, name), indent=2, ensure_ascii=False) + "\n"
        for name, model in schemas.items()
    }
    written = {"format.md": format_page(), "scenario.md": scenario_page(), "study.md": study_page()}
    return {DOCS / name: text for name, text in written.items()} | texts


def main() -> int:
    """Write the pages, or with --check report those that are not up to date."""
    old = [path for path, text in pages().items() if not path.exists() or path.read_text("utf-8") != text]
    if "--check" in sys.argv[1:]:
        for path in old:
            sys.stderr.write(f"{path} is not up to date; run python docs/generate_format.py\n")
        return 1 if old else 0
    for path in old:
        path.parent.mkdir(exist_ok=True)
        path.write_text(pages()[path], "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
