"""What a page shows: the present step of a participant as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.token import Token

from ..core.labels import LabelSpec
from ..study.config import QuestionConfig, RunsConfig, ScaleConfig, in_language, name_of_entry
from ..study.load import Study
from ..study.participant import Participant
from ..study.plan import Step, shuffled
from ..study.scales import Item, scale_named

Json = dict[str, Any]

# HTML in a text is shown as text. Images would be requests to other servers.
_markdown = MarkdownIt("commonmark", {"html": False}).enable("table").disable("image")


def html_of(text: str) -> str:
    """Markdown as HTML, without scripts, images or HTML of its own; links open another tab."""
    tokens = _markdown.parse(text)
    for token in tokens:
        for child in token.children or ():
            _open_elsewhere(child)
    return str(_markdown.renderer.render(tokens, _markdown.options, {}))


def _open_elsewhere(token: Token) -> None:
    if token.type == "link_open":
        token.attrSet("target", "_blank")
        token.attrSet("rel", "noopener noreferrer")


def step_json(participant: Participant) -> Json:
    """The present step in the participant's language, apart from runs to drive or to rate."""
    step, language = participant.step, participant.language
    content: Json = {"id": step.id, "kind": "declined" if participant.has_declined else step.kind}
    if step.title:
        content["title"] = in_language(step.title, language)
    if step.text:
        content["html"] = html_of(in_language(step.text, language))
    if step.kind == "consent":
        content["statements"] = [html_of(in_language(text, language)) for text in step.statements]
    if step.kind == "questions":
        content["questions"] = [_question_json(entry, participant) for entry in step.entries]
    return content


def _question_json(entry: QuestionConfig | ScaleConfig, participant: Participant) -> Json:
    language, study = participant.language, participant.study
    content: Json = {"name": name_of_entry(entry), "required": entry.required}
    if isinstance(entry, ScaleConfig):
        return content | _scale_json(entry, language, shuffled(entry, study.config.seed, participant.index))
    content |= {"kind": entry.kind, "question": in_language(entry.question, language)}
    if entry.classes is not None:
        content["classes"] = [in_language(name, language) for name in entry.classes]
    if entry.ends is not None:
        content["ends"] = [in_language(end, language) for end in entry.ends]
    if entry.kind == "number":
        content |= {"minimum": entry.minimum, "maximum": entry.maximum}
    if entry.kind == "likert":
        labels = [in_language(label, language) for label in entry.labels] if entry.labels else None
        content |= {"points": entry.points, "labels": labels}
        content["items"] = [_item_json(item, language) for item in entry.items or ()]
    return content


def _item_json(item: Item, language: str) -> Json:
    ends = [in_language(end, language) for end in item.ends] if item.ends else None
    return {"name": item.name, "text": in_language(item.text, language), "ends": ends}


def _scale_json(entry: ScaleConfig, language: str, order: Sequence[str]) -> Json:
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


def label_json(spec: LabelSpec, block: RunsConfig | None, language: str) -> Json | None:
    """The question that a scenario asks about each run; None if it asks nothing."""
    if spec.kind == "command":
        return None
    texts = block.label if block is not None else None
    question = in_language(texts.question, language) if texts and texts.question is not None else spec.question
    classes = texts.classes.get(language, spec.classes) if texts else spec.classes
    ends = texts.ends.get(language, spec.ends) if texts else spec.ends
    return {
        "name": spec.name,
        "kind": spec.kind,
        "when": spec.when,
        "question": question,
        "classes": list(classes),
        "ends": list(ends),
    }


def rating_question(study: Study, step: Step, language: str) -> Json:
    """The question about the runs of a block of ratings."""
    question = study.config.ratings[step.block].question
    content: Json = {"name": question.name, "kind": question.kind, "question": in_language(question.question, language)}
    content["classes"] = [in_language(name, language) for name in question.classes or ()]
    content["ends"] = [in_language(end, language) for end in question.ends or LabelSpec().ends]
    return content


def words_of(study: Study) -> dict[str, dict[str, str]]:
    """The page's own words, by language."""
    sections = ("web", "menu", "readings", "keys", "run", "notice", "question", "rating", "legend", "action", "player")
    return {
        language: {key: text for key, text in table.items() if key.partition(".")[0] in sections}
        for language, table in study.tables.items()
    }
