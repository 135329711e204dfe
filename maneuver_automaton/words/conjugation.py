"""Words with displacements as words without: twists and goals seen from before all of them."""

from __future__ import annotations

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import group_of
from maneuver_automaton.groups.chain import chained


def conjugated(twists: Array, displacements: Array) -> tuple[Array, Array]:
    """Twists (n, dof) seen from before all `displacements`, and the product of these (dof,).

    `displacements` are (n - 1, dof), one between each two trims, or (n, dof), one after each.

    Source: ``D exp(xi) = exp(Ad(D) xi) D``; Solà, Deray, Atchuthan (2018), Eq. (30).

    Examples
    --------
    >>> quarter = np.array([[1.0, 0.0, np.pi / 2]])
    >>> seen, product = conjugated(np.array([[1.0, 0, 0], [1.0, 0, 0]]), quarter)
    >>> seen.round(9).tolist(), product.round(3).tolist()
    ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [1.0, 0.0, 1.571])
    """
    n, dof = twists.shape
    before = chained(np.zeros(dof), displacements)
    adjoints = group_of(dof)(before[:n]).adjoint()
    return np.asarray((adjoints @ twists[:, :, None])[:, :, 0]), before[-1]


def conjugated_turn(product: Array) -> Array:
    """Twist (dof,) of a turn in place after all displacements, seen from before them."""
    turn = np.zeros(product.size)
    turn[2] = 1.0
    return np.asarray(group_of(product.size)(product).adjoint() @ turn)


def goal_before(goal: Array, product: Array) -> Array:
    """Where a word without its displacements has to end, for one with them to end at `goal`."""
    group = group_of(goal.size)
    return (group(goal) @ group(product).inverse()).pose
