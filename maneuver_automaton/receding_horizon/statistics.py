"""Many closed loops: the same problem from many starts, or with many seeds, in parallel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, check_range, freeze
from maneuver_automaton._brief import brief
from maneuver_automaton._interrupts import stopped
from maneuver_automaton._parallel import in_parallel
from maneuver_automaton.problem import Problem
from maneuver_automaton.receding_horizon.log import ClosedLoop, Guarantee, Violation
from maneuver_automaton.receding_horizon.simulation import Disturbance, simulate

CHUNKS = 4  # per worker, so that a slow one is not waited for


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Outcome:
    """How one closed loop went, in a few numbers."""

    start: Array  # (dof,)
    seed: int
    reached: bool
    arrived_after: int | None  # steps until the goal, or its set, was first reached
    stayed: bool  # in the goal's set from then on
    share_inside: float  # of the steps after the first arrival, 1 if there is none
    steps: int
    cost: float
    first_value: float
    violations: tuple[tuple[int, Violation], ...]
    disturbed: tuple[tuple[int, Violation], ...]
    audits_failed: int
    reason: str  # why the goal was not reached, or not kept; empty if all is well
    solve_s: Array  # (steps,)

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "start", last=(3, 4))
        freeze(self, "solve_s")

    @property
    def collisions(self) -> tuple[int, ...]:
        """Numbers of the steps that hit an obstacle, by the audit."""
        told = (*self.violations, *self.disturbed)
        return tuple(step for step, one in told if one.guarantee is Guarantee.NO_COLLISION)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Statistics:
    """Statistics of many closed loops."""

    outcomes: tuple[Outcome, ...]

    __repr__ = brief

    @property
    def reached(self) -> float:
        """Share that reached the goal."""
        return float(np.mean([one.reached for one in self.outcomes]))

    @property
    def stayed(self) -> float:
        """Share that reached the goal's set and stayed in it."""
        return float(np.mean([one.reached and one.stayed for one in self.outcomes]))

    @property
    def broken(self) -> int:
        """Number of steps that broke a guarantee."""
        return sum(len({step for step, _ in one.violations}) for one in self.outcomes)

    @property
    def solve_s(self) -> Array:
        """Times of all steps of all loops [s]."""
        return np.concatenate([one.solve_s for one in self.outcomes])


def simulate_many(
    problem: Problem,
    *,
    starts: ArrayLike | None = None,
    seeds: Sequence[int] = (0,),
    step: float,
    steps: int = 100,
    disturbance: Disturbance | None = None,
    margin: float = 0.0,
    time_limit: float = 5.0,
    stay: bool = False,
    retimed: bool = False,
    pieces: int = 0,
    gap: float | None = None,
    audit: bool = False,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Statistics:
    """Close the loop from every start with every seed.

    Parameters
    ----------
    problem : Problem
    starts : (n, dof) array_like, optional
        Poses to start from; the problem's own start if omitted.
    seeds : sequence of int
        Each start is tried with each of them.
    step, steps, disturbance, margin, time_limit, stay, retimed, pieces, gap, audit
        As in `simulate`; the seed of `disturbance` is replaced.
    jobs : int
        Processes at a time.
    scheduler : str, optional
        Address of a Dask scheduler ("tcp://host:8786"), or "local" for a cluster on this machine:
        the same work is sent there. Needs the package ``distributed``.
    progress : callable, optional
        Called with the number of loops done and their total.

    Returns
    -------
    Statistics
        In the order of starts, then seeds, whatever ran where; after a signal to the command line
        of the loops done until then.

    Raises
    ------
    ValueError
        If a number is out of range, or Dask is asked for and not installed.

    Examples
    --------
    >>> from maneuver_automaton import Automaton, Cost, Horizon, Problem, Unicycle
    >>> robot = Automaton.of_controls(Unicycle(), {"rest": (0, 0), "ahead": (1, 0), "spin": (0, 1)})
    >>> problem = Problem(
    ...     robot, [0, 0, 0], [0, 0, 0], cost=Cost(effort=1.0), horizon=Horizon(max_trims=3)
    ... )
    >>> simulate_many(problem, starts=[[-1, 0, 0], [0, 1, 1]], step=1.0).reached
    1.0
    """
    dof = problem.start.size
    poses = np.atleast_2d(as_array("starts", problem.start if starts is None else starts, last=dof))
    if poses.ndim != 2:
        raise ValueError(f"starts: got shape {poses.shape}, need (n, {dof})")
    cases = [(pose, seed) for pose in poses for seed in seeds]
    if not cases:
        raise ValueError(f"got {len(poses)} starts and {len(seeds)} seeds, need one of each")
    check_range("jobs", jobs, least=1)
    at_once = jobs == 1 and scheduler is None and progress is None
    n_chunks = min(1 if at_once else CHUNKS * max(jobs, 4), len(cases))
    chunks = [[cases[k] for k in part] for part in np.array_split(np.arange(len(cases)), n_chunks)]
    closed = partial(
        simulate,
        step=step,
        steps=steps,
        margin=margin,
        time_limit=time_limit,
        stay=stay,
        retimed=retimed,
        pieces=pieces,
        gap=gap,
        audit=audit,
    )
    upset = Disturbance() if disturbance is None else disturbance
    done: list[Outcome] = []
    work = partial(_outcomes, problem, upset=upset, closed=closed)
    for outcomes in in_parallel(work, chunks, jobs=jobs, scheduler=scheduler, ends_early=True):
        done += outcomes
        if progress is not None:
            progress(len(done), len(cases))
    if not done:
        raise KeyboardInterrupt  # the signal came before any loop was done
    return Statistics(outcomes=tuple(done))


def _outcomes(
    problem: Problem,
    cases: Sequence[tuple[Array, int]],
    *,
    upset: Disturbance,
    closed: Callable[..., ClosedLoop],
) -> list[Outcome]:
    """Outcomes of loops one after the other, without one that a signal cut short."""
    done: list[Outcome] = []
    for pose, seed in cases:
        if not stopped():
            loop = closed(replace(problem, start=pose), disturbance=replace(upset, seed=seed))
            done += [] if stopped() else [outcome_of(loop, seed=seed)]
    return done


def outcome_of(loop: ClosedLoop, *, seed: int = 0) -> Outcome:
    """A closed loop in a few numbers."""
    inside = np.array(loop.inside)
    arrived = np.flatnonzero(inside)
    first = int(arrived[0]) if arrived.size else None
    after = inside[first:] if first is not None else inside[:0]
    reason = loop.reason
    if not reason and not after.all():
        out = int(np.flatnonzero(~after)[0]) + (first or 0)
        reason = f"reached after {first} steps, outside again after {out}"
    return Outcome(
        start=loop.poses[0],
        seed=seed,
        reached=loop.reached,
        arrived_after=first,
        stayed=first is not None and bool(after.all()),
        share_inside=float(after.mean()) if after.size else 1.0,
        steps=len(loop.steps),
        cost=loop.cost,
        first_value=loop.steps[0].value if loop.steps else 0.0,
        violations=tuple(loop.violations),
        disturbed=tuple(loop.disturbed),
        audits_failed=sum(not audit.passed for audit in loop.audits),
        reason=reason,
        solve_s=loop.solve_s,
    )
