"""The optimal control problem, the grid and rule it is put on, and a first guess: all as values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np

from maneuver_automaton._arrays import Array, check_fields, freeze
from maneuver_automaton.groups import SE2, LieGroup, SE2xR
from maneuver_automaton.models import Model
from maneuver_automaton.models.vehicle import Components
from maneuver_automaton.models.vehicle import limits_of as checked_limits

Rates = Callable[[Components, Components], Components]
"""``f(x, u)``: the rate of each component of the state."""

RunningCost = Callable[[Components, Components], Any]
"""``l(x, u)``: a cost per second."""

Rule = Literal["trapezoidal", "rk4"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OptimalControlProblem:
    """Least ``terminal_cost(x(T)) + integral of stage_cost(x, u)`` for ``x' = dynamics(x, u)``.

    The functions get the components of one state and of one control, and use Python's
    arithmetic and NumPy's functions on them, component by component. So they serve symbols, for
    the solver, and numbers, for the check of what the solver says.

    Source: the paper, Sec. 3.1.

    Parameters
    ----------
    state_names, control_names : tuple of str
        Names of the n_x components of the state and of the n_u controls.
    dynamics : callable
        ``f(x, u)``: the n_x rates [per second]; see `moving_frame` for those of a vehicle.
    start, end : sequences of n_x numbers
        First and last state; None leaves a component free.
    duration : (float, float)
        Least and greatest final time [s]; equal if it is fixed.
    stage_cost : callable, optional
        ``l(x, u)``: cost per second; ``lambda x, u: 1.0`` asks for the least time.
    terminal_cost : callable, optional
        ``m(x)``: cost of the last state.
    integrals : mapping of str to callable
        What else to integrate along the solution, by the same rule; no part of the optimisation.
    state_limits, control_limits : (n, 2) arrays, optional
        Least and greatest values at every node; infinite where there is no limit.

    Examples
    --------
    >>> cart = OptimalControlProblem(
    ...     state_names=("position", "speed"), control_names=("push",),
    ...     dynamics=lambda x, u: [x[1], u[0]], stage_cost=lambda x, u: u[0] ** 2,
    ...     start=(0.0, 0.0), end=(1.0, None), duration=(2.0, 2.0))
    >>> cart.n_states, cart.end[1] is None
    (2, True)
    """

    state_names: tuple[str, ...]
    control_names: tuple[str, ...]
    dynamics: Rates
    start: tuple[float | None, ...]
    end: tuple[float | None, ...]
    duration: tuple[float, float]  # [s]
    stage_cost: RunningCost | None = None
    terminal_cost: Callable[[Components], Any] | None = None
    integrals: Mapping[str, RunningCost] = field(default_factory=dict)
    state_limits: Array | None = None  # (n_x, 2)
    control_limits: Array | None = None  # (n_u, 2)

    def __post_init__(self) -> None:
        for name, names in (("state", self.state_names), ("control", self.control_names)):
            object.__setattr__(self, f"{name}_names", tuple(names))
            if (limits := getattr(self, f"{name}_limits")) is not None:
                limits = checked_limits(f"optimal control: {name}_limits", limits, names=names)
                object.__setattr__(self, f"{name}_limits", limits)
        for name in ("start", "end"):
            state = tuple(None if v is None else float(v) for v in getattr(self, name))
            object.__setattr__(self, name, self._inside(name, state))
        low, high = (float(seconds) for seconds in self.duration)
        if not (0.0 < low <= high and math.isfinite(high)):
            raise ValueError(
                f"optimal control: duration must be 0 < least <= greatest, got ({low}, {high}) s"
            )
        object.__setattr__(self, "duration", (low, high))
        object.__setattr__(self, "integrals", dict(self.integrals))
        if self.stage_cost is None and self.terminal_cost is None:
            raise ValueError("optimal control: got no cost, need stage_cost or terminal_cost")

    def _inside(self, what: str, state: tuple[float | None, ...]) -> tuple[float | None, ...]:
        if len(state) != self.n_states:
            raise ValueError(
                f"optimal control: {what} has {len(state)} components, need {self.n_states} "
                f"({', '.join(self.state_names)})"
            )
        for name, value, (low, high) in zip(
            self.state_names, state, limits_of(self.state_limits, self.n_states), strict=True
        ):
            if value is not None and not (math.isfinite(value) and low <= value <= high):
                raise ValueError(
                    f"optimal control: {what}: {name} = {value:.6g} is outside "
                    f"[{low:.6g}, {high:.6g}]"
                )
        return state

    @property
    def n_states(self) -> int:
        """Components of the state."""
        return len(self.state_names)

    @property
    def n_controls(self) -> int:
        """Number of controls."""
        return len(self.control_names)


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeGrid:
    """Where the problem is looked at: equidistant nodes, and the rule that joins them.

    Examples
    --------
    >>> TimeGrid(n_nodes=50).n_controls, TimeGrid(n_nodes=50, rule="rk4").n_controls
    (50, 49)
    """

    n_nodes: int
    rule: Rule = "trapezoidal"  # controls at the nodes; "rk4": constant between them
    held: int = 1  # with "rk4", the steps from node to node in which one control holds

    def __post_init__(self) -> None:
        check_fields("grid", self, "n_nodes", least=2)
        if self.rule not in get_args(Rule):
            raise ValueError(f"grid: rule must be {' or '.join(get_args(Rule))}, got {self.rule!r}")

    @property
    def n_controls(self) -> int:
        """Instants or intervals that have a control."""
        return self.n_nodes if self.rule == "trapezoidal" else (self.n_nodes - 1) // self.held


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Guess:
    """Where the solver begins: states and controls at equidistant instants, as many as one likes.

    They are interpolated to the grid, so the solution on a coarse grid is a guess for a fine one.

    Examples
    --------
    >>> guess = Guess(state=[[0.0], [2.0]], control=[[1.0]], duration=2.0)
    >>> resampled(guess.state, 5).ravel().tolist()
    [0.0, 0.5, 1.0, 1.5, 2.0]
    """

    state: Array  # (m, n_x)
    control: Array  # (m, n_u)
    duration: float  # [s]

    def __post_init__(self) -> None:
        for name in ("state", "control"):
            freeze(self, name)
            if getattr(self, name).ndim != 2 or not len(getattr(self, name)):
                raise ValueError(
                    f"guess: {name} has shape {getattr(self, name).shape}, need at least one row, "
                    "one for each instant"
                )
        check_fields("guess", self, "duration", unit="s")

    @classmethod
    def of_motion(cls, times: Array, *, known: Array, state: Array, control: Array) -> Guess:
        """The guess at `times` (n,) [s] from a motion at `known` ones (m,), from 0 to its end."""
        rows = np.stack([np.interp(times, known, column) for column in state.T], axis=1)
        which = np.searchsorted(known, times[:-1], side="right") - 1
        held = control[np.clip(which, 0, len(known) - 2)]
        return cls(state=rows, control=held, duration=float(known[-1]))


def straight_guess(problem: OptimalControlProblem) -> Guess:
    """States in a straight line from start to end, free components held, no control.

    Examples
    --------
    >>> fall = OptimalControlProblem(
    ...     state_names=("height",), control_names=("u",), dynamics=lambda x, u: [u[0]],
    ...     start=(2.0,), end=(0.0,), duration=(1.0, 3.0), stage_cost=lambda x, u: 1.0)
    >>> straight_guess(fall).state.ravel().tolist(), straight_guess(fall).duration
    ([2.0, 0.0], 2.0)
    """
    pairs = list(zip(problem.start, problem.end, strict=True))
    first = [a if a is not None else b if b is not None else 0.0 for a, b in pairs]
    last = [b if b is not None else a for a, b in zip(first, problem.end, strict=True)]
    return Guess(
        state=np.array([first, last]),
        control=np.zeros((1, problem.n_controls)),
        duration=sum(problem.duration) / 2.0,
    )


def resampled(rows: Array, count: int) -> Array:
    """Rows (count, n) at equidistant instants, interpolated from rows (m, n) at such."""
    places = np.linspace(0.0, 1.0, len(rows))
    at = np.linspace(0.0, 1.0, count)
    return np.stack([np.interp(at, places, column) for column in rows.T], axis=-1)


def limits_of(limits: Array | None, count: int) -> Array:
    """Limits (count, 2), infinite if there are none."""
    return np.tile([-np.inf, np.inf], (count, 1)) if limits is None else limits


Field = Callable[[Any, Any], Any]
"""Rates (m, n) of states (n_x, n) under controls (n_u, n), matrices of numbers or of symbols.

