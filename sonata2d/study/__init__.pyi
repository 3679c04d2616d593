from .config import StudyConfig as StudyConfig
from .load import Study as Study, load_study as load_study
from .participant import Participant as Participant
from .report import save_results as save_results

__all__ = ["Participant", "Study", "StudyConfig", "load_study", "save_results"]
