"""Drives with a policy that LeRobot has trained on a data set of sonata2d.

LEROBOT_POLICY=runs/act/checkpoints/last/pretrained_model \
    sonata2d evaluate --scenario sonata-2020 --controller examples/lerobot/policy.py:LeRobotPolicy
"""

from __future__ import annotations

import os
from typing import Any

import torch
from lerobot.configs.policies import PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors

import sonata2d as s2
from sonata2d.formats.lerobot import IMAGE, Observer
from sonata2d.metrics.words import instruction


class LeRobotPolicy(s2.Controller):
    """Observes what a data set of `sonata2d export --to lerobot` holds."""

    def __init__(self) -> None:
        path = os.environ["LEROBOT_POLICY"]
        config = PreTrainedConfig.from_pretrained(path)
        self._policy = get_policy_class(config.type).from_pretrained(path).eval()
        self._before, self._after = make_pre_post_processors(config, pretrained_path=path)
        self._has_pictures = "observation.images.top" in config.input_features
        if self._has_pictures:
            self.image = IMAGE

    def reset(self, scene: s2.Scene) -> None:
        """Begin an episode."""
        self._policy.reset()
        self._observe, self._task = Observer(scene), instruction(scene).text

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        """The command of the policy."""
        batch: dict[str, Any] = {name: torch.from_numpy(value) for name, value in self._observe(snapshot).items()}
        if self._has_pictures:
            batch["observation.images.top"] = torch.from_numpy(snapshot.image.copy()).permute(2, 0, 1) / 255.0
        with torch.no_grad():
            action = self._after(self._policy.select_action(self._before(batch | {"task": self._task})))
        return s2.Twist(*action.squeeze(0).tolist())
