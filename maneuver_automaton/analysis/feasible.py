"""The initially feasible set: from where a library reaches a goal within a time.

By the symmetry only the pose relative to the goal matters: a goal moved together with the poses
has the same least times.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, as_number, check_range, freeze
from maneuver_automaton._parallel import in_parallel
from maneuver_automaton.costs import Cost
from maneuver_automaton.problem import Horizon, Problem
from maneuver_automaton.search.choose import load_search, search_goal

CHUNK = 64  # poses that one job takes at a time
SLACK = 1e-9  # relative: a least time that exceeds the limit by no more counts as within it

Window = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FeasibleSet:
    """Least times from a grid of start poses to the goal of a problem.

    Where `exhaustive`, every admitted word was searched for every pose, and the times are the
    least. Otherwise they are those of the best plans found: a pose in the set is feasible, and one
    outside may be, too.
    """

    problem: Problem
    within: float  # T [s]
    x: Array  # (n_x,) [m]
    y: Array  # (n_y,) [m]
    headings: Array  # (k,) [rad]
    times: Array  # (k, n_y, n_x) [s], inf where no plan was found
    exhaustive: bool

    def __post_init__(self) -> None:
        for name in ("x", "y", "headings"):
            freeze(self, name)
        times = np.array(self.times, dtype=np.float64)
        shape = (self.headings.size, self.y.size, self.x.size)
        if times.shape != shape:
            raise ValueError(f"feasible set: got times of shape {times.shape}, need {shape}")
        times.setflags(write=False)
        object.__setattr__(self, "times", times)

    @property
    def feasible(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Which poses reach the goal within the time: (k, n_y, n_x)."""
        return np.asarray(self.times <= self.within * (1.0 + SLACK))


def least_times(problem: Problem, poses: ArrayLike, *, jobs: int = 1) -> Array:
    """Least time from each of `poses` to the nearest goal, over the words of the library.

    The words are those that `problem.horizon` admits, with the final time free. Where it fixes
    the time and the library has a rest, one of `max_trims` is left to the rest, which takes what
    remains of the time: a word that needs all trims and exactly the time is not counted.

    The search is exhaustive, and the times exact, for few trims (`max_trims` up to 4 for a small
    library); with more trims, or no limit, they are upper bounds, of the best plans found.
    `FeasibleSet.exhaustive` says which.

    Parameters
    ----------
    problem : Problem
        Its automaton, goals and horizon; start, cost and tolerances do not matter.
    poses : (n, dof) array_like
        Start poses [m, m, rad(, m)].
    jobs : int
        Processes that share the work.

    Returns
    -------
    (n,) array
        [s], inf where no word reaches a goal.

    Raises
    ------
    ValueError
        If the poses are no poses of the vehicle, or the problem has bounds, which break the
        symmetry.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (2, 0), "spin": (0, 1)})
    >>> problem = Problem(robot, [0, 0, 0], [0, 0, 0], horizon=Horizon(max_trims=3))
    >>> least_times(problem, [[-3, 0, 0], [-3, 0, -0.5]]).round(9).tolist()
    [1.5, 2.0]
    """
    times, _ = _searched(problem, poses, jobs)
    return times


