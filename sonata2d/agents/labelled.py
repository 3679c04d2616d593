"""One drives, another tells what it would have done: labels for data-set aggregation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import ControllerError
from ..frame import Snapshot
from ..geometry import Twist
from ..scene import Scene
from .controller import Answer, Controller


class Labelled(Controller):
    """One controller drives; the label of each frame is the twist that another would have asked for there.

    So an expert labels what a learner meets (DAgger: S. Ross, G. Gordon & D. Bagnell, AISTATS 2011). The label is
    [vx, vy, omega], or null where the other would have ended the episode. By name: `driver+labeller`.

    Args:
        driver: drives.
        labeller: is shown every snapshot, and drives nothing.

    Raises:
        ControllerError: the labeller asks for a camera image.
    """

    def __init__(self, driver: Controller, labeller: Controller) -> None:
        if labeller.image is not None:
            raise ControllerError(f"{type(labeller).__name__} asks for a camera image; as a labeller it gets none")
        self._driver, self._labeller = driver, labeller
        self.image = driver.image
        told = f"[vx, vy, omega] that {type(labeller).__name__} would have asked for here; body frame, m/s, m/s, rad/s"
        self.labels = {"twist": told}

    @property
    def deterministic(self) -> bool:  # type: ignore[override]
        """Whether both claim it."""
        return self._driver.deterministic and self._labeller.deterministic

    def settings(self) -> Mapping[str, Any]:
        return {"driver": dict(self._driver.settings()), "labeller": dict(self._labeller.settings())}

    def reset(self, scene: Scene) -> None:
        self._driver.reset(scene)
        self._labeller.reset(scene)

    def act(self, snapshot: Snapshot) -> Answer:
        answer, wanted = self._driver.act(snapshot), self._labeller.act(snapshot)
        self._wanted = wanted.rounded() if isinstance(wanted, Twist) else None
        return answer

    def label(self, snapshot: Snapshot, twist: Twist) -> Any:
        wanted = self._wanted
        return None if wanted is None else [wanted.vx, wanted.vy, wanted.omega]
