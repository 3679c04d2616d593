from .controllers import SCENARIOS as SCENARIOS, check_controller as check_controller, default_scenes as default_scenes
