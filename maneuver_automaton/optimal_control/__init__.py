"""Optimal control by direct transcription: the one room that imports CasADi, when it is used."""

from __future__ import annotations

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.optimal_control._casadi import load_casadi as load_casadi
    from maneuver_automaton.optimal_control._casadi import why_no_casadi as why_no_casadi
    from maneuver_automaton.optimal_control.maneuvers import ManeuverObjective as ManeuverObjective
    from maneuver_automaton.optimal_control.maneuvers import TransferSettings as TransferSettings
    from maneuver_automaton.optimal_control.maneuvers import solve_transfer as solve_transfer
    from maneuver_automaton.optimal_control.maneuvers import transfer_program as transfer_program
    from maneuver_automaton.optimal_control.polish_values import PolishSettings as PolishSettings
    from maneuver_automaton.optimal_control.polishing import polish as polish
    from maneuver_automaton.optimal_control.problem import Grid as Grid
    from maneuver_automaton.optimal_control.problem import Guess as Guess
    from maneuver_automaton.optimal_control.problem import (
        OptimalControlProblem as OptimalControlProblem,
    )
    from maneuver_automaton.optimal_control.problem import straight_guess as straight_guess
    from maneuver_automaton.optimal_control.separation import BodyPart as BodyPart
    from maneuver_automaton.optimal_control.solution import (
        OptimalControlSolution as OptimalControlSolution,
    )
    from maneuver_automaton.optimal_control.solution import SolveStatus as SolveStatus
    from maneuver_automaton.optimal_control.transcription import SolverSettings as SolverSettings
    from maneuver_automaton.optimal_control.transcription import Transcription as Transcription
    from maneuver_automaton.optimal_control.transcription import solve as solve
    from maneuver_automaton.optimal_control.transcription import transcribe as transcribe
    from maneuver_automaton.optimal_control.uniform_effort import (
        UniformEffortExample as UniformEffortExample,
    )
    from maneuver_automaton.optimal_control.uniform_effort import (
        solve_uniform_effort_example as solve_uniform_effort_example,
    )
    from maneuver_automaton.optimal_control.vehicles import moving_frame as moving_frame

_HOMES = {
    "load_casadi": "_casadi",
    "why_no_casadi": "_casadi",
    "ManeuverObjective": "maneuvers",
    "TransferSettings": "maneuvers",
    "solve_transfer": "maneuvers",
    "transfer_program": "maneuvers",
    "PolishSettings": "polish_values",
    "polish": "polishing",
    "Grid": "problem",
    "Guess": "problem",
    "OptimalControlProblem": "problem",
    "straight_guess": "problem",
    "BodyPart": "separation",
    "OptimalControlSolution": "solution",
    "SolveStatus": "solution",
    "SolverSettings": "transcription",
    "Transcription": "transcription",
    "solve": "transcription",
    "transcribe": "transcription",
    "UniformEffortExample": "uniform_effort",
    "solve_uniform_effort_example": "uniform_effort",
    "moving_frame": "vehicles",
}
__getattr__, __dir__ = lazily(__name__, _HOMES)
