"""Disturbances of a vehicle: noise, pushes, and speeds unlike its model's."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from maneuver_automaton._arrays import Array, as_array, plain_numbers
from maneuver_automaton._brief import brief
from maneuver_automaton.automaton import Plan


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Disturbance:
    """How a real vehicle departs from its plan; every random number comes from `seed`.

    Noise shifts the pose after every step, as a person's push would: the place by a normal number
    per axis, the heading by another. Measurement errors are seen by the controller alone. A push
    is a displacement in the vehicle's own frame after the step of that number. A vehicle that
    differs from its model has other body velocities: `twist_scale` times those of the library.
    With `delay` 1 the controller sees every pose a step late, and plans from the predicted end of
    the piece that is driven meanwhile.
    """

    position_m: float = 0.0  # standard deviation per axis and step
    heading_rad: float = 0.0  # standard deviation per step
    measured_position_m: float = 0.0  # standard deviation of the measurement
    measured_heading_rad: float = 0.0
    twist_scale: tuple[float, ...] | None = None  # (dof,) none if None
    pushes: Mapping[int, tuple[float, ...]] = field(default_factory=lambda: MappingProxyType({}))
    delay: int = 0  # steps, 0 or 1
    seed: int = 0

    __repr__ = brief

    def __post_init__(self) -> None:
        plain_numbers(self)
        for name in ("position_m", "heading_rad", "measured_position_m", "measured_heading_rad"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"disturbance: {name} must be at least 0, got {value}")
        if self.delay not in (0, 1):
            raise ValueError(f"disturbance: delay must be 0 or 1 steps, got {self.delay}")
        if not (isinstance(self.seed, int | np.integer) and self.seed >= 0):
            raise ValueError(
                f"disturbance: seed must be a whole number of at least 0, got {self.seed}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Draw:
    """The random numbers of one step."""

    noise: Array
    measurement: Array

    __repr__ = brief


def checked(upset: Disturbance, dof: int) -> Disturbance:
    """The disturbance, if it has as many components as the pose."""
    if upset.twist_scale is not None:
        as_array("disturbance: twist_scale", upset.twist_scale, last=dof)
    for after, push in upset.pushes.items():
        as_array(f"disturbance: push after step {after}", push, last=dof)
    return upset


def draws(upset: Disturbance, dof: int) -> Iterator[Draw]:
    """Numbers for step after step: the same for a seed, whatever the loop does with them."""
    rng = np.random.default_rng(upset.seed)
    spread = np.full(dof, upset.position_m)
    spread[2] = upset.heading_rad
    blur = np.full(dof, upset.measured_position_m)
    blur[2] = upset.measured_heading_rad
    while True:
        numbers = rng.standard_normal((2, dof))
        yield Draw(spread * numbers[0], blur * numbers[1])


def as_driven(piece: Plan, upset: Disturbance) -> Plan:
    """A piece of plan as the disturbed vehicle drives it."""
    if upset.twist_scale is None:
        return piece
    scale = as_array("disturbance: twist_scale", upset.twist_scale, last=piece.start.size)
    trims = tuple(replace(trim, body_velocity=trim.body_velocity * scale) for trim in piece.trims)
    return replace(piece, trims=trims)
