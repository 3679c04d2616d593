"""Texts in the languages of a study, and errors in its settings."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator
from pydantic_core import PydanticCustomError

from ..scenegen.scenario.base import Settings, TupleOf
from ..scenegen.scenario.problems import setting_error

Json = dict[str, Any]
Path = tuple[str | int, ...]  # keys that lead to a setting
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}")


def _as_written(value: Any) -> Any:
    """Refuse texts that YAML has read as something else.

    YAML cuts a text within braces at a comma; the rest of the text becomes a key without a value.
    """
    for text in value.values() if isinstance(value, dict) else [value]:
        if isinstance(text, bool):
            raise PydanticCustomError("text", "yes, no, on, off, true and false are texts in quotes only")
        if isinstance(text, int | float):
            raise PydanticCustomError("text", "a number is a text in quotes only")
    if isinstance(value, dict) and None in value.values():
        raise no_text(next(name for name, text in value.items() if text is None))
    return value


Text = Annotated[str | dict[str, str], BeforeValidator(_as_written)]
"""A text in one language, or by language."""


def _as_list(value: Any) -> Any:
    """Convert lists by language to a list of texts by language; other values are returned as they are.

    >>> _as_list({"en": ["rude", "kind"], "de": ["grob", "nett"]})
    [{'en': 'rude', 'de': 'grob'}, {'en': 'kind', 'de': 'nett'}]
    """
    if not isinstance(value, dict):
        return value
    for language, texts in value.items():
        if not isinstance(texts, list | tuple):
            raise setting_error(f"{language!r} has no list of texts; write {{en: [a, b], de: [c, d]}}, or [a, b]")
        for text in texts:
            _as_written(text)
    counts = {language: len(texts) for language, texts in value.items()}
    if len(set(counts.values())) > 1:
        listed = ", ".join(f"{count} in {language!r}" for language, count in counts.items())
        raise setting_error(f"each language needs as many texts, got {listed}")
    return [dict(zip(value, texts, strict=True)) for texts in zip(*value.values(), strict=True)]


def _as_languages(value: Any) -> Any:
    """Convert a list of texts by language to lists by language; other values are returned as they are.

    >>> _as_languages([{"en": "rude", "de": "grob"}, {"en": "kind", "de": "nett"}])
    {'en': ['rude', 'kind'], 'de': ['grob', 'nett']}
    """
    if not isinstance(value, list | tuple):
        return value
    if not all(isinstance(texts, dict) and texts.keys() == value[0].keys() for texts in value):
        raise setting_error("each text needs the same languages: {en: [a, b], de: [c, d]}, or [{en: a, de: c}, …]")
    return {language: [texts[language] for texts in value] for language in (value[0] if value else ())}


Texts = Annotated[TupleOf[Text], BeforeValidator(_as_list)]
"""Texts, each in one language or by language; or lists of texts by language."""
TwoTexts = Annotated[tuple[Text, Text], BeforeValidator(_as_list)]
Translations = Annotated[dict[str, tuple[str, ...]], BeforeValidator(_as_languages)]
"""Texts by language, `{en: [a, b], de: [c, d]}`; or a list of texts by language."""
TwoTranslations = Annotated[dict[str, tuple[str, str]], BeforeValidator(_as_languages)]


def in_language(text: Text, language: str) -> str:
    """A text in a language; in its first language if it lacks that one.

    >>> in_language({"en": "yes", "de": "ja"}, "de")
    'ja'
    """
    if isinstance(text, str):
        return text
    return text.get(language) or next(iter(text.values()), "")


def texts_in(settings: Settings, path: Path = ()) -> Iterator[tuple[Path, Text]]:
    """All texts that participants read, each with the keys that lead to it.

    The class attribute `translated` of settings names the keys whose values are texts.
    """
    translated = getattr(settings, "translated", ())
    for name in type(settings).model_fields:
        value, place = getattr(settings, name), (*path, name)
        for k, item in enumerate(value) if isinstance(value, tuple) else ((None, value),):
            where = place if k is None else (*place, k)
            if isinstance(item, Settings):
                yield from texts_in(item, where)
            elif name in translated and item is not None:
                yield where, item


def with_texts(settings: Settings, change: Callable[[Text], str]) -> Json:
    """Settings as JSON values, with each text replaced by the result of a function."""
    values = settings.model_dump(mode="json")
    for (*parents, last), text in texts_in(settings):
        place: Any = values
        for key in parents:
            place = place[key]
        place[last] = change(text)
    return values


def no_text(name: object) -> PydanticCustomError:
    """The error about a key without a text."""
    return setting_error(f"{name!r} has no text; a text with a comma needs quotes within braces")


def require_distinct(things: str, settings: Sequence[Any], *section: str) -> None:
    """Require different names.

    Args:
        things: plural of the things that have the names, for the message.
        settings: settings with a `name`.
        section: keys that lead to the settings.
    """
    names = [item.name for item in settings]
    for k, name in enumerate(names):
        if name in names[:k]:
            raise setting_error(f"two {things} have the name {name!r}", *section, k, "name")


def _require_name(name: str) -> str:
    """Require that a name can be a key of answers, and the name of a folder."""
    if not _NAME.fullmatch(name):
        raise setting_error("a name begins with a letter and has up to 40 letters, digits, dashes and underscores")
    return name


Name = Annotated[str, AfterValidator(_require_name)]
