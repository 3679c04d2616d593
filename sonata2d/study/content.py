"""What a participant sees: the present step in their language, for the window and for a browser."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ..core.labels import LabelSpec
from .config import QuestionConfig, RunsConfig, ScaleConfig, in_language, name_of_entry
from .plan import PRACTICE_TEXT, shuffled
from .progress import Progress
from .scales import Item, scale_named

Json = dict[str, Any]


def step_content(participant: Progress) -> Json:
    """The present step in the participant's language; texts are Markdown; runs are not part of it."""
    step, language = participant.step, participant.language
    content: Json = {"id": step.id, "kind": "declined" if participant.has_declined else step.kind}
    if step.title:
        content["title"] = in_language(step.title, language)
    elif step.id == PRACTICE_TEXT:
        content["title"] = participant.study.tables[language]["web.practice"]
    if step.text:
        content["text"] = in_language(step.text, language)
    if step.kind == "consent":
        content["statements"] = [in_language(text, language) for text in step.statements]
    if step.kind == "questions":
        content["questions"] = [_question(entry, participant) for entry in step.entries]
    return content


def shown_label(spec: LabelSpec, block: RunsConfig | None, language: str) -> LabelSpec:
    """The question that a scenario asks about each run, in a language."""
    if block is None:
        return spec
    texts = block.label
    question = spec.question if texts.question is None else in_language(texts.question, language)
    classes, ends = texts.classes.get(language, spec.classes), texts.ends.get(language, spec.ends)
    return replace(spec, question=question, classes=tuple(classes), ends=ends)


def _question(entry: QuestionConfig | ScaleConfig, participant: Progress) -> Json:
    language, study = participant.language, participant.study
    content: Json = {"name": name_of_entry(entry), "required": entry.required}
    if isinstance(entry, ScaleConfig):
        return content | _scale(entry, language, shuffled(entry, study.config.seed, participant.index))
    content |= {"kind": entry.kind, "question": in_language(entry.question, language)}
    if entry.classes is not None:
        content["classes"] = [in_language(name, language) for name in entry.classes]
    if entry.ends is not None:
        content["ends"] = [in_language(end, language) for end in entry.ends]
    if entry.kind == "number":
        content |= {"minimum": entry.minimum, "maximum": entry.maximum, "integer": entry.integer}
    if entry.kind == "likert":
        labels = [in_language(label, language) for label in entry.labels] if entry.labels else None
        content |= {"points": entry.points, "labels": labels}
        content["items"] = [_item(item, language) for item in entry.items or ()]
    return content


def _item(item: Item, language: str) -> Json:
    ends = [in_language(end, language) for end in item.ends] if item.ends else None
    return {"name": item.name, "text": in_language(item.text, language), "ends": ends}


def _scale(entry: ScaleConfig, language: str, order: Sequence[str]) -> Json:
    """A published questionnaire as a table, translated as far as the study does."""
    scale, texts = scale_named(entry.scale), entry.texts.get(language, {})
    ends = [str(texts.get(key, end)) for key, end in zip(("first", "last"), scale.ends or (), strict=False)]
    by_name = {item.name: item for item in scale.items}
    items = []
    for name in order:
        translated, item = texts.get(name), by_name[name]
        pair = list(translated) if isinstance(translated, tuple) else list(item.ends) if item.ends else None
        items.append({"name": name, "text": translated if isinstance(translated, str) else item.text, "ends": pair})
    question = texts.get("question", scale.question)
    table: Json = {"kind": "likert", "question": question, "points": scale.points, "labels": None, "items": items}
    return table | ({"ends": ends} if ends else {})
