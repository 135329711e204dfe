"""The hovercraft: it pushes ahead and turns, and drifts sideways as it likes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.models._components import Components, no_parts, on_arrays
from maneuver_automaton.models._limits import check_positive, speed_limits, symmetric_limits


@dataclass(frozen=True, slots=True, kw_only=True)
class Hovercraft:
    """A body on an air cushion under linear drag; control [force ahead, torque], none sideways.

    The reduced state is [speed, lateral_speed, turn_rate], along and across the body:
    ``v_x' = (force - d_x v_x) / m + r v_y``, ``v_y' = -d_y v_y / m - r v_x``,
    ``r' = (torque - d_r r) / I``. It is underactuated: two controls for three velocities.

    Source: Fantoni, Lozano, Mazenc, Pettersen (2000), *Stabilization of a nonlinear underactuated
    hovercraft*, Sec. 2, with the drag written out; Sira-Ramírez, Aguilar Ibáñez (2000), *On the
    control of the hovercraft system*.

    Parameters
    ----------
    mass, inertia : float
        Mass [kg] and moment of inertia about the vertical [kg m^2].
    drag, lateral_drag, turn_drag : float
        Force per speed ahead [N s/m] and aside [N s/m], torque per turn rate [N m s/rad].
    max_force, max_torque : float
        Greatest force ahead [N]; greatest torque to either side [N m].
    min_force : float, optional
        Least force, negative in reverse [N]; ``-max_force`` if None.
    max_speed, max_lateral_speed, max_turn_rate : float, optional
        Greatest speeds [m/s] and turn rate [rad/s] to either side; no limit if None.

    Examples
    --------
    >>> craft = Hovercraft(mass=2.0, inertia=0.1, drag=1.0, lateral_drag=3.0, turn_drag=0.1,
    ...                    max_force=4.0, max_torque=0.2)
    >>> craft.dynamics([2.0, 1.0, 0.5], [4.0, 0.0])
    (1.5, -2.5, -0.5)
    """

    mass: float  # [kg]
    inertia: float  # [kg m^2]
    drag: float  # [N s/m]
    lateral_drag: float  # [N s/m]
    turn_drag: float  # [N m s/rad]
    max_force: float  # [N]
    max_torque: float  # [N m]
    min_force: float | None = None  # [N]
    max_speed: float | None = None  # [m/s]
    max_lateral_speed: float | None = None  # [m/s]
    max_turn_rate: float | None = None  # [rad/s]
    name: ClassVar[str] = "hovercraft"
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]] = ("force", "torque")
    reduced_names: ClassVar[tuple[str, ...]] = ("speed", "lateral_speed", "turn_rate")
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_positive(
            self.name,
            mass=self.mass,
            inertia=self.inertia,
            drag=self.drag,
            lateral_drag=self.lateral_drag,
            turn_drag=self.turn_drag,
            max_force=self.max_force,
            max_torque=self.max_torque,
            max_speed=self.max_speed,
            max_lateral_speed=self.max_lateral_speed,
            max_turn_rate=self.max_turn_rate,
        )
        speed_limits(self.name, self.min_force, self.max_force, what="force", unit="N")

    @property
    def control_limits(self) -> Array:
        """Least and greatest force [N] and torque [N m]: (2, 2)."""
        limits = symmetric_limits(self.max_force, self.max_torque)
        limits[0] = speed_limits(self.name, self.min_force, self.max_force, what="force", unit="N")
        return limits

    @property
    def reduced_limits(self) -> Array:
        """Least and greatest speed [m/s], lateral speed [m/s] and turn rate [rad/s]: (3, 2)."""
        return symmetric_limits(self.max_speed, self.max_lateral_speed, self.max_turn_rate)

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, lateral_speed, turn_rate)."""
        return z[0], z[1], z[2]

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rates of [speed, lateral_speed, turn_rate]."""
        return (
            (u[0] - self.drag * z[0]) / self.mass + z[2] * z[1],
            -self.lateral_drag * z[1] / self.mass - z[2] * z[0],
            (u[1] - self.turn_drag * z[2]) / self.inertia,
        )

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        return on_arrays(self.velocity, reduced_state, control, sizes=(3, 2, 3))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rates (..., 3) [m/s^2, m/s^2, rad/s^2]; see `dynamics`."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(3, 2, 3))

    def part_poses(self, reduced_state: Array) -> Array:
        """Carries nothing: (..., 0, 3)."""
        return no_parts(reduced_state)
