"""Names for bench.py, which leaves this package."""

from .options import PATH as PATH, examples as examples, json_option as json_option
from .output import echo as note, progress as progress, show_json as show_json, show_table as show_table

__all__ = ["PATH", "examples", "json_option", "note", "progress", "show_json", "show_table"]
