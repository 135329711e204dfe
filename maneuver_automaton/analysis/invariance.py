"""Invariance of cost, constraints and boundary conditions under a group."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array
from maneuver_automaton.analysis._examine import NOWHERE, Question, examine, values_of
from maneuver_automaton.analysis.region import Region
from maneuver_automaton.analysis.report import SymmetryReport
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.models import moved_state

StateControlFunction = Callable[[Array, Array], ArrayLike]
"""``l(x, u)`` or ``g(x, u)`` of one state (n_x,) and one control (n_u,): one or more numbers."""

BoundaryFunction = Callable[[Array, Array], ArrayLike]
"""``r(x_0, x_T)`` of the first and the last state (n_x,): one or more numbers."""


def check_stage_cost(
    stage_cost: StateControlFunction,
    *,
    region: Region,
    rng: np.random.Generator | None = None,
    samples: int = 100,
    tolerance: float = 1e-9,
) -> SymmetryReport:
    """Whether a stage cost ``l(x, u)`` has the same value at a moved state.

    Source: the paper, Def. 7.

    Parameters
    ----------
    stage_cost : callable
        ``l(x, u)`` of one state (n_x,), pose first, and one control (n_u,).
    region : Region
        Group, and where states and controls are drawn.
    rng : Generator, optional
        Source of the samples; always the same ones if None.
    samples : int
        Random states for each coordinate of the group.
    tolerance : float
        Greatest change admitted, relative to the value there (at least 1) [-].

    Returns
    -------
    SymmetryReport
        Where the worst change happens, and which motions leave the cost alone.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> region = Region.of(SE2, n_controls=2)
    >>> check_stage_cost(lambda x, u: u @ u, region=region).holds
    True
    >>> check_stage_cost(lambda x, u: x[0] ** 2 + x[1] ** 2, region=region).intact
    ('rotation',)
    """
    return _check("stage cost", stage_cost, region, rng, samples, tolerance)


def check_constraint(
    constraint: StateControlFunction,
    *,
    region: Region,
    rng: np.random.Generator | None = None,
    samples: int = 100,
    tolerance: float = 1e-9,
) -> SymmetryReport:
    """Whether a constraint ``g(x, u) <= 0``, of one or more rows, has the same value when moved.

    Source: the paper, Def. 7. Parameters and result are those of `check_stage_cost`.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> region = Region.of(SE2, n_controls=2)
    >>> report = check_constraint(lambda x, u: [u[0] - 1.0, x[1] - 3.0], region=region)
    >>> report.components
    ('constraint 2',)
    """
    return _check("constraint", constraint, region, rng, samples, tolerance)


def check_boundary_condition(
    boundary_condition: BoundaryFunction,
    *,
    region: Region,
    rng: np.random.Generator | None = None,
    samples: int = 100,
    tolerance: float = 1e-9,
) -> SymmetryReport:
    """Whether a boundary condition ``r(x_0, x_T) = 0`` stays the same when both ends are moved.

    A fixed start or goal never does; `shifted_problem` moves it along.

    Source: the paper, Def. 7. Parameters are those of `check_stage_cost`; the state of the report
    is the pair of ends (2, n_x).

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> region = Region.of(SE2, n_controls=2)
    >>> def distance(first, last):
    ...     return np.hypot(*(last - first)[:2]) - 3.0
    >>> check_boundary_condition(distance, region=region).holds
    True
    """

    def defect(by: LieGroup, state: Array, control: Array) -> tuple[Array, float]:
        here = values_of("r(x_0, x_T)", boundary_condition(state[0], state[1]))
        first, last = moved_state(by, state)
        change = values_of("r(x_0, x_T)", boundary_condition(first, last)) - here
        return change, float(np.abs(here).max(initial=0.0))

    return examine(
        _question("boundary condition"),
        defect,
        region=region,
        draw=lambda rng: (np.array([region.state(rng), region.state(rng)]), NOWHERE),
        rng=rng,
        samples=samples,
        tolerance=tolerance,
    )


def _check(
    what: str,
    function: StateControlFunction,
    region: Region,
    rng: np.random.Generator | None,
    samples: int,
    tolerance: float,
) -> SymmetryReport:
    def defect(by: LieGroup, state: Array, control: Array) -> tuple[Array, float]:
        here = values_of(what, function(state, control))
        change = values_of(what, function(moved_state(by, state), control)) - here
        return change, float(np.abs(here).max(initial=0.0))

    return examine(
        _question(what),
        defect,
        region=region,
        draw=lambda rng: (region.state(rng), region.control(rng)),
        rng=rng,
        samples=samples,
        tolerance=tolerance,
    )


def _question(what: str) -> Question:
    def cause(broken: tuple[str, ...], violated: tuple[int, ...]) -> str:
        place = any(motion.startswith(("translation", "climb")) for motion in broken)
        depends = "the place" if place else "a direction of the world"
        return f"it depends on {depends}: shift its references along with the problem"

    return Question(
        what=what,
        names=lambda i: "value" if what == "stage cost" else f"{what} {i + 1}",
        units=lambda i: "",
        cause=cause,
    )
