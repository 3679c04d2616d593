"""The HTML templates of this package."""

from __future__ import annotations

from typing import Any

from .summary import format_number


def render(template: str, **values: Any) -> str:
    """Fill a template of this package; texts are escaped.

    Args:
        template: name of the file.
        values: of the names in the template.
    """
    from jinja2 import Environment, PackageLoader

    loader = PackageLoader(__package__, ".")
    environment = Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["number"] = format_number
    return environment.get_template(template).render(values)
