"""The HTML templates of this package."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .summary import format_number


def render(
    template: str, *, package: str = str(__package__), number: Callable[[Any], str] = format_number, **values: Any
) -> str:
    """Fill a template of a package; texts are escaped.

    Args:
        template: name of the file.
        package: that holds it; by default this one.
        number: the filter `number` of templates.
        values: of the names in the template.
    """
    from jinja2 import Environment, PackageLoader

    loader = PackageLoader(package, ".")
    environment = Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["number"] = number
    return environment.get_template(template).render(values)
