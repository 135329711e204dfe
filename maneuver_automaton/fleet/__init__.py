"""Several vehicles: plans that keep apart, found one after another and improved in groups."""

from __future__ import annotations

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.fleet.agreement import Message as Message
    from maneuver_automaton.fleet.asking import Workers as Workers
    from maneuver_automaton.fleet.driven import DrivenVerdict as DrivenVerdict
    from maneuver_automaton.fleet.driven import verify_driven as verify_driven
    from maneuver_automaton.fleet.horizon import FleetHorizon as FleetHorizon
    from maneuver_automaton.fleet.log import FleetGuarantee as FleetGuarantee
    from maneuver_automaton.fleet.log import FleetLog as FleetLog
    from maneuver_automaton.fleet.log import FleetStep as FleetStep
    from maneuver_automaton.fleet.log import FleetViolation as FleetViolation
    from maneuver_automaton.fleet.log import Swap as Swap
    from maneuver_automaton.fleet.on_dask import DaskWorkers as DaskWorkers
    from maneuver_automaton.fleet.planning import plan_fleet as plan_fleet
    from maneuver_automaton.fleet.problem import FleetProblem as FleetProblem
    from maneuver_automaton.fleet.result import Closest as Closest
    from maneuver_automaton.fleet.result import FleetResult as FleetResult
    from maneuver_automaton.fleet.result import FleetStatus as FleetStatus
    from maneuver_automaton.fleet.simulation import simulate_fleet as simulate_fleet
    from maneuver_automaton.fleet.verify import FleetVerdict as FleetVerdict
    from maneuver_automaton.fleet.verify import verify_fleet as verify_fleet

_HOMES = {
    "Message": "agreement",
    "Workers": "asking",
    "DrivenVerdict": "driven",
    "verify_driven": "driven",
    "FleetHorizon": "horizon",
    "FleetGuarantee": "log",
    "FleetLog": "log",
    "FleetStep": "log",
    "FleetViolation": "log",
    "Swap": "log",
    "DaskWorkers": "on_dask",
    "plan_fleet": "planning",
    "FleetProblem": "problem",
    "Closest": "result",
    "FleetResult": "result",
    "FleetStatus": "result",
    "simulate_fleet": "simulation",
    "FleetVerdict": "verify",
    "verify_fleet": "verify",
}
__getattr__, __dir__ = lazily(__name__, _HOMES)
