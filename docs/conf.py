"""Configuration of the documentation site: `python -m sphinx -W docs site`; see CONTRIBUTING.md."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from types import UnionType
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

from sonata2d.version import __version__

if "GITHUB_REPOSITORY" in os.environ:  # where the publishing workflow runs
    _parts = "GITHUB_SERVER_URL", "GITHUB_REPOSITORY"
    REPOSITORY = "/".join([*(os.environ[name] for name in _parts), "blob", os.environ.get("GITHUB_REF_NAME", "main")])
else:
    REPOSITORY = ""

PAGE = os.environ.get("SONATA2D_DOCS_PAGE", "")  # folder to add to the site: `sonata2d page FOLDER/drive`
VERSIONS = os.environ.get("SONATA2D_DOCS_VERSIONS", "")  # address of the list of published versions
SHOWN = os.environ.get("SONATA2D_DOCS_VERSION", __version__).removeprefix("v")

project = "sonata2d"
author = "The sonata2d developers"
release = version = SHOWN

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_click",
    "sphinx_copybutton",
]
exclude_patterns = ["_templates", "notebooks/runs"]
smartquotes = False
templates_path = ["_templates"]

# Markdown, and notebooks with the results that are stored in them
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath", "substitution"]
myst_substitutions = {
    "drive_it": '<a class="drive-it" href="drive/index.html">Drive it in this browser</a>, without an installation: '
    "a robot among pedestrians, by keys or by code of your own."
    if PAGE
    else ""
}
html_math_renderer = "mathml"
nb_execution_mode = "off"

# docstrings
autosummary_generate = True
autosummary_imported_members = True
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False
python_maximum_signature_line_length = 88
toc_object_entries_show_parents = "hide"
add_module_names = False
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

html_theme = "pydata_sphinx_theme"
html_title = f"sonata2d {version}"
html_sidebars = {"index": [], "first-steps": [], "troubleshooting": []}  # they have no pages below them
html_static_path = ["_static"]
html_extra_path = [str(Path(PAGE).resolve())] if PAGE else []
html_css_files = ["site.css"]
html_favicon = "_static/favicon.svg"
html_show_sourcelink = False
html_theme_options: dict[str, Any] = {
    "logo": {"text": "sonata2d", "image_light": "_static/favicon.svg", "image_dark": "_static/favicon.svg"},
    "navbar_align": "left",
    "navbar_persistent": ["search-button"],
    "navbar_end": ["version-switcher", "theme-switcher"] if VERSIONS else ["theme-switcher"],
    "switcher": {"json_url": VERSIONS, "version_match": SHOWN},
    "check_switcher": False,
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "header_links_before_dropdown": 6,
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
copyright = "The sonata2d developers, MIT licence"


def _with_examples(app: Any, ctx: Any, lines: list[str]) -> None:
    """Show the examples of a command, one a line in its epilog, as a block that can be copied."""
    lines[:] = [
        "Examples:",
        "",
        ".. code-block:: sh",
        "",
        *(f"   {line.strip()}" for line in lines if line.strip()),
        "",
    ]


def _as_restructured_text(app: Any, what: str, name: str, found: Any, options: Any, lines: list[str]) -> None:
    """Docstrings have Markdown's `code`, which takes two backquotes here; constants have their type's."""
    if what == "data":
        lines[:] = [_constant(found), ""]
    elif not re.search(r"``|:`", text := "\n".join(lines)):  # as in docstrings inherited from other packages
        text = re.sub(r"(?<![`:])`([^`]+)`(?![`_])(\w?)", _literal, text)
        lines[:] = text.split("\n")


def _settings_signature(app: Any, what: str, name: str, found: Any, *others: Any) -> tuple[str, None] | None:
    """Settings have dozens of arguments, which their page lists; the signature would fill a screen."""
    return ("(**settings)", None) if what == "class" and hasattr(found, "model_fields") else None


def _literal(match: re.Match[str]) -> str:
    """Code, and an escaped space before a letter that follows, as the s of a plural."""
    return f"``{match[1]}``" + (f"\\ {match[2]}" if match[2] else "")


def _constant(found: Any) -> str:
    """What a constant is, in one line."""
    if isinstance(found, int | float | str):
        return f"``{found!r}``"
    if isinstance(found, Mapping | tuple):
        names = [f"``{getattr(key, 'name', key)}``" for key in found]
        return f"{type(found).__name__} of {', '.join(names[:12])}{', …' if len(names) > 12 else ''}"
    return f"The type ``{found}``." if isinstance(found, type | UnionType) else "NumPy array of floats."


def _with_links_to_the_repository(app: Any, page: str, source: list[str]) -> None:
    """Links to files outside of the documentation lead to the repository; they are plain text if it is not known."""
    docs = Path(app.srcdir)

    def link(match: re.Match[str]) -> str:
        path, _, anchor = match[2].partition("#")
        target = (docs / page).parent / path
        if "://" in path or not path or docs in target.resolve().parents or not target.exists():
            return match[0]
        place = target.resolve().relative_to(docs.parent).as_posix()
        return f"[{match[1]}]({REPOSITORY}/{place}{'#' + anchor if anchor else ''})" if REPOSITORY else match[1]

    source[0] = re.sub(r"(?<!!)\[([^\]]*)\]\(([^)\s]+)\)", link, source[0])


def _as_mathml(translator: Any, node: Any) -> None:
    """Formulas as MathML, which browsers show without a script and without a connection."""
    markup = tex2mathml(node.astext(), as_block=isinstance(node, nodes.math_block))
    translator.body.append(f'<div class="math">{markup}</div>' if isinstance(node, nodes.math_block) else markup)
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Connect the functions above."""
    shutil.rmtree(Path(__file__).parent / "api", ignore_errors=True)  # pages of names that may have been removed
    app.add_html_math_renderer("mathml", (_as_mathml, None), (_as_mathml, None))
    app.connect("source-read", _with_links_to_the_repository)
    app.connect("sphinx-click-process-epilog", _with_examples)
    app.connect("autodoc-process-signature", _settings_signature)
    app.connect("autodoc-process-docstring", _as_restructured_text, priority=400)
