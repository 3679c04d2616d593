from .floor_plans import RoomKind as RoomKind
from .generator import generate as generate
from .maps.api import MapScenario as MapScenario, scenario_from_map as scenario_from_map
from .scenario.config import ScenarioConfig as ScenarioConfig
from .scenario.load import load_scenario as load_scenario, scenario_names as scenario_names
