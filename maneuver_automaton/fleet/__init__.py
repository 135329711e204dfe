"""Several vehicles: plans that keep apart, found one after another and improved in groups."""

from __future__ import annotations

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.fleet.agreement import Message as Message
    from maneuver_automaton.fleet.driven import DrivenVerdict as DrivenVerdict
    from maneuver_automaton.fleet.driven import verify_driven as verify_driven
    from maneuver_automaton.fleet.horizon import FleetHorizon as FleetHorizon
    from maneuver_automaton.fleet.planning import plan_fleet as plan_fleet
    from maneuver_automaton.fleet.problem import FleetProblem as FleetProblem
    from maneuver_automaton.fleet.result import Closest as Closest
    from maneuver_automaton.fleet.result import FleetGuarantee as FleetGuarantee
    from maneuver_automaton.fleet.result import FleetLog as FleetLog
    from maneuver_automaton.fleet.result import FleetResult as FleetResult
    from maneuver_automaton.fleet.result import FleetStatus as FleetStatus
    from maneuver_automaton.fleet.result import FleetStep as FleetStep
    from maneuver_automaton.fleet.result import FleetViolation as FleetViolation
    from maneuver_automaton.fleet.result import Swap as Swap
    from maneuver_automaton.fleet.simulation import simulate_fleet as simulate_fleet
    from maneuver_automaton.fleet.verdict import FleetVerdict as FleetVerdict
    from maneuver_automaton.fleet.verdict import verify_fleet as verify_fleet
    from maneuver_automaton.fleet.workers import DaskWorkers as DaskWorkers
    from maneuver_automaton.fleet.workers import Workers as Workers

__getattr__, __dir__ = lazily(__name__)
