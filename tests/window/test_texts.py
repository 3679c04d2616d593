"""The words of the window are in one table per language, and researchers can translate them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from sonata2d import window
from sonata2d.collect import texts
from sonata2d.collect.texts import choose_language, fields_of, languages, text
from sonata2d.errors import ConfigError
from sonata2d.view.legend import TEXTS

FOLDER = Path(window.__file__).parent
MODULES = sorted(path for path in FOLDER.glob("*.py") if path.name not in ("texts.py", "profiles.py"))
ENGLISH = texts.table("en")
PAGES = [path for path in FOLDER.parent.glob("web/**/*") if path.suffix in (".py", ".js", ".html")]
NAMED_IN = ("core/labels.py", "core/proxemics.py", "core/furniture_types.py", "view/legend.py")
NAMES_OF = [FOLDER.parent / path for path in NAMED_IN]  # values of keys, beside the window
SECTION = re.compile(r"[a-z]+\.")  # at the start of a key
WORDS = re.compile(r"[A-Za-z]{2,} [A-Za-z]{2,}|^[A-Z][a-z]{2,}")
NO_WORDS = {
    "Enter", "Backspace", "Space", "Esc", "Ctrl+Q",  # keys, shown as they are printed on them
    "page up", "page down",  # SDL's names of keys
    "another scene",  # a reason in the log of a folder
}  # fmt: skip


def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@pytest.fixture(autouse=True)
def _english() -> Iterator[None]:
    yield
    choose_language("en")


def constants(trees: list[ast.Module]) -> set[str]:
    """All constant strings."""
    nodes = (node for tree in trees for node in ast.walk(tree))
    return {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def composed(trees: list[ast.Module], names: set[str]) -> list[re.Pattern[str]]:
    """Keys that f-strings compose, such as `readings.{light}`: of a constant section, and of names in the program."""
    name = f"(?:{'|'.join(sorted(names, key=len, reverse=True))})"
    found = []
    for node in (node for tree in trees for node in ast.walk(tree)):
        if isinstance(node, ast.JoinedStr) and isinstance(node.values[0], ast.Constant):
            parts = [re.escape(str(v.value)) if isinstance(v, ast.Constant) else name for v in node.values]
            if SECTION.match(str(node.values[0].value)):
                found.append(re.compile("".join(parts)))
    return found


def shown_literals(tree: ast.AST) -> Iterator[str]:
    """Strings that may be shown: not docstrings, errors, log lines, or explanations of assertions."""
    hidden: set[int] = set()
    for node in ast.walk(tree):
        is_log = isinstance(node, ast.Call) and ast.unparse(node.func).startswith("logger.")
        if is_log or isinstance(node, ast.Raise | ast.Assert):
            hidden |= {id(inner) for inner in ast.walk(node)}
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            hidden.add(id(node.value))
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in hidden:
            yield node.value


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_no_screen_shows_words_that_are_not_in_the_table(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert [words for words in shown_literals(tree) if WORDS.search(words) and words not in NO_WORDS] == []


def test_every_text_that_a_screen_names_exists_and_every_text_is_used() -> None:
    trees = [parsed(path) for path in FOLDER.glob("*.py")]
    named = {
        node.args[0].value
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "text" and isinstance(node.args[0], ast.Constant)
    }
    assert named - set(ENGLISH) == set()
    names = {word for word in constants(trees + [parsed(path) for path in NAMES_OF]) if re.fullmatch(r"\w+", word)}
    names |= set(TEXTS)
    patterns, written = composed(trees, names), constants(trees)
    unused = [key for key in ENGLISH if key not in written and not any(p.fullmatch(key) for p in patterns)]
    of_pages = "\n".join(path.read_text(encoding="utf-8") for path in PAGES)
    assert [key for key in unused if f'"{key}"' not in of_pages] == []


def test_a_text_without_use_is_found() -> None:
    trees = [ast.parse("text(f'{section}.{key}'); text(f'run.{name}'); text('menu.quit')")]
    (pattern,) = composed(trees, {"goal"})
    assert pattern.fullmatch("run.goal")
    assert not pattern.fullmatch("run.swim")


@pytest.mark.parametrize("language", languages())
def test_a_language_has_all_texts_with_the_same_values(language: str) -> None:
    table = texts.table(language)
    assert set(table) == set(ENGLISH)
    assert {key for key in table if fields_of(table[key]) != fields_of(ENGLISH[key])} == set()


def test_the_legend_in_english_is_that_of_pictures() -> None:
    assert {f"legend.{name}": words for name, words in TEXTS.items()}.items() <= ENGLISH.items()


def test_a_table_of_ones_own_falls_back_to_english(tmp_path: Path) -> None:
    (tmp_path / "latin.toml").write_text('[run]\nkeep_question = "Servare?"\n', encoding="utf-8")
    choose_language(str(tmp_path / "latin.toml"))
    assert (text("run.keep_question"), text("run.keep")) == ("Servare?", "Keep (Enter)")


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ('[run]\nkept = "x"', r"there is no text 'run.kept'; did you mean 'run.keep'"),
        ('kept = "x"', "there is no text"),
        ("[run]\nkeep = 3", "a text in quotes is expected"),
        ('[run]\nkeep = "{count}"', r"may have no braces"),
        ('[run]\ngoal = "{time!r}"', r"may have {time}"),
        ('[run]\ngoal = "{time"', r"may have {time}"),
        ("[run", "not valid TOML"),
        ("[run]\nkeep = " + "[" * 5000, "not valid TOML"),
    ],
)
def test_a_wrong_table_is_refused_by_file_and_key(tmp_path: Path, content: str, problem: str) -> None:
    path = tmp_path / "own.toml"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ConfigError, match=problem) as error:
        choose_language(str(path))
    assert "own.toml" in str(error.value)
    assert text("run.keep") == "Keep (Enter)", "the language before stays"


def test_an_unknown_language_names_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="choose de, en, es, zh"):
        choose_language("latin")
    with pytest.raises(ConfigError, match=r"absent\.toml cannot be read: No such file"):
        choose_language(str(tmp_path / "absent.toml"))
