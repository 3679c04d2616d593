"""Scenarios by name or from a file (YAML, JSON, TOML), with errors that say where."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ...errors import ConfigError
from ...registry import did_you_mean
from .config import ScenarioConfig
from .ranges import Settings

_PRESETS = Path(__file__).parents[1] / "presets"
_SUFFIXES = (".yaml", ".yml", ".json", ".toml")


def scenario_names() -> dict[str, str]:
    """The presets: name to one-line description."""
    return {name: str(_read(_PRESETS / f"{name}.yaml")["description"]) for name in _presets()}


def load_scenario(name_or_path: str | Path) -> ScenarioConfig:
    """A preset by name, or a scenario from a file.

    A file may say `extends: sonata-2020`, or a path beside it, to change only some settings of another scenario. Its
    name is the file's own unless it gives one.

    Raises:
        ConfigError: there is no such preset or file, or it says something that cannot be used; one line that names
            file, line, key and value.
    """
    return _validated(_found(str(name_or_path), Path()), ())[0]


def _presets() -> list[str]:
    return sorted(path.stem for path in _PRESETS.glob("*.yaml"))


def _found(name: str, folder: Path) -> Path:
    """The file of a preset's name or of a path, which may be relative to a folder."""
    path = folder / name
    if name in _presets():
        return _PRESETS / f"{name}.yaml"
    if path.is_file():
        return path
    beside = [str(other) for other in sorted(path.parent.glob("*")) if other.suffix in _SUFFIXES]
    hint = did_you_mean(name, [*_presets(), *beside]) or f"; presets are {', '.join(_presets())}"
    raise ConfigError(f"no scenario file or preset {name!r}{hint}")


def _validated(path: Path, below: tuple[Path, ...]) -> tuple[ScenarioConfig, dict[str, Any]]:
    """A file's scenario, and its settings as given, on top of those that it extends."""
    if path.resolve() in below:
        raise ConfigError(f"{path.name} extends itself")
    given = _read(path)
    if "extends" in given:
        under = _extended(path, str(given.pop("extends")), below)
        given = _laid_over({k: v for k, v in under.items() if k not in ("name", "description")}, given, ScenarioConfig)
    given = {"name": path.stem} | given
    try:
        return ScenarioConfig.model_validate(given), given
    except ValidationError as error:
        raise ConfigError(_message(path, given, error)) from None


def _extended(path: Path, base: str, below: tuple[Path, ...]) -> dict[str, Any]:
    """The settings of the scenario that a file extends."""
    try:
        return _validated(_found(base, path.parent), (*below, path.resolve()))[1]
    except ConfigError as error:
        raise ConfigError(f"{path.name}{_line(path, ['extends'])}: extends: {error}") from None


def _laid_over(under: dict[str, Any], over: dict[str, Any], model: type[Settings]) -> dict[str, Any]:
    """Settings on top of others, section by section; who is counted as humans is not counted again."""
    counted = {"standing", "wandering"}
    hidden = counted if "humans" in over else {"humans"} if counted & over.keys() else set()
    merged = {key: value for key, value in under.items() if key not in hidden}
    for key, value in over.items():
        section = model.model_fields[key].annotation if key in model.model_fields else None
        if isinstance(value, dict) and isinstance(section, type) and issubclass(section, Settings):
            value = _laid_over(merged.get(key) or {}, value, section)
        merged[key] = value
    return merged


def _read(path: Path) -> dict[str, Any]:
    """What a file says, as Python values."""
    import yaml

    try:
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".toml":
            content = tomllib.loads(text)
        else:
            content = json.loads(text) if path.suffix == ".json" else yaml.safe_load(text)
    except yaml.MarkedYAMLError as error:
        line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise ConfigError(f"{path.name}{line}: {error.problem}") from None
    except json.JSONDecodeError as error:
        raise ConfigError(f"{path.name}, line {error.lineno}: {error.msg}") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path.name}: {error}") from None
    if not isinstance(content, dict):
        raise ConfigError(f"{path.name}: a scenario is a mapping of settings, not {type(content).__name__}")
    return content


def _message(path: Path, given: dict[str, Any], error: ValidationError) -> str:
    """The first thing wrong, on one line: file, line, key, what is wrong, value."""
    first, *others = error.errors(include_url=False)
    further = first.get("ctx", {}).get("path", ())
    keys, value = _walked(given, (*first["loc"], *further))
    where = ".".join(str(key) for key in keys) + ": " if keys else ""
    got = f" (got {_short(value)})" if first["type"] not in ("unknown_key", "missing") and keys else ""
    more = f" (and {len(others)} more)" if others else ""
    return f"{path.name}{_line(path, keys)}: {where}{first['msg']}{got}{more}"


def _walked(given: Any, keys: tuple[int | str, ...]) -> tuple[list[int | str], Any]:
    """The keys that lead to a setting, without those that only pydantic knows, and its value."""
    known: list[int | str] = []
    for key in keys:
        is_item = isinstance(given, list) and isinstance(key, int) and key < len(given)
        if is_item or (isinstance(given, dict) and key in given):
            known.append(key)
            given = given[key]
        elif key == keys[-1] and isinstance(given, dict):  # a setting that is missing
            known.append(key)
    return known, given


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _line(path: Path, keys: list[int | str]) -> str:
    """`, line 3`, if the file's format tells: the line of the last of the keys that the file has."""
    import yaml

    if path.suffix == ".toml":
        return ""
    try:
        node = yaml.compose(path.read_text(encoding="utf-8"), Loader=yaml.SafeLoader)
    except yaml.YAMLError:  # JSON that is indented by tabs
        return ""
    line = None
    for key in keys:
        if isinstance(node, yaml.MappingNode):
            found = next(((k, v) for k, v in node.value if k.value == str(key)), None)
        else:
            found = (node.value[key],) * 2 if isinstance(node, yaml.SequenceNode) else None
        if found is None:
            break
        line, node = found[0].start_mark.line + 1, found[1]
    return f", line {line}" if line else ""
