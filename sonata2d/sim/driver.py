"""The driver of one robot in an episode: its controller and sensors, and what they answer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from typing import Any

from ..agents.controllers.base import Controller, Regenerate, Stop, recorded_path, require_controller
from ..agents.sensors.base import Renderer, Sensor, SensorSuite, definition_of, known_to, shown_to
from ..core.files import interruption
from ..core.geometry import Twist, quantised
from ..core.scene import Scene
from ..core.snapshot import ControllerInfo, Outcome, Snapshot, Status
from ..core.wording import counted, described, shown
from ..errors import ControllerError
from ..registry import did_you_mean


class Driver:
    """Drives one robot.

    Args:
        controller: of the robot; it is reset.
        scene: in the view of the robot.
        info: describes the controller in files.
        renderer: draws the images that the controller requests.

    Attributes:
        controller: of the robot.
        robot_id: of the robot.
        info: describes the controller in files.
        sensors: of the controller.

    Raises:
        ControllerError: the controller requests an image, and no renderer is given, or `partial` is neither True nor
            False.
    """

    def __init__(self, controller: Controller, scene: Scene, info: ControllerInfo, renderer: Renderer | None) -> None:
        if controller.image is not None and renderer is None:
            raise ControllerError(
                f"{type(controller).__name__} requests a camera image; give Episode(renderer=sonata2d.view.image_of)"
            )
        if not isinstance(controller.partial, bool):
            raise ControllerError(
                f"partial of {type(controller).__name__} must be True or False, got {shown(controller.partial)}"
            )
        self.controller, self.robot_id, self.info, self._renderer = controller, scene.robot_id, info, renderer
        self.sensors = SensorSuite(controller.sensors, scene, renderer)
        controller.reset(known_to(controller, scene))

    def answer(self, snapshot: Snapshot) -> tuple[Twist, Any] | Outcome:
        """The command and label for a snapshot, which may be in the view of another robot; or the end of the episode.

        Raises:
            ControllerError: the controller's answer is not a finite twist, or its label has a key that it does not
                declare.
        """
        controller = self.controller
        if snapshot.scene.robots:
            snapshot = snapshot.seen_by(self.robot_id)
        if controller.image is not None and self._renderer is not None:
            snapshot = replace(snapshot, image=self._renderer(snapshot, controller.image))
        if self.sensors:
            snapshot = replace(snapshot, sensors=self.sensors.observe(snapshot))
        answer = controller.act(shown_to(controller, snapshot))
        if isinstance(answer, (Stop, Regenerate)):
            status: Status = "stopped" if isinstance(answer, Stop) else "regenerate"
            return Outcome(status, answer.reason, snapshot.tick, snapshot.time)
        command = checked_twist(answer, type(controller))
        label = controller.label(snapshot, command)
        if label is not None:
            label = deepcopy(label)  # the controller may reuse the object
            self._require_declared(label)
        return command, label

    def look(self, snapshot: Snapshot) -> None:
        """Let the sensors observe a tick in which the controller is not asked: odometry goes on."""
        if self.sensors:
            self.sensors.observe(snapshot.seen_by(self.robot_id))

    def _require_declared(self, label: Any) -> None:
        """Require that a label has only the keys that the controller declares: files explain only these.

        Raises:
            ControllerError: it has another key.
        """
        declared = self.info.labels
        if declared and isinstance(label, Mapping):
            for key in label:
                if key not in declared:
                    hint = did_you_mean(str(key), declared) or f"; they explain {', '.join(declared)}"
                    raise ControllerError(
                        f"label() returned the key {shown(key)}, which the controller's `labels` do not explain{hint}"
                    )


def drivers_of(
    scene: Scene,
    controller: Controller,
    others: Sequence[Controller] | None,
    info: ControllerInfo | None,
    renderer: Renderer | None,
) -> list[Driver]:
    """The drivers of all robots, in the order of `Scene.robot_ids`.

    Args:
        scene: of the episode.
        controller: of the first robot.
        others: controllers of the other robots; None: those that the scene names.
        info: describes the controllers in files; None: as `controller_info_of` does.
        renderer: as of `Driver`; None: `renderer_for` of each other controller.

    Raises:
        ControllerError: a controller that the scene names is neither built in nor a plug-in.
        TypeError: `others` is no sequence.
        ValueError: the number of other controllers is not that of the other robots, or one object would drive several
            robots though its class does not say so.
    """
    names: list[str | None] = [other.controller for other in scene.robots]
    if others is None and names:
        from ..agents.controllers.loading import is_installed, load_controller  # which few episodes need

        for other in scene.robots:
            if not is_installed(other.controller, {}):  # a file may name anything
                raise ControllerError(
                    f"the controller {other.controller!r} of robot {other.id} is neither built in nor a plug-in; give "
                    "the controllers of the other robots: others=[...]"
                )
        others = [load_controller(other.controller) for other in scene.robots]
    else:
        names = [None for _ in names]
    others = others or ()
    if not isinstance(others, Sequence):
        raise TypeError(
            f"others are several controllers, got {shown(others)}; write others=[{type(others).__name__}()]"
        )
    if len(others) != len(names):
        robots = counted(len(names), "other robot")
        raise ValueError(f"the scene has {robots}, got {counted(len(others), 'controller')} for them")
    controllers = [controller, *map(require_controller, others)]
    for k, each in enumerate(controllers):
        if not each.drives_several and any(each is earlier for earlier in controllers[:k]):
            raise ValueError(
                f"one {type(each).__name__} cannot drive several robots; give each robot an object of its own, or set "
                "drives_several = True in a class that tells them apart by snapshot.robot.id"
            )
    infos = [info or controller_info_of(controller), *(info.others if info else ())]
    known = len(infos)
    infos += [controller_info_of(*each) for each in zip(controllers[known:], names[known - 1 :], strict=True)]
    views = [scene.seen_by(id) for id in scene.robot_ids]
    drivers = zip(controllers, views, infos, [renderer, *map(renderer_for, others)], strict=True)
    return [Driver(each, view, its_info, renderer or own) for each, view, its_info, own in drivers]


def _sensors_of(controller: Controller) -> Sequence[Any]:
    """The sensors of a controller; empty for what is no sequence, which `SensorSuite` refuses."""
    return controller.sensors if isinstance(controller.sensors, Sequence) else ()


def renderer_for(controller: Controller) -> Renderer | None:
    """The renderer of the camera images that a controller requests.

    Returns:
        `sonata2d.view.image_of`; None, without importing pygame, if the controller requests no images.
    """
    if controller.image is None and not any(getattr(sensor, "request", None) for sensor in _sensors_of(controller)):
        return None
    from ..view.painter import image_of

    return image_of


_USUAL = 1e4  # m/s, rad/s, beyond which the limits of files are looked at


def checked_twist(answer: object, controller_class: type | None = None) -> Twist:
    """A command as a twist that a file can hold.

    Args:
        answer: of a controller, or given to `Episode.apply`.
        controller_class: class of the controller, for the error messages; None: the command was given to `apply`.

    Raises:
        ControllerError: the answer is not a `Twist`, is not finite, or is too large for a file.
    """
    if type(answer) is Twist:  # the usual case in a third of the time
        vx, vy, omega = answer.vx, answer.vy, answer.omega
        is_small = type(vx) is type(vy) is type(omega) is float and -_USUAL < vx < _USUAL and -_USUAL < vy < _USUAL
        if is_small and -_USUAL < omega < _USUAL:
            return Twist(round(vx * 1e4) / 1e4 + 0.0, round(vy * 1e4) / 1e4 + 0.0, round(omega * 1e4) / 1e4 + 0.0)
    name = f"{controller_class.__name__}.act" if controller_class else ""
    must = f"{name} must return" if name else "the command must be"
    if not isinstance(answer, Twist):
        raise ControllerError(f"{must} a Twist, got {answer!r}; return Twist(vx, vy, omega)")
    vx, vy, omega = answer.vx, answer.vy, answer.omega
    if not (_is_finite(vx) and _is_finite(vy) and _is_finite(omega)):
        raise ControllerError(f"{must} finite numbers, got {answer!r}")
    try:
        return Twist(quantised(float(vx)), quantised(float(vy)), quantised(float(omega)))
    except ValueError as error:
        # part of the recorded reason of an episode that ended in an error: do not reword
        raise ControllerError(f"{name} answered {answer!r}: {error}" if name else f"{must} smaller: {error}") from None


def _is_finite(value: Any) -> bool:
    """Whether a value is a finite number of Python or NumPy."""
    if type(value) is not float and hasattr(value, "item"):
        value = value.item()
    return isinstance(value, (int, float)) and math.isfinite(value)


@interruption.surroundings_kept()
def controller_info_of(controller: Controller, path: str | None = None) -> ControllerInfo:
    """The description of a controller that files record.

    Args:
        controller: the controller.
        path: its name, e.g. on the command line; by default its module and class.

    Raises:
        ControllerError: `settings()` raises an exception, or a value is not of the kind that files hold.
    """
    name = path or recorded_path(type(controller))
    try:
        settings = controller.settings()
    except BaseException as error:
        interruption.reraise(error)
        raise ControllerError(f"settings() of {name} raised {described(error)}") from error
    version, labels = controller.version, controller.labels
    if not isinstance(settings, Mapping):
        raise ControllerError(f"settings() of {name} must return a dict, got {shown(settings)}")
    if version is not None and not isinstance(version, str):
        raise ControllerError(
            f"version of {name} must be text, got {shown(version)}; write version = {shown(str(version))}"
        )
    if not isinstance(labels, Mapping) or not all(isinstance(meaning, str) for meaning in labels.values()):
        raise ControllerError(f"labels of {name} must be a dict of names and their meanings, got {shown(labels)}")
    sensors = _sensors_of(controller)
    recorded = tuple(definition_of(each) for each in sensors if isinstance(each, Sensor) and each.record)
    return ControllerInfo(name, version, dict(settings), dict(labels) or None, recorded)
