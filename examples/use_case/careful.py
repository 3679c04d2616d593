"""An expert that keeps more distance from walls and furniture, as a margin for the errors of the learner."""

from __future__ import annotations

from sonata2d import SocialPlanner


class Careful(SocialPlanner):
    """`social-planner` with a cost of small clearances; the stock one passes obstacles at 2 cm if that is shorter."""

    obstacle_price = 2.0  # per second at contact, falling linearly to 0 at the distance; a metre of path costs 1
    obstacle_distance = 0.15  # m
