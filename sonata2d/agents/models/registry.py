"""The walking models by name."""

from __future__ import annotations

from .moussaid2009 import Moussaid2009Model
from .sonata2026 import Sonata2026Model
from .walkers import WalkingModel

MODELS: dict[str, type[WalkingModel]] = {"sonata2026": Sonata2026Model, "moussaid2009": Moussaid2009Model}
