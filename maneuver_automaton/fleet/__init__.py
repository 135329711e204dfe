"""Several vehicles: plans that keep apart, found one after another and improved in groups."""

from maneuver_automaton.fleet.planning import plan_fleet as plan_fleet
from maneuver_automaton.fleet.problem import FleetProblem as FleetProblem
from maneuver_automaton.fleet.result import Closest as Closest
from maneuver_automaton.fleet.result import FleetResult as FleetResult
from maneuver_automaton.fleet.result import FleetStatus as FleetStatus
from maneuver_automaton.fleet.verify import FleetVerdict as FleetVerdict
from maneuver_automaton.fleet.verify import verify_fleet as verify_fleet
