"""Names and scales of the features of both kinds of graph, and the columns of the table of static nodes."""

from __future__ import annotations

from ...record.layout import ROW_HEAD
from .graph import NODE_TYPES

# Columns of the table of static nodes: the columns of pedestrians in files, then size, radius (0 for rectangles and
# walls), and unit vector of the direction.
LENGTH, WIDTH, RADIUS, AXIS_X, AXIS_Y, COLUMNS = range(ROW_HEAD + 1, ROW_HEAD + 7)

# Of a modern graph, in SI units.
MODERN_FEATURES = (
    *(f"is_{kind}" if kind != "room" else "is_robot" for kind in NODE_TYPES),
    "age", "x", "y", "cos", "sin", "vx", "vy", "omega", "head_cos", "head_sin", "length", "width",
    "near_x", "near_y", "gap",
)  # fmt: skip
# Inputs of a network from a modern graph: the features up to the width, and derived ones.
INPUTS = (
    *MODERN_FEATURES[: MODERN_FEATURES.index("near_x")],
    "near_x", "near_y", "to_x", "to_y", "distance", "gap", "close", "near",
    "goal_x", "goal_y", "goal_distance", "own_vx", "own_vy", "own_omega",
)  # fmt: skip
POSITION_SCALE = 5.0  # m, divides positions and distances
CLOSE, NEAR = 0.5, 2.0  # m, decay lengths of the gaps
LARGEST_DISTANCE = 10.0  # m, gaps and the goal's distance are clipped to it

# Of a graph of the paper; each type of node has its own features, and zeros in the others.
_DIRECTION = ("orientation_sin", "orientation_cos")
_MOVING = ("x_pos", "y_pos", "a_vel", "x_vel", "y_vel", *_DIRECTION)
_HUMAN = ("hum_x_pos", "hum_y_pos", "human_a_vel", "human_x_vel", "human_y_vel", "hum_orientation_sin",
          "hum_orientation_cos", "hum_dist", "hum_inv_dist")  # fmt: skip
_OBJECT = tuple(f"obj_{name}" for name in (*_MOVING, "x_size", "y_size", "dist", "inv_dist"))
_ROOM = ("room_humans", "room_humans2")
_WALL = tuple(f"wall_{name}" for name in ("x_pos", "y_pos", *_DIRECTION, "dist", "inv_dist"))
_GOAL = ("goal_x_pos", "goal_y_pos", "goal_dist", "goal_inv_dist")
_INSTANT, _TIME = ("is_t_0", "is_t_m1", "is_t_m2"), ("is_first_frame", "time_left")  # of all nodes
FEATURES = (*NODE_TYPES, *_INSTANT, *_TIME, *_HUMAN, *_OBJECT, *_ROOM, *_WALL, *_GOAL)

INSTANTS = len(_INSTANT)
SCALE = 10.0  # m, m/tick, rad/tick: divides positions and velocities
CROWD = 15.0  # pedestrians: divides their number
