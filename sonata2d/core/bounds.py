"""Types of numbers with bounds. Code that runs does not check them; readers of files and of settings do."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt

from .files.limits import MAX_COUNT, MAX_ID, MAX_SUBSTEPS

MAX_MAGNITUDE = 1e11  # beyond it a double no longer resolves the precision of files

ADDITIVE = {"additive": True}  # metadata of fields that files hold only where they differ from the default

Number = Annotated[float, Ge(-MAX_MAGNITUDE), Le(MAX_MAGNITUDE)]
Positive = Annotated[float, Gt(0), Le(MAX_MAGNITUDE)]
NotNegative = Annotated[float, Ge(0), Le(MAX_MAGNITUDE)]
Fraction = Annotated[float, Ge(0), Le(1)]
OpeningTime = Annotated[float, Ge(0.1), Le(60)]  # s
Opening = Annotated[float, Ge(-1), Le(1)]  # of a door
Count = Annotated[int, Ge(0), Lt(1 << 63)]  # the length of a list that a computer can hold
Id = Annotated[int, Ge(-MAX_ID), Le(MAX_ID)]
Steps = Annotated[int, Ge(1), Le(MAX_SUBSTEPS)]
Capacity = Annotated[int, Ge(1), Le(MAX_COUNT)]
