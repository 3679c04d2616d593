from .config import StudyConfig as StudyConfig
from .export import export_study as export_study
from .load import Study as Study, load_study as load_study
from .participant import Participant as Participant
from .questions import Question as Question
from .removal import remove_participant as remove_participant
from .report import save_results as save_results

__all__ = [
    "Participant",
    "Question",
    "Study",
    "StudyConfig",
    "export_study",
    "load_study",
    "remove_participant",
    "save_results",
]
