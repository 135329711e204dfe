"""Receding horizon: plan, drive a little, and plan again."""

from maneuver_automaton.receding_horizon.candidates import within as within
from maneuver_automaton.receding_horizon.controller import ManeuverHorizon as ManeuverHorizon
from maneuver_automaton.receding_horizon.controller import RecedingHorizon as RecedingHorizon
from maneuver_automaton.receding_horizon.failsafe import FailSafe as FailSafe
from maneuver_automaton.receding_horizon.failsafe import search_fail_safe as search_fail_safe
from maneuver_automaton.receding_horizon.guarantees import Promises as Promises
from maneuver_automaton.receding_horizon.guarantees import promises as promises
from maneuver_automaton.receding_horizon.log import ClosedLoop as ClosedLoop
from maneuver_automaton.receding_horizon.log import Decision as Decision
from maneuver_automaton.receding_horizon.log import Guarantee as Guarantee
from maneuver_automaton.receding_horizon.log import Origin as Origin
from maneuver_automaton.receding_horizon.log import Step as Step
from maneuver_automaton.receding_horizon.log import Violation as Violation
from maneuver_automaton.receding_horizon.simulation import Disturbance as Disturbance
from maneuver_automaton.receding_horizon.simulation import simulate as simulate
from maneuver_automaton.receding_horizon.statistics import Outcome as Outcome
from maneuver_automaton.receding_horizon.statistics import Statistics as Statistics
from maneuver_automaton.receding_horizon.statistics import simulate_many as simulate_many
from maneuver_automaton.receding_horizon.unconstrained import FixedHorizon as FixedHorizon
from maneuver_automaton.receding_horizon.unconstrained import HorizonPlan as HorizonPlan
from maneuver_automaton.receding_horizon.unconstrained import HorizonSearch as HorizonSearch
from maneuver_automaton.receding_horizon.unconstrained import MixedOrderCost as MixedOrderCost
from maneuver_automaton.receding_horizon.unconstrained import UnconstrainedLoop as UnconstrainedLoop
from maneuver_automaton.receding_horizon.unconstrained import (
    UnconstrainedProblem as UnconstrainedProblem,
)
from maneuver_automaton.receding_horizon.unconstrained import search_horizon as search_horizon
from maneuver_automaton.receding_horizon.unconstrained import (
    simulate_unconstrained as simulate_unconstrained,
)
