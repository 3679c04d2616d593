"""The walking models by name."""

from __future__ import annotations

from .farina2017 import Farina2017Model
from .helbing1995 import Helbing1995Model
from .helbing2000 import Helbing2000Model
from .moussaid2009 import Moussaid2009Model
from .orca2011 import Orca2011Model
from .sonata2026 import Sonata2026Model
from .walkers import WalkingModel

MODELS: dict[str, type[WalkingModel]] = {
    "sonata2026": Sonata2026Model,
    "moussaid2009": Moussaid2009Model,
    "helbing1995": Helbing1995Model,
    "helbing2000": Helbing2000Model,
    "farina2017": Farina2017Model,
    "orca2011": Orca2011Model,
}
HEADED = frozenset({"farina2017"})  # whose bodies turn to where people want to go, since they walk where they face
