"""Lane changes by the automaton against one direct optimal control problem from a plain guess.

A single-track car at 20 m/s changes to the lane 3.5 m to the left within 70 m; a hovercraft at
1.5 m/s goes 1 m to the side within 6 m, and from rest to rest 4 m ahead and 1.5 m aside. All at
least cost in time, from a trim to a trim, by the libraries that come with the package.

    python -m benchmarks.lane_changes [seconds of planning]
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np

from maneuver_automaton.automaton.library import load_stock_library
from maneuver_automaton.budget import Budget
from maneuver_automaton.optimal_control import OptimalControlProblem, TimeGrid, moving_frame, solve
from maneuver_automaton.planning import plan
from maneuver_automaton.planning.checking import check_plan
from maneuver_automaton.planning.plan import prepare
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.refinement.improve import WordSchedule, words_of
from maneuver_automaton.search.lattice_pass import plan_of_word
from maneuver_automaton.search.lattice_query import lattice_query

NODES = 61
CASES = (
    ("single-track, 20 m/s", "single_track", [70.0, 3.5, 0.0], "speed 20, turn_rate 0"),
    ("hovercraft, 1.5 m/s", "hovercraft", [6.0, 1.0, 0.0], "speed 1.5, turn_rate 0"),
    ("hovercraft, at rest", "hovercraft", [4.0, 1.5, 0.0], "speed 0, turn_rate 0"),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Row:
    """One lane change: costs [s], and what they took [s]."""

    first: float
    first_s: float
    word: float
    word_s: float
    plan: float
    plan_s: float
    direct: float
    direct_s: float
    direct_status: str
    passed: bool


def lane_problem(library: str, goal: list[float], trim: str) -> Problem:
    """From the origin in a trim to a pose in the same trim, in least time."""
    automaton = load_stock_library(library)
    return Problem(automaton, np.zeros(3), Goal(pose=goal, trim=trim), start_trim=trim)


def direct_solution(problem: Problem):
    """The same ends as one optimal control problem of 60 intervals, from a straight guess."""
    model, goal = problem.automaton.model, problem.goals[0]
    first, last = problem.first_trim, problem.last_trim(goal)
    free = np.tile([-np.inf, np.inf], (3, 1))
    asked = OptimalControlProblem(
        state_names=(*model.group.coordinates, *model.reduced_names),
        control_names=model.control_names,
        dynamics=moving_frame(model.group, velocity=model.velocity, reduced=model.dynamics),
        start=(*problem.start, *first.reduced_state),
        end=(*goal.pose, *last.reduced_state),
        duration=(0.1, 60.0),
        stage_cost=lambda x, u: 1.0,
        state_limits=np.concatenate([free, model.reduced_limits]),
        control_limits=model.control_limits,
    )
    return solve(asked, TimeGrid(n_nodes=NODES, rule="rk4"))


def measured(problem: Problem, seconds: float) -> Row:
    """Words alone, the planner with all it has, and the direct solution."""
    prepare(problem)
    began = time.perf_counter()
    query = lattice_query(problem, (0,))
    first = word = None
    first_s = word_s = np.nan
    for word in words_of(query, budget=Budget.from_now(seconds), schedule=WordSchedule()):
        word_s = time.perf_counter() - began
        if first is None:
            first, first_s = word, word_s
    assert first is not None
    assert word is not None
    checked = check_plan(problem, plan_of_word(query, word), problem.goals[0])
    result = plan(problem, time_limit=seconds)
    reached = [when for when, cost in result.improvements if cost == result.cost]
    began = time.perf_counter()
    direct = direct_solution(problem)
    return Row(
        first=first.cost,
        first_s=first_s,
        word=word.cost,
        word_s=word_s,
        plan=result.cost,
        plan_s=reached[0],
        direct=direct.cost,
        direct_s=time.perf_counter() - began,
        direct_status=direct.status.value,
        passed=checked.passed and result.audit is not None and result.audit.passed,
    )


def main(seconds: float) -> None:
    """Print a table: cost over the direct one's, and how long each took."""
    print(f"{'':22} first word        best word         plan (polished)   direct")
    for name, library, goal, trim in CASES:
        row = measured(lane_problem(library, goal, trim), seconds)
        cells = [
            f"{cost:6.3f} {100 * (cost / row.direct - 1):+5.1f}% {took:5.2f}s"
            for cost, took in (
                (row.first, row.first_s), (row.word, row.word_s), (row.plan, row.plan_s),
            )
        ]  # fmt: skip
        print(
            f"{name:22} {'  '.join(cells)}  {row.direct:6.3f} {row.direct_s:5.2f}s "
            f"({row.direct_status}); audits {'passed' if row.passed else 'FAILED'}; "
            f"time of the best word over the direct one's {row.word_s / row.direct_s:.2f}"
        )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0)
