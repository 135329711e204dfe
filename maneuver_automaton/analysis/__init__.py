"""The paper's checks, for any model and for a user's own functions."""

from maneuver_automaton.analysis.invariance import (
    check_boundary_condition as check_boundary_condition,
)
from maneuver_automaton.analysis.invariance import check_constraint as check_constraint
from maneuver_automaton.analysis.invariance import check_stage_cost as check_stage_cost
from maneuver_automaton.analysis.library_conditions import LibraryReport as LibraryReport
from maneuver_automaton.analysis.library_conditions import check_library as check_library
from maneuver_automaton.analysis.library_conditions import turn_move_turn as turn_move_turn
from maneuver_automaton.analysis.motion_primitives import Equivalence as Equivalence
from maneuver_automaton.analysis.motion_primitives import (
    same_motion_primitive as same_motion_primitive,
)
from maneuver_automaton.analysis.region import Region as Region
from maneuver_automaton.analysis.report import SymmetryReport as SymmetryReport
from maneuver_automaton.analysis.shift import ControlProblem as ControlProblem
from maneuver_automaton.analysis.shift import QuadraticCost as QuadraticCost
from maneuver_automaton.analysis.shift import (
    shifted_boundary_condition as shifted_boundary_condition,
)
from maneuver_automaton.analysis.shift import shifted_cost as shifted_cost
from maneuver_automaton.analysis.shift import shifted_function as shifted_function
from maneuver_automaton.analysis.shift import shifted_problem as shifted_problem
from maneuver_automaton.analysis.symmetry import check_flow as check_flow
from maneuver_automaton.analysis.symmetry import check_vector_field as check_vector_field
from maneuver_automaton.analysis.unit_cost import unit_cost as unit_cost
