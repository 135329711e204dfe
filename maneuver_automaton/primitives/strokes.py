"""From rest to rest over any length: speed up, cruise, brake."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from maneuver_automaton._limits import LONGEST_STROKE
from maneuver_automaton.errors import NotATrim
from maneuver_automaton.models import Model
from maneuver_automaton.models.speeds import pace_within
from maneuver_automaton.primitives.bang_bang import check_limited_rates
from maneuver_automaton.primitives.driving import drive_all
from maneuver_automaton.primitives.maneuver import Maneuver
from maneuver_automaton.primitives.trim import Trim


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """The quickest motion over a length from rest to rest: times of its three parts."""

    peak: float  # greatest speed, signed as the length [m/s, or rad/s]
    speed_up: float  # [s]
    cruise: float  # [s]
    brake: float  # [s]

    @property
    def duration(self) -> float:
        """Time it takes [s]."""
        return self.speed_up + self.cruise + self.brake


def ramp_of(
    length: float, *, max_speed: float, acceleration: float, deceleration: float | None = None
) -> Ramp:
    """Quickest speeds over a signed length, from rest to rest: a triangle, or a trapezoid.

    Source: the area under the speed; LaValle (2006), *Planning Algorithms*, Sec. 14.6.3.

    Parameters
    ----------
    length : float
        Distance or angle, negative in reverse [m, or rad].
    max_speed, acceleration : float
        Greatest speed and rate of the speed, positive [m/s, m/s^2; or rad].
    deceleration : float, optional
        Greatest rate of braking; the acceleration if None.

    Examples
    --------
    >>> ramp_of(4.0, max_speed=10.0, acceleration=1.0)
    Ramp(peak=2.0, speed_up=2.0, cruise=0.0, brake=2.0)
    >>> ramp_of(-4.0, max_speed=1.0, acceleration=1.0)
    Ramp(peak=-1.0, speed_up=1.0, cruise=3.0, brake=1.0)
    """
    brake = acceleration if deceleration is None else deceleration
    given = {"max_speed": max_speed, "acceleration": acceleration, "deceleration": brake}
    for name, value in given.items():
        if not 0.0 < value < math.inf:
            raise ValueError(f"ramp: {name} must be positive, got {value}")
    if not math.isfinite(length):
        raise ValueError(f"ramp: length must be finite, got {length}")
    ramps = 0.5 / acceleration + 0.5 / brake  # length of both ramps over the squared peak
    peak = min(max_speed, math.sqrt(abs(length) / ramps))
    cruise = (abs(length) - ramps * peak * peak) / peak if peak == max_speed else 0.0
    return Ramp(
        peak=math.copysign(peak, length),
        speed_up=peak / acceleration,
        cruise=max(0.0, cruise),
        brake=peak / brake,
    )


def strokes(
    model: Model, rests: Sequence[Trim], lengths: Sequence[float], *, max_speed: float | None = None
) -> tuple[Maneuver, ...]:
    """The quickest motions of every length [m] from rest to the same rest, as maneuvers.

    What else the reduced state holds, such as the steering angle, stays: an arc of a circle.
    Negative lengths are driven backwards.

    Raises
    ------
    ValueError
        If the vehicle cannot go that way, or is none whose rates are limited.
    NotATrim
        If it does not rest there.

    Examples
    --------
    >>> from maneuver_automaton.models import SecondOrderCar
    >>> from maneuver_automaton.primitives.equilibrium import trims_of
    >>> car = SecondOrderCar(wheelbase=2.8, max_steering=0.75, max_speed=2.5, max_acceleration=1.0,
    ...                      max_steering_rate=0.5)
    >>> (rest,) = trims_of(car, {"speed": [0.0], "steering": [0.0]}).trims
    >>> (back,) = strokes(car, [rest], [-10.0])
    >>> back.displacement.round(12).tolist(), back.duration
    ([-10.0, 0.0, 0.0], 6.5)
    """
    return _whole(
        model, [_swing(model, r, length, "speed", max_speed) for r in rests for length in lengths]
    )


def turns(
    model: Model,
    rests: Sequence[Trim],
    angles: Sequence[float],
    *,
    max_turn_rate: float | None = None,
) -> tuple[Maneuver, ...]:
    """Turns on the spot by every angle at every rest, each as one maneuver to the same rest."""
    return _whole(
        model,
        [_swing(model, r, angle, "turn_rate", max_turn_rate) for r in rests for angle in angles],
    )


class _Swing(NamedTuple):
    """A rest, and how one component of its reduced state goes up and back to zero."""

    name: str
    rest: Trim
    component: int
    ramp: Ramp


def _swing(model: Model, rest: Trim, length: float, component: str, limit: float | None) -> _Swing:
    """The one whose integral is `length` [m, or rad]."""
    check_limited_rates(model)
    _check_rest(rest)
    if component not in model.reduced_names:
        raise ValueError(f"stroke: the {model.name} has no {component}, need one of limited rate")
    k = model.reduced_names.index(component)
    (slow, fast), (least, greatest) = model.control_limits[k], model.reduced_limits[k]
    up, down, most = (fast, -slow, greatest) if length > 0.0 else (-slow, fast, -least)
    if length == 0.0 or not most > 0.0:
        raise ValueError(
            f"stroke: got {length}, but the {component} of the {model.name} is within "
            f"[{least:.6g}, {greatest:.6g}]; need a way that is not 0 and leads there"
        )
    if abs(length) > LONGEST_STROKE:
        raise ValueError(f"stroke: got {length:g}, need at most {LONGEST_STROKE:g} in size")
    moving = rest.reduced_state.copy()
    moving[k] = most
    pace = min(1.0, pace_within(model, model.body_velocity(moving, rest.control)))
    ramp = ramp_of(
        length,
        max_speed=float(most) * pace if limit is None else min(float(most) * pace, limit),
        acceleration=float(up),
        deceleration=float(down),
    )
    return _Swing(f"{rest.name}, {component} over {length:.6g}", rest, k, ramp)


def _whole(model: Model, swings: Sequence[_Swing]) -> tuple[Maneuver, ...]:
    if not swings:
        return ()
    ramps = [swing.ramp for swing in swings]
    durations = np.array([[ramp.speed_up, ramp.cruise, ramp.brake] for ramp in ramps])
    control = np.zeros((len(swings), 3, len(model.control_names)))
    for row, swing in zip(control, swings, strict=True):
        up, down = swing.ramp.speed_up, swing.ramp.brake
        row[:, swing.component] = [swing.ramp.peak / up, 0.0, -swing.ramp.peak / down]
    courses = drive_all(
        model,
        [swing.rest.reduced_state for swing in swings],
        control=control,
        durations=durations,
    )
    return tuple(
        Maneuver.along(
            course,
            name=swing.name,
            source=swing.rest.name,
            target=swing.rest.name,
        )
        for swing, course in zip(swings, courses, strict=True)
    )


def _check_rest(trim: Trim) -> None:
    if not trim.is_rest:
        raise NotATrim(f"trim {trim.name!r}: moves with {trim.body_velocity.tolist()}, need a rest")
