"""The scenario file: YAML to `Problem` and back; files of other formats, with a scenario beside."""

from maneuver_automaton.scenario.fleet import FleetScenario as FleetScenario
from maneuver_automaton.scenario.loading import RoadScenario as RoadScenario
from maneuver_automaton.scenario.loading import load_roads as load_roads
from maneuver_automaton.scenario.loading import load_scenario as load_scenario
from maneuver_automaton.scenario.loading import remarks_on as remarks_on
from maneuver_automaton.scenario.loading import statements_of as statements_of
from maneuver_automaton.scenario.scenario import Scenario as Scenario
from maneuver_automaton.scenario.scenario import scenario_of_text as scenario_of_text
from maneuver_automaton.scenario.writing import json_schema as json_schema
from maneuver_automaton.scenario.writing import to_yaml as to_yaml
