"""What a page shows: the present step of a participant as JSON."""

from __future__ import annotations

from ..core.labels import LabelSpec
from ..study.content import Json, step_content
from ..study.markdown import html_of
from ..study.participant import Participant


def step_json(participant: Participant) -> Json:
    """The present step in the participant's language with texts in HTML, apart from runs to drive or to rate."""
    content = step_content(participant)
    if "text" in content:
        content["html"] = html_of(content.pop("text"))
    if "statements" in content:
        content["statements"] = [html_of(text) for text in content["statements"]]
    return content


def label_json(spec: LabelSpec) -> Json | None:
    """A question about a run; None if nothing is asked."""
    if spec.kind == "command":
        return None
    texts: Json = {"question": spec.question, "classes": list(spec.classes), "ends": list(spec.ends)}
    return {"name": spec.name, "kind": spec.kind, "when": spec.when} | texts
