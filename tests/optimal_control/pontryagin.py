"""The example of uniform effort by another method: Pontryagin's conditions and shooting.

No grid and no solver of the package: the costates of the unicycle start at three unknown numbers,
which a root finder chooses so that the end is met; the control minimises the Hamiltonian.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

MATRIX = np.array([[4.0, -1.5], [-1.5, 1.0]])
NORM_WEIGHT = 0.1
DURATION = 50.0
START = (0.1, 1.0, 0.8)
NEAR_THE_BEST = (-0.3, 0.4, -0.2)  # costates in x, y and heading

_VALUES, _VECTORS = np.linalg.eigh(MATRIX)


def control_of(slope):
    """Control that minimises ``u'Ru + w |u| + slope u``: zero, or in closed form up to its size."""
    along = _VECTORS.T @ slope
    if np.hypot(*along) <= NORM_WEIGHT:
        return np.zeros(2)
    size = 0.0
    for _ in range(60):  # Newton on 1 / |along / (2 w r + c)| = 1, nearly linear in r
        below = 2.0 * _VALUES * size + NORM_WEIGHT
        total = float(((along / below) ** 2).sum())
        slope_of_total = -2.0 * float((along**2 * 2.0 * _VALUES / below**3).sum())
        step = (total**-0.5 - 1.0) / (-0.5 * total**-1.5 * slope_of_total)
        size = max(size - step, 0.0)
        if abs(step) < 1e-15:
            break
    return _VECTORS @ (-along * size / (2.0 * _VALUES * size + NORM_WEIGHT))


def motion(costates, *, times=None):
    """States (n, 5), x1 to x5, and the last costate (n,), from three first costates."""

    def rates(_, z):
        cosine, sine = math.cos(z[2]), math.sin(z[2])
        along = costates[0] * cosine + costates[1] * sine
        across = costates[0] * sine - costates[1] * cosine
        u = control_of(np.array([along, z[5]]))
        effort = float(u @ MATRIX @ u)
        cost = effort + NORM_WEIGHT * math.hypot(*u)
        return [u[0] * cosine, u[0] * sine, u[1], cost, effort, u[0] * across]

    first = [*START, 0.0, 0.0, costates[2]]
    grid = [0.0, DURATION] if times is None else times
    solution = solve_ivp(
        rates, (0.0, DURATION), first, method="DOP853", rtol=1e-10, atol=1e-11, t_eval=grid
    )
    return solution.y[:5].T, solution.y[5]


def extremal(costates=NEAR_THE_BEST):
    """First costates (3,) of the extremal near the given ones, None if the root finder fails."""
    found = root(lambda guess: motion(guess)[0][-1, :3], costates, tol=1e-11)
    missed = np.abs(motion(found.x)[0][-1, :3]).max()
    return found.x if missed < 1e-7 else None


def controls_along(costates, times):
    """Controls (n, 2) of an extremal at `times`."""
    states, last = motion(costates, times=times)
    heading = states[:, 2]
    along = costates[0] * np.cos(heading) + costates[1] * np.sin(heading)
    return np.array([control_of(slope) for slope in np.stack([along, last], axis=-1)])
