"""Vehicles that steer elsewhere than at the front: the rear axle, both axles, or their middle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maneuver_automaton._arrays import Array
from maneuver_automaton.models.vehicle import Components, Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class RearSteeredCar(Vehicle):
    """A forklift: its front axle drives and is fixed, its rear axle steers; [speed, steering].

    ``heading' = -v tan(steering) / wheelbase``, with the angle of the rear wheels positive to the
    left. The pose is that of the middle of the front axle, which follows its heading; what is
    behind it swings out of the turn.

    Source: LaValle (2006), *Planning Algorithms*, Eq. (13.15), with the steered axle behind the
    fixed one. Sheets by VDI 2198 of counterbalanced trucks for 2 t have a wheelbase near 1.5 m and
    an outer turning radius near 2.1 m, for which rear wheels turn by some 75 degrees.

    Parameters
    ----------
    wheelbase : float
        Distance from the rear to the front axle [m].
    max_steering : float
        Greatest angle of the rear wheels to either side, less than pi / 2 [rad].
    max_speed : float, optional
        Greatest speed, forward and in reverse [m/s]; no limit if None.

    Examples
    --------
    >>> truck = RearSteeredCar(wheelbase=1.5, max_steering=1.3)
    >>> truck.body_velocity(np.zeros(0), np.array([1.0, -0.5])).round(3).tolist()
    [1.0, 0.0, 0.364]
    >>> round(truck.turning_radius, 3)
    0.416
    """

    wheelbase: float  # [m]
    max_steering: float  # [rad]
    max_speed: float | None = None  # [m/s]
    name: ClassVar[str] = "rear_steered_car"
    control_names: ClassVar[tuple[str, ...]] = ("speed", "rear_steering")

    @property
    def turning_radius(self) -> float:
        """Radius of the tightest circle of the front axle [m]."""
        return self.wheelbase / math.tan(self.max_steering)

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, -speed tan(rear_steering) / wheelbase)."""
        return u[0], 0.0, -u[0] * np.tan(u[1]) / self.wheelbase


