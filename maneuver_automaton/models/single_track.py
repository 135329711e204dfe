"""The dynamic single-track model: a car whose tyres slip sideways to hold it in a curve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from maneuver_automaton._arrays import Array, plain_numbers
from maneuver_automaton.groups import SE2, LieGroup
from maneuver_automaton.models._components import Components, no_parts, on_arrays
from maneuver_automaton.models._limits import (
    check_positive,
    check_steering,
    speed_limits,
    symmetric_limits,
)

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleTrack:
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
    group: ClassVar[type[LieGroup]] = SE2
    control_names: ClassVar[tuple[str, ...]] = ("acceleration", "steering_rate")
    reduced_names: ClassVar[tuple[str, ...]] = ("speed", "lateral_speed", "turn_rate", "steering")
    part_names: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        plain_numbers(self)
        check_positive(
            self.name,
            mass=self.mass,
            inertia=self.inertia,
            front=self.front,
            rear=self.rear,
            height=self.height,
            cornering=self.cornering,
            friction=self.friction,
            max_steering=self.max_steering,
            max_steering_rate=self.max_steering_rate,
            max_acceleration=self.max_acceleration,
            min_speed=self.min_speed,
            max_speed=self.max_speed,
            max_lateral_speed=self.max_lateral_speed,
            max_turn_rate=self.max_turn_rate,
            max_lateral_acceleration=self.max_lateral_acceleration,
        )
        check_steering(self.name, self.max_steering)
        speed_limits(self.name, self.min_speed, self.max_speed)

    @property
    def wheelbase(self) -> float:
        """Distance of the axles [m]."""
        return self.front + self.rear

    @property
    def control_limits(self) -> Array:
        """Least and greatest acceleration [m/s^2] and steering rate [rad/s]: (2, 2)."""
        return symmetric_limits(self.max_acceleration, self.max_steering_rate)

    @property
    def reduced_limits(self) -> Array:
        """Least and greatest [speed, lateral_speed, turn_rate, steering]: (4, 2)."""
        limits = symmetric_limits(
            self.max_speed, self.max_lateral_speed, self.max_turn_rate, self.max_steering
        )
        limits[0] = speed_limits(self.name, self.min_speed, self.max_speed)
        return limits

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

    def body_velocity(self, reduced_state: Array, control: Array) -> Array:
        """Twist (..., 3) [m/s, m/s, rad/s]; see `velocity`."""
        return on_arrays(self.velocity, reduced_state, control, sizes=(4, 2, 3))

    def reduced_dynamics(self, reduced_state: Array, control: Array) -> Array:
        """Rates (..., 4) [m/s^2, m/s^2, rad/s^2, rad/s]; see `dynamics`."""
        return on_arrays(self.dynamics, reduced_state, control, sizes=(4, 2, 4))

    def part_poses(self, reduced_state: Array) -> Array:
        """Carries nothing: (..., 0, 3)."""
        return no_parts(reduced_state)
