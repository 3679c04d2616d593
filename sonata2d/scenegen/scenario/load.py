"""Loading scenarios: presets by name, and YAML, JSON or TOML files. Errors name file, line, key and value."""

from __future__ import annotations

import os
from collections.abc import Mapping
from copy import deepcopy
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from ...core.files.reading import is_shell_pipe
from ...core.wording import shown
from ...errors import ConfigError
from .base import Settings
from .config import ScenarioConfig, merged
from .parse import line_of, parse_settings
from .problems import problem_of

S = TypeVar("S", bound=Settings)
_PRESETS = Path(__file__).parents[1] / "presets"
_SUFFIXES = (".yaml", ".yml", ".json", ".toml")


def scenario_names() -> dict[str, str]:
    """Return the names of the presets, each with its one-line description."""
    return {name: str(parse_settings(_PRESETS / f"{name}.yaml")["description"]) for name in preset_names()}


def load_scenario(name_or_path: str | Path) -> ScenarioConfig:
    """Load a preset by name, or a scenario from a YAML, JSON or TOML file.

    A file may contain `extends: sonata-2020`, or a path relative to its own folder instead of the name, to change only
    some settings of another scenario. The scenario is named after the file unless the file sets `name`.

    Args:
        name_or_path: name of a preset, or path of a file. A preset takes precedence over a file of the same name.

    Raises:
        ConfigError: there is no such preset or file, or the file is invalid; one line with file, line, key and value.
    """
    return _load(_find(str(name_or_path), Path()), ())[0]


def scenario_of(scenario: object) -> ScenarioConfig:
    """The settings of a scenario that is given as a `ScenarioConfig`, by name or by path.

    Raises:
        ConfigError: as `load_scenario`.
        TypeError: it is something else, such as a dictionary.
    """
    if isinstance(scenario, ScenarioConfig):
        return scenario
    if isinstance(scenario, str | Path):
        return load_scenario(scenario)
    hint = "; ScenarioConfig(**settings) takes a dictionary" if isinstance(scenario, Mapping) else ""
    if hasattr(scenario, "act"):
        hint = "; write controller=..."
    raise TypeError(
        f"a scenario is the name of a preset, the path of a file or a ScenarioConfig, got {shown(scenario)}{hint}"
    )


def preset_names() -> list[str]:
    """Return the names of the presets, in alphabetical order."""
    return sorted(path.stem for path in _PRESETS.glob("*.yaml"))


def _find(name: str, folder: Path) -> Path:
    """Return the file of a preset name, or of a path relative to `folder`."""
    path = folder / name
    if name in preset_names():
        return _PRESETS / f"{name}.yaml"
    try:
        if path.is_file() or is_shell_pipe(path):
            return path
        if path.is_dir():
            raise ConfigError(f"{name} is a folder; name a scenario file in it")
        if path.exists():
            raise ConfigError(f"{name} is a device or a named pipe, not a scenario file")
        neighbours = [str(other) for other in sorted(path.parent.glob("*")) if other.suffix in _SUFFIXES]
    except (OSError, ValueError) as error:  # not the name of a file, e.g. too long
        raise ConfigError(f"no scenario file or preset {shown(name)}: {getattr(error, 'strerror', error)}") from None
    known = {Path(other).stem: other for other in (*neighbours, *preset_names())}
    close = get_close_matches(path.stem, known, n=1)  # without suffixes, which files have in common
    hint = f"; did you mean {known[close[0]]!r}?" if close else f"; presets are {', '.join(preset_names())}"
    raise ConfigError(f"no scenario file or preset {name!r}{hint}")


_preset_settings = cache(parse_settings)


def _load(path: Path, extended_by: tuple[Path, ...]) -> tuple[ScenarioConfig, dict[str, Any]]:
    """Load a file.

    Args:
        path: of the file.
        extended_by: chain of files that extend this one, to detect a cycle.

    Returns:
        The scenario, and its settings as written in the file, merged into the settings of the scenario that it extends.
    """
    if _real(path) in extended_by:
        raise ConfigError(f"{path.name} extends itself")
    # Presets do not change, and parsing one takes as long as a generated scene.
    settings = deepcopy(_preset_settings(path)) if path.parent == _PRESETS else parse_settings(path)
    if "extends" in settings:
        try:
            base = _load(_find(str(settings.pop("extends")), path.parent), (*extended_by, _real(path)))[1]
        except ConfigError as error:
            raise ConfigError(f"{path.name}{line_of(path, ['extends'])}: extends: {error}") from None
        base = {key: value for key, value in base.items() if key not in ("name", "description")}
        settings = merged(base, settings)
    settings = {"name": path.stem} | settings
    return validated(ScenarioConfig, settings, path), settings


def validated(kind: type[S], settings: dict[str, Any], path: Path) -> S:
    """Validate the settings of a file.

    Args:
        kind: class of the settings.
        settings: as parsed.
        path: of the file, for the message.

    Raises:
        ConfigError: a setting is invalid; one line with file, line, key and value.
    """
    try:
        return kind.model_validate(settings)
    except ValidationError as error:
        keys, text = problem_of(settings, error)
        raise ConfigError(f"{path.name}{line_of(path, keys)}: {text}") from None


def _real(path: Path) -> Path:
    """The path without symbolic links; unlike `Path.resolve`, without an exception for a link to itself."""
    return Path(os.path.realpath(path))
