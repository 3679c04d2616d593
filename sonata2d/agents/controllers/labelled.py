"""`Labelled`: one controller drives, another labels each frame with the command it would have given (DAgger)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from ...core.geometry import Twist
from ...core.scene import Scene
from ...core.snapshot import Snapshot
from ...errors import ControllerError
from ..sensors.base import known_to, shown_to
from .base import Answer, Controller, Regenerate, Stop


class Labelled(Controller):
    """Combines two controllers: the driver's command is executed, the labeller's command becomes the label.

    In this way an expert labels the states that a learner visits (DAgger). After each tick the labeller is given the
    executed command (`Controller.command_overridden`), so its label does not depend on its own earlier commands.
    The label is [vx, vy, omega]. It is [0, 0, 0] where the labeller would have ended the episode, because a robot
    that is no longer driven stands still. On the command line the pair is named `driver+labeller`.

    Args:
        driver: its command is executed.
        labeller: receives every snapshot; its command is recorded and never executed.

    Raises:
        ControllerError: the labeller requests a camera image or has sensors; or, from `act`, it returns something other
            than a finite twist or a request.

    Source: S. Ross, G. Gordon & D. Bagnell, AISTATS 2011.
    """

    def __init__(self, driver: Controller, labeller: Controller) -> None:
        if labeller.image is not None:
            raise ControllerError(
                f"{type(labeller).__name__} requests a camera image, which a labeller does not receive; "
                "use it as the driver, or choose another labeller"
            )
        self.driver, self.labeller = driver, labeller
        if labeller.sensors:
            raise ControllerError(
                f"{type(labeller).__name__} has sensors, which a labeller does not receive; use it as the driver, or "
                "choose another labeller"
            )
        self.sensors = driver.sensors
        self.image, self.deterministic = driver.image, driver.deterministic and labeller.deterministic
        # Recorded in files: do not change the text.
        meaning = (
            f"[vx, vy, omega] that {type(labeller).__name__} would have asked for here; body frame, m/s, m/s, rad/s"
        )
        self.labels = {"twist": meaning}

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Not possible: recorded settings do not contain the classes of the driver and the labeller.

        Raises:
            ControllerError: always; load the pair by its name, `driver+labeller`, instead.
        """
        raise ControllerError(
            "the settings of Labelled(...) do not contain the classes of driver and labeller; "
            "name both, as driver+labeller"
        )

    def settings(self) -> Mapping[str, Any]:
        return {"driver": dict(self.driver.settings()), "labeller": dict(self.labeller.settings())}

    def reset(self, scene: Scene) -> None:
        self.driver.reset(known_to(self.driver, scene))
        self.labeller.reset(known_to(self.labeller, scene))

    def act(self, snapshot: Snapshot) -> Answer:
        answer = self.driver.act(shown_to(self.driver, snapshot))
        self._label = self._label_of(self.labeller.act(shown_to(self.labeller, snapshot)))
        if isinstance(answer, Twist):
            self.labeller.command_overridden(answer)
        return answer

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        return self._label

    def _label_of(self, answer: Answer) -> list[float]:
        """The labeller's answer as [vx, vy, omega] at the precision of files."""
        if isinstance(answer, Stop | Regenerate):
            return [0.0, 0.0, 0.0]
        try:
            twist = answer.rounded()
        except (AttributeError, ValueError, OverflowError):  # not a Twist, or not finite
            name = type(self.labeller).__name__
            raise ControllerError(f"{name}.act must return a Twist of finite numbers, got {answer!r}") from None
        return [twist.vx, twist.vy, twist.omega]
