"""Quickest maneuvers in closed form, where the controls are the rates of the reduced state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from maneuver_automaton._arrays import Array, IntArray, check_range
from maneuver_automaton._limits import LONGEST_STROKE
from maneuver_automaton.errors import NotATrim
from maneuver_automaton.models import Model
from maneuver_automaton.models.speeds import (
    is_too_sharp,
    lateral_limit,
    pace_within,
    standing_price,
    steers_at_rest,
)
from maneuver_automaton.primitives.driving import BoolArray, drive_all
from maneuver_automaton.primitives.primitive import Maneuver, Trajectory, Trim

Pairs = Literal["all", "neighbours"] | Sequence[tuple[int, int]]
EQUAL = 1e-12  # times or states closer than this, over their size, are equal [s, units of z]
BATCH = 2000  # maneuvers that are integrated together
MOST = 300_000  # maneuvers of one library


def bang_bang(model: Model, source: Trim, target: Trim, *, late: bool = False) -> Maneuver:
    """Quickest maneuver between two trims of a vehicle with ``z' = u`` and limits on u.

    It takes the time of the component that needs longest, ``max |z_i' - z_i| / rate_i``; that one
    changes at its greatest rate throughout. The others do so too, and then wait; or, if `late`,
    wait first: as quick, with another displacement. Where that exceeds the lateral acceleration of
    the vehicle, it brakes before it turns its wheels, or turns them before it speeds up.

    Source: the minimum time of integrators with bounded rates; LaValle (2006), *Planning
    Algorithms*, Sec. 14.6.3, bang-bang. The displacement is that of `drive_all`.

    Raises
    ------
    ValueError
        If the reduced state has other dynamics or no limit of its rates, or is the same at both
        trims, which need no maneuver.
    NotATrim
        If a trim is none of this vehicle.

    Examples
    --------
    >>> from maneuver_automaton.models import SecondOrderUnicycle
    >>> from maneuver_automaton.primitives.equilibrium import trims_of
    >>> robot = SecondOrderUnicycle(max_speed=1.0, max_turn_rate=1.0, max_acceleration=0.5,
    ...                             max_angular_acceleration=1.0)
    >>> rest, ahead = trims_of(robot, {"speed": [0.0, 1.0], "turn_rate": [0.0]}).trims
    >>> start = bang_bang(robot, rest, ahead)
    >>> start.duration, start.displacement.round(12).tolist()
    (2.0, [1.0, 0.0, 0.0])
    """
    return _maneuvers(model, [(source, target)], late=late)[0]


def connect_bang_bang(
    model: Model, trims: Sequence[Trim], *, pairs: Pairs = "all", late: bool = False
) -> tuple[Maneuver, ...]:
    """Quickest maneuvers between trims of different reduced states; see `bang_bang`.

    Parameters
    ----------
    model : Model
        The vehicle.
    trims : sequence of Trim
        Its trims.
    pairs : "all", "neighbours" or a sequence of pairs of int
        From every trim to every other; to those that differ by at most one level in every
        component, where the levels are the values that the trims take; or from and to the trims
        of these positions.
    late : bool
        Which of the quickest maneuvers; see `bang_bang`.

    Examples
    --------
    >>> from maneuver_automaton.models import SecondOrderCar
    >>> from maneuver_automaton.primitives.equilibrium import trims_of
    >>> car = SecondOrderCar(wheelbase=2.8, max_steering=0.75, max_speed=2.5, max_acceleration=1.0,
    ...                      max_steering_rate=0.5)
    >>> five = np.linspace(-1.0, 1.0, 5)
    >>> trims = trims_of(car, {"speed": 2.5 * five, "steering": 0.75 * five}).trims
    >>> len(connect_bang_bang(car, trims)), len(connect_bang_bang(car, trims, pairs="neighbours"))
    (600, 144)
    """
    return _maneuvers(model, _chosen(trims, pairs), late=late)


def differing(maneuvers: Sequence[Maneuver], others: Sequence[Maneuver]) -> tuple[Maneuver, ...]:
    """The `others` that lead elsewhere than the maneuver at their place, or along another path.

    Late maneuvers are the early ones again where one component changes or both take equally long.
    """
    return tuple(
        other
        for one, other in zip(maneuvers, others, strict=True)
        if np.abs(one.displacement - other.displacement).max() > EQUAL
    )


def has_limited_rates(model: Model) -> bool:
    """Whether the control is the rate of the reduced state, component by component, and limited."""
    n = len(model.reduced_names)
    if n == 0 or n != len(model.control_names) or not np.isfinite(model.control_limits).all():
        return False
    low, high = np.clip(np.moveaxis(model.reduced_limits, -1, 0), -1e3, 1e3)
    shares = np.linspace(0.1, 0.8, 5)[:, None]
    control = np.random.default_rng(0).uniform(-1.0, 1.0, (5, n))
    rates = model.reduced_dynamics(low + shares * (high - low), control)
    return bool((rates == control).all())


def check_limited_rates(model: Model) -> None:
    """Refuse a vehicle that bang-bang maneuvers are not for; raises ValueError."""
    if not has_limited_rates(model):
        raise ValueError(
            f"bang-bang: the {model.name} is none of the vehicles whose control is the rate of "
            "the reduced state, each component with limits; its maneuvers need optimal control"
        )


def _maneuvers(
    model: Model, pairs: Sequence[tuple[Trim, Trim]], *, late: bool
) -> tuple[Maneuver, ...]:
    check_limited_rates(model)
    for trim in {id(trim): trim for pair in pairs for trim in pair}.values():
        _check_trim(model, trim)
    return tuple(
        maneuver
        for k in range(0, len(pairs), BATCH)
        for maneuver in quickest_between(model, pairs[k : k + BATCH], late=late)
    )


def quickest_between(
    model: Model, pairs: Sequence[tuple[Trim, Trim]], *, late: bool | BoolArray = False
) -> list[Maneuver]:
    """The maneuvers of `bang_bang` of a vehicle known to have them; `late`: all, or which (m,)."""
    late = np.broadcast_to(late, len(pairs))
    source = np.array([source.reduced_state for source, _ in pairs])
    target = np.array([target.reduced_state for _, target in pairs])
    same = ~(np.abs(target - source) > EQUAL * np.maximum(1.0, np.abs(source))).any(axis=1)
    if same.any():
        a, b = pairs[int(np.argmax(same))]
        raise ValueError(
            f"bang-bang: {a.name!r} and {b.name!r} have the same reduced state, so the vehicle "
            "switches between them without a maneuver"
        )
    control, durations = _segments(model, source, target, late)
    courses = list(drive_all(model, source, control=control, durations=durations))
    limited = math.isfinite(lateral_limit(model))
    sharp = [
        k
        for k, one in enumerate(courses)
        if limited and is_too_sharp(model, one.twists(model)).any()
    ]
    if sharp:
        slow = _one_by_one(model, source[sharp], target[sharp])
        for k, course in zip(sharp, slow, strict=True):
            courses[k] = course
    return [
        Maneuver.along(
            course,
            name=f"{a.name} to {b.name}" + (", late" if waits else ""),
            source=a.name,
            target=b.name,
        )
        for (a, b), course, waits in zip(pairs, courses, late.tolist(), strict=True)
    ]


def _one_by_one(model: Model, source: Array, target: Array) -> tuple[Trajectory, ...]:
    """Motions between reduced states (m, n): the speed changes first where it falls, else last."""
    k = model.reduced_names.index("speed")
    falls = np.abs(target[:, k]) <= np.abs(source[:, k])
    middle = np.where(falls[:, None] == (np.arange(source.shape[1]) == k), target, source)
    early = np.zeros(len(source), dtype=np.bool_)
    legs = [_segments(model, a, b, early) for a, b in ((source, middle), (middle, target))]
    control, durations = (np.concatenate(parts, axis=1) for parts in zip(*legs, strict=True))
    return drive_all(model, source, control=control, durations=durations)


def _segments(model: Model, source: Array, target: Array, late: BoolArray) -> tuple[Array, Array]:
    """Controls (m, n, n) and durations (m, n) that lead from reduced states (m, n) to others."""
    change = target - source
    low, high = model.control_limits.T
    rate = np.where(change > 0.0, high, low)
    stuck = (change != 0.0) & (rate * np.sign(change) <= 0.0)
    if stuck.any():
        k = int(np.argwhere(stuck)[0, 1])
        raise ValueError(
            f"bang-bang: {model.reduced_names[k]} cannot change that way, the limits of "
            f"{model.control_names[k]} are [{low[k]:.6g}, {high[k]:.6g}]"
        )
    needed = np.where(change == 0.0, 0.0, change / np.where(change == 0.0, 1.0, rate))
    longest = needed.max(axis=1, keepdims=True)
    close = needed > longest * (1.0 - EQUAL)
    rate = np.where(close, change / np.where(close, longest, 1.0), rate)
    needed = np.where(close, longest, needed)
    ends = np.sort(needed, axis=1)
    durations = ends.copy()
    durations[:, 1:] -= ends[:, :-1]
    active = (needed[:, None, :] >= ends[:, :, None]) & (needed[:, None, :] > 0.0)
    control = np.where(active, rate[:, None, :], 0.0)
    control[late], durations[late] = control[late, ::-1], durations[late, ::-1]
    return control, durations


def _chosen(trims: Sequence[Trim], pairs: Pairs) -> list[tuple[Trim, Trim]]:
    if not isinstance(pairs, str):
        return [(trims[i], trims[j]) for i, j in pairs]
    if pairs not in ("all", "neighbours"):
        raise ValueError(f"pairs: got {pairs!r}, need all or neighbours")
    states = np.array([trim.reduced_state for trim in trims]).reshape(len(trims), -1)
    levels = np.stack([_levels(column) for column in states.T], axis=-1)
    steps = np.abs(levels[:, None] - levels).max(axis=2, initial=0)
    wanted: BoolArray = (steps > 0) & ((steps == 1) | (pairs == "all"))
    if (count := np.count_nonzero(wanted)) > MOST:
        raise ValueError(
            f"pairs: got {count} maneuvers between {len(trims)} trims, need at most {MOST}: fewer "
            "trims, or neighbours instead of all"
        )
    return [(trims[i], trims[j]) for i, j in np.argwhere(wanted)]


def _levels(values: Array) -> IntArray:
    """Which of the values that occur each one is (n,), from the least up."""
    order = np.argsort(values)
    rises = np.diff(values[order]) > EQUAL * np.maximum(1.0, np.abs(values[order][1:]))
    levels = np.empty(values.size, dtype=np.int64)
    levels[order] = np.concatenate([[0], np.cumsum(rises)])
    return levels


def _check_trim(model: Model, trim: Trim) -> None:
    n = len(model.reduced_names)
    if trim.reduced_state.shape != (n,) or trim.control.shape != (n,) or trim.control.any():
        raise NotATrim(
            f"trim {trim.name!r}: got reduced state {trim.reduced_state.tolist()} and control "
            f"{trim.control.tolist()}, need {n} numbers ({', '.join(model.reduced_names)}) and "
            f"{n} zeros for the {model.name}"
        )


def _swing(
    model: Model, rest: Trim, length: float, component: str
) -> tuple[float, float, float, float]:
    """How a component goes up from a rest and back, over `length`: its peak, and times [s].

    These are up, held and down: a triangle of speeds, or a trapezoid. Source: the area under the
    speed; LaValle (2006), *Planning Algorithms*, Sec. 14.6.3.
    """
    check_limited_rates(model)
    if not rest.is_rest:
        raise NotATrim(f"trim {rest.name!r}: moves with {rest.body_velocity.tolist()}, need a rest")
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
    top, up, down = float(most) * pace, float(up), float(down)
    check_range(f"stroke: the greatest {component}", top)
    check_range(f"stroke: the rate of the {component}", min(up, down))
    ramps = 0.5 / up + 0.5 / down  # length of both ramps over the squared peak
    peak = min(top, math.sqrt(abs(length) / ramps))
    held = (abs(length) - ramps * peak * peak) / peak if peak == top else 0.0
    return math.copysign(peak, length), peak / up, max(0.0, held), peak / down


def from_rest(
    model: Model, rests: Sequence[Trim], lengths: Sequence[float], component: str
) -> tuple[Maneuver, ...]:
    """The quickest motions of every length [m, or rad] from rest to the same rest, as maneuvers.

    Speed, or turn rate, is the `component` of the reduced state that rises and falls. What else
    the state holds, such as the steering angle, stays: an arc of a circle. Negative lengths are
    driven backwards.

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
    >>> (back,) = from_rest(car, [rest], [-10.0], "speed")
    >>> back.displacement.round(12).tolist(), back.duration
    ([-10.0, 0.0, 0.0], 6.5)
    """
    asked = [(rest, length) for rest in rests for length in lengths]
    if not asked:
        return ()
    swings = [_swing(model, rest, length, component) for rest, length in asked]
    durations = np.array([times for _, *times in swings])
    control, driven = np.zeros((len(asked), 3, len(model.control_names))), model.reduced_names
    for row, (peak, up, _, down) in zip(control, swings, strict=True):
        row[:, driven.index(component)] = [peak / up, 0.0, -peak / down]
    courses = drive_all(
        model, [rest.reduced_state for rest, _ in asked], control=control, durations=durations
    )
    return tuple(
        Maneuver.along(
            course,
            name=f"{rest.name}, {component} over {length:.6g}",
            source=rest.name,
            target=rest.name,
        )
        for (rest, length), course in zip(asked, courses, strict=True)
    )


def quickest_maneuvers(
    model: Model,
    trims: Sequence[Trim],
    *,
    pairs: Pairs = "neighbours",
    late: bool = False,
    strokes: Sequence[float] = (),
    turns: Sequence[float] = (),
) -> tuple[Maneuver, ...]:
    """Quickest maneuvers between trims; strokes and turns on the spot at every trim that rests.

    In narrow places a maneuver between speed trims is longer than the room there is: short
    strokes are what parking is made of.
    """
    early = connect_bang_bang(model, trims, pairs=pairs)
    both = late or not steers_at_rest(model)  # who brakes last has turned the wheels before
    others = connect_bang_bang(model, trims, pairs=pairs, late=True) if both else early
    rests = [trim for trim in trims if trim.is_rest]
    every = (
        *early,
        *differing(early, others),
        *from_rest(model, rests, strokes, "speed"),
        *from_rest(model, rests, turns, "turn_rate"),
    )
    return tuple(one for one in every if may_drive(model, one))


def may_drive(model: Model, maneuver: Maneuver) -> bool:
    """Whether a maneuver with a course turns no wheel at rest, or the vehicle may do so."""
    course = maneuver.course
    return course is None or math.isfinite(
        standing_price(model, course.reduced_state, course.control)
    )
