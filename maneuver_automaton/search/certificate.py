"""The certificate of a plan: the smallest reduced cost over the whole library and all times."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton.problem import Goal, Problem
from maneuver_automaton.search.library_arrays import LibraryArrays, library_arrays
from maneuver_automaton.search.setup import search_setup
from maneuver_automaton.search.time_limit import within_time
from maneuver_automaton.words.word import Word

BINDING = 1e-9  # share of a greatest time [s] that may be left where it binds
CUTS = 60  # rounds of the linear program where multipliers are not unique


def certificate(problem: Problem, goal: Goal, solution: Word) -> float | None:
    """Smallest reduced cost of inserting any trim at any time into a solution; None if it is empty.

    At least zero (up to rounding) where Pontryagin's condition holds over the whole library: a
    necessary condition for the optimum. Where the multipliers are not unique, those are taken that
    make it largest. With a binding ``max_trims`` it may be negative.
    """
    if solution.trims.size == 0:
        return None
    setup = search_setup(problem, goal)
    library = library_arrays(problem, setup)
    most_time = problem.horizon.max_time
    if most_time is not None and solution.duration > most_time - BINDING * (1.0 + most_time):
        library = within_time(library, most_time)  # time has a price where its limit binds
    used = solution.durations > 0.0
    moving = library.number_of[solution.trims] >= 0
    if not (used & moving).any():
        return None
    word = library.number_of[solution.trims[used & moving]]
    times = solution.durations[used & moving]
    if library.free_heading:
        word = np.append(word, len(library.rates) - 1)
        turned = float(library.twists[word[:-1], 2] @ times)
        times = np.append(times, np.remainder(setup.goal[2] - turned, 2.0 * np.pi))
    return smallest_reduced_cost(library, word, times)


def smallest_reduced_cost(library: LibraryArrays, word: IntArray, times: Array) -> float:
    """`certificate` of a word in the numbers of `library`."""
    from maneuver_automaton.search import _kernels_insertion as kernels

    p = kernels.multipliers_of_word(library.twists, library.rates, library.rows, word, times)
    least, trim, position, when = _price(library, word, times, p)
    columns = _conditions(library, word, times)
    scale = library.scale
    if least >= -1e-9 * scale or np.linalg.matrix_rank(columns, tol=1e-9) == len(columns):
        return least
    cuts = [_insertion_column(library, word, times, trim, position, when)]
    best = least
    for _ in range(CUTS):
        solved = _largest_least(columns, library.rates[word], cuts)
        if solved is None:
            return best
        p, bound = solved
        least, trim, position, when = _price(library, word, times, p)
        best = max(best, least)
        if least >= bound - 1e-10 * scale or best >= -1e-9 * scale:
            return best
        cuts.append(_insertion_column(library, word, times, trim, position, when))
    return best


def _price(
    library: LibraryArrays, word: IntArray, times: Array, p: Array
) -> tuple[float, int, int, float]:
    from maneuver_automaton.search import _kernels_insertion as kernels

    n = word.size - (1 if library.free_heading else 0)
    value, trim, position, when = kernels.price_word(
        library.twists, library.rates, library.rows, library.n_priced, word, times, n, p
    )
    return float(value), int(trim), int(position), float(when)


def _conditions(library: LibraryArrays, word: IntArray, times: Array) -> Array:
    """Derivatives (3 + m, n) of all conditions by the times."""
    from maneuver_automaton.groups import SE2

    twists = library.twists[word]
    pose = SE2.identity()
    poses = []
    for twist, time in zip(twists, times, strict=True):
        poses.append(pose.pose)
        pose = pose @ SE2.exp(time * twist[:3])
    columns = [
        _column(library, trim, begin, pose.pose) for trim, begin in zip(word, poses, strict=True)
    ]
    return np.array(columns).T


def _column(library: LibraryArrays, trim: int, at: Array, end: Array) -> Array:
    """How the end and the linear conditions move when `trim` is inserted at the pose `at`."""
    v, u, w = library.twists[trim, :3]
    c, s = np.cos(at[2]), np.sin(at[2])
    motion = [c * v - s * u - w * (end[1] - at[1]), s * v + c * u + w * (end[0] - at[0]), w]
    return np.array([*motion, *library.rows[:, trim]])


def _insertion_column(
    library: LibraryArrays, word: IntArray, times: Array, trim: int, position: int, when: float
) -> tuple[Array, float]:
    from maneuver_automaton.groups import SE2

    at = SE2.identity()
    for k in range(position):
        at = at @ SE2.exp(times[k] * library.twists[word[k], :3])
    at = at @ SE2.exp(when * library.twists[word[position], :3])
    end = SE2.identity()
    for k in range(word.size):
        end = end @ SE2.exp(times[k] * library.twists[word[k], :3])
    return _column(library, trim, at.pose, end.pose), float(library.rates[trim])


def _largest_least(
    columns: Array, rates: Array, cuts: list[tuple[Array, float]]
) -> tuple[Array, float] | None:
    """Multipliers that explain the word and make the least reduced cost of the cuts largest."""
    from scipy.optimize import linprog

    n = len(columns)
    objective = np.append(np.zeros(n), -1.0)
    upper = np.array([np.append(-column, 1.0) for column, _ in cuts])
    solved = linprog(
        objective,
        A_ub=upper,
        b_ub=[rate for _, rate in cuts],
        A_eq=np.hstack([columns.T, np.zeros((columns.shape[1], 1))]),
        b_eq=-rates,
        bounds=[(-1e6, 1e6)] * n + [(None, 0.0)],
        method="highs",
    )
    if solved.status != 0 or solved.x is None:
        return None
    return np.asarray(solved.x[:n]), float(solved.x[n])
