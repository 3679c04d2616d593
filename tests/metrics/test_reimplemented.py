"""Every metric beside a second implementation: plain loops over positions, written from the formulas in the docs."""

from __future__ import annotations

import math
from itertools import pairwise
from statistics import fmean

import numpy as np
import pytest

from sonata2d.core.geometry import Disc
from sonata2d.metrics.catalogue import ALL
from sonata2d.metrics.space import THRESHOLDS, ZONES

from .test_invariance import Run, measured, random_walks, smooth_drive

Vector = tuple[float, float]
R = 0.3  # m, of the robot
# shortest paths: test_shortest_path.py; browsers: test_measurement.py; other robots: test_robots.py; rules of areas:
# test_area_rules.py
NOT_HERE = {
    "shortest_length", "spl", "stl", "round_trip_median", "round_trip_95", "robot_collisions", "robot_clearance_min",
    "makespan", "company", "no_go_time", "speeding_time", "wrong_way_time",
}  # fmt: skip


class Loops:
    """The quantities of a run, up to the goal, from its poses alone."""

    def __init__(self, run: Run) -> None:
        self.run, self.scene, self.dt = run, run.scene, run.scene.rules.dt
        goal = run.scene.goal
        at_goal = [math.dist(p[:2], goal.position) <= goal.distance for p in run.poses[:, 0].tolist()]
        self.success = any(at_goal)
        self.count = at_goal.index(True) + 1 if self.success else len(at_goal)
        self.poses = run.poses[: self.count].tolist()
        self.robot = [(x, y) for (x, y, _), *_ in self.poses]
        self.theta = [state[0][2] for state in self.poses]
        all_poses = run.poses.tolist()
        self.people = range(1, len(all_poses[0]))
        self.velocity = [[self._velocity(all_poses, t, k) for k in range(len(all_poses[0]))] for t in range(self.count)]
        self.time = (self.count - 1) * self.dt
        self.clearance = [[self._clearance(t, k) for k in self.people] for t in range(self.count)]
        self.nearest = [max(0.0, min(row)) for row in self.clearance]
        self.collisions = self._collisions()

    def _velocity(self, poses: list[list[list[float]]], t: int, k: int) -> Vector:
        a, b = poses[max(t, 1) - 1][k], poses[max(t, 1)][k]
        return (b[0] - a[0]) / self.dt, (b[1] - a[1]) / self.dt

    def shoulders(self, t: int, k: int) -> list[Vector]:
        """Points along a person's shoulder line, 0.5 mm apart."""
        x, y, theta = self.poses[t][k]
        half = max(self.scene.humans[k - 1].breadth / 2 - self.scene.humans[k - 1].radius, 0.0)
        steps = max(int(half / 5e-4), 1)
        return [
            (x - math.sin(theta) * half * s / steps, y + math.cos(theta) * half * s / steps)
            for s in range(-steps, steps + 1)
        ]

    def _clearance(self, t: int, k: int) -> float:
        points = np.array(self.shoulders(t, k)) - self.robot[t]
        return float(np.hypot(*points.T).min()) - R - self.scene.humans[k - 1].radius

    def obstacles(self, point: Vector) -> list[tuple[str, int, float, Vector]]:
        """Kind, id, clearance of the robot's outline, and nearest point, of every wall and object."""
        found = []
        for k, wall in enumerate(self.scene.walls):
            near = on_segment(point, wall.start, wall.end)
            found.append(("wall", k, math.dist(point, near) - R, near))
        for piece in self.scene.furniture:
            centre, shape = piece.pose.position, piece.shape
            if isinstance(shape, Disc):
                found.append(("object", piece.id, math.dist(point, centre) - R - shape.radius, centre))
                continue
            c, s = math.cos(piece.pose.theta), math.sin(piece.pose.theta)
            corners = [
                (centre[0] + c * a - s * b, centre[1] + s * a + c * b)
                for a, b in [
                    (i * shape.length / 2, j * shape.width / 2) for i, j in ((1, 1), (-1, 1), (-1, -1), (1, -1))
                ]
            ]
            sides = [on_segment(point, a, b) for a, b in pairwise([*corners, corners[0]])]
            near = min(sides, key=lambda p: math.dist(point, p))
            found.append(("object", piece.id, math.dist(point, near) - R, near))
        return found

    def _collisions(self) -> list[tuple[str, int, int, bool, bool]]:
        """Kind, id, first state, and the faults of robot and other, of each uninterrupted contact."""
        touching: dict[tuple[str, int], dict[int, tuple[bool, bool]]] = {}
        for t, at in enumerate(self.robot):
            vx, vy = self.velocity[t][0]
            for kind, id, gap, (x, y) in self.obstacles(at):
                if gap < 0.01:
                    closing = (vx * (x - at[0]) + vy * (y - at[1])) / math.dist(at, (x, y))
                    touching.setdefault((kind, id), {})[t] = closing > 0.01, False
            for k in self.people:
                if self.clearance[t][k - 1] < 0.01:
                    x, y = min(self.shoulders(t, k), key=lambda p: math.dist(p, at))
                    (wx, wy), distance = self.velocity[t][k], math.dist(at, (x, y))
                    ux, uy = (x - at[0]) / distance, (y - at[1]) / distance
                    faults = vx * ux + vy * uy > 0.01, -(wx * ux + wy * uy) > 0.01
                    touching.setdefault(("human", self.scene.humans[k - 1].id), {})[t] = faults
        for t, rows in self.run.contacts.items():
            for row in rows if t < self.count else ():
                touching.setdefault((row["kind"], row["id"]), {})[t] = row["robot_at_fault"], row["other_at_fault"]
        found = []
        for (kind, id), faults in touching.items():
            for t in sorted(faults):
                if t - 1 not in faults:
                    last = next(e for e in range(t, self.count + 1) if e + 1 not in faults)
                    part = [faults[e] for e in range(t, last + 1)]
                    found.append((kind, id, t, any(a for a, _ in part), any(b for _, b in part)))
        return found


