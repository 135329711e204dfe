"""Plans as they come: each better than the one before, and audited."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from queue import SimpleQueue

from maneuver_automaton.budget import Watch
from maneuver_automaton.planning.plan import plan
from maneuver_automaton.planning.result import PlanResult
from maneuver_automaton.problem import Problem


def plans(
    problem: Problem, *, time_limit: float = 5.0, alternatives: int = 0, gap: float | None = None
) -> Iterator[PlanResult]:
    """Better and better plans for `problem`; the last one is the answer of `plan`.

    The search goes on in a thread of its own while a plan is looked at, and ends when the iterator
    is closed: when the loop over it is left.

    Parameters
    ----------
    problem : Problem
    time_limit : float
        [s] as of `plan`.
    alternatives : int
        How many costlier plans the last one has beside it.
    gap : float, optional
        Share of the cost that is small enough, as of `plan`.

    Yields
    ------
    PlanResult
        A plan that passed all checks, cheaper than those before. The last answer has the best
        bound, alternatives, and where there is no plan the reason.

    Raises
    ------
    ValueError
        As `plan` does.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Box, Unicycle
    >>> trims = {"ahead": (1, 0), "left": (1, 1), "right": (1, -1)}
    >>> robot = Automaton.of_controls(Unicycle(), trims)
    >>> wall = Box([1.0, 1.0], [3.0, 0.2])
    >>> problem = Problem(robot, [0, 0, 0], [6, 0, 0], obstacles=wall, footprint=Box([0.4, 0.2]))
    >>> costs = [better.cost for better in plans(problem, time_limit=0.5)]
    >>> all(after <= before for before, after in zip(costs, costs[1:]))
    True
    """
    watch = Watch(gap=-math.inf if gap is None else gap)
    came: SimpleQueue[PlanResult | BaseException | None] = SimpleQueue()

    def search() -> None:
        try:
            last = plan(
                problem,
                time_limit=time_limit,
                alternatives=alternatives,
                gap=gap,
                watch=watch,
                on_better=came.put,
            )
            came.put(last)
        except BaseException as error:  # noqa: BLE001, raised again by who waits
            came.put(error)
        came.put(None)

    thread = threading.Thread(target=search, daemon=True)
    thread.start()
    try:
        while (one := came.get()) is not None:
            if isinstance(one, BaseException):
                raise one
            yield one
    finally:
        watch.is_given_up = True
        thread.join()
