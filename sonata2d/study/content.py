"""The content of a participant's page: the present step in their language, as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import quote

from ..core.labels import LabelSpec
from .config import LabelTexts
from .markdown import html_of
from .plan import PRACTICE_CHECK, PRACTICE_TEXT, order_key
from .progress import Progress
from .questions import Entry
from .texts import Json, in_language


def step_content(participant: Progress) -> Json:
    """The present step with texts in HTML; runs to drive and to rate are not part of it."""
    step, language, pictures = participant.step, participant.language, participant.study.pictures
    content: Json = {"id": step.id, "kind": "declined" if participant.has_declined else step.kind}
    if step.title:
        content["title"] = in_language(step.title, language)
    elif step.id in (PRACTICE_TEXT, PRACTICE_CHECK):
        content["title"] = participant.study.tables[language]["web.practice"]
    if step.text:
        content["html"] = html_of(in_language(step.text, language), pictures)
    recruitment = participant.study.config.recruitment
    ways = {} if recruitment is None else {
        "thanks": recruitment.complete, "declined": recruitment.declined,
        "screened": recruitment.full if participant.is_full else recruitment.screened_out,
    }  # fmt: skip
    if (target := ways.get(content["kind"])) is not None:
        content["leave"] = way_back(target, participant.external)
    if participant.is_full:
        content["isFull"] = True
    if step.kind == "consent":
        content["statements"] = [html_of(in_language(text, language), pictures) for text in step.statements]
    if step.kind == "questions":
        content["questions"] = [question_content(entry, participant) for entry in step.entries]
    return content


def way_back(target: str, ids: Mapping[str, str]) -> Json:
    """The way back to a panel: an address with the ids filled in, or a code.

    >>> way_back("https://panel.example/done?id={PID}", {"PID": "a b"})
    {'address': 'https://panel.example/done?id=a%20b'}
    """
    if not target.startswith(("https://", "http://")):
        return {"code": target}
    for name, value in ids.items():
        target = target.replace(f"{{{name}}}", quote(value, safe=""))
    return {"address": target}


def question_content(entry: Entry, participant: Progress) -> Json:
    """A question in the participant's language; shuffled rows are in the participant's order."""
    content = entry.content(participant.language)
    if content.get("shuffle"):
        seed, index = participant.study.config.seed, participant.index
        content["items"].sort(key=lambda item: order_key(seed, "items", index, item["name"]))
    return content


def label_content(spec: LabelSpec, texts: LabelTexts, language: str) -> Json | None:
    """The question that a scenario asks about a run, in a language; None if it asks nothing.

    Args:
        spec: the question of the scenario.
        texts: its translations.
        language: of the participant; the scenario's own texts are used where a translation is missing.
    """
    if spec.kind == "command":
        return None
    question = spec.question if texts.question is None else in_language(texts.question, language)
    classes, ends = texts.classes.get(language, spec.classes), texts.ends.get(language, spec.ends)
    content: Json = {"name": spec.name, "renderer": spec.kind, "when": spec.when}
    return content | {"question": question, "classes": classes, "ends": ends}
