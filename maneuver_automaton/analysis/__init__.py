"""The paper's checks, for any model and for a user's own functions."""

from maneuver_automaton.analysis.coverage import CoverageSettings as CoverageSettings
from maneuver_automaton.analysis.coverage import Dispersion as Dispersion
from maneuver_automaton.analysis.coverage import Reached as Reached
from maneuver_automaton.analysis.coverage import ReachSettings as ReachSettings
from maneuver_automaton.analysis.coverage import StretchFactor as StretchFactor
from maneuver_automaton.analysis.coverage import dispersion as dispersion
from maneuver_automaton.analysis.coverage import reached as reached
from maneuver_automaton.analysis.coverage import settings_for as settings_for
from maneuver_automaton.analysis.coverage import stretch_factor as stretch_factor
from maneuver_automaton.analysis.examine import Region as Region
from maneuver_automaton.analysis.examine import SymmetryReport as SymmetryReport
from maneuver_automaton.analysis.feasible import FeasibleSet as FeasibleSet
from maneuver_automaton.analysis.feasible import feasible_set as feasible_set
from maneuver_automaton.analysis.feasible import least_times as least_times
from maneuver_automaton.analysis.growth import GrowthBound as GrowthBound
from maneuver_automaton.analysis.growth import growth_bound as growth_bound
from maneuver_automaton.analysis.growth import ring_poses as ring_poses
from maneuver_automaton.analysis.growth import unit_cost as unit_cost
from maneuver_automaton.analysis.library_conditions import LibraryReport as LibraryReport
from maneuver_automaton.analysis.library_conditions import check_library as check_library
from maneuver_automaton.analysis.shift import ControlProblem as ControlProblem
from maneuver_automaton.analysis.shift import QuadraticCost as QuadraticCost
from maneuver_automaton.analysis.shift import (
    shifted_boundary_condition as shifted_boundary_condition,
)
from maneuver_automaton.analysis.shift import shifted_cost as shifted_cost
from maneuver_automaton.analysis.shift import shifted_function as shifted_function
from maneuver_automaton.analysis.shift import shifted_problem as shifted_problem
from maneuver_automaton.analysis.stability import CertifiedHorizon as CertifiedHorizon
from maneuver_automaton.analysis.stability import ClosedLoopCheck as ClosedLoopCheck
from maneuver_automaton.analysis.stability import certified_horizon as certified_horizon
from maneuver_automaton.analysis.stability import check_closed_loop as check_closed_loop
from maneuver_automaton.analysis.symmetry import Equivalence as Equivalence
from maneuver_automaton.analysis.symmetry import (
    check_boundary_condition as check_boundary_condition,
)
from maneuver_automaton.analysis.symmetry import check_constraint as check_constraint
from maneuver_automaton.analysis.symmetry import check_flow as check_flow
from maneuver_automaton.analysis.symmetry import check_stage_cost as check_stage_cost
from maneuver_automaton.analysis.symmetry import check_vector_field as check_vector_field
from maneuver_automaton.analysis.symmetry import same_motion_primitive as same_motion_primitive
from maneuver_automaton.analysis.turnpike import Turnpike as Turnpike
from maneuver_automaton.analysis.turnpike import TurnpikeCase as TurnpikeCase
from maneuver_automaton.analysis.turnpike import turnpike as turnpike
from maneuver_automaton.refinement.retiming import EffortReport as EffortReport
from maneuver_automaton.refinement.retiming import Retiming as Retiming
from maneuver_automaton.refinement.retiming import effort_report as effort_report
from maneuver_automaton.refinement.retiming import effort_threshold as effort_threshold
from maneuver_automaton.refinement.retiming import retime as retime
from maneuver_automaton.refinement.shooting import least_effort as least_effort
