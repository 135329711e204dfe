"""The best coasting times of a fixed word: a primal-dual interior-point Newton method.

Minimise ``rates . times`` subject to ``end = goal``, linear conditions, and ``times >= 0``, with
exact second derivatives (Nocedal, Wright, Numerical Optimization, 2nd ed., Sec. 19.3).
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel, kernel, shared_kernel
from maneuver_automaton.words._kernels_times import (
    TimesProblem,
    assign,
    columns_of,
    jacobian,
    lagrangian_hessian,
    least_squares,
    multipliers,
    newton_feasible,
    newton_stationary,
    residual,
)

SOLVED, FEASIBLE, FAILED = 0, 1, 2
STALLED = 10  # steps in a row of next to no length, after which no more are tried


@inner_kernel
def merit(rates: Array, times: Array, barrier: float, gap: Array, weight: float) -> float:
    """Cost with a logarithmic barrier and an exact penalty."""
    value = 0.0
    for i in range(times.size):
        value += rates[i] * times[i] - barrier * math.log(times[i])
    for e in range(gap.size):
        value += weight * abs(gap[e])
    return value


@inner_kernel
def correct(problem: TimesProblem, times: Array, gap: Array, columns: Array) -> float:
    """What times after a full step violate, brought nearer to the goal; inf if one vanishes."""
    # The conditions are curved, so that a step along their tangent misses them, and the merit may
    # rise however near the solution is (the Maratos effect; Nocedal, Wright, Sec. 15.6). Each time
    # changes in proportion to itself, so that the long ones give way; all but `problem` in place.
    scaled = jacobian(columns, problem.rows)
    for e in range(gap.size):
        gap[e] = -gap[e]
        for i in range(times.size):
            scaled[e, i] *= times[i]
    change, _rank = least_squares(scaled, gap, 1e-11)
    for i in range(times.size):
        if change[i] < -0.5:
            return np.inf
    for i in range(times.size):
        times[i] += times[i] * change[i]
    return residual(problem, times, columns, gap)


@inner_kernel
def interior_point(
    problem: TimesProblem, times: Array, barrier: float, iterations: int
) -> tuple[bool, Array]:
    """Primal-dual Newton from `times` > 0, in place; returns (converged, slack of each bound)."""
    rates, twists = problem.rates, problem.twists
    n, n_rows = times.size, 3 + problem.targets.size
    columns, hessian = np.empty((n, 3)), np.empty((n, n))
    gap, trial_gap = np.empty(n_rows), np.empty(n_rows)
    # State of the method: `times`, multipliers `p` of the conditions, and `slack` (n,), those of
    # the bounds ``times >= 0``. On the central path ``times * slack = barrier`` for each of them.
    # `columns` (n, 3) are derivatives of the end by the times, `gap` the conditions violated, and
    # `trial` and `trial_gap` the same at the point that the line search tries.
    slack, trial = np.empty(n), np.empty(n)
    for i in range(n):
        slack[i] = barrier / times[i]
        trial[i] = rates[i] - slack[i]
    worst = residual(problem, times, columns, gap)
    p = multipliers(jacobian(columns, problem.rows), trial)
    system, rhs = np.empty((n + n_rows, n + n_rows)), np.empty(n + n_rows)
    stalled = 0  # steps in a row that led nowhere: degenerate words have no end of them
    for _ in range(iterations):
        if stalled == STALLED:
            break
        matrix = jacobian(columns, problem.rows)
        lagrangian_hessian(columns, p[0], p[1], hessian)
        slope, complementarity, centring = 0.0, 0.0, 0.0
        for i in range(n):
            value = rates[i] - slack[i]
            for e in range(n_rows):
                value += matrix[e, i] * p[e]
            rhs[i] = value
            slope = max(slope, abs(value))
            complementarity = max(complementarity, abs(times[i] * slack[i]))
            centring = max(centring, abs(times[i] * slack[i] - barrier))
        if worst < 1e-11 and slope < 1e-9 and complementarity < 1e-10:
            return True, slack
        # The barrier falls as soon as its own problem is solved well enough, faster than linearly.
        while max(worst, slope, centring) < 10.0 * barrier and barrier > 1e-13:
            barrier = max(1e-13, min(0.1 * barrier, barrier**1.5))
            centring = 0.0
            for i in range(n):
                centring = max(centring, abs(times[i] * slack[i] - barrier))
        damping = 0.0
        step = np.zeros(n + n_rows)
        # Newton's step for times and multipliers, the slacks eliminated. The Hessian is damped
        # until the curvature along the step is positive: else it may lead to a saddle.
        for _attempt in range(8):
            for i in range(n + n_rows):
                for j in range(n + n_rows):
                    system[i, j] = 0.0
            for i in range(n):
                value = rates[i] - barrier / times[i]
                for e in range(n_rows):
                    value += matrix[e, i] * p[e]
                    system[i, n + e] = matrix[e, i]
                    system[n + e, i] = matrix[e, i]
                rhs[i] = -value
                for j in range(n):
                    system[i, j] = hessian[i, j]
                system[i, i] += slack[i] / times[i] + damping
            for e in range(n_rows):
                rhs[n + e] = -gap[e]
            step = least_squares(system, rhs, 1e-13)[0]
            bend, size = 0.0, 0.0
            for i in range(n):
                size += step[i] * step[i]
                bend += step[i] * step[i] * (slack[i] / times[i] + damping)
                for j in range(n):
                    bend += step[i] * hessian[i, j] * step[j]
            if bend > 1e-10 * size:
                break
            damping = max(10.0 * damping, 1e-2)
        # Steps to the boundary, for times and slacks apart: all of them stay positive.
        longest, longest_dual = 1.0, 1.0
        for i in range(n):
            if step[i] < 0.0:
                longest = min(longest, -0.995 * times[i] / step[i])
            change = (barrier - slack[i] * step[i]) / times[i] - slack[i]
            if change < 0.0:
                longest_dual = min(longest_dual, -0.995 * slack[i] / change)
        for i in range(n):  # a turn is not crossed in one step
            if abs(step[i] * twists[i, 2]) > 1.0:
                longest = min(longest, 1.0 / abs(step[i] * twists[i, 2]))
        # A penalty above the largest multiplier makes the merit exact: its minimum meets the
        # conditions.
        weight = 1.0
        for e in range(n_rows):
            weight = max(weight, 2.0 * abs(p[e] + step[n + e]))
        before = merit(rates, times, barrier, gap, weight)
        before += 1e-12 * abs(before)
        # Halve the step until the merit falls; the last of ten tries is taken as it is.
        share = longest
        for _attempt in range(10):
            for i in range(n):
                trial[i] = times[i] + share * step[i]
            worst = residual(problem, trial, columns, trial_gap)
            if merit(rates, trial, barrier, trial_gap, weight) <= before:
                break
            if _attempt == 0:
                left = correct(problem, trial, trial_gap, columns)
                if left < np.inf and merit(rates, trial, barrier, trial_gap, weight) <= before:
                    worst = left
                    break
            share *= 0.5
        for i in range(n):
            change = (barrier - slack[i] * step[i]) / times[i] - slack[i]
            slack[i] += longest_dual * change
        moved = 0.0
        for i in range(n):
            moved = max(moved, abs(trial[i] - times[i]))
        stalled = stalled + 1 if moved < 1e-13 or share < 0.002 * longest else 0
        assign(times, trial)
        assign(gap, trial_gap)
        for e in range(n_rows):
            p[e] += share * step[n + e]
        for i in range(n):  # keep the slacks near the central path
            slack[i] = min(max(slack[i], barrier / (1e10 * times[i])), 1e10 * barrier / times[i])
    return False, slack


@inner_kernel
def levenberg_marquardt(problem: TimesProblem, times: Array, iterations: int) -> float:
    """Feasible times near `times`, in place, by projected Levenberg-Marquardt; what is violated."""
    n, n_rows = times.size, 3 + problem.targets.size
    columns, gap, trial = np.empty((n, 3)), np.empty(n_rows), np.empty(n)
    worst = residual(problem, times, columns, gap)
    square = 0.0
    for e in range(n_rows):
        square += gap[e] * gap[e]
    damping = 1e-2
    for _ in range(iterations):
        if worst < 1e-13:
            break
        residual(problem, times, columns, gap)
        matrix = jacobian(columns, problem.rows)
        system, rhs = np.zeros((n_rows + n, n)), np.zeros(n_rows + n)
        for i in range(n):
            # A time at zero that the step would push below stays there: its column is left out.
            pinned = times[i] <= 0.0
            if pinned:  # does the gradient push it further below zero?
                push = 0.0
                for e in range(n_rows):
                    push += matrix[e, i] * gap[e]
                pinned = push >= 0.0
            if not pinned:
                for e in range(n_rows):
                    system[e, i] = matrix[e, i]
            system[n_rows + i, i] = math.sqrt(damping)
        for e in range(n_rows):
            rhs[e] = -gap[e]
        step = least_squares(system, rhs, 1e-14)[0]
        # Projected on the bounds, then accepted only if the conditions improve.
        for i in range(n):
            trial[i] = max(0.0, times[i] + step[i])
        after = residual(problem, trial, columns, gap)
        square_after = 0.0
        for e in range(n_rows):
            square_after += gap[e] * gap[e]
        if square_after < square:
            assign(times, trial)
            worst, square = after, square_after
            damping = max(0.2 * damping, 1e-14)
        else:
            damping *= 5.0
            if damping > 1e8:
                break
    return worst


@inner_kernel
def finish(
    problem: TimesProblem, times: Array, slack: Array, keep: IntArray
) -> tuple[float, float, Array]:
    """Times in place, vanishing ones zero, others refined; (violation, slope, multipliers)."""
    n, m, count = times.size, problem.targets.size, 0
    for i in range(n):
        # A trim leaves the word where its time is nothing, or small against its slack: then the
        # bound is active, and the time would go to zero with the barrier.
        if times[i] < 1e-9 or (times[i] < 1e-4 and slack[i] > 1e2 * times[i]):
            times[i] = 0.0
        else:
            keep[count] = i
            count += 1
    some = columns_of(problem, keep, count)
    some_times = np.empty(count)
    for k in range(count):
        some_times[k] = times[keep[k]]
    p, slope = np.zeros(3 + m), 0.0
    # More times than conditions: a minimum, refined by Newton. As many or fewer: the conditions
    # alone fix them, and the multipliers are those that fit best.
    if count > 3 + m:
        p, worst, slope = newton_stationary(some, some_times, 20)
    worst = newton_feasible(some, some_times, 10)
    if count <= 3 + m:
        columns = np.empty((count, 3))
        residual(some, some_times, columns, np.empty(3 + m))
        matrix = jacobian(columns, some.rows)
        p = multipliers(matrix, some.rates)
        for k in range(count):
            value = some.rates[k]
            for e in range(3 + m):
                value += matrix[e, k] * p[e]
            slope = max(slope, abs(value))
    for k in range(count):
        if some_times[k] < -1e-12:
            worst = np.inf
        times[keep[k]] = max(0.0, some_times[k])
    return worst, slope, p


@shared_kernel
def solve_from(problem: TimesProblem, times: Array, barrier: float) -> tuple[int, Array, float]:
    """Interior point, then refinement; `times` in place. Returns (status, multipliers, slope)."""
    n = times.size
    start, inner = np.empty(n), np.empty(n)
    for i in range(n):
        # A start on the boundary has no slack to speak of: away from it by what suits the barrier.
        times[i] = max(times[i], 30.0 * barrier)
        start[i] = times[i]
    keep = np.empty(n, dtype=np.int64)
    _, slack = interior_point(problem, times, barrier, 60)
    assign(inner, times)
    worst, slope, p = finish(problem, times, slack, keep)
    if worst < 1e-10 and slope < 1e-7:
        return 0, p, slope
    for i in range(n):  # the refinement went astray: feasibility alone, from where it began
        times[i] = inner[i] if math.isfinite(inner[i]) else start[i]
    worst = levenberg_marquardt(problem, times, 60)
    if worst > 1e-10:
        assign(times, start)
        worst = levenberg_marquardt(problem, times, 100)
    columns = np.empty((n, 3))
    residual(problem, times, columns, np.empty(3 + problem.targets.size))
    p = multipliers(jacobian(columns, problem.rows), problem.rates)
    return (1 if worst < 1e-10 else 2), p, np.inf


@kernel
def solve_times(
    problem: TimesProblem, starts: Array, best_times: Array
) -> tuple[int, float, Array, float]:
    """Best of starts (k, n), or the first solved, in place; (status, cost, multipliers, slope)."""
    n = best_times.size
    times, best_p = np.empty(n), np.zeros(3 + problem.targets.size)
    best_status, best_cost, best_slope = 2, np.inf, np.inf
    for k in range(starts.shape[0]):
        assign(times, starts[k])
        scale = 0.0
        for i in range(n):
            scale = max(scale, abs(problem.rates[i]))
        status, p, slope = solve_from(problem, times, 1e-2 * max(scale, 1e-3))
        if status == 2:
            continue
        cost = 0.0
        for i in range(n):
            cost += problem.rates[i] * times[i]
        if status < best_status or (status == best_status and cost < best_cost):
            best_status, best_cost, best_slope, best_p = status, cost, slope, p
            assign(best_times, times)
        if status == 0:
            break
    return best_status, best_cost, best_p, best_slope