def on_segment(p: Vector, a: Vector, b: Vector) -> Vector:
    """The point of a segment that is nearest to p."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    t = min(max(((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square, 0.0), 1.0) if square else 0.0
    return a[0] + t * dx, a[1] + t * dy


def wrap(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)


def share(states: list[bool]) -> float:
    return sum(states) / len(states)


def disc_time(dx: float, dy: float, vx: float, vy: float, radius: float) -> float:
    """Time until a point that moves with v comes within a radius of (dx, dy): the smaller root."""
    a, b, c = vx * vx + vy * vy, -2.0 * (dx * vx + dy * vy), dx * dx + dy * dy - radius * radius
    if c <= 0.0:
        return 0.0
    if a == 0.0 or b >= 0.0 or b * b - 4.0 * a * c <= 0.0:
        return math.inf
    return (-b - math.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)


def values_of(run: Run) -> dict[str, float | None]:
    """The metrics of success, collisions, paths, clearances and disturbance."""
    e = Loops(run)
    steps = [math.dist(a, b) for a, b in pairwise(e.robot)]
    speeds = [v[0] for v in e.velocity]
    accelerations = [((b[0] - a[0]) / e.dt, (b[1] - a[1]) / e.dt) for a, b in pairwise(speeds)]
    jerks = [math.dist(a, b) / e.dt for a, b in pairwise(accelerations)]
    turns = [abs(wrap(b - a)) for a, b in pairwise(e.theta)]
    still = [step < 0.01 * e.dt and turn < 0.02 * e.dt for step, turn in zip(steps, turns, strict=True)]
    obstacles = [max(min(gap for _, _, gap, _ in e.obstacles(p)), 0.0) for p in e.robot]
    by_kind = {kind: [c for c in e.collisions if c[0] == kind] for kind in ("human", "object", "wall")}
    human = by_kind["human"]
    disturbed = [[math.dist(e.poses[t][k][:2], run.undisturbed[t, k - 1]) for k in e.people] for t in range(e.count)]
    free, walked = run.undisturbed.tolist(), [[pose[:2] for pose in state[1:]] for state in e.poses]
    lost = [
        math.dist(free[t][k], free[t - 1][k]) - math.dist(walked[t][k], walked[t - 1][k])
        for t in range(1, e.count) for k in range(len(e.people))
    ]  # fmt: skip
    walking = [
        math.hypot(*e.velocity[t][k]) / e.scene.humans[k - 1].desired_speed for t in range(e.count) for k in e.people
    ]
    first = min((c[2] for c in e.collisions), default=None)
    times = [
        min(
            disc_time(x - px, y - py, vx - wx, vy - wy, R + e.scene.humans[k - 1].radius)
            for wx, wy in [e.velocity[t][k]] for x, y in e.shoulders(t, k)[::2]
        )
        for t, ((px, py), (vx, vy)) in enumerate(zip(e.robot, speeds, strict=True)) for k in e.people
    ]  # fmt: skip
    return {
        "success": float(e.success), "success_strict": float(e.success and not e.collisions), "timeout": 0.0,
        "collisions": len(e.collisions), **{f"{kind}_collisions": len(found) for kind, found in by_kind.items()},
        "robot_on_person": sum(c[3] for c in human), "person_on_robot": sum(c[4] for c in human),
        "both_on_each_other": sum(c[3] and c[4] for c in human),
        "time_to_first_collision": None if first is None else first * e.dt,
        "time_to_goal": e.time if e.success else None, "stalled_time": sum(still) * e.dt,
        "path_length": sum(steps), "cumulative_heading_change": sum(turns), "speed_mean": sum(steps) / e.time,
        "speed_max": max(math.hypot(*v) for v in speeds),
        "acceleration_mean": fmean(math.hypot(*a) for a in accelerations),
        "acceleration_max": max(math.hypot(*a) for a in accelerations), "jerk_mean": fmean(jerks),
        "jerk_max": max(jerks),
        "human_clearance_min": min(e.nearest), "human_clearance_mean": fmean(e.nearest),
        "obstacle_clearance_min": min(obstacles), "obstacle_clearance_mean": fmean(obstacles),
        **{f"personal_space_compliance_{d:.2f}": share([n >= d for n in e.nearest]) for d in THRESHOLDS},
        **{f"zone_{name}": share([low <= n < high for n in e.nearest]) for name, (low, high) in ZONES.items()},
        "time_to_collision_min": None if min(times) == math.inf else min(times),
        "human_speed_ratio": fmean(walking), "human_deviation_mean": fmean(d for row in disturbed for d in row),
        "human_deviation_max": max(d for row in disturbed for d in row),
        "human_slowing": sum(lost) / (len(lost) * e.dt), **interactions_of(run, e),
    }  # fmt: skip


def interactions_of(run: Run, e: Loops) -> dict[str, float | None]:
    """Intrusion into groups and interactions: of points in the robot's outline, 3 mm apart at its border."""
    border = [(R * math.cos(a), R * math.sin(a)) for a in np.arange(0.0, 2.0 * math.pi, 0.01).tolist()]
    column = {human.id: k + 1 for k, human in enumerate(e.scene.humans)}
    objects = {piece.id: piece.pose.position for piece in e.scene.furniture}

    def place(t: int, id: int) -> Vector:
        return objects[id] if id in objects else (e.poses[t][column[id]][0], e.poses[t][column[id]][1])

    in_group, in_pair, pairs = [], [], 0
    for t, (x, y) in enumerate(e.robot):
        points = [(x, y), *((x + a, y + b) for a, b in border)]
        inside = False
        for group in e.scene.groups:
            near = [place(t, member) for member in group.members]
            edges = [(a, b) for i, a in enumerate(near) for b in near[:i] if math.dist(a, b) <= 3.6]
            inside |= any(math.dist(on_segment((x, y), a, b), (x, y)) < R for a, b in edges)
            if len(near) == 3 and len(edges) == 3:
                inside |= any(in_triangle(p, near) for p in points)
        in_group.append(inside)
        rows = run.interactions.get(t, [])
        pairs += len(rows)
        in_pair.append(any(math.dist(on_segment((x, y), place(t, a), place(t, b)), (x, y)) < R for a, _, b in rows))
    return {"group_intrusion": share(in_group), "interaction_intrusion": share(in_pair) if pairs else None}


