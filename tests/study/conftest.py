"""A small study, and a participant who drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

import sonata2d as s2
from sonata2d.core.devices import NETWORK_DEVICE, ROUND_TRIP, DeviceEvent
from sonata2d.study.folder import StudyFolder
from sonata2d.study.load import load_study
from sonata2d.study.participant import Participant

STUDY = """\
title: Passing people
pages:
  - {title: Welcome, text: "**Thank you** for coming."}
consent: {title: Consent, text: Your runs are stored., statements: [I am 18 or older., I take part freely.]}
demographics:
  - {name: age, kind: number, question: Your age, minimum: 18, maximum: 120}
  - {name: remark, kind: text, question: Anything else, required: false}
practice: {scenario: empty, runs: 1, text: Try it first.}
runs:
  - {scenario: room.yaml, runs: 2}
after_run:
  - {name: effort, kind: classes, classes: 5, question: How hard was it}
  - {name: driver, kind: text, question: Your name, personal: true, required: false}
ratings:
  - {name: polite, folder: recorded, count: 3, question: {name: polite, kind: yes_no, question: Was it polite}}
end:
  - {scale: rosas, subscales: [warmth]}
minimum_length: 0.5
seed: 3
"""
ROOM = """\
extends: empty
label: {kind: slider, question: How well did you drive}
"""
NOW = datetime(2026, 3, 4, 5, 6, 7, tzinfo=UTC)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four recorded runs."""
    folder = tmp_path_factory.mktemp("recorded") / "runs"
    s2.generate_dataset(folder, "empty", "straight-to-goal", episodes=4, workers=1)
    return folder


@pytest.fixture
def study_file(tmp_path: Path, recorded: Path) -> Path:
    (tmp_path / "room.yaml").write_text(ROOM)
    (tmp_path / "recorded").symlink_to(recorded)
    path = tmp_path / "study.yaml"
    path.write_text(STUDY)
    return path


@pytest.fixture
def arrive(study_file: Path, tmp_path: Path) -> Iterator[Callable[..., Participant]]:
    """Starts the program again, and returns a participant."""
    arrived: list[Participant] = []

    def arrive(id: str = "p1") -> Participant:
        arrived.append(Participant(StudyFolder(tmp_path / "out", load_study(study_file)), id, now=lambda: NOW))
        return arrived[-1]

    yield arrive
    for participant in arrived:
        participant.close()


def drive(participant: Participant, ticks: int = 8, round_trip: float = 0.05) -> None:
    """Drive ahead for a while, and end the run."""
    session = participant.session
    assert session is not None
    for k in range(ticks):
        first = (DeviceEvent("keyboard", "w", 1.0),) if k == 0 else ()
        session.tick((*first, DeviceEvent(NETWORK_DEVICE, ROUND_TRIP, round_trip)))
    session.stop()


def prepare(participant: Participant) -> None:
    """Go on to the first run that counts."""
    participant.read("page-1")
    participant.consent("consent", [True, True])
    participant.answer("demographics", {"age": 30, "remark": "left-handed"})
    participant.read("practice-text")
    drive(participant)
    participant.finish_practice()


def rate_all(participant: Participant) -> int:
    """Rate all runs of a block; returns their number."""
    step, count = participant.step.id, 0
    while participant.step.id == step:
        participant.rate(True, seconds=1.0, whole=True)
        count += 1
    return count


def take_part(participant: Participant) -> None:
    """Do all steps up to the questions at the end."""
    prepare(participant)
    for number in (1, 2):
        drive(participant)
        participant.keep(0.5)
        participant.answer(f"after-run-{number}", {"effort": 1})
    rate_all(participant)


WARMTH = dict.fromkeys(("happy", "feeling", "social", "organic", "compassionate", "emotional"), 4)
