"""A user's own vehicle: from two functions, or from a plain differential equation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any

import numpy as np

from maneuver_automaton._arrays import Array, as_array
from maneuver_automaton._brief import brief
from maneuver_automaton.errors import BrokenSymmetry
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.models.state import VectorField, equivariance_defect
from maneuver_automaton.models.vehicle import (
    UNLIMITED,
    ComponentFunction,
    Components,
    limits_of,
    no_parts,
    no_rates,
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class UserModel:
    """A vehicle given by two functions of one reduced state and one control, by components.

    Written with Python's arithmetic and NumPy's functions on components, the two functions serve
    numbers, here, and symbols, in optimal control: they are all that a vehicle needs. Batches are
    taken apart and the functions called row by row, so they need not be vectorised.

    Parameters
    ----------
    name : str
        What messages call the vehicle.
    group : type[LieGroup]
        Group of its poses.
    control_names, reduced_names : tuple of str
        Names of the n_u controls and of the n_z components of the reduced state.
    velocity : callable
        ``velocity(z, u)`` returns the twist (dof,) in the body frame, in the order of the pose.
    dynamics : callable, optional
        ``dynamics(z, u)`` returns the rates (n_z,) of the reduced state; needed if there is one.
    control_limits, reduced_limits : (n, 2) arrays, optional
        Least and greatest values, infinite where there is no limit; one pair serves all.
    part_names : tuple of str
        Names of what it carries.
    part_poses : callable
        Planar poses (..., n, 3) of that, seen from the vehicle, for reduced states (..., n_z).

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> boat = UserModel(name="boat", group=SE2, control_names=("push", "turn"),
    ...                  reduced_names=("speed",),
    ...                  velocity=lambda z, u: [z[0], 0.1 * z[0], u[1]],
    ...                  dynamics=lambda z, u: [u[0] - z[0]])
    >>> boat.body_velocity(np.array([2.0]), np.array([1.0, 0.3])).tolist()
    [2.0, 0.2, 0.3]
    >>> boat.reduced_dynamics(np.array([[2.0], [1.0]]), np.array([1.0, 0.3])).tolist()
    [[-1.0], [0.0]]
    """

    name: str
    group: type[LieGroup]
    control_names: tuple[str, ...]
    velocity: ComponentFunction
    reduced_names: tuple[str, ...] = ()
    dynamics: ComponentFunction = no_rates
    control_limits: Array = field(default_factory=lambda: np.array(UNLIMITED))  # (n_u, 2)
    reduced_limits: Array = field(default_factory=lambda: np.array(UNLIMITED))  # (n_z, 2)
    part_names: tuple[str, ...] = ()
    part_poses: Callable[[Array], Array] = no_parts

    __repr__ = brief

    def __post_init__(self) -> None:
        if self.reduced_names and self.dynamics is no_rates:
            raise ValueError(
                f"{self.name}: has the reduced state {', '.join(self.reduced_names)} but no "
                "dynamics, need a function of (reduced_state, control)"
            )
        for kind, names in (("control", self.control_names), ("reduced", self.reduced_names)):
            what, limits = f"{kind}_limits", getattr(self, f"{kind}_limits")
            rows = np.tile(limits, (len(names), 1)) if np.shape(limits) == (2,) else limits
            object.__setattr__(self, what, limits_of(f"{self.name}: {what}", rows, names=names))

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., dof) in the body frame, in the order of the pose."""
        return self._row_by_row("velocity", self.velocity, reduced_state, control, self.group.dof)

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rates (..., n_z) of the reduced state per second."""
        n = len(self.reduced_names)
        return self._row_by_row("dynamics", self.dynamics, reduced_state, control, n)

    def part_frames(self, z: Components, /) -> tuple[tuple[Any, ...], ...]:
        """Components of the pose of each part, for numbers and symbols: those of `part_poses`."""
        return tuple(tuple(part) for part in self.part_poses(_components(z)[None])[0])

    def _row_by_row(
        self, what: str, function: ComponentFunction, z: Array, u: Array, n: int
    ) -> Array:
        z = as_array(f"{self.name}: reduced state", z, last=len(self.reduced_names))
        u = as_array(f"{self.name}: control", u, last=len(self.control_names))
        batch = np.broadcast_shapes(z.shape[:-1], u.shape[:-1])
        both = (np.broadcast_to(a, (*batch, a.shape[-1])) for a in (z, u))
        rows = (a.reshape(math.prod(batch), a.shape[-1]) for a in both)
        values = as_array(f"{self.name}: {what}", list(map(function, *rows)) or np.empty((0, n)))
        if values.shape[1:] != (n,):
            raise ValueError(f"{self.name}: {what} returned shape {values.shape[1:]}, need ({n},)")
        return values.reshape(*batch, n)


def model_of_vector_field(
    f: VectorField,
    *,
    group: type[LieGroup],
    n_controls: int,
    reduced_names: Sequence[str] = (),
    check: bool = True,
    tolerance: float = 1e-9,
) -> UserModel:
    """Make a model of a plain differential equation ``x' = f(x, u)`` that has the symmetry.

    The state is the pose, as the group orders it, then the reduced state. The body velocity is
    what `f` returns for the pose at the identity: right everywhere only if `f` is equivariant.

    Parameters
    ----------
    f : callable
        ``f(x, u)`` for one state (dof + n_z,) and one control (n_u,): rates (dof + n_z,), as a list
        where maneuvers are built, since optimal control hands it symbols.
    group : type[LieGroup]
        Group of the poses.
    n_controls : int
        Number of controls; they are called u1, u2, ...
    reduced_names : sequence of str
        Names of the components of the reduced state.
    check : bool
        Whether to try the symmetry at a few random states, near zero; the thorough check is
        `analysis.check_vector_field`.
    tolerance : float
        Greatest violation admitted, relative to the largest rate (at least 1), [-].

    Returns
    -------
    UserModel
        Without limits and with names of no beauty: `dataclasses.replace` changes both.

    Raises
    ------
    BrokenSymmetry
        If a check fails: the message names the rate and the motion that changes it.

    Examples
    --------
    >>> from maneuver_automaton.groups import SE2
    >>> def skate(x, u):
    ...     return [u[0] * np.cos(x[2]), u[0] * np.sin(x[2]), u[1]]
    >>> skate = model_of_vector_field(skate, group=SE2, n_controls=2)
    >>> skate.body_velocity(np.zeros(0), np.array([1.0, 0.5])).tolist()
    [1.0, 0.0, 0.5]
    """
    name = getattr(f, "__name__", type(f).__name__)
    names, dof = tuple(reduced_names), group.dof
    n_states = dof + len(names)

    def rates(x: Array, u: Array) -> Array:
        try:
            return as_array(f"{name}: rates", f(x, u), last=n_states)
        except IndexError as error:
            known = ", ".join((*group.coordinates, *names))
            raise ValueError(
                f"{name}: {error}: the state has {n_states} numbers, {known}, and the control "
                f"{n_controls}; need reduced_names for what else the state holds"
            ) from error

    def at_identity(z: Components, u: Components) -> Any:
        x, u = _components([*np.zeros(dof), *z]), _components(u)
        return f(x, u) if np.object_ in (x.dtype, u.dtype) else rates(x, u)

    if check:
        _try_symmetry(rates, name, group, (n_states, n_controls), tolerance)
    return UserModel(
        name=name,
        group=group,
        control_names=tuple(f"u{i + 1}" for i in range(n_controls)),
        reduced_names=names,
        velocity=lambda z, u: at_identity(z, u)[:dof],
        dynamics=(lambda z, u: at_identity(z, u)[dof:]) if names else no_rates,
    )


def _components(values: Components) -> Array:
    """Components in one row: an array of numbers, or of symbols as they are."""
    row = np.empty(len(values), dtype=object)
    for k in range(row.size):
        row[k] = values[k]
    return row.astype(np.float64) if all(isinstance(one, Real) for one in row) else row


def _try_symmetry(
    f: VectorField, name: str, group: type[LieGroup], sizes: tuple[int, int], tolerance: float
) -> None:
    rng = np.random.default_rng(0)
    for axis in np.repeat(np.arange(group.dof), 5):
        by = group.exp(np.where(np.arange(group.dof) == axis, rng.normal(), 0.0))
        state, control = rng.normal(size=sizes[0]), rng.normal(size=sizes[1])
        rates = as_array(f"{name}: rates", f(state, control), last=sizes[0])
        defect = equivariance_defect(f, by, state=state, control=control)
        worst = int(np.argmax(np.abs(defect)))
        if abs(defect[worst]) > tolerance * max(1.0, float(np.abs(rates).max())):
            what = (*group.coordinates, *(f"z{i + 1}" for i in range(sizes[0] - group.dof)))
            raise BrokenSymmetry(
                f"{name}: not the same at every pose: moving the {group.coordinates[axis]} by "
                f"{by.pose[axis]:.4g} changes the rate of {what[worst]} by "
                f"{abs(defect[worst]):.4g} against what it should be; a model needs a vector field "
                "without wind, slope or dependence on position"
            )
