from .controllers import SCENARIOS as SCENARIOS, check_controller as check_controller, default_scenes as default_scenes
from .standard_tests import (
    STANDARD_TESTS as STANDARD_TESTS,
    Finding as Finding,
    run_standard_tests as run_standard_tests,
)
