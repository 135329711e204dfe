"""Slow, obvious twins: horizons by quadrature and by trying everything, the index as a program."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.integrate import quad
from scipy.optimize import linprog

from maneuver_automaton.groups import SE2


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
