"""Outcomes of an episode by its state: goal reached, contact, time limit."""

from __future__ import annotations

from ..core.humans import X, Y
from ..core.snapshot import Contact, Outcome, Snapshot
from ..core.tasks import is_done


def arrivals_at(snapshot: Snapshot) -> list[bool]:
    """Whether each robot is at its goal, in the order of `Scene.robot_ids`."""
    robots = (snapshot.robot, *snapshot.robots)
    reached = [goal.is_reached(robot.pose) for (_, goal), robot in zip(snapshot.scene.tasks, robots, strict=True)]
    return reached if snapshot.goal.is_plain else [is_done(snapshot), *reached[1:]]


def outcome_at(snapshot: Snapshot) -> Outcome | None:
    """The outcome if an episode of one robot ends at a snapshot: goal reached, contact if the rules say so, or time.

    Returns:
        None if the episode continues.
    """
    scene, row = snapshot.scene, snapshot.state.row
    goal, rules = scene.goal, scene.rules
    if not goal.is_plain and "goal" in rules.ends_on and is_done(snapshot):
        return Outcome("goal", f"the robot has done its task: {goal.task}", snapshot.tick, snapshot.time)
    # The exact test needs the robot's heading, which takes longer to find than most ticks need for all of this.
    reach = goal.distance + 1e-6
    is_near = abs(goal.x - row.item(X)) <= reach and abs(goal.y - row.item(Y)) <= reach
    if is_near and goal.is_plain and "goal" in rules.ends_on and goal.is_reached(snapshot.robot.pose):
        return Outcome("goal", f"within {goal.distance} m of the goal", snapshot.tick, snapshot.time)
    if "contact" in rules.ends_on and snapshot.contacts:
        return Outcome("contact", _described(snapshot.contacts[0]), snapshot.tick, snapshot.time)
    if snapshot.tick >= rules.last_tick:
        return Outcome("timeout", f"{snapshot.time} s are over", snapshot.tick, snapshot.time)
    return None


def outcome_of_several(snapshot: Snapshot, have_arrived: bool) -> Outcome | None:
    """`outcome_at` of a scene with several robots, which have all arrived or not."""
    scene, rules = snapshot.scene, snapshot.scene.rules
    if "goal" in rules.ends_on and have_arrived:
        count = len(scene.robot_ids)
        return Outcome("goal", f"all {count} robots have reached their goals", snapshot.tick, snapshot.time)
    if "contact" in rules.ends_on:
        for id, contacts in zip(scene.robot_ids, (snapshot.contacts, *snapshot.contacts_of_robots), strict=True):
            if contacts:
                reason = f"robot {id}: {_described(contacts[0])}"
                return Outcome("contact", reason, snapshot.tick, snapshot.time)
    if snapshot.tick >= rules.last_tick:
        return Outcome("timeout", f"{snapshot.time} s are over", snapshot.tick, snapshot.time)
    return None


def _described(contact: Contact) -> str:
    fault = _FAULTS[contact.robot_at_fault, contact.other_at_fault]
    return f"contact with {contact.kind} {contact.id}, at fault: {fault}"


# By fault of the robot and of the other side. Recorded in files.
_FAULTS = {(True, False): "the robot", (False, True): "the other", (True, True): "both", (False, False): "nobody"}
