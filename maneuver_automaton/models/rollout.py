"""Simulation by an ODE solver: slow, and independent of all closed forms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton.models.model import Model
from maneuver_automaton.models.state import VectorField, vector_field


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
    control_at = control if callable(control) else _constant(control)

    def rates(time: float, state: Array) -> Array:
        return as_array("f(x, u)", f(state, as_array("control", control_at(time))))

    if not np.isfinite(rates(times[0], start)).all():
        raise ValueError(f"rollout: the model's rates at {start} are not finite")
    span = (times[0], times[-1])
    solution = solve_ivp(rates, span, start, method="DOP853", t_eval=times, rtol=rtol, atol=atol)
    if not solution.success:
        raise ValueError(
            f"rollout: the solver stopped at {solution.t[-1]:.6g} s of {times[-1]:.6g} s: "
            f"{solution.message}"
        )
    return np.asarray(solution.y.T, dtype=np.float64)


def _constant(control: ArrayLike) -> Callable[[float], Array]:
    value = as_array("control", control)
    return lambda _: value
