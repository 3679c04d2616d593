"""Recorded runs in words: a tick, its label, and the whole run."""

from __future__ import annotations

from typing import Any

from ..collect.texts import text
from ..core.labels import LabelSpec
from ..core.scene import Scene
from ..core.snapshot import Contact, Snapshot
from ..record.record import EpisodeRecord
from ..view.annotations import value_text
from .answer import answer_text


def frame_summary(record: EpisodeRecord, snapshot: Snapshot, index: int) -> list[str]:
    """Command, contacts and device events of a tick, one text each.

    Args:
        record: the run.
        snapshot: the state at the tick.
        index: of the tick; T, the final snapshot, has no command.
    """
    texts = []
    if index < len(record) and "robot" not in snapshot.scene.unmeasured:
        vx, vy, omega = (f"{value:+.2f}" for value in record.command[index].tolist())
        key = "player.command_sideways" if record.command[index, 1] else "player.command"
        texts.append(text(key, ahead=vx, left=vy, turn=omega))
    if snapshot.robot.guarded:
        texts.append(text("player.guarded"))
    texts += [_contact_text(contact, snapshot.scene) for contact in snapshot.contacts]
    return texts + [f"{event.device} {event.control} {event.value:g}" for event in snapshot.events]


def frame_label(record: EpisodeRecord, index: int) -> str:
    """The label of a frame as text; empty if it has none."""
    frames = record.document["frames"]
    label = frames[index].get("label") if index < len(frames) else None
    return "" if label is None else _label_text(label, record.label_spec)


def run_summary(record: EpisodeRecord) -> list[tuple[str, str]]:
    """Keys of names (`player.…`) and values that describe the whole run; absent values are left out."""
    outcome, spec = record.outcome, record.label_spec
    ended = text("player.outcome_value", status=outcome.status, reason=outcome.reason, time=f"{outcome.time:.1f}")
    entries = [
        ("file", record.path.name),
        ("scenario", text("player.scenario_value", name=record.family, seed=record.seed, episode=record.episode)),
        ("driven_by", record.controller_info.path),
        ("contributor", record.contributor or ""),
        ("outcome", ended),
        ("question", spec.question),
        ("label", "" if record.label is None else _label_text(record.label, spec)),
        ("context", record.context or ""),
    ]
    return [(name, value) for name, value in entries if value]


def _label_text(label: Any, spec: LabelSpec) -> str:
    """A label as text.

    >>> _label_text({"label": 2}, LabelSpec("classes", classes=("poor", "fair")))
    'label: 2 fair'
    """
    if isinstance(label, dict):
        return ", ".join(f"{name}: {_value_text(v, spec if name == spec.name else None)}" for name, v in label.items())
    return _value_text(label, spec)


def _contact_text(contact: Contact, scene: Scene) -> str:
    """The person or thing that the robot touches, and the side at fault."""
    types = {item.id: item.type for item in scene.furniture}
    name = types.get(contact.id, "object") if contact.kind == "object" else contact.kind
    fault = {(True, False): "robot", (False, True): "other", (True, True): "both"}.get(
        (contact.robot_at_fault, contact.other_at_fault)
    )
    if fault is None:
        return text("player.touches", what=name, number=contact.id)
    return text("player.touches_fault", what=name, number=contact.id, fault=text(f"player.fault_{fault}"))


def _value_text(value: Any, spec: LabelSpec | None) -> str:
    """One value; the answer to a question in its own words."""
    if spec is not None and spec.kind != "command":
        return answer_text(value, spec)
    if isinstance(value, bool):
        return text("question.yes" if value else "question.no")
    return f"{value:.2f}" if isinstance(value, float) else value_text(value)
