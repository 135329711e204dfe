"""What the vehicles of the package share: arrays from formulas by component, and limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, plain_numbers
from maneuver_automaton.groups import SE2, LieGroup

Components = Sequence[Any] | Array
"""Components of a reduced state or control: each a number, an array of numbers, or a symbol."""

ComponentFunction = Callable[[Components, Components], Components]
"""``f(z, u)``, component by component, in Python's arithmetic and NumPy's functions."""


class Vehicle:
    """All that follows once `velocity` and `dynamics` are stated by components.

    A vehicle derived from it moves in the plane, has no reduced state and carries nothing, unless
    it says so.
    """

    __slots__ = ()
    name: ClassVar[str]
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]]
    reduced_names: ClassVar[tuple[str, ...]] = ()
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        check_parameters(self)

    @property
    def reduced_limits(self) -> Array:
        """No reduced state: (0, 2)."""
        return np.zeros((0, 2))

    def velocity(self, z: Components, u: Components, /) -> Components:
        """Components of the twist xi(z, u), in the order of the pose."""
        raise NotImplementedError

    def dynamics(self, z: Components, u: Components, /) -> Components:
        """Rates of the components of the reduced state; none: ()."""
        return ()

    def part_frames(self, z: Components, /) -> tuple[tuple[Any, Any, Any], ...]:
        """Components of the pose of each part that it carries, seen from the vehicle; none: ()."""
        return ()

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., dof) in the body frame, in the order of the pose; see `velocity`."""
        return self._on_arrays(self.velocity, reduced_state, control, self.group.dof)

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rates (..., n_z) of the reduced state per second; see `dynamics`."""
        return self._on_arrays(self.dynamics, reduced_state, control, len(self.reduced_names))

    def part_poses(self, reduced_state: Array) -> Array:
        """Planar poses (..., n, 3) of what it carries, seen from the vehicle; see `part_frames`."""
        if not self.part_names:
            return no_parts(reduced_state)
        z = as_array("reduced state", reduced_state, last=len(self.reduced_names))
        frames = self.part_frames(np.moveaxis(z, -1, 0))
        return np.stack([np.stack(frame, axis=-1) for frame in frames], axis=-2)

    def _on_arrays(
        self, function: ComponentFunction, reduced_state: ArrayLike, control: ArrayLike, n: int
    ) -> Array:
        """Values (..., n) of a formula on batches of reduced states and controls."""
        z = as_array("reduced state", reduced_state, last=len(self.reduced_names))
        u = as_array("control", control, last=len(self.control_names))
        result = np.empty((*np.broadcast_shapes(z.shape[:-1], u.shape[:-1]), n))
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


def check_at_rest(vehicle: Any) -> None:
    """Refuse a price of steering at rest that is none; raises ValueError."""
    if not vehicle.steering_at_rest >= 0.0:
        raise ValueError(
            f"{vehicle.name}: steering_at_rest must be at least 0, or inf, got "
            f"{vehicle.steering_at_rest} 1/rad"
        )


def check_parameters(vehicle: Any, *, but: Sequence[str] = ()) -> None:
    """Make the parameters plain numbers, all positive but least speeds and those in `but`.

    Where None is allowed it is left as it is. Wheels that can be turned across are refused too,
    and a least speed that is not below the greatest.
    """
    plain_numbers(vehicle)
    for name in (one.name for one in fields(vehicle)):
        value = getattr(vehicle, name)
        unsigned = name in but or name.startswith("min_")
        if value is not None and not unsigned and not 0.0 < value < math.inf:
            raise ValueError(f"{vehicle.name}: {name} must be positive, got {value}")
    steering = getattr(vehicle, "max_steering", None)
    if steering is not None and not steering < math.pi / 2:
        raise ValueError(
            f"{vehicle.name}: max_steering must be less than pi / 2, got {steering} rad"
        )
    if hasattr(vehicle, "min_speed"):
        speed_limits(vehicle.name, vehicle.min_speed, vehicle.max_speed)


def speed_limits(
    owner: str, least: float | None, greatest: float, *, what: str = "speed", unit: str = "m/s"
) -> tuple[float, float]:
    """Least and greatest speed; a least one of None is as fast in reverse."""
    if least is None:
        return -greatest, greatest
    if not -math.inf < least < greatest:
        raise ValueError(
            f"{owner}: min_{what} must be less than max_{what} {greatest} {unit}, "
            f"got {least} {unit}"
        )
    return least, greatest


def rows_of_limits(*greatest: float | tuple[float, float] | None) -> Array:
    """(n, 2): pairs as they are, of a number its negative and itself; None is no limit."""
    pairs = [
        one if isinstance(one, tuple) else (-one, one) if one is not None else UNLIMITED
        for one in greatest
    ]
    return np.array(pairs, dtype=np.float64)


UNLIMITED = (-math.inf, math.inf)


def limits_of(what: str, limits: ArrayLike, *, names: Sequence[str]) -> Array:
    """Read-only limits (n, 2), one row for each name, from rows or from one row for all."""
    array = np.asarray(limits, dtype=np.float64)
    if array.shape != (2,) and array.shape != (len(names), 2):
        raise ValueError(
            f"{what}: got shape {array.shape}, need ({len(names)}, 2): least and greatest "
            f"{', '.join(names) or '(nothing)'}"
        )
    array = np.broadcast_to(array, (len(names), 2)).copy()
    for name, (low, high) in zip(names, array, strict=True):
        if not low <= high:
            raise ValueError(f"{what}: {name} needs least <= greatest, got ({low:.6g}, {high:.6g})")
    array.setflags(write=False)
    return array
