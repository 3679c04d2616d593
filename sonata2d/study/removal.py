"""Removal of a participant who withdraws from a study."""

from __future__ import annotations

from pathlib import Path

from ..collect.collection import Collection
from ..collect.rating import path_for
from ..core.files.whole_file import delete_for_good
from ..datasets.manifest import METRICS
from ..errors import ConfigError
from ..record.files import safe_stem
from .export import unfinished_exports
from .folder import ANSWERS, PERSONAL, RATED, STUDY, locked, read_state, write_state
from .links import Links


def remove_participant(out: str | Path, id: str) -> list[Path]:
    """Delete the runs, ratings and answers of a participant, and the link.

    The id stays in the list of participants, because the orders of the others follow from it. Stored metrics are
    deleted, because they name the runs; `sonata2d evaluate` computes them again. Earlier exports are not changed.

    Args:
        out: folder of the study.
        id: of the participant.

    Returns:
        The paths of the deleted files.

    Raises:
        ConfigError: the study has no such participant.
        RecordError: the folder is not the folder of a study, another program uses it, or a file cannot be deleted.
    """
    out = Path(out)
    state = read_state(out)
    known = [other for other in state["participants"] if other not in state["withdrawn"]]
    if id not in known:
        raise ConfigError(f"the study has no participant {id!r}; it has {', '.join(known) or 'none'}")
    with locked(out):
        collection = Collection(out, id, {})
        try:
            paths = collection.forget()
        finally:
            collection.close()
        blocks = sorted(path for path in (out / RATED).glob("*") if path.is_dir())
        others = [path_for(block, id) for block in blocks]
        others += [out / STUDY / name / f"{safe_stem(id)}.jsonl" for name in (ANSWERS, PERSONAL)]
        others += [collection.journal.with_suffix(".lock"), out / METRICS, *unfinished_exports(out)]
        present = [path for path in others if path.exists()]
        delete_for_good(present, {path.parent for path in others})  # before the state says that they are gone
        paths += present
        Links(out / STUDY).remove(id)
        state = read_state(out)
        write_state(out, state | {"withdrawn": [*state["withdrawn"], id]})
    return paths
