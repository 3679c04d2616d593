"""Writes docs/api.md from signatures and docstrings of the public names: `python docs/generate_api.py [--check]`."""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import UnionType
from typing import Any

import sonata2d as s2

PAGE = Path(__file__).parent / "api.md"

INTRO = """\
<!-- written by docs/generate_api.py from the docstrings -->
# API reference

The public names of `sonata2d`, by purpose, and those of its packages. Names that are not on this page may change
without notice. Units are SI, angles radians; N people, T frames. [First steps](first-steps.md) and
[How to](how-to.md) show them in use.

"""

# purpose: names of the top level; a name that is not listed here comes under OTHER
PURPOSES = {
    "Run an episode": ("Episode", "Scene", "generate", "Snapshot", "Frame", "Outcome", "Observer"),
    "Write a controller": ("Controller", "Twist", "Pose", "Stop", "Regenerate", "check_controller", "clearance"),
    "Stock controllers": ("SocialPlanner", "StraightToGoal", "SocialForce", "Orca", "HumanLike"),
    "Describe scenarios": ("ScenarioConfig", "load_scenario", "Door", "Queue", "Place"),
    "Record and read episodes": ("JsonRecorder", "EpisodeRecorder", "read_episode", "EpisodeRecord", "Dataset"),
    "Generate data sets": ("generate_dataset",),
    "Evaluate": ("evaluate", "Comparison"),
    "Constants and types": ("INTIMATE_DISTANCE", "PERSONAL_DISTANCE", "SOCIAL_DISTANCE", "Array", "__version__"),
    "Exceptions": ("Sonata2dError", "errors"),
}
OTHER = "Other"
PACKAGES = {
    "sonata2d.agents": "Agents",
    "sonata2d.scenegen": "Scene generation",
    "sonata2d.record": "Episode files",
    "sonata2d.view": "Pictures, films and pages",
    "sonata2d.datasets": "Data sets",
    "sonata2d.metrics": "Metrics",
    "sonata2d.formats": "Formats",
    "sonata2d.gym": "Gymnasium environments",
    "sonata2d.learning": "Learned policies",
    "sonata2d.learning.graph": "Graphs",
    "sonata2d.testing": "Checks of controllers",
    "sonata2d.window": "The window",
}
SECTION = re.compile(r"^(Args|Attributes|Returns|Yields|Raises|Source):(.*)$")
ITEM = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*): (.*)$", re.DOTALL)
_SHOWN_WITH_SUBCLASSES = ("sonata2d.core.drawable",)  # modules of base classes whose methods subclasses list
MAX_SIGNATURE, MAX_DEFAULT = 100, 40  # characters
MAX_ENTRIES = 12  # of a constant


def signature_of(name: str, found: Any) -> str:
    """The call of a function or class, with one argument a line if it is long."""
    signature = inspect.signature(found)
    texts: list[str] = []
    for parameter in signature.parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and "*" not in texts:
            texts.append("*")
        texts.append(argument_of(parameter))
    returned = "" if inspect.isclass(found) else f" -> {signature.return_annotation}"
    line = f"{name}({', '.join(texts)}){returned}"
    if len(line) <= MAX_SIGNATURE:
        return line
    return f"{name}(\n" + "".join(f"    {text},\n" for text in texts) + f"){returned}"


def argument_of(parameter: inspect.Parameter) -> str:
    """An argument with its type and default; a default whose text is long, or an address, is shown as `...`."""
    stars = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
    annotation = "" if parameter.annotation is parameter.empty else f": {parameter.annotation}"
    if parameter.default is parameter.empty:
        return f"{stars}{parameter.name}{annotation}"
    default = repr(parameter.default)
    is_shown = len(default) <= MAX_DEFAULT and " at 0x" not in default
    return f"{parameter.name}{annotation} = {default if is_shown else '...'}"


def markdown_of(docstring: str) -> Iterator[str]:
    """The blocks of a docstring: paragraphs, examples, and lists of arguments, results and errors."""
    for block in re.split(r"\n\s*\n", inspect.cleandoc(docstring)):
        first, *rest = block.splitlines()
        section = SECTION.match(first)
        if first.startswith(">>>"):
            yield f"```pycon\n{block}\n```"
        elif section is None:
            yield block
        elif section[2] or not any(ITEM.match(line.strip()) for line in rest):  # one text
            yield f"{section[1]}: {' '.join([section[2].strip(), *(line.strip() for line in rest)]).strip()}"
        else:
            yield f"{section[1]}:\n\n" + "\n".join(f"- {as_item(item)}" for item in items_of(rest))


def items_of(lines: list[str]) -> Iterator[str]:
    """The entries of a section: lines that begin with a name, with those that follow and are indented further."""
    item: list[str] = []
    texts = [line for line in lines if line.strip()]
    indent = min((len(line) - len(line.lstrip()) for line in texts), default=0)
    for line in texts:
        if item and len(line) - len(line.lstrip()) == indent and ITEM.match(line.strip()):
            yield " ".join(item)
            item = []
        item.append(line.strip())
    if item:
        yield " ".join(item)


