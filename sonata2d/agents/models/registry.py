"""The walking models by name."""

from __future__ import annotations

from .moussaid2009 import Moussaid2009Model
from .walkers import WalkingModel

MODELS: dict[str, type[WalkingModel]] = {"moussaid2009": Moussaid2009Model}
