"""Words whose maneuvers alone turn the vehicle: maneuvers in a row, and straight coasts between.

Where no trim turns, the heading at the end follows from the maneuvers, and the place is linear in
the coasting times. So the maneuvers are enumerated along the graph, those that lead from a trim to
itself and costlier ones of a pair included; two coasts at most then lead to the goal exactly.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array, IntArray, wrapped
from maneuver_automaton.automaton import Automaton, Plan
from maneuver_automaton.budget import UNLIMITED, Budget
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Goal, Problem

MOST_ROWS = 200_000  # sequences of one length
LONGEST = 12  # maneuvers in a row
TURNED = 1e-9  # [rad] by which a last heading may differ from the goal's
PARALLEL = 1e-9  # sine of the angle below which two coasts lead along one line
OFF = 1e-9  # [m] by which such a line may miss the goal


def only_maneuvers_turn(automaton: Automaton) -> bool:
    """Whether a vehicle in the plane has maneuvers, and no trim that turns."""
    velocities = automaton.body_velocities
    return bool(automaton.maneuvers) and velocities.shape[1] == 3 and not velocities[:, 2].any()


def maneuver_words(
    problem: Problem, goal: Goal, *, others: int = 0, budget: Budget = UNLIMITED
) -> list[Plan]:
    """The cheapest plan to a goal, and up to `others` more, by maneuvers and straight coasts.

    Shorter sequences come first, and all of a length, as long as there are not too many. Obstacles,
    bounds and the horizon are not looked at.
    """
    automaton, index = problem.automaton, problem.automaton.index_of
    first, last = index(problem.first_trim.name), index(problem.last_trim(goal).name)
    source, target = (
        np.array([index(getattr(one, end)) for one in automaton.maneuvers])
        for end in ("source", "target")
    )
    prices = np.array([problem.maneuver_cost(one) for one in automaton.maneuvers])
    gained = SE2(np.array([one.displacement for one in automaton.maneuvers]))
    aim = (SE2(problem.start).inverse() @ SE2(goal.pose)).pose
    rows, poses, spent = np.zeros((1, 0), dtype=np.int64), np.zeros((1, 3)), np.zeros(1)
    found: list[tuple[float, IntArray, Array]] = []
    for _ in range(LONGEST + 1):
        at = target[rows[:, -1]] if rows.shape[1] else np.full(len(rows), first)
        off = np.abs(wrapped(poses[:, 2] - aim[2]))
        for row in np.flatnonzero((at == last) & (goal.free_heading | (off <= TURNED))):
            trims = np.append(first, target[rows[row]])
            times = _coasts(problem, trims, gained.pose[rows[row]], aim)
            if times is not None:
                found.append((spent[row] + float(problem.rates[trims] @ times), rows[row], times))
        found = sorted(found, key=lambda one: one[0])[: others + 1]
        follow = [np.flatnonzero(source == trim) for trim in range(len(automaton.trims))]
        counts = np.array([len(one) for one in follow])[at]
        if not 0 < counts.sum() <= MOST_ROWS or budget.is_over:
            break
        of = np.repeat(np.arange(len(rows)), counts)
        by = np.concatenate([follow[trim] for trim in at.tolist()])
        rows, spent = np.column_stack([rows[of], by]), spent[of] + prices[by]
        poses = (SE2(poses[of]) @ SE2(gained.pose[by])).pose
        if len(found) > others:  # what costs more already leads to nothing cheaper
            cheap = spent < found[-1][0]
            rows, poses, spent = rows[cheap], poses[cheap], spent[cheap]
    return [_plan(problem, first, row, times) for _, row, times in found]


def _coasts(problem: Problem, trims: IntArray, steps: Array, aim: Array) -> Array | None:
    """The cheapest times (k + 1,) of the coasts beside k maneuvers that lead to a place, if any."""
    heading = np.append(0.0, np.cumsum(steps[:, 2]))
    turn = np.stack([np.cos(heading), np.sin(heading)])

    def seen(moves: Array, turn: Array) -> Array:
        """Moves (n, 2) in the frame of the start."""
        ahead, aside = moves.T
        return np.stack([turn[0] * ahead - turn[1] * aside, turn[1] * ahead + turn[0] * aside])

    ways = seen(problem.automaton.body_velocities[trims][:, :2], turn)  # (2, k + 1)
    left = aim[:2] - seen(steps[:, :2], turn[:, :-1]).sum(axis=1)
    size, rates, best, times = np.hypot(*ways), problem.rates[trims], math.inf, None
    for i in np.flatnonzero(size):
        for j in np.flatnonzero(size)[np.flatnonzero(size) >= i]:
            cross = ways[0, i] * ways[1, j] - ways[1, i] * ways[0, j]
            if abs(cross) > PARALLEL * size[i] * size[j]:
                one = (left[0] * ways[1, j] - left[1] * ways[0, j]) / cross
                other = (ways[0, i] * left[1] - ways[1, i] * left[0]) / cross
            else:
                one, other = float(left @ ways[:, i]) / size[i] ** 2, 0.0
                if np.hypot(*(left - one * ways[:, i])) > OFF * (1.0 + np.hypot(*aim[:2])):
                    continue
            cost = one * rates[i] + other * rates[j]
            if min(one, other) >= 0.0 and cost < best:
                best, times = cost, np.zeros(len(trims))
                times[i] += one
                times[j] += other
    if times is None and np.hypot(*left) <= OFF * (1.0 + np.hypot(*aim[:2])):
        return np.zeros(len(trims))  # the maneuvers alone lead there
    return times


def _plan(problem: Problem, first: int, row: IntArray, times: Array) -> Plan:
    automaton = problem.automaton
    maneuvers = tuple(automaton.maneuvers[k] for k in row.tolist())
    trims = (automaton.trims[first], *(automaton[one.target] for one in maneuvers))
    return Plan(
        problem.start, trims, durations=times, maneuvers=maneuvers, start_time=problem.start_time
    )
