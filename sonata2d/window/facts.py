"""What a recorded run tells, in words: of a frame in a line, of the whole run in a few."""

from __future__ import annotations

from typing import Any

from ..core.devices import DeviceEvent
from ..core.labels import LabelSpec
from ..core.scene import Scene
from ..core.snapshot import Contact, Snapshot
from ..record.record import EpisodeRecord


def frame_facts(record: EpisodeRecord, snapshot: Snapshot, index: int) -> list[str]:
    """What was done and what happened at a look: command, touches, what a person did to a device."""
    facts = []
    if index < len(record):
        vx, vy, omega = record.command[index].tolist()
        sideways = f", {vy:+.2f} m/s left" if vy else ""
        facts.append(f"command {vx:+.2f} m/s ahead{sideways}, {omega:+.2f} rad/s")
    if snapshot.robot.guarded:
        facts.append("the guard stepped in")
    facts += [contact_text(contact, snapshot.scene) for contact in snapshot.contacts]
    return facts + [event_text(event) for event in snapshot.events]


def frame_label(record: EpisodeRecord, index: int) -> str:
    """The label of a frame in words; empty where there is none."""
    frames = record.document["frames"]
    label = frames[index].get("label") if index < len(frames) else None
    return "" if label is None else label_text(label, record.label_spec)


def run_facts(record: EpisodeRecord) -> list[tuple[str, str]]:
    """What is true of the whole run: names and values; nothing that the file does not tell."""
    outcome, spec = record.outcome, record.label_spec
    facts = [
        ("file", record.path.name),
        ("scenario", f"{record.family}, seed {record.seed}, episode {record.episode}"),
        ("driven by", record.author.path),
        ("contributor", record.contributor or ""),
        ("outcome", f"{outcome.status}: {outcome.reason} ({outcome.time:.1f} s)"),
        ("question", spec.question),
        ("label", "" if record.label is None else label_text(record.label, spec)),
        ("context", record.context or ""),
    ]
    return [(name, value) for name, value in facts if value]


def label_text(label: Any, spec: LabelSpec) -> str:
    """A label in words.

    >>> label_text({"label": 2}, LabelSpec("classes", classes=("poor", "fair")))
    'label: 2 fair'
    """
    if isinstance(label, dict):
        return ", ".join(f"{name}: {_value_text(v, spec if name == spec.name else None)}" for name, v in label.items())
    return _value_text(label, spec)


def contact_text(contact: Contact, scene: Scene) -> str:
    """Whom or what the robot touches, and who moved into whom."""
    types = {thing.id: thing.type for thing in scene.furniture}
    what = types.get(contact.id, "object") if contact.kind == "object" else contact.kind
    fault = {(True, False): ", robot at fault", (False, True): ", other at fault", (True, True): ", both at fault"}
    return f"touches {what} {contact.id}{fault.get((contact.robot_at_fault, contact.other_at_fault), '')}"


def event_text(event: DeviceEvent) -> str:
    """Which control got which value."""
    return f"{event.device} {event.control} {event.value:g}"


def _value_text(value: Any, spec: LabelSpec | None) -> str:
    """One value; of a class or a slider as the person chose it."""
    if spec is not None and spec.kind != "command":
        return spec.in_words(value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.2f}" if isinstance(value, float) else str(value)
