"""Labels that are twists have an image: sideways and turning change sign."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonata2d.datasets.mirror import mirrored
from sonata2d.datasets.mirror_image import twist_image
from sonata2d.errors import RecordError
from sonata2d.record.canonical import plain
from sonata2d.record.record import EpisodeRecord


@pytest.mark.parametrize("twist", [[0.5, 0.1, -0.3], [0.0, 0.0, 0.0], [1, 0, -2], [-0.25, 0.0001, 0.0]])
def test_an_image_of_a_twist_is_its_own_inverse(twist: list[float]) -> None:
    assert twist_image(twist) == [twist[0], -twist[1], -twist[2]]
    assert repr(twist_image(twist_image(twist))) == repr(twist)
    assert plain(twist_image(twist), "label") == twist_image(twist)


@pytest.mark.parametrize(
    "label", [None, True, 0.5, "left", [0.1, 0.2], [0.1, 0.2, None], [0.1, 0.2, True], {"vx": 1.0}]
)
def test_what_is_no_twist_is_refused(label: object) -> None:
    with pytest.raises(RecordError, match=r"is no twist \[vx, vy, omega\]; mirror with labels that stay"):
        twist_image(label)


def test_an_episode_of_other_labels_is_told_so(odd: EpisodeRecord, tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="is no twist"):
        mirrored(odd, label=twist_image)
