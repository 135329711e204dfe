"""Whether a plan is what the model's equations lead to, within the model's limits.

No group formula, no trim and no closed form of the search is used: an ODE solver drives the plan
again under its controls.
"""

from __future__ import annotations

import math

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.audit.stretches import Stretches
from maneuver_automaton.automaton import Plan
from maneuver_automaton.models import Model
from maneuver_automaton.models.state import vector_field

LIMIT_TOLERANCE = 1e-9  # relative to the limit, at least to 1, by which a value may exceed it
STATE_TOLERANCE = 1e-9  # [model's units] of the first and the last reduced state


def defect_of(driven: Stretches, model: Model) -> float:
    """How far the model's equations lead from sample to sample of the plan, added up.

    Each stretch begins at the plan's own pose. All are driven at once, every one in its own unit of
    time, so that the solver takes a few steps for the whole plan.

    Source: Hairer, Nørsett, Wanner (1993), *Solving Ordinary Differential Equations I*, Sec. II.5
    (Dormand-Prince 8(5,3), by SciPy).
    """
    from scipy.integrate import solve_ivp

    if not driven.lengths.size:
        return 0.0
    dof = driven.begins.shape[1]
    begins, ends = driven.begins.copy(), driven.ends.copy()
    places = [0, 1, *range(3, dof)]
    ends[:, places] -= begins[:, places]
    begins[:, places] = 0.0
    start = np.concatenate([begins, driven.states], axis=1)
    f = vector_field(model)

    def rates(_: float, states: Array) -> Array:
        return (f(states.reshape(start.shape), driven.controls) * driven.lengths[:, None]).ravel()

    solution = solve_ivp(rates, (0.0, 1.0), start.ravel(), method="DOP853", rtol=1e-11, atol=1e-12)
    if not solution.success:
        raise ValueError(
            f"audit: the solver stopped at {solution.t[-1]:.6g} of 1: {solution.message}"
        )
    reached = solution.y[:, -1].reshape(start.shape)
    expected = np.concatenate([ends, driven.end_states], axis=1)
    jumps = np.abs(driven.states[1:] - driven.end_states[:-1])
    return float(
        np.abs(reached - expected).max(axis=1).sum() + jumps.max(axis=1, initial=0.0).sum()
    )


def beyond_limits(driven: Stretches, model: Model) -> list[str]:
    """What exceeds a limit of the model, and by how much."""
    reasons: list[str] = []
    if not driven.lengths.size:
        return reasons
    for names, limits, rows in (
        (model.reduced_names, model.reduced_limits, (driven.states, driven.end_states)),
        (model.control_names, model.control_limits, (driven.controls,)),
    ):
        for k, (name, (low, high)) in enumerate(zip(names, limits, strict=True)):
            values = np.concatenate([row[:, k] for row in rows])
            excess = max(
                float((values - high).max(initial=0.0)), float((low - values).max(initial=0.0))
            )
            size = max([1.0, *(abs(limit) for limit in (low, high) if math.isfinite(limit))])
            if excess > LIMIT_TOLERANCE * size:
                reasons.append(f"{name} is {excess:.3g} beyond its limits [{low:.6g}, {high:.6g}]")
    return reasons


def wrong_ends(plan: Plan, states: tuple[Array, Array]) -> list[str]:
    """How far the first and last reduced states are from what they must be."""
    if not plan.trims:
        return []
    reasons = []
    ends = (("begins", plan.trims[0], states[0]), ("ends", plan.trims[-1], states[1]))
    for what, trim, expected in ends:
        off = float(np.abs(trim.reduced_state - expected).max(initial=0.0))
        if off > STATE_TOLERANCE:
            reasons.append(f"it {what} in trim {trim.name!r}, {off:.3g} off the reduced state")
    return reasons
