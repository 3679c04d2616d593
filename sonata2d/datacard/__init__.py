"""The data card in full: how the data look, and what machines read of them."""

from .croissant import croissant
from .survey import Survey, surveyed
from .write import FIGURES, write_card

__all__ = ["FIGURES", "Survey", "croissant", "surveyed", "write_card"]
