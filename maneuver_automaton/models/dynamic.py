"""Vehicles that forces move: a car on slipping tyres, a hovercraft, a helicopter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import check_fields
from maneuver_automaton.groups import LieGroup, SE2xR
from maneuver_automaton.models.vehicle import Components, Vehicle, check_parameters

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleTrack(Vehicle):
    """Two wheels on linear tyres, under load transfer; control [acceleration, steering_rate].

    The reduced state is [speed, lateral_speed, turn_rate, steering], the first three along and
    across the body, at the centre of gravity, which is the pose. With the loads
    ``F_zf = m (g lr - a h) / (lf + lr)`` and ``F_zr = m (g lf + a h) / (lf + lr)`` and the slip
    angles in front and behind,

    ``F_yf = mu C F_zf (steering - (v_y + lf r) / v_x)``, ``F_yr = -mu C F_zr (v_y - lr r) / v_x``,
    ``v_x' = a``, ``v_y' = (F_yf + F_yr) / m - v_x r``, ``r' = (lf F_yf - lr F_yr) / I_z``.

    The slip angles are those of small angles, so the model holds from a least speed on, and as
    long as the lateral acceleration is well below ``mu g``: linear tyres never let go. The
    published model has the slip angle ``v_y / v_x`` as a state, and the speed along the path.

    Source: Althoff, Koschi, Manzinger (2017), CommonRoad: composable benchmarks for motion
    planning on roads; its *vehicle models*, Sec. 6 (single-track model), parameters of vehicle 2,
    a BMW 320i.

    Parameters
    ----------
    mass, inertia : float
        Mass [kg] and moment of inertia about the vertical [kg m^2].
    front, rear : float
        Distance of the front and of the rear axle from the centre of gravity [m].
    height : float
        Height of the centre of gravity [m].
    cornering, friction : float
        Stiffness of the tyres over their load and friction [1/rad], and friction [-].
    max_steering, max_steering_rate : float
        Greatest steering angle [rad] and rate [rad/s] to either side.
    max_acceleration : float
        Greatest acceleration, forward and braking [m/s^2].
    min_speed, max_speed : float
        Least speed for which the model is taken to hold, positive, and greatest speed [m/s].
    max_lateral_speed, max_turn_rate : float, optional
        Greatest lateral speed [m/s] and turn rate [rad/s] to either side; no limit if None.
    max_lateral_acceleration : float, optional
        Greatest speed times turn rate [m/s^2]; no limit if None.

    Examples
    --------
    >>> car = SingleTrack()
    >>> [round(float(rate), 3) for rate in car.dynamics([20.0, 0.0, 0.0, 0.02], [0.0, 0.0])]
    [0.0, 2.372, 1.673, 0.0]
    """

    mass: float = 1093.2952  # [kg]
    inertia: float = 1791.5995  # [kg m^2]
    front: float = 1.1561957  # [m]
    rear: float = 1.4227170  # [m]
    height: float = 0.6137  # [m]
    cornering: float = 20.89  # [1/rad]
    friction: float = 1.0489  # [-]
    max_steering: float = 1.066  # [rad]
    max_steering_rate: float = 0.4  # [rad/s]
    max_acceleration: float = 11.5  # [m/s^2]
    min_speed: float = 5.0  # [m/s]
    max_speed: float = 50.8  # [m/s]
    max_lateral_speed: float | None = None  # [m/s]
    max_turn_rate: float | None = None  # [rad/s]
    max_lateral_acceleration: float | None = None  # [m/s^2]
    name: ClassVar[str] = "single_track"
    control_names: ClassVar[tuple[str, ...]] = ("acceleration", "steering_rate")
    reduced_names: ClassVar[tuple[str, ...]] = ("speed", "lateral_speed", "turn_rate", "steering")

    def __post_init__(self) -> None:
        check_parameters(self)
        check_fields(self.name, self, "min_speed")

    @property
    def wheelbase(self) -> float:
        """Distance of the axles [m]."""
        return self.front + self.rear

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, lateral_speed, turn_rate)."""
        return z[0], z[1], z[2]

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rates of [speed, lateral_speed, turn_rate, steering]."""
        speed, aside, turn, steering = z[0], z[1], z[2], z[3]
        acceleration, steering_rate = u[0], u[1]
        grip = self.friction * self.cornering / self.wheelbase  # tyre force: grip, slip, m times
        load_front = GRAVITY * self.rear - acceleration * self.height
        load_rear = GRAVITY * self.front + acceleration * self.height
        front = grip * load_front * (steering - (aside + self.front * turn) / speed)
        rear = -grip * load_rear * (aside - self.rear * turn) / speed
        turn_up = self.mass / self.inertia * (self.front * front - self.rear * rear)
        return acceleration, front + rear - speed * turn, turn_up, steering_rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Hovercraft(Vehicle):
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
    control_names: ClassVar[tuple[str, ...]] = ("force", "torque")
    reduced_names: ClassVar[tuple[str, ...]] = ("speed", "lateral_speed", "turn_rate")

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Helicopter(Vehicle):
    """A small helicopter, seen in the upright frame that turns with its heading.

    The reduced state is [speed, lateral_speed, climb, turn_rate, tilt, lateral_tilt], the control
    [tilt_rate, lateral_tilt_rate, climb_acceleration, angular_acceleration]. Tilt is counted from
    the vertical, ahead and to the left; with w = g + climb_acceleration, the thrust over the mass
    that is left upright,

    ``v_x' = w tan(tilt) - c v_x + r v_y``, ``v_y' = w tan(lateral_tilt) - c v_y - r v_x``,
    ``v_z' = climb_acceleration``, ``r' = angular_acceleration``.

    Simplified against the source: the inner loops are taken to follow, so tilt changes at a rate
    that is commanded, not by moments; the two tilts are angles of the thrust against the vertical
    in the two upright planes of the body, so they do not couple; no thrust from the tail rotor, no
    flapping, drag linear in the speed, and a limit of the climb's acceleration instead of thrust.

    Source: Frazzoli, Dahleh, Feron (2002), *Real-time motion planning for agile autonomous
    vehicles*, Sec. V; (2005), *Maneuver-based motion planning for nonlinear systems with
    symmetries*, Sec. II: symmetric under translations and turns about the vertical.

    Parameters
    ----------
    max_speed, max_lateral_speed, max_climb : float
        Greatest speed ahead, aside and up or down [m/s].
    max_turn_rate : float
        Greatest turn rate to either side [rad/s].
    max_tilt : float
        Greatest tilt in either direction, less than pi / 2 [rad].
    max_tilt_rate : float
        Greatest rate of tilt [rad/s].
    max_climb_acceleration, max_angular_acceleration : float
        Greatest rate of the climb [m/s^2], less than gravity, and of the turn rate [rad/s^2].
    drag : float
        Drag over speed and mass [1/s].
    min_speed : float, optional
        Least speed, negative backwards [m/s]; ``-max_speed`` if None.
    gravity : float
        Acceleration of free fall [m/s^2].

    Examples
    --------
    >>> craft = Helicopter(max_speed=10.0, max_lateral_speed=3.0, max_climb=3.0, max_turn_rate=1.0,
    ...                    max_tilt=0.6, max_tilt_rate=1.5, max_climb_acceleration=3.0,
    ...                    max_angular_acceleration=2.0)
    >>> left_turn = [5.0, 0.0, 1.0, 0.5, 0.0, np.arctan(2.5 / 9.81)]
    >>> [round(float(rate), 9) + 0.0 for rate in craft.dynamics(left_turn, [0.0, 0.0, 0.0, 0.0])]
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    """

    max_speed: float  # [m/s]
    max_lateral_speed: float  # [m/s]
    max_climb: float  # [m/s]
    max_turn_rate: float  # [rad/s]
    max_tilt: float  # [rad]
    max_tilt_rate: float  # [rad/s]
    max_climb_acceleration: float  # [m/s^2]
    max_angular_acceleration: float  # [rad/s^2]
    drag: float = 0.0  # [1/s]
    min_speed: float | None = None  # [m/s]
    gravity: float = 9.81  # [m/s^2]
    name: ClassVar[str] = "helicopter"
    group: ClassVar[type[LieGroup]] = SE2xR
    control_names: ClassVar[tuple[str, ...]] = (
        "tilt_rate",
        "lateral_tilt_rate",
        "climb_acceleration",
        "angular_acceleration",
    )
    reduced_names: ClassVar[tuple[str, ...]] = (
        "speed",
        "lateral_speed",
        "climb",
        "turn_rate",
        "tilt",
        "lateral_tilt",
    )

    def __post_init__(self) -> None:
        check_parameters(self, but=("drag",))
        if not 0.0 <= self.drag < math.inf:
            raise ValueError(f"{self.name}: drag must not be negative, got {self.drag} 1/s")
        if not self.max_climb_acceleration < self.gravity:
            raise ValueError(
                f"{self.name}: max_climb_acceleration must be less than gravity "
                f"{self.gravity} m/s^2, got {self.max_climb_acceleration} m/s^2"
            )

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, lateral_speed, turn_rate, climb)."""
        return z[0], z[1], z[3], z[2]

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rates of [speed, lateral_speed, climb, turn_rate, tilt, lateral_tilt]."""
        upright = self.gravity + u[2]
        return (
            upright * np.tan(z[4]) - self.drag * z[0] + z[3] * z[1],
            upright * np.tan(z[5]) - self.drag * z[1] - z[3] * z[0],
            u[2],
            u[3],
            u[0],
            u[1],
        )