def feasible_set(
    problem: Problem,
    within: float,
    *,
    window: Window,
    headings: Sequence[float] | Array,
    resolution: float,
    jobs: int = 1,
) -> FeasibleSet:
    """From which poses of a grid the goal of a `problem` is reached `within` a time [s].

    Parameters
    ----------
    problem : Problem
        As for `least_times`; the altitude is that of its start.
    within : float
        T [s].
    window : ((x_low, x_high), (y_low, y_high))
        Places of the grid, ends included [m].
    headings : (k,) sequence
        One slice of the set for each [rad].
    resolution : float
        Distance of grid points [m], at most.
    jobs : int
        Processes that share the work.

    Returns
    -------
    FeasibleSet

    Raises
    ------
    ValueError
        If a number is out of range, or as for `least_times`.

    Examples
    --------
    >>> from maneuver_automaton.automaton import Automaton
    >>> from maneuver_automaton.models import Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"ahead": (1, 0), "spin": (0, 1)})
    >>> problem = Problem(robot, [0, 0, 0], [0, 0, 0], horizon=Horizon(max_trims=3))
    >>> found = feasible_set(
    ...     problem, 2.0, window=((-3, 0), (0, 1)), headings=[0.0], resolution=1.0
    ... )
    >>> found.feasible[0, 0].tolist(), found.exhaustive
    ([False, True, True, True], True)
    """
    within = as_number("feasible set: within", within)
    resolution = as_number("feasible set: resolution", resolution)
    check_range("feasible set: within", within, unit="s")
    check_range("feasible set: resolution", resolution, unit="m")
    angles = as_array("feasible set: headings", headings)
    if angles.ndim != 1 or not angles.size:
        raise ValueError(f"feasible set: got headings of shape {angles.shape}, need (k,)")
    x, y = (_points(name, pair, resolution) for name, pair in zip("xy", window, strict=True))
    shape = (angles.size, y.size, x.size)
    poses = np.zeros((*shape, problem.start.size))
    poses[...] = problem.start
    poses[..., 0], poses[..., 1] = x, y[:, None]
    poses[..., 2] = angles[:, None, None]
    times, exhaustive = _searched(problem, poses.reshape(-1, problem.start.size), jobs)
    return FeasibleSet(
        problem=problem,
        within=within,
        x=x,
        y=y,
        headings=angles,
        times=times.reshape(shape),
        exhaustive=exhaustive,
    )


def _points(name: str, pair: tuple[float, float], resolution: float) -> Array:
    low, high = as_array(f"feasible set: window, {name}", pair, last=2)
    if not low < high:
        raise ValueError(
            f"feasible set: window must have low < high, got {name} from {low} to {high} m"
        )
    return np.linspace(low, high, math.ceil((high - low) / resolution * (1.0 - SLACK)) + 1)


def _searched(problem: Problem, poses: ArrayLike, jobs: int) -> tuple[Array, bool]:
    """Least times (n,), and whether all of them were searched exhaustively."""
    starts = as_array("poses", poses, last=problem.start.size)
    if starts.ndim != 2:
        raise ValueError(f"poses: got shape {starts.shape}, need (n, {problem.start.size})")
    timed = _in_least_time(problem)
    chunks = [starts[k : k + CHUNK] for k in range(0, len(starts), CHUNK)]
    load_search(timed)
    parts = in_parallel(functools.partial(_rows, timed), chunks, jobs=jobs)
    rows = list(itertools.chain.from_iterable(parts))
    return np.array([time for time, _ in rows]), all(exhaustive for _, exhaustive in rows)


def _in_least_time(problem: Problem) -> Problem:
    """The problem of least time: the final time free, and a trim left to the rest that pads it."""
    if not problem.bounds.are_open:
        raise ValueError("least times: bounds do not move with the symmetry; leave them out")
    most, horizon = problem.horizon.max_trims, problem.horizon
    if horizon.time is not None and most is not None and problem.automaton.rest is not None:
        if most == 1:
            raise ValueError(
                "least times: a fixed time padded by rest leaves no trim to move with, need "
                "max_trims of at least 2, got 1"
            )
        most -= 1
    free = Horizon(max_trims=most, min_coast=horizon.min_coast)
    return replace(problem, cost=Cost(time=1.0), horizon=free)


def _rows(problem: Problem, poses: Array) -> list[tuple[float, bool]]:
    """Least time to any goal, and whether the search of it was exhaustive, for each pose."""
    rows = []
    for pose in poses:
        here = replace(problem, start=pose)
        least, exhaustive = math.inf, True
        for goal in problem.goals:
            results = search_goal(here, goal, alternatives=0)
            exhaustive &= any(result.exhaustive for result in results)
            costs = (solution.cost for result in results for solution in result.solutions[:1])
            least = min(least, *costs, math.inf)
        rows.append((least, exhaustive))
    return rows
