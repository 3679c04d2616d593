"""`chat`: lines of JSON with messages about an episode, as vision and language models are trained on.

Each line has `id`, `messages` (a user's question about a moment, or about the episode, and the assistant's answer) and
`meta` (kind of the question, tick, ids, value). The first line asks for a description of the episode. With pictures,
the content of a question has an image part, a PNG in a data URL: of the moment, or of the end with all paths.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import orjson

from ...errors import UnsuitableEpisode
from ...metrics.words import instruction, path_words, situation, story
from ...record.record import EpisodeRecord
from ..format import Format, Options, require_robot
from .questions import ask
from .recompute import recompute

NAME = "chat"
QUESTIONS = 20  # of an episode, by default, the description included
_SYSTEM = "You are watching a robot that drives among people in a room, seen from above."
_PICTURE = 480  # px, longer side


def export(record: EpisodeRecord, options: Options) -> bytes:
    """Return the lines of an episode.

    Raises:
        UnsuitableEpisode: the episode has no recorded robot, or no frame, or an answer is not the same when it is
            computed again by other code.
    """
    require_robot(record, NAME)
    if not len(record):
        raise UnsuitableEpisode(record.path, "the episode has no frame to ask about", "leave out such episodes")
    count = QUESTIONS if options.questions is None else options.questions
    task, told = instruction(record.scene()), " ".join(story(record))
    episode = f"At the start: {situation(record.snapshot(0))} {path_words(record)}"
    asked = f"Task of the robot: {task.text} {episode} Describe what happens."
    lines = [_line(record, 0, asked, told, {
        "kind": "description", "instruction": task.text, "slots": task.slots
    }, None, options)] if count else []  # fmt: skip
    for k, question in enumerate(ask(record, count - 1) if count > 1 else [], 1):
        again = recompute(record.document, question.kind, question.tick, question.ids, question.value)
        if again != question.answer:
            raise UnsuitableEpisode(
                record.path,
                f"the answer to {question.text!r} is {question.answer!r}, but {again!r} when it is computed again",
                "report this as an error of sonata2d",
            )
        meta = {"kind": question.kind, "tick": question.tick, "ids": question.ids, "value": question.value}
        context = episode if question.tick is None else situation(record.snapshot(question.tick))
        text = f"{context} {question.text}"
        lines.append(_line(record, k, text, question.answer, meta, question.tick, options))
    return b"".join(orjson.dumps(line) + b"\n" for line in lines)


def _line(
    record: EpisodeRecord, number: int, text: str, answer: str, meta: dict[str, Any], tick: int | None, options: Options
) -> dict[str, Any]:
    content: Any = text
    if options.pictures:
        content = [{"type": "image_url", "image_url": {"url": _picture(record, tick)}}, {"type": "text", "text": text}]
    messages = [{"role": "system", "content": _SYSTEM}, {"role": "user", "content": content}]
    return {
        "id": f"{record.id}-{number}", "messages": [*messages, {"role": "assistant", "content": answer}],
        "meta": meta,
    }  # fmt: skip


def _picture(record: EpisodeRecord, tick: int | None) -> str:
    """The scene at a tick, or at the end with all paths, as a data URL of a PNG with the ids of people and objects."""
    from ...view.layers import Layers
    from ...view.stills import Still
    from ...view.trails import Trails

    snapshot = record.snapshot(len(record) - 1 if tick is None else tick)
    trails = Trails.of(record.snapshots()) if tick is None else None
    width, height = np.ptp(snapshot.scene.outline, axis=0).tolist()
    longer = max(width, height)
    size = (round(_PICTURE * width / longer), round(_PICTURE * height / longer))
    layers = Layers(ids=True, caption=False, grid=False)
    content = Still(snapshot, size=size, layers=layers, trails=trails).pixels().content()
    return f"data:image/png;base64,{base64.b64encode(content).decode('ascii')}"


FORMAT = Format(
    "questions and answers in the chat form of language models",
    ".jsonl",
    export=export,
    options=frozenset({"questions", "pictures"}),
)