@dataclass(frozen=True, slots=True, kw_only=True)
class FourWheelSteeringCar(Vehicle):
    """A car whose axles steer on their own: control [speed, front_steering, rear_steering].

    The pose is that of the middle between the axles, and the speed is along its path, at the slip
    angle ``beta`` with ``tan(beta) = (tan(front) + tan(rear)) / 2``;
    ``heading' = speed cos(beta) (tan(front) - tan(rear)) / wheelbase``. Equal angles go aside,
    opposite ones turn about a point near the middle.

    Source: Rajamani (2012), *Vehicle Dynamics and Control*, Eqs. (2.1) to (2.10), with equal
    distances of the axles. Hyundai Mobis shows an Ioniq 5 (wheelbase 3.0 m) with wheels that turn
    by 90 degrees; here a right angle itself is excluded.

    Parameters
    ----------
    wheelbase : float
        Distance of the axles [m].
    max_steering : float
        Greatest angle of the wheels of each axle to either side, less than pi / 2 [rad].
    max_speed : float, optional
        Greatest speed, forward and in reverse [m/s]; no limit if None.

    Examples
    --------
    >>> car = FourWheelSteeringCar(wheelbase=3.0, max_steering=1.5)
    >>> controls = np.array([[1.0, np.pi / 4, np.pi / 4], [0.5, 1.5, -1.5]])
    >>> (car.body_velocity(np.zeros(0), controls).round(3) + 0.0).tolist()
    [[0.707, 0.707, 0.0], [0.5, 0.0, 4.7]]
    """

    wheelbase: float  # [m]
    max_steering: float  # [rad]
    max_speed: float | None = None  # [m/s]
    name: ClassVar[str] = "four_wheel_steering_car"
    control_names: ClassVar[tuple[str, ...]] = ("speed", "front_steering", "rear_steering")

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: speed (cos(beta), sin(beta)), and the turn rate."""
        front, rear = np.tan(u[1]), np.tan(u[2])
        aside = 0.5 * (front + rear)
        ahead = u[0] / np.sqrt(1.0 + aside * aside)  # speed cos(beta)
        return ahead, ahead * aside, ahead * (front - rear) / self.wheelbase


@dataclass(frozen=True, slots=True, kw_only=True)
class ArticulatedVehicle(Vehicle):
    """A wheel loader: two rigid parts with a fixed axle each, and a driven joint between them.

    The reduced state is [articulation], the heading of the front part less that of the rear, the
    control [speed, articulation_rate]. The pose is that of the middle of the front axle, and
    ``heading' = (speed sin(articulation) + rear articulation_rate) / (front cos(articulation) +
    rear)``: it turns while it stands and bends, too. The rear part is carried, seen from the
    middle of its axle.

    Source: Corke, Ridley (2001), *Steering kinematics for a center-articulated mobile robot*,
    IEEE Trans. Robotics and Automation 17(2). A loader of 18 t (Caterpillar 950) has a wheelbase
    of 3.35 m with the joint in its middle, and bends by 40 degrees to either side.

    Parameters
    ----------
    front, rear : float
        From the joint to the front axle, and to the rear axle [m].
    max_articulation : float
        Greatest angle at the joint to either side, less than pi / 2 [rad].
    max_articulation_rate : float
        Greatest rate of it to either side [rad/s].
    max_speed : float
        Greatest speed of the front axle [m/s].
    min_speed : float, optional
        Least speed, negative in reverse [m/s]; ``-max_speed`` if None.
    steering_at_rest : float
        Price of every radian that it bends while the front axle stands, beside what a plan costs
        otherwise [1/rad]; inf: it never does.

    Examples
    --------
    >>> loader = ArticulatedVehicle(front=1.675, rear=1.675, max_articulation=0.7,
    ...                             max_articulation_rate=0.3, max_speed=2.0)
    >>> loader.body_velocity(np.array([0.6]), np.array([[2.0, 0.0], [0.0, 0.3]])).round(3).tolist()
    [[2.0, 0.0, 0.369], [0.0, 0.0, 0.164]]
    >>> round(loader.turning_radius, 2)
    4.59
    """

    front: float  # [m]
    rear: float  # [m]
    max_articulation: float  # [rad]
    max_articulation_rate: float  # [rad/s]
    max_speed: float  # [m/s]
    min_speed: float | None = None  # [m/s]
    steering_at_rest: float = 0.0  # [1/rad]
    name: ClassVar[str] = "articulated_vehicle"
    control_names: ClassVar[tuple[str, ...]] = ("speed", "articulation_rate")
    reduced_names: ClassVar[tuple[str, ...]] = ("articulation",)
    part_names: ClassVar[tuple[str, ...]] = ("rear_part",)

    def steered(self, states: Array, controls: Array) -> tuple[Array, Array]:
        """Speeds between samples (n - 1,), which the control holds, and angles at them (n,)."""
        return np.abs(controls[:-1, 0]), states[:, 0]

    @property
    def turning_radius(self) -> float:
        """Radius of the tightest circle of the front axle [m]."""
        bent = self.max_articulation
        return (self.front * math.cos(bent) + self.rear) / math.sin(bent)

    def velocity(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Components of the twist: (speed, 0, turn rate of the front part)."""
        along = self.front * np.cos(z[0]) + self.rear
        return u[0], 0.0, (u[0] * np.sin(z[0]) + self.rear * u[1]) / along

    def dynamics(self, z: Components, u: Components, /) -> tuple[Any, ...]:
        """Rate of [articulation]: the control."""
        return (u[1],)

    def part_frames(self, z: Components, /) -> tuple[tuple[Any, Any, Any], ...]:
        """Components of the pose of the rear part: back to the joint, turned, back to its axle."""
        back, aside = self.rear * np.cos(z[0]), self.rear * np.sin(z[0])
        return ((-self.front - back, aside, -z[0]),)
