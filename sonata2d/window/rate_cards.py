"""What a rater reads before the first run, at a rest, and after the last one: titles and lines."""

from __future__ import annotations

from ..collect.rating import RatingSession

_KEYS = {
    "yes_no": "Y, N: answer",
    "classes": "1, 2, …: answer",
    "slider": "Left, Right: answer (with Shift: finely)",
    "text": "type the answer",
}
_MOST_NAMES = 5  # of files that were left out

Card = tuple[str, list[str]]


def start_card(session: RatingSession) -> Card:
    """What is asked, how much is left, and by which keys."""
    spec, total = session.spec, session.total
    with_control = "      (while typing: with Ctrl)" if spec.kind == "text" else ""
    return "Rating runs", [
        spec.question or f"{spec.name}?",
        "",
        f"{total - session.done} of {total} runs are left for {session.rater}.",
        "Watch each run to its end; then the answer opens.",
        f"{_KEYS[spec.kind]}      Enter: save, next run",
        f"Space: pause      R: see again      V: camera      + -: speed{with_control}",
        "You can stop at any time with Esc, and go on later where you stopped.",
        "",
        "Space: begin",
    ]


def break_card(session: RatingSession) -> Card:
    """A rest is due."""
    return "Time for a rest", [
        f"{session.done} of {session.total} runs are rated.",
        "Look out of the window for a while.",
        "",
        "Space: go on      Esc: stop for now",
    ]


def end_card(session: RatingSession) -> Card:
    """All is done: where the ratings are, and what could not be shown."""
    left_out = [f"Left out, since it cannot be read: {name}" for name in session.skipped[:_MOST_NAMES]]
    more = len(session.skipped) - len(left_out)
    return "Thank you!", [
        f"All {session.total} runs are rated."
        if session.done == session.total
        else f"{session.done} of {session.total} are rated; the rest would be repeats too soon.",
        f"The ratings are in {session.path}",
        *left_out,
        *([f"and {more} more"] if more > 0 else []),
        "",
        "Enter: close",
    ]
