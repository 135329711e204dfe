"""How fast a vehicle may be: at all, by intervals, and in a curve, by its lateral acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.models.model import Model, as_stated

STANDING = 1e-3  # [m/s] slower is to stand
TURNED = 1e-9  # [rad] between two samples, that is no rounding
EXCEEDED = 1e-9  # relative, by which a limit may be exceeded


def standing_price(model: Model, states: Array, controls: Array) -> float:
    """Price of steering while it stands, along samples of state (n, n_z) and control; or inf.

    Zero for a vehicle that steers at rest at will, whose wheels turn at once, or that has none.
    """
    price = getattr(model, "steering_at_rest", 0.0)
    if not price:
        return 0.0
    speeds, angles = model.steered(states, controls)  # type: ignore[attr-defined]  # has a price
    turned = np.abs(np.diff(angles))[speeds <= STANDING]
    angle = float(turned[turned > TURNED].sum())
    return float(price * angle) if angle else 0.0


def steers_at_rest(model: Model) -> bool:
    """Whether the vehicle may turn its wheels while it stands, if it has any."""
    return not math.isinf(getattr(model, "steering_at_rest", 0.0))


def lateral_limit(model: Model) -> float:
    """Greatest lateral acceleration of a vehicle [m/s^2]; infinite where it has no limit."""
    most = getattr(model, "max_lateral_acceleration", None)
    return math.inf if most is None else float(most)


def lateral_acceleration(twists: Array) -> Array:
    """Speed times turn rate (...,) [m/s^2] of body velocities (..., dof)."""
    return np.asarray(np.linalg.norm(twists[..., :2], axis=-1) * np.abs(twists[..., 2]))


def is_too_sharp(model: Model, twists: Array) -> NDArray[np.bool_]:
    """Whether body velocities (..., dof) exceed the lateral acceleration of a vehicle (...,)."""
    most = lateral_limit(model)
    if math.isinf(most):  # its twists may have no turn rate at all
        return np.zeros(twists.shape[:-1], dtype=np.bool_)
    return np.asarray(lateral_acceleration(twists) > most * (1.0 + EXCEEDED))


def pace_within(model: Model, twist: Array) -> float:
    """By how much a body velocity (dof,) may be driven faster within the lateral limit."""
    most = lateral_limit(model)
    across = 0.0 if math.isinf(most) else float(lateral_acceleration(twist))
    return math.sqrt(most / across) if across > 0.0 else math.inf


def greatest_speed(model: Model, *, axes: tuple[int, ...] = (0, 1, 3)) -> float:
    """An upper bound of the speed [m/s] along some axes of the body, within a model's limits.

    All of them if left out, climb included.

    Infinite where a limit is missing, or where the velocity is made of functions that intervals
    do not know.

    Source: Moore, Kearfott, Cloud (2009), *Introduction to Interval Analysis*, Ch. 5: the value of
    an expression on intervals contains all its values.
    """
    seen, model = model, as_stated(model)  # as fast seen from the world as from its body
    up = 3 if seen is model else 2  # translations have no heading
    state = [Interval(low, high) for low, high in model.reduced_limits.tolist()]
    control = [Interval(low, high) for low, high in model.control_limits.tolist()]
    try:
        velocity = model.velocity(state, control)
        numbered = [(3 if k == up else k, one) for k, one in enumerate(velocity)]
        sides = [_interval(one).size for k, one in numbered if k in axes]
    except (TypeError, AttributeError, ZeroDivisionError):
        return math.inf
    fastest = math.hypot(*sides)
    return fastest if not math.isnan(fastest) else math.inf


@dataclass(frozen=True, slots=True)
class Interval:
    """All numbers from `low` to `high`; operations contain every result they may have."""

    low: float
    high: float

    @property
    def size(self) -> float:
        """Greatest absolute value."""
        return max(abs(self.low), abs(self.high))

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __add__(self, other: Interval | float) -> Interval:
        more = _interval(other)
        return Interval(self.low + more.low, self.high + more.high)

    def __sub__(self, other: Interval | float) -> Interval:
        return self + -_interval(other)

    def __rsub__(self, other: float) -> Interval:
        return _interval(other) - self

    def __mul__(self, other: Interval | float) -> Interval:
        by = _interval(other)
        ends = [_times(a, b) for a in (self.low, self.high) for b in (by.low, by.high)]
        return Interval(min(ends), max(ends))

    def __truediv__(self, other: Interval | float) -> Interval:
        by = _interval(other)
        if by.low <= 0.0 <= by.high:
            return Interval(-math.inf, math.inf)
        return self * Interval(1.0 / by.high, 1.0 / by.low)

    __radd__ = __add__
    __rmul__ = __mul__

    def sin(self) -> Interval:
        """What `np.sin` of an interval asks for."""
        return Interval(-1.0, 1.0)

    def cos(self) -> Interval:
        """What `np.cos` of an interval asks for."""
        return Interval(-1.0, 1.0)

    def tan(self) -> Interval:
        """What `np.tan` of an interval asks for."""
        if self.size < math.pi / 2.0:
            return Interval(math.tan(self.low), math.tan(self.high))
        return Interval(-math.inf, math.inf)


def _interval(value: Interval | float) -> Interval:
    return value if isinstance(value, Interval) else Interval(float(value), float(value))


def _times(a: float, b: float) -> float:
    """A product in which zero times infinity is zero: a limit that is zero stays zero."""
    return 0.0 if a == 0.0 or b == 0.0 else a * b
