"""Optimal control by direct transcription: the one room that imports CasADi, when it is used."""

from __future__ import annotations

from typing import TYPE_CHECKING

from maneuver_automaton._lazy import lazily

if TYPE_CHECKING:
    from maneuver_automaton.optimal_control.ipopt import SolverSettings as SolverSettings
    from maneuver_automaton.optimal_control.ipopt import SolveStatus as SolveStatus
    from maneuver_automaton.optimal_control.ipopt import load_casadi as load_casadi
    from maneuver_automaton.optimal_control.ipopt import why_no_casadi as why_no_casadi
    from maneuver_automaton.optimal_control.maneuvers import ManeuverObjective as ManeuverObjective
    from maneuver_automaton.optimal_control.maneuvers import TransferSettings as TransferSettings
    from maneuver_automaton.optimal_control.maneuvers import solve_transfer as solve_transfer
    from maneuver_automaton.optimal_control.maneuvers import transfer_program as transfer_program
    from maneuver_automaton.optimal_control.polishing import polish as polish
    from maneuver_automaton.optimal_control.problem import Grid as Grid
    from maneuver_automaton.optimal_control.problem import Guess as Guess
    from maneuver_automaton.optimal_control.problem import (
        OptimalControlProblem as OptimalControlProblem,
    )
    from maneuver_automaton.optimal_control.problem import moving_frame as moving_frame
    from maneuver_automaton.optimal_control.problem import straight_guess as straight_guess
    from maneuver_automaton.optimal_control.scene import BodyPart as BodyPart
    from maneuver_automaton.optimal_control.scene import PolishSettings as PolishSettings
    from maneuver_automaton.optimal_control.transcription import (
        OptimalControlSolution as OptimalControlSolution,
    )
    from maneuver_automaton.optimal_control.transcription import Transcription as Transcription
    from maneuver_automaton.optimal_control.transcription import solve as solve
    from maneuver_automaton.optimal_control.transcription import transcribe as transcribe
    from maneuver_automaton.optimal_control.uniform_effort import (
        UniformEffortExample as UniformEffortExample,
    )
    from maneuver_automaton.optimal_control.uniform_effort import (
        solve_uniform_effort_example as solve_uniform_effort_example,
    )

_HOMES = {
    "load_casadi": "ipopt",
    "why_no_casadi": "ipopt",
    "ManeuverObjective": "maneuvers",
    "TransferSettings": "maneuvers",
    "solve_transfer": "maneuvers",
    "transfer_program": "maneuvers",
    "PolishSettings": "scene",
    "polish": "polishing",
    "Grid": "problem",
    "Guess": "problem",
    "OptimalControlProblem": "problem",
    "straight_guess": "problem",
    "BodyPart": "scene",
    "OptimalControlSolution": "transcription",
    "SolveStatus": "ipopt",
    "SolverSettings": "ipopt",
    "Transcription": "transcription",
    "solve": "transcription",
    "transcribe": "transcription",
    "UniformEffortExample": "uniform_effort",
    "solve_uniform_effort_example": "uniform_effort",
    "moving_frame": "problem",
}
__getattr__, __dir__ = lazily(__name__, _HOMES)
