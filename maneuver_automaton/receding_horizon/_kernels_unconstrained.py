"""Search over sequences of trims on a fixed horizon, without a terminal constraint.

Poses (x, y, heading) are relative to the goal. By symmetry the motion inside an interval is the
same wherever it begins, so the nodes of its quadrature are displacements made once per trim.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._compile import inner_kernel, kernel
from maneuver_automaton.groups._kernels import compose


class IntervalTables(NamedTuple):
    """Displacements and costs of one interval of each of m trims."""

    places: np.ndarray  # (m, q, 3) displacement at the nodes of the quadrature
    ends: np.ndarray  # (m, 3) displacement at the end
    weights: np.ndarray  # (q,) of the quadrature [s]
    effort: np.ndarray  # (m,) cost of the control in an interval
    pose_weights: np.ndarray  # (3,)
    pose_orders: np.ndarray  # (3,)
    near: np.ndarray  # (m, k) trims of most similar twist, the trim itself first


@inner_kernel
def power(value: float, order: float) -> float:
    """``|value| ** order``, quick where the order is 2 or 4."""
    square = value * value
    if order == 2.0:
        return square
    if order == 4.0:
        return square * square
    return abs(value) ** order


@inner_kernel
def pose_rate(tables: IntervalTables, x: float, y: float, heading: float) -> float:
    """Cost per second of a pose."""
    q, p = tables.pose_weights, tables.pose_orders
    return q[0] * power(x, p[0]) + q[1] * power(y, p[1]) + q[2] * power(heading, p[2])


@inner_kernel
def interval_cost(
    tables: IntervalTables, trim: int, x: float, y: float, heading: float, c: float, s: float
) -> float:
    """Cost of one interval of a trim from a pose; `c`, `s` are cosine and sine of its heading."""
    total = tables.effort[trim]
    for k in range(tables.weights.size):
        dx, dy = tables.places[trim, k, 0], tables.places[trim, k, 1]
        rate = pose_rate(
            tables, x + c * dx - s * dy, y + s * dx + c * dy, heading + tables.places[trim, k, 2]
        )
        total += tables.weights[k] * rate
    return total


@inner_kernel
def next_pose(
    tables: IntervalTables, trim: int, x: float, y: float, heading: float
) -> tuple[float, float, float]:
    """Pose after one interval of a trim."""
    end = tables.ends[trim]
    return compose(x, y, heading, end[0], end[1], end[2])


@kernel
def roll_out(
    tables: IntervalTables, pose: Array, sequence: IntArray, poses: Array, costs: Array
) -> float:
    """Fill `poses` (n + 1, 3) and `costs` (n,) of a sequence (n,) of trims; the total cost."""
    return follow(tables, pose, sequence, poses, costs)


@inner_kernel
def follow(
    tables: IntervalTables, pose: Array, sequence: IntArray, poses: Array, costs: Array
) -> float:
    """What `roll_out` does, for other kernels."""
    total = 0.0
    poses[0] = pose
    for k in range(sequence.size):
        x, y, heading = poses[k]
        c, s = math.cos(heading), math.sin(heading)
        costs[k] = interval_cost(tables, sequence[k], x, y, heading, c, s)
        poses[k + 1] = next_pose(tables, sequence[k], x, y, heading)
        total += costs[k]
    return total


@inner_kernel
def tail_cost(
    tables: IntervalTables,
    sequence: IntArray,
    first: int,
    pose: tuple[float, float, float],
    limit: float,
) -> float:
    """Cost of the trims from `first` on, from a pose; inf once it is not below `limit`."""
    x, y, heading = pose
    # Costs are not negative, so a sum that reaches the limit stays there.
    total = 0.0
    for k in range(first, sequence.size):
        c, s = math.cos(heading), math.sin(heading)
        total += interval_cost(tables, sequence[k], x, y, heading, c, s)
        if total >= limit:
            return np.inf
        x, y, heading = next_pose(tables, sequence[k], x, y, heading)
    return total


@inner_kernel
def best_single(
    tables: IntervalTables,
    sequence: IntArray,
    i: int,
    pose: tuple[float, float, float],
    best: float,
) -> tuple[int, float]:
    """Trim for interval `i` with the least cost of the rest, and that cost, if below `best`."""
    x, y, heading = pose
    c, s = math.cos(heading), math.sin(heading)
    chosen = old = sequence[i]
    for trim in range(tables.effort.size):
        cost = interval_cost(tables, trim, x, y, heading, c, s)
        if trim != old and cost < best:
            end = next_pose(tables, trim, x, y, heading)
            cost += tail_cost(tables, sequence, i + 1, end, best - cost)
            if cost < best:
                best, chosen = cost, trim
    return chosen, best


@inner_kernel
def best_pair(
    tables: IntervalTables,
    sequence: IntArray,
    i: int,
    j: int,
    pose: tuple[float, float, float],
    best: float,
) -> tuple[int, int, float]:
    """Similar trims for intervals i < j with the least cost from i on, and it, if below `best`."""
    first = old_i = sequence[i]
    second = old_j = sequence[j]
    for a in tables.near[old_i]:
        sequence[i] = a
        for b in tables.near[old_j]:
            sequence[j] = b
            cost = tail_cost(tables, sequence, i, pose, best)
            if cost < best:
                best, first, second = cost, a, b
    sequence[i], sequence[j] = old_i, old_j
    return first, second, best


@kernel
def improve(tables: IntervalTables, pose: Array, sequence: IntArray, gain: float) -> float:
    """Change `sequence` one or two trims at a time while that gains more than `gain`; its cost.

    One interval tries every trim; two intervals try the trims most similar to theirs.
    """
    n = sequence.size
    # Poses between the intervals, and the cost of each: `poses[i]` is up to date when i is changed.
    poses, costs = np.empty((n + 1, 3)), np.empty(n)
    total = follow(tables, pose, sequence, poses, costs)
    # It ends: each change lowers the cost by more than `gain`, and sequences are finitely many.
    changed = True
    while changed:
        changed = False
        rest = total  # cost from interval i on
        for i in range(n):
            here = (poses[i, 0], poses[i, 1], poses[i, 2])
            chosen, least = best_single(tables, sequence, i, here, rest - gain)
            if chosen != sequence[i]:
                sequence[i], rest, changed = chosen, least, True
            for j in range(i + 1, n):
                first, second, least = best_pair(tables, sequence, i, j, here, rest - gain)
                if first != sequence[i] or second != sequence[j]:
                    sequence[i], sequence[j], rest, changed = first, second, least, True
            x, y, heading = here
            c, s = math.cos(heading), math.sin(heading)
            rest -= interval_cost(tables, sequence[i], x, y, heading, c, s)
            poses[i + 1] = next_pose(tables, sequence[i], x, y, heading)
        total = follow(tables, pose, sequence, poses, costs)
    return total


@inner_kernel
def near_one(poses: Array, count: int, pose: Array, same: float) -> bool:
    """Whether one of the first `count` poses is within `same` of `pose` in every component."""
    for k in range(count):
        if (
            abs(poses[k, 0] - pose[0]) <= same
            and abs(poses[k, 1] - pose[1]) <= same
            and abs(poses[k, 2] - pose[2]) <= same
        ):
            return True
    return False


@kernel
def beam(
    tables: IntervalTables, pose: Array, n: int, width: int, growth: float, same: float
) -> tuple[IntArray, Array]:
    """Sequences (k, n) of a beam search, k at most `width`, and their costs (k,), cheapest first.

    A partial sequence is ranked by its cost and ``min(time left, growth) * rate`` at its end, with
    the rate of standing still there; of those that end within `same` [m, rad] the first one stays.
    """
    m = tables.effort.size
    time = tables.weights.sum()  # of an interval
    # The sequences kept so far, a row each: where they end, what they cost, and their trims.
    poses, spent = np.empty((width, 3)), np.empty(width)
    words = np.empty((width, n), np.int64)
    poses[0], spent[0], kept = pose, 0.0, 1
    # Their children, m for each in the order of the rows, and the score by which they are ranked.
    ends, costs, scores = np.empty((width * m, 3)), np.empty(width * m), np.empty(width * m)
    for level in range(n):
        left = min(time * (n - 1 - level), growth)
        for row in range(kept):
            x, y, heading = poses[row]
            c, s = math.cos(heading), math.sin(heading)
            for trim in range(m):
                at = row * m + trim
                ends[at] = next_pose(tables, trim, x, y, heading)
                costs[at] = spent[row] + interval_cost(tables, trim, x, y, heading, c, s)
                scores[at] = costs[at] + left * pose_rate(
                    tables, ends[at, 0], ends[at, 1], ends[at, 2]
                )
        # A stable order: equal scores come in the order of rows and trims.
        order = np.argsort(scores[: kept * m], kind="mergesort")
        old_words, kept = words.copy(), 0
        for at in order:
            if near_one(poses, kept, ends[at], same):
                continue
            words[kept] = old_words[at // m]
            words[kept, level] = at % m
            poses[kept], spent[kept] = ends[at], costs[at]
            kept += 1
            if kept == width:
                break
    order = np.argsort(spent[:kept], kind="mergesort")
    return words[order], spent[order]
