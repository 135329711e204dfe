"""Optimal control by direct transcription: the one room that imports CasADi, when it is used."""

from maneuver_automaton.optimal_control.ipopt import SolverSettings as SolverSettings
from maneuver_automaton.optimal_control.ipopt import SolveStatus as SolveStatus
from maneuver_automaton.optimal_control.ipopt import load_casadi as load_casadi
from maneuver_automaton.optimal_control.ipopt import why_no_casadi as why_no_casadi
from maneuver_automaton.optimal_control.problem import Guess as Guess
from maneuver_automaton.optimal_control.problem import (
    OptimalControlProblem as OptimalControlProblem,
)
from maneuver_automaton.optimal_control.problem import TimeGrid as TimeGrid
from maneuver_automaton.optimal_control.problem import moving_frame as moving_frame
from maneuver_automaton.optimal_control.transcription import (
    OptimalControlSolution as OptimalControlSolution,
)
from maneuver_automaton.optimal_control.transcription import solve as solve
from maneuver_automaton.optimal_control.transcription import transcribe as transcribe
from maneuver_automaton.optimal_control.uniform_effort import (
    UniformEffortExample as UniformEffortExample,
)
from maneuver_automaton.optimal_control.uniform_effort import (
    solve_uniform_effort_example as solve_uniform_effort_example,
)
