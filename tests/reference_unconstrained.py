"""Slow, obvious twins: horizons by quadrature, by trying all sequences; the index as a program."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.integrate import quad
from scipy.optimize import linprog

from maneuver_automaton._compile import kernel
from maneuver_automaton.groups import SE2
from maneuver_automaton.receding_horizon import _kernels_unconstrained as kernels
from maneuver_automaton.receding_horizon._kernels_unconstrained import (
    follow,
    interval_cost,
    next_pose,
)
from maneuver_automaton.receding_horizon.unconstrained import search_horizon


def horizon_cost(problem, pose, sequence):
    """Cost of a sequence of trims from a pose of the world, by adaptive quadrature."""
    cost, step = problem.cost, problem.horizon.interval
    here, total = SE2(problem.seen(pose)), 0.0
    for k in sequence:
        trim = problem.automaton.trims[k]

        def rate(t, here=here, trim=trim):
            return float(cost.rates(trim.coast(here, t).pose, trim.control))

        total += quad(rate, 0.0, step, epsabs=1e-13, epsrel=1e-13)[0]
        here = trim.coast(here, step)
    return total


def best_of_all(value, trims, intervals):
    """The sequence of least `value`, and that value, of all there are."""
    words = [np.array(word) for word in itertools.product(range(trims), repeat=intervals)]
    values = [value(word) for word in words]
    best = int(np.argmin(values))
    return words[best], values[best]


def index_by_program(growth, applied):
    """Suboptimality index as the linear program it comes from.

    Least decrease of the value per cost driven, over all stage costs of an optimal plan and all
    values after it that the growth admits.
    Source: Grüne, Pannek, Seehafer, Worthmann (2010), Problem 3.8 in its linear form (4.7).
    """
    n = len(growth)
    rows = []
    for k in range(n):  # the tail of an optimal plan is optimal
        row = np.zeros(n + 1)
        row[k:n] = 1.0
        row[k] -= growth[n - k - 1]
        rows.append(row)
    for j in range(n - applied):  # follow the plan for j steps more, then start afresh
        row = np.zeros(n + 1)
        row[n] = 1.0
        row[applied : applied + j] -= 1.0
        row[applied + j] -= growth[n - j - 1]
        rows.append(row)
    gain = np.append(np.ones(n), -1.0)
    driven = np.append(np.ones(applied), np.zeros(n + 1 - applied))
    solution = linprog(gain, rows, np.zeros(len(rows)), [driven], [1.0], bounds=(0.0, None))
    return solution.fun


class Exhausted(NamedTuple):
    """The cheapest sequence that was met, its cost, and whether no other one is cheaper."""

    trims: np.ndarray
    value: float
    proven: bool


def rolled_out(problem, pose, trims):
    """Cost of a sequence of trims from a pose of the world, as the kernels compute it."""
    sequence = np.array(trims, dtype=np.int64)
    poses, costs = np.empty((sequence.size + 1, 3)), np.empty(sequence.size)
    return kernels.roll_out(problem.tables, problem.seen(pose), sequence, poses, costs)


def exhausted(problem, pose, *, first=None, max_intervals=100_000_000):
    """The cheapest of all sequences from a pose, by `exhaust`; a search gives the first guess."""
    sequence = np.array(search_horizon(problem, pose).trims if first is None else first)
    proven, _ = exhaust(problem.tables, problem.seen(pose), sequence, max_intervals)
    return Exhausted(sequence, rolled_out(problem, pose, sequence), bool(proven))


@kernel
def exhaust(tables, pose, sequence, most):
    """Best of all sequences by depth-first search: whether it is proven, and the intervals tried.

    `sequence` (n,) holds a first guess and then the answer. Costs only add up, so a partial
    sequence that costs as much as the best one is left. After `most` intervals the search gives up.
    """
    n, m = sequence.size, tables.effort.size
    poses, costs = np.empty((n + 1, 3)), np.empty(n)
    best = follow(tables, pose, sequence, poses, costs)
    word, spent, tried = np.zeros(n, np.int64), np.zeros(n + 1), 0
    orders, steps, place = np.empty((n, m), np.int64), np.empty((n, m)), np.zeros(n, np.int64)
    level, fresh = 0, True
    while level >= 0:
        x, y, heading = poses[level]
        if fresh:
            c, s = math.cos(heading), math.sin(heading)
            for trim in range(m):
                steps[level, trim] = interval_cost(tables, trim, x, y, heading, c, s)
            orders[level] = np.argsort(steps[level], kind="mergesort")
            place[level] = 0
            tried += m
            if tried > most:
                return False, tried
        trim = orders[level, place[level]] if place[level] < m else -1
        if trim < 0 or spent[level] + steps[level, trim] >= best:
            level, fresh = level - 1, False  # dearer ones follow in the order
            continue
        place[level] += 1
        word[level] = trim
        spent[level + 1] = spent[level] + steps[level, trim]
        if level == n - 1:
            best = spent[n]
            sequence[:] = word
            fresh = False
            continue
        poses[level + 1] = next_pose(tables, trim, x, y, heading)
        level, fresh = level + 1, True
    return True, tried