def as_item(item: str) -> str:
    """`name: text` with the name as code."""
    match = ITEM.match(item)
    return f"`{match[1]}`: {match[2]}" if match else item


def first_paragraph(docstring: str | None) -> str:
    return " ".join(inspect.cleandoc(docstring or "").split("\n\n")[0].split())


def methods_of(found: type) -> Iterator[tuple[str, str]]:
    """Public methods and properties that a class of sonata2d defines itself, or shows, with what they do."""
    members = dict(vars(found))
    for base in found.__mro__[1:]:
        if base.__module__ in _SHOWN_WITH_SUBCLASSES:
            members |= {name: value for name, value in vars(base).items() if name not in members}
    for name, value in members.items():
        if name.startswith("_"):
            continue
        function = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        getter = getattr(value, "fget", None) or getattr(value, "func", None)  # property, cached_property
        documented = getter or function
        if not callable(documented) or not getattr(documented, "__doc__", None):
            continue
        if getter is not None:
            yield f"`{name}`", first_paragraph(getter.__doc__)
        elif inspect.isfunction(function):
            arguments = [str(p).partition(":")[0].partition("=")[0].strip() for p in
                         inspect.signature(function).parameters.values() if p.name not in ("self", "cls")]  # fmt: skip
            yield f"`{name}({', '.join(arguments)})`", first_paragraph(function.__doc__)


def entry(name: str, found: Any, level: int) -> list[str]:
    """The blocks of one name."""
    blocks = [f"{'#' * level} `{name}`"]
    if inspect.ismodule(found):
        rows = [(n, first_paragraph(e.__doc__)) for n, e in vars(found).items() if inspect.isclass(e)]
        return [*blocks, first_paragraph(found.__doc__), "\n".join(f"- `{n}`: {text}" for n, text in rows)]
    if not (inspect.isfunction(found) or (inspect.isclass(found) and found.__module__.startswith("sonata2d"))):
        return [*blocks, _value(name, found)]
    if hasattr(found, "model_fields"):  # dozens of keys, which have a page of their own
        link = "Its keyword arguments are the keys of [the scenario file](scenario.md)."
        return [*blocks, first_paragraph(found.__doc__), link]
    if not (inspect.isclass(found) and (issubclass(found, Exception) or getattr(found, "_is_protocol", False))):
        blocks.append(f"```python\n{signature_of(name, found)}\n```")
    blocks += markdown_of(found.__doc__ or "")
    if inspect.isclass(found):
        rows = [(call, text.replace("|", "\\|")) for call, text in methods_of(found)]
        if rows:
            table = "\n".join(f"| {call} | {text} |" for call, text in rows)
            blocks.append(f"| method or property | |\n| --- | --- |\n{table}")
    return blocks


def _value(name: str, found: Any) -> str:
    if name == "__version__":
        return "Version of the package."
    if isinstance(found, int | float | str):
        return f"`{found!r}`"
    if isinstance(found, dict | tuple):
        shown = [f"`{getattr(key, 'name', key)}`" for key in list(found)[:MAX_ENTRIES]]
        rest = f", and {len(found) - len(shown)} more" if len(found) > len(shown) else ""
        return f"A {type(found).__name__} of {', '.join(shown)}{rest}."
    if isinstance(found, UnionType):
        return " or ".join(f"`{kind.__name__}`" for kind in found.__args__)
    return "NumPy array of floats." if name == "Array" else f"`{type(found).__name__}`"


def anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def page() -> str:
    """The whole page."""
    known = {name for names in PURPOSES.values() for name in names}
    purposes = PURPOSES | {OTHER: tuple(name for name in s2.__all__ if name not in known)}
    contents, blocks = [], []
    for title, names in purposes.items():
        present = [name for name in names if name in s2.__all__]
        if present:
            contents.append(f"- [{title}](#{anchor(title)}): " + ", ".join(f"[`{n}`](#{anchor(n)})" for n in present))
            blocks.append(f"## {title}")
            for name in present:
                blocks += entry(name, getattr(s2, name), 3)
    top = {id(getattr(s2, name)) for name in s2.__all__}
    for module, title in PACKAGES.items():
        package = importlib.import_module(module)
        heading = f"{title}: {module}"
        contents.append(f"- [{title}](#{anchor(heading)}): `{module}`")
        blocks += [f"## {heading}", first_paragraph(package.__doc__)]
        for name in package.__all__:
            found = getattr(package, name)
            if id(found) not in top or not callable(found):
                blocks += entry(f"{module.rpartition('.')[2]}.{name}", found, 3)
    return INTRO + "\n".join(contents) + "\n\n" + "\n\n".join(blocks) + "\n"


def main(arguments: list[str]) -> int:
    text = page()
    if "--check" not in arguments:
        PAGE.write_text(text, encoding="utf-8")
        return 0
    is_current = PAGE.exists() and PAGE.read_text(encoding="utf-8") == text
    if not is_current:
        print(f"{PAGE} is not up to date; run python docs/generate_api.py", file=sys.stderr)
    return int(not is_current)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