def in_triangle(p: Vector, corners: list[Vector]) -> bool:
    sides = [(b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) for a, b in pairwise([*corners, corners[0]])]
    return all(s > 0.0 for s in sides) or all(s < 0.0 for s in sides)


def variants_of(run: Run) -> dict[str, float | None]:
    """The variants of other projects."""
    e, n = Loops(run), Loops(run).count
    distances = [min(math.dist(e.robot[t], e.poses[t][k][:2]) for k in e.people) for t in range(n)]
    near = [max(d - R - 0.3, 0.0) for d in distances]
    goal = e.scene.goal
    to_goal = [math.dist(p, goal.position) for p in e.robot]
    speeds = [math.hypot(*v[0]) for v in e.velocity]
    omega = [wrap_rate(run, max(t, 1)) for t in range(n)]
    body = [(0.0, 0.0)]
    for t in range(1, n):
        (vx, vy), theta = e.velocity[t][0], run.poses[t, 0, 2]
        body.append((vx * math.cos(theta) + vy * math.sin(theta), vy * math.cos(theta) - vx * math.sin(theta)))
    changes = [(0.0, 0.0), *((b[0] - a[0], b[1] - a[1]) for a, b in pairwise(body))]
    jerk = [math.dist(a, b) / e.dt**2 for a, b in pairwise(changes)]
    approaching = [0.0 if t == 0 else 1.0 for t in range(n)]  # velocities are zero in the first state
    times = [
        disc_time(
            e.poses[t][k][0] - e.robot[t][0], e.poses[t][k][1] - e.robot[t][1],
            approaching[t] * (e.velocity[t][0][0] - e.velocity[t][k][0]),
            approaching[t] * (e.velocity[t][0][1] - e.velocity[t][k][1]), math.sqrt(2.0) * R + 0.3,
        )
        for t in range(n) for k in e.people
    ]  # fmt: skip
    (columns,) = [[int(member) for member in group.members] for group in e.scene.groups]
    centres = [
        tuple(
            fmean(e.poses[t][k][i] + 1.5 * (math.cos, math.sin)[i](e.poses[t][k][2]) for k in columns) for i in (0, 1)
        )
        for t in range(n)
    ]
    group = [math.dist(e.robot[t], centres[t]) - R for t in range(n)]
    shortest = min(times)
    zones = [(name, low, high) for name, (low, high) in ZONES.items() if name != "public"]
    return {
        "socnavgym.personal_space_compliance": share([d - R >= 0.45 for d in distances]),
        "socnavgym.minimum_distance_to_human": min(distances),
        "socnavgym.minimum_obstacle_distance": min(gap + R for p in e.robot for _, _, gap, _ in e.obstacles(p)),
        "socnavgym.stalled_time": sum(b == (0.0, 0.0) for b in body[1:]) * e.dt,
        "socnavgym.failure_to_progress": sum(b > a for a, b in pairwise(to_goal)),
        "socnavgym.jerk_avg": fmean(jerk),
        "hunavsim.goal_reached": float(to_goal[-1] - goal.distance < 0.05),
        "hunavsim.robot_on_person_collision": hunav_collisions(e, 1),
        "hunavsim.person_on_robot_collision": hunav_collisions(e, -1),
        "hunavsim.time_not_moving": e.time / n * sum(s < 0.01 and w < 0.02 for s, w in zip(speeds, omega, strict=True)),
        "hunavsim.avg_overacceleration": sum(b - a for a, b in pairwise(speeds)) / e.dt**2 / n,
        **{f"hunavsim.{z}_space_intrusions": 100 * share([a <= d < b for d in e.nearest]) for z, a, b in zones},
        **{
            f"hunavsim.group_{z}_space_intrusions": 100 * share([(a <= d or z == "intimate") and d < b for d in group])
            for z, a, b in zones
        },
        **{
            f"socnav3.social_space_intrusion{z}": share([d < limit for d in near])
            for z, limit in (("A", 0.4), ("B", 0.6), ("C", 0.8))
        },
        "socnav3.hum_collision_flag": share([d == 0.0 for d in near]),
        "socnav3.min_time_to_collision": None if shortest == math.inf else shortest,
        "socnav3.max_fear": 10.0 if shortest <= 0.01 else 1.0 / shortest,
        "socnav3.path_efficiency_ratio": min(1.0, to_goal[0] / sum(math.dist(a, b) for a, b in pairwise(e.robot))),
    }  # fmt: skip


