"""Parsing of settings files: YAML, JSON and TOML, within limits that no sensible file reaches.

A file is refused if it is too large or nested too deeply, if a mapping has too many keys, if aliases repeat more values
than a file of that size could hold, or if a key is given twice, which would silently drop the first value.
"""

from __future__ import annotations

import json
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

from ...core.files.limits import (
    MAX_SCENARIO_BYTES,
    MAX_SCENARIO_DEPTH,
    MAX_SCENARIO_KEYS,
    MAX_SCENARIO_VALUES,
    MAX_TOML_BYTES,
    MAX_YAML_BYTES,
)
from ...core.files.reading import read_at_most
from ...core.wording import one_line, shown
from ...errors import ConfigError

_MAX_BYTES_WITH_LINES = 200_000
_HINTS = {  # by a part of an error of PyYAML
    "got '?'": "; put a text with a question mark in quotes",  # which ends a text within braces
    "got ':'": "; put a text with a colon in quotes",
    "mapping values are not allowed": "; correct the indentation, or put a text with a colon in quotes",
    "found character '\\t'": "; indent with spaces",
}
_TOO_DEEP = f"values are nested more than {MAX_SCENARIO_DEPTH} deep"
_TOO_MANY = f"a mapping has more than {MAX_SCENARIO_KEYS} keys"


def parse_settings(path: Path, kind: str = "scenario") -> dict[str, Any]:
    """Parse a file of settings.

    Args:
        path: of the file.
        kind: what the settings describe, for error messages.

    Raises:
        ConfigError: the file cannot be read, is not valid, or exceeds a limit; one line with file and, if known, line.
    """
    import yaml

    try:
        text = _read_text(path)
        if path.suffix == ".toml":
            content = tomllib.loads(text)
        elif path.suffix == ".json":
            content = json.loads(text, object_pairs_hook=_object)
        else:
            content = yaml.load(text, _yaml_loader())
        _require_limits(content)
        if "\\u" in text:  # an escape may give half a character, which no file can hold
            json.dumps(content, ensure_ascii=False, skipkeys=True, default=str).encode()
    except yaml.MarkedYAMLError as error:
        line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        hint = next((hint for part, hint in _HINTS.items() if part in str(error.problem)), "")
        raise ConfigError(f"{path.name}{line}: {error.problem}{hint}") from None
    except json.JSONDecodeError as error:
        raise ConfigError(f"{path.name}, line {error.lineno}: {error.msg}") from None
    except OSError as error:
        raise ConfigError(f"{path.name} cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path.name} is not UTF-8 text ({error.reason}); save it in this encoding") from None
    except (ValueError, yaml.YAMLError) as error:
        raise ConfigError(f"{path.name}: {one_line(error, 300)}") from None
    except RecursionError:
        raise ConfigError(f"{path.name}: values are nested too deeply") from None
    if not isinstance(content, dict):
        raise ConfigError(f"{path.name}: a {kind} is a mapping of settings, not {type(content).__name__}")
    return content


def line_of(path: Path, keys: list[int | str]) -> str:
    """Return `, line 3` for the last of the keys that the file contains; empty where the line cannot be determined."""
    import yaml

    if path.suffix == ".toml" or not path.is_file() or path.stat().st_size > _MAX_BYTES_WITH_LINES:
        return ""  # a pipe cannot be read again, and positions in a large file take a minute
    try:
        node = yaml.compose(_read_text(path), Loader=_yaml_loader())  # reads JSON as well
    except yaml.YAMLError:  # JSON indented with tabs
        return ""
    line = None
    for key in keys:
        if isinstance(node, yaml.MappingNode):
            entry = next(((k, v) for k, v in node.value if k.value == str(key)), None)
        else:
            entry = (node.value[key],) * 2 if isinstance(node, yaml.SequenceNode) else None
        if entry is None:
            break
        line, node = entry[0].start_mark.line + 1, entry[1]
    return f", line {line}" if line else ""


def _read_text(path: Path) -> str:
    """The text of a file, without a byte order mark."""
    maximum = {".json": MAX_SCENARIO_BYTES, ".toml": MAX_TOML_BYTES}.get(path.suffix, MAX_YAML_BYTES)
    data = read_at_most(path, maximum, remedy="write it as .json, which may be larger")
    return data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")  # as Python's text files


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object without repeated keys."""
    content = dict(pairs)
    if len(content) < len(pairs):
        repeated = next(key for key, count in Counter(key for key, _ in pairs).items() if count > 1)
        raise ValueError(f"the key {shown(repeated)} is given twice")
    return content


def _require_limits(content: Any) -> None:
    """Raise ValueError if lists and mappings are nested too deeply, or a mapping has too many keys."""
    depth, level = 0, [content]
    while level:
        inner = [value for value in level if isinstance(value, (dict, list))]
        if any(isinstance(value, dict) and len(value) > MAX_SCENARIO_KEYS for value in inner):
            raise ValueError(_TOO_MANY)
        level = [item for value in inner for item in (value.values() if isinstance(value, dict) else value)]
        depth += bool(inner)
        if depth > MAX_SCENARIO_DEPTH:
            raise ValueError(_TOO_DEEP)


@cache
def _yaml_loader() -> Any:
    """PyYAML's safe loader, with limits."""
    import yaml

    class Loader(yaml.SafeLoader):
        depth = 0

        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                return super().compose_node(parent, index)
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            if self.depth > MAX_SCENARIO_DEPTH:
                raise yaml.MarkedYAMLError(None, None, _TOO_DEEP, mark)
            if isinstance(parent, yaml.MappingNode) and len(parent.value) > MAX_SCENARIO_KEYS:
                raise yaml.MarkedYAMLError(None, None, _TOO_MANY, mark)
            self.depth += 1
            node = super().compose_node(parent, index)
            self.depth -= 1
            if isinstance(node, yaml.MappingNode):
                seen: set[str] = set()
                for key, _ in node.value:
                    if isinstance(key, yaml.ScalarNode) and key.value != "<<":
                        if key.value in seen:
                            problem = f"the key {shown(key.value)} is given twice"
                            raise yaml.MarkedYAMLError(None, None, problem, key.start_mark)
                        seen.add(key.value)
            return node

        def get_single_node(self) -> Any:
            node = super().get_single_node()
            if node is not None and _value_count(node, {}) > MAX_SCENARIO_VALUES:
                raise yaml.YAMLError(f"aliases repeat more than {MAX_SCENARIO_VALUES} values")
            return node

    return Loader


def _value_count(node: Any, known: dict[int, int]) -> int:
    """Number of values of a YAML node, with the values that aliases repeat."""
    if isinstance(node.value, str):
        return 1
    if id(node) not in known:
        known[id(node)] = MAX_SCENARIO_VALUES  # an alias of the node within itself has no end
        count = 1
        for item in node.value:
            for part in item if isinstance(item, tuple) else (item,):
                count += _value_count(part, known)
        known[id(node)] = count
    return known[id(node)]
