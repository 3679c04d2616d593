from .controllers import SCENARIOS as SCENARIOS
from .controllers import check_controller as check_controller
from .controllers import default_scenes as default_scenes
