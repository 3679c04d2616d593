"""The words of the page: every one that it names exists, and every one of its own is used."""

from __future__ import annotations

import re
from pathlib import Path

from sonata2d import web
from sonata2d.collect.texts import languages, table

FOLDER = Path(web.__file__).parent
SOURCE = "\n".join(
    path.read_text(encoding="utf-8") for path in sorted(FOLDER.rglob("*")) if path.suffix in (".js", ".html", ".py")
)
SECTIONS = "web|menu|readings|keys|run|notice|question|rating|action|player|researcher|help|legend"
KEY = re.compile(rf"""["']((?:{SECTIONS})\.(?!html|js\b)\w+)["']""")


def test_every_word_that_the_page_names_exists() -> None:
    named = set(KEY.findall(SOURCE))
    assert len(named) > 50
    assert named <= set(table("en"))


def test_every_word_of_the_page_is_used() -> None:
    own = {key for key in table("en") if key.startswith(("web.", "researcher."))}
    assert own - set(KEY.findall(SOURCE)) == set()


def test_every_language_has_all_words_of_the_page() -> None:
    own = {key for key in table("en") if key.startswith(("web.", "researcher."))}
    assert all(own <= set(table(language)) for language in languages())
