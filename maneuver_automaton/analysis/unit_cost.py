"""The unit cost of a trim: what coasting costs per second, the same at every instant."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, vector_text
from maneuver_automaton.errors import BrokenSymmetry, NotATrim
from maneuver_automaton.models import Model


def unit_cost(
    stage_cost: Callable[[Array, Array], ArrayLike],
    model: Model,
    *,
    state: ArrayLike,
    control: ArrayLike,
    duration: float = 10.0,
    tolerance: float = 1e-9,
) -> float:
    """Cost per second of the trim that starts at `state` under a constant control.

    An invariant cost is constant along a trim, so coasting for T seconds costs T times this. That
    the cost is constant is checked at 101 instants.

    Source: the paper, Prop. 9.

    Parameters
    ----------
    stage_cost : callable
        ``l(x, u)`` of one state (n_x,), pose first, and one control (n_u,).
    model : Model
        The vehicle.
    state : (n_x,) array
        Pose and reduced state where the trim starts.
    control : (n_u,) array
        Its control, in the model's units.
    duration : float
        How long the trim is followed for the check [s].
    tolerance : float
        Greatest rate of the reduced state and greatest change of the cost admitted, the latter
        relative to the cost (at least 1) [-].

    Returns
    -------
    float
        The cost per second, ``l(x(0), u)``.

    Raises
    ------
    NotATrim
        If the reduced state does not stay where it is.
    BrokenSymmetry
        If the cost changes along the trim.

    Examples
    --------
    >>> from maneuver_automaton.models import Unicycle
    >>> unit_cost(lambda x, u: u @ u, Unicycle(), state=np.zeros(3), control=[1.5, 0.5])
    2.5
    """
    dof, n_controls = model.group.dof, len(model.control_names)
    x = as_array("state", state, last=dof + len(model.reduced_names))
    u = as_array("control", control, last=n_controls)
    rates = model.reduced_dynamics(x[dof:], u)
    if np.any(np.abs(rates) > tolerance):
        worst = int(np.argmax(np.abs(rates)))
        raise NotATrim(
            f"{model.name}: no trim at u = {vector_text(u)}: {model.reduced_names[worst]} changes "
            f"by {rates[worst]:.4g} per second, need 0"
        )
    times = np.linspace(0.0, duration, 101)
    twist = model.body_velocity(x[dof:], u)
    poses = (model.group(x[:dof]) @ model.group.exp(np.multiply.outer(times, twist))).pose
    costs = np.array([float(np.asarray(stage_cost(np.append(p, x[dof:]), u))) for p in poses])
    change = np.abs(costs - costs[0])
    if change.max() > tolerance * max(1.0, abs(costs[0])):
        worst = int(np.argmax(change))
        raise BrokenSymmetry(
            f"stage cost is not constant along the trim u = {vector_text(u)} of the {model.name}: "
            f"{costs[0]:.4g} at the start, {costs[worst]:.4g} after {times[worst]:.4g} s at pose "
            f"{vector_text(poses[worst])}; it depends on the pose, so the trim has no unit cost"
        )
    return float(costs[0])
