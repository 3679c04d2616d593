"""The side to which people lean, so that no two stand face to face for ever."""

from __future__ import annotations

import numpy as np

from ...exact import Array

LEAN = 0.003  # of the way ahead: 3 mm a metre


def leaning(direction: Array, side: int) -> Array:
    """Ways that lean a little to the side of the rules.

    Laws that know no side leave two who meet head-on face to face. Their papers add chance or begin unevenly; here
    chance has no part in forces, so that a mirrored scene is a mirrored motion.

    Args:
        direction: (M, 2), unit vectors, or zero, which stays zero.
        side: +1 leans to the right, -1 to the left.

    Returns:
        (M, 2), of length 1 within 5e-6.

    Source: ours.
    """
    x, y = direction[:, 0], direction[:, 1]
    return np.stack((x + side * LEAN * y, y - side * LEAN * x), axis=1)