The first n_x rates are those of the state; the others are integrands that ride along."""


def increments(rule: Rule, field: Field, *, state: Any, control: Any, step: Any) -> Any:
    """What each rate adds up to over each interval (m, n - 1), with `step` [s] between nodes.

    Source: Betts (2010), *Practical Methods for Optimal Control*, Sec. 3.4 (trapezoidal), Sec. 3.5
    (Runge-Kutta).

    `state`: at the n nodes. `control`: there too (n_u, n), or constant over the n - 1 intervals
    (n_u, n - 1), as the rule has it.
    """
    if rule == "trapezoidal":
        rates = field(state, control)
        return (step / 2.0) * (rates[:, :-1] + rates[:, 1:])
    n_states, begin = state.shape[0], state[:, :-1]
    k_1 = field(begin, control)
    k_2 = field(begin + (step / 2.0) * k_1[:n_states, :], control)
    k_3 = field(begin + (step / 2.0) * k_2[:n_states, :], control)
    k_4 = field(begin + step * k_3[:n_states, :], control)
    return (step / 6.0) * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)


def moving_frame(
    group: type[LieGroup],
    *,
    velocity: Callable[[Components, Components], Any],
    reduced: Callable[[Components, Components], Any] | None = None,
) -> Rates:
    """Rates of the state (pose, reduced state) of a vehicle: ``g' = g xi(z, u), z' = f(z, u)``.

    The models of the package work on arrays; the solver needs the same formulas on symbols, and
    the tests compare the two. For a `UserModel` they are its `velocity` and `dynamics`.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. II; the paper, Example 1.

    Parameters
    ----------
    group : type[LieGroup]
        SE(2) or SE(2) x R.
    velocity : callable
        ``xi(z, u)``: the twist (dof) in the body frame, component by component.
    reduced : callable, optional
        ``f(z, u)``: rates of the reduced state; none for a kinematic vehicle.

    Raises
    ------
    ValueError
        If the group is another one.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> f = moving_frame(SE2, velocity=lambda z, u: [u[0], 0.0, u[1]])
    >>> [float(rate) for rate in f([3.0, 1.0, 0.0], [2.0, 0.5])]
    [2.0, 0.0, 0.5]
    """
    if group.coordinates not in (SE2.coordinates, SE2xR.coordinates):
        raise ValueError(
            f"moving_frame: got the group {group.__name__} with poses "
            f"({', '.join(group.coordinates)}), need SE2 or SE2xR"
        )
    dof = group.dof

    def rates(state: Components, control: Components) -> list[Any]:
        ahead, aside, *others = velocity(state[dof:], control)
        cosine, sine = np.cos(state[2]), np.sin(state[2])
        drift = [] if reduced is None else reduced(state[dof:], control)
        return [cosine * ahead - sine * aside, sine * ahead + cosine * aside, *others, *drift]

    return rates


def control_scale(model: Model) -> Array:
    """Greatest value (n_u,) of each control by size, 1 where there is no limit."""
    greatest = np.abs(model.control_limits).max(axis=-1)
    return np.where(np.isfinite(greatest) & (greatest > 0.0), greatest, 1.0)
