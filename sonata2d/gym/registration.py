"""The ids of the environments."""

from __future__ import annotations

import gymnasium

from ..scenegen.scenario.load import preset_names


def _id_of(preset: str) -> str:
    """The id of the environment of a preset.

    >>> _id_of("narrow-doorway")
    'sonata2d/NarrowDoorway-v0'
    """
    return f"sonata2d/{''.join(word.capitalize() for word in preset.split('-'))}-v0"


ENVIRONMENT_IDS = {"sonata2d/SocialNav-v0": "sonata-2020"} | {_id_of(preset): preset for preset in preset_names()}
"""The preset of each id. `sonata2d/SocialNav-v0` takes any scenario."""


def register_environments() -> None:
    """Register the ids with Gymnasium; done when `sonata2d.gym` is imported."""
    for name, preset in ENVIRONMENT_IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="sonata2d.gym.env:SocialNavEnv",
                vector_entry_point="sonata2d.gym.vector:SocialNavVectorEnv",
                kwargs={"scenario": preset},
            )
