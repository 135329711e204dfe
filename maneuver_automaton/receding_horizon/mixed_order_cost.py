"""A stage cost whose orders follow the directions that are hard to drive."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, freeze

MIXED_POSE_ORDERS = (4.0, 2.0, 4.0)
NAMES = ("pose_weights", "control_weights", "pose_orders", "control_orders")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MixedOrderCost:
    """``q1 |x|^a1 + q2 |y|^a2 + q3 |heading|^a3 + sum r_i |u_i|^b_i``, of poses seen from the goal.

    A small offset y to the side is reached by speeds and headings of the size of its square root.
    With orders 4, 2, 4 and controls of order 4 all terms shrink alike, so that driving pays however
    small the offset is; with order 2 throughout it does not.

    Source: Worthmann, Mehrez, Zanon, Mann, Gosine, Diehl (2016), *Model predictive control of
    nonholonomic mobile robots without stabilizing constraints and costs*; why squares fail: Müller,
    Worthmann (2017), *Quadratic costs do not always work in MPC*.

    Parameters
    ----------
    pose_weights : (3,) array
        Positive weights of x, y and heading.
    control_weights : (n_u,) array
        Positive weights of the controls.
    pose_orders : (3,) array
        Exponents of x, y and heading, at least 1.
    control_orders : (n_u,) array, optional
        Exponents of the controls, at least 1; 4 for all if omitted.

    Examples
    --------
    >>> cost = MixedOrderCost(pose_weights=[1.0, 5.0, 0.1], control_weights=[0.5, 0.05])
    >>> cost.rates([0.0, 2.0, 0.0], [1.0, 0.0]).tolist()
    20.5
    """

    pose_weights: Array
    control_weights: Array
    pose_orders: Array = field(default_factory=lambda: np.array(MIXED_POSE_ORDERS))
    control_orders: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if np.size(self.control_orders) == 0:
            object.__setattr__(self, "control_orders", np.full(np.shape(self.control_weights), 4.0))
        for name in NAMES:
            freeze(self, name, last=3 if name.startswith("pose") else None)
            values = getattr(self, name)
            least = 0.0 if name.endswith("weights") else 1.0
            good = values > 0.0 if name.endswith("weights") else values >= 1.0
            if values.ndim != 1 or not good.all():
                need = "positive" if least == 0.0 else "at least 1"
                raise ValueError(f"mixed-order cost: {name} must be {need}, got {values.tolist()}")
        if self.control_orders.shape != self.control_weights.shape:
            raise ValueError(
                f"mixed-order cost: got {self.control_orders.size} control_orders for "
                f"{self.control_weights.size} control_weights, need one each"
            )

    @classmethod
    def quadratic(cls, pose_weights: ArrayLike, control_weights: ArrayLike) -> MixedOrderCost:
        """The usual cost: order 2 throughout.

        Examples
        --------
        >>> MixedOrderCost.quadratic([1, 1, 1], [1, 1]).rates([0, 0, 0], [0.5, 0]).tolist()
        0.25
        """
        weights = as_array("mixed-order cost: control_weights", control_weights)
        return cls(
            pose_weights=as_array("mixed-order cost: pose_weights", pose_weights),
            control_weights=weights,
            pose_orders=np.full(3, 2.0),
            control_orders=np.full(weights.shape, 2.0),
        )

    def pose_rates(self, poses: ArrayLike) -> Array:
        """Cost per second (...,) of being at poses (..., 3) seen from the goal [m, m, rad]."""
        return _weighted(as_array("poses", poses, last=3), self.pose_weights, self.pose_orders)

    def control_rates(self, controls: ArrayLike) -> Array:
        """Cost per second (...,) of controls (..., n_u)."""
        rows = as_array("controls", controls, last=self.control_weights.size)
        return _weighted(rows, self.control_weights, self.control_orders)

    def rates(self, poses: ArrayLike, controls: ArrayLike) -> Array:
        """Cost per second (...,) at poses (..., 3) from the goal, under controls (..., n_u)."""
        return self.pose_rates(poses) + self.control_rates(controls)


def _weighted(values: Array, weights: Array, orders: Array) -> Array:
    """Sum of ``weight |value| ** order`` over the last axis; squares are multiplied out."""
    total = np.zeros(values.shape[:-1])
    for k in range(weights.size):
        column = values[..., k]
        if orders[k] in (2.0, 4.0):
            square = column * column
            total = total + weights[k] * (square if orders[k] == 2.0 else square * square)
        else:
            total = total + weights[k] * np.abs(column) ** orders[k]
    return total