def wrap_rate(run: Run, t: int) -> float:
    """Change of the robot's heading to state t, as the samples record it, rad/s."""
    return float(run.poses[t, 0, 2] - run.poses[t - 1, 0, 2]) / run.scene.rules.dt


def hunav_collisions(e: Loops, sign: int) -> int:
    found = 0
    for t in range(e.count):
        for k in e.people:
            if e.clearance[t][k - 1] < 0.02:
                (x, y), (px, py, heading) = e.robot[t], e.poses[t][k]
                alpha = abs(wrap(math.atan2(y - py, x - px) - heading))
                other = abs(wrap(math.pi / 2.0 - (math.atan2(py - y, px - x) - e.theta[t])))
                equal = math.hypot(*e.velocity[t][0]) == math.hypot(*e.velocity[t][k])
                found += (sign * alpha < sign * other and not equal) or (alpha == other and equal)
    return found


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("make", [random_walks, smooth_drive])
def test_metrics_equal_those_of_plain_loops(make: object, seed: int) -> None:
    run: Run = make(seed)  # type: ignore[operator]
    found, expected = measured(run), values_of(run) | variants_of(run)
    assert found.keys() - expected.keys() <= NOT_HERE | {name for name in ALL if ALL[name].source == "this package"}
    for name, value in expected.items():
        assert found[name] == (None if value is None else pytest.approx(value, rel=1e-3, abs=2e-5)), name
