"""Gymnasium environments. Importing this module registers their ids.

>>> import gymnasium, sonata2d.gym
>>> gymnasium.make("sonata2d/SocialNav-v0", scenario="lively").action_space
Box(-1.0, 1.0, (3,), float32)
"""

from importlib.util import find_spec

import lazy_loader

if find_spec("gymnasium") is None:
    raise ModuleNotFoundError("sonata2d.gym needs Gymnasium; pip install 'sonata2d[gym]'", name="gymnasium")

from .registration import register_environments  # only with Gymnasium

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

register_environments()
