"""The Protocol `Model`: what every room may ask of a vehicle."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from maneuver_automaton._arrays import Array
from maneuver_automaton.groups import LieGroup
from maneuver_automaton.models.vehicle import Components


class Model(Protocol):
    """A vehicle whose dynamics look the same at every pose.

    Its state is a pose g and a reduced state z, with ``g' = g xi(z, u)`` and ``z' = f(z, u)``:
    neither xi nor f sees the pose. Both are stated component by component, as `velocity` and
    `dynamics`, for numbers, arrays or symbols; `body_velocity` and `reduced_dynamics` are the same
    on arrays with components last, and broadcast over batch axes as NumPy does.

    A vehicle may carry parts, such as a trailer, whose place depends on the reduced state.

    Source: Frazzoli, Dahleh, Feron (2005), Sec. II; reduction by symmetry.

    Examples
    --------
    >>> import numpy as np
    >>> from maneuver_automaton.models import Car
    >>> car = Car(wheelbase=2.0)
    >>> car.body_velocity(np.zeros(0), np.array([[4.0, 0.0], [4.0, np.pi / 4]])).round(3).tolist()
    [[4.0, 0.0, 0.0], [4.0, 0.0, 2.0]]
    """

    @property
    def name(self) -> str:
        """What messages and files call the vehicle."""
        ...

    @property
    def group(self) -> type[LieGroup]:
        """Group that moves it; its elements are the poses."""
        ...

    @property
    def control_names(self) -> tuple[str, ...]:
        """Names of the n_u controls."""
        ...

    @property
    def reduced_names(self) -> tuple[str, ...]:
        """Names of the n_z components of the reduced state; none for a kinematic vehicle."""
        ...

    @property
    def control_limits(self) -> Array:
        """Least and greatest value (n_u, 2) of each control; infinite where there is no limit."""
        ...

    @property
    def reduced_limits(self) -> Array:
        """Least and greatest value (n_z, 2) of each component of the reduced state."""
        ...

    @property
    def part_names(self) -> tuple[str, ...]:
        """Names of what it carries; () if that is nothing."""
        ...

    def velocity(self, z: Components, u: Components, /) -> Components:
        """Components of the twist xi(z, u), in the order of the pose."""
        ...

    def dynamics(self, z: Components, u: Components, /) -> Components:
        """Rates f(z, u) of the components of the reduced state; () for a kinematic vehicle."""
        ...

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist xi(z, u) (..., dof) in the body frame, in the order of the pose."""
        ...

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rates (..., n_z) of the reduced state per second."""
        ...

    def part_poses(self, reduced_state: Array) -> Array:
        """Planar poses (..., n, 3) of what it carries, seen from the vehicle."""
        ...


@runtime_checkable
class OnLattice(Protocol):
    """What a vehicle has besides whose library holds on a lattice of cells and headings.

    Each heading of the lattice is a reduced state. The vehicle moves by the maneuvers of its
    library alone: between them nothing is known of it.
    """

    @property
    def resolution(self) -> float:
        """Side of a cell [m]."""
        ...

    def heading(self, reduced_state: Array) -> float:
        """Heading of the lattice [rad] in a reduced state (n_z,)."""
        ...


@runtime_checkable
class OnlyTranslated(Model, Protocol):
    """What a vehicle has besides that translations alone move: its heading is a reduced state."""

    @property
    def stated(self) -> Model:
        """The vehicle on its group of translations."""
        ...

    @property
    def follows_pose(self) -> tuple[int, ...]:
        """Numbers of the reduced states that the pose determines."""
        ...

    def heading(self, reduced_state: Array) -> float:
        """Heading [rad] of the body in a reduced state (n_z,)."""
        ...

    def seen(self, reduced_state: Array) -> Array:
        """Reduced states (..., n_z) of those of `stated`."""
        ...


NEEDED = (  # of a model
    *("name", "group", "control_names", "reduced_names", "control_limits", "reduced_limits"),
    *("part_names", "velocity", "dynamics", "body_velocity", "reduced_dynamics", "part_poses"),
)


def check_model(model: object) -> None:
    """Refuse what has not all that a `Model` has."""
    missing = [name for name in NEEDED if not hasattr(model, name)]
    if missing:
        raise ValueError(
            f"{type(model).__name__} is no model: it has no {', '.join(missing)}; need a "
            "maneuver_automaton.UserModel, or all that one has"
        )


def as_stated(model: Model) -> Model:
    """The model as its author stated it, on the group that is its symmetry."""
    return model.stated if isinstance(model, OnlyTranslated) else model
