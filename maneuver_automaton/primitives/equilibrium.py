"""Trims of a model: where its reduced dynamics are at equilibrium, point by point of a grid."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton._brief import brief
from maneuver_automaton.models import Model
from maneuver_automaton.models.model import check_model
from maneuver_automaton.models.speeds import is_too_sharp, lateral_limit
from maneuver_automaton.primitives.primitive import Trim

TWIST_NAMES = ("speed", "lateral_speed", "turn_rate", "climb")
WORLD_NAMES = ("v_x", "v_y", "v_z")  # of a vehicle that translations alone move
BALANCED = 1e-11  # rates of an equilibrium and misses of what is asked for, over the scale
ROUNDING = 1e-12  # numbers closer than this are taken for the simpler one
MOST_STEPS = 60
SHORTEST = 1e-6  # share of a step of Newton
DIFFERENCE = 1e-6  # of central differences, over the size of the value, at least 1
SLACK = 1e-12  # what a limit may be exceeded by, over its size, before the value is moved onto it


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingTrim:
    """A point of a grid at which the vehicle has no trim, and why."""

    name: str
    reason: str  # which limit, and by how much; or what stays out of balance
    sharp: bool = False  # whether it is beyond the lateral acceleration of the vehicle alone


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundTrims:
    """Trims at the points of a grid, and the points without one, both in the order of the grid."""

    trims: tuple[Trim, ...]
    missing: tuple[MissingTrim, ...]

    __repr__ = brief


def trims_of(
    model: Model, grid: Mapping[str, ArrayLike], *, max_lateral_acceleration: float | None = None
) -> FoundTrims:
    """Trims of a model at every combination of the values in `grid`, within its limits.

    What the grid does not say is solved for: reduced state z and control u with ``f(z, u) = 0``,
    nearest to zero where that leaves a freedom. If the equations leave one, the vehicle is asked
    not to slide sideways. Trims are named after their point: ``"speed 10, turn_rate 0.2"``.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. III-A: trims are the equilibria of the reduced
    dynamics. Solved by Newton with halved steps; from a start inside the limits by the trust
    region of Branch, Coleman, Li (1999), in SciPy, where Newton leaves them.

    Parameters
    ----------
    model : Model
        The vehicle.
    grid : mapping of str to (n,) arrays
        Values of components of the reduced state or the control, by name; or of the body
        velocity: speed [m/s], lateral_speed [m/s], turn_rate [rad/s], climb [m/s]; v_x, v_y, v_z
        [m/s] of a vehicle that translations alone move.
    max_lateral_acceleration : float, optional
        Greatest speed times turn rate [m/s^2], beside that of the vehicle: a tyre's grip, which is
        no limit of a state; no limit if None.

    Returns
    -------
    FoundTrims
        Rates of the reduced state are below 1e-11, relative to their terms.

    Raises
    ------
    ValueError
        If the grid names what the model does not have, or holds no number.

    Examples
    --------
    >>> from maneuver_automaton.models import SecondOrderCar
    >>> car = SecondOrderCar(wheelbase=2.0, max_steering=0.7, max_speed=2.0, max_acceleration=1.0,
    ...                      max_steering_rate=0.5)
    >>> found = trims_of(car, {"speed": [1.0, 2.0], "turn_rate": [0.5]})
    >>> [trim.name for trim in found.trims]
    ['speed 2, turn_rate 0.5']
    >>> found.missing[0].reason
    'steering would be 0.7854, 0.0854 beyond its limit 0.7000'
    """
    check_model(model)
    axes = {name: as_array(f"grid: {name}", values).ravel() + 0.0 for name, values in grid.items()}
    for name, values in axes.items():
        if not values.size:
            raise ValueError(f"grid: got no value of {name}, need at least one")
    known = dict.fromkeys((*model.reduced_names, *model.control_names, *_twist_names(model)))
    if not axes:
        raise ValueError(f"grid: got no axis, need some of {', '.join(known)}")
    for name in axes:
        if name not in known:
            raise ValueError(f"grid: the {model.name} has no {name!r}, need {', '.join(known)}")
    trims, missing = [], []
    for point in product(*(values.tolist() for values in axes.values())):
        asked = dict(zip(axes, point, strict=True))
        name = ", ".join(f"{what} {value:.10g}" for what, value in asked.items())
        found = _trim_at(_balance(model, asked), name, max_lateral_acceleration)
        if isinstance(found, Trim):
            trims.append(found)
        else:
            missing.append(found)
    return FoundTrims(trims=tuple(trims), missing=tuple(missing))


def _twist_names(model: Model) -> tuple[str, ...]:
    turns = "heading" in model.group.coordinates
    return (TWIST_NAMES if turns else WORLD_NAMES)[: model.group.dof]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Balance:
    """The equations of one trim; the unknowns are those of state and control not given."""

    model: Model
    given: Array  # (n_z + n_u,) nan where it is unknown
    twist: Mapping[int, float]  # components of the body velocity that are asked for

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.model.reduced_names, *self.model.control_names)

    @property
    def limits(self) -> Array:
        return np.concatenate([self.model.reduced_limits, self.model.control_limits])

    @property
    def equations(self) -> tuple[str, ...]:
        rates = (f"the rate of {name}" for name in self.model.reduced_names)
        return (*rates, *(_twist_names(self.model)[k] for k in self.twist))

    def completed(self, unknown: Array) -> Array:
        """Reduced state and control (n_z + n_u,)."""
        everything = self.given.copy()
        everything[np.isnan(everything)] = unknown
        return everything

    def missed(self, unknown: Array) -> Array:
        """Residuals (n_equations,) of the balance; not finite where the model is not defined."""
        everything = self.completed(unknown)
        z, u = np.split(everything, [len(self.model.reduced_names)])
        with np.errstate(all="ignore"):
            rates = np.array(self.model.dynamics(z, u), dtype=np.float64).ravel()
            twist = np.array(self.model.velocity(z, u), dtype=np.float64)
        return np.concatenate([rates, [twist[k] - value for k, value in self.twist.items()]])


def _balance(model: Model, asked: Mapping[str, float]) -> _Balance:
    names = (*model.reduced_names, *model.control_names)
    components = _twist_names(model)
    twist = {components.index(k): value for k, value in asked.items() if k not in names}
    free = len(names) - (len(asked) - len(twist))
    open_ = free > len(model.reduced_names) + len(twist)
    if open_ and "lateral_speed" in components and "lateral_speed" not in asked:
        twist[1] = 0.0
    given = np.array([asked.get(name, np.nan) for name in names], dtype=np.float64)
    return _Balance(model=model, given=given, twist=twist)


def _trim_at(
    balance: _Balance, name: str, max_lateral_acceleration: float | None
) -> Trim | MissingTrim:
    """The trim that a balance asks for, or why there is none."""
    model = balance.model
    found, solved = _solved(balance)
    everything, excess = balance.completed(found), _excess(balance, found)
    if not solved:  # only what the grid asks for is sure to be beyond its limits
        excess = np.where(np.isnan(balance.given), 0.0, excess)
    if excess.any():
        beyond = [
            f"{balance.names[k]} would be {everything[k]:.4f}, {excess[k]:.4g} beyond its limit "
            f"{balance.limits[k, int(everything[k] > balance.limits[k, 1])]:.4f}"
            for k in np.flatnonzero(excess)
        ]
        return MissingTrim(name=name, reason="; ".join(beyond))
    if not solved:
        missed = np.abs(balance.missed(found))
        worst = int(np.argmax(missed))
        what = f"{balance.equations[worst]} stays off by {missed[worst]:.4g}"
        return MissingTrim(name=name, reason=f"no steady motion: {what}")
    inside = np.clip(everything, *balance.limits.T) + 0.0
    state, control = np.split(inside, [len(model.reduced_names)])
    twist: Array = np.array(model.body_velocity(state, control))
    for k, value in balance.twist.items():
        if abs(twist[k] - value) <= ROUNDING * max(1.0, abs(value)):
            twist[k] = value
    twist += 0.0  # -0.0 is 0.0
    turn_rate = float(np.abs(twist[2:3]).sum()) if "turn_rate" in _twist_names(model) else 0.0
    lateral = float(np.hypot(twist[0], twist[1]) * turn_rate)
    most = math.inf if max_lateral_acceleration is None else max_lateral_acceleration
    sharp = lateral <= most * (1.0 + SLACK)
    if not sharp or is_too_sharp(model, twist):
        most = lateral_limit(model) if sharp else most
        reason = (
            f"the lateral acceleration would be {lateral:.4g} m/s^2, {lateral - most:.4g} m/s^2 "
            f"beyond max_lateral_acceleration {most:.4g} m/s^2"
        )
        return MissingTrim(name=name, reason=reason, sharp=sharp)
    return Trim(name=name, body_velocity=twist, control=control, reduced_state=state)


def _solved(balance: _Balance) -> tuple[Array, bool]:
    """Unknowns in balance, within the limits if there are such; and whether they are."""
    low, high = balance.limits[np.isnan(balance.given)].T
    found, solved = _newton(balance.missed, np.clip(0.0, low, high))
    if low.size and (not solved or _excess(balance, found).any()):
        other, also = _newton(balance.missed, _inside(balance, low, high))
        if also and not (solved and _excess(balance, other).any()):
            found, solved = other, True
    return (_simplest(balance.missed, found) if solved else found), solved


def _newton(missed: Callable[[Array], Array], start: Array) -> tuple[Array, bool]:
    """Root of `missed` from `start`, by shortest steps that are halved until they help."""
    x, now = start, missed(start)
    for _ in range(MOST_STEPS):
        if not np.isfinite(now).all() or not now.any():
            break
        slopes = _slopes(missed, x)
        if not np.isfinite(slopes).all():
            break
        step = np.linalg.lstsq(slopes, -now, rcond=1e-12)[0]
        share = 1.0
        while share > SHORTEST:
            there = missed(x + share * step)
            if np.isfinite(there).all() and np.abs(there).max() < np.abs(now).max():
                break
            share /= 2.0
        else:
            break
        x, now = x + share * step, there
    if not np.isfinite(now).all():
        return x, False
    scale = max(1.0, float((np.abs(_slopes(missed, x)) @ np.abs(x)).max(initial=0.0)))
    return x, bool(np.abs(now).max(initial=0.0) <= BALANCED * scale)


def _slopes(missed: Callable[[Array], Array], x: Array) -> Array:
    """Derivatives (n_equations, n) by central differences."""
    widths = DIFFERENCE * np.maximum(1.0, np.abs(x))
    steps = np.diag(widths)
    columns = [
        (missed(x + step) - missed(x - step)) / (2.0 * width)
        for step, width in zip(steps, widths, strict=True)
    ]
    slopes: Array = np.stack(columns, axis=-1) if columns else np.zeros((missed(x).size, 0))
    return slopes


def _inside(balance: _Balance, low: Array, high: Array) -> Array:
    """The unknowns within the limits that are nearest to balance."""
    from scipy.optimize import least_squares

    high = np.maximum(high, low + 1e-9)
    start: Array = np.clip(0.0, low, high)
    if not np.isfinite(balance.missed(start)).all():
        return start
    fit = least_squares(
        balance.missed, start, bounds=(low, high), xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    return np.asarray(fit.x, dtype=np.float64)


def _excess(balance: _Balance, unknown: Array) -> Array:
    """How far each component is beyond its limits (n_z + n_u,), 0 inside."""
    everything, (low, high) = balance.completed(unknown), balance.limits.T
    beyond = np.maximum(low - everything, everything - high)
    return np.where(beyond > SLACK * np.maximum(1.0, np.abs(everything)), beyond, 0.0)


def _simplest(missed: Callable[[Array], Array], x: Array) -> Array:
    """The root without the digits that are rounding: zeros are zero, a half is a half."""
    for k, value in enumerate(np.round(x, 12)):
        simple = x.copy()
        simple[k] = value
        if np.abs(missed(simple)).max() <= max(np.abs(missed(x)).max(), 1e-15):
            x = simple
    return x
