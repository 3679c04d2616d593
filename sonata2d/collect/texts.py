"""The words of the window and of the browser's pages: one table for each language, in `languages/`."""

from __future__ import annotations

import string
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from ..core.files.reading import read_at_most
from ..errors import ConfigError
from ..registry import did_you_mean, furniture_types

_FOLDER = Path(__file__).with_name("languages")
_ENGLISH = "en"
_MAX_BYTES = 1_000_000  # of a table
_chosen: dict[str, str] = {}


def text(key: str, /, **values: object) -> str:
    """A text of the chosen language with its values filled in; in English if the language does not have it.

    >>> text("readings.run_of", number=2, count=20)
    'run 2 of 20'
    """
    template = _chosen.get(key) or _file(_ENGLISH).get(key) or table(_ENGLISH)[key]
    return template.format(**values) if values else template


def languages() -> list[str]:
    """Names of the languages that come with sonata2d."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def choose_language(name: str) -> None:
    """Use a language for the window.

    Args:
        name: of a language that comes with sonata2d (`en`), or the path of a table in TOML.

    Raises:
        ConfigError: the table cannot be read, or has an unknown key or value.
    """
    texts = table(name) if name in languages() else read_table(Path(name))
    _chosen.clear()
    _chosen.update(texts)


def table(language: str) -> dict[str, str]:
    """All texts of a language that comes with sonata2d, by `section.key`.

    Types of furniture bring their own; one that has none in the language is called as in English.
    """
    kinds = [kind for kind in furniture_types().values() if kind.count]
    words = {f"scene.{kind.count}": kind.words.get(language, kind.words[_ENGLISH]) for kind in kinds}
    return words | _file(language)


@cache
def _file(language: str) -> dict[str, str]:
    """The texts of a language in its file."""
    return _flat(tomllib.loads((_FOLDER / f"{language}.toml").read_text(encoding="utf-8")))


def _flat(tables: dict[str, Any]) -> dict[str, Any]:
    """Texts by `section.key`."""
    return {
        f"{section}.{key}": value
        for section, entries in tables.items()
        for key, value in (entries.items() if isinstance(entries, dict) else {"": entries}.items())
    }


def read_table(path: Path) -> dict[str, str]:
    """The texts of a researcher's table, by `section.key`.

    Raises:
        ConfigError: the table cannot be read, or has an unknown key or value.
    """
    english = table(_ENGLISH)
    if path.suffix.lower() != ".toml":
        known = ", ".join(languages())
        raise ConfigError(f"no language {str(path)!r}; choose {known}, or name a file that ends in .toml")
    try:
        read = _flat(tomllib.loads(read_at_most(path, _MAX_BYTES).decode("utf-8")))
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path} is not valid TOML: {error}") from None
    for key, value in read.items():
        if key not in english:
            raise ConfigError(f"{path}: there is no text {key!r}{did_you_mean(key, english)}")
        if not isinstance(value, str):
            raise ConfigError(f"{path}: {key} is {value!r}; a text in quotes is expected")
        if not fields_of(value) <= fields_of(english[key]):
            allowed = ", ".join(f"{{{field}}}" for field in sorted(fields_of(english[key]))) or "no braces"
            raise ConfigError(f"{path}: {key} is {value!r}; it may have {allowed}")
    return read


def fields_of(template: str) -> set[str]:
    """Names in braces of a text; a text with unbalanced braces has the name `!`, which no text may have."""
    try:
        parts = string.Formatter().parse(template)
        return {f"{name}{spec}{conversion or ''}" for _, name, spec, conversion in parts if name is not None}
    except ValueError:
        return {"!"}
