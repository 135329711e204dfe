"""From formulas on components to arrays: a model states each of its formulas once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array

Components = Sequence[Any] | Array
"""Components of a reduced state or control: each a number, an array of numbers, or a symbol."""

ComponentFunction = Callable[[Components, Components], Components]
"""``f(z, u)``, component by component, in Python's arithmetic and NumPy's functions."""


def on_arrays(
    function: ComponentFunction,
    reduced_state: ArrayLike,
    control: ArrayLike,
    *,
    sizes: tuple[int, int, int],
) -> Array:
    """Values (..., n) of a formula on batches of reduced states (..., n_z), controls (..., n_u).

    `sizes` are n_z, n_u and n.
    """
    n_z, n_u, n = sizes
    z = as_array("reduced state", reduced_state, last=n_z)
    u = as_array("control", control, last=n_u)
    batch = np.broadcast_shapes(z.shape[:-1], u.shape[:-1])
    result = np.empty((*batch, n))
    # `moveaxis` does the same, and takes longer than most formulas.
    components = (a.transpose(a.ndim - 1, *range(a.ndim - 1)) for a in (z, u))
    for k, value in enumerate(function(*components)):
        result[..., k] = value
    return result


def no_rates(z: Components, u: Components, /) -> tuple[()]:
    """Dynamics of a vehicle without a reduced state."""
    return ()


def no_parts(reduced_state: ArrayLike) -> Array:
    """Poses (..., 0, 3) of the parts of a vehicle that carries none."""
    return np.zeros((*np.shape(reduced_state)[:-1], 0, 3))
