"""One drives, another tells what it would have done: labels for data-set aggregation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from ...core.geometry import Twist
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...errors import ControllerError
from .base import Answer, Controller, Regenerate, Stop


class Labelled(Controller):
    """One controller drives; the label of each frame is the twist that another would have asked for there.

    The labeller is given the executed command (`Controller.command_overridden`), so that its label is what it would do
    at that moment, whatever it asked for before. So an expert labels what a learner meets (DAgger: S. Ross, G. Gordon &
    D. Bagnell, AISTATS 2011). The label is [vx, vy, omega]; [0, 0, 0] where the other would have ended the episode,
    since what is driven no more stands still. By name: `driver+labeller`.

    Args:
        driver: drives.
        labeller: is shown every snapshot, and drives nothing.

    Raises:
        ControllerError: the labeller asks for a camera image, or answers what is no finite twist.
    """

    def __init__(self, driver: Controller, labeller: Controller) -> None:
        if labeller.image is not None:
            raise ControllerError(f"{type(labeller).__name__} asks for a camera image; as a labeller it gets none")
        self._driver, self._labeller = driver, labeller
        self.image, self.deterministic = driver.image, driver.deterministic and labeller.deterministic
        told = f"[vx, vy, omega] that {type(labeller).__name__} would have asked for here; body frame, m/s, m/s, rad/s"
        self.labels = {"twist": told}

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Refuse: what a file tells of it does not say whose settings these are.

        Raises:
            ControllerError: always; by a name, `driver+labeller`, it can be had again.
        """
        raise ControllerError("a file made by Labelled(...) does not say who drove; name both as driver+labeller")

    def settings(self) -> Mapping[str, Any]:
        return {"driver": dict(self._driver.settings()), "labeller": dict(self._labeller.settings())}

    def reset(self, scene: Scene) -> None:
        self._driver.reset(scene)
        self._labeller.reset(scene)

    def act(self, snapshot: Snapshot) -> Answer:
        answer, wanted = self._driver.act(snapshot), self._labeller.act(snapshot)
        self._wanted = self._label_of(wanted)
        if isinstance(answer, Twist):
            self._labeller.command_overridden(answer)
        return answer

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        return self._wanted

    def _label_of(self, answer: Answer) -> list[float]:
        if isinstance(answer, Stop | Regenerate):
            return [0.0, 0.0, 0.0]
        try:
            twist = answer.rounded()
        except (AttributeError, ValueError, OverflowError):
            name = type(self._labeller).__name__
            raise ControllerError(f"{name}.act must return a Twist of finite numbers, got {answer!r}") from None
        return [twist.vx, twist.vy, twist.omega]
