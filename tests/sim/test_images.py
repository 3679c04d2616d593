"""Camera images are in the snapshots of controllers that request them, and cost nothing for others."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonata2d.agents.controllers.base import Controller
from sonata2d.agents.controllers.reactive import StraightToGoal
from sonata2d.core.devices import ImageRequest
from sonata2d.core.geometry import Twist
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.datasets import generate_dataset, verify
from sonata2d.errors import ControllerError
from sonata2d.scenegen.scenario.config import ScenarioConfig
from sonata2d.sim.episode import Episode
from sonata2d.testing.controllers import check_controller
from sonata2d.view.painter import image_of

CONTROLLER_FILE = """
import sonata2d as s2
from sonata2d.core.devices import ImageRequest


class ImageController(s2.Controller):
    image = ImageRequest(width=64, height=48)

    def act(self, snapshot):
        green = int((snapshot.image[..., 1] > snapshot.image[..., 0]).sum())
        return s2.Twist(vx=0.5, omega=0.0004 * green)

    def label(self, snapshot, twist):
        return {"mean": float(snapshot.image.mean())}
"""


class ImageController(Controller):
    """Collects the images of its snapshots."""

    image = ImageRequest(width=64, height=48)

    def __init__(self) -> None:
        self._images: list[Any] = []

    def act(self, snapshot: Snapshot) -> Twist:
        self._images.append(snapshot.image)
        return Twist(0.5)


def test_every_snapshot_has_a_new_image(busy: Scene) -> None:
    controller = ImageController()
    episode = Episode(busy, controller, renderer=image_of)
    for _ in range(3):
        episode.step()
    assert [image.shape for image in controller._images] == [(48, 64, 3)] * 3
    assert controller._images[0].dtype == np.uint8
    assert not np.array_equal(controller._images[0], controller._images[2])


def test_without_a_renderer_the_error_names_the_remedy(busy: Scene) -> None:
    with pytest.raises(ControllerError, match=r"Episode\(renderer=sonata2d.view.image_of\)"):
        Episode(busy, ImageController())


def test_a_controller_without_a_request_gets_no_image_and_loads_no_pygame(busy: Scene) -> None:
    def fail(snapshot: Snapshot, request: ImageRequest) -> Any:
        raise AssertionError("no image was requested")

    frame = Episode(busy, StraightToGoal(), renderer=fail).step()
    assert frame is not None
    assert frame.snapshot.image is None
    code = (
        "import sys, sonata2d as s2; from sonata2d.sim.driver import renderer_for;"
        "c = s2.StraightToGoal(); s2.Episode(s2.generate(s2.ScenarioConfig(), 1), c, renderer=renderer_for(c)).step();"
        "print('pygame' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_data_sets_of_controllers_with_images_are_generated_and_verified(tmp_path: Path) -> None:
    (tmp_path / "image_controller.py").write_text(CONTROLLER_FILE)
    name = f"{tmp_path / 'image_controller.py'}:ImageController"
    config = ScenarioConfig(humans=2, rules={"time_limit": 2.0})
    generate_dataset(tmp_path / "out", config, name, episodes=2)
    assert verify(tmp_path / "out", replay=True, rerun=True, controller=name) == []


def test_check_controller_provides_images() -> None:
    class Spinning(ImageController):
        def act(self, snapshot: Snapshot) -> Twist:
            assert snapshot.image is not None
            return Twist(0.0, 0.0, float(snapshot.image[0, 0, 0]) / 255.0)

    assert len(check_controller(Spinning(), time_limit=0.5)) == 3
