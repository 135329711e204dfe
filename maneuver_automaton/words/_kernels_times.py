"""End of a word, its derivatives, and the Newton iterations on its coasting times.

No kernel knows a displacement: trims after a maneuver come in as conjugated twists, and the goal as
seen from before all maneuvers (see `closing.conjugated`). Times are in seconds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import by_value, inner_kernel
from maneuver_automaton.groups._kernels import coast, nearest_turn


@by_value
class TimesProblem(NamedTuple):
    """Minimise ``rates @ times`` such that the word ends at `goal` and ``rows @ times = targets``.

    Its columns are the trims of a word, or all trims of a library that words are made of.
    """

    twists: Array  # (n, 4) v_x, v_y, turn rate, v_z
    rates: Array  # (n,) cost per second
    rows: Array  # (m, n) of the linear conditions: altitude, fixed time
    goal: Array  # (4,) relative to the start
    targets: Array  # (m,)


@inner_kernel
def columns_of(problem: TimesProblem, word: IntArray, n: int) -> TimesProblem:
    """The problem of the first `n` trims of a word of a library."""
    m = problem.targets.size
    twists, rates, rows = np.empty((n, 4)), np.empty(n), np.empty((m, n))
    for i in range(n):
        assign(twists[i], problem.twists[word[i]])
        rates[i] = problem.rates[word[i]]
        for r in range(m):
            rows[r, i] = problem.rows[r, word[i]]
    return TimesProblem(twists, rates, rows, problem.goal, problem.targets)


@inner_kernel
def assign(target: Array, source: Array) -> None:
    """``target[:] = source`` in one dimension, as a loop: quicker to compile."""
    for i in range(target.size):
        target[i] = source[i]


@inner_kernel
def end_and_columns(twists: Array, times: Array, columns: Array) -> tuple[float, float, float]:
    """End pose (x, y, heading) of a word; fills `columns` (n, 3) with derivatives by the times."""
    # A trim that lasts longer turns all that follows about its own instantaneous centre:
    # column i is ``(R v_i + w_i J (end - p_i), w_i)`` in the world, p_i any point of trim i.
    n = times.size
    x, y, heading, c, s = 0.0, 0.0, 0.0, 1.0, 0.0
    for i in range(n):
        dx, dy, turn = coast(twists[i, 0], twists[i, 1], twists[i, 2], times[i])
        # What `compose` does, which would take the cosine and the sine of the last trim again.
        x, y, heading = x + c * dx - s * dy, y + s * dx + c * dy, heading + turn
        c, s = math.cos(heading), math.sin(heading)
        # Velocity of the world's origin if all turned with this trim: its last pose does for `p_i`,
        # as every pose of the trim lies on the same motion. The end is known only after the last
        # trim, so what it adds comes in the second loop.
        columns[i, 0] = c * twists[i, 0] - s * twists[i, 1] + twists[i, 2] * y
        columns[i, 1] = s * twists[i, 0] + c * twists[i, 1] - twists[i, 2] * x
        columns[i, 2] = twists[i, 2]
    for i in range(n):
        columns[i, 0] -= twists[i, 2] * y
        columns[i, 1] += twists[i, 2] * x
    return x, y, heading


@inner_kernel
def lagrangian_hessian(columns: Array, p_x: float, p_y: float, hessian: Array) -> None:
    """Fill `hessian` (n, n) with second derivatives of ``p . end position`` by the times.

    For i <= j it is ``w_i (p x column_j)``: the earlier trim turns the later one's column.
    """
    n = columns.shape[0]
    for j in range(n):
        across = p_y * columns[j, 0] - p_x * columns[j, 1]
        for i in range(j + 1):
            hessian[i, j] = columns[i, 2] * across
            hessian[j, i] = hessian[i, j]


@inner_kernel
def least_squares(matrix: Array, rhs: Array, relative_tolerance: float) -> tuple[Array, int]:
    """Basic least-squares solution of ``matrix x = rhs`` and the rank; both arguments are spoilt.

    Householder QR with column pivoting (Golub, Van Loan, Matrix Computations, Alg. 5.4.1).
    """
    # Each loop over columns is the innermost one, so that the processor takes several at once, with
    # indices that cannot be negative, which it would ask of each.
    m, n = matrix.shape
    order, rank, largest, room = np.arange(n), 0, 0.0, np.zeros((2, n))
    squares, factors, end = room[0], room[1], np.uint64(n)
    for i in range(m):
        for j in range(n):
            squares[j] += matrix[i, j] * matrix[i, j]
    for k in range(min(m, n)):
        # The longest column that is left comes next: the rank is how many are longer than the
        # tolerance of the longest of all, so words whose columns do not span are solved like any
        # other.
        best, best_norm = k, -1.0
        for j in range(k, n):
            if squares[j] > best_norm:
                best, best_norm = j, squares[j]
        best_norm = math.sqrt(best_norm)
        largest = max(largest, best_norm)
        if best_norm <= relative_tolerance * largest or best_norm == 0.0:
            break
        if best != k:
            for i in range(m):
                matrix[i, k], matrix[i, best] = matrix[i, best], matrix[i, k]
            order[k], order[best] = order[best], order[k]
        head = matrix[k, k]
        # The sign that adds in `head - alpha`, so that no digit cancels.
        alpha = -best_norm if head >= 0.0 else best_norm
        v0 = head - alpha
        scale, dot, after = 0.0, v0 * rhs[k], np.uint64(k + 1)
        for j in range(after, end):
            factors[j] = v0 * matrix[k, j]
        for i in range(k + 1, m):
            v = matrix[i, k]
            scale += v * v
            dot += v * rhs[i]
            for j in range(after, end):
                factors[j] += v * matrix[i, j]
        scale = v0 * v0 + scale
        factor = 2.0 * dot / scale
        rhs[k] -= factor * v0
        for j in range(after, end):
            factors[j] = 2.0 * factors[j] / scale
            matrix[k, j] -= factors[j] * v0
            squares[j] = 0.0
        for i in range(k + 1, m):
            v = matrix[i, k]
            rhs[i] -= factor * v
            for j in range(after, end):
                matrix[i, j] -= factors[j] * v
                squares[j] += matrix[i, j] * matrix[i, j]
        matrix[k, k] = alpha
        rank += 1
    # The basic solution: columns beyond the rank are not used.
    solution = np.zeros(n)
    for k in range(rank - 1, -1, -1):
        value = rhs[k]
        for j in range(k + 1, rank):
            value -= matrix[k, j] * solution[order[j]]
        solution[order[k]] = value / matrix[k, k]
    return solution, rank


@inner_kernel
def residual(problem: TimesProblem, times: Array, columns: Array, out: Array) -> float:
    """Fill `out` (3 + m,) with end minus goal and the linear conditions; returns the largest."""
    x, y, heading = end_and_columns(problem.twists, times, columns)
    out[0], out[1] = x - problem.goal[0], y - problem.goal[1]
    out[2] = nearest_turn(heading - problem.goal[2])
    for r in range(problem.targets.size):
        value = -problem.targets[r]
        for i in range(times.size):
            value += problem.rows[r, i] * times[i]
        out[3 + r] = value
    worst = 0.0
    for e in range(out.size):
        worst = max(worst, abs(out[e]))
    return worst


@inner_kernel
def jacobian(columns: Array, rows: Array) -> Array:
    """Derivatives (3 + m, n) of all conditions by the times."""
    n = columns.shape[0]
    matrix = np.empty((3 + rows.shape[0], n))
    for i in range(n):
        matrix[0, i], matrix[1, i], matrix[2, i] = columns[i, 0], columns[i, 1], columns[i, 2]
        for r in range(rows.shape[0]):
            matrix[3 + r, i] = rows[r, i]
    return matrix


@inner_kernel
def multipliers(matrix: Array, rates: Array) -> Array:
    """Multipliers (3 + m,) that best make ``rates + matrix^T multipliers`` vanish."""
    m, n = matrix.shape
    transposed, rhs = np.empty((n, m)), np.empty(n)
    for i in range(n):
        rhs[i] = -rates[i]
        for e in range(m):
            transposed[i, e] = matrix[e, i]
    return least_squares(transposed, rhs, 1e-10)[0]


@inner_kernel
def newton_stationary(
    problem: TimesProblem, times: Array, iterations: int
) -> tuple[Array, float, float]:
    """Newton on ``rates + J^T p = 0, conditions = 0`` without bounds, from `times`, in place.

    Returns the multipliers (3 + m,), the largest condition and the largest slope violated.
    """
    n, n_rows = times.size, 3 + problem.targets.size
    columns, gap, hessian = np.empty((n, 3)), np.empty(n_rows), np.empty((n, n))
    worst = residual(problem, times, columns, gap)
    p = multipliers(jacobian(columns, problem.rows), problem.rates)
    slope = np.inf
    for _ in range(iterations):
        matrix = jacobian(columns, problem.rows)
        lagrangian_hessian(columns, p[0], p[1], hessian)
        system, rhs, slope = np.zeros((n + n_rows, n + n_rows)), np.empty(n + n_rows), 0.0
        for i in range(n):
            value = problem.rates[i]
            for e in range(n_rows):
                value += matrix[e, i] * p[e]
                system[i, n + e] = matrix[e, i]
                system[n + e, i] = matrix[e, i]
            rhs[i] = -value
            slope = max(slope, abs(value))
            for j in range(n):
                system[i, j] = hessian[i, j]
        for e in range(n_rows):
            rhs[n + e] = -gap[e]
        if worst < 1e-13 and slope < 1e-12:
            break
        # The system of Karush, Kuhn and Tucker. It may be singular, as where trims share a centre;
        # the basic least-squares step then goes on in what it determines.
        step, _rank = least_squares(system, rhs, 1e-13)
        length = 0.0
        for i in range(n):
            length = max(length, abs(step[i]))
        # Half a second at most: headings turn by more than Newton's linear model bears otherwise.
        shrink = min(1.0, 0.5 / length) if length > 0.0 else 1.0
        for i in range(n):
            times[i] += shrink * step[i]
        for e in range(n_rows):
            p[e] += shrink * step[n + e]
        worst = residual(problem, times, columns, gap)
        if length < 1e-15:
            break
    return p, worst, slope


@inner_kernel
def newton_feasible(problem: TimesProblem, times: Array, iterations: int) -> float:
    """Gauss-Newton on the conditions alone, from `times`, in place; the largest one violated."""
    n = times.size
    columns, gap, best = np.empty((n, 3)), np.empty(3 + problem.targets.size), np.empty(n)
    # The last steps are below rounding, and a worse one may follow a better: the best is kept.
    assign(best, times)
    worst = residual(problem, times, columns, gap)
    least = worst
    for _ in range(iterations):
        if worst < 1e-15:
            break
        for e in range(gap.size):
            gap[e] = -gap[e]
        step, _rank = least_squares(jacobian(columns, problem.rows), gap, 1e-11)
        for i in range(n):
            times[i] += step[i]
        worst = residual(problem, times, columns, gap)
        if worst < least:
            least = worst
            assign(best, times)
        elif worst > 0.5 * least and least < 1e-12:
            break
    assign(times, best)
    return least


@inner_kernel
def curvature(problem: TimesProblem, times: Array, p: Array) -> float:
    """Least pivot of the Hessian where conditions hold: positive at a minimum; inf for none."""
    n = times.size
    columns, gap, hessian = np.empty((n, 3)), np.empty(3 + problem.targets.size), np.empty((n, n))
    residual(problem, times, columns, gap)
    lagrangian_hessian(columns, p[0], p[1], hessian)
    basis = null_space(jacobian(columns, problem.rows))
    d = basis.shape[1]
    if d == 0:
        return np.inf
    # Second derivatives along directions that keep all conditions, to first order: that they are
    # positive is the condition of second order for a minimum.
    reduced = np.zeros((d, d))
    for k in range(d):
        for q in range(d):
            for i in range(n):
                for j in range(n):
                    reduced[k, q] += basis[i, k] * hessian[i, j] * basis[j, q]
    smallest = np.inf
    for k in range(d):  # LDL^T without pivoting: enough for the sign
        pivot = reduced[k, k]
        smallest = min(smallest, pivot)
        if pivot <= 0.0:
            break
        for i in range(k + 1, d):
            factor = reduced[i, k] / pivot
            for j in range(k, d):
                reduced[i, j] -= factor * reduced[k, j]
    return smallest


@inner_kernel
def null_space(matrix: Array) -> Array:
    """Basis (n, n - rank) of what `matrix` (m, n) maps to zero; Gauss-Jordan, full pivoting."""
    m, n = matrix.shape
    work, order, rank, largest = np.empty((m, n)), np.arange(n), 0, 0.0
    for i in range(m):
        for j in range(n):
            work[i, j] = matrix[i, j]
            largest = max(largest, abs(work[i, j]))
    for k in range(min(m, n)):
        best_i, best_j, best = k, k, 0.0
        for i in range(k, m):
            for j in range(k, n):
                if abs(work[i, j]) > best:
                    best_i, best_j, best = i, j, abs(work[i, j])
        if best <= 1e-11 * largest or best == 0.0:
            break
        for j in range(n):
            work[k, j], work[best_i, j] = work[best_i, j], work[k, j]
        for i in range(m):
            work[i, k], work[i, best_j] = work[i, best_j], work[i, k]
        order[k], order[best_j] = order[best_j], order[k]
        pivot = work[k, k]
        for j in range(n):
            work[k, j] /= pivot
        for i in range(m):
            if i != k:
                factor = work[i, k]
                for j in range(n):
                    work[i, j] -= factor * work[k, j]
        rank += 1
    basis = np.zeros((n, n - rank))
    for free in range(n - rank):
        basis[order[rank + free], free] = 1.0
        for k in range(rank):
            basis[order[k], free] = -work[k, rank + free]
    return basis
