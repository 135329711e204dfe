"""The whole state of a vehicle, pose and then reduced state: what moves it, and its simulation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.models.model import Model

VectorField = Callable[[Array, Array], ArrayLike]
"""``f(x, u)``: rates (n_x,) of one state x (n_x,), pose first, under one control u (n_u,)."""


def vector_field(model: Model) -> Callable[[Array, Array], Array]:
    """Differential equation ``x' = f(x, u)`` of a model, on states (..., dof + n_z).

    Source: g' = g xi(z, u), z' = f(z, u).

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> f = vector_field(Unicycle())
    >>> f(np.array([3.0, 1.0, np.pi / 2]), np.array([2.0, 0.5])).round(3).tolist()
    [0.0, 2.0, 0.5]
    """
    dof = model.group.dof
    n_states, n_controls = dof + len(model.reduced_names), len(model.control_names)

    def rates(state: Array, control: Array) -> Array:
        state = as_array("state", state, last=n_states)
        control = as_array("control", control, last=n_controls)
        twist = model.body_velocity(state[..., dof:], control)
        pose_rates = model.group(state[..., :dof]).pose_rates(twist)
        reduced_rates = model.reduced_dynamics(state[..., dof:], control)
        batch = pose_rates.shape[:-1]
        reduced_rates = np.broadcast_to(reduced_rates, (*batch, reduced_rates.shape[-1]))
        return np.concatenate([pose_rates, reduced_rates], axis=-1)

    return rates


def moved_state(by: LieGroup, state: ArrayLike) -> Array:
    """States (..., n_x) moved by group elements: the action Psi on pose and reduced state.

    Source: the paper, Def. 2; for the mobile robot its Prop. 3.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> moved_state(SE2([1.0, 1.0, np.pi / 2]), [2.0, 0.0, 0.0, 7.0]).round(3).tolist()
    [1.0, 3.0, 1.571, 7.0]
    """
    state = as_array("state", state)
    pose, rest = np.split(state, [by.dof], axis=-1)
    moved = (by @ type(by)(pose)).pose
    return np.concatenate([moved, np.broadcast_to(rest, (*moved.shape[:-1], rest.shape[-1]))], -1)


def moved_rates(by: LieGroup, state: ArrayLike, *, rates: ArrayLike) -> Array:
    """Rates (..., n_x) of a state, seen after the state was moved: the lifted action.

    Source: the paper, remark on an alternative characterization of symmetry groups.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> quarter_turn = SE2([0.0, 0.0, np.pi / 2])
    >>> moved_rates(quarter_turn, [2.0, 0.0, 0.0], rates=[1.0, 0.0, 0.1]).round(3).tolist()
    [0.0, 1.0, 0.1]
    """
    group, state, rates = type(by), as_array("state", state), as_array("rates", rates)
    here = group(state[..., : by.dof])
    pose_rates = (by @ here).pose_rates(here.body_twist(rates[..., : by.dof]))
    rest = np.broadcast_to(rates[..., by.dof :], (*pose_rates.shape[:-1], rates.shape[-1] - by.dof))
    return np.concatenate([pose_rates, rest], axis=-1)


def equivariance_defect(
    f: VectorField, by: LieGroup, *, state: ArrayLike, control: ArrayLike
) -> Array:
    """How far a vector field is from commuting with a move, at one state: (n_x,), zero if it does.

    It is ``f(Psi_g x, u) - dPsi_g f(x, u)``, in the units of the rates.

    Source: the paper, remark on an alternative characterization of symmetry groups.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> def drifting(x, u):  # a wind of 0.3 m/s along the world's x axis
    ...     return [u[0] * np.cos(x[2]) + 0.3, u[0] * np.sin(x[2]), u[1]]
    >>> half_turn = SE2([0.0, 0.0, np.pi])
    >>> defect = equivariance_defect(drifting, half_turn, state=np.zeros(3), control=[1.0, 0.0])
    >>> (defect.round(9) + 0.0).tolist()
    [0.6, 0.0, 0.0]
    """
    state, control = as_array("state", state), as_array("control", control)
    here = as_array("f(x, u)", f(state, control), last=state.size)
    there = as_array("f(x, u)", f(moved_state(by, state), control), last=state.size)
    return there - moved_rates(by, state, rates=here)


def rollout(
    model: Model | VectorField,
    start: ArrayLike,
    *,
    control: ArrayLike | Callable[[float], ArrayLike],
    times: ArrayLike,
    rtol: float = 1e-9,
    atol: float = 1e-9,
) -> Array:
    """States at `times` of a model, or of a plain ``f(x, u)``, that starts at `start`.

    Source: Hairer, Nørsett, Wanner (1993), *Solving Ordinary Differential Equations I*, Sec. II.5
    (Dormand-Prince 8(5,3), by SciPy).

    Parameters
    ----------
    model : Model or callable
        The vehicle, or its vector field ``f(x, u)``.
    start : (n_x,) array
        State at the first time: pose, then reduced state.
    control : (n_u,) array or callable
        A constant control, or a function of time [s]. Where it jumps, start a new rollout.
    times : (n,) array
        Increasing times [s]; the first is that of `start`.
    rtol, atol : float
        Relative and absolute tolerance of the solver [-, units of the state].

    Returns
    -------
    (n, n_x) array
        State at each time.

    Raises
    ------
    ValueError
        If the times do not increase, or the solver cannot reach the last one.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> circle = rollout(Unicycle(), np.zeros(3), control=[1.0, 1.0], times=[0.0, np.pi])
    >>> (circle[-1].round(3) + 0.0).tolist()
    [0.0, 2.0, 3.142]
    """
    from scipy.integrate import solve_ivp

    f = model if callable(model) else vector_field(model)
    times, start = as_array("times", times), as_array("start", start)
    if times.ndim != 1 or times.size < 1 or np.any(np.diff(times) <= 0.0):
        raise ValueError(f"rollout: times must be increasing, got {times}")
    if times.size == 1:
        return start[None].copy()
    constant = np.zeros(0) if callable(control) else as_array("control", control)

    def rates(time: float, state: Array) -> Array:
        u = as_array("control", control(time)) if callable(control) else constant
        return as_array("f(x, u)", f(state, u))

    if not np.isfinite(rates(times[0], start)).all():
        raise ValueError(f"rollout: the model's rates at {start} are not finite")
    span = (times[0], times[-1])
    solution = solve_ivp(rates, span, start, method="DOP853", t_eval=times, rtol=rtol, atol=atol)
    if not solution.success:
        stopped = f"{solution.t[-1]:.6g} s of {times[-1]:.6g} s: {solution.message}"
        raise ValueError(f"rollout: the solver stopped at {stopped}")
    return np.asarray(solution.y.T, dtype=np.float64)
