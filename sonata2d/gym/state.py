"""States of the environment as plain data."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from ..core.wording import shown
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.problems import problem_of
from ..version import PHYSICS_VERSION

_STATE_FORMAT: Literal["sonata2d-env-state"] = "sonata2d-env-state"
_STATE_VERSION: Literal[1] = 1
MAX_SEED = 2**63 - 1  # the largest that files hold
_Seed = Annotated[int, Field(ge=0, le=MAX_SEED)]


class EnvState(BaseModel):
    """Result of `SocialNavEnv.get_state`: the seed and the commands that lead to the state.

    Attributes:
        format, version: of this data.
        physics: `sonata2d.PHYSICS_VERSION`, with which the commands lead to the state.
        settings: of the scenario.
        seed, episode: of the scene.
        commands: forward (m/s), left (m/s) and turn (rad/s) of each tick so far.
        is_over: whether the episode has ended.
        np_random: state of the random generator of the environment, JSON: its integers have 128 bits, which some
            libraries cannot write as numbers.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal["sonata2d-env-state"] = _STATE_FORMAT
    version: Literal[1] = _STATE_VERSION
    physics: int = PHYSICS_VERSION
    settings: dict[str, Any]
    seed: _Seed
    episode: _Seed
    commands: list[tuple[FiniteFloat, FiniteFloat, FiniteFloat]]
    is_over: bool
    np_random: str


def checked_state(state: Mapping[str, Any], config: ScenarioConfig) -> EnvState:
    """Validate a state for a scenario.

    Raises:
        ValueError: it is not a state of this version, or belongs to another scenario.
    """
    content = state if isinstance(state, Mapping) else {}
    if content.get("format") != _STATE_FORMAT or content.get("version") != _STATE_VERSION:
        got = f"{content.get('format')!r}, version {content.get('version')!r}" if content else shown(state)
        raise ValueError(f"a state has the format {_STATE_FORMAT!r}, version {_STATE_VERSION}; got {got}")
    try:
        checked = EnvState.model_validate(dict(content))
        np.random.PCG64().state = json.loads(checked.np_random)
    except ValidationError as error:
        problem = problem_of(dict(content), error)[1]
        raise ValueError(f"the state is damaged: {problem}; use one of get_state()") from None
    except (KeyError, OverflowError, RecursionError, TypeError, ValueError) as error:
        raise ValueError(f"the state is damaged: np_random: {error!r}; use one of get_state()") from None
    if checked.physics != PHYSICS_VERSION:
        raise ValueError(
            f"the state has physics version {checked.physics}, this sonata2d has version {PHYSICS_VERSION}: the "
            "commands would lead to another state"
        )
    if checked.settings != config.settings():
        raise ValueError("the state belongs to another scenario, or to other settings of it")
    return checked
