"""What the vehicles of the package share: arrays from formulas by component, and limits."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array, check_range, plain_numbers
from maneuver_automaton._limits import SMALLEST
from maneuver_automaton.groups import SE2, LieGroup

Components = Sequence[Any] | Array
"""Components of a reduced state or control: each a number, an array of numbers, or a symbol."""

ComponentFunction = Callable[[Components, Components], Components]
"""``f(z, u)``, component by component, in Python's arithmetic and NumPy's functions."""


_batch = functools.lru_cache(np.broadcast_shapes)  # which takes longer than most formulas
AT_REST = "steering_at_rest"
LIKE = {  # whose limits hold for a component that has none of its own
    "front_steering": "steering",
    "rear_steering": "steering",
    "lateral_tilt": "tilt",
    "lateral_tilt_rate": "tilt_rate",
    "hitch_2": "hitch",
    "hitch_3": "hitch",
}


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
    def control_limits(self) -> Array:
        """Least and greatest value (n_u, 2) of each control, by the parameters of its name."""
        return self._limits(self.control_names)

    @property
    def reduced_limits(self) -> Array:
        """Least and greatest value (n_z, 2) of each component of the reduced state; likewise."""
        return self._limits(self.reduced_names)

    def _limits(self, names: Sequence[str]) -> Array:
        """Limits (n, 2) by `max_NAME` and `min_NAME`, which is its negative if left out."""
        limits = []
        for name in names:
            one = LIKE.get(name, name)
            most, least = getattr(self, f"max_{one}"), getattr(self, f"min_{one}", None)
            most = math.inf if most is None else most
            limits.append((-most if least is None else least, most))
        return np.array(limits, dtype=np.float64).reshape(-1, 2)

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
        result = np.empty((*_batch(z.shape[:-1], u.shape[:-1]), n))
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


def check_parameters(vehicle: Any, *, but: Sequence[str] = ()) -> None:
    """Make the parameters plain numbers, all positive but least ones, prices and those in `but`.

    Where None is allowed it is left as it is. Wheels that can be turned across are refused too,
    and a least speed or force that is not below the greatest.
    """
    plain_numbers(vehicle)
    name = vehicle.name
    values = {one.name: getattr(vehicle, one.name) for one in fields(vehicle)}
    for one, value in values.items():
        unsigned = one in (*but, AT_REST) or one.startswith("min_")
        if not unsigned:
            check_range(f"{name}: {one}", value)
            check_range(f"{name}: {one}", value, least=SMALLEST)
    for one in ("max_steering", "max_articulation", "max_tilt"):
        if (angle := values.get(one)) is not None and not angle < math.pi / 2:
            raise ValueError(f"{name}: {one} must be less than pi / 2, got {angle} rad")
    for one, unit in (("speed", "m/s"), ("force", "N")):
        least, most = values.get(f"min_{one}"), values.get(f"max_{one}", math.inf)
        if least is not None and not -math.inf < least < most:
            raise ValueError(
                f"{name}: min_{one} must be less than max_{one} {most} {unit}, got {least} {unit}"
            )
    check_range(f"{name}: {AT_REST}", values.get(AT_REST), least=0, unit="1/rad", infinite=True)


UNLIMITED = (-math.inf, math.inf)


def limits_of(what: str, limits: ArrayLike, *, names: Sequence[str]) -> Array:
    """Read-only limits (n, 2), one row for each name; infinite where there is no limit."""
    array = np.array(limits, dtype=np.float64)
    if array.shape != (len(names), 2):
        raise ValueError(
            f"{what}: got shape {array.shape}, need ({len(names)}, 2): least and greatest "
            f"{', '.join(names) or '(nothing)'}"
        )
    for name, (low, high) in zip(names, array, strict=True):
        if not low <= high:
            raise ValueError(f"{what}: {name} needs least <= greatest, got ({low:.6g}, {high:.6g})")
    array.setflags(write=False)
    return array
